//! Filters of one signal, and the two that the force balance needs: momentum and load.

use crate::{Cylinder, Real, Sample};

/// Second-order Butterworth low-pass, one sample at a time: the filter the paper puts on every
/// signal (Section IV, 5 Hz at 100 Hz).
///
/// Bilinear transform with the cut-off prewarped (Oppenheim and Schafer, "Discrete-Time Signal
/// Processing", §7.1), so the gain is 1/√2 at `cutoff_hz` exactly; transposed direct form II.
///
/// A reading that is not finite, or so large that the output would overflow, is passed over: the
/// filter repeats its last output and goes on from the last good reading.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Butterworth<T> {
    b0: T,
    a1: T,
    a2: T,
    memory: [T; 2],
    output: T,
}

/// Error returned by [`Butterworth::new`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum FilterError {
    /// The sample rate is not positive and finite.
    #[error("the sample rate must be positive")]
    SampleRate,
    /// The cut-off is not above zero and below half the sample rate.
    #[error("the cut-off must lie above zero and below half the sample rate")]
    Cutoff,
}

impl<T: Real> Butterworth<T> {
    /// A filter at rest at zero. `cutoff_hz` must lie between zero and half of `sample_rate_hz`.
    pub fn new(cutoff_hz: T, sample_rate_hz: T) -> Result<Self, FilterError> {
        if !sample_rate_hz.is_positive() {
            return Err(FilterError::SampleRate);
        }
        let share = cutoff_hz / sample_rate_hz;
        if !(share > T::zero() && share < T::lit(0.5)) {
            return Err(FilterError::Cutoff);
        }
        let one = T::one();
        let warped = (T::lit(core::f64::consts::PI) * share).libm_tan();
        let square = warped * warped;
        let damping = T::lit(core::f64::consts::SQRT_2) * warped;
        let scale = one / (one + damping + square);
        let b0 = square * scale;
        let a2 = (one - damping + square) * scale;
        // a1 from the others, so that the gain at zero frequency is one to rounding.
        let a1 = T::lit(4.0) * b0 - one - a2;
        Ok(Self { b0, a1, a2, memory: [T::zero(); 2], output: T::zero() })
    }

    /// Puts the filter into the steady state of a constant `value`; ignored unless finite.
    pub fn reset(&mut self, value: T) {
        if value.is_finite() {
            let second = (self.b0 - self.a2) * value;
            let first = (self.b0 + self.b0 - self.a1) * value + second;
            self.memory = [first, second];
            self.output = value;
        }
    }

    /// Takes one reading and gives the filtered value.
    #[inline]
    pub fn update(&mut self, value: T) -> T {
        let [first, second] = self.memory;
        let weighted = self.b0 * value;
        let output = weighted + first;
        let next = [weighted + weighted - self.a1 * output + second, weighted - self.a2 * output];
        let [next_first, next_second] = next;
        if output.is_finite() && next_first.is_finite() && next_second.is_finite() {
            self.memory = next;
            self.output = output;
        }
        self.output
    }

    /// The last output.
    #[inline]
    pub fn output(&self) -> T {
        self.output
    }
}

/// Parabola through a signal by discounted least squares: value, slope and curvature at the newest sample,
/// older samples weighted by exp(−age/memory).
///
/// The recursive form has gains that do not change (N. Morrison 1969, Introduction to Sequential Smoothing and
/// Prediction, ch. 13; E. Brookner 1998, Tracking and Kalman Filtering Made Easy, §1.3, "critically
/// damped g-h-k filter"). Exact on a parabola, without lag.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct FadingMemoryFilter<T> {
    memory_s: T,
    value: T,
    slope: T,
    curvature: T,
    started: bool,
}

impl<T: Real> FadingMemoryFilter<T> {
    /// With a memory of `memory_s` seconds.
    pub fn new(memory_s: T) -> Self {
        Self { memory_s, value: T::zero(), slope: T::zero(), curvature: T::zero(), started: false }
    }

    /// Takes a reading `dt_s` after the one before; a step that is not positive starts anew.
    pub fn update(&mut self, dt_s: T, reading: T) -> &Self {
        if !self.started || dt_s <= T::zero() {
            *self = Self { value: reading, started: true, ..Self::new(self.memory_s) };
            return self;
        }
        let half = T::lit(0.5);
        let discount = (-dt_s / self.memory_s).libm_exp();
        let fresh = T::one() - discount;
        let slope = self.slope + dt_s * self.curvature;
        let value = self.value + dt_s * (self.slope + half * dt_s * self.curvature);
        let error = reading - value;
        self.value = value + (T::one() - discount.powi(3)) * error;
        self.slope = slope + T::lit(1.5) * fresh * fresh * (T::one() + discount) * error / dt_s;
        self.curvature += fresh.powi(3) * error / (dt_s * dt_s);
        self
    }

    /// The signal now.
    pub fn value(&self) -> T {
        self.value
    }

    /// Its first derivative, per s.
    pub fn slope(&self) -> T {
        self.slope
    }

    /// Its second derivative, per s².
    pub fn curvature(&self) -> T {
        self.curvature
    }
}

/// Load force F from eq. (2) by least squares, for a trace without a force column (paper, Section II after
/// eq. 14): F = P_A A_A − P_B A_B − m ẍ.
///
/// ẍ is the curvature of the [`FadingMemoryFilter`] through the positions; the hydraulic force is smoothed by
/// the same filter, so that both sides lag alike.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct LoadEstimator<T> {
    position: FadingMemoryFilter<T>,
    force: FadingMemoryFilter<T>,
}

impl<T: Real> LoadEstimator<T> {
    /// With a memory of `memory_s` seconds.
    pub fn new(memory_s: T) -> Self {
        let filter = FadingMemoryFilter::new(memory_s);
        Self { position: filter, force: filter }
    }

    /// Takes a reading `dt_s` after the one before; returns the load F, N, against extension.
    pub fn update(&mut self, cylinder: &Cylinder<T>, dt_s: T, sample: &Sample<T>) -> T {
        let acceleration = self.position.update(dt_s, sample.x_m).curvature();
        let force = self.force.update(dt_s, hydraulic_force_n(cylinder, sample)).value();
        force - cylinder.moving_mass_kg * acceleration
    }
}

/// ∫ (P_A A_A − P_B A_B − F) dt of f5, kept from drifting.
///
/// The integral is the momentum m ẋ, eq. (14), so its own integral is m (x − x₀), which the position sensor
/// measures. An observer of second order integrates the imbalance and pulls the result to the measured
/// position:
///
/// ```text
/// dx̂/dt = p̂/m + 2 ζ ω (x − x̂)        dp̂/dt = imbalance + m ω² (x − x̂)
/// ```
///
/// Above ω the imbalance decides, below it the position: a constant error ε of the imbalance gives a bounded
/// error 2 ζ ε/ω of p̂ instead of a ramp, and on exact data p̂ = m ẋ for every ω (Luenberger observer with a
/// double pole; complementary filter). The step is implicit, hence stable for every dt.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Momentum<T> {
    bandwidth_rad_s: T,
    mass_kg: T,
    position_m: T,
    momentum_n_s: T,
    started: bool,
}

impl<T: Real> Momentum<T> {
    /// At rest, with the bandwidth ω in rad/s.
    pub fn new(mass_kg: T, bandwidth_rad_s: T) -> Self {
        Self { bandwidth_rad_s, mass_kg, position_m: T::zero(), momentum_n_s: T::zero(), started: false }
    }

    /// Takes the imbalance over the step `dt_s` and the position at its end; returns the momentum, N·s.
    pub fn update(&mut self, dt_s: T, imbalance_n: T, x_m: T) -> T {
        if !self.started {
            self.started = true;
            self.position_m = x_m;
            return self.momentum_n_s;
        }
        let w = self.bandwidth_rad_s;
        let (h, m) = (dt_s, self.mass_kg);
        // Backward Euler of both equations, solved for the position error e = x − x̂ at the new time.
        let free = self.position_m + h * (self.momentum_n_s + h * imbalance_n) / m;
        let error = (x_m - free) / (T::one() + T::lit(2.0) * w * h + w * w * h * h);
        self.momentum_n_s += h * (imbalance_n + m * w * w * error);
        self.position_m = x_m - error;
        self.momentum_n_s
    }

    /// A gap: the piston is where it is read, the momentum as last known.
    pub fn restart(&mut self, x_m: T) {
        self.position_m = x_m;
    }
}

/// P_A A_A − P_B A_B − F, N: what accelerates the mass, eq. (2).
pub fn force_imbalance_n<T: Real>(cylinder: &Cylinder<T>, sample: &Sample<T>, load_n: T) -> T {
    hydraulic_force_n(cylinder, sample) - load_n
}

/// P_A A_A − P_B A_B, N.
fn hydraulic_force_n<T: Real>(cylinder: &Cylinder<T>, sample: &Sample<T>) -> T {
    sample.pa_pa * cylinder.area_a_m2 - sample.pb_pa * cylinder.area_b_m2
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Steady amplitude of the response to a unit sine.
    fn gain(cutoff_hz: f64, rate_hz: f64, frequency_hz: f64) -> f64 {
        let mut filter = Butterworth::new(cutoff_hz, rate_hz).unwrap();
        let (mut sine, mut cosine) = (0.0, 0.0);
        let samples = rate_hz as usize * 40;
        for i in 0..samples {
            let phase = core::f64::consts::TAU * frequency_hz * i as f64 / rate_hz;
            let y = filter.update(phase.sin());
            if i >= samples / 2 {
                sine += y * phase.sin();
                cosine += y * phase.cos();
            }
        }
        sine.hypot(cosine) * 4.0 / samples as f64
    }

    #[test]
    fn loses_3_db_at_the_cutoff_and_40_db_per_decade_above() {
        assert!((gain(5.0, 100.0, 5.0) - 0.5_f64.sqrt()).abs() < 1e-6);
        let decade = gain(1.0, 1000.0, 2.0) / gain(1.0, 1000.0, 20.0);
        let db = 20.0 * decade.log10();
        assert!((db - 40.0).abs() < 0.5, "{db} dB per decade");
    }

    #[test]
    fn starts_and_settles_without_a_jump() {
        let mut filter = Butterworth::new(5.0, 100.0).unwrap();
        filter.reset(7.0);
        for _ in 0..100 {
            assert!((filter.update(7.0) - 7.0_f64).abs() < 1e-12);
        }
        for _ in 0..1000 {
            filter.update(-3.0);
        }
        assert!((filter.output() + 3.0).abs() < 1e-12);
    }

    #[test]
    fn a_bad_reading_is_passed_over() {
        let mut filter = Butterworth::new(5.0_f64, 100.0).unwrap();
        filter.reset(2.0);
        for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, f64::MAX, -f64::MAX] {
            filter.update(bad);
            assert!(filter.output().is_finite());
        }
        for _ in 0..20_000 {
            filter.update(2.0);
        }
        assert!((filter.output() - 2.0).abs() < 1e-9, "{}", filter.output());
    }

    #[test]
    fn refuses_impossible_frequencies() {
        assert_eq!(Butterworth::new(5.0, f64::NAN), Err(FilterError::SampleRate));
        for cutoff in [0.0, -1.0, 50.0, f64::NAN, f64::INFINITY] {
            assert_eq!(Butterworth::new(cutoff, 100.0), Err(FilterError::Cutoff));
        }
    }

    #[test]
    fn finds_the_load_of_an_accelerating_piston() {
        let cylinder = Cylinder::<f64>::paper();
        let mut estimator = LoadEstimator::new(0.02);
        let mut load = 0.0;
        for k in 0..2000 {
            let t = f64::from(k) * 1e-3;
            let sample = Sample {
                x_m: 0.01 + 0.5 * 0.04 * t * t,
                pa_pa: (1500.0 + cylinder.moving_mass_kg * 0.04) / cylinder.area_a_m2,
                ..Sample::default()
            };
            load = estimator.update(&cylinder, 1e-3, &sample);
        }
        assert!((load - 1500.0).abs() < 1e-6, "{load} N");
    }

    /// A sinusoidal motion: the observer has to give m ẋ, and to bound the effect of a wrong load.
    #[test]
    fn follows_the_momentum_and_bounds_the_drift() {
        let (m, h, w) = (20.0, 1e-3, 10.0);
        for (wrong_n, bound) in [(0.0, 0.05), (5.0, 2.0 * 5.0 / w + 0.05)] {
            let mut momentum = Momentum::new(m, w);
            let mut worst: f64 = 0.0;
            for k in 0..60_000 {
                let t = f64::from(k) * h;
                let x = 0.1 + 0.02 * (3.0 * t).sin();
                let force = -m * 0.02 * 9.0 * (3.0 * t).sin();
                let p = momentum.update(h, force + wrong_n, x);
                if k > 5_000 {
                    worst = worst.max((p - m * 0.06 * (3.0 * t).cos()).abs());
                }
            }
            assert!(worst < bound, "{worst} N·s with {wrong_n} N of wrong load");
        }
    }
}
