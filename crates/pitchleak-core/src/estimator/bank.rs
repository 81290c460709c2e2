// Index loops over const bounds: they read like the algebra and the bounds checks vanish.
#![allow(clippy::needless_range_loop)]

use super::evidence::Evidence;
use super::hypothesis::{Hypothesis, Mixture};
use super::information::{Posterior, Prior, Solution};
use super::prior::{LEAKS, Parameter, leak_column};
use crate::Real;

/// Hypotheses in which the leaks change.
const TRENDS: usize = 5;
/// Their memories, s: an hour down to a few seconds, about a factor of five apart. In between a trend of the
/// nearest memory is at most a fifth less exact.
const MEMORIES_S: [f64; TRENDS] = [3600.0, 480.0, 90.0, 18.0, 4.0];
/// All hypotheses: leaks that stay, and the trends.
const HYPOTHESES: usize = TRENDS + 1;
/// What comes in a renewal once all of them were heard.
const CONCLUDE: u8 = HYPOTHESES as u8;
const REPLACE: u8 = CONCLUDE + 1;
const DONE: u8 = REPLACE + 1;
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
///
/// A renewal is spread over several samples, so that none of them takes much longer than the others: [`begin`](Self::begin)
/// takes in what has been seen, and each sample hears one hypothesis, first of all a jump that is suspected. As soon as it has foretold
/// best it is told; else the next sample concludes. The one after replaces what was refuted.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(bound = "T: crate::Saved"))]
pub(super) struct Bank<T, const N: usize> {
    /// That the leaks stay as they are, then the trends.
    hypotheses: [Hypothesis<T, N>; HYPOTHESES],
    /// ln of the weights; the best has zero.
    log_weights: [T; HYPOTHESES],
    /// The evidence of the last [`RECENT_S`]; the best has zero.
    recent: [T; HYPOTHESES],
    /// Of the latest block.
    pub evidence: Evidence<T, N>,
    /// What is next in a renewal: the hypothesis of this number, [`CONCLUDE`], [`REPLACE`], or nothing.
    next: u8,
    pending: Pending<T, N>,
}

/// What waits for more.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(bound = "T: crate::Saved"))]
enum Pending<T, const N: usize> {
    Nothing,
    /// It looks as though the leaks had jumped; this is what is known since. The next block tells.
    Jump(Hypothesis<T, N>),
    Renewal(Renewal<T, N>),
}

/// A renewal, half done.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(bound = "T: crate::Saved"))]
struct Renewal<T, const N: usize> {
    /// Variances by which the offsets of chambers A and B have moved.
    drifted: [T; 2],
    /// How much larger than declared the noise is.
    inflation: T,
    /// The trend that foretold the recent data best before.
    best_trend: u8,
    /// ln of the block's probability by each.
    gained: [T; HYPOTHESES],
    /// The same by the jump that was suspected before.
    by_jump: Option<T>,
    /// The block tells more than was known before.
    news: bool,
    /// Slopes of the leaks, mean and variance, prior units per s, by the trend that foretold the recent data best before.
    slopes_ps: [(T, T); LEAKS],
    mixture: Mixture<T, N>,
}

/// What the bank says of a block.
pub(super) enum Heard<T> {
    /// Nothing new.
    Part,
    /// The leaks have changed at once: no hypothesis foretells them.
    Jumped,
    /// What is known is new.
    All(Outlook<T>),
}

/// What the bank knows after a block.
pub(super) struct Outlook<T> {
    /// Slopes of the leaks, mean and variance, prior units per s; by the trend that foretold best what came before the block.
    pub slopes_ps: [(T, T); LEAKS],
    /// Σ (y − fᵀθ)² of the block by what is known now, and its number of rows.
    pub chi_square: (T, T),
}

impl<T: Real, const N: usize> Bank<T, N> {
    /// Knows nothing, and will remember for `memory_s` at most.
    pub fn new(memory_s: T) -> Self {
        let mut hypotheses = [Hypothesis::steady(memory_s); HYPOTHESES];
        for (hypothesis, memory) in hypotheses.iter_mut().skip(1).zip(MEMORIES_S) {
            *hypothesis = Hypothesis::trend(T::lit(memory).at_most(memory_s));
        }
        Self {
            hypotheses,
            log_weights: unheard(),
            recent: [T::zero(); HYPOTHESES],
            evidence: Evidence::none(),
            next: DONE,
            pending: Pending::Nothing,
        }
    }

    /// Knows nothing again.
    pub fn forget_all(&mut self) {
        for hypothesis in &mut self.hypotheses {
            hypothesis.forget_all();
        }
        self.log_weights = unheard();
        self.recent = [T::zero(); HYPOTHESES];
        self.next = DONE;
        self.pending = Pending::Nothing;
    }

    /// Begins to take in the block of `evidence`, after which zeros have moved by something of the variances `drifted`; `inflation` says how
    /// much larger than declared the noise is, `known` is what was known before.
    #[cfg_attr(target_os = "none", inline(never))] // its stack is none of the other samples'
    pub fn begin(&mut self, drifted: [T; 2], inflation: T, prior: &Prior<'_, T>, known: &Solution<T, N>) {
        let by_jump = match &mut self.pending {
            Pending::Jump(jumped) => Some(self.evidence.gain(jumped, prior, &known.mean) / inflation),
            _ => None,
        };
        self.pending = Pending::Renewal(Renewal {
            drifted,
            inflation,
            best_trend: best_trend(&self.recent),
            gained: [T::zero(); HYPOTHESES],
            by_jump,
            news: false,
            slopes_ps: [(T::zero(), T::zero()); LEAKS],
            mixture: Mixture::new(),
        });
        self.next = 0;
        if by_jump.is_none() {
            self.hear(prior, known);
        }
    }

    /// Whether a renewal is half done.
    #[inline]
    pub fn is_renewing(&self) -> bool {
        self.next < DONE
    }

    /// Goes on with a renewal, which began with this `prior` and what was `known`.
    #[cfg_attr(target_os = "none", inline(never))]
    pub fn go_on(&mut self, prior: &Prior<'_, T>, known: &mut Solution<T, N>) -> Heard<T> {
        match self.next {
            CONCLUDE => return self.conclude(prior, known),
            REPLACE => self.replace_refuted(),
            _ => self.hear(prior, known),
        }
        match &self.pending {
            Pending::Renewal(renewal) if self.next == CONCLUDE && renewal.has_jumped() => Heard::Jumped,
            _ => Heard::Part,
        }
    }

    /// The next hypothesis is heard.
    #[cfg_attr(target_os = "none", inline(never))] // once in the flash, not for each caller
    fn hear(&mut self, prior: &Prior<'_, T>, known: &Solution<T, N>) {
        let Pending::Renewal(renewal) = &mut self.pending else { return };
        let next = usize::from(self.next);
        if let (Some(hypothesis), Some(weight)) = (self.hypotheses.get_mut(next), self.log_weights.get(next))
        {
            renewal.hear(self.next, hypothesis, *weight, &self.evidence, prior, known);
        }
        self.next += 1;
    }

    /// Weighs the hypotheses, all of which were heard.
    #[cfg_attr(target_os = "none", inline(never))]
    fn conclude(&mut self, prior: &Prior<'_, T>, known: &mut Solution<T, N>) -> Heard<T> {
        let Pending::Renewal(renewal) = &self.pending else { return Heard::Part };
        let Renewal { gained, news, slopes_ps, .. } = *renewal;
        let mut jumped = Hypothesis::steady(T::infinity());
        let mut after = Posterior::room();
        if !news && self.suspects_jump(renewal, prior, known, &mut jumped, &mut after) {
            *known = after.solution();
            self.pending = Pending::Jump(jumped);
        } else {
            *known = renewal.mixture.solution();
            self.pending = Pending::Nothing;
        }
        if !news {
            self.weigh(&gained, self.evidence.block.time_s);
        }
        self.next = REPLACE;
        Heard::All(Outlook { slopes_ps, chi_square: self.evidence.block.chi_square(&known.mean) })
    }

    /// Holds against the hypotheses that the leaks jumped to anything usual just before this block, all else as
    /// known, as `jumped` says then, of which `after` is known. Whether that is much more likely.
    fn suspects_jump(
        &self,
        renewal: &Renewal<T, N>,
        prior: &Prior<'_, T>,
        known: &Solution<T, N>,
        jumped: &mut Hypothesis<T, N>,
        after: &mut Posterior<T, N>,
    ) -> bool {
        let mut variance = [T::zero(); N];
        for i in 0..N {
            variance[i] = known.covariance[i][i];
        }
        for i in 0..LEAKS {
            variance[leak_column(i)] += T::lit(USUAL_JUMP * USUAL_JUMP);
        }
        let pivots = variance.map(|variance| T::one() / variance);
        jumped.known.set(&known.mean, &pivots, prior);
        let (gain, _) = self.evidence.teach(jumped, prior, &known.mean, after);
        let mut foretold = T::neg_infinity();
        for k in 0..HYPOTHESES {
            foretold = (self.log_weights[k] + renewal.gained[k]).at_least(foretold);
        }
        gain / renewal.inflation - foretold >= T::lit(JUMPED)
    }

    fn weigh(&mut self, gained: &[T; HYPOTHESES], time_s: T) {
        let keep = T::one() / (T::one() + time_s / T::lit(RECENT_S));
        for k in 0..HYPOTHESES {
            self.log_weights[k] += gained[k];
            self.recent[k] = keep * self.recent[k] + gained[k];
        }
        below_the_best(&mut self.log_weights);
        below_the_best(&mut self.recent);
        self.log_weights = self.log_weights.map(|weight| weight.at_least(T::lit(LEAST)));
    }

    /// A hypothesis that recent data refute goes on from what the best one knows. Only one whose own past would
    /// hold it back longer than the best's: the others forget it by themselves.
    #[cfg_attr(target_os = "none", inline(never))]
    fn replace_refuted(&mut self) {
        let mut best = 0;
        for k in 0..HYPOTHESES {
            if self.recent[k] > self.recent[best] {
                best = k;
            }
        }
        // The best is never refuted: its recent evidence is zero.
        for k in 0..HYPOTHESES {
            if k != best && self.is_refuted(k) {
                self.replace(k, best);
            }
        }
        self.next = DONE;
    }

    #[cfg_attr(target_os = "none", inline(never))]
    fn replace(&mut self, refuted: usize, best: usize) {
        let Ok([hypothesis, source]) = self.hypotheses.get_disjoint_mut([refuted, best]) else { return };
        // Only one whose own past holds it back longer: leaks that stay, or a longer memory; and none that is as quick as the
        // evidence itself.
        let longer = if best == 0 { hypothesis.memory_s > T::lit(RECENT_S) } else { refuted < best };
        if longer {
            hypothesis.take_over(source);
            self.restart(refuted);
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

impl<T: Real, const N: usize> Renewal<T, N> {
    /// The jump that was suspected foretold best. After a wild reading it does not.
    fn has_jumped(&self) -> bool {
        let best = |gain: T| self.gained.iter().all(|other| gain > *other);
        !self.news && self.by_jump.is_some_and(best)
    }

    /// The hypothesis of number `own` takes the block in, and is heard: it weighs by what it was believed before, and not at all where
    /// that was the least.
    fn hear(
        &mut self,
        own: u8,
        hypothesis: &mut Hypothesis<T, N>,
        log_weight: T,
        evidence: &Evidence<T, N>,
        prior: &Prior<'_, T>,
        known: &Solution<T, N>,
    ) {
        for (offset, variance) in moved::<T, N>(&self.drifted) {
            hypothesis.known.diffuse(offset, variance);
        }
        hypothesis.advance(evidence.block.time_s);
        let mut posterior = Posterior::room();
        let (gain, growth) = evidence.teach(hypothesis, prior, &known.mean, &mut posterior);
        if own == self.best_trend {
            self.slopes_ps = posterior.slopes();
        }
        if own == 0 {
            // Before there is something to foretell with, all hypotheses say the same, up to rounding.
            self.news = growth >= T::lit(NEWS);
        }
        let gained = if self.news { T::zero() } else { gain / self.inflation };
        if let Some(own) = self.gained.get_mut(usize::from(own)) {
            *own = gained;
        }
        if log_weight > T::lit(LEAST) {
            let share = T::one() - (T::lit(LEAST) - log_weight).libm_exp();
            self.mixture.add(share, log_weight + gained, &posterior);
        }
    }
}

/// The trend that foretold the recent data best, the first of those that did so alike.
fn best_trend<T: Real>(recent: &[T; HYPOTHESES]) -> u8 {
    let mut best = (0, T::neg_infinity());
    for (trend, evidence) in (0_u8..).zip(recent).skip(1) {
        if *evidence > best.1 {
            best = (trend, *evidence);
        }
    }
    best.0
}

/// ln of the weights before any data.
fn unheard<T: Real>() -> [T; HYPOTHESES] {
    let mut log_weights = [T::lit(UNUSUAL); HYPOTHESES];
    log_weights[0] = T::zero();
    log_weights
}

/// Offsets that have moved, and the variances by which.
fn moved<T: Real, const N: usize>(variances: &[T; 2]) -> impl Iterator<Item = (usize, T)> {
    let offsets = [Parameter::OffsetA as usize, Parameter::OffsetB as usize];
    let there = if N > Parameter::OffsetB as usize { offsets.len() } else { 0 };
    offsets
        .into_iter()
        .zip(*variances)
        .take(there)
        .filter(|(offset, variance)| *offset < N && *variance > T::zero())
}

/// Each number less the largest.
fn below_the_best<T: Real, const K: usize>(values: &mut [T; K]) {
    let best = values.iter().fold(T::neg_infinity(), |best, value| value.at_least(best));
    for value in values {
        *value -= best;
    }
}

#[cfg(test)]
mod tests {
    use super::super::block::{Block, BlockSums};
    use super::*;

    const PRIOR: Prior<'static, f64> = Prior { mean_0: 0.0, offsets: &[[1.0, 0.0], [0.0, 1.0]] };

    /// Each hypothesis has seen another leak.
    fn told() -> Bank<f64, 4> {
        let mut bank = Bank::new(f64::INFINITY);
        for (k, hypothesis) in bank.hypotheses.iter_mut().enumerate() {
            let mut sums = BlockSums::new();
            (0..9).for_each(|_| sums.add(&[0.0, 1.0, 0.0, 0.0], &[0.0; LEAKS], k as f64, 1e3));
            hypothesis.learn(&Block::new(0.5, &sums, &[None; 2], 0.0));
        }
        bank
    }

    /// The leaks that the hypotheses know, by the number of the one that saw them.
    fn known(bank: &Bank<f64, 4>) -> [i32; HYPOTHESES] {
        bank.hypotheses.map(|hypothesis| hypothesis.solved(&PRIOR).mean[1].round() as i32)
    }

    /// Who is refuted takes over what the best knows, if its own past holds it back longer than the best's; the best stays as it is,
    /// and who forgets sooner by itself does so.
    #[test]
    fn the_refuted_learn_from_the_best() {
        for (best, expected) in [
            (0, [0, 0, 0, 0, 4, 5]),
            (3, [3, 3, 3, 3, 4, 5]),
            (5, [5, 5, 5, 5, 5, 5]),
            (1, [1, 1, 2, 3, 4, 5]),
        ] {
            let mut bank = told();
            bank.recent = [REFUTED - 1.0; HYPOTHESES];
            bank.recent[best] = 0.0;
            bank.replace_refuted();
            assert_eq!(known(&bank), expected, "{best} is best");
            assert!(bank.log_weights[best] > ANEW || best > 0, "{:?}", bank.log_weights);
        }
        let mut bank = told();
        bank.recent = [REFUTED + 1.0, 0.0, 0.0, 0.0, 0.0, 0.0];
        bank.replace_refuted();
        assert_eq!(known(&bank), [0, 1, 2, 3, 4, 5], "nobody is refuted");
    }

    /// What spoke against a hypothesis counts for 1/e after twenty seconds, and its weight not less than the least.
    #[test]
    fn evidence_fades() {
        let mut bank = Bank::<f64, 4>::new(f64::INFINITY);
        bank.weigh(&[0.0, -10.0, 0.0, 0.0, 0.0, 0.0], 0.5);
        assert!((bank.recent[1] + 10.0).abs() < 1e-12);
        assert!((bank.log_weights[1] - LEAST).abs() < 1e-12, "{:?}", bank.log_weights);
        (0..40).for_each(|_| bank.weigh(&[0.0; HYPOTHESES], 0.5));
        let left = -bank.recent[1] / 10.0;
        assert!((left - (-1.0_f64).exp()).abs() < 0.01, "{left}");
    }

    /// Which of ten blocks, each of which tells a leak to a thousandth of the prior, say that it jumped;
    /// `leak` in thousandths.
    fn jumps(inflation: f64, leak: impl Fn(usize) -> f64) -> std::vec::Vec<usize> {
        let mut bank = Bank::<f64, 4>::new(f64::INFINITY);
        let mut solution = Solution::of_prior(PRIOR.offsets);
        let has_jumped = |block: &usize| {
            let mut sums = BlockSums::new();
            sums.add(&[0.0, 1.0, 0.0, 0.0], &[0.0; LEAKS], 1e-3 * leak(*block), 1e6);
            bank.evidence.block = Block::new(0.5, &sums, &[None; 2], 0.0);
            bank.evidence.refer(0.0, &solution.mean);
            bank.begin([0.0; 2], inflation, &PRIOR, &solution);
            let mut jumped = false;
            while bank.is_renewing() && !jumped {
                jumped = matches!(bank.go_on(&PRIOR, &mut solution), Heard::Jumped);
            }
            jumped
        };
        (0..10).filter(has_jumped).collect()
    }

    /// The block after the first that no hypothesis foretold confirms it. A wild block is none, nor is what
    /// the noise can be.
    #[test]
    fn a_jump_is_confirmed_by_the_next_block() {
        let none: [usize; 0] = [];
        assert_eq!(jumps(1.0, |block| if block < 6 { 0.0 } else { 10.0 })[..1], [7]);
        assert_eq!(jumps(1.0, |block| if block == 6 { 10.0 } else { 0.0 }), none);
        assert_eq!(jumps(100.0, |block| if block < 6 { 0.0 } else { 10.0 }), none);
        assert_eq!(jumps(1.0, |_| 10.0), none);
        // As small as one of the usual size shows.
        assert_eq!(jumps(1.0, |block| if block < 6 { 0.0 } else { 5.0 }), [7]);
    }

    /// Before there is something to foretell with, all hypotheses say the same: none gains by it.
    #[test]
    fn a_first_block_is_news_to_all() {
        let mut bank = Bank::<f64, 4>::new(f64::INFINITY);
        let mut solution = Solution::of_prior(PRIOR.offsets);
        let mut sums = BlockSums::new();
        sums.add(&[0.0, 1.0, 0.0, 0.0], &[0.0; LEAKS], 0.5, 1e6);
        bank.evidence.block = Block::new(0.5, &sums, &[None; 2], 0.0);
        bank.evidence.refer(0.0, &solution.mean);
        bank.begin([0.0; 2], 1.0, &PRIOR, &solution);
        while bank.next < CONCLUDE {
            bank.go_on(&PRIOR, &mut solution);
        }
        let Pending::Renewal(renewal) = &bank.pending else { panic!("no renewal") };
        assert!(renewal.news && renewal.gained.iter().all(|gain| gain.abs() < 1e-12), "{:?}", renewal.gained);
    }
}
