//! The parameters, and what is known of them beforehand: their spread, and zeros that are off and drift.

use crate::{Cylinder, Fluid, PerLeak, Real, SensorSpread, Sensors};

/// Parameters that are leaks.
pub(super) const LEAKS: usize = 3;

/// Place of a leak, in the order of [`Leak::ALL`](crate::Leak::ALL), among the parameters.
#[inline]
pub(super) const fn leak_column(leak: usize) -> usize {
    Parameter::Internal as usize + leak
}

/// Parameters of [`Rls`](super::Rls) in their fixed order: an estimator of N parameters has the first N.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(rename_all = "snake_case"))]
pub enum Parameter {
    /// 1/β.
    Compressibility,
    /// C_ip.
    Internal,
    /// C_epA.
    ExternalA,
    /// C_epB.
    ExternalB,
    /// Offset of flow meter A.
    OffsetA,
    /// Offset of flow meter B.
    OffsetB,
    /// Scale error of flow meter A.
    GainA,
    /// Scale error of flow meter B.
    GainB,
    /// Scale error of the position sensor.
    GainPosition,
}

impl Parameter {
    /// All, in order.
    pub const ALL: [Self; 9] = [
        Self::Compressibility,
        Self::Internal,
        Self::ExternalA,
        Self::ExternalB,
        Self::OffsetA,
        Self::OffsetB,
        Self::GainA,
        Self::GainB,
        Self::GainPosition,
    ];
}

/// Prior standard deviation of each parameter, SI; of the offsets only the unit that they are counted in
/// ([`OffsetPrior`] has their covariance). A leak that would empty the cylinder in a tenth of a
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
    use super::*;
    use nalgebra::Matrix2;

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

    /// Of both chambers, by the meter's own and by what the pressures' drift drives through its leaks.
    #[test]
    fn offsets_move_with_their_own_meters_and_leaks() {
        let mut sensors = Sensors::<f64>::paper();
        (sensors.flow_a.bias_std, sensors.flow_b.bias_std) = (2e-6, 4e-6);
        (sensors.flow_a.drift_std_ph, sensors.flow_b.drift_std_ph) = (3e-6, 1e-6);
        (sensors.pressure.bias_std, sensors.pressure.drift_std_ph) = (9e4, 1e5);
        let cylinder = Cylinder::<f64>::paper();
        let mut zeros = Zeros::of(&sensors);
        // A leak that empties the cylinder in 20 s at 1 MPa, at 0.09 MPa.
        let through = 0.09 * cylinder.area_a_m2 * cylinder.stroke_m / 20.0;
        let units = offset_units(&cylinder, &zeros);
        for (unit, of_meter) in units.into_iter().zip([13e-12, 17e-12]) {
            assert!((unit * unit / (of_meter + through * through) - 1.0).abs() < 1e-12);
        }
        let leaks = PerLeak { internal: 1e-11, external_a: 2e-12, external_b: 5e-12 };
        let moved = zeros.advance(HOUR_S, &cylinder, &leaks);
        let expected = [9e-12 + 1.44e-12 + 1e-12, 1e-12 + 2.25e-12 + 1e-12];
        for side in 0..2 {
            assert!((moved[side] * units[side] * units[side] / expected[side] - 1.0).abs() < 1e-12);
        }
    }

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
