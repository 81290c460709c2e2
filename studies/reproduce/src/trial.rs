//! One estimator on one noisy 20 s window, and how far off it was.

use super::protocol::{ReproduceError, SAMPLE_RATE_HZ};
use pitchleak::Rig;
use pitchleak::core::{Butterworth, Estimate, FilterError, Leak, PerLeak, Sample};
use pitchleak::replay::{Estimator, leak_pressures_pa};
use pitchleak::simulate::{Sensing, Truth};
use pitchleak::trace::Record;

/// Cut-off of the filter on leak flows and pressures, Hz, Section IV.
const CUTOFF_HZ: f64 = 5.0;
/// The estimate has converged once its coefficient stays within this share of the truth.
const BAND: f64 = 0.05;
/// Where it converges later than this, or never, s, the rest of the window counts as steady state.
const LATEST_STEADY_S: f64 = 10.0;

/// One leak in one window.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrialScore {
    /// Mean of |Q̂ − Q| in steady state over the mean of |Q|, %.
    pub leakage_mean: f64,
    /// Peak of |Q̂ − Q| in steady state over the mean of |Q|, %.
    pub leakage_peak: f64,
    /// Mean of |Ĉ/C − 1| in steady state, %.
    pub coefficient_mean: f64,
    /// Peak of the same, %.
    pub coefficient_peak: f64,
    /// Time until |Ĉ/C − 1| stays within 5 %, s; `None` if it does not.
    pub convergence_s: Option<f64>,
    /// Ĉ/C − 1 at the end, %.
    pub final_error: f64,
    /// Whether the 95 % interval at the end holds the truth; `None` from the paper's law.
    pub covered: Option<bool>,
}

/// What was estimated over time.
#[derive(Clone, Debug, Default)]
pub struct EstimateHistory {
    /// Time since the window began, s.
    pub t_s: Vec<f64>,
    /// Coefficients, m³/(s·Pa).
    pub coefficients: Vec<PerLeak<Estimate<f64>>>,
    /// Leak flows by eq. (15), from pressures through the 5 Hz filter, m³/s.
    pub flows_m3s: Vec<PerLeak<f64>>,
    /// True leak flows through the same filter, m³/s.
    pub references_m3s: Vec<PerLeak<f64>>,
}

impl EstimateHistory {
    /// The rig's estimator on a window as `sensing` reads it.
    ///
    /// # Errors
    /// Where the rig has no estimator, or the filter does not exist at the protocol's rate.
    pub fn run(rig: &Rig, window: &[Truth], sensing: Sensing) -> Result<Self, ReproduceError> {
        let mut estimator = Estimator::new(rig)?;
        let dt_s = 1.0 / SAMPLE_RATE_HZ;
        let history = Self::of(window, sensing, |index, sample| {
            let (t_s, dt_s) = (index as f64 * dt_s, if index == 0 { 0.0 } else { dt_s });
            estimator.update(&Record { t_s, dt_s, sample: *sample, ..Record::default() });
            (estimator.leak_coefficients(), estimator.pressure_biases_pa())
        });
        Ok(history?)
    }

    /// What `estimate` makes of each sample of a window that `sensing` reads: leak coefficients, and biases of the pressure
    /// sensors A and B, Pa.
    ///
    /// # Errors
    /// Where the filter does not exist at the protocol's rate.
    pub(super) fn of(
        window: &[Truth],
        mut sensing: Sensing,
        mut estimate: impl FnMut(usize, &Sample<f64>) -> (PerLeak<Estimate<f64>>, [f64; 2]),
    ) -> Result<Self, FilterError> {
        let mut history = Self::default();
        let filter = Butterworth::new(CUTOFF_HZ, SAMPLE_RATE_HZ)?;
        let settled = |value: f64| {
            let mut filter = filter;
            filter.reset(value);
            filter
        };
        let mut filters = None;
        for (index, truth) in window.iter().enumerate() {
            let sample = sensing.read(&truth.sample);
            let (coefficients, biases_pa) = estimate(index, &sample);
            let read = leak_pressures_pa([sample.pa_pa, sample.pb_pa]);
            // Both start settled on their first values.
            let [of_pressures, of_leaks] =
                filters.get_or_insert_with(|| [read, truth.leaks_m3s].map(|first| first.map(settled)));
            let (pressures, found) = (advance(of_pressures, read), leak_pressures_pa(biases_pa));
            let flows = coefficients.zip(pressures.zip(found)).map(|(c, (p, bias))| c.value * (p - bias));
            history.t_s.push(index as f64 / SAMPLE_RATE_HZ);
            history.coefficients.push(coefficients);
            history.flows_m3s.push(flows);
            history.references_m3s.push(advance(of_leaks, truth.leaks_m3s));
        }
        Ok(history)
    }

    /// Mean of |Ĉ/C − 1| over the second half of the window.
    pub fn late_error(&self, truth: f64, leak: Leak) -> f64 {
        let late = self.coefficients.iter().skip(self.coefficients.len() / 2);
        mean(late.map(|c| (c[leak].value / truth - 1.0).abs()))
    }

    /// Scores one leak, whose true coefficient is `truth`.
    pub fn score(&self, truth: f64, leak: Leak) -> TrialScore {
        let coefficient =
            |k: usize| self.coefficients.get(k).map_or(f64::NAN, |c| (c[leak].value / truth - 1.0).abs());
        let count = self.t_s.len();
        let converged =
            (0..count).rev().find(|&k| coefficient(k).is_nan() || coefficient(k) > BAND).map_or(0, |k| k + 1);
        let latest = ((LATEST_STEADY_S * SAMPLE_RATE_HZ) as usize).min(count);
        let steady = converged.min(latest);
        let mean_size = mean(self.references_m3s.iter().map(|q| q[leak].abs()));
        let leakage = self.flows_m3s.iter().zip(&self.references_m3s).skip(steady);
        let leakage = || leakage.clone().map(|(q, r)| (q[leak] - r[leak]).abs() / mean_size);
        let last = self.coefficients.last();
        let estimate = last.map_or(Estimate { value: f64::NAN, std: f64::NAN }, |c| c[leak]);
        let [low, high] = estimate.ci95();
        TrialScore {
            leakage_mean: 100.0 * mean(leakage()),
            leakage_peak: 100.0 * leakage().fold(0.0, f64::max),
            coefficient_mean: 100.0 * mean((steady..count).map(coefficient)),
            coefficient_peak: 100.0 * (steady..count).map(coefficient).fold(0.0, f64::max),
            convergence_s: (converged < count).then(|| converged as f64 / SAMPLE_RATE_HZ),
            final_error: 100.0 * (estimate.value / truth - 1.0),
            covered: (estimate.std > 0.0).then_some(low <= truth && truth <= high),
        }
    }
}

fn advance(filters: &mut PerLeak<Butterworth<f64>>, values: PerLeak<f64>) -> PerLeak<f64> {
    PerLeak::from_fn(|leak| filters[leak].update(values[leak]))
}

pub(super) fn mean(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0.0), |(sum, count), value| (sum + value, count + 1.0));
    sum / f64::max(count, 1.0)
}
