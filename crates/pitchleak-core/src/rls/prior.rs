use super::zeros::Zeros;
use crate::{Cylinder, Fluid, Real, Sensors};

/// Prior standard deviation of each parameter, SI; of the offsets only the unit that they are counted in
/// ([`OffsetPrior`](super::offset_prior::OffsetPrior) has their covariance). A leak that would empty the cylinder in a tenth of a
/// second at 1/800 of the bulk modulus, 1 MPa with the paper's oil, is the widest that anyone could overlook: said so, it
/// does not depend on units.
pub(super) fn prior_spread<T: Real, const N: usize>(
    cylinder: &Cylinder<T>,
    fluid: &Fluid<T>,
    sensors: &Sensors<T>,
) -> [T; N] {
    let tiny = T::lit(1e-9);
    let leak = cylinder.area_a_m2 * cylinder.stroke_m * T::lit(8e3) / fluid.bulk_modulus_pa;
    let relative = (fluid.bulk_modulus_std_pa / fluid.bulk_modulus_pa).at_least(T::lit(1e-6));
    let [offset_a, offset_b] = offset_units(cylinder, &Zeros::of(sensors));
    let all = [
        relative / fluid.bulk_modulus_pa,
        leak,
        leak,
        leak,
        offset_a,
        offset_b,
        sensors.flow_a.gain_std.at_least(tiny),
        sensors.flow_b.gain_std.at_least(tiny),
        sensors.position.gain_std.at_least(tiny),
    ];
    let mut spread = [T::zero(); N];
    for (s, value) in spread.iter_mut().zip(all) {
        *s = value;
    }
    spread
}

/// Units of the offsets of chambers A and B, m³/s: the meter's bias and what it drifts in an hour, and what the pressures' bias drives
/// through a leak that empties the cylinder in 20 s at 1 MPa.
#[cfg_attr(target_os = "none", inline(never))] // once in the flash, not for each caller
pub(super) fn offset_units<T: Real>(cylinder: &Cylinder<T>, zeros: &Zeros<T>) -> [T; 2] {
    let volume = cylinder.area_a_m2 * cylinder.stroke_m;
    let through_leak = volume * T::lit(5e-8) * zeros.pressure.bias_std;
    [zeros.flow_a, zeros.flow_b].map(|meter| {
        let (bias, drift) = (meter.bias_std, meter.drift_std_ph);
        let together = bias * bias + drift * drift + through_leak * through_leak;
        together.sqrt().at_least(T::lit(1e-9) * volume)
    })
}

#[cfg(test)]
mod tests {
    use super::prior_spread;
    use crate::{Cylinder, Fluid, Sensors};

    #[test]
    fn the_widest_leak_empties_the_cylinder_in_a_tenth_of_a_second_at_1_mpa() {
        let cylinder = Cylinder::<f64>::paper();
        let [_, internal, external_a, external_b] =
            prior_spread(&cylinder, &Fluid::paper(), &Sensors::paper());
        for leak_m3spa in [internal, external_a, external_b] {
            let lost_m3 = leak_m3spa * 1e6 * 0.1;
            assert!((lost_m3 / (cylinder.area_a_m2 * cylinder.stroke_m) - 1.0).abs() < 1e-12);
        }
    }
}
