//! The equations integrated against test functions at a linearisation, and the known noise of their residual.

mod integrals;
mod leak_change;
mod linearisation;
mod noise;
mod rows;
mod sensitivity;
mod shared_noise;
mod terms;

pub(crate) use leak_change::{ChangeKind, LeakChange};
pub(crate) use linearisation::Linearisation;
pub(crate) use noise::{Covariances, NoiseModel, Whitening};
pub(crate) use rows::{Entry, RESIDUAL_TESTS, Row, Rows, VARIABLES};
#[cfg(test)]
pub(crate) use shared_noise::NoisyColumn;
pub(crate) use shared_noise::SharedNoise;
pub(crate) use terms::{Columns, DECLARED, Term, Unlisted, all_terms};

use self::integrals::{ActiveTerm, Integrand};
use self::rows::Steps;
use self::sensitivity::Sensitivity;
use crate::diagnose::data::{Channel, Motion, Series, Unresolved};
use crate::diagnose::equation::PerEquation;
use crate::diagnose::thresholds::{BLOCK_S, PIECES};
use pitchleak_core::Sensors;
use pitchleak_core::effects::EffectConstants;
use rayon::prelude::*;
use std::borrow::Cow;
use std::ops::Range;
use std::sync::OnceLock;

/// The weak form of traces at a linearisation; never changed.
pub(crate) struct WeakForm<'a> {
    traces: &'a [Series],
    sensors: &'a Sensors<f64>,
    pub(crate) at: Linearisation,
    motions: Vec<Motion>,
    steps: OnceLock<Steps>,
    pub(crate) rows: Rows,
    /// Where the noise is taken.
    noise_at: Linearisation,
    sensitivities: Vec<PerEquation<Sensitivity>>,
    /// That it was made with.
    equation_error: PerEquation<f64>,
    /// Of the rows with that.
    covariances: Covariances,
    pub(crate) whitening: Whitening,
}

impl<'a> WeakForm<'a> {
    /// Of traces with their fast parts, with the noise that the sensors bring at `noise_at`, and `equation_error` as in [`NoiseModel`].
    pub(crate) fn new(
        (traces, unresolved): (&'a [Series], &[Unresolved]),
        sensors: &'a Sensors<f64>,
        (at, noise_at): (Linearisation, Linearisation),
        columns: Columns<'_>,
        equation_error: PerEquation<f64>,
    ) -> Self {
        let motions = at.motions(traces, sensors);
        let rows = Rows::build(traces, &motions, &Integrand::of(&at, columns), BLOCK_S);
        let mut rows = rows.at_places(columns.places, columns.terms.len());
        rows.add_leak_changes(columns.terms);
        rows.meet_scales(columns.terms);
        let mut sensitivities = Self::sensitivities(&rows, sensors, &noise_at);
        add_unresolved(&mut sensitivities, &mut rows, (traces, unresolved, &motions), (sensors, &noise_at));
        let (of_rows, of_noise) = (&rows, &sensitivities);
        let noise =
            NoiseModel { at: &noise_at, sensors, equation_error, rows: of_rows, sensitivities: of_noise };
        let covariances = Covariances::of(&noise);
        let whitening = Whitening::of(&covariances, &equation_error);
        Self {
            traces,
            sensors,
            at,
            motions,
            steps: OnceLock::new(),
            rows,
            noise_at,
            sensitivities,
            equation_error,
            covariances,
            whitening,
        }
    }

    /// The same with other columns.
    #[must_use]
    pub(crate) fn with_columns(mut self, columns: Columns<'_>) -> Self {
        let rows = Rows::build(self.traces, &self.motions, &Integrand::of(&self.at, columns), BLOCK_S);
        self.rows.columns = rows.at_places(columns.places, columns.terms.len()).columns;
        self.rows.add_leak_changes(columns.terms);
        self.rows.meet_scales(columns.terms);
        self
    }

    /// The noise of these rows, had the equations this error.
    pub(crate) fn noise(&self, equation_error: PerEquation<f64>) -> NoiseModel<'_> {
        self.noise_with(&self.sensitivities, equation_error)
    }

    /// By how much each entry grows with what its meter or the load cell reads.
    pub(crate) fn left_gains(&self) -> impl Iterator<Item = f64> {
        self.rows
            .entries
            .iter()
            .map(|entry| self.sensitivities[entry.row][entry.equation].left_gain(entry.equation))
    }

    /// The covariances of these rows, had the equations this error.
    pub(crate) fn covariances(&self, equation_error: PerEquation<f64>) -> Cow<'_, Covariances> {
        if equation_error == self.equation_error {
            Cow::Borrowed(&self.covariances)
        } else {
            Cow::Owned(Covariances::of(&self.noise(equation_error)))
        }
    }

    /// The rows' noise where leaks let in no more of the pressures' than leaks would that let all of the oil past.
    pub(crate) fn credible_covariances(&self) -> Cow<'_, Covariances> {
        let most = self.rows.leak_of_all_oil();
        let is_more =
            |row: &PerEquation<Sensitivity>| row.iter().any(|(at, own)| own.leak_m3spa() > most[at]);
        if !self.sensitivities.iter().any(is_more) {
            return self.covariances(PerEquation::default());
        }
        let held = |row: &PerEquation<Sensitivity>| {
            PerEquation::from_fn(|equation| row[equation].with_leaks_of_at_most(most[equation]))
        };
        let sensitivities: Vec<_> = self.sensitivities.iter().map(held).collect();
        Cow::Owned(Covariances::of(&self.noise_with(&sensitivities, PerEquation::default())))
    }

    /// The rows' noise at other sensitivities.
    pub(crate) fn noise_with<'b>(
        &'b self,
        sensitivities: &'b [PerEquation<Sensitivity>],
        equation_error: PerEquation<f64>,
    ) -> NoiseModel<'b> {
        let Self { noise_at: at, rows, sensors, .. } = self;
        NoiseModel { at, sensors, equation_error, rows, sensitivities }
    }

    /// The sensitivities, had the sensors their `declared` noise and a share of what they show beyond it.
    pub(crate) fn at_share(&self, declared: &Sensors<f64>, share: f64) -> Vec<PerEquation<Sensitivity>> {
        let times = Channel::ALL.map(|channel| {
            let variance = |sensors| channel.noise_std(sensors, &self.noise_at.model.cylinder).powi(2);
            let quiet = variance(declared) / variance(self.sensors);
            if quiet.is_finite() { (share + (1.0 - share) * quiet).sqrt() } else { 1.0 }
        });
        let of_row =
            |row: &PerEquation<Sensitivity>| PerEquation::from_fn(|equation| row[equation].at_noise(&times));
        self.sensitivities.iter().map(of_row).collect()
    }

    /// How the sensors' noise enters each of the rows.
    pub(crate) fn sensitivities(
        rows: &Rows,
        sensors: &Sensors<f64>,
        at: &Linearisation,
    ) -> Vec<PerEquation<Sensitivity>> {
        rows.rows.par_iter().map(|row| Sensitivity::of(at, sensors, row)).collect()
    }

    /// The noise of `sensors` that the columns share with the residual, in these pieces of the entries.
    pub(crate) fn shared_noise(
        &self,
        sensors: &Sensors<f64>,
        columns: Columns<'_>,
        pieces: &[Range<usize>; PIECES],
    ) -> SharedNoise {
        let noise = NoiseModel { sensors, ..self.noise(PerEquation::default()) };
        SharedNoise::of(&self.rows, &noise, &self.whitening, columns, pieces)
    }

    /// The column of one term, whitened.
    pub(crate) fn white_column(&self, term: Term, constants: EffectConstants<f64>) -> Vec<f64> {
        let steps = self.steps.get_or_init(|| Steps::of(self.traces, &self.motions, &self.at, BLOCK_S));
        let mut column = steps.column(&ActiveTerm::new(term, constants), &self.at, &self.rows);
        self.rows.meet_scale(term, &mut column, &self.rows.y);
        self.whitening.whiten(&column)
    }
}

/// The residual of a model along traces, in test functions over blocks of `block_s`, without any column.
pub(crate) fn residual_rows(
    traces: &[Series],
    sensors: &Sensors<f64>,
    at: &Linearisation,
    block_s: f64,
) -> Rows {
    Rows::build(traces, &at.motions(traces, sensors), &Integrand::new(at, &[], &[]), block_s)
}

/// More noise where a trace moves faster than its samples tell, and where a sensor is somewhere in its play or dead band.
fn add_unresolved(
    sensitivities: &mut [PerEquation<Sensitivity>],
    rows: &mut Rows,
    (traces, unresolved, motions): (&[Series], &[Unresolved], &[Motion]),
    (sensors, at): (&Sensors<f64>, &Linearisation),
) {
    for (own, row) in sensitivities.iter_mut().zip(&mut rows.rows) {
        let samples = row.samples_in(&traces[row.trace()].t_s);
        let mut times = unresolved[row.trace()].noise_factor(samples.clone());
        let motion = &motions[row.trace()];
        let mut has_unseen_force = false;
        for active in at.effects.iter() {
            let Some((channel, sides)) = motion.sides_of(active.effect) else { continue };
            let play = active.value / channel.noise_std(sensors, &at.model.cylinder);
            let somewhere = sides.noise_factor(samples.clone(), play);
            let times = &mut times[channel as usize];
            *times = times.hypot(somewhere);
            has_unseen_force |= somewhere > 1.0;
        }
        *own = PerEquation::from_fn(|equation| own[equation].with_noise_factors(times));
        row.has_unseen_force = own.force.is_speed_unresolved() || has_unseen_force;
    }
}
