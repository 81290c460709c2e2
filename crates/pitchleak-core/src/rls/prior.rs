use crate::{Cylinder, Fluid, Real, Sensors};

/// Prior standard deviation of each parameter, SI. A leak that would empty the cylinder in a tenth of a
/// second at 1 MPa is the widest that anyone could overlook.
pub(super) fn prior_spread<T: Real, const N: usize>(
    cylinder: &Cylinder<T>,
    fluid: &Fluid<T>,
    sensors: &Sensors<T>,
) -> [T; N] {
    let tiny = T::lit(1e-9);
    let leak = cylinder.area_a_m2 * cylinder.stroke_m * T::lit(1e-5);
    let relative = (fluid.bulk_modulus_std_pa / fluid.bulk_modulus_pa).max(T::lit(1e-6));
    let flow_floor = tiny * cylinder.area_a_m2 * cylinder.stroke_m;
    // A biased pressure drives a leak a little more or less all the time, which looks like an offset of the
    // flow meter: a leak that empties the cylinder in 20 s at 1 MPa is the usual worst.
    let through_leak = cylinder.area_a_m2 * cylinder.stroke_m * T::lit(5e-8) * sensors.pressure.bias_std;
    let offset = |bias: T| bias.libm_hypot(through_leak).max(flow_floor);
    let all = [
        relative / fluid.bulk_modulus_pa,
        leak,
        leak,
        leak,
        offset(sensors.flow_a.bias_std),
        offset(sensors.flow_b.bias_std),
        sensors.flow_a.gain_std.max(tiny),
        sensors.flow_b.gain_std.max(tiny),
        sensors.position.gain_std.max(tiny),
    ];
    let mut spread = [T::zero(); N];
    for (s, value) in spread.iter_mut().zip(all) {
        *s = value;
    }
    spread
}
