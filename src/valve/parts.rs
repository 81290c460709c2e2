//! What some seconds of a window say, as normal equations around the same unknowns: enough to find when leaks changed, and whether what
//! is left is noise.

use super::course::{AT_ONCE_S, Course, Ramp, Solved};
use super::edges::{PA, PB};
use super::equations::Node;
use super::unknowns::{Belief, Information, LEAKS, UNKNOWNS, Unknowns};
use super::whitening::WhiteStep;
use crate::presence::Pressures;
use nalgebra::{SMatrix, SVector};
use pitchleak_core::{Estimate, PerLeak};
use serde::{Deserialize, Serialize};

/// The unknowns amid a part, and how fast the leaks grow in it, in their unit per second.
pub(super) const TOLD: usize = UNKNOWNS + 3;
pub(super) type Told = SVector<f64, TOLD>;

/// Normal equations Λ δ = η of a step from the unknowns of the moment.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(into = "Vec<f64>", try_from = "Vec<f64>")]
pub(super) struct Normal {
    pub information: SMatrix<f64, TOLD, TOLD>,
    pub right: Told,
}

impl Normal {
    /// Of what was believed before.
    pub fn prior(before: &Belief, at: &Unknowns) -> Self {
        let right = before.information * (before.mean - at);
        Self { information: before.information.fixed_resize(0.0), right: right.fixed_resize(0.0) }
    }

    fn none() -> Self {
        Self { information: SMatrix::zeros(), right: Told::zeros() }
    }

    /// To the lower triangle alone.
    fn add_step(&mut self, step: &WhiteStep) {
        let mut columns: SMatrix<f64, 2, TOLD> = step.by_unknowns.fixed_resize(0.0);
        columns.fixed_columns_mut::<3>(UNKNOWNS).copy_from(&step.by_rates);
        for j in 0..TOLD {
            let (a, b) = (columns[(0, j)], columns[(1, j)]);
            for i in j..TOLD {
                self.information[(i, j)] += columns[(0, i)] * a + columns[(1, i)] * b;
            }
        }
        self.right -= columns.transpose() * step.residual;
    }

    /// Of leaks so much later.
    fn later(&self, by_s: f64) -> Self {
        let mut begin = SMatrix::<f64, TOLD, TOLD>::identity();
        (0..3).for_each(|leak| begin[(LEAKS + leak, UNKNOWNS + leak)] = -by_s);
        let mut information = begin.transpose() * self.information * begin;
        information.fill_upper_triangle_with_lower_triangle();
        Self { information, right: begin.transpose() * self.right }
    }
}

/// η, and the lower triangle of Λ.
impl From<Normal> for Vec<f64> {
    fn from(Normal { information, right }: Normal) -> Self {
        let lower = (0..TOLD).flat_map(|j| (j..TOLD).map(move |i| information[(i, j)]));
        right.iter().copied().chain(lower).collect()
    }
}

impl TryFrom<Vec<f64>> for Normal {
    type Error = &'static str;

    fn try_from(numbers: Vec<f64>) -> Result<Self, Self::Error> {
        let mut numbers = numbers.into_iter();
        let mut normal = Self::none();
        let mut next = || numbers.next().ok_or("normal equations that are cut short");
        for row in 0..TOLD {
            normal.right[row] = next()?;
        }
        for j in 0..TOLD {
            for i in j..TOLD {
                normal.information[(i, j)] = next()?;
            }
        }
        normal.information.fill_upper_triangle_with_lower_triangle();
        Ok(normal)
    }
}

/// Some seconds of a window.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Part {
    pub from_s: f64,
    pub normal: Normal,
    /// What is left, squared, and of how many equations.
    pub squares: f64,
    pub count: f64,
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

    pub fn until_s(&self) -> f64 {
        self.from_s + self.pressures.time_s
    }

    /// With its normal equations whole, to which steps are added as the lower triangle and of a run that begins then.
    pub fn whole(mut self, begin_s: f64) -> Self {
        self.normal.information.fill_upper_triangle_with_lower_triangle();
        let normal = self.normal.later(self.middle_s() - begin_s);
        Self { normal, ..self }
    }

    /// The same, around unknowns from which these are so far.
    pub fn around(&self, far: &Told) -> Self {
        let pull = self.normal.information * far;
        let mut around = self.clone();
        around.squares += far.dot(&(2.0 * self.normal.right + pull));
        around.normal.right += pull;
        around
    }
}

impl Part {
    /// The same of a valve that may have changed since, by so much squared: the normal equations without what that makes of them.
    pub fn before_drift(&self, drift: &Unknowns) -> Option<Self> {
        let drift: Told = drift.fixed_resize(0.0);
        let spread = SMatrix::<f64, TOLD, TOLD>::from_diagonal(&drift);
        let less = (SMatrix::<f64, TOLD, TOLD>::identity() + self.normal.information * spread).lu();
        let right = less.solve(&self.normal.right)?;
        let squares = self.squares - self.normal.right.dot(&drift.component_mul(&right));
        let mut information = less.solve(&self.normal.information)?;
        information.fill_upper_triangle_with_lower_triangle();
        Some(Self { normal: Normal { information, right }, squares, ..self.clone() })
    }
}

/// What the parts say together.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Summary {
    /// At their end.
    pub belief: Belief,
    /// Squares of what is left over those of the noise, about 1.
    pub noise: f64,
    /// The leaks' variances by how the parts differ, over those by the noise, and of how many parts.
    pub course: [f64; 3],
    pub parts: usize,
    /// Since when leaks stay or grow as they do, s.
    pub time_s: f64,
    /// Since then, where they grow of late.
    pub pressures: Pressures,
    /// When that was, s.
    pub changed_at_s: Option<f64>,
    /// How often they changed.
    pub changes: usize,
    /// How each leak grows where leaks still go in a straight line, in their unit per second.
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
/// What passes a leak that grows is told at the pressures of so many seconds before the end.
const OF_LATE_S: f64 = 60.0;
/// Fewer parts tell no line from a step.
pub(super) const LEAST_IN_COURSE: usize = 3;
/// Leaks change in so many ramps at the most: more explain anything (chosen).
const MOST_RAMPS: usize = 3;
/// Leaks that stay or grow show in no less, s: two parts of a trace.
const LEAST_TOLD_S: f64 = 7.5;
/// Times nearer than this are one, s: a part of a trace lasts twice as long.
const NEAR_S: f64 = 2.5;
/// Ramps begin and end at one of so many times at the most; numerical.
const MOST_TIMES: usize = 60;
/// So many of the likeliest ramps count; numerical.
const MOST_LIKELY: usize = 12;

/// Sums up the parts of a window, linear around `at`, in the likeliest course, of those that begin with these jumps; none where they say
/// no finite number. The spool's zero stays where it is where leaks do, too: either looks like the other that goes.
pub(super) fn likeliest(
    parts: &[Part],
    jumps: &[Ramp],
    before: &Belief,
    at: &Unknowns,
) -> Option<(Course, Summary)> {
    let search = Search { parts, before, at };
    let still = search.solved(Course::constant())?;
    if jumps.is_empty() && search.longer(&still, &ramps(parts)).is_none() {
        let told = search.told(&still.0)?;
        if told.is_explained() {
            return Some((still.0, told));
        }
    }
    search.in_ramps(Course::walking(parts).with(jumps))
}

/// What a course is sought for.
struct Search<'a> {
    parts: &'a [Part],
    before: &'a Belief,
    at: &'a Unknowns,
}

impl Search<'_> {
    fn solved(&self, course: Course) -> Option<(Course, Solved)> {
        let solved = course.solved(self.parts, self.before, self.at)?;
        Some((course, solved))
    }

    fn told(&self, course: &Course) -> Option<Summary> {
        summed_up(&course_parts(course, self.parts), course, self.before, self.at)
    }

    /// A course with ramps, as long as one more explains more than chance.
    fn in_ramps(&self, base: Course) -> Option<(Course, Summary)> {
        let ramps = ramps(self.parts);
        let mut likely = vec![self.solved(base)?];
        while let Some(next) = self.longer(likely.first()?, &ramps) {
            likely = next;
        }
        let (course, best) = likely.first()?;
        let summary = self.told(course)?;
        Some((best.course.clone(), Summary { belief: self.mixed(&likely)?, ..summary }))
    }

    /// With a ramp more, the likeliest first; none where that explains no more than chance.
    fn longer(&self, (course, found): &(Course, Solved), ramps: &[Ramp]) -> Option<Vec<(Course, Solved)>> {
        if course.ramps.len() >= MOST_RAMPS {
            return None;
        }
        let gains = found.gains(self.parts, self.before, self.at, ramps);
        let mut near: Vec<(f64, &Ramp)> =
            gains.into_iter().zip(ramps).filter(|(gain, _)| *gain > CHANGED).collect();
        near.sort_by(|(a, _), (b, _)| b.total_cmp(a));
        near.truncate(MOST_LIKELY);
        let mut next: Vec<_> =
            near.iter().filter_map(|(_, ramp)| self.solved(course.with(&[**ramp]))).collect();
        next.sort_by(|(_, a), (_, b)| b.worth().total_cmp(&a.worth()));
        let (longer, best) = next.first()?;
        (best.worth() - found.worth() > CHANGED * self.told(longer)?.unlike().powi(2)).then_some(next)
    }

    /// What is believed at the end where each of some courses is as likely as what it explains.
    fn mixed(&self, likely: &[(Course, Solved)]) -> Option<Belief> {
        let most = likely.first()?.1.worth();
        let one = |(course, all): &(Course, Solved)| {
            let own = course.solved(&course_parts(course, self.parts), self.before, self.at)?;
            Some(((0.5 * (all.worth() - most)).exp(), own.step, own.covariance()))
        };
        let each: Vec<(f64, Unknowns, Information)> = likely.iter().filter_map(one).collect();
        let sum: f64 = each.iter().map(|(weight, ..)| weight).sum();
        let step: Unknowns = each.iter().map(|(weight, step, _)| step * (weight / sum)).sum();
        let apart = |one: &Unknowns| (one - step) * (one - step).transpose();
        let spread: Information =
            each.iter().map(|(weight, step, own)| (own + apart(step)) * (weight / sum)).sum();
        let information = spread.cholesky()?.inverse();
        Some(Belief { mean: self.at + step, information, leak_std: self.before.leak_std })
    }
}

/// Those in which leaks go as a course has it: when in its ramp one that sets in at once did so is not known.
fn course_parts(course: &Course, parts: &[Part]) -> Vec<Part> {
    let is_amid = |part: &&Part| course.jumps().iter().any(|ramp| ramp.has(part.middle_s()));
    parts.iter().filter(|part| !is_amid(part)).cloned().collect()
}

/// Those in which leaks may have changed: between two times at which parts begin or end. After one that is over at once there is a part
/// to tell what it changed to.
fn ramps(parts: &[Part]) -> Vec<Ramp> {
    let [first, .., last] = parts else { return Vec::new() };
    if parts.len() < LEAST_IN_COURSE {
        return Vec::new();
    }
    let end_s = last.until_s();
    let mut times: Vec<f64> = parts.iter().flat_map(|part| [part.from_s, part.until_s()]).collect();
    times.dedup_by(|next, last| *next - *last < NEAR_S);
    let times: Vec<f64> = times.iter().copied().step_by(times.len().div_ceil(MOST_TIMES).max(1)).collect();
    let told = |from_s: f64, until_s: f64| {
        let is_over = end_s - until_s >= LEAST_TOLD_S;
        let until_s = if is_over { until_s } else { end_s };
        let is_amid = is_over && from_s > first.from_s;
        let is_told = is_over || until_s - from_s >= LEAST_TOLD_S;
        is_told.then(|| Ramp::new(from_s, until_s, is_amid && until_s - from_s <= AT_ONCE_S))
    };
    let after = |place: usize| times[place + 1..].iter();
    let all = times.iter().enumerate();
    let ramps: Vec<Ramp> =
        all.flat_map(|(place, from_s)| after(place).filter_map(|until_s| told(*from_s, *until_s))).collect();
    let kind = |ramp: &Ramp| (ramp.is_at_once, ramp.until_s >= end_s);
    let alike = |ramp: &Ramp| ramps.iter().filter(|other| kind(other) == kind(ramp)).count() as f64;
    ramps.iter().map(|ramp| ramp.one_of(alike(ramp))).collect()
}

/// What parts say in a course.
fn summed_up(own: &[Part], course: &Course, before: &Belief, at: &Unknowns) -> Option<Summary> {
    let best = course.solved(own, before, at)?;
    let step: Told = best.step.fixed_resize(0.0);
    let moved = |part: &Part| step + best.course.amid(part.middle_s());
    let around: Vec<Part> = own.iter().map(|part| part.around(&-moved(part))).collect();
    let squares: f64 = around.iter().map(|part| part.squares).sum();
    let count: f64 = own.iter().map(|part| part.count).sum();
    let covariance = best.covariance();
    let end_s = own.last()?.until_s();
    let last = best.course.last(end_s);
    let growth = best.growth(end_s);
    let since = |from_s: f64| {
        let later = own.iter().filter(|part| part.middle_s() > from_s);
        later.fold(Pressures::default(), |sum, part| sum.plus(&part.pressures))
    };
    let (from_s, of_late_s) = match (best.course.growing(end_s), last) {
        (Some(ramp), _) => (ramp.from_s, end_s - OF_LATE_S),
        (None, Some(ramp)) => (ramp.until_s, ramp.until_s),
        (None, None) => (f64::NEG_INFINITY, f64::NEG_INFINITY),
    };
    Some(Summary {
        belief: Belief {
            mean: at + best.step,
            information: covariance.cholesky()?.inverse(),
            leak_std: before.leak_std,
        },
        noise: squares / count.max(1.0),
        course: unlike(&around, &covariance),
        parts: own.len(),
        time_s: since(from_s).time_s,
        pressures: since(of_late_s),
        changed_at_s: last.map(Ramp::changed_at_s),
        changes: best.course.ramps.len(),
        growth,
    })
}

/// The leaks' variances by the parts' own scores over those by the noise: errors of the model make neighbours alike, and parts different
/// (the sandwich of Huber 1967, "The behavior of maximum likelihood estimates under nonstandard conditions").
fn unlike(parts: &[Part], covariance: &Information) -> [f64; 3] {
    let (mut seen, mut expected) = ([0.0; 3], [0.0; 3]);
    for Part { normal, .. } in parts {
        for leak in 0..3 {
            let row: Told = covariance.column(LEAKS + leak).into_owned().fixed_resize(0.0);
            seen[leak] += row.dot(&normal.right).powi(2);
            expected[leak] += row.dot(&(normal.information * row));
        }
    }
    [0, 1, 2].map(|leak| seen[leak] / f64::max(expected[leak], f64::MIN_POSITIVE))
}
