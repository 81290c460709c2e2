//! Rows of the paper's table: medians and worst cases over all seeds.

use super::protocol::Case;
use super::trial::{TrialScore, mean};
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
