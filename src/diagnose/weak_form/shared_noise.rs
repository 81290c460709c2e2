//! What columns share with the residual, drawn again and again: noise of the same sensors.

use super::noise::{NoiseModel, TestFunctionWeights, test_function_weights};
use super::rows::{Entry, Row, Rows};
use super::terms::{Columns, Term};
use crate::diagnose::data::Channel;
use crate::diagnose::equation::PerEquation;
use pitchleak_core::effects::EffectConstants;
use rayon::prelude::*;

/// One realisation of the noise that some columns share with the residual.
pub(crate) struct SharedNoise {
    /// In the rows.
    pub(crate) rows: Vec<f64>,
    /// In the columns that have it.
    pub(crate) columns: Vec<NoisyColumn>,
}

/// The noise of one column.
pub(crate) struct NoisyColumn {
    pub(crate) term: usize,
    /// Whether the column is in proportion to the equations' left side.
    pub(crate) is_left_side: bool,
    pub(crate) noise: Vec<f64>,
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

/// Noise of one sensor in each row: through test functions (0), and through differences of block means (1).
type InRows = [Vec<f64>; 2];

/// Unit white noise seen by each row. A test function's noise is that of its two blocks, which it shares with its
/// neighbours, and its own, in the shares that give the known covariances.
fn draw(rows: &[Row], signs: &mut Rademacher) -> InRows {
    let (mut difference, mut weighted) = (Vec::with_capacity(rows.len()), Vec::with_capacity(rows.len()));
    let mut last = (usize::MAX, 0.0);
    let mut known = (0, TestFunctionWeights::default());
    for row in rows {
        let left = if last.0 == row.stretch { last.1 } else { signs.next() };
        let right = signs.next();
        last = (row.stretch, right);
        if known.0 != row.samples {
            known = (row.samples, test_function_weights(row.samples));
        }
        let (own, next) = (known.1.own[0][0], known.1.next[0][0]);
        let step_s = row.block_s / row.samples as f64;
        difference.push((right - left) / (row.samples as f64).sqrt());
        let shared = next.max(0.0).sqrt() * (left + right);
        weighted.push(step_s * (shared + (own - 2.0 * next).max(0.0).sqrt() * signs.next()));
    }
    [weighted, difference]
}

impl SharedNoise {
    /// The `number`th realisation.
    pub(crate) fn draw(rows: &Rows, noise: &NoiseModel<'_>, slopes: &Slopes, number: u64) -> Self {
        let mut signs = Rademacher(number);
        let of_channel = |channel: Channel| {
            let std = channel.noise_std(noise.sensors, &noise.at.model.cylinder);
            draw(&rows.rows, &mut signs).map(|drawn| drawn.into_iter().map(|v| std * v).collect())
        };
        let drawn: [InRows; Channel::ALL.len()] = Channel::ALL.map(of_channel);
        let in_row = |entry: &Entry| {
            let sensitivity = &noise.sensitivities[entry.row][entry.equation];
            let of_one = |((gains, noise_factor), drawn): ((&[f64; 3], &f64), &InRows)| {
                noise_factor * (gains[0] * drawn[0][entry.row] + gains[1] * drawn[1][entry.row])
            };
            sensitivity.gains.iter().zip(&sensitivity.noise_factor).zip(&drawn).map(of_one).sum()
        };
        let in_rows: Vec<f64> = rows.entries.iter().map(in_row).collect();
        let columns = slopes.0.iter().map(|SlopesOfTerm { place, term, signals, by_row }| {
            let noise_of = |channel: Channel, order: usize| &drawn[channel as usize][order];
            let in_column = |entry: &Entry| {
                let signals = signals.iter().zip(&by_row[entry.row]);
                let of_one = |((channel, order), slope): (&(Channel, usize), &PerEquation<f64>)| {
                    slope[entry.equation] * noise_of(*channel, *order)[entry.row]
                };
                signals.map(of_one).sum()
            };
            let mut own: Vec<f64> = rows.entries.iter().map(in_column).collect();
            rows.meet_scale(*term, &mut own, &in_rows);
            NoisyColumn { term: *place, is_left_side: term.is_left_side(), noise: own }
        });
        let columns = columns.collect();
        Self { rows: in_rows, columns }
    }
}

/// By how much the terms that carry noise grow with each signal they carry it from.
pub(crate) struct Slopes(Vec<SlopesOfTerm>);

struct SlopesOfTerm {
    place: usize,
    term: Term,
    /// As in [`Term::noisy_in`].
    signals: Vec<(Channel, usize)>,
    /// By row, in their order.
    by_row: Vec<Vec<PerEquation<f64>>>,
}

impl Slopes {
    pub(crate) fn of(rows: &Rows, noise: &NoiseModel<'_>, columns: Columns<'_>) -> Self {
        let of_term = |place: &usize| {
            let (term, constants) = (columns.terms[*place], &columns.constants[*place]);
            let signals = term.noisy_in();
            let by_row = slopes(rows, noise, (term, &signals), constants);
            (!signals.is_empty()).then_some(SlopesOfTerm { place: *place, term, signals, by_row })
        };
        Self(columns.places.par_iter().filter_map(of_term).collect())
    }
}

/// Those of one term, row by row.
fn slopes(
    rows: &Rows,
    noise: &NoiseModel<'_>,
    (term, signals): (Term, &[(Channel, usize)]),
    constants: &EffectConstants<f64>,
) -> Vec<Vec<PerEquation<f64>>> {
    if signals.is_empty() {
        return vec![];
    }
    let term = (term, term.in_force());
    let of_row = |row: &Row| {
        let seen = noise.at.effects.correct(&row.mean);
        let slope = |(channel, order): &(Channel, usize)| {
            let std = channel.noise_std(noise.sensors, &noise.at.model.cylinder);
            channel.slope(*order, &seen, (std, row.block_s), |at| {
                let mut unit = noise.at.both_unit_terms(term, constants, at, at);
                // Forces feel another speed than the position's.
                match *channel {
                    Channel::FeltSpeed => (unit.chamber_a, unit.chamber_b) = (0.0, 0.0),
                    Channel::Position | Channel::FlowA | Channel::FlowB => unit.force = 0.0,
                    Channel::PressureA | Channel::PressureB | Channel::Force => {}
                }
                unit
            })
        };
        signals.iter().map(slope).collect()
    };
    rows.rows.iter().map(of_row).collect()
}
