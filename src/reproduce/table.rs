//! Rows of the paper's table: medians and worst cases over all seeds.

use super::protocol::Case;
use super::trial::{TrialScore, mean};
use serde::Serialize;

/// The five figures of the paper.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Figures {
    /// Mean leakage error in steady state, % of the window's mean |Q|.
    pub leakage_mean_error_percent: f64,
    /// Peak leakage error in steady state, % of the window's mean |Q|.
    pub leakage_peak_error_percent: f64,
    /// Mean coefficient error in steady state, %.
    pub coefficient_mean_error_percent: f64,
    /// Peak coefficient error in steady state, %.
    pub coefficient_peak_error_percent: f64,
    /// Time until the coefficient stays within 5 %, s; `null` where it does not.
    pub convergence_time_s: Option<f64>,
}

/// What physics allows, from sensor noise alone.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Bound {
    /// Cramér–Rao bound on the coefficient's standard deviation at the end of a window, %: median
    /// over the windows.
    pub coefficient_std_percent: f64,
    /// The same 2 s after the window's start.
    pub coefficient_std_after_2s_percent: f64,
    /// Mean |error| of the leak flow that remains at the end of a window with an efficient
    /// coefficient and pressures through the 5 Hz filter, % of the window's mean |Q|.
    pub leakage_mean_error_percent: f64,
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
    pub worst: Option<Figures>,
    /// Share of the seeds that converged, %.
    pub converged_percent: f64,
    /// Share of the seeds whose 95 % interval at the end of the window holds the truth, %; `null` for
    /// the paper's law.
    pub coverage_percent: Option<f64>,
    /// The bound beside it.
    pub bound: Bound,
}

/// The five figures, or nulls where the row is not identifiable.
#[derive(Clone, Copy, Debug, PartialEq, Default, Serialize)]
pub struct Scored {
    /// See [`Figures::leakage_mean_error_percent`].
    pub leakage_mean_error_percent: Option<f64>,
    /// See [`Figures::leakage_peak_error_percent`].
    pub leakage_peak_error_percent: Option<f64>,
    /// See [`Figures::coefficient_mean_error_percent`].
    pub coefficient_mean_error_percent: Option<f64>,
    /// See [`Figures::coefficient_peak_error_percent`].
    pub coefficient_peak_error_percent: Option<f64>,
    /// See [`Figures::convergence_time_s`].
    pub convergence_time_s: Option<f64>,
}

/// What one seed adds to a row.
#[derive(Clone, Copy, Debug)]
pub(super) struct Entry {
    pub score: TrialScore,
    pub window: WindowBound,
}

/// The bound of one leak in one window.
#[derive(Clone, Copy, Debug)]
pub(super) struct WindowBound {
    /// Standard deviation of the coefficient, share of the truth.
    pub coefficient: f64,
    /// The same after the first 2 s.
    pub coefficient_early: f64,
    /// Mean |error| of the leak flow, share of the mean |Q|.
    pub leakage: f64,
    /// Whether the leak is identifiable in it.
    pub identifiable: bool,
}

impl Row {
    pub(super) fn of(
        wind_mps: u32,
        case: Case,
        leak: &'static str,
        estimator: &'static str,
        entries: &[Entry],
    ) -> Self {
        let identifiable = 2 * entries.iter().filter(|e| e.window.identifiable).count() >= entries.len();
        let all = |of: fn(&TrialScore) -> f64| entries.iter().map(|e| of(&e.score)).collect::<Vec<_>>();
        let times: Vec<f64> =
            entries.iter().map(|e| e.score.convergence_s.unwrap_or(f64::INFINITY)).collect();
        let figures = |pick: fn(Vec<f64>) -> f64| Figures {
            leakage_mean_error_percent: pick(all(|s| s.leakage_mean)),
            leakage_peak_error_percent: pick(all(|s| s.leakage_peak)),
            coefficient_mean_error_percent: pick(all(|s| s.coefficient_mean)),
            coefficient_peak_error_percent: pick(all(|s| s.coefficient_peak)),
            convergence_time_s: Some(pick(times.clone())).filter(|t| t.is_finite()),
        };
        let covered: Vec<f64> = entries
            .iter()
            .filter_map(|e| e.score.covered)
            .map(|yes| 100.0 * f64::from(u8::from(yes)))
            .collect();
        let of_windows =
            |of: fn(&WindowBound) -> f64| median(entries.iter().map(|e| of(&e.window)).collect());
        let ratio = |e: &Entry| (e.score.final_error / (100.0 * e.window.coefficient)).powi(2);
        Self {
            wind_mps,
            case,
            leak,
            estimator,
            identifiable,
            median: if identifiable { figures(median).into() } else { Scored::default() },
            worst: identifiable.then(|| figures(worst)),
            converged_percent: 100.0 * mean(times.iter().map(|t| f64::from(u8::from(t.is_finite())))),
            coverage_percent: (!covered.is_empty()).then(|| mean(covered.into_iter())),
            bound: Bound {
                coefficient_std_percent: 100.0 * of_windows(|w| w.coefficient),
                coefficient_std_after_2s_percent: 100.0 * of_windows(|w| w.coefficient_early),
                leakage_mean_error_percent: 100.0 * of_windows(|w| w.leakage),
                error_over_bound: mean(entries.iter().map(ratio)).sqrt(),
            },
        }
    }
}

impl From<Figures> for Scored {
    fn from(figures: Figures) -> Self {
        Self {
            leakage_mean_error_percent: Some(figures.leakage_mean_error_percent),
            leakage_peak_error_percent: Some(figures.leakage_peak_error_percent),
            coefficient_mean_error_percent: Some(figures.coefficient_mean_error_percent),
            coefficient_peak_error_percent: Some(figures.coefficient_peak_error_percent),
            convergence_time_s: figures.convergence_time_s,
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

/// The table for people: medians, worst case in brackets.
pub(super) fn to_text(title: &str, rows: &[Row]) -> String {
    let mut out = format!(
        "{title}\n{:33}| {:^29} | {:^29} | {:^13} | what noise alone allows\n\
         {:>4} {:>4}  {:<10}  {:<9}| {:>14} {:>14} | {:>14} {:>14} | {:>13} | {:>7} {:>7} {:>7} {:>6}\n",
        "",
        "leakage error %",
        "coefficient error %",
        "within 5 %",
        "m/s",
        "case",
        "leak",
        "law",
        "mean",
        "peak",
        "mean",
        "peak",
        "after s",
        "leakage",
        "1s, 2 s",
        "1s, end",
        "ratio"
    );
    for row in rows {
        out += &line(row);
    }
    out
}

fn line(row: &Row) -> String {
    let head =
        format!("{:>4} {:>4}  {:<10}  {:<9}| ", row.wind_mps, u8::from(row.case), row.leak, row.estimator);
    let Some(worst) = row.worst else {
        return format!("{head}not identifiable: bound {:.1} %\n", row.bound.coefficient_std_percent);
    };
    let pair = |median: Option<f64>, worst: Option<f64>| {
        let one = |value: Option<f64>| value.map_or_else(|| "-".into(), short);
        format!("{} ({})", one(median), one(worst))
    };
    let cells = [
        pair(row.median.leakage_mean_error_percent, Some(worst.leakage_mean_error_percent)),
        pair(row.median.leakage_peak_error_percent, Some(worst.leakage_peak_error_percent)),
        pair(row.median.coefficient_mean_error_percent, Some(worst.coefficient_mean_error_percent)),
        pair(row.median.coefficient_peak_error_percent, Some(worst.coefficient_peak_error_percent)),
        pair(row.median.convergence_time_s, worst.convergence_time_s),
    ];
    let [a, b, c, d, e] = cells;
    let bound = &row.bound;
    format!(
        "{head}{a:>14} {b:>14} | {c:>14} {d:>14} | {e:>13} | {:>7} {:>7} {:>7} {:>6}\n",
        short(bound.leakage_mean_error_percent),
        short(bound.coefficient_std_after_2s_percent),
        short(bound.coefficient_std_percent),
        short(bound.error_over_bound)
    )
}

/// A number in at most five characters.
fn short(value: f64) -> String {
    match value {
        v if v >= 1000.0 => ">999".into(),
        v if v >= 100.0 => format!("{v:.0}"),
        v => format!("{v:.2}"),
    }
}
