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
            flow_a_m3s: sensors.flow_a.noise_std.max(flow_floor),
            flow_b_m3s: sensors.flow_b.noise_std.max(flow_floor),
            pressure_pa: sensors.pressure.noise_std.max(T::one()),
            position_m: sensors.position.noise_std.max(millionth * cylinder.stroke_m),
        }
    }

    /// Variance of a chamber equation's error: flow noise, and the chamber's own and the other's
    /// pressure noise through the leaks.
    pub fn chamber_variance(&self, flow_std: T, own: T, cross: T) -> T {
        flow_std * flow_std + self.pressure_pa * self.pressure_pa * (own * own + cross * cross)
    }
}
