//! One estimator on one noisy 20 s window, how far off it was, and rows of the paper's table: medians and worst cases over all seeds.

use super::protocol::{Case, ReproduceError, SAMPLE_RATE_HZ};
use pitchleak::Rig;
use pitchleak::core::{Butterworth, Estimate, FilterError, Leak, PerLeak, Sample};
use pitchleak::replay::{Estimator, leak_pressures_pa};
use pitchleak::simulate::{Sensing, Truth};
use pitchleak::trace::Record;
use serde::Serialize;

/// The five figures of the paper, or nulls where the row is not identifiable.
#[derive(Clone, Copy, Debug, PartialEq, Default, Serialize)]
pub struct Scored {
    /// Mean leakage error in steady state, % of the window's mean |Q|.
    pub leakage_mean_error_percent: Option<f64>,
    /// Peak leakage error in steady state, % of the window's mean |Q|.
    pub leakage_peak_error_percent: Option<f64>,
    /// Mean coefficient error in steady state, %.
    pub coefficient_mean_error_percent: Option<f64>,
    /// Peak coefficient error in steady state, %.
    pub coefficient_peak_error_percent: Option<f64>,
    /// Time until the coefficient stays within 5 %, s; `null` where it does not.
    pub convergence_time_s: Option<f64>,
}

/// What noise alone allows: the figures of an efficient estimator in the same windows.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Bound {
    /// Its medians over all seeds.
    #[serde(flatten)]
    pub median: Scored,
    /// Cramér–Rao bound on the coefficient's standard deviation at the end of a window, %: median
    /// over the windows.
    pub coefficient_std_percent: f64,
    /// Bound on the coefficient's standard deviation 2 s after the window's start, %.
    pub coefficient_std_after_2s_percent: f64,
    /// Root mean square of (error at the end of the window / bound of that window): 1 is as good as
    /// any unbiased estimator.
    pub error_over_bound: f64,
}

/// One row: wind × case × leak × estimator, over all seeds.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Row {
    /// Mean wind, m/s.
    pub wind_mps: u32,
    /// Leak setting.
    pub case: Case,
    /// `internal` or `external_a`.
    pub leak: &'static str,
    /// `paper` or `rls`.
    pub estimator: &'static str,
    /// Whether the windows tell this leak apart, by the Cramér–Rao bound: 95 % within 0.1 L/min or a
    /// tenth of the leak. Only then there are figures.
    pub identifiable: bool,
    /// Medians over all seeds.
    #[serde(flatten)]
    pub median: Scored,
    /// Worst over all seeds; `null` where not identifiable.
    pub worst: Option<Scored>,
    /// Share of the seeds that converged, %.
    pub converged_percent: f64,
    /// Share of the seeds whose 95 % interval at the end of the window holds the truth, %; `null` for
    /// the paper's law.
    pub coverage_percent: Option<f64>,
    /// The bound beside it.
    pub bound: Bound,
}

/// What one seed adds to a row.
#[derive(Clone, Copy, Debug)]
pub(super) struct Entry {
    pub score: TrialScore,
    /// Score of an efficient estimator.
    pub efficient: TrialScore,
    /// Bound on the coefficient's standard deviation in this window, share of the truth.
    pub bound: f64,
    /// The same after the first 2 s.
    pub bound_early: f64,
    /// Whether the leak is identifiable in it: 95 % within 0.1 L/min or a tenth of itself.
    pub identifiable: bool,
}

/// The five figures of all seeds, by `pick`.
fn scored<'a>(scores: impl Iterator<Item = &'a TrialScore> + Clone, pick: fn(Vec<f64>) -> f64) -> Scored {
    let all = |of: fn(&TrialScore) -> f64| Some(pick(scores.clone().map(of).collect()));
    Scored {
        leakage_mean_error_percent: all(|s| s.leakage_mean),
        leakage_peak_error_percent: all(|s| s.leakage_peak),
        coefficient_mean_error_percent: all(|s| s.coefficient_mean),
        coefficient_peak_error_percent: all(|s| s.coefficient_peak),
        convergence_time_s: all(|s| s.convergence_s.unwrap_or(f64::INFINITY)).filter(|t| t.is_finite()),
    }
}

impl Row {
    pub(super) fn of(
        wind_mps: u32,
        case: Case,
        leak: &'static str,
        estimator: &'static str,
        entries: &[Entry],
    ) -> Self {
        let identifiable = 2 * entries.iter().filter(|e| e.identifiable).count() >= entries.len();
        let scores = entries.iter().map(|e| &e.score);
        let efficient = entries.iter().map(|e| &e.efficient);
        let known = |scored: Scored| if identifiable { scored } else { Scored::default() };
        let covered: Vec<f64> = entries
            .iter()
            .filter_map(|e| e.score.covered)
            .map(|yes| 100.0 * f64::from(u8::from(yes)))
            .collect();
        let of_windows = |of: fn(&Entry) -> f64| median(entries.iter().map(of).collect());
        let ratio = |e: &Entry| (e.score.final_error / (100.0 * e.bound)).powi(2);
        Self {
            wind_mps,
            case,
            leak,
            estimator,
            identifiable,
            median: known(scored(scores.clone(), median)),
            worst: identifiable.then(|| scored(scores.clone(), worst)),
            converged_percent: 100.0 * mean(scores.map(|s| f64::from(u8::from(s.convergence_s.is_some())))),
            coverage_percent: (!covered.is_empty()).then(|| mean(covered.into_iter())),
            bound: Bound {
                median: known(scored(efficient, median)),
                coefficient_std_percent: 100.0 * of_windows(|e| e.bound),
                coefficient_std_after_2s_percent: 100.0 * of_windows(|e| e.bound_early),
                error_over_bound: mean(entries.iter().map(ratio)).sqrt(),
            },
        }
    }
}

pub(super) fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
}

fn worst(values: Vec<f64>) -> f64 {
    values.into_iter().fold(f64::NEG_INFINITY, f64::max)
}

/// Above the columns of [`line`].
const HEAD: [&str; 2] = [
    "                                 |        leakage error %        |      coefficient error %      |  within 5 %   | coefficient's bound",
    " m/s case  leak        law      |           mean           peak |           mean           peak |       after s | 1s, 2 s 1s, end  ratio",
];

/// The table for people: medians, worst case in brackets; below each leak the efficient estimator.
pub(super) fn to_text(title: &str, rows: &[Row]) -> String {
    let mut out = format!("{title}\n{}\n", HEAD.join("\n"));
    for leak in rows.chunk_by(|a, b| (a.wind_mps, a.case, a.leak) == (b.wind_mps, b.case, b.leak)) {
        leak.iter().for_each(|row| out += &line(row));
        leak.last().into_iter().filter(|row| row.identifiable).for_each(|row| out += &limit_line(row));
    }
    out
}

fn line(row: &Row) -> String {
    let head =
        format!("{:>4} {:>4}  {:<10}  {:<9}| ", row.wind_mps, u8::from(row.case), row.leak, row.estimator);
    let bound = &row.bound;
    let Some(worst) = row.worst else {
        return format!("{head}not identifiable: bound {:.1} %\n", bound.coefficient_std_percent);
    };
    let [a, b, c, d, e] = row.median.cells();
    let [wa, wb, wc, wd, we] = worst.cells();
    let pair = |median: String, worst: String| format!("{median} ({worst})");
    format!(
        "{head}{:>14} {:>14} | {:>14} {:>14} | {:>13} | {:>7} {:>7} {:>6}\n",
        pair(a, wa),
        pair(b, wb),
        pair(c, wc),
        pair(d, wd),
        pair(e, we),
        five_digits(bound.coefficient_std_after_2s_percent),
        five_digits(bound.coefficient_std_percent),
        five_digits(bound.error_over_bound)
    )
}

/// What an efficient estimator would show.
fn limit_line(row: &Row) -> String {
    let [a, b, c, d, e] = row.bound.median.cells();
    format!("{:>24}{:<9}| {a:>7}{b:>15}        | {c:>7}{d:>15}        | {e:>6}\n", "", "limit")
}

impl Scored {
    /// All five, in the order of the table's columns.
    pub(super) fn values(&self) -> [Option<f64>; 5] {
        [
            self.leakage_mean_error_percent,
            self.leakage_peak_error_percent,
            self.coefficient_mean_error_percent,
            self.coefficient_peak_error_percent,
            self.convergence_time_s,
        ]
    }

    fn cells(&self) -> [String; 5] {
        self.values().map(|value| value.map_or_else(|| "-".into(), five_digits))
    }
}

/// A number in at most five characters.
pub(super) fn five_digits(value: f64) -> String {
    match value {
        v if v >= 1000.0 => ">999".into(),
        v if v >= 100.0 => format!("{v:.0}"),
        v => format!("{v:.2}"),
    }
}

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
