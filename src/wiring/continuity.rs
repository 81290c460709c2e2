use super::blocks::{Block, blocks};
use super::equations::{BothSums, Equations, Noise};
use super::fit::Fit;
use super::force::ForceBalance;
use super::priors::Priors;
use crate::rig::Rig;
use crate::trace::Record;
use pitchleak_core::PerLeak;

/// A stretch of which all records are at hand.
pub struct Recorded<'a> {
    pub(super) records: &'a [Record],
    blocks: Vec<Block>,
    rig: &'a Rig,
    /// With the noise of the sensors alone.
    equations: Equations,
    sums: BothSums,
}

/// Fewer rows say nothing.
const LEAST_ROWS: usize = 30;

/// Pressure noise through the leaks, which halves a residual at the most, can't explain this one.
const HOPELESS: f64 = 20.0;

impl<'a> Recorded<'a> {
    /// Of these records, if there are any. Use an [`Excerpt`](super::Excerpt) of a long trace.
    pub fn new(records: &'a [Record], rig: &'a Rig) -> Option<Self> {
        records.first()?;
        let blocks = blocks(records, &rig.cylinder);
        let equations = Equations::of(&blocks, &Noise::new(rig, PerLeak::default()));
        let sums = BothSums::of(&equations);
        Some(Self { records, blocks, rig, equations, sums })
    }

    /// Fits the model with these priors; the fewer the samples, the more the priors say. `None` where readings lead to no
    /// number.
    fn fit_of_any_length(&self, priors: &Priors) -> Option<Fit> {
        let found = Fit::of(&self.sums, self.rig, priors)?;
        if found.worst() > HOPELESS {
            return Some(found);
        }
        // Pressure noise reaches the equations through the leaks, which only a fit tells.
        let equations = Equations::of(&self.blocks, &Noise::new(self.rig, found.leaks()));
        Fit::of(&BothSums::of(&equations), self.rig, priors)
    }

    /// Fits the model with these priors; `None` where the samples are too few to say anything.
    pub(super) fn fit(&self, priors: &Priors) -> Option<Fit> {
        self.fit_of_any_length(priors).filter(|fit| fit.row_count() >= LEAST_ROWS)
    }

    pub(super) fn rig(&self) -> &Rig {
        self.rig
    }

    /// The force balance, where the load force was measured.
    pub(super) fn force_balance(&self) -> Option<ForceBalance> {
        ForceBalance::of(&self.equations.force, self.rig)
    }
}
