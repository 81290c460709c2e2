//! What is left of samples that were not fitted: its size, its course, its shape.

use super::fit::Fit;
use super::outcome::{BinnedResidual, Residual, Rmse};
use super::residual::VARIABLES;
use super::rows::{Balance, Entry, Row, Rows};
use super::series::Series;

/// Bins of equal count against each variable.
const BINS: usize = 12;

/// What is left of each hat, in m³/s or N.
pub(super) struct HeldOut {
    points: Vec<Point>,
}

/// What is left of one hat.
struct Point {
    balance: Balance,
    t_s: f64,
    /// What the machine did then, from other samples.
    beside: Option<Row>,
    left: f64,
}

impl HeldOut {
    /// On `test`, or, where that is empty, on blocks that the fit left out.
    pub(super) fn of(fit: &Fit<'_>, test: &[Series]) -> Self {
        let collect = |rows: &Rows, left: Vec<f64>| {
            let entries = rows.entries.iter().zip(left);
            let point = |(entry, left): (&Entry, f64)| Point {
                balance: entry.balance,
                t_s: rows.rows[entry.row].t_s,
                beside: rows.beside(entry.row).copied(),
                left,
            };
            Self { points: entries.map(point).collect() }
        };
        if test.is_empty() {
            return collect(&fit.rows, fit.held_out_leftover());
        }
        let (rows, left) = fit.judge(test);
        collect(&rows, left)
    }

    fn of_balance(&self, balance: Balance) -> impl Iterator<Item = &Point> {
        self.points.iter().filter(move |point| point.balance == balance)
    }

    pub(super) fn rmse(&self) -> Rmse {
        let of = |balance| {
            let (sum, count) =
                self.of_balance(balance).fold((0.0, 0), |(s, n), p| (s + p.left * p.left, n + 1));
            (count > 0).then(|| (sum / f64::from(count)).sqrt())
        };
        Rmse {
            chamber_a_m3s: of(Balance::ChamberA),
            chamber_b_m3s: of(Balance::ChamberB),
            force_n: of(Balance::Force),
        }
    }

    pub(super) fn residual(&self) -> Residual {
        let of = |balance| self.of_balance(balance).map(|point| (point.t_s, point.left)).collect();
        Residual {
            chamber_a_m3s: of(Balance::ChamberA),
            chamber_b_m3s: of(Balance::ChamberB),
            force_n: of(Balance::Force),
        }
    }

    /// What is left against each variable, in bins of equal count.
    pub(super) fn shapes(&self) -> Vec<BinnedResidual> {
        let mut shapes = Vec::new();
        for (balance, name) in Balance::ALL.into_iter().zip(["chamber_a", "chamber_b", "force"]) {
            if self.of_balance(balance).count() < 2 * BINS {
                continue;
            }
            for variable in &VARIABLES {
                let pair = |point: &Point| Some(((variable.of)(point.beside.as_ref()?), point.left));
                let pairs = self.of_balance(balance).filter_map(pair).collect();
                shapes.push(binned(name, variable.name, pairs));
            }
        }
        shapes
    }
}

fn binned(balance: &'static str, against: &'static str, mut pairs: Vec<(f64, f64)>) -> BinnedResidual {
    pairs.sort_by(|a, b| a.0.total_cmp(&b.0));
    let n = pairs.len() as f64;
    let mean = |f: &dyn Fn(&(f64, f64)) -> f64| pairs.iter().map(f).sum::<f64>() / n;
    let (mx, my) = (mean(&|p| p.0), mean(&|p| p.1));
    let (xx, yy) = (mean(&|p| (p.0 - mx).powi(2)), mean(&|p| (p.1 - my).powi(2)));
    let xy = mean(&|p| (p.0 - mx) * (p.1 - my));
    let scale = (xx * yy).sqrt();
    let bins = pairs.chunks(pairs.len().div_ceil(BINS)).map(Bin::of);
    let (mut at, mut mean, mut std_error) = (vec![], vec![], vec![]);
    for bin in bins {
        at.push(bin.at);
        mean.push(bin.mean);
        std_error.push(bin.std_error);
    }
    BinnedResidual {
        balance,
        against,
        at,
        mean,
        std_error,
        correlation: if scale > 0.0 { xy / scale } else { 0.0 },
    }
}

/// Means of one bin.
struct Bin {
    at: f64,
    mean: f64,
    std_error: f64,
}

impl Bin {
    fn of(pairs: &[(f64, f64)]) -> Self {
        let n = pairs.len() as f64;
        let sum = pairs.iter().fold((0.0, 0.0), |s, p| (s.0 + p.0, s.1 + p.1));
        let (at, mean) = (sum.0 / n, sum.1 / n);
        let variance = pairs.iter().map(|p| (p.1 - mean).powi(2)).sum::<f64>() / n;
        Self { at, mean, std_error: (variance / n).sqrt() }
    }
}
