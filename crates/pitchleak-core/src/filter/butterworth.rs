use crate::Real;

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
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum FilterError {
    /// The sample rate is not positive and finite.
    SampleRate,
    /// The cut-off is not above zero and below half the sample rate.
    Cutoff,
}

impl core::fmt::Display for FilterError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str(match self {
            Self::SampleRate => "the sample rate must be positive",
            Self::Cutoff => "the cut-off must lie above zero and below half the sample rate",
        })
    }
}

impl core::error::Error for FilterError {}

impl<T: Real> Butterworth<T> {
    /// A filter at rest at zero. `cutoff_hz` must lie between zero and half of `sample_rate_hz`.
    pub fn new(cutoff_hz: T, sample_rate_hz: T) -> Result<Self, FilterError> {
        if !(sample_rate_hz.is_finite() && sample_rate_hz > T::zero()) {
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

#[cfg(test)]
mod tests {
    use super::{Butterworth, FilterError};

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
}
