//! The sensors' white noise: as declared, and as the readings show it.

use crate::{Cylinder, Real, Sensors};

/// Standard deviations of the sensors' white noise, kept above zero.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct NoiseStd<T> {
    /// Flow meter of chamber A, m³/s.
    pub flow_a_m3s: T,
    /// Flow meter of chamber B, m³/s.
    pub flow_b_m3s: T,
    /// Both pressure sensors, Pa.
    pub pressure_pa: T,
    /// Position sensor, m.
    pub position_m: T,
}

impl<T: Real> NoiseStd<T> {
    /// A perfect sensor does not exist: its resolution is at least a millionth of the range.
    pub fn of(sensors: &Sensors<T>, cylinder: &Cylinder<T>) -> Self {
        let millionth = T::lit(1e-6);
        let flow_floor = millionth * cylinder.area_a_m2 * cylinder.stroke_m;
        Self {
            flow_a_m3s: sensors.flow_a.noise_std.at_least(flow_floor),
            flow_b_m3s: sensors.flow_b.noise_std.at_least(flow_floor),
            pressure_pa: sensors.pressure.noise_std.at_least(T::one()),
            position_m: sensors.position.noise_std.at_least(millionth * cylinder.stroke_m),
        }
    }

    /// Variance of a chamber equation's error: flow noise, and the chamber's own and the other's
    /// pressure noise through the leaks.
    pub fn chamber_variance(&self, flow_std: T, own: T, cross: T) -> T {
        flow_std * flow_std + self.pressure_pa * self.pressure_pa * (own * own + cross * cross)
    }
}

/// Variance of both pressure sensors' white noise from second differences of the signal, which cancel its slope:
/// E (p₂ − 2 p₁ + p₀)² = 6 σ² (von Neumann et al. 1941 use first differences).
#[derive(Clone, Copy, Debug, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct PressureNoise<T> {
    last_rise: Option<[T; 2]>,
    sum: [T; 2],
    count: T,
}

impl<T: Real> PressureNoise<T> {
    /// Takes in a step from the pressures A and B `before` to those `now`, Pa; steps are of equal length.
    #[inline]
    pub fn add(&mut self, before: [T; 2], now: [T; 2]) {
        let rise = [now[0] - before[0], now[1] - before[1]];
        let Some(last) = &mut self.last_rise else {
            self.last_rise = Some(rise);
            return;
        };
        let keep = T::lit(0.999);
        for i in 0..2 {
            let second = rise[i] - last[i];
            self.sum[i] = keep * self.sum[i] + second * second;
        }
        self.count = keep * self.count + T::one();
        *last = rise;
    }

    /// A gap: the next difference starts anew.
    pub fn interrupt(&mut self) {
        self.last_rise = None;
    }

    /// Variances, Pa².
    pub fn variance_pa2(&self) -> [T; 2] {
        let variance = |sum: T| sum / (T::lit(6.0) * self.count);
        if self.count > T::zero() { self.sum.map(variance) } else { [T::zero(); 2] }
    }
}

/// Mean size of a third difference of white noise of unit standard deviation: √(20 · 2/π).
const THIRD_DIFFERENCE: f64 = 3.568_248_232;

/// Mean size of the third differences of a channel's readings.
#[derive(Clone, Copy, Debug, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Scatter<T> {
    last: [T; 3],
    known: u32,
    sum: T,
    count: T,
}

impl<T: Real> Scatter<T> {
    /// Takes in the next reading.
    pub fn add(&mut self, reading: Option<T>, after_gap: bool) {
        if after_gap {
            self.known = 0;
        }
        let Some(now) = reading else { return };
        let [one, two, three] = self.last;
        if self.known >= 3 {
            self.sum += (now - T::lit(3.0) * (one - two) - three).abs();
            self.count += T::one();
        }
        self.last = [now, one, two];
        self.known = self.known.saturating_add(1);
    }

    /// Standard deviation of their white noise; none of fewer than four.
    pub fn std(&self) -> Option<T> {
        (self.count > T::zero()).then(|| self.sum / (self.count * T::lit(THIRD_DIFFERENCE)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::SensorSpread;
    use pitchleak_testkit::white_noise;

    /// Each has its floor: a millionth of a stroke's oil in a second, 1 Pa, a millionth of the stroke.
    #[test]
    fn a_perfect_sensor_has_its_resolution() {
        let none = SensorSpread { noise_std: 0.0, bias_std: 0.0, gain_std: 0.0, drift_std_ph: 0.0 };
        let sensors = Sensors { flow_a: none, flow_b: none, pressure: none, position: none, force: none };
        let cylinder = Cylinder { area_a_m2: 2e-3, stroke_m: 0.5, ..Cylinder::paper() };
        let NoiseStd { flow_a_m3s, flow_b_m3s, pressure_pa, position_m } = NoiseStd::of(&sensors, &cylinder);
        let floors: [(f64, f64); 4] =
            [(flow_a_m3s, 1e-9), (flow_b_m3s, 1e-9), (pressure_pa, 1.0), (position_m, 5e-7)];
        for (found, floor) in floors {
            assert!((found / floor - 1.0).abs() < 1e-12, "{found} {floor}");
        }
    }

    /// White noise on a slope: the slope cancels, the noise is read as large as it is.
    #[test]
    fn the_meter_reads_the_noise_and_not_the_slope() {
        let (std_pa, slope_pa) = (5e4, 1e3);
        let mut meter = PressureNoise::default();
        let mut before = 0.0;
        let mut readings = [0.0; 40];
        let mut noise = white_noise(1).enumerate();
        for reading in &mut readings {
            // A few times the meter's memory of a thousand samples.
            for (k, unit) in noise.by_ref().take(3000) {
                let now = slope_pa * k as f64 + std_pa * unit;
                meter.add([before, 0.0], [now, 0.0]);
                before = now;
            }
            *reading = meter.variance_pa2()[0].sqrt() / std_pa;
        }
        let mean = readings.iter().sum::<f64>() / readings.len() as f64;
        assert!((mean - 1.0).abs() < 0.02, "{mean} of the noise");
    }

    #[test]
    fn of_no_second_difference_no_noise_is_known() {
        let mut meter = PressureNoise::default();
        meter.add([0.0; 2], [1e5, 2e5]);
        assert!(meter.variance_pa2().iter().all(|variance: &f64| variance.abs() < 1e-12));
    }

    fn scatter(readings: impl Iterator<Item = f64>) -> Option<f64> {
        let mut scatter = Scatter::default();
        readings.for_each(|reading| scatter.add(Some(reading), false));
        scatter.std()
    }

    /// A motion of constant acceleration has none, white noise its own.
    #[test]
    fn scatter_is_of_the_noise_and_not_of_the_motion() {
        let parabola = |k: u32| 4.0 + 0.5 * f64::from(k) + 0.25 * f64::from(k * k);
        assert_eq!(scatter((0..50).map(parabola)), Some(0.0));
        let found = scatter((0..).map(parabola).zip(white_noise(3)).take(20_000).map(|(m, n)| m + 5.0 * n));
        assert!((found.unwrap() / 5.0 - 1.0).abs() < 0.03, "{found:?}");
    }

    /// It is told from four readings in a row, with no gap between them; one that is missing is none.
    #[test]
    fn scatter_takes_four_readings_in_a_row() {
        let jump = |k: u32| if k < 3 { 0.0 } else { 1.0 };
        assert_eq!(scatter((0..3).map(jump)), None);
        assert!(scatter((0..4).map(jump)).unwrap() > 0.0);
        let mut after_gap = Scatter::default();
        (0..6).for_each(|k| after_gap.add(Some(jump(k)), k == 3));
        assert_eq!(after_gap.std(), None);
        after_gap.add(None, false);
        after_gap.add(Some(1.0), false);
        assert_eq!(after_gap.std(), Some(0.0));
    }
}
