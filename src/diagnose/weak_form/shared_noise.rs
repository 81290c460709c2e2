//! What columns share with the residual, drawn again and again: noise of the same sensors.

use super::linearisation::as_felt;
use super::noise::{NoiseModel, sample_weights};
use super::rows::{Entry, Row, Rows};
use super::terms::{Balances, Columns, Term};
use crate::diagnose::data::Channel;
use crate::diagnose::equation::PerEquation;
use crate::diagnose::thresholds::NOISE_DRAWS;
use pitchleak_core::Effect;
use pitchleak_core::effects::EffectConstants;
use rayon::prelude::*;
use std::collections::VecDeque;

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

/// Unit noise of one sensor in each row: through test functions (0), differences (1) and curvatures (2).
type InRows = [Vec<f64>; 3];

/// Realisations of unit white noise of every channel as the rows see it: drawn once, as the rows stay the same ones.
pub(crate) struct UnitNoise(Vec<[InRows; Channel::ALL.len()]>);

impl UnitNoise {
    pub(crate) fn draw(rows: &Rows) -> Self {
        let of_number = |number: u64| {
            let mut signs = Rademacher(number);
            Channel::ALL.map(|_| in_rows(&rows.rows, &mut signs))
        };
        Self((0..NOISE_DRAWS).into_par_iter().map(of_number).collect())
    }
}

/// What each row sees of white noise, sample by sample: neighbours share those of a block.
fn in_rows(rows: &[Row], signs: &mut Rademacher) -> InRows {
    let mut seen = InRows::default();
    let (mut known, mut weights) = (0, <[Vec<f64>; 3]>::default());
    let (mut samples, mut stretch) = (VecDeque::new(), usize::MAX);
    for row in rows {
        if known != row.samples {
            (known, weights) = (row.samples, sample_weights(row.samples));
        }
        let gone = if stretch == row.stretch { row.samples } else { samples.len() };
        stretch = row.stretch;
        samples.drain(..gone);
        samples.extend((samples.len()..weights[0].len()).map(|_| signs.next()));
        let step_s = row.block_s / row.samples as f64;
        for ((seen, weights), unit) in seen.iter_mut().zip(&weights).zip([step_s, 1.0, 1.0 / step_s]) {
            seen.push(
                unit * weights.iter().zip(&samples).map(|(weight, sample)| weight * sample).sum::<f64>(),
            );
        }
    }
    seen
}

impl SharedNoise {
    /// Every realisation.
    pub(crate) fn all(unit: &UnitNoise, rows: &Rows, noise: &NoiseModel<'_>, slopes: &Slopes) -> Vec<Self> {
        unit.0.iter().map(|drawn| Self::of(drawn, rows, noise, slopes)).collect()
    }

    fn of(unit: &[InRows; Channel::ALL.len()], rows: &Rows, noise: &NoiseModel<'_>, slopes: &Slopes) -> Self {
        let stds = Channel::ALL.map(|channel| channel.noise_std(noise.sensors, &noise.at.model.cylinder));
        let in_row = |entry: &Entry| {
            let sensitivity = &noise.sensitivities[entry.row][entry.equation];
            let of_one = |channel: Channel| {
                let place = channel as usize;
                let orders = sensitivity.gains[place].iter().zip(&unit[place]);
                let of_unit: f64 = orders.map(|(gain, unit)| gain * unit[entry.row]).sum();
                sensitivity.noise_factor[place] * stds[place] * of_unit
            };
            Channel::ALL.into_iter().map(of_one).sum()
        };
        let in_rows: Vec<f64> = rows.entries.iter().map(in_row).collect();
        let columns = slopes.0.iter().map(|SlopesOfTerm { place, term, signals, by_row }| {
            let in_column = |entry: &Entry| {
                let signals = signals.iter().zip(&by_row[entry.row]);
                let of_one = |((channel, order), slope): (&(Channel, usize), &PerEquation<f64>)| {
                    let place = *channel as usize;
                    slope[entry.equation] * stds[place] * unit[place][*order][entry.row]
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
        // Curvatures are in what undoes a lag alone, and in a lag's own column.
        let has_lag = noise.at.effects.iter().any(|active| active.effect.is_lag());
        let has_curvature = |term: Term| has_lag || term.effect().is_some_and(Effect::is_lag);
        let of_term = |place: &usize| {
            let (term, constants) = (columns.terms[*place], &columns.constants[*place]);
            let signals: Vec<_> =
                term.noisy_in().into_iter().filter(|(_, order)| *order < 2 || has_curvature(term)).collect();
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
    let own = term.balances();
    let balances = |channel: Channel| match channel {
        // Forces feel another speed than the position's.
        Channel::FeltSpeed => Balances { chambers: false, ..own },
        Channel::Position | Channel::FlowA | Channel::FlowB => Balances { force: false, ..own },
        Channel::PressureA | Channel::PressureB | Channel::Force => own,
    };
    let of_row = |row: &Row| {
        let slope = |(channel, order): &(Channel, usize)| {
            let std = channel.noise_std(noise.sensors, &noise.at.model.cylinder);
            channel.slope(*order, &row.mean, (std, row.block_s), |reading| {
                let seen = noise.at.effects.correct(reading);
                let felt = as_felt(&seen, reading);
                noise.at.both_unit_terms((term, balances(*channel)), constants, &seen, &felt)
            })
        };
        signals.iter().map(slope).collect()
    };
    rows.rows.iter().map(of_row).collect()
}

#[cfg(test)]
mod tests {
    use super::super::noise::test_function_weights;
    use super::*;
    use pitchleak_core::Signals;

    /// What is drawn has the covariances that the rows are whitened by: of each row with itself and with the next, at every order.
    #[test]
    fn noise_that_is_drawn_has_the_covariance_that_is_assumed() {
        const ROWS: usize = 40_000;
        let row = Row {
            stretch: 0,
            t_s: 0.0,
            block_s: 5.0,
            samples: 5,
            mean: Signals::default(),
            unsure_share: 0.0,
            has_unseen_force: false,
            has_leak_change: false,
        };
        let seen = in_rows(&vec![row; ROWS], &mut Rademacher(1));
        let weights = test_function_weights(row.samples);
        for (apart, expected) in [(0, weights.own), (1, weights.next)] {
            for (one, other) in (0..9).map(|pair| (pair / 3, pair % 3)) {
                let products = seen[one].iter().skip(apart).zip(&seen[other]).map(|(later, own)| later * own);
                let mean = products.sum::<f64>() / (ROWS - apart) as f64;
                let size = (weights.own[one][one] * weights.own[other][other]).sqrt();
                let off = (mean - expected[other][one]) / size;
                assert!(off.abs() < 0.03, "{one} {other} {apart}: {mean} {}", expected[other][one]);
            }
        }
    }
}
