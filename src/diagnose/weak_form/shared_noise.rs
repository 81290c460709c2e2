//! What columns share with the residual: noise of the same sensors. Whitened, the mean of a product of both is the trace of Σ⁻¹ times their
//! covariance. That is a band, as [`noise`](super::noise) has it, so the same band of Σ⁻¹ is enough.

use super::linearisation::as_felt;
use super::noise::{NoiseModel, Products, Whitening, rows_apart, test_function_weights};
use super::rows::{Entry, Row, Rows};
use super::terms::{Balances, Columns, Term};
use crate::diagnose::data::Channel;
use crate::diagnose::equation::PerEquation;
use crate::diagnose::thresholds::PIECES;
use pitchleak_core::effects::EffectConstants;
use pitchleak_core::{Effect, Signals};
use rayon::prelude::*;
use std::ops::Range;

/// Means of whitened products of noise, in each piece of the traces.
#[derive(Default)]
pub(crate) struct SharedNoise {
    pub(crate) columns: Vec<NoisyColumn>,
    /// Those of two columns each that are in proportion to the equations' left side.
    pub(crate) products: Vec<(usize, usize, [f64; PIECES])>,
}

/// Those of a column.
pub(crate) struct NoisyColumn {
    pub(crate) term: usize,
    pub(crate) with_residual: [f64; PIECES],
    /// All in all; none of one that is in proportion to the equations' left side.
    pub(crate) with_itself: f64,
}

impl SharedNoise {
    /// That of columns and residual in these `pieces` of the entries.
    pub(super) fn of(
        rows: &Rows,
        noise: &NoiseModel<'_>,
        whitening: &Whitening,
        columns: Columns<'_>,
        pieces: &[Range<usize>; PIECES],
    ) -> Self {
        let residual = Correlations::of(rows, noise, whitening, pieces);
        let column = |place: &usize| ColumnNoise::of(rows, noise, columns, *place);
        let all: Vec<ColumnNoise> = columns.places.par_iter().filter_map(column).collect();
        let of_column = |one: &ColumnNoise| NoisyColumn {
            term: one.term,
            with_residual: residual.traced(|seat| one.with_residual(&residual.gains, seat)),
            with_itself: if one.is_left_side {
                0.0
            } else {
                residual.traced(|seat| one.with(one, &residual.gains, seat)).iter().sum()
            },
        };
        let left: Vec<&ColumnNoise> = all.iter().filter(|one| one.is_left_side).collect();
        let pairs: Vec<_> = (0..left.len()).flat_map(|a| (0..=a).map(move |b| (a, b))).collect();
        let of_pair = |(a, b): &(usize, usize)| {
            let (a, b) = (left[*a], left[*b]);
            (a.term, b.term, residual.traced(|seat| a.with(b, &residual.gains, seat)))
        };
        Self {
            columns: all.par_iter().map(of_column).collect(),
            products: pairs.par_iter().map(of_pair).collect(),
        }
    }
}

/// How an entry takes up unit noise of each channel: by test functions (0), differences (1) and curvatures (2).
type Gains = [[f64; 3]; Channel::ALL.len()];

/// The noise of the residual, and of which entries it is correlated.
struct Correlations {
    /// Of each entry.
    gains: Vec<Gains>,
    /// By the samples of a block: of a row with itself, with the next and with the one before.
    weights: Vec<(usize, [Products; 3])>,
    pairs: Vec<Pair>,
}

/// Two entries, or one and itself.
struct Pair {
    earlier: usize,
    later: usize,
    rows_apart: usize,
    weights: usize,
    piece: usize,
    /// Of Σ⁻¹.
    inverse: f64,
    /// Covariance of their residual.
    covariance: f64,
}

/// Two entries in their order, as one factor of a product and the other have them.
struct Seat<'a> {
    one: usize,
    other: usize,
    /// By the order of the one's noise and the other's.
    weights: &'a Products,
    /// The other way.
    turned: &'a Products,
    /// Covariance of the residual.
    covariance: f64,
}

impl Correlations {
    fn of(
        rows: &Rows,
        noise: &NoiseModel<'_>,
        whitening: &Whitening,
        pieces: &[Range<usize>; PIECES],
    ) -> Self {
        let stds = Channel::ALL.map(|channel| channel.noise_std(noise.sensors, &noise.at.model.cylinder));
        let of_entry = |entry: &Entry| -> Gains {
            let own = &noise.sensitivities[entry.row][entry.equation];
            let units = units(&rows.rows[entry.row]);
            std::array::from_fn(|channel| {
                let std = own.noise_factor[channel] * stds[channel];
                std::array::from_fn(|order| own.gains[channel][order] * std * units[order])
            })
        };
        let gains = rows.entries.iter().map(of_entry).collect();
        let mut all = Self { gains, weights: vec![], pairs: vec![] };
        for (later, inverse) in whitening.inverse().into_iter().enumerate() {
            let own = &rows.entries[later];
            let weights = all.weights_of(rows.rows[own.row].samples);
            let piece = pieces.iter().position(|piece| piece.contains(&later)).unwrap_or(0);
            for (earlier, inverse) in (0..=later).rev().zip(inverse) {
                let Some(rows_apart) = rows_apart(rows, own, &rows.entries[earlier]) else { continue };
                let pair = Pair { earlier, later, rows_apart, weights, piece, inverse, covariance: 0.0 };
                let covariance = all.residual(&all.seats(&pair)[0]);
                all.pairs.push(Pair { covariance, ..pair });
            }
        }
        all
    }

    fn weights_of(&mut self, samples: usize) -> usize {
        self.weights.iter().position(|(known, _)| *known == samples).unwrap_or_else(|| {
            let all = test_function_weights(samples);
            let before = std::array::from_fn(|k| std::array::from_fn(|l| all.next[l][k]));
            self.weights.push((samples, [all.own, all.next, before]));
            self.weights.len() - 1
        })
    }

    /// The earlier entry first, and the later one.
    fn seats(&self, pair: &Pair) -> [Seat<'_>; 2] {
        let [own, next, before] = &self.weights[pair.weights].1;
        let (weights, turned) = if pair.rows_apart == 0 { (own, own) } else { (next, before) };
        let Pair { earlier, later, covariance, .. } = *pair;
        [
            Seat { one: earlier, other: later, weights, turned, covariance },
            Seat { one: later, other: earlier, weights: turned, turned: weights, covariance },
        ]
    }

    fn residual(&self, seat: &Seat<'_>) -> f64 {
        let channels = self.gains[seat.one].iter().zip(&self.gains[seat.other]);
        let of_channel = |(one, other): (&[f64; 3], &[f64; 3])| -> f64 {
            one.iter().zip(seat.weights).map(|(gain, weights)| gain * dot(weights, other)).sum()
        };
        channels.map(of_channel).sum()
    }

    /// The trace of Σ⁻¹ times a covariance, in each piece.
    fn traced(&self, covariance: impl Fn(&Seat<'_>) -> f64) -> [f64; PIECES] {
        let mut sums = [0.0; PIECES];
        for pair in &self.pairs {
            let seats = self.seats(pair);
            let wanted = if pair.earlier == pair.later { &seats[..1] } else { &seats[..] };
            sums[pair.piece] += pair.inverse * wanted.iter().map(&covariance).sum::<f64>();
        }
        sums
    }
}

/// What the weights of each order are times.
fn units(row: &Row) -> [f64; 3] {
    let step_s = row.block_s / row.samples as f64;
    [step_s, 1.0, 1.0 / step_s]
}

fn dot(a: &[f64; 3], b: &[f64; 3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// The noise of a column: that of some signals, and a share of the residual's.
struct ColumnNoise {
    term: usize,
    is_left_side: bool,
    /// As in [`Term::noisy_in`].
    signals: Vec<(Channel, usize)>,
    /// By entry, in the order of the signals.
    gains: Vec<f64>,
    /// By entry, as [`Rows::meet_scale`] brings it in; empty where there is none.
    of_residual: Vec<f64>,
}

impl ColumnNoise {
    fn of(rows: &Rows, noise: &NoiseModel<'_>, columns: Columns<'_>, place: usize) -> Option<Self> {
        let term = columns.terms[place];
        // Curvatures are in what undoes a lag alone, and in a lag's own column.
        let is_lag = |effect: Effect| effect.is_lag();
        let has_lag = noise.at.effects.iter().any(|active| is_lag(active.effect));
        let is_seen =
            |(_, order): &(Channel, usize)| *order < 2 || has_lag || term.effect().is_some_and(is_lag);
        let signals: Vec<_> = term.noisy_in().into_iter().filter(is_seen).collect();
        if signals.is_empty() {
            return None;
        }
        let by_row = slopes(rows, noise, (term, &signals), &columns.constants[place]);
        let stds: Vec<f64> = signals
            .iter()
            .map(|(channel, _)| channel.noise_std(noise.sensors, &noise.at.model.cylinder))
            .collect();
        let of_entry = |entry: &Entry| {
            let units = units(&rows.rows[entry.row]);
            let slopes = by_row[entry.row].iter().zip(&stds).zip(&signals);
            let gain = |((slope, std), (_, order)): ((&PerEquation<f64>, &f64), &(Channel, usize))| {
                slope[entry.equation] * std * units[*order]
            };
            slopes.map(gain).collect::<Vec<f64>>()
        };
        let gains = rows.entries.iter().flat_map(of_entry).collect();
        let mut of_residual = vec![];
        if term.by_reading(&Signals::default()).is_some() {
            of_residual = vec![0.0; rows.entries.len()];
            rows.meet_scale(term, &mut of_residual, &vec![1.0; rows.entries.len()]);
        }
        Some(Self { term: place, is_left_side: term.is_left_side(), signals, gains, of_residual })
    }

    /// By channel and order.
    fn gains(&self, entry: usize) -> impl Iterator<Item = (usize, usize, f64)> {
        let gains = &self.gains[self.signals.len() * entry..];
        self.signals.iter().zip(gains).map(|((channel, order), gain)| (*channel as usize, *order, *gain))
    }

    fn share(&self, entry: usize) -> f64 {
        self.of_residual.get(entry).copied().unwrap_or(0.0)
    }

    /// Covariance of what its signals bring in one entry with what the residual has in another.
    fn by_signals(&self, entry: usize, residual: &Gains, weights: &Products) -> f64 {
        self.gains(entry).map(|(channel, order, gain)| gain * dot(&weights[order], &residual[channel])).sum()
    }

    /// Covariance with the residual.
    fn with_residual(&self, residual: &[Gains], seat: &Seat<'_>) -> f64 {
        self.by_signals(seat.one, &residual[seat.other], seat.weights)
            + self.share(seat.one) * seat.covariance
    }

    /// Covariance with a column.
    fn with(&self, other: &Self, residual: &[Gains], seat: &Seat<'_>) -> f64 {
        let mut sum = 0.0;
        for (channel, order, gain) in self.gains(seat.one) {
            for (_, of_other, others) in other.gains(seat.other).filter(|(own, ..)| *own == channel) {
                sum += gain * others * seat.weights[order][of_other];
            }
        }
        let (share, others) = (self.share(seat.one), other.share(seat.other));
        if others != 0.0 {
            sum += others * self.by_signals(seat.one, &residual[seat.other], seat.weights);
        }
        if share != 0.0 {
            sum += share * other.by_signals(seat.other, &residual[seat.one], seat.turned);
        }
        sum + share * others * seat.covariance
    }
}

/// By how much a term grows with each signal that it carries noise from, row by row.
fn slopes(
    rows: &Rows,
    noise: &NoiseModel<'_>,
    (term, signals): (Term, &[(Channel, usize)]),
    constants: &EffectConstants<f64>,
) -> Vec<Vec<PerEquation<f64>>> {
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
