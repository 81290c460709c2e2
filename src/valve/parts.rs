//! What some seconds of a window say, as normal equations around the same unknowns: enough to find when leaks changed, and whether what
//! is left is noise.

use super::course::{Course, Solved};
use super::edges::{PA, PB};
use super::equations::{Node, Slopes};
use super::fit::Place;
use super::unknowns::{Belief, Information, LEAKS, UNKNOWNS, Unknowns};
use super::whitening::WhiteStep;
use crate::presence::Pressures;
use pitchleak_core::{Estimate, PerLeak};
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
}

/// Some seconds of a window.
#[derive(Clone, Debug)]
pub(super) struct Part {
    pub from_s: f64,
    pub normal: Normal,
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

    pub fn middle_s(&self) -> f64 {
        self.from_s + 0.5 * self.pressures.time_s
    }

    /// With its normal equations whole: steps are added to the lower triangle.
    pub fn whole(mut self) -> Self {
        self.normal.information.fill_upper_triangle_with_lower_triangle();
        self
    }

    fn plus(&self, other: &Self) -> Self {
        Self {
            from_s: self.from_s,
            normal: Normal {
                information: self.normal.information + other.normal.information,
                right: self.normal.right + other.normal.right,
            },
            squares: self.squares + other.squares,
            count: self.count + other.count,
            pressures: self.pressures.plus(&other.pressures),
        }
    }

    /// The same, around unknowns from which these are so far.
    fn around(&self, far: &Unknowns) -> Self {
        let pull = self.normal.information * far;
        let mut around = self.clone();
        around.squares += far.dot(&(2.0 * self.normal.right + pull));
        around.normal.right += pull;
        around
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
    /// How each leak grows where leaks go in straight lines, in their unit per second.
    #[serde(default)]
    pub growth: Option<PerLeak<Estimate<f64>>>,
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

/// What readings say in the likeliest courses.
pub(super) struct Likeliest {
    /// If leaks never change, or at once.
    pub at_once: Summary,
    /// In a line, where that is likelier.
    pub line: Option<Summary>,
}

/// Sums up the parts of a window, linear around a place; none where they say no finite number.
pub(super) fn likeliest(parts: &[Part], before: &Belief, place: &Place) -> Option<Likeliest> {
    let parts: Vec<Part> =
        parts.iter().map(|part| part.around(&place.course.before_end(part.middle_s()))).collect();
    let at = &place.unknowns;
    let solved = |course: Course| course.solved(&parts, before, at);
    let constant = solved(Course::constant())?;
    let is_likelier = |found: &Solved| {
        let more = found.gain - constant.gain;
        let unlike = || summed_up(&parts, found, before, at).map(|all| all.unlike().powi(2));
        more > CHANGED && unlike().is_some_and(|unlike| more > CHANGED * unlike)
    };
    let (early, late) = (sums(parts.iter()), sums(parts.iter().rev()));
    let since = (LEAST_PARTS..(parts.len() + 1).saturating_sub(LEAST_PARTS))
        .filter_map(|since| {
            let late = Part { from_s: parts[since].from_s, ..late[parts.len() - 1 - since].clone() };
            let sides = [early[since - 1].clone(), late];
            Some((since, Course::since(sides[1].from_s).solved(&sides, before, at)?))
        })
        .max_by(|(_, a), (_, b)| a.gain.total_cmp(&b.gain))
        .filter(|(_, found)| is_likelier(found));
    let line = Course::line(&parts).and_then(solved).filter(is_likelier);
    let (since, best) = since.unwrap_or((0, constant));
    let at_once = Summary { since, ..summed_up(&parts[since..], &best, before, at)? };
    let line = line.filter(|line| line.gain > best.gain);
    Some(Likeliest { at_once, line: line.and_then(|line| summed_up(&parts, &line, before, at)) })
}

/// The sums of the first one, two and more.
fn sums<'a>(parts: impl Iterator<Item = &'a Part>) -> Vec<Part> {
    let sum = |sum: &mut Option<Part>, part: &Part| {
        let next = sum.as_ref().map_or_else(|| part.clone(), |sum| sum.plus(part));
        *sum = Some(next.clone());
        Some(next)
    };
    parts.scan(None, sum).collect()
}

/// What parts say in a course.
fn summed_up(own: &[Part], best: &Solved, before: &Belief, at: &Unknowns) -> Option<Summary> {
    let moved = |part: &Part| best.step + best.course.before_end(part.middle_s());
    let around: Vec<Part> = own.iter().map(|part| part.around(&-moved(part))).collect();
    let squares: f64 = around.iter().map(|part| part.squares).sum();
    let count: f64 = own.iter().map(|part| part.count).sum();
    let covariance = best.covariance();
    Some(Summary {
        belief: Belief {
            mean: at + best.step,
            information: covariance.cholesky()?.inverse(),
            leak_std: before.leak_std,
        },
        since: 0,
        noise: squares / count.max(1.0),
        course: course(&around, &covariance),
        parts: own.len(),
        pressures: own.iter().fold(Pressures::default(), |sum, part| sum.plus(&part.pressures)),
        growth: best.growth(),
    })
}

/// The leaks' variances by the parts' own scores over those by the noise: errors of the model make neighbours alike, and parts different
/// (the sandwich of Huber 1967, "The behavior of maximum likelihood estimates under nonstandard conditions").
fn course(parts: &[Part], covariance: &Information) -> [f64; 3] {
    let (mut seen, mut expected) = ([0.0; 3], [0.0; 3]);
    for Part { normal, .. } in parts {
        for leak in 0..3 {
            let row = covariance.row(LEAKS + leak).transpose();
            seen[leak] += row.dot(&normal.right).powi(2);
            expected[leak] += row.dot(&(normal.information * row));
        }
    }
    [0, 1, 2].map(|leak| seen[leak] / f64::max(expected[leak], f64::MIN_POSITIVE))
}
