use crate::rig::{EstimatorKind, Rig};
use crate::trace::Record;
use pitchleak_core::{
    Estimate, Estimates, LeakPressures, PaperEstimator, PaperGains, PerLeak, Rls, RlsError, RlsSettings,
    Sensors, Update,
};

/// Gains of the paper's law where the rig file gives none: a search over simulated wind traces
/// (docs/reproduction.md).
const PAPER_LAMBDA_PER_S: f64 = 10.0;
const PAPER_GAMMA: f64 = 3e-5;
const PAPER_CUTOFF_HZ: f64 = 5.0;

/// The estimator that a rig file asks for.
#[derive(Clone, serde::Serialize, serde::Deserialize)]
pub enum Estimator {
    /// Leaks and compressibility.
    Plain(Box<Rls<f64, 4>>),
    /// Leaks, compressibility, and the flow meters' offsets.
    WithOffsets(Box<Rls<f64, 6>>),
    /// Those, and the gains of flow meters and position sensor.
    WithGains(Box<Rls<f64, 9>>),
    /// The paper's law; its filters are set up once the sample rate is known.
    Paper(Box<PaperChain>),
}

/// The paper's law, waiting for its sample rate.
#[derive(Clone, serde::Serialize, serde::Deserialize)]
pub struct PaperChain {
    rig: Rig,
    waiting: Option<Record>,
    estimator: Option<PaperEstimator<f64>>,
}

/// What is known of the bulk modulus, Pa.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BulkModulus {
    /// Best value.
    pub value: f64,
    /// Standard deviation and 95 % interval; none from the paper's law.
    pub spread: Option<(f64, [f64; 2])>,
}

/// One expression for every size, and for the paper's law.
macro_rules! each {
    ($estimator:expr, $rls:ident => $known:expr, $paper:ident => $law:expr) => {
        match $estimator {
            Self::Plain($rls) => $known,
            Self::WithOffsets($rls) => $known,
            Self::WithGains($rls) => $known,
            Self::Paper($paper) => $law,
        }
    };
}

impl Estimator {
    /// The estimator for `rig`.
    ///
    /// # Errors
    /// Where nothing can be estimated for such a rig; no rig file makes one.
    pub fn new(rig: &Rig) -> Result<Self, RlsError> {
        if rig.estimator.kind == EstimatorKind::Paper {
            let chain = PaperChain { rig: rig.clone(), waiting: None, estimator: None };
            return Ok(Self::Paper(Box::new(chain)));
        }
        let sensors = rig.sensors();
        Ok(if has_gains(&sensors) {
            Self::WithGains(Box::new(rls(rig, &sensors)?))
        } else if has_biases(&sensors) {
            Self::WithOffsets(Box::new(rls(rig, &sensors)?))
        } else {
            Self::Plain(Box::new(rls(rig, &sensors)?))
        })
    }

    /// Takes in one record.
    // Not inlined: here the core's arithmetic is compiled once, not in every crate that replays.
    pub fn update(&mut self, record: &Record) -> Update<f64> {
        // A step of no length makes the core start anew.
        let dt_s = record.step_s();
        // A flow may have a clock of its own.
        each!(self,
            rls => rls.update_waiting(dt_s, &record.sample),
            chain => chain.update(dt_s, record)
        )
    }

    /// All that has been found; `None` for the paper's law, which knows no uncertainty.
    pub fn estimates(&self) -> Option<Estimates<f64>> {
        each!(self, rls => Some(rls.estimates()), _chain => None)
    }

    /// Leak coefficients, m³/(s·Pa); the paper's law knows no spread, it is zero there.
    pub fn leak_coefficients(&self) -> PerLeak<Estimate<f64>> {
        known_or_not(each!(self,
            rls => rls.leak_coefficients(),
            chain => chain.leak_coefficients().map(|value| Estimate { value, std: 0.0 })
        ))
    }

    /// Mean leak flows over the estimator's memory, m³/s; `None` for the paper's law.
    pub fn mean_leaks_m3s(&self) -> Option<PerLeak<Estimate<f64>>> {
        each!(self, rls => Some(known_or_not(rls.mean_leaks_m3s())), _chain => None)
    }

    /// [`Estimates::normalised_innovation`] alone; `None` for the paper's law.
    pub fn normalised_innovation(&self) -> Option<[f64; 2]> {
        each!(self, rls => Some(rls.normalised_innovation()), _chain => None)
    }

    /// Leak flows at `pressures`, m³/s; `None` for the paper's law.
    pub fn leak_flows_m3s(&self, pressures: &LeakPressures<f64>) -> Option<PerLeak<Estimate<f64>>> {
        each!(self, rls => Some(known_or_not(rls.leak_flows_m3s(pressures))), _chain => None)
    }

    /// Biases found of the pressure sensors A and B, Pa; zero where the rig file declares none.
    pub fn pressure_biases_pa(&self) -> [f64; 2] {
        let biases = each!(self, rls => rls.pressure_biases_pa(), _chain => return [0.0; 2]);
        biases.map(|bias| if bias.value.is_finite() { bias.value } else { 0.0 })
    }

    /// The bulk modulus, from the interval of the compressibility.
    pub fn bulk_modulus(&self) -> BulkModulus {
        let compressibility = each!(self,
            rls => rls.estimates().compressibility_per_pa,
            chain => return BulkModulus { value: chain.bulk_modulus_pa(), spread: None }
        );
        let value = 1.0 / compressibility.value;
        let spread_pa = compressibility.std * value * value;
        if !(value.is_finite() && spread_pa.is_finite()) {
            return BulkModulus { value: f64::NAN, spread: None };
        }
        let [low, high] = compressibility.ci95();
        let stiffest = if low > 0.0 { 1.0 / low } else { f64::INFINITY };
        BulkModulus { value, spread: Some((spread_pa, [1.0 / high, stiffest])) }
    }
}

fn has_biases(sensors: &Sensors<f64>) -> bool {
    [sensors.flow_a, sensors.flow_b, sensors.pressure]
        .iter()
        .any(|s| s.bias_std > 0.0 || s.drift_std_ph > 0.0)
}

fn has_gains(sensors: &Sensors<f64>) -> bool {
    [sensors.flow_a, sensors.flow_b, sensors.position].iter().any(|s| s.gain_std > 0.0)
}

fn rls<const N: usize>(rig: &Rig, sensors: &Sensors<f64>) -> Result<Rls<f64, N>, RlsError> {
    let default = RlsSettings::default();
    let settings = RlsSettings {
        forgetting_time_s: rig.estimator.forgetting_time_s.unwrap_or(default.forgetting_time_s),
        block_time_s: rig.estimator.block_time_s.unwrap_or(default.block_time_s),
        // The reader marks gaps by the trace's own rhythm.
        max_step_s: f64::MAX,
    };
    Rls::new(rig.cylinder, rig.fluid, sensors, settings)
}

impl PaperChain {
    fn update(&mut self, dt_s: f64, record: &Record) -> Update<f64> {
        if let Some(estimator) = &mut self.estimator {
            return estimator.update(dt_s, &record.sample);
        }
        let Some(first) = self.waiting.replace(*record) else {
            return Update::Started;
        };
        let Some(mut estimator) = self.set_up(dt_s) else {
            return Update::Started;
        };
        estimator.update(0.0, &first.sample);
        let update = estimator.update(dt_s, &record.sample);
        self.estimator = Some(estimator);
        update
    }

    /// Filters need a rate: that of the first step, with the cut-off well below half of it.
    fn set_up(&self, dt_s: f64) -> Option<PaperEstimator<f64>> {
        let settings = &self.rig.estimator;
        let rate_hz = 1.0 / dt_s;
        let gains = PaperGains::scaled(
            &self.rig.cylinder,
            &self.rig.fluid,
            settings.lambda_per_s.unwrap_or(PAPER_LAMBDA_PER_S),
            settings.gamma.unwrap_or(PAPER_GAMMA),
        );
        let cutoff_hz = settings.filter_cutoff_hz.unwrap_or(PAPER_CUTOFF_HZ).min(0.4 * rate_hz);
        PaperEstimator::new(self.rig.cylinder, self.rig.fluid, gains, cutoff_hz, rate_hz).ok()
    }

    fn leak_coefficients(&self) -> PerLeak<f64> {
        self.estimator.as_ref().map_or_else(PerLeak::default, PaperEstimator::leak_coefficients)
    }

    fn bulk_modulus_pa(&self) -> f64 {
        self.estimator.as_ref().map_or(self.rig.fluid.bulk_modulus_pa, PaperEstimator::bulk_modulus_pa)
    }
}

/// Larger than any leak or coefficient in SI, and small enough for its square and its value in L/min to be numbers.
const LARGEST: f64 = 1e30;
/// Nothing is known.
const UNKNOWN: Estimate<f64> = Estimate { value: 0.0, std: LARGEST };

/// The estimates, those that are no numbers as unknown: no alarm follows from one, nor the end of one.
pub(super) fn known_or_not(estimates: PerLeak<Estimate<f64>>) -> PerLeak<Estimate<f64>> {
    estimates.map(|estimate| {
        let Estimate { value, std } = estimate;
        if value.abs() < LARGEST && (0.0..LARGEST).contains(&std) { estimate } else { UNKNOWN }
    })
}

/// Whether anything is known at all.
pub(super) fn is_known(estimate: &Estimate<f64>) -> bool {
    estimate.std < LARGEST
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_nan_and_no_infinity_gets_through() {
        let sound = Estimate { value: -1e-12, std: 0.0 };
        for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e300] {
            for estimate in [Estimate { value: bad, ..sound }, Estimate { std: bad, ..sound }] {
                let PerLeak { internal, external_a, .. } =
                    known_or_not(PerLeak { internal: estimate, external_a: sound, external_b: sound });
                assert!(!is_known(&internal) && internal.value == 0.0);
                assert!(is_known(&external_a) && external_a == sound);
            }
        }
    }
}
