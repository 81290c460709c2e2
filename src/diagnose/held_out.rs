//! What is left of samples that were not fitted: its size, its course, its shape.

use super::fit::Fit;
use super::outcome::{Residual, Rmse, Shape};
use super::rows::{Balance, Row, Rows};
use super::series::Series;

/// Bins of equal count against each variable.
const BINS: usize = 12;

/// What is left of each hat, in m³/s or N.
pub(super) struct HeldOut {
    points: Vec<(Balance, Row, f64)>,
}

impl HeldOut {
    /// On `test`, or, where that is empty, on blocks that the fit left out.
    pub(super) fn of(fit: &Fit<'_>, test: &[Series]) -> Self {
        let collect = |rows: &Rows, left: Vec<f64>| {
            let entries = rows.entries.iter().zip(left);
            Self { points: entries.map(|(e, v)| (e.balance, rows.rows[e.row], v)).collect() }
        };
        if test.is_empty() {
            return collect(&fit.rows, fit.held_out_leftover());
        }
        let (rows, left) = fit.judge(test);
        collect(&rows, left)
    }

    fn of_balance(&self, balance: Balance) -> impl Iterator<Item = &(Balance, Row, f64)> {
        self.points.iter().filter(move |point| point.0 == balance)
    }

    pub(super) fn rmse(&self) -> Rmse {
        let of = |balance| {
            let (sum, count) = self.of_balance(balance).fold((0.0, 0), |(s, n), p| (s + p.2 * p.2, n + 1));
            (count > 0).then(|| (sum / f64::from(count)).sqrt())
        };
        Rmse {
            chamber_a_m3s: of(Balance::ChamberA),
            chamber_b_m3s: of(Balance::ChamberB),
            force_n: of(Balance::Force),
        }
    }

    pub(super) fn residual(&self) -> Residual {
        let of = |balance| self.of_balance(balance).map(|(_, row, v)| (row.t_s, *v)).collect();
        Residual {
            chamber_a_m3s: of(Balance::ChamberA),
            chamber_b_m3s: of(Balance::ChamberB),
            force_n: of(Balance::Force),
        }
    }

    /// What is left against each variable, in bins of equal count.
    pub(super) fn shapes(&self) -> Vec<Shape> {
        type Variable = fn(&Row) -> f64;
        let variables: [(&'static str, Variable); 9] = [
            ("load_pressure_pa", |r| r.mean.pa_pa - r.mean.pb_pa),
            ("pa_pa", |r| r.mean.pa_pa),
            ("pb_pa", |r| r.mean.pb_pa),
            ("x_m", |r| r.mean.x_m),
            ("v_mps", |r| r.mean.v_mps),
            ("direction", |r| r.mean.v_mps.signum()),
            ("qa_m3s", |r| r.mean.qa_m3s),
            ("qb_m3s", |r| r.mean.qb_m3s),
            ("t_s", |r| r.t_s),
        ];
        let mut shapes = Vec::new();
        for (balance, name) in Balance::ALL.into_iter().zip(["chamber_a", "chamber_b", "force"]) {
            if self.of_balance(balance).count() < 2 * BINS {
                continue;
            }
            for (against, variable) in variables {
                let pairs = self.of_balance(balance).map(|(_, row, v)| (variable(row), *v)).collect();
                shapes.push(binned(name, against, pairs));
            }
        }
        shapes
    }
}

fn binned(balance: &'static str, against: &'static str, mut pairs: Vec<(f64, f64)>) -> Shape {
    pairs.sort_by(|a, b| a.0.total_cmp(&b.0));
    let n = pairs.len() as f64;
    let mean = |f: &dyn Fn(&(f64, f64)) -> f64| pairs.iter().map(f).sum::<f64>() / n;
    let (mx, my) = (mean(&|p| p.0), mean(&|p| p.1));
    let (xx, yy) = (mean(&|p| (p.0 - mx).powi(2)), mean(&|p| (p.1 - my).powi(2)));
    let xy = mean(&|p| (p.0 - mx) * (p.1 - my));
    let scale = (xx * yy).sqrt();
    let (at, means) = pairs
        .chunks(pairs.len().div_ceil(BINS))
        .map(|bin| {
            let sum = bin.iter().fold((0.0, 0.0), |s, p| (s.0 + p.0, s.1 + p.1));
            (sum.0 / bin.len() as f64, sum.1 / bin.len() as f64)
        })
        .unzip();
    Shape { balance, against, at, mean: means, correlation: if scale > 0.0 { xy / scale } else { 0.0 } }
}
