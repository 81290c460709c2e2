//! The noise that some columns share with what the model leaves over, drawn again and again.

use super::noise_model::{HatWeights, NoiseModel, hat_weights};
use super::rows::{Entry, Row, Rows};
use super::terms::Term;
use crate::diagnose::equation::{Equation, PerEquation};
use pitchleak_core::effects::{EffectConstants, LeftSide};
use pitchleak_core::{Model, Signals};

/// One realisation of the noise that some columns share with the residual, because they are the left
/// side of the equation itself.
pub(crate) struct SharedNoise {
    /// In the rows.
    pub(crate) rows: Vec<f64>,
    /// In the columns that have it.
    pub(crate) columns: Vec<(usize, Vec<f64>)>,
}

/// Signs without an order, each as likely as the other (splitmix64), the same on every machine.
struct Rademacher(u64);

impl Rademacher {
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
fn draw(rows: &[Row], signs: &mut Rademacher) -> InRows {
    let (mut difference, mut hat) = (Vec::with_capacity(rows.len()), Vec::with_capacity(rows.len()));
    let mut last = (usize::MAX, 0.0);
    let mut known = (0, HatWeights::default());
    for row in rows {
        let left = if last.0 == row.stretch { last.1 } else { signs.next() };
        let right = signs.next();
        last = (row.stretch, right);
        if known.0 != row.samples {
            known = (row.samples, hat_weights(row.samples));
        }
        let HatWeights { own, next } = known.1;
        let step_s = row.block_s / row.samples as f64;
        difference.push((right - left) / (row.samples as f64).sqrt());
        let shared = next.max(0.0).sqrt() * (left + right);
        hat.push(step_s * (shared + (own - 2.0 * next).max(0.0).sqrt() * signs.next()));
    }
    InRows { difference, hat }
}

impl SharedNoise {
    /// The `number`th realisation.
    pub(crate) fn draw(rows: &Rows, noise: &NoiseModel<'_>, terms: &[Term], number: u64) -> Self {
        let mut signs = Rademacher(number);
        let [position, flow_a, flow_b] = std::array::from_fn(|_| draw(&rows.rows, &mut signs));
        let moved = |entry: &Entry| noise.sensors.position.noise_std * position.difference[entry.row];
        let metered = |entry: &Entry| match entry.equation {
            Equation::ChamberA => noise.sensors.flow_a.noise_std * flow_a.hat[entry.row],
            Equation::ChamberB => noise.sensors.flow_b.noise_std * flow_b.hat[entry.row],
            Equation::Force => 0.0,
        };
        let swept = |entry: &Entry| match entry.equation {
            Equation::Force => 0.0,
            chamber => noise.swept_area(chamber) * moved(entry),
        };
        let column = |term: Term, carried: LeftSide| {
            let of_entry = |entry: &Entry| {
                let at = &rows.rows[entry.row].mean;
                let noise_of_one = match (carried, entry.equation) {
                    (LeftSide::Speed, Equation::ChamberA | Equation::ChamberB) => moved(entry),
                    (LeftSide::FlowA, Equation::ChamberA) | (LeftSide::FlowB, Equation::ChamberB) => {
                        metered(entry)
                    }
                    _ => return 0.0,
                };
                slope(term, carried, at, &noise.at.model)[entry.equation] * noise_of_one
            };
            rows.entries.iter().map(of_entry).collect()
        };
        let carrying = terms.iter().enumerate().filter_map(|(i, term)| Some((i, *term, term.carries()?)));
        Self {
            rows: rows.entries.iter().map(|entry| metered(entry) - swept(entry)).collect(),
            columns: carrying.map(|(i, term, carried)| (i, column(term, carried))).collect(),
        }
    }
}

/// By how much a term grows with the speed or the flow of its equation's left side, in which it is linear.
fn slope(term: Term, carried: LeftSide, at: &Signals<f64>, model: &Model<f64>) -> PerEquation<f64> {
    let rest = Signals { v_mps: 0.0, qa_m3s: 0.0, qb_m3s: 0.0, ..*at };
    let one = match carried {
        LeftSide::Speed => Signals { v_mps: 1.0, ..rest },
        LeftSide::FlowA => Signals { qa_m3s: 1.0, ..rest },
        LeftSide::FlowB => Signals { qb_m3s: 1.0, ..rest },
    };
    let term = |at: &Signals<f64>| term.unit_term(at, model, &EffectConstants::default());
    term(&one).plus(-1.0, term(&rest)).into()
}
