// Index loops over const bounds: they read like the algebra and the bounds checks vanish.
#![allow(clippy::needless_range_loop)]

use super::block::Block;
use super::evidence::{Evidence, Foretold, Learnt};
use super::information::{Information, Posterior, Prior, Solution};
use super::parameter::{LEAKS, Parameter, leak_column};
use super::trend::{Elimination, Trend};
use crate::Real;

/// Hypotheses in which the leaks change.
const TRENDS: usize = 5;
/// Their memories, s: an hour down to a few seconds, about a factor of five apart. In between a trend of the
/// nearest memory is at most a fifth less exact.
const MEMORIES_S: [f64; TRENDS] = [3600.0, 480.0, 90.0, 18.0, 4.0];
/// All hypotheses: leaks that stay, and the trends.
const HYPOTHESES: usize = TRENDS + 1;
/// Least ln of a weight beside the best one's. It bounds how long the past of a hypothesis counts for it: from
/// here it needs seven nats of new evidence to be believed.
const LEAST: f64 = -8.5;
/// ln of the weight of each trend before any data, beside leaks that stay.
const UNUSUAL: f64 = -2.0;
/// ln of the weight with which a hypothesis starts anew beside the best.
const ANEW: f64 = -3.0;
/// Recent evidence against a hypothesis that refutes it: by chance once in a million windows.
const REFUTED: f64 = -14.0;
/// ln of the growth of the determinant from which on a block tells more than was known before: twofold in each of
/// the four parameters that there always are.
const NEWS: f64 = 2.77;
/// Leak that may open at once, in prior units: it empties the cylinder in ten seconds at 1/800 of the bulk modulus.
const USUAL_JUMP: f64 = 0.01;
/// Evidence, in nats, from which on a block makes one suspect that the leaks have jumped.
const JUMPED: f64 = 4.0;
/// Memory of the recent evidence, s.
const RECENT_S: f64 = 20.0;

/// Hypotheses of how fast the leaks change, weighed by how well each foretells the data: the rate of change is
/// learnt instead of assumed (multiple models: D. Magill 1965, IEEE Trans. Automatic Control 10; with a floor under
/// the weights, so that each can come back: A. Raftery, M. Kárný, P. Ettler 2010, Technometrics 52, dynamic
/// model averaging).
///
/// What is told is the mixture: its mean, and the covariance about it, which holds what the hypotheses disagree on.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(
    feature = "serde",
    serde(bound(
        serialize = "T: serde::Serialize + Copy",
        deserialize = "T: Real + serde::Deserialize<'de>"
    ))
)]
pub(super) struct ModelBank<T, const N: usize> {
    /// The hypothesis that the leaks stay as they are.
    constant: Information<T, N>,
    /// Its memory, s.
    memory_s: T,
    trends: [Trend<T, N>; TRENDS],
    /// ln of the weights; the best has zero.
    log_weights: [T; HYPOTHESES],
    /// The evidence of the last [`RECENT_S`]; the best has zero.
    recent: [T; HYPOTHESES],
    /// What is known since the block before, if it looked as though the leaks had jumped.
    suspected: Option<Information<T, N>>,
}

/// What the bank knows after a block.
pub(super) struct Outlook<T, const N: usize> {
    /// All parameters as they are now.
    pub now: Solution<T, N>,
    /// Slopes of the leaks, mean and variance, prior units per s; by the trend that foretold the recent data best.
    pub slopes_ps: [(T, T); LEAKS],
    /// Whether the leaks have changed at once: no hypothesis foretells them.
    pub jumped: bool,
}

impl<T: Real, const N: usize> ModelBank<T, N> {
    /// Knows nothing, and will remember for `memory_s` at most.
    pub fn new(memory_s: T) -> Self {
        let mut log_weights = [T::lit(UNUSUAL); HYPOTHESES];
        log_weights[0] = T::zero();
        Self {
            constant: Information::new(),
            memory_s,
            trends: MEMORIES_S.map(|memory| Trend::new(T::lit(memory).min(memory_s))),
            log_weights,
            recent: [T::zero(); HYPOTHESES],
            suspected: None,
        }
    }

    /// The offsets of chambers A and B have moved by something of these variances.
    pub fn drift_zeros(&mut self, variances: &[T; 2]) {
        for (offset, variance) in [Parameter::OffsetA, Parameter::OffsetB].into_iter().zip(variances) {
            if *variance > T::zero() && (offset as usize) < N {
                self.constant.diffuse(offset as usize, *variance);
                for trend in &mut self.trends {
                    trend.diffuse(offset as usize, *variance);
                }
            }
        }
    }

    /// Takes in a block. `inflation` says how much larger than declared the noise is; `reference` are parameters
    /// near the truth: those `known` before.
    pub fn update(
        &mut self,
        block: &Block<T, N>,
        prior: &Prior<'_, T>,
        inflation: T,
        known: &Solution<T, N>,
    ) -> Outlook<T, N> {
        let evidence = Evidence::new(block, prior.mean_0, &known.mean);
        let mut found = [Posterior::zero(); HYPOTHESES];
        let mut gained = [T::zero(); HYPOTHESES];
        let growth;
        self.constant.forget(T::one() / (T::one() + block.time_s / self.memory_s));
        (found[0], gained[0], growth) = update_levels(&mut self.constant, block, prior, &evidence);
        for k in 0..TRENDS {
            (found[k + 1], gained[k + 1]) = update_trend(&mut self.trends[k], block, prior, &evidence);
        }
        let gained = gained.map(|gain| gain / inflation);
        let mut jumped = false;
        let mut suspicion = None;
        // Before there is something to foretell with, all hypotheses say the same, up to rounding.
        if growth < T::lit(NEWS) {
            jumped = self.confirm_jump(block, prior, &evidence, &gained, inflation);
            suspicion = self.suspect_jump(block, prior, &evidence, &gained, inflation, known);
            self.weigh(&gained, block.time_s);
        }
        let now = suspicion.unwrap_or_else(|| self.mixture(&found));
        let outlook = Outlook { now, slopes_ps: self.slopes_ps(&found), jumped };
        self.replace_refuted();
        outlook
    }

    /// Whether a suspected jump foretold this block better than any hypothesis: after a wild reading it does not.
    fn confirm_jump(
        &mut self,
        block: &Block<T, N>,
        prior: &Prior<'_, T>,
        evidence: &Evidence<'_, T, N>,
        gained: &[T; HYPOTHESES],
        inflation: T,
    ) -> bool {
        let Some(mut suspected) = self.suspected.take() else { return false };
        let (_, gain, _) = update_levels(&mut suspected, block, prior, evidence);
        gained.iter().all(|other| gain / inflation > *other)
    }

    /// Holds against the hypotheses that the leaks jumped to anything usual just before this block, all else as
    /// known. Where that is much more likely it is what is known until the next block.
    fn suspect_jump(
        &mut self,
        block: &Block<T, N>,
        prior: &Prior<'_, T>,
        evidence: &Evidence<'_, T, N>,
        gained: &[T; HYPOTHESES],
        inflation: T,
        known: &Solution<T, N>,
    ) -> Option<Solution<T, N>> {
        let mut variance = [T::zero(); N];
        for i in 0..N {
            variance[i] = known.covariance[i][i];
        }
        for i in 0..LEAKS {
            variance[leak_column(i)] += T::lit(USUAL_JUMP * USUAL_JUMP);
        }
        let mut information = Information::of(&known.mean, &variance, prior);
        let (posterior, gain, _) = update_levels(&mut information, block, prior, evidence);
        let mut foretold = T::neg_infinity();
        for k in 0..HYPOTHESES {
            foretold = foretold.max(self.log_weights[k] + gained[k]);
        }
        if gain / inflation - foretold < T::lit(JUMPED) {
            return None;
        }
        self.suspected = Some(information);
        Some(posterior.solution())
    }

    /// Slopes by the trend that foretold the recent data best.
    fn slopes_ps(&self, found: &[Posterior<T, N>; HYPOTHESES]) -> [(T, T); LEAKS] {
        let mut best = 1;
        for k in 2..HYPOTHESES {
            if self.recent[k] > self.recent[best] {
                best = k;
            }
        }
        let mut slopes = [(T::zero(), T::zero()); LEAKS];
        let trend = best.checked_sub(1).and_then(|k| self.trends.get(k));
        let (Some(trend), Some(levels)) = (trend, found.get(best)) else { return slopes };
        let (_, elimination) = trend.eliminate_slopes();
        let mean = elimination.slopes(&levels.mean);
        for i in 0..LEAKS {
            let mut one = [T::zero(); LEAKS];
            one[i] = trend.rate_ps();
            slopes[i] = (trend.rate_ps() * mean[i], elimination.variance(levels, &[T::zero(); N], &one));
        }
        slopes
    }

    fn weigh(&mut self, gained: &[T; HYPOTHESES], time_s: T) {
        let keep = T::one() / (T::one() + time_s / T::lit(RECENT_S));
        for k in 0..HYPOTHESES {
            self.log_weights[k] += gained[k];
            self.recent[k] = keep * self.recent[k] + gained[k];
        }
        below_the_best(&mut self.log_weights);
        below_the_best(&mut self.recent);
        self.log_weights = self.log_weights.map(|weight| weight.max(T::lit(LEAST)));
    }

    fn mixture(&self, found: &[Posterior<T, N>; HYPOTHESES]) -> Solution<T, N> {
        let weights = self.weights();
        let mut mixture = Solution::zero();
        for (weight, posterior) in weights.iter().zip(found) {
            for i in 0..N {
                mixture.mean[i] += *weight * posterior.mean[i];
            }
        }
        for (weight, posterior) in weights.iter().zip(found) {
            if *weight <= T::zero() {
                continue;
            }
            let Solution { mean: mut apart, covariance } = posterior.solution();
            for i in 0..N {
                apart[i] -= mixture.mean[i];
                for j in 0..=i {
                    mixture.covariance[i][j] += *weight * (covariance[i][j] + apart[i] * apart[j]);
                }
            }
        }
        for i in 0..N {
            for j in 0..i {
                mixture.covariance[j][i] = mixture.covariance[i][j];
            }
        }
        mixture
    }

    /// Weights that sum to one; none for a hypothesis at the floor.
    fn weights(&self) -> [T; HYPOTHESES] {
        let least = T::lit(LEAST).libm_exp();
        let mut weights = [T::zero(); HYPOTHESES];
        let mut whole = T::zero();
        for k in 0..HYPOTHESES {
            if self.log_weights[k] > T::lit(LEAST) {
                weights[k] = self.log_weights[k].libm_exp() - least;
                whole += weights[k];
            }
        }
        weights.map(|weight| weight / whole)
    }

    /// A hypothesis that recent data refute goes on from what the best one knows. Only one whose own past would
    /// hold it back longer than the best's: the others forget it by themselves.
    fn replace_refuted(&mut self) {
        let mut best = 0;
        for k in 0..HYPOTHESES {
            if self.recent[k] > self.recent[best] {
                best = k;
            }
        }
        // The best is never refuted: its recent evidence is zero.
        if best == 0 {
            for k in 0..TRENDS {
                if self.is_refuted(k + 1) && self.trends[k].memory_s > T::lit(RECENT_S) {
                    self.trends[k] = Trend::from_levels(self.trends[k].memory_s, self.constant);
                    self.restart(k + 1);
                }
            }
        }
        let Some(source) = best.checked_sub(1).and_then(|k| self.trends.get(k)).copied() else { return };
        if self.is_refuted(0) {
            self.constant = source.eliminate_slopes().0;
            self.restart(0);
        }
        for k in 0..TRENDS {
            if k + 1 < best && self.is_refuted(k + 1) {
                self.trends[k] = Trend::from_trend(self.trends[k].memory_s, &source);
                self.restart(k + 1);
            }
        }
    }

    fn is_refuted(&self, hypothesis: usize) -> bool {
        self.recent.get(hypothesis).is_some_and(|recent| *recent <= T::lit(REFUTED))
    }

    fn restart(&mut self, hypothesis: usize) {
        for weights in [&mut self.log_weights, &mut self.recent] {
            if let Some(weight) = weights.get_mut(hypothesis) {
                *weight = T::lit(ANEW);
            }
        }
    }
}

/// Takes a block into leaks that stay; gives what is known then, ln of the block's probability and the growth of the
/// determinant.
#[cfg_attr(target_os = "none", inline(never))] // once in the flash, not for each caller
fn update_levels<T: Real, const N: usize>(
    information: &mut Information<T, N>,
    block: &Block<T, N>,
    prior: &Prior<'_, T>,
    evidence: &Evidence<'_, T, N>,
) -> (Posterior<T, N>, T, T) {
    let slopes = Elimination::no_slopes();
    let levels = information.solve(prior);
    let pivots = (*levels.pivots(), slopes.pivots);
    let before = Foretold { levels: levels.mean, slopes_ps: [T::zero(); LEAKS], pivots };
    information.add(block);
    let levels = information.solve(prior);
    let after = Learnt { levels: &levels, slopes: &slopes, rate_ps: T::zero() };
    let (gain, growth) = evidence.log_likelihood(&before, &after);
    (levels, gain, growth)
}

#[cfg_attr(target_os = "none", inline(never))]
fn update_trend<T: Real, const N: usize>(
    trend: &mut Trend<T, N>,
    block: &Block<T, N>,
    prior: &Prior<'_, T>,
    evidence: &Evidence<'_, T, N>,
) -> (Posterior<T, N>, T) {
    let rate_ps = trend.rate_ps();
    trend.advance(block.time_s);
    let (information, slopes) = trend.eliminate_slopes();
    let levels = information.solve(prior);
    let slopes_ps = slopes.slopes(&levels.mean).map(|slope| slope * rate_ps);
    let before = Foretold { slopes_ps, pivots: (*levels.pivots(), slopes.pivots), levels: levels.mean };
    trend.add(block);
    let (information, slopes) = trend.eliminate_slopes();
    let levels = information.solve(prior);
    let (gain, _) = evidence.log_likelihood(&before, &Learnt { levels: &levels, slopes: &slopes, rate_ps });
    (levels, gain)
}

/// Each number less the largest.
fn below_the_best<T: Real, const K: usize>(values: &mut [T; K]) {
    let best = values.iter().fold(T::neg_infinity(), |best, value| best.max(*value));
    for value in values {
        *value -= best;
    }
}
