//! What the estimator has found so far.

use super::{ExcitationReport, ExcitationSettings, Parameter, Rls};
use crate::{Estimate, LeakPressures, PerLeak, Real};

/// All that an estimator has found.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Estimates<T> {
    /// Leak coefficients C_ip, C_epA, C_epB, m³/(s·Pa). A negative one is physically impossible and means that
    /// the model lacks an effect.
    pub leaks_m3spa: PerLeak<Estimate<T>>,
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
    /// Normalised innovation squared of the balance and of the odometer: 1 where the declared noise and
    /// the model explain the data, above where they do not (Bar-Shalom, Li, Kirubarajan, Estimation with
    /// Applications to Tracking and Navigation, §5.4).
    pub normalised_innovation: [T; 2],
    /// What the samples identify, by the usual [`ExcitationSettings`].
    pub excitation: ExcitationReport<T>,
}

const OFFSETS: [Parameter; 2] = [Parameter::OffsetA, Parameter::OffsetB];

impl<T: Real, const N: usize> Rls<T, N> {
    /// All that is known by now.
    pub fn estimates(&self) -> Estimates<T> {
        let pressures = self.pressures.means();
        Estimates {
            leaks_m3spa: self.leak_coefficients(),
            mean_leaks_m3s: self.leak_flows_m3s(&pressures),
            mean_pressures_pa: pressures.sizes_pa,
            compressibility_per_pa: self.compressibility(),
            flow_offsets_m3s: (N > Parameter::OffsetB as usize).then(|| self.flow_offsets_m3s()),
            gains: (N > Parameter::GainPosition as usize).then(|| self.gains()),
            pressure_biases_pa: self.pressure_biases_pa(),
            normalised_innovation: self.innovations.ratios(),
            excitation: self.excitation(&ExcitationSettings::default()),
        }
    }

    /// Estimate of a parameter's deviation from its prior mean, SI; zero with no spread where N is too
    /// small to have it.
    fn parameter(&self, parameter: Parameter) -> Estimate<T> {
        let index = parameter as usize;
        match (self.solution.mean.get(index), self.scale.get(index)) {
            (Some(mean), Some(scale)) => {
                Estimate { value: *mean * *scale, std: self.covariance(parameter, parameter).sqrt() * *scale }
            }
            _ => Estimate::default(),
        }
    }

    /// Covariance of two parameters' errors, each in units of its prior's standard deviation; not below
    /// what the residuals show. Zero where N is too small to have them.
    pub fn covariance(&self, a: Parameter, b: Parameter) -> T {
        let row = self.solution.covariance.get(a as usize);
        let entry = row.and_then(|row| row.get(b as usize));
        entry.map_or(T::zero(), |entry| *entry * self.innovations.inflation())
    }

    /// [`Estimates::leaks_m3spa`] alone.
    pub fn leak_coefficients(&self) -> PerLeak<Estimate<T>> {
        PerLeak {
            internal: self.parameter(Parameter::Internal),
            external_a: self.parameter(Parameter::ExternalA),
            external_b: self.parameter(Parameter::ExternalB),
        }
    }

    pub(super) fn compressibility(&self) -> Estimate<T> {
        let deviation = self.parameter(Parameter::Compressibility);
        Estimate { value: deviation.value + self.compressibility, std: deviation.std }
    }

    fn flow_offsets_m3s(&self) -> [Estimate<T>; 2] {
        let (one, none) = (T::one(), T::zero());
        let leaks = self.leak_coefficients().map(|c| c.value.max(none));
        let c = leaks.internal;
        [
            self.offset_sum([one, none], [c + leaks.external_a, -c]),
            self.offset_sum([none, one], [-c, c + leaks.external_b]),
        ]
    }

    fn gains(&self) -> [Estimate<T>; 3] {
        [
            self.parameter(Parameter::GainA),
            self.parameter(Parameter::GainB),
            self.parameter(Parameter::GainPosition),
        ]
    }

    /// Prior standard deviations of the leak coefficients, m³/(s·Pa).
    pub fn leak_prior_std(&self) -> T {
        self.scale[Parameter::Internal as usize]
    }

    /// Prior standard deviation of the compressibility, 1/Pa.
    pub fn compressibility_prior_std(&self) -> T {
        self.scale[Parameter::Compressibility as usize]
    }

    /// [`Estimates::pressure_biases_pa`] alone.
    pub fn pressure_biases_pa(&self) -> [Estimate<T>; 2] {
        let (one, none) = (T::one(), T::zero());
        [[one, none], [none, one]].map(|shares| self.offset_sum([none, none], shares))
    }

    /// Weights of the offsets found in `flows`·offsets + `pressures`·biases (SI), m³/s or Pa per prior unit.
    fn per_offset(&self, [flow_a, flow_b]: [T; 2], [share_a, share_b]: [T; 2]) -> [T; 2] {
        let [[aa, ab], [ba, bb]] = self.offsets.pressure_per_offset;
        let bias_pa = self.sensors.pressure.bias_std;
        let [unit_a, unit_b] = OFFSETS.map(|o| self.scale.get(o as usize).copied().unwrap_or(T::zero()));
        [
            flow_a * unit_a + bias_pa * (share_a * aa + share_b * ba),
            flow_b * unit_b + bias_pa * (share_a * ab + share_b * bb),
        ]
    }

    /// `flows`·offsets + `pressures`·biases, SI.
    fn offset_sum(&self, flows: [T; 2], pressures: [T; 2]) -> Estimate<T> {
        let [per_a, per_b] = self.per_offset(flows, pressures);
        let [a, b] = OFFSETS;
        let [mean_a, mean_b] =
            OFFSETS.map(|o| self.solution.mean.get(o as usize).copied().unwrap_or(T::zero()));
        let found = per_a * per_a * self.covariance(a, a)
            + T::lit(2.0) * per_a * per_b * self.covariance(a, b)
            + per_b * per_b * self.covariance(b, b);
        let [[aa, ab], [ba, bb]] = self.offsets.pressure_spread;
        let [share_a, share_b] = pressures;
        let hidden = share_a * share_a * aa + share_a * share_b * (ab + ba) + share_b * share_b * bb;
        let bias_pa = self.sensors.pressure.bias_std;
        let variance = found.max(T::zero()) + bias_pa * bias_pa * hidden.max(T::zero());
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
        let scale = self.scale.get(leak as usize).copied().unwrap_or(T::zero());
        let together = scale * (per_a * a + per_b * b);
        let (own, through) = (coefficient.std * pressure, coefficient.value * bias.std);
        let variance = own * own + through * through - T::lit(2.0) * coefficient.value * pressure * together;
        Estimate { value: coefficient.value * pressure, std: variance.max(T::zero()).sqrt() }
    }

    /// Means of |P_L|, P_A, P_B over the memory as read, Pa.
    pub(super) fn mean_pressures_pa(&self) -> PerLeak<T> {
        self.pressures.means().sizes_pa
    }
}
