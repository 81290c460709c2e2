//! What the estimator has found so far.

use super::{Parameter, Rls};
use crate::{Estimate, PerLeak, Real};

impl<T: Real, const N: usize> Rls<T, N> {
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
        entry.map_or(T::zero(), |entry| *entry * self.surprise.inflation())
    }

    /// Leak coefficients C_ip, C_epA, C_epB, m³/(s·Pa). A negative one is physically impossible and means
    /// that the model lacks an effect.
    pub fn leak_coefficients(&self) -> PerLeak<Estimate<T>> {
        PerLeak {
            internal: self.parameter(Parameter::Internal),
            external_a: self.parameter(Parameter::ExternalA),
            external_b: self.parameter(Parameter::ExternalB),
        }
    }

    /// Compressibility κ = 1/β, 1/Pa.
    pub fn compressibility(&self) -> Estimate<T> {
        let deviation = self.parameter(Parameter::Compressibility);
        Estimate { value: deviation.value + self.compressibility, std: deviation.std }
    }

    /// Offsets of the flow meters A and B, m³/s (reading minus truth); zero where N < 6.
    pub fn flow_offsets_m3s(&self) -> [Estimate<T>; 2] {
        [self.parameter(Parameter::OffsetA), self.parameter(Parameter::OffsetB)]
    }

    /// Scale errors of flow meter A, flow meter B and the position sensor, as shares; zero where N < 9.
    pub fn gains(&self) -> [Estimate<T>; 3] {
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

    /// Mean leak flows over the memory, m³/s, by eq. (15): coefficient times mean |P_L|, P_A, P_B. A
    /// declared pressure bias widens them.
    pub fn mean_leak_flows_m3s(&self) -> PerLeak<Estimate<T>> {
        let root_two = T::lit(core::f64::consts::SQRT_2);
        let bias = self.pressure_bias_pa;
        let biases = PerLeak { internal: root_two * bias, external_a: bias, external_b: bias };
        self.leak_coefficients().zip(self.pressures.means()).zip(biases).map(|((c, pressure), bias)| {
            Estimate { value: c.value * pressure, std: (c.std * pressure).libm_hypot(c.value * bias) }
        })
    }

    /// Means of |P_L|, P_A, P_B over the memory, Pa.
    pub fn mean_pressures_pa(&self) -> PerLeak<T> {
        self.pressures.means()
    }

    /// Normalised innovation squared of the balance and of the odometer: 1 where the declared noise and
    /// the model explain the data, above where they do not (Bar-Shalom, Li, Kirubarajan, Estimation with
    /// Applications to Tracking and Navigation, §5.4).
    pub fn normalised_innovation(&self) -> [T; 2] {
        self.surprise.ratios()
    }
}
