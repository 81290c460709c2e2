use crate::{Cylinder, Real, Sensors};

/// Standard deviations of the sensors' white noise, kept above zero.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct NoiseStd<T> {
    pub flow_a_m3s: T,
    pub flow_b_m3s: T,
    pub pressure_pa: T,
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::SensorSpread;

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
}
