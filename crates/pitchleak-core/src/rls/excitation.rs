//! What the data can tell: per parameter, whether this trace pins it down.

use super::{Parameter, Rls};
use crate::{Estimate, LPM_PER_M3S, PerLeak, Real};

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

impl<T: Real, const N: usize> Rls<T, N> {
    /// Says for each parameter whether the samples so far identify it: identifiability as accumulated
    /// Fisher information against the prior.
    pub fn excitation(&self, settings: &ExcitationSettings<T>) -> ExcitationReport<T> {
        let one = |parameter: Parameter, identifiable: bool| Excitation {
            identifiable,
            variance_reduction: self.variance_reduction(parameter),
            traded_with: self.traded_with(parameter),
        };
        let pinned = self.leak_coefficients().zip(self.mean_pressures_pa()).map(|(leak, pressure)| {
            settings.resolves(&leak.scaled(pressure.at_least(settings.least_pressure_pa)))
        });
        let learnt = settings.learns(self.compressibility().std, self.compressibility_prior_std());
        ExcitationReport {
            leaks: PerLeak {
                internal: one(Parameter::Internal, pinned.internal),
                external_a: one(Parameter::ExternalA, pinned.external_a),
                external_b: one(Parameter::ExternalB, pinned.external_b),
            },
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
