use super::blocks::{Block, blocks};
use super::equations::{BothSums, Driven, Equations, Noise};
use super::fit::Fit;
use super::force::ForceBalance;
use super::priors::Priors;
use crate::rig::Rig;
use crate::trace::Record;
use pitchleak_core::{Leak, PerLeak};

/// What both continuity equations say of a stretch of samples, and the force balance.
pub(crate) trait Continuity {
    /// Fits the model with these priors; the fewer the samples, the more the priors say. `None` where readings lead to no
    /// number.
    fn fit_of_any_length(&self, priors: &Priors) -> Option<Fit>;

    /// Fits the model with these priors; `None` where the samples are too few to say anything.
    fn fit(&self, priors: &Priors) -> Option<Fit> {
        self.fit_of_any_length(priors).filter(|fit| fit.row_count() >= LEAST_ROWS)
    }

    /// A fit of any length in which no leak is below zero: oil comes out, never in.
    fn fit_of_outflows(&self, priors: &Priors) -> Option<Fit> {
        self.without_inflows(self.fit_of_any_length(priors)?, *priors)
    }

    /// What `fit`, of these priors, becomes where no leak is below zero. Leaks that would be are taken out, one after the
    /// other, the surest first.
    fn without_inflows(&self, mut fit: Fit, mut priors: Priors) -> Option<Fit> {
        while let Some(inflow) = fit.most_negative_leak() {
            priors = priors.without(inflow);
            fit = self.fit_of_any_length(&priors)?;
        }
        Some(fit)
    }

    /// The rig.
    fn rig(&self) -> &Rig;

    /// From its first sample to its last, s.
    fn duration_s(&self) -> f64;

    /// What drove a leak's flow, on average.
    fn driven(&self, leak: Leak) -> Driven;

    /// The force balance, where the load force was measured.
    fn force_balance(&self) -> Option<ForceBalance>;
}

/// A stretch of which all records are at hand.
pub struct Recorded<'a> {
    pub(super) records: &'a [Record],
    blocks: Vec<Block>,
    rig: &'a Rig,
    duration_s: f64,
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
        let duration_s = records.last()?.t_s - records.first()?.t_s;
        let blocks = blocks(records, &rig.cylinder);
        let equations = Equations::of(&blocks, &Noise::new(rig, PerLeak::default()));
        let sums = BothSums::of(&[&equations]);
        Some(Self { records, blocks, rig, duration_s, equations, sums })
    }
}

impl Continuity for Recorded<'_> {
    fn fit_of_any_length(&self, priors: &Priors) -> Option<Fit> {
        let found = Fit::of(&self.sums, self.rig, priors)?;
        if found.worst() > HOPELESS {
            return Some(found);
        }
        // Pressure noise reaches the equations through the leaks, which only a fit tells.
        let equations = Equations::of(&self.blocks, &Noise::new(self.rig, found.leaks()));
        Fit::of(&BothSums::of(&[&equations]), self.rig, priors)
    }

    fn rig(&self) -> &Rig {
        self.rig
    }

    fn duration_s(&self) -> f64 {
        self.duration_s
    }

    fn driven(&self, leak: Leak) -> Driven {
        Driven::of(&[&self.equations], leak)
    }

    fn force_balance(&self) -> Option<ForceBalance> {
        ForceBalance::of(&self.equations.force, self.rig)
    }
}
