//! How leaks, and the spool's zero beside them, go through a window: the unknowns at its end, and by how much these rose before.
//!
//! Leaks stay as they are but for ramps, in each of which they go in a straight line from what they were to what they are since. A leak
//! that sets in at once has a short one, one that grows a long one.

use super::parts::{Normal, Part, TOLD, Told};
use super::unknowns::{Belief, Information, LAPS, LEAKS, UNKNOWNS, Unknowns};
use nalgebra::{Cholesky, DMatrix, DVector, Dyn, Matrix3, OMatrix, U3, Vector3};
use pitchleak_core::{Estimate, PerLeak};

/// The spool's zero may walk by this share of the stroke in a window, 1 σ. A guess.
const NULL_WALK: f64 = 0.005;
/// A ramp that lasts no longer, s, is a leak that sets in at once somewhere in it: two parts of a window.
pub(super) const AT_ONCE_S: f64 = 10.5;

/// In what leaks go from what they were before to what they are from then on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Ramp {
    pub from_s: f64,
    pub until_s: f64,
    /// Whether leaks change at once, somewhere in it.
    pub is_at_once: bool,
    /// By how much it was likelier than others before any reading, in squares.
    odds: f64,
    rise: Vector3<f64>,
}

/// A course through a window.
#[derive(Clone, Debug)]
pub(super) struct Course {
    /// By how much the spool's zero walks from the window's begin to its end, and these times; none where it stays.
    null: Option<(f64, [f64; 2])>,
    pub ramps: Vec<Ramp>,
}

/// What readings say in a course, made linear around unknowns at its end and another course.
pub(super) struct Solved {
    /// From those at the end.
    pub step: Unknowns,
    pub course: Course,
    /// Squares that it explains.
    pub gain: f64,
    factor: Cholesky<f64, Dyn>,
}

/// Normal equations of the unknowns at the end, of the walk of the spool's zero and of the rises.
pub(super) struct Rising {
    information: DMatrix<f64>,
    right: DVector<f64>,
}

impl Ramp {
    pub fn new(from_s: f64, until_s: f64, is_at_once: bool) -> Self {
        Self { from_s, until_s, is_at_once, odds: 0.0, rise: Vector3::zeros() }
    }

    /// As one of so many of its kind.
    #[must_use]
    pub fn one_of(self, count: f64) -> Self {
        Self { odds: -2.0 * count.ln(), ..self }
    }

    /// When leaks changed in it, s.
    pub fn changed_at_s(&self) -> f64 {
        if self.is_at_once { 0.5 * (self.from_s + self.until_s) } else { self.until_s }
    }

    /// Whether it goes on at a time.
    pub fn has(&self, t_s: f64) -> bool {
        (self.from_s..self.until_s).contains(&t_s)
    }

    /// What of its rise is still to come at a time, below zero.
    fn share(&self, t_s: f64) -> f64 {
        if t_s >= self.until_s {
            0.0
        } else {
            -((self.until_s - t_s) / (self.until_s - self.from_s)).min(1.0)
        }
    }

    /// What of its rise a second at a time brings.
    fn pace_ps(&self, t_s: f64) -> f64 {
        if self.has(t_s) { 1.0 / (self.until_s - self.from_s) } else { 0.0 }
    }
}

impl Course {
    pub fn constant() -> Self {
        Self { null: None, ramps: Vec::new() }
    }

    /// In which the spool's zero walks through these parts.
    pub fn walking(parts: &[Part]) -> Self {
        let from_s = parts.first().map_or(0.0, |part| part.from_s);
        Self { null: Some((0.0, [from_s, parts.last().map_or(from_s, Part::until_s)])), ramps: Vec::new() }
    }

    /// In which leaks go in one line.
    pub fn line(parts: &[Part]) -> Self {
        let from_s = parts.first().map_or(0.0, |part| part.from_s);
        let ramp = Ramp::new(from_s, parts.last().map_or(from_s, Part::until_s), false);
        Self { null: None, ramps: vec![ramp] }
    }

    /// With ramps more.
    #[must_use]
    pub fn with(&self, ramps: &[Ramp]) -> Self {
        Self { null: self.null, ramps: [&self.ramps, ramps].concat() }
    }

    /// Whether nothing changes in it.
    pub fn is_constant(&self) -> bool {
        self.null.is_none() && self.ramps.is_empty()
    }

    /// Whether leaks change at the same times.
    pub fn is_like(&self, other: &Self) -> bool {
        let are_alike = |a: &Ramp, b: &Ramp| (a.from_s, a.until_s) == (b.from_s, b.until_s);
        self.ramps.len() == other.ramps.len()
            && self.ramps.iter().zip(&other.ramps).all(|(a, b)| are_alike(a, b))
    }

    /// The ramp after which leaks changed no more; none where they never did or still do.
    pub fn last(&self, end_s: f64) -> Option<&Ramp> {
        let last = self.ramps.iter().max_by(|a, b| a.until_s.total_cmp(&b.until_s));
        last.filter(|ramp| ramp.until_s < end_s)
    }

    /// The ramp in which leaks still grow.
    pub fn growing(&self, end_s: f64) -> Option<&Ramp> {
        self.ramps.iter().find(|ramp| ramp.until_s >= end_s)
    }

    /// The ramps of leaks that set in at once, which are yet to rise.
    pub fn jumps(&self) -> Vec<Ramp> {
        let jumps = self.ramps.iter().filter(|ramp| ramp.is_at_once);
        jumps.map(|ramp| Ramp { rise: Vector3::zeros(), ..*ramp }).collect()
    }

    /// How many numbers it has.
    fn len(&self) -> usize {
        usize::from(self.null.is_some()) + 3 * self.ramps.len()
    }

    /// What each of its numbers does to what a part about this time tells.
    fn slopes(&self, middle_s: f64) -> DMatrix<f64> {
        let mut slopes = DMatrix::zeros(TOLD, self.len());
        let mut at = 0;
        if let Some((_, [from_s, until_s])) = self.null {
            let share = (middle_s - until_s) / (until_s - from_s);
            slopes.fixed_view_mut::<UNKNOWNS, 1>(0, at).copy_from(&(null_opens() * share));
            at += 1;
        }
        for (place, ramp) in (at..).step_by(3).zip(&self.ramps) {
            slopes.fixed_view_mut::<3, 3>(LEAKS, place).fill_diagonal(ramp.share(middle_s));
            slopes.fixed_view_mut::<3, 3>(UNKNOWNS, place).fill_diagonal(ramp.pace_ps(middle_s));
        }
        slopes
    }

    /// By how much what a part about this time tells is more than the unknowns at the end.
    pub fn amid(&self, middle_s: f64) -> Told {
        let mut more: Told = self.before_end(middle_s).fixed_resize(0.0);
        for ramp in &self.ramps {
            let mut rates = more.fixed_rows_mut::<3>(UNKNOWNS);
            rates += ramp.rise * ramp.pace_ps(middle_s);
        }
        more
    }

    /// By how much the unknowns at a time are more than those at the end.
    pub fn before_end(&self, t_s: f64) -> Unknowns {
        let null =
            self.null.map_or(0.0, |(rise, [from_s, until_s])| rise * (t_s - until_s) / (until_s - from_s));
        let mut more = null_opens() * null;
        for ramp in &self.ramps {
            let mut leaks = more.fixed_rows_mut::<3>(LEAKS);
            leaks += ramp.rise * ramp.share(t_s);
        }
        more
    }

    /// Normal equations of parts that are linear around the unknowns `at` the end and this course.
    pub fn normal(&self, parts: &[Part], before: &Belief, at: &Unknowns) -> Rising {
        let count = UNKNOWNS + self.len();
        let mut sum = Rising { information: DMatrix::zeros(count, count), right: DVector::zeros(count) };
        // What was believed before is of the beginning.
        let from_s = parts.first().map_or(0.0, |part| part.from_s);
        sum.add(&Normal::prior(before, &(at + self.before_end(from_s))), &self.slopes(from_s));
        parts.iter().for_each(|part| sum.add(&part.normal, &self.slopes(part.middle_s())));
        let null = self.null.map(|(rise, _)| (rise, NULL_WALK));
        let rises =
            self.ramps.iter().flat_map(|ramp| (0..3).map(|leak| (ramp.rise[leak], before.leak_std[leak])));
        for (place, (rise, std)) in (UNKNOWNS..).zip(null.into_iter().chain(rises)) {
            sum.information[(place, place)] += std.powi(-2);
            sum.right[place] -= rise * std.powi(-2);
        }
        sum
    }

    /// A share of a solution further: of the unknowns at the end and of its own numbers.
    pub fn moved(&self, solution: &DVector<f64>, share: f64) -> Self {
        let mut moved = self.clone();
        let mut at = UNKNOWNS;
        if let Some((rise, _)) = &mut moved.null {
            *rise += solution[at] * share;
            at += 1;
        }
        for (place, ramp) in (at..).step_by(3).zip(&mut moved.ramps) {
            ramp.rise += solution.fixed_rows::<3>(place) * share;
        }
        moved
    }

    /// What parts say that are linear around the unknowns `at` the end and this course.
    pub fn solved(&self, parts: &[Part], before: &Belief, at: &Unknowns) -> Option<Solved> {
        let Rising { information, right } = self.normal(parts, before, at);
        let factor = information.cholesky()?;
        let solution = factor.solve(&right);
        let gain = solution.dot(&right);
        let step = solution.fixed_rows::<UNKNOWNS>(0).into_owned();
        gain.is_finite().then(|| Solved { step, course: self.moved(&solution, 1.0), gain, factor })
    }
}

impl Solved {
    /// How likely its course is: squares that it explains, and those by which its ramps were likelier before any reading.
    pub fn worth(&self) -> f64 {
        self.gain + self.course.ramps.iter().map(|ramp| ramp.odds).sum::<f64>()
    }

    /// Of the unknowns at the end.
    pub fn covariance(&self) -> Information {
        self.factor.inverse().fixed_view::<UNKNOWNS, UNKNOWNS>(0, 0).into_owned()
    }

    /// How leaks grow in the ramp that lasts until the end, in their unit per second.
    pub fn growth(&self, end_s: f64) -> Option<PerLeak<Estimate<f64>>> {
        let place = self.course.ramps.iter().position(|ramp| ramp.until_s >= end_s)?;
        let ramp = self.course.ramps[place];
        let at = UNKNOWNS + self.course.len() - 3 * (self.course.ramps.len() - place);
        let covariance = self.factor.inverse();
        Some(PerLeak::from_fn(|leak| {
            let std = covariance[(at + leak as usize, at + leak as usize)].sqrt();
            Estimate { value: ramp.rise[leak as usize], std }.scaled(1.0 / (ramp.until_s - ramp.from_s))
        }))
    }

    /// How many more squares each of these ramps would explain beside this course (Rao 1948, the score test), of parts linear around
    /// the unknowns `at` the end and no course.
    pub fn gains(&self, parts: &[Part], before: &Belief, at: &Unknowns, ramps: &[Ramp]) -> Vec<f64> {
        let from_s = parts.first().map_or(0.0, |part| part.from_s);
        let prior = Normal::prior(before, at);
        let all = parts.iter().map(|part| (part.middle_s(), &part.normal));
        let told: Vec<OfLeaks> =
            all.chain([(from_s, &prior)]).map(|(t_s, normal)| self.of_leaks(t_s, normal)).collect();
        let usual = Matrix3::from_diagonal(&Vector3::from(before.leak_std).map(|std| std.powi(-2)));
        let gain = |ramp: &Ramp| {
            let mut across = OMatrix::<f64, Dyn, U3>::zeros(UNKNOWNS + self.course.len());
            let (mut square, mut left) = (usual, Vector3::zeros());
            for one in &told {
                let both = [ramp.share(one.t_s), ramp.pace_ps(one.t_s)];
                for (k, by) in both.into_iter().enumerate().filter(|(_, by)| *by != 0.0) {
                    across += &one.across[k] * by;
                    left += one.left[k] * by;
                    both.iter().zip(&one.square[k]).for_each(|(other, own)| square += own * (by * other));
                }
            }
            let own = square - across.transpose() * self.factor.solve(&across);
            own.cholesky().map_or(0.0, |own| left.dot(&own.solve(&left)))
        };
        ramps.iter().map(gain).collect()
    }

    fn of_leaks(&self, t_s: f64, normal: &Normal) -> OfLeaks {
        let slopes = self.course.slopes(t_s);
        let left = normal.right - normal.information * (self.step.fixed_resize(0.0) + self.course.amid(t_s));
        let square = |i: usize, j: usize| normal.information.fixed_view::<3, 3>(i, j).into_owned();
        let places = [LEAKS, UNKNOWNS];
        OfLeaks {
            t_s,
            across: places.map(|i| {
                let by_leaks = normal.information.fixed_columns::<3>(i).into_owned();
                let mut across = by_leaks.resize_vertically(UNKNOWNS + slopes.ncols(), 0.0);
                across.rows_mut(UNKNOWNS, slopes.ncols()).copy_from(&(slopes.transpose() * by_leaks));
                across
            }),
            square: places.map(|i| places.map(|j| square(i, j))),
            left: places.map(|i| left.fixed_rows::<3>(i).into_owned()),
        }
    }
}

/// What a part says of the leaks and of how fast they grow beside a solution: with its numbers, among themselves, and what is left.
struct OfLeaks {
    t_s: f64,
    across: [OMatrix<f64, Dyn, U3>; 2],
    square: [[Matrix3<f64>; 2]; 2],
    left: [Vector3<f64>; 2],
}

impl Rising {
    /// What a part says of the unknowns, and of the numbers that do this to what it tells.
    fn add(&mut self, normal: &Normal, slopes: &DMatrix<f64>) {
        let more = slopes.ncols();
        let across = normal.information * slopes;
        let mut own = self.information.fixed_view_mut::<UNKNOWNS, UNKNOWNS>(0, 0);
        own += normal.information.fixed_view::<UNKNOWNS, UNKNOWNS>(0, 0);
        let mut beside = self.information.view_mut((0, UNKNOWNS), (UNKNOWNS, more));
        beside += across.rows(0, UNKNOWNS);
        let mut below = self.information.view_mut((UNKNOWNS, 0), (more, UNKNOWNS));
        below += across.rows(0, UNKNOWNS).transpose();
        let mut square = self.information.view_mut((UNKNOWNS, UNKNOWNS), (more, more));
        square += slopes.transpose() * across;
        let mut right = self.right.fixed_rows_mut::<UNKNOWNS>(0);
        right += normal.right.fixed_rows::<UNKNOWNS>(0);
        let mut right = self.right.rows_mut(UNKNOWNS, more);
        right += slopes.transpose() * normal.right;
    }

    /// The step; the unknowns that are not leaks, in which the equations are not linear, are held back by so many times what was
    /// known of each (Levenberg 1944, Marquardt 1963).
    pub fn solve(&self, known: &Information, damping: f64) -> Option<DVector<f64>> {
        let mut information = self.information.clone();
        for unknown in (0..UNKNOWNS).filter(|unknown| !(LEAKS..LEAKS + 3).contains(unknown)) {
            information[(unknown, unknown)] += damping * known[(unknown, unknown)];
        }
        let step = information.cholesky()?.solve(&self.right);
        step.iter().all(|number| number.is_finite()).then_some(step)
    }

    /// A step's square in the information: none of the unknowns moves by more of its standard deviations than its root.
    pub fn square(&self, step: &DVector<f64>) -> f64 {
        step.dot(&(&self.information * step))
    }
}

/// What the spool's zero does to the unknowns: it opens two edges and closes two.
fn null_opens() -> Unknowns {
    let mut column = Unknowns::zeros();
    for (edge, sign) in [-1.0, 1.0, 1.0, -1.0].into_iter().enumerate() {
        column[LAPS + edge] = sign;
    }
    column
}
