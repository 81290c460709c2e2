//! Whether noise explains what the equations say, and when the leaks changed at once.
//!
//! Innovations of a filter whose model holds are white and have the variance that it says (Kailath 1968, "An innovations approach to
//! least-squares estimation"). Over parts of five seconds:
//!
//! - **Noise**: mean ν²/S, 1 where the declared noise holds.
//! - **Course**: by how much a leak moved with each part, Σ K ν, squared over the Σ K² S that noise makes of it. What the model lacks makes
//!   parts differ (the sandwich of Huber 1967); it widens the leak's interval.
//! - **Change**: the score of the leaks, s = Σ H ν/S, has the covariance J = Σ H Hᵀ/S. sᵀ J⁻¹ s is χ² of three; beyond chance the leaks
//!   changed (the generalised likelihood ratio of Willsky and Jones 1976). Windows last 5, 20 and 80 s, so that a small change is seen
//!   late and a large one soon. What the window taught of all but the leaks was a leak then: it is taken back.

use super::filter::{Row, Surprise};
use super::unknowns::{KAPPA, VALVE_UNKNOWNS as N};
use crate::Real;

/// A part, s.
const PART_S: f64 = 5.0;
/// Windows of so many parts.
const WINDOWS: [u8; 3] = [1, 4, 16];
/// χ² of three leaks that chance goes beyond once in a million.
const CHANGED: f64 = 30.7;
/// So many parts count for how well noise explains: ten minutes. So many with the same leaks are needed, as fewer tell nothing of it.
const MOST_PARTS: f64 = 120.0;
const LEAST_PARTS: f64 = 6.0;
/// Parts differ by more than one in ten thousand sound cylinders', in standard deviations.
const CHANCE_SIGMAS: f64 = 3.7;
/// A variance beyond this multiple of the declared is no noise of these sensors.
const MOST_NOISE: f64 = 9.0;
/// Leaks change no oftener than once in so long, s.
const CHANGES_COUNT_S: f64 = 600.0;

/// s and the lower triangle of J.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Score<T> {
    score: [T; 3],
    information: [T; 6],
}

/// Some parts together.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Window<T> {
    score: Score<T>,
    parts: u8,
    /// The unknowns where it began.
    begin: [T; N],
}

/// Sums over a part.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Part<T> {
    time_s: T,
    squares: T,
    count: T,
    moved: [T; 3],
    expected: [T; 3],
}

/// See the module.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Watch<T> {
    part: Part<T>,
    score: Score<T>,
    windows: [Window<T>; WINDOWS.len()],
    /// Means over parts with the same leaks, and how many.
    noise: T,
    course: [T; 3],
    parts: T,
    changes: u8,
    since_change_s: T,
}

impl<T: Real> Score<T> {
    fn none() -> Self {
        Self { score: [T::zero(); 3], information: [T::zero(); 6] }
    }

    fn add(&mut self, row: &Row<T>, left: T, per_variance: T) {
        let [a, b, c, ..] = *row;
        let [scaled_a, scaled_b, scaled_c] = [a, b, c].map(|own| own * per_variance);
        let own = [scaled_a * a, scaled_b * a, scaled_b * b, scaled_c * a, scaled_c * b, scaled_c * c];
        self.information.iter_mut().zip(own).for_each(|(sum, own)| *sum += own);
        let own = [scaled_a * left, scaled_b * left, scaled_c * left];
        self.score.iter_mut().zip(own).for_each(|(sum, own)| *sum += own);
    }

    fn join(&mut self, other: &Self) {
        self.score.iter_mut().zip(other.score).for_each(|(sum, own)| *sum += own);
        self.information.iter_mut().zip(other.information).for_each(|(sum, own)| *sum += own);
    }

    /// sᵀ J⁻¹ s by Cholesky's factor; a direction of which nothing is told counts for nothing.
    fn chi_square(&self) -> T {
        let [aa, ba, bb, ca, cb, cc] = self.information;
        let [a, b, c] = self.score;
        let per = |pivot: T, whole: T| {
            if pivot > T::lit(1e-5) * whole { pivot.recip() } else { T::zero() }
        };
        let per_a = per(aa, aa);
        let (on_b, on_c) = (ba * per_a, ca * per_a);
        let per_b = per(bb - on_b * ba, bb);
        let cross = cb - on_c * ba;
        let b = b - on_b * a;
        let on_c_by_b = cross * per_b;
        let per_c = per(cc - on_c * ca - on_c_by_b * cross, cc);
        let c = c - on_c * a - on_c_by_b * b;
        a * a * per_a + b * b * per_b + c * c * per_c
    }
}

impl<T: Real> Window<T> {
    fn at(begin: [T; N]) -> Self {
        Self { score: Score::none(), parts: 0, begin }
    }
}

impl<T: Real> Part<T> {
    fn none() -> Self {
        let zero = T::zero();
        Self { time_s: zero, squares: zero, count: zero, moved: [zero; 3], expected: [zero; 3] }
    }
}

impl<T: Real> Watch<T> {
    pub fn new() -> Self {
        Self {
            part: Part::none(),
            score: Score::none(),
            windows: [Window::at([T::zero(); N]); WINDOWS.len()],
            noise: T::one(),
            course: [T::one(); 3],
            parts: T::zero(),
            changes: 0,
            since_change_s: T::zero(),
        }
    }

    /// Takes in what an equation said.
    pub fn add(&mut self, row: &Row<T>, surprise: &Surprise<T>) {
        let Surprise { innovation, variance, gains } = surprise;
        let per_variance = variance.recip();
        let part = &mut self.part;
        part.squares += *innovation * *innovation * per_variance;
        part.count += T::one();
        for ((moved, expected), gain) in part.moved.iter_mut().zip(&mut part.expected).zip(gains) {
            *moved += *gain * *innovation;
            *expected += *gain * *gain * *variance;
        }
        self.score.add(row, *innovation, per_variance);
    }

    /// So much time has passed, s, with which the unknowns came to `step`. Where a part ends with it and the leaks have changed, all but
    /// they are taken back to where the window began, and it says how long ago that is, s.
    pub fn pass(&mut self, time_s: T, step: &mut [T; N]) -> Option<T> {
        self.part.time_s += time_s;
        if self.part.time_s < T::lit(PART_S) {
            return None;
        }
        let part = core::mem::replace(&mut self.part, Part::none());
        let score = core::mem::replace(&mut self.score, Score::none());
        self.since_change_s += part.time_s;
        // By the noise before: a leak that sets in is no noise.
        let limit = T::lit(CHANGED) * self.noise.at_least(T::one());
        self.average(&part);
        let mut changed = None;
        for (window, whole) in self.windows.iter_mut().zip(WINDOWS) {
            window.score.join(&score);
            window.parts += 1;
            if window.parts >= whole {
                let is_other = window.score.chi_square() > limit;
                changed = changed.or(is_other.then_some((window.begin, whole)));
                *window = Window::at(*step);
            }
        }
        let (begin, parts) = changed?;
        step.iter_mut().zip(begin).skip(KAPPA).for_each(|(now, then)| *now = then);
        self.change(step);
        Some(T::lit(PART_S * f64::from(parts)))
    }

    fn average(&mut self, part: &Part<T>) {
        let parts = self.parts + T::one();
        let weight = parts.at_most(T::lit(MOST_PARTS)).recip();
        let noise = part.squares / part.count.at_least(T::one());
        self.noise += weight * (noise - self.noise);
        for ((course, moved), expected) in self.course.iter_mut().zip(part.moved).zip(part.expected) {
            let own = if expected > T::zero() { moved * moved / expected } else { T::one() };
            *course += weight * (own - *course);
        }
        self.parts = parts;
    }

    fn change(&mut self, step: &[T; N]) {
        let is_recent = self.changes > 0 && self.since_change_s < T::lit(CHANGES_COUNT_S);
        self.changes = if is_recent { self.changes.saturating_add(1) } else { 1 };
        self.since_change_s = T::zero();
        self.windows = [Window::at(*step); WINDOWS.len()];
        self.parts = T::zero();
    }

    /// Mean ν²/S.
    pub fn noise(&self) -> T {
        self.noise
    }

    /// By how much each leak's standard deviation is wider for what noise does not explain: beyond two standard deviations of what so
    /// many parts scatter by themselves (Birge 1932).
    pub fn widening(&self) -> [T; 3] {
        let two = T::lit(2.0);
        let chance = T::one() + two * (two / self.many()).sqrt();
        self.course.map(|course| (course / chance).at_least(self.noise).at_least(T::one()).sqrt())
    }

    /// Parts that count.
    fn many(&self) -> T {
        self.parts.at_least(T::one()).at_most(T::lit(MOST_PARTS))
    }

    /// Whether a valve as calibrated, its leaks and noise explain the readings: parts differ by no more than by chance (Wilson and
    /// Hilferty 1931), and leaks change no oftener than leaks do.
    pub fn is_explained(&self) -> bool {
        let share = T::lit(2.0 / 9.0) / self.many();
        let root = T::one() - share + T::lit(CHANCE_SIGMAS) * share.sqrt();
        let most = root * root * root * self.noise.at_least(T::one());
        let is_often = self.changes > 1 && self.since_change_s < T::lit(CHANGES_COUNT_S);
        let is_alike = self.course.iter().all(|course| *course <= most);
        self.parts >= T::lit(LEAST_PARTS) && is_alike && self.noise <= T::lit(MOST_NOISE) && !is_often
    }
}
