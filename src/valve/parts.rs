//! What some seconds of a window say, as normal equations around the same unknowns: enough to find when leaks changed, and whether what
//! is left is noise.

use super::edges::{PA, PB};
use super::equations::{Node, Slopes};
use super::unknowns::{Belief, Information, LEAKS, UNKNOWNS, Unknowns};
use super::whitening::WhiteStep;
use crate::presence::Pressures;
use nalgebra::SMatrix;
use serde::{Deserialize, Serialize};

/// Normal equations Λ δ = η of a step from the unknowns of the moment.
#[derive(Clone, Debug)]
pub(super) struct Normal {
    pub information: Information,
    pub right: Unknowns,
}

impl Normal {
    /// Of what was believed before.
    pub fn prior(before: &Belief, at: &Unknowns) -> Self {
        Self { information: before.information, right: before.information * (before.mean - at) }
    }

    fn none() -> Self {
        Self { information: Information::zeros(), right: Unknowns::zeros() }
    }

    pub fn add(&mut self, other: &Self) {
        self.information += other.information;
        self.right += other.right;
    }

    pub fn add_steps(&mut self, steps: &[WhiteStep]) {
        let mut sum = Self::none();
        steps.iter().for_each(|step| sum.add_step(step));
        sum.information.fill_upper_triangle_with_lower_triangle();
        self.add(&sum);
    }

    /// To the lower triangle alone.
    fn add_step(&mut self, step: &WhiteStep) {
        let columns: &Slopes = &step.by_unknowns;
        for j in 0..UNKNOWNS {
            let (a, b) = (columns[(0, j)], columns[(1, j)]);
            for i in j..UNKNOWNS {
                self.information[(i, j)] += columns[(0, i)] * a + columns[(1, i)] * b;
            }
        }
        self.right -= columns.transpose() * step.residual;
    }

    /// The step; the unknowns that are not leaks, in which the equations are not linear, are held back by so many times what was
    /// known of each (Levenberg 1944, Marquardt 1963).
    pub fn solve(&self, known: &Information, damping: f64) -> Option<Unknowns> {
        let mut information = self.information;
        for unknown in (0..UNKNOWNS).filter(|unknown| !(LEAKS..LEAKS + 3).contains(unknown)) {
            information[(unknown, unknown)] += damping * known[(unknown, unknown)];
        }
        let step = information.cholesky()?.solve(&self.right);
        step.iter().all(|number| number.is_finite()).then_some(step)
    }

    /// A step's square in the information: none of the unknowns moves by more of its standard deviations than its root.
    pub fn square(&self, step: &Unknowns) -> f64 {
        step.dot(&(self.information * step))
    }
}

/// Some seconds of a window.
#[derive(Clone, Debug)]
pub(super) struct Part {
    pub from_s: f64,
    normal: Normal,
    /// What is left, squared, and of how many equations.
    squares: f64,
    count: f64,
    pub pressures: Pressures,
}

impl Part {
    pub fn from(from_s: f64) -> Self {
        Self { from_s, normal: Normal::none(), squares: 0.0, count: 0.0, pressures: Pressures::default() }
    }

    /// A step between two nodes, which tells so many numbers beside the signals.
    pub fn add(&mut self, step: &WhiteStep, nodes: [&Node; 2], told: f64) {
        self.normal.add_step(step);
        self.squares += step.residual.norm_squared();
        self.count += told;
        let [from, to] = nodes;
        let [a_pa, b_pa] = [PA, PB].map(|at| [from.signals[at], to.signals[at]]);
        self.pressures.add(to.t_s - from.t_s, a_pa, b_pa);
    }

    fn normal(&self) -> Normal {
        let mut normal = self.normal.clone();
        normal.information.fill_upper_triangle_with_lower_triangle();
        normal
    }
}

/// What the parts say together, the leaks from one of them on.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Summary {
    pub belief: Belief,
    /// Place of the first part with these leaks.
    pub since: usize,
    /// Squares of what is left over those of the noise, about 1.
    pub noise: f64,
    /// The leaks' variances by how the parts differ, over those by the noise, and of how many parts.
    pub course: [f64; 3],
    pub parts: usize,
    pub pressures: Pressures,
}

impl Summary {
    /// How much more the parts' scores vary than noise makes them: variances over variances.
    fn course_over_noise(&self) -> f64 {
        self.course.into_iter().fold(0.0, f64::max) / self.noise.max(1.0)
    }

    /// By how much parts differ, in what noise makes of them: standard deviations over standard deviations.
    pub fn unlike(&self) -> f64 {
        self.course_over_noise().max(self.noise).sqrt()
    }

    /// Whether the parts differ by no more than by chance, and the readings scatter like those of sensors.
    pub fn is_explained(&self) -> bool {
        self.course_over_noise() <= most_by_chance(self.parts) && self.noise <= MOST_SCATTER * MOST_SCATTER
    }

    /// With what went before, where the leaks were the same.
    #[must_use]
    pub fn after(self, before: &Self) -> Self {
        // What is long ago says little of how well the model fits now.
        let kept = before.parts.min(MOST_PARTS);
        let [was, is] = [kept, self.parts].map(|parts| parts as f64 / (kept + self.parts).max(1) as f64);
        let course = [0, 1, 2].map(|leak| was * before.course[leak] + is * self.course[leak]);
        Self {
            noise: was * before.noise + is * self.noise,
            course,
            parts: kept + self.parts,
            pressures: before.pressures.plus(&self.pressures),
            ..self
        }
    }
}

/// How far the variance of so many parts goes beyond its mean by chance (Wilson and Hilferty 1931).
fn most_by_chance(parts: usize) -> f64 {
    let share = 2.0 / (9.0 * parts.max(1) as f64);
    (1.0 - share + CHANCE_SIGMAS * share.sqrt()).powi(3)
}

type Both = SMatrix<f64, { UNKNOWNS + 3 }, { UNKNOWNS + 3 }>;
type BothRight = SMatrix<f64, { UNKNOWNS + 3 }, 1>;
/// Leaks have changed where that explains so much more, in squares of the noise: of three leaks, one in a million by chance.
pub(super) const CHANGED: f64 = 30.7;
/// Parts of a trace that differ by more than one in ten thousand sound ones would contradict the model, in standard deviations.
const CHANCE_SIGMAS: f64 = 3.7;
/// A scatter beyond this is no noise of these sensors.
const MOST_SCATTER: f64 = 3.0;
/// So many parts before count for how well noise explains a stream: ten minutes (chosen).
const MOST_PARTS: usize = 120;
/// Leaks are known from so many parts on.
const LEAST_PARTS: usize = 2;

/// Sums up the parts of a window around the unknowns `at`; none where they say no finite number.
pub(super) fn summary(parts: &[Part], before: &Belief, at: &Unknowns) -> Option<Summary> {
    let normals: Vec<Normal> = parts.iter().map(Part::normal).collect();
    let noise = parts.iter().map(|part| part.squares).sum::<f64>()
        / parts.iter().map(|part| part.count).sum::<f64>().max(1.0);
    let constant = split(&normals, before, at, 0)?;
    let least = constant.gain + CHANGED * noise.max(1.0);
    let changed = (LEAST_PARTS..(parts.len() + 1).saturating_sub(LEAST_PARTS))
        .filter_map(|place| split(&normals, before, at, place).map(|found| (place, found)))
        .max_by(|(_, a), (_, b)| a.gain.total_cmp(&b.gain))
        .filter(|(_, found)| found.gain > least);
    let (since, best) = changed.unwrap_or((0, constant));
    let own = &parts[since..];
    let count: f64 = own.iter().map(|part| part.count).sum();
    let moved = best.step;
    let left = |part: &Part, normal: &Normal| {
        part.squares - 2.0 * moved.dot(&normal.right) + moved.dot(&(normal.information * moved))
    };
    let squares: f64 = own.iter().zip(&normals[since..]).map(|(part, normal)| left(part, normal)).sum();
    let covariance = best.information.cholesky()?.inverse();
    let course = course(&normals[since..], &moved, &covariance);
    Some(Summary {
        belief: Belief { mean: at + moved, information: best.information, leak_std: before.leak_std },
        since,
        noise: squares / count.max(1.0),
        course,
        parts: own.len(),
        pressures: own.iter().fold(Pressures::default(), |sum, part| sum.plus(&part.pressures)),
    })
}

/// The unknowns where the leaks are others from the part `place` on.
struct Split {
    step: Unknowns,
    information: Information,
    /// Squares that it explains.
    gain: f64,
}

fn split(normals: &[Normal], before: &Belief, at: &Unknowns, place: usize) -> Option<Split> {
    let (mut information, mut right) = (Both::zeros(), BothRight::zeros());
    // What was believed before is of the leaks before, which stand last.
    let early = |unknown: usize| {
        let is_apart = place > 0 && (LEAKS..LEAKS + 3).contains(&unknown);
        if is_apart { UNKNOWNS + unknown - LEAKS } else { unknown }
    };
    let mut add = |normal: &Normal, to: &dyn Fn(usize) -> usize| {
        for j in 0..UNKNOWNS {
            for i in 0..UNKNOWNS {
                information[(to(i), to(j))] += normal.information[(i, j)];
            }
            right[to(j)] += normal.right[j];
        }
    };
    let mut first = Normal::prior(before, at);
    normals[..place].iter().for_each(|normal| first.add(normal));
    let mut second = Normal::none();
    normals[place..].iter().for_each(|normal| second.add(normal));
    add(&first, &early);
    add(&second, &|unknown| unknown);
    for (leak, std) in before.leak_std.into_iter().enumerate() {
        let (free, old, known) = (LEAKS + leak, UNKNOWNS + leak, std.powi(-2));
        if place > 0 {
            information[(free, free)] += known;
            right[free] -= at[free] * known;
        } else {
            information[(old, old)] += 1.0;
        }
    }
    let step = information.cholesky()?.solve(&right);
    // The early leaks are of no interest any more.
    let inner = information.fixed_view::<3, 3>(UNKNOWNS, UNKNOWNS).try_inverse()?;
    let outer = information.fixed_view::<UNKNOWNS, 3>(0, UNKNOWNS).into_owned();
    let own = information.fixed_view::<UNKNOWNS, UNKNOWNS>(0, 0) - outer * inner * outer.transpose();
    let gain = step.dot(&right);
    gain.is_finite().then(|| Split {
        step: step.fixed_rows::<UNKNOWNS>(0).into_owned(),
        information: own,
        gain,
    })
}

/// The leaks' variances by the parts' own scores over those by the noise: errors of the model make neighbours alike, and parts different
/// (the sandwich of Huber 1967, "The behavior of maximum likelihood estimates under nonstandard conditions").
fn course(normals: &[Normal], moved: &Unknowns, covariance: &Information) -> [f64; 3] {
    let (mut seen, mut expected) = ([0.0; 3], [0.0; 3]);
    for normal in normals {
        let score = normal.right - normal.information * moved;
        for leak in 0..3 {
            let row = covariance.row(LEAKS + leak).transpose();
            seen[leak] += row.dot(&score).powi(2);
            expected[leak] += row.dot(&(normal.information * row));
        }
    }
    [0, 1, 2].map(|leak| seen[leak] / f64::max(expected[leak], f64::MIN_POSITIVE))
}
