//! The noise of the weak form's rows, known from the sensors' own noise, and its inverse square root.
//!
//! A row's noise is hat·(n_Q − C n_P) − A (n̄_{k+1} − n̄_k) of the position − (V/β)(n̄_{k+1} − n̄_k) of the
//! pressure. Rows that share a block are correlated, others are not: the covariance is a narrow band,
//! and whitening by its Cholesky factor is the Kalman filter's innovation form of the same regression.

use super::point::Point;
use super::rows::{Balance, Entry, Row, Rows};
use super::term::{Nameless, Term};
use pitchleak_core::{Effect, Sensors};

/// Entries to the left of the diagonal that can be correlated: three of the row before, two of the own.
const BAND: usize = 5;
/// Variance of an entry that must not count, times its own.
const IGNORED: f64 = 1e8;

/// Σ = L Lᵀ, banded; `factor[i][d]` is L_{i,i−d}.
pub(super) struct Whitening {
    factor: Vec<[f64; BAND + 1]>,
}

/// Sums of squares of the samples' weights in a hat, and of products with the next hat's.
fn hat_weights(samples: usize) -> (f64, f64) {
    let m = samples as isize;
    let step = |j: isize| {
        if (0..2 * m - 1).contains(&j) { (m - (j - (m - 1)).abs()) as f64 / m as f64 } else { 0.0 }
    };
    let weight = |i: isize| (step(i - 1) + step(i)) / 2.0;
    let own = (0..2 * m).map(|i| weight(i) * weight(i)).sum();
    let next = (0..2 * m).map(|i| weight(i) * weight(i - m)).sum();
    (own, next)
}

/// What the covariance needs of one kind of row.
pub(super) struct Spread<'a> {
    pub(super) point: &'a Point,
    pub(super) sensors: &'a Sensors<f64>,
    /// Variance of the equation error by balance, as if white in its flow or force.
    pub(super) equation_error: [f64; 3],
}

impl Spread<'_> {
    /// Sensitivity of a chamber's row to both pressures as flows, m³/(s·Pa). While a missing effect drives
    /// the leaks to absurd sizes, their noise must not hide it: it is held to that of the flow meter.
    fn leak_gain(&self, balance: Balance) -> [f64; 2] {
        let leaks = &self.point.model.leaks_m3spa;
        let past = leaks.internal;
        let gain = match balance {
            Balance::ChamberA => [past + leaks.external_a, -past],
            _ => [-past, past + leaks.external_b],
        };
        let noise = gain[0].hypot(gain[1]) * self.sensors.pressure.noise_std;
        let held = if noise > self.flow_std(balance) { self.flow_std(balance) / noise } else { 1.0 };
        gain.map(|g| g * held)
    }

    /// A_A or −A_B: how a change of position enters a chamber.
    fn swept_area(&self, balance: Balance) -> f64 {
        let cylinder = &self.point.model.cylinder;
        if balance == Balance::ChamberA { cylinder.area_a_m2 } else { -cylinder.area_b_m2 }
    }

    /// Variance of one row of a balance, as if all of it were white in the flow or force.
    pub(super) fn white_variance(&self, row: &Row, balance: Balance) -> f64 {
        let own = Weights { hat: hat_weights(row.samples).0, difference: 2.0 };
        self.as_white(row, self.covariance((row, balance), (row, balance), own))
    }

    /// The white flow or force whose variance makes this variance of a row.
    pub(super) fn as_white(&self, row: &Row, variance: f64) -> f64 {
        let step_s = row.block_s / row.samples as f64;
        variance / (hat_weights(row.samples).0 * step_s * step_s)
    }

    /// Standard deviation of a chamber's row as a mean flow, m³/s.
    pub(super) fn mean_flow_std(&self, row: &Row, balance: Balance) -> f64 {
        let own = Weights { hat: hat_weights(row.samples).0, difference: 2.0 };
        self.covariance((row, balance), (row, balance), own).sqrt() / row.block_s
    }

    fn flow_std(&self, balance: Balance) -> f64 {
        let meter = if balance == Balance::ChamberA { &self.sensors.flow_a } else { &self.sensors.flow_b };
        meter.noise_std
    }

    /// (V/β) σ_P: noise of the pressure's part that the chamber stores, m³.
    fn stored_std(&self, row: &Row, balance: Balance) -> f64 {
        let cylinder = &self.point.model.cylinder;
        let volume = match balance {
            Balance::ChamberA => cylinder.volume_a_m3(row.mean.x_m),
            _ => cylinder.volume_b_m3(row.mean.x_m),
        };
        volume / self.point.model.fluid.bulk_modulus_pa * self.sensors.pressure.noise_std
    }

    /// Covariance of two entries of the same row or, with `weights` of the next hat, of neighbours.
    fn covariance(&self, (row_a, a): (&Row, Balance), (row_b, b): (&Row, Balance), weights: Weights) -> f64 {
        if (a == Balance::Force) != (b == Balance::Force) {
            return 0.0;
        }
        let step_s = row_a.block_s / row_a.samples as f64;
        let hat = weights.hat * step_s * step_s;
        let difference = weights.difference / row_a.samples as f64;
        let (pressure, cylinder) = (self.sensors.pressure.noise_std, &self.point.model.cylinder);
        if a == Balance::Force {
            let areas = cylinder.area_a_m2.powi(2) + cylinder.area_b_m2.powi(2);
            let error = self.equation_error[a.index()];
            return hat * (areas * pressure.powi(2) + self.sensors.force.noise_std.powi(2) + error);
        }
        let (ga, gb) = (self.leak_gain(a), self.leak_gain(b));
        let leak = (ga[0] * gb[0] + ga[1] * gb[1]) * pressure.powi(2);
        let moved = self.swept_area(a) * self.swept_area(b) * self.sensors.position.noise_std.powi(2);
        if a != b {
            return hat * leak + difference * moved;
        }
        let stored = self.stored_std(row_a, a) * self.stored_std(row_b, b);
        let error = self.equation_error[a.index()];
        hat * (self.flow_std(a).powi(2) + leak + error) + difference * (moved + stored)
    }
}

/// How the noise of samples enters two rows together: through their hats, and through their
/// differences of block means (times the samples of a block).
#[derive(Clone, Copy, Default)]
struct Weights {
    hat: f64,
    difference: f64,
}

impl Whitening {
    pub(super) fn new(rows: &Rows, spread: &Spread<'_>) -> Self {
        let mut factor: Vec<[f64; BAND + 1]> = Vec::with_capacity(rows.entries.len());
        let mut known = (0, (0.0, 0.0));
        for (i, entry) in rows.entries.iter().enumerate() {
            let samples = rows.rows[entry.row].samples;
            if known.0 != samples {
                known = (samples, hat_weights(samples));
            }
            let mut line = [0.0; BAND + 1];
            for d in (0..=BAND.min(i)).rev() {
                let covariance = entry_covariance(rows, spread, i, i - d, known.1);
                // L_{i,j} = (Σ_{i,j} − Σ_{l<j} L_{i,l} L_{j,l}) / L_{j,j}
                let done: f64 = (1..=BAND - d)
                    .filter(|e| i >= d + e)
                    .map(|e| line[d + e] * if d == 0 { line[e] } else { factor[i - d][e] })
                    .sum();
                let rest = covariance - done;
                line[d] = match d {
                    0 => rest.max(1e-3 * covariance).sqrt(),
                    _ => rest / factor[i - d][0],
                };
            }
            factor.push(line);
        }
        Self { factor }
    }

    /// L⁻¹ v.
    pub(super) fn whiten(&self, v: &[f64]) -> Vec<f64> {
        let mut out: Vec<f64> = Vec::with_capacity(v.len());
        for (i, (line, value)) in self.factor.iter().zip(v).enumerate() {
            let before: f64 = (1..=BAND.min(i)).map(|d| line[d] * out[i - d]).sum();
            out.push((value - before) / line[0]);
        }
        out
    }
}

fn entry_covariance(rows: &Rows, spread: &Spread<'_>, i: usize, j: usize, weights: (f64, f64)) -> f64 {
    let (a, b) = (rows.entries[i], rows.entries[j]);
    let (row_a, row_b) = (&rows.rows[a.row], &rows.rows[b.row]);
    if row_a.stretch != row_b.stretch || a.row - b.row > 1 {
        return 0.0;
    }
    let weights = if a.row == b.row {
        Weights { hat: weights.0, difference: 2.0 }
    } else {
        Weights { hat: weights.1, difference: -1.0 }
    };
    let value = spread.covariance((row_a, a.balance), (row_b, b.balance), weights);
    if i == j && !rows.counts(&a) { value * IGNORED } else { value }
}

/// One realisation of the noise that some columns share with the residual, because they are the left
/// side of the equation itself.
pub(super) struct SharedNoise {
    /// In the rows.
    pub(super) rows: Vec<f64>,
    /// In the columns that have it.
    pub(super) columns: Vec<(usize, Vec<f64>)>,
}

/// Signs without an order (splitmix64), the same on every machine.
struct Signs(u64);

impl Signs {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        if (z ^ (z >> 31)) & 1 == 0 { 1.0 } else { -1.0 }
    }
}

/// Noise of one sensor in each row: through differences of block means, or through hats.
struct InRows {
    difference: Vec<f64>,
    hat: Vec<f64>,
}

/// Unit white noise seen by each row. A hat's noise is that of its two blocks, which it shares with its
/// neighbours, and its own, in the shares that give the known covariances.
fn draw(rows: &[Row], signs: &mut Signs) -> InRows {
    let (mut difference, mut hat) = (Vec::with_capacity(rows.len()), Vec::with_capacity(rows.len()));
    let mut last = (usize::MAX, 0.0);
    let mut known = (0, (0.0, 0.0));
    for row in rows {
        let left = if last.0 == row.stretch { last.1 } else { signs.next() };
        let right = signs.next();
        last = (row.stretch, right);
        if known.0 != row.samples {
            known = (row.samples, hat_weights(row.samples));
        }
        let (own, next) = known.1;
        let step_s = row.block_s / row.samples as f64;
        difference.push((right - left) / (row.samples as f64).sqrt());
        let shared = next.max(0.0).sqrt() * (left + right);
        hat.push(step_s * (shared + (own - 2.0 * next).max(0.0).sqrt() * signs.next()));
    }
    InRows { difference, hat }
}

impl SharedNoise {
    /// The `number`th realisation.
    pub(super) fn draw(rows: &Rows, spread: &Spread<'_>, terms: &[Term], number: u64) -> Self {
        let mut signs = Signs(number);
        let [position, flow_a, flow_b] = std::array::from_fn(|_| draw(&rows.rows, &mut signs));
        let moved = |entry: &Entry| spread.sensors.position.noise_std * position.difference[entry.row];
        let metered = |entry: &Entry| match entry.balance {
            Balance::ChamberA => spread.sensors.flow_a.noise_std * flow_a.hat[entry.row],
            Balance::ChamberB => spread.sensors.flow_b.noise_std * flow_b.hat[entry.row],
            Balance::Force => 0.0,
        };
        let swept = |entry: &Entry| match entry.balance {
            Balance::Force => 0.0,
            chamber => spread.swept_area(chamber) * moved(entry),
        };
        let area_a = spread.point.model.cylinder.area_a_m2;
        let load = |entry: &Entry| {
            let mean = &rows.rows[entry.row].mean;
            mean.pa_pa - mean.pb_pa
        };
        let column = |term: Term, entry: &Entry| match (term, entry.balance) {
            (Term::Effect(Effect::PositionGain), _) => -swept(entry),
            (Term::Effect(Effect::DragLeak), Balance::ChamberA) => area_a * moved(entry),
            (Term::Effect(Effect::DragLeak), Balance::ChamberB) => -area_a * moved(entry),
            (Term::Effect(Effect::FlowMeterGainA), Balance::ChamberA)
            | (Term::Effect(Effect::FlowMeterGainB), Balance::ChamberB) => metered(entry),
            (Term::Nameless(Nameless::DirectionLeak), Balance::ChamberA) => load(entry) * moved(entry),
            (Term::Nameless(Nameless::DirectionLeak), Balance::ChamberB) => -load(entry) * moved(entry),
            _ => 0.0,
        };
        let sharing = terms.iter().enumerate().filter(|(_, term)| SHARING.contains(term));
        Self {
            rows: rows.entries.iter().map(|entry| metered(entry) - swept(entry)).collect(),
            columns: sharing
                .map(|(i, term)| (i, rows.entries.iter().map(|entry| column(*term, entry)).collect()))
                .collect(),
        }
    }
}

/// Terms whose column is the left side of the equation, or a multiple of it, and so carries the residual's own noise.
const SHARING: [Term; 5] = [
    Term::Effect(Effect::PositionGain),
    Term::Effect(Effect::DragLeak),
    Term::Effect(Effect::FlowMeterGainA),
    Term::Effect(Effect::FlowMeterGainB),
    Term::Nameless(Nameless::DirectionLeak),
];

#[cfg(test)]
mod tests {
    use super::hat_weights;

    #[test]
    fn hat_weights_tend_to_two_thirds_and_one_sixth() {
        let (own, next) = hat_weights(200);
        assert!((own / 200.0 - 2.0 / 3.0).abs() < 1e-3 && (next / 200.0 - 1.0 / 6.0).abs() < 1e-3);
    }
}
