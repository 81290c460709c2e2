//! Columns of single terms at one linearisation: the search for an effect's constants tries many, and each costs the term
//! alone, because the corrected signals are kept.

use super::hats::{ActiveTerm, Step};
use super::linearisation::Linearisation;
use super::rows::{Rows, parts};
use crate::diagnose::data::{Motion, Series};
use crate::diagnose::equation::PerEquation;
use rayon::prelude::*;

/// The corrected signals of all traces, in the order of their rows.
pub(super) struct Steps(Vec<StepsOfPart>);

struct StepsOfPart {
    /// From its first sample to its last.
    steps: Vec<Step>,
    samples_per_block: usize,
}

impl Steps {
    pub(super) fn of(traces: &[Series], motions: &[Motion], at: &Linearisation, block_s: f64) -> Self {
        let parts = parts(traces, block_s);
        let steps = parts.par_iter().map(|part| {
            let (series, motion) = (&traces[part.trace], &motions[part.trace]);
            let steps =
                part.samples.clone().skip(1).map(|number| Step::ending_at(number, series, motion, at).0);
            StepsOfPart { steps: steps.collect(), samples_per_block: part.samples_per_block }
        });
        Self(steps.collect())
    }

    /// The column of one term in `rows`.
    pub(super) fn column(&self, term: &ActiveTerm, at: &Linearisation, rows: &Rows) -> Vec<f64> {
        let hats: Vec<PerEquation<f64>> =
            self.0.par_iter().flat_map_iter(|part| part.hats(term, at)).collect();
        rows.entries.iter().map(|entry| hats[entry.row][entry.equation]).collect()
    }
}

impl StepsOfPart {
    /// The term's integrals weighted by hats, as in [`super::hats`].
    fn hats(&self, term: &ActiveTerm, at: &Linearisation) -> Vec<PerEquation<f64>> {
        let none = PerEquation::<f64>::default();
        let (mut integral, mut block, mut before) = (none, none, None);
        let mut hats = Vec::with_capacity(self.steps.len() / self.samples_per_block);
        let steps = std::iter::once(none).chain(self.steps.iter().map(|step| step.column(term, at)));
        for (number, step) in (1..).zip(steps) {
            integral = integral.zip(step, |sum, more| sum + more);
            block = block.zip(integral, |sum, more| sum + more);
            if number % self.samples_per_block == 0 {
                let mean = std::mem::take(&mut block).map(|sum| sum / self.samples_per_block as f64);
                hats.extend(before.map(|before| mean.zip(before, |now, before| now - before)));
                before = Some(mean);
            }
        }
        hats
    }
}
