//! What the estimator has found so far, and what the data can tell: per parameter, whether this trace pins it down.

use super::prior::Parameter;
use super::rls::Rls;
use crate::{Estimate, LPM_PER_M3S, LeakPressures, PerLeak, Real};

/// All that an estimator has found.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Estimates<T> {
    /// Leak coefficients C_ip, C_epA, C_epB, m³/(s·Pa). A negative one is physically impossible and means that
    /// the model lacks an effect.
    pub leaks_m3spa: PerLeak<Estimate<T>>,
    /// How fast the leak coefficients change, m³/(s·Pa) per s. Leaks that stay have slopes of zero within their
    /// spread.
    pub leak_slopes_m3spa_ps: PerLeak<Estimate<T>>,
    /// Mean leak flows over the memory, m³/s, by eq. (15) at the mean pressures.
    pub mean_leaks_m3s: PerLeak<Estimate<T>>,
    /// Means of |P_L|, P_A, P_B over the memory as read, Pa.
    pub mean_pressures_pa: PerLeak<T>,
    /// Compressibility κ = 1/β, 1/Pa.
    pub compressibility_per_pa: Estimate<T>,
    /// Offsets of the flow meters A and B, m³/s (reading minus truth), apart from what biased pressures drive
    /// through the leaks. None where N < 6.
    pub flow_offsets_m3s: Option<[Estimate<T>; 2]>,
    /// Scale errors of flow meter A, flow meter B and the position sensor, as shares. None where N < 9.
    pub gains: Option<[Estimate<T>; 3]>,
    /// Biases of the pressure sensors A and B, Pa (reading minus truth), as far as the offsets found tell: a
    /// biased pressure drives a leak a little more all the time. Zero, as wide as declared, where N < 6.
    pub pressure_biases_pa: [Estimate<T>; 2],
    /// Normalised innovation squared of the balance and of the position equation: 1 where the declared noise and
    /// the model explain the data, above where they do not (Bar-Shalom, Li, Kirubarajan, Estimation with
    /// Applications to Tracking and Navigation, §5.4).
    pub normalised_innovation: [T; 2],
    /// What the samples identify, by the usual [`ExcitationSettings`].
    pub excitation: ExcitationReport<T>,
}

/// When a parameter counts as identified.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct ExcitationSettings<T> {
    /// A leak is identified once the 95 % interval of its flow is within ± this, m³/s …
    pub resolution_m3s: T,
    /// … at the mean pressure that drives it, or at this one if that is lower; Pa (a leak without pressure has
    /// no flow, and yet nothing is known of it) …
    pub least_pressure_pa: T,
    /// … or within ± this share of the flow itself.
    pub resolution_share: T,
    /// The bulk modulus is identified once its spread is below this share of its prior's.
    pub prior_share: T,
}

impl<T: Real> Default for ExcitationSettings<T> {
    /// 0.1 L/min, at 1 MPa or more, or a tenth of the leak; half the prior's spread (three quarters of what is known about
    /// the bulk modulus then comes from the trace).
    fn default() -> Self {
        Self {
            resolution_m3s: T::lit(0.1 / LPM_PER_M3S),
            least_pressure_pa: T::lit(1e6),
            resolution_share: T::lit(0.1),
            prior_share: T::lit(0.5),
        }
    }
}

impl<T: Real> ExcitationSettings<T> {
    /// Whether a leak's flow, m³/s, is known well enough to call it identified.
    pub fn resolves(&self, flow_m3s: &Estimate<T>) -> bool {
        flow_m3s.half_width95() <= self.resolution_m3s.at_least(self.resolution_share * flow_m3s.value.abs())
    }

    /// Whether the bulk modulus, or its inverse, is identified: its spread beside its prior's.
    pub fn learns(&self, std: T, prior_std: T) -> bool {
        std <= self.prior_share * prior_std
    }
}

/// What a trace tells about one parameter.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Excitation<T> {
    /// Whether the trace identifies the parameter.
    pub identifiable: bool,
    /// Share of the prior's variance that the trace took away, 0 (dead parameter) to 1 (pinned).
    pub variance_reduction: T,
    /// The parameter it trades off with (|correlation| above 0.95), if any: only their combination is
    /// known well.
    pub traded_with: Option<Parameter>,
}

/// What a trace tells about the four parameters of eq. (1).
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct ExcitationReport<T> {
    /// The three leak coefficients.
    pub leaks: PerLeak<Excitation<T>>,
    /// The bulk modulus.
    pub bulk_modulus: Excitation<T>,
}

const LEAKS: PerLeak<Parameter> = PerLeak {
    internal: Parameter::Internal,
    external_a: Parameter::ExternalA,
    external_b: Parameter::ExternalB,
};
const OFFSETS: [Parameter; 2] = [Parameter::OffsetA, Parameter::OffsetB];

impl<T: Real, const N: usize> Rls<T, N> {
    /// All that is known by now.
    pub fn estimates(&self) -> Estimates<T> {
        let pressures = self.pressures.means();
        Estimates {
            leaks_m3spa: self.leak_coefficients(),
            leak_slopes_m3spa_ps: self.leak_slopes(),
            mean_leaks_m3s: self.leak_flows_m3s(&pressures),
            mean_pressures_pa: pressures.sizes_pa,
            compressibility_per_pa: self.compressibility(),
            flow_offsets_m3s: (N > Parameter::OffsetB as usize).then(|| self.flow_offsets_m3s()),
            gains: (N > Parameter::GainPosition as usize).then(|| self.gains()),
            pressure_biases_pa: self.pressure_biases_pa(),
            normalised_innovation: self.normalised_innovation(),
            excitation: self.excitation(&ExcitationSettings::default()),
        }
    }

    /// Estimate of a parameter's deviation from its prior mean, SI; zero with no spread where N is too
    /// small to have it.
    fn parameter(&self, parameter: Parameter) -> Estimate<T> {
        let (mean, scale) = (entry(&self.solution.mean, parameter), entry(&self.scale, parameter));
        Estimate { value: mean * scale, std: self.covariance(parameter, parameter).sqrt() * scale }
    }

    /// Covariance of two parameters' errors, each in units of its prior's standard deviation; not below
    /// what the residuals show. Zero where N is too small to have them.
    pub fn covariance(&self, a: Parameter, b: Parameter) -> T {
        let row = self.solution.covariance.get(a as usize);
        let entry = row.and_then(|row| row.get(b as usize));
        entry.map_or(T::zero(), |entry| *entry * self.innovations.inflation())
    }

    /// [`Estimates::mean_leaks_m3s`] alone.
    pub fn mean_leaks_m3s(&self) -> PerLeak<Estimate<T>> {
        self.leak_flows_m3s(&self.pressures.means())
    }

    /// [`Estimates::leaks_m3spa`] alone.
    pub fn leak_coefficients(&self) -> PerLeak<Estimate<T>> {
        LEAKS.map(|leak| self.parameter(leak))
    }

    fn leak_slopes(&self) -> PerLeak<Estimate<T>> {
        let unit = self.leak_prior_std();
        let inflation = self.innovations.inflation();
        let [internal, external_a, external_b] = self.slopes_ps.map(|(mean, variance)| Estimate {
            value: mean * unit,
            std: (variance * inflation).sqrt() * unit,
        });
        PerLeak { internal, external_a, external_b }
    }

    fn compressibility(&self) -> Estimate<T> {
        let deviation = self.parameter(Parameter::Compressibility);
        Estimate { value: deviation.value + self.compressibility, std: deviation.std }
    }

    /// Leak coefficients, those below zero as none, m³/(s·Pa).
    pub(super) fn possible_leaks_m3spa(&self) -> PerLeak<T> {
        LEAKS.map(|leak| (self.solution.mean[leak as usize] * self.scale[leak as usize]).at_least(T::zero()))
    }

    fn flow_offsets_m3s(&self) -> [Estimate<T>; 2] {
        let (one, none) = (T::one(), T::zero());
        let leaks = self.possible_leaks_m3spa();
        let c = leaks.internal;
        [
            self.offset_sum([one, none], [c + leaks.external_a, -c]),
            self.offset_sum([none, one], [-c, c + leaks.external_b]),
        ]
    }

    fn gains(&self) -> [Estimate<T>; 3] {
        [
            of_reading(self.parameter(Parameter::GainA)),
            of_reading(self.parameter(Parameter::GainB)),
            self.parameter(Parameter::GainPosition),
        ]
    }

    /// [`Estimates::normalised_innovation`] alone.
    pub fn normalised_innovation(&self) -> [T; 2] {
        self.innovations.ratios()
    }

    /// Prior standard deviations of the leak coefficients, m³/(s·Pa).
    pub fn leak_prior_std(&self) -> T {
        self.scale[Parameter::Internal as usize]
    }

    /// [`Estimates::pressure_biases_pa`] alone.
    pub fn pressure_biases_pa(&self) -> [Estimate<T>; 2] {
        let (one, none) = (T::one(), T::zero());
        [[one, none], [none, one]].map(|shares| self.offset_sum([none, none], shares))
    }

    /// Weights of the offsets found in `flows`·offsets + `pressures`·biases (SI), m³/s or Pa per prior unit.
    fn per_offset(&self, [flow_a, flow_b]: [T; 2], [share_a, share_b]: [T; 2]) -> [T; 2] {
        let [[aa, ab], [ba, bb]] = self.offsets.pressure_per_offset;
        let bias_pa = self.zeros.now().pressure.bias_std;
        let [unit_a, unit_b] = OFFSETS.map(|offset| entry(&self.scale, offset));
        [
            flow_a * unit_a + bias_pa * (share_a * aa + share_b * ba),
            flow_b * unit_b + bias_pa * (share_a * ab + share_b * bb),
        ]
    }

    /// `flows`·offsets + `pressures`·biases, SI.
    fn offset_sum(&self, flows: [T; 2], pressures: [T; 2]) -> Estimate<T> {
        let [per_a, per_b] = self.per_offset(flows, pressures);
        let [a, b] = OFFSETS;
        let [mean_a, mean_b] = OFFSETS.map(|offset| entry(&self.solution.mean, offset));
        let found = per_a * per_a * self.covariance(a, a)
            + T::lit(2.0) * per_a * per_b * self.covariance(a, b)
            + per_b * per_b * self.covariance(b, b);
        let [[aa, ab], [ba, bb]] = self.offsets.pressure_spread;
        let [share_a, share_b] = pressures;
        let hidden = share_a * share_a * aa + share_a * share_b * (ab + ba) + share_b * share_b * bb;
        let bias_pa = self.zeros.now().pressure.bias_std;
        let variance = found.at_least(T::zero()) + bias_pa * bias_pa * hidden.at_least(T::zero());
        Estimate { value: per_a * mean_a + per_b * mean_b, std: variance.sqrt() }
    }

    /// Leak flows, m³/s, by eq. (15): coefficients times `pressures` as read, less the biases found. What a
    /// declared pressure bias leaves uncertain widens them.
    pub fn leak_flows_m3s(&self, pressures: &LeakPressures<T>) -> PerLeak<Estimate<T>> {
        let (one, none) = (T::one(), T::zero());
        let sign = pressures.load_sign;
        let sizes = pressures.sizes_pa;
        PerLeak {
            internal: self.leak_flow(Parameter::Internal, sizes.internal, [sign, -sign]),
            external_a: self.leak_flow(Parameter::ExternalA, sizes.external_a, [one, none]),
            external_b: self.leak_flow(Parameter::ExternalB, sizes.external_b, [none, one]),
        }
    }

    /// One leak at the pressure read, of which the biases make up `shares`.
    fn leak_flow(&self, leak: Parameter, pressure_pa: T, shares: [T; 2]) -> Estimate<T> {
        let none = [T::zero(), T::zero()];
        let bias = self.offset_sum(none, shares);
        let coefficient = self.parameter(leak);
        let pressure = pressure_pa - bias.value;
        let [per_a, per_b] = self.per_offset(none, shares);
        let [a, b] = OFFSETS.map(|offset| self.covariance(leak, offset));
        let together = entry(&self.scale, leak) * (per_a * a + per_b * b);
        let (own, through) = (coefficient.std * pressure, coefficient.value * bias.std);
        let variance = own * own + through * through - T::lit(2.0) * coefficient.value * pressure * together;
        Estimate { value: coefficient.value * pressure, std: variance.at_least(T::zero()).sqrt() }
    }

    /// Says for each parameter whether the samples so far identify it: identifiability as accumulated
    /// Fisher information against the prior.
    pub fn excitation(&self, settings: &ExcitationSettings<T>) -> ExcitationReport<T> {
        let one = |parameter: Parameter, identifiable: bool| Excitation {
            identifiable,
            variance_reduction: self.variance_reduction(parameter),
            traded_with: self.traded_with(parameter),
        };
        let pinned = self.leak_coefficients().zip(self.pressures.means().sizes_pa).map(|(leak, pressure)| {
            settings.resolves(&leak.scaled(pressure.at_least(settings.least_pressure_pa)))
        });
        let prior_std = self.scale[Parameter::Compressibility as usize];
        let learnt = settings.learns(self.compressibility().std, prior_std);
        ExcitationReport {
            leaks: PerLeak::from_fn(|leak| one(LEAKS[leak], pinned[leak])),
            bulk_modulus: one(Parameter::Compressibility, learnt),
        }
    }

    fn variance_reduction(&self, parameter: Parameter) -> T {
        (T::one() - self.covariance(parameter, parameter)).at_least(T::zero())
    }

    fn traded_with(&self, parameter: Parameter) -> Option<Parameter> {
        let own = self.covariance(parameter, parameter);
        let mut strongest = T::lit(0.95);
        let mut partner = None;
        for other in Parameter::ALL.into_iter().take(N) {
            if other == parameter {
                continue;
            }
            let scale = (own * self.covariance(other, other)).sqrt();
            let correlation = self.covariance(parameter, other).abs() / scale;
            if correlation > strongest {
                strongest = correlation;
                partner = Some(other);
            }
        }
        partner
    }
}

/// A parameter's own; zero where N is too small to have it.
fn entry<T: Real, const N: usize>(of_each: &[T; N], parameter: Parameter) -> T {
    of_each.get(parameter as usize).copied().unwrap_or(T::zero())
}

/// A share of the reading that is wrong, γ/(1 + γ), as a share of the truth, γ.
fn of_reading<T: Real>(share: Estimate<T>) -> Estimate<T> {
    let rest = T::one() - share.value;
    Estimate { value: share.value / rest, std: share.std / (rest * rest) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Cylinder, Fluid, RlsSettings, Sample, Sensors};
    use nalgebra::{Matrix2, Matrix3, Vector2, Vector3};

    /// Half a minute of a leaking cylinder whose meters and pressure sensors read too much.
    fn fed() -> Rls<f64, 6> {
        let mut sensors = Sensors::paper();
        sensors.flow_a.bias_std = 2e-6;
        sensors.flow_b.bias_std = 3e-6;
        sensors.pressure.bias_std = 9e4;
        let (cylinder, fluid) = (Cylinder::paper(), Fluid::paper());
        let mut rls = Rls::new(cylinder, fluid, &sensors, RlsSettings::default()).unwrap();
        for k in 0..3000 {
            let t = f64::from(k) * 0.01;
            let (pa, pb) = (5.5e6 + 1e6 * (1.3 * t).sin(), 4e6 + 8e5 * (0.7 * t).sin());
            let (x, v) = (0.1 + 0.03 * (0.9 * t).sin(), 0.027 * (0.9 * t).cos());
            let leak = 2e-11 * (pa - pb);
            let store_a = cylinder.volume_a_m3(x) / fluid.bulk_modulus_pa * 1.3e6 * (1.3 * t).cos();
            let store_b = cylinder.volume_b_m3(x) / fluid.bulk_modulus_pa * 5.6e5 * (0.7 * t).cos();
            let qa = cylinder.area_a_m2 * v + store_a + leak + 5e-12 * pa + 2e-6;
            let qb = -cylinder.area_b_m2 * v + store_b - leak + 3e-12 * pb - 1e-6;
            let (pa_pa, pb_pa) = (pa + 9e4, pb - 5e4);
            rls.update(
                0.01,
                &Sample { x_m: x, pa_pa, pb_pa, qa_m3s: Some(qa), qb_m3s: Some(qb), force_n: None },
            );
        }
        rls
    }

    /// Mean and covariance of the offsets found, prior units; biases per offset and what is hidden of them, Pa.
    fn offsets(rls: &Rls<f64, 6>) -> (Vector2<f64>, Matrix2<f64>, Matrix2<f64>, Matrix2<f64>) {
        let mean = OFFSETS.map(|o| rls.parameter(o).value / rls.scale[o as usize]);
        let covariance = Matrix2::from_fn(|i, j| rls.covariance(OFFSETS[i], OFFSETS[j]));
        let bias_pa = rls.zeros.pressure.bias_std;
        let per_offset = rls.offsets.pressure_per_offset;
        let hidden = rls.offsets.pressure_spread;
        (
            mean.into(),
            covariance,
            Matrix2::from_fn(|i, j| per_offset[i][j]) * bias_pa,
            Matrix2::from_fn(|i, j| hidden[i][j]) * bias_pa * bias_pa,
        )
    }

    fn assert_near(found: Estimate<f64>, value: f64, variance: f64) {
        assert!((found.value - value).abs() < 1e-9 * value.abs(), "{found:?} for {value}");
        assert!((found.std / variance.sqrt() - 1.0).abs() < 1e-9, "{found:?} for {}", variance.sqrt());
    }

    /// Offsets and biases are linear in the offsets found o: q + J b with b = M o, and what o does not show of b.
    #[test]
    fn an_offset_sum_has_the_variance_of_a_linear_form() {
        let rls = fed();
        let (mean, covariance, per_offset, hidden) = offsets(&rls);
        let units = Matrix2::from_diagonal(&OFFSETS.map(|o| rls.scale[o as usize]).into());
        for (flows, pressures) in
            [([1.0, 0.0], [3e-11, -2e-11]), ([0.0, 1.0], [-2e-11, 2e-11]), ([0.0; 2], [1.0, -0.4])]
        {
            let (q, b) = (Vector2::from(flows), Vector2::from(pressures));
            let weights = units * q + per_offset.transpose() * b;
            let variance = weights.dot(&(covariance * weights)) + b.dot(&(hidden * b));
            assert_near(rls.offset_sum(flows, pressures), weights.dot(&mean), variance);
        }
    }

    /// A leak's flow is C (P − b): to first order its error is that of C, of the offsets that tell b, and what is
    /// hidden of b.
    #[test]
    fn a_leak_flow_is_as_uncertain_as_its_factors_together() {
        let rls = fed();
        let (mean, covariance, per_offset, hidden) = offsets(&rls);
        let flows = rls.leak_flows_m3s(&LeakPressures {
            sizes_pa: PerLeak { internal: 2e6, external_a: 5e6, external_b: 4e6 },
            load_sign: 0.8,
        });
        for (found, leak, pressure_pa, shares) in [
            (flows.internal, Parameter::Internal, 2e6, Vector2::new(0.8, -0.8)),
            (flows.external_a, Parameter::ExternalA, 5e6, Vector2::new(1.0, 0.0)),
            (flows.external_b, Parameter::ExternalB, 4e6, Vector2::new(0.0, 1.0)),
        ] {
            let coefficient = rls.parameter(leak).value;
            let to_bias = per_offset.transpose() * shares;
            let pressure = pressure_pa - to_bias.dot(&mean);
            let [a, b] = OFFSETS.map(|offset| rls.covariance(leak, offset));
            let own = rls.covariance(leak, leak);
            let joint =
                Matrix3::new(own, a, b, a, covariance.m11, covariance.m12, b, covariance.m21, covariance.m22);
            let slope = Vector3::new(
                rls.scale[leak as usize] * pressure,
                -coefficient * to_bias.x,
                -coefficient * to_bias.y,
            );
            let variance = slope.dot(&(joint * slope)) + coefficient.powi(2) * shares.dot(&(hidden * shares));
            assert_near(found, coefficient * pressure, variance);
        }
    }

    /// A meter's zero is what is left of what it reads once the leaks through the pressures' zeros are taken
    /// off.
    #[test]
    fn flow_offsets_are_without_what_leaks_through_the_pressures_zeros() {
        let rls = fed();
        let [bias_a, bias_b] = rls.pressure_biases_pa().map(|bias| bias.value);
        let leaks = rls.possible_leaks_m3spa();
        let internal = leaks.internal * (bias_a - bias_b);
        let through = [internal + leaks.external_a * bias_a, -internal + leaks.external_b * bias_b];
        let whole = [[1.0, 0.0], [0.0, 1.0]].map(|flows| rls.offset_sum(flows, [0.0; 2]).value);
        for (side, found) in rls.flow_offsets_m3s().into_iter().enumerate() {
            let expected = whole[side] + through[side];
            assert!((found.value / expected - 1.0).abs() < 1e-9, "{found:?} {expected}");
        }
    }

    /// As the leaks, in prior units per s and not below what the residuals show.
    #[test]
    fn slopes_are_of_the_leaks_units_and_noise() {
        let mut rls = fed();
        rls.slopes_ps = [(0.2, rls.solution.covariance[1][1]); 3];
        let (slope, leak) = (rls.leak_slopes().internal, rls.leak_coefficients().internal);
        assert!((slope.value / (0.2 * rls.leak_prior_std()) - 1.0).abs() < 1e-12);
        assert!((slope.std / leak.std - 1.0).abs() < 1e-12);
    }

    /// Of a sixth of the reading, a fifth of the truth: y = x (1 + γ). Its spread follows the slope of γ/(1 + γ).
    #[test]
    fn a_share_of_the_reading_is_one_of_the_truth() {
        let gain = of_reading(Estimate { value: 1.0_f64 / 6.0, std: 1e-3 });
        let nearby = of_reading(Estimate { value: 1.0_f64 / 6.0 + 1e-6, std: 1e-3 });
        assert!((gain.value - 0.2).abs() < 1e-12);
        let slope = (nearby.value - gain.value) / 1e-6;
        assert!((gain.std / 1e-3 / slope - 1.0).abs() < 1e-5, "{gain:?} {slope}");
    }
}
