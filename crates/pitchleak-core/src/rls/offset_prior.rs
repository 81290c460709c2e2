use super::zeros::Zeros;
use crate::{Cylinder, PerLeak, Real};

/// What is known beforehand of the two offsets that the continuity equations of a leaking cylinder show.
///
/// A meter that reads q too much and pressures that read b too much leave in eq. (1) of chambers A and B
/// the constant flows o = q − J b with J = [[C_ip + C_epA, −C_ip], [−C_ip, C_ip + C_epB]]: a biased pressure
/// drives a leak a little more all the time. So o has the covariance D + σ_P² J Jᵀ, D that of the
/// meters, and what is found of o tells in turn about b (Friedland 1969, separate-bias form).
///
/// Offsets are counted in their prior units, pressure biases in units of σ_P.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct OffsetPrior<T> {
    /// (D + J Jᵀ)⁻¹.
    pub information: [[T; 2]; 2],
    /// −Jᵀ (D + J Jᵀ)⁻¹: the pressure biases that go with the offsets found.
    pub pressure_per_offset: [[T; 2]; 2],
    /// 1 − Jᵀ (D + J Jᵀ)⁻¹ J: covariance of the pressure biases once the offsets are known.
    pub pressure_spread: [[T; 2]; 2],
}

impl<T: Real> OffsetPrior<T> {
    /// Of `zeros` as far off as they may be by now; `units` of the offsets, m³/s.
    #[cfg_attr(target_os = "none", inline(never))] // once in the flash, not for each caller
    pub fn new(
        cylinder: &Cylinder<T>,
        zeros: &Zeros<T>,
        [unit_a, unit_b]: [T; 2],
        leaks: &PerLeak<T>,
    ) -> Self {
        let floor = T::lit(1e-9) * cylinder.area_a_m2 * cylinder.stroke_m;
        let square = |bias: T, unit: T| (bias.at_least(floor) / unit) * (bias.at_least(floor) / unit);
        let (d_a, d_b) = (square(zeros.flow_a.bias_std, unit_a), square(zeros.flow_b.bias_std, unit_b));
        let (to_a, to_b) = (zeros.pressure.bias_std / unit_a, zeros.pressure.bias_std / unit_b);
        let c = leaks.internal;
        let j = [[(c + leaks.external_a) * to_a, -c * to_a], [-c * to_b, (c + leaks.external_b) * to_b]];
        let [[aa, ab], [ba, bb]] = j;
        let (size_a, size_b) = (aa * aa + ab * ab, ba * ba + bb * bb);
        let cross = aa * ba + ab * bb;
        // C_ip (C_epA + C_epB) + C_epA C_epB: written so that nothing cancels.
        let turn =
            (c * (leaks.external_a + leaks.external_b) + leaks.external_a * leaks.external_b) * to_a * to_b;
        let determinant = d_a * d_b + d_b * size_a + d_a * size_b + turn * turn;
        let over = T::one() / determinant;
        let information = [[(d_b + size_b) * over, -cross * over], [-cross * over, (d_a + size_a) * over]];
        let transposed = [[aa, ba], [ab, bb]];
        let pressure_per_offset = product(&transposed, &information).map(|row| row.map(|value| -value));
        let explained = product(&pressure_per_offset, &j);
        let pressure_spread = [
            [(T::one() + explained[0][0]).at_least(T::zero()), explained[0][1]],
            [explained[1][0], (T::one() + explained[1][1]).at_least(T::zero())],
        ];
        Self { information, pressure_per_offset, pressure_spread }
    }
}

fn product<T: Real>(a: &[[T; 2]; 2], b: &[[T; 2]; 2]) -> [[T; 2]; 2] {
    let [[a00, a01], [a10, a11]] = *a;
    let [[b00, b01], [b10, b11]] = *b;
    [[a00 * b00 + a01 * b10, a00 * b01 + a01 * b11], [a10 * b00 + a11 * b10, a10 * b01 + a11 * b11]]
}

#[cfg(test)]
mod tests {
    use super::super::prior::offset_units;
    use super::*;
    use crate::Sensors;
    use nalgebra::Matrix2;

    fn matrix(m: [[f64; 2]; 2]) -> Matrix2<f64> {
        Matrix2::new(m[0][0], m[0][1], m[1][0], m[1][1])
    }

    #[test]
    fn is_the_covariance_of_meters_and_pressures_together() {
        let cylinder = Cylinder::paper();
        let mut sensors = Sensors::paper();
        sensors.flow_a.bias_std = 2e-6;
        sensors.flow_b.bias_std = 3e-6;
        sensors.pressure.bias_std = 9e4;
        let zeros = Zeros::of(&sensors);
        let leaks = PerLeak { internal: 5e-11, external_a: 7e-12, external_b: 2e-12 };
        let prior = OffsetPrior::new(&cylinder, &zeros, offset_units(&cylinder, &zeros), &leaks);
        let unit = Matrix2::from_diagonal(&offset_units(&cylinder, &zeros).into());
        let j = Matrix2::new(5.7e-11, -5e-11, -5e-11, 5.2e-11) * 9e4;
        let meters = Matrix2::new(4e-12, 0.0, 0.0, 9e-12);
        let information = (meters + j * j.transpose()).try_inverse().unwrap();
        let near = |a: Matrix2<f64>, b: Matrix2<f64>| (a - b).norm() < 1e-9 * b.norm();
        assert!(near(matrix(prior.information), unit * information * unit));
        assert!(near(matrix(prior.pressure_per_offset), -j.transpose() * information * unit));
        let spread = Matrix2::identity() - j.transpose() * information * j;
        assert!(near(matrix(prior.pressure_spread), spread));
    }

    #[test]
    fn a_sound_cylinder_hides_its_pressure_biases() {
        let mut sensors = Sensors::<f64>::paper();
        sensors.flow_a.bias_std = 2e-6;
        sensors.flow_b.bias_std = 2e-6;
        sensors.pressure.bias_std = 9e4;
        let cylinder = Cylinder::paper();
        let zeros = Zeros::of(&sensors);
        let prior = OffsetPrior::new(&cylinder, &zeros, offset_units(&cylinder, &zeros), &PerLeak::default());
        let [unit, _] = offset_units(&cylinder, &zeros);
        assert!((prior.information[0][0] * (2e-6 / unit).powi(2) - 1.0).abs() < 1e-12);
        assert!(matrix(prior.pressure_per_offset).norm() < 1e-12);
        assert!((matrix(prior.pressure_spread) - Matrix2::identity()).norm() < 1e-12);
    }
}
