use super::prior::offset_units;
use crate::{Cylinder, PerLeak, Real, SensorSpread, Sensors};

const HOUR_S: f64 = 3600.0;

/// How far a sensor's zero may be off, 1 σ.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Zero<T> {
    /// At the beginning.
    pub bias_std: T,
    /// By what it drifts in an hour.
    pub drift_std_ph: T,
}

/// The zeros that leave offsets in the continuity equations, and how far they have drifted.
///
/// A zero that drifts steadily by D an hour (1 σ) is D t/h off after the time t. It is followed as a random walk with that
/// variance at every time, so that it may turn; after the first hour the walk is as wide in each hour.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Zeros<T> {
    pub flow_a: Zero<T>,
    pub flow_b: Zero<T>,
    pub pressure: Zero<T>,
    elapsed_s: T,
}

impl<T: Real> Zeros<T> {
    pub fn of(sensors: &Sensors<T>) -> Self {
        let zero =
            |sensor: &SensorSpread<T>| Zero { bias_std: sensor.bias_std, drift_std_ph: sensor.drift_std_ph };
        Self {
            flow_a: zero(&sensors.flow_a),
            flow_b: zero(&sensors.flow_b),
            pressure: zero(&sensors.pressure),
            elapsed_s: T::zero(),
        }
    }

    /// `time_s` passes. Variances by which the offsets of chambers A and B have moved in it, in units of
    /// [`offset_units`]: the meters' own drift, and the pressures' through the leaks found.
    pub fn advance(&mut self, time_s: T, cylinder: &Cylinder<T>, leaks_m3spa: &PerLeak<T>) -> [T; 2] {
        let before = self.share();
        self.elapsed_s += time_s;
        let share = self.share() - before;
        let [unit_a, unit_b] = offset_units(cylinder, self);
        let internal = leaks_m3spa.internal;
        let pressure = self.pressure.drift_std_ph;
        let moved = |meter: &Zero<T>, external: T, unit: T| {
            let own = meter.drift_std_ph / unit;
            let (from_own, from_other) =
                ((internal + external) * pressure / unit, internal * pressure / unit);
            share * (own * own + from_own * from_own + from_other * from_other)
        };
        [
            moved(&self.flow_a, leaks_m3spa.external_a, unit_a),
            moved(&self.flow_b, leaks_m3spa.external_b, unit_b),
        ]
    }

    /// The same with biases as wide as drift has made them by now.
    pub fn now(&self) -> Self {
        let share = self.share();
        let wider = |zero: Zero<T>| {
            let (bias, drift) = (zero.bias_std, zero.drift_std_ph);
            Zero { bias_std: (bias * bias + share * drift * drift).sqrt(), ..zero }
        };
        Self {
            flow_a: wider(self.flow_a),
            flow_b: wider(self.flow_b),
            pressure: wider(self.pressure),
            ..*self
        }
    }

    /// Variance of a drift since the beginning, in units of an hour's.
    fn share(&self) -> T {
        let hours = self.elapsed_s / T::lit(HOUR_S);
        if hours <= T::one() { hours * hours } else { T::lit(2.0) * hours - T::one() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_zero_moves_as_far_as_is_declared() {
        let mut sensors = Sensors::<f64>::paper();
        sensors.flow_a.drift_std_ph = 3e-6;
        sensors.pressure.drift_std_ph = 1e5;
        let (cylinder, leaks) =
            (Cylinder::paper(), PerLeak { internal: 1e-11, external_a: 2e-12, external_b: 0.0 });
        let mut zeros = Zeros::of(&sensors);
        let moved: f64 = (0..7200).map(|_| zeros.advance(0.25, &cylinder, &leaks)[0]).sum();
        let [unit, _] = offset_units(&cylinder, &zeros);
        let through_leaks = (1.2e-11 * 1e5_f64).powi(2) + (1e-11 * 1e5_f64).powi(2);
        let expected = 0.25 * (9e-12 + through_leaks);
        assert!((moved * unit * unit / expected - 1.0).abs() < 1e-9);
        let widened = zeros.now();
        assert!((widened.flow_a.bias_std / 1.5e-6 - 1.0).abs() < 1e-12);
        assert_eq!(widened.flow_b, zeros.flow_b);
    }
}
