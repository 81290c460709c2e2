//! How leaks, and the spool's zero beside them, go through a window: the unknowns at its end, and by how much these rose before.

use super::parts::{Normal, Part};
use super::unknowns::{Belief, CERTAIN, Information, LAPS, LEAKS, UNKNOWNS, Unknowns};
use nalgebra::{DMatrix, DVector, SMatrix, SVector};
use pitchleak_core::{Estimate, PerLeak};

/// The leaks, and the spool's zero, which opens two edges and closes two.
const RISING: usize = 4;
/// Fewer parts tell no line from a step.
const LEAST_IN_LINE: usize = 6;
/// More stairs cost more than they tell; numerical.
const MOST_STAIRS: usize = 60;
/// The spool's zero may walk by this share of the stroke in a window, 1 σ. A guess.
const NULL_WALK: f64 = 0.005;

type Rise = SVector<f64, RISING>;

/// Times at which what rises does so, s.
#[derive(Clone, Debug)]
enum Shape {
    Constant,
    /// The leaks are others from here on.
    Since(f64),
    Line {
        from_s: f64,
        until_s: f64,
    },
    /// Others in each part, which begin here.
    Stairs(Vec<f64>),
}

/// A course through a window.
#[derive(Clone, Debug)]
pub(super) struct Course {
    shape: Shape,
    rises: Vec<Rise>,
}

/// What readings say in a course, made linear around unknowns at its end and another course.
pub(super) struct Solved {
    /// From those at the end.
    pub step: Unknowns,
    pub course: Course,
    /// Squares that it explains.
    pub gain: f64,
    covariance: DMatrix<f64>,
}

/// Normal equations of the unknowns at the end and of the rises.
pub(super) struct Rising {
    pub information: DMatrix<f64>,
    pub right: DVector<f64>,
}

impl Course {
    pub fn constant() -> Self {
        Self { shape: Shape::Constant, rises: Vec::new() }
    }

    pub fn since(t_s: f64) -> Self {
        Self { shape: Shape::Since(t_s), rises: vec![Rise::zeros()] }
    }

    /// None through parts that are too few.
    pub fn line(parts: &[Part]) -> Option<Self> {
        if parts.len() < LEAST_IN_LINE {
            return None;
        }
        let (first, last) = (parts.first()?, parts.last()?);
        let shape = Shape::Line { from_s: first.from_s, until_s: last.from_s + last.pressures.time_s };
        Some(Self { shape, rises: vec![Rise::zeros()] })
    }

    pub fn stairs(parts: &[Part]) -> Self {
        let each = parts.len().div_ceil(MOST_STAIRS).max(1);
        let begins: Vec<f64> = parts.iter().step_by(each).skip(1).map(|part| part.from_s).collect();
        Self { rises: vec![Rise::zeros(); begins.len()], shape: Shape::Stairs(begins) }
    }

    /// Which rise counts at a time, and by which share: none at the end.
    fn share(&self, t_s: f64) -> Option<(usize, f64)> {
        match &self.shape {
            Shape::Constant => None,
            Shape::Since(since_s) => (t_s < *since_s).then_some((0, -1.0)),
            Shape::Line { from_s, until_s } => Some((0, (t_s - until_s) / (until_s - from_s))),
            Shape::Stairs(begins) => {
                let stair = begins.partition_point(|begin_s| *begin_s <= t_s);
                (stair < begins.len()).then_some((stair, -1.0))
            }
        }
    }

    /// By how much the unknowns at a time are more than those at the end.
    pub fn before_end(&self, t_s: f64) -> Unknowns {
        self.share(t_s).map_or(Unknowns::zeros(), |(rise, share)| directions() * self.rises[rise] * share)
    }

    /// Normal equations of parts that are linear around the unknowns `at` the end and this course.
    pub fn normal(&self, parts: &[Part], before: &Belief, at: &Unknowns) -> Rising {
        let count = UNKNOWNS + RISING * self.rises.len();
        let mut sum = Rising { information: DMatrix::zeros(count, count), right: DVector::zeros(count) };
        // What was believed before is of the beginning.
        let from_s = parts.first().map_or(0.0, |part| part.from_s);
        sum.add(&Normal::prior(before, &(at + self.before_end(from_s))), self.share(from_s));
        parts.iter().for_each(|part| sum.add(&part.normal, self.share(part.middle_s())));
        let null = if matches!(self.shape, Shape::Since(_)) { CERTAIN } else { NULL_WALK };
        for (place, rise) in self.rises.iter().enumerate() {
            for (one, std) in before.leak_std.into_iter().chain([null]).enumerate() {
                let at = UNKNOWNS + RISING * place + one;
                sum.information[(at, at)] += std.powi(-2);
                sum.right[at] -= rise[one] * std.powi(-2);
            }
        }
        sum
    }

    /// A share of a solution further: of the unknowns at the end and of the rises.
    pub fn moved(&self, solution: &DVector<f64>, share: f64) -> Self {
        let mut moved = self.clone();
        for (place, rise) in moved.rises.iter_mut().enumerate() {
            *rise += solution.fixed_rows::<RISING>(UNKNOWNS + RISING * place) * share;
        }
        moved
    }

    /// What parts say that are linear around the unknowns `at` the end and this course.
    pub fn solved(&self, parts: &[Part], before: &Belief, at: &Unknowns) -> Option<Solved> {
        let Rising { information, right } = self.normal(parts, before, at);
        let factor = information.cholesky()?;
        let (solution, covariance) = (factor.solve(&right), factor.inverse());
        let gain = solution.dot(&right);
        let step = solution.fixed_rows::<UNKNOWNS>(0).into_owned();
        gain.is_finite().then(|| Solved { step, course: self.moved(&solution, 1.0), gain, covariance })
    }
}

impl Solved {
    /// Of the unknowns at the end.
    pub fn covariance(&self) -> Information {
        self.covariance.fixed_view::<UNKNOWNS, UNKNOWNS>(0, 0).into_owned()
    }

    /// How leaks grow in a line, in their unit per second.
    pub fn growth(&self) -> Option<PerLeak<Estimate<f64>>> {
        let Shape::Line { from_s, until_s } = self.course.shape else { return None };
        let rise = self.course.rises.first()?;
        Some(PerLeak::from_fn(|leak| {
            let at = UNKNOWNS + leak as usize;
            let std = self.covariance[(at, at)].sqrt();
            Estimate { value: rise[leak as usize], std }.scaled(1.0 / (until_s - from_s))
        }))
    }
}

impl Rising {
    fn add(&mut self, normal: &Normal, share: Option<(usize, f64)>) {
        let mut own = self.information.fixed_view_mut::<UNKNOWNS, UNKNOWNS>(0, 0);
        own += normal.information;
        let mut right = self.right.fixed_rows_mut::<UNKNOWNS>(0);
        right += normal.right;
        let Some((rise, share)) = share else { return };
        let at = UNKNOWNS + RISING * rise;
        let by_rise = directions() * share;
        let across = normal.information * by_rise;
        let mut beside = self.information.fixed_view_mut::<UNKNOWNS, RISING>(0, at);
        beside += across;
        let mut below = self.information.fixed_view_mut::<RISING, UNKNOWNS>(at, 0);
        below += across.transpose();
        let mut square = self.information.fixed_view_mut::<RISING, RISING>(at, at);
        square += by_rise.transpose() * across;
        let mut right = self.right.fixed_rows_mut::<RISING>(at);
        right += by_rise.transpose() * normal.right;
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

/// What each that rises does to the unknowns.
fn directions() -> SMatrix<f64, UNKNOWNS, RISING> {
    let mut columns = SMatrix::zeros();
    (0..3).for_each(|leak| columns[(LEAKS + leak, leak)] = 1.0);
    for (edge, sign) in [-1.0, 1.0, 1.0, -1.0].into_iter().enumerate() {
        columns[(LAPS + edge, 3)] = sign;
    }
    columns
}
