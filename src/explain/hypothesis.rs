//! One explanation: a choice of leaks, their courses, and the state of sensors, rig and wiring.

use super::SEGMENTS;
use super::columns::{Column, Course};
use super::equations::NormalEquations;
use super::evidence::Free;
use super::table::{Entry, LEAK_CREEP, LEAK_SHARE, LEAK_SIZE, LEAK_STEP, USUAL};
use pitchleak_core::{Leak, PerLeak};
use std::f64::consts::LN_2;

/// How a leak goes along the trace.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum LeakCourse {
    Constant,
    /// C √P beside C P.
    Orifice,
    /// A steady flow, beside C P or alone: the pressures across it are not as read.
    Unfollowed {
        alone: bool,
    },
    /// Opens at a pressure: C P less a constant flow.
    Cracking,
    /// Linear, from start ≥ 0 to end ≥ 0.
    Growing,
    /// From start ≥ 0 on, linear and by the square of time.
    Accelerating,
    /// There from this segment on; before, what seeps.
    Opening(usize),
    /// The same as a steady flow out of a chamber: within a segment pressures swing as it opens, and it can't be told from its meter's zero that
    /// jumps.
    Burst(usize),
    /// Another level from this segment on.
    Sudden(usize),
    /// A random walk at the segments' borders.
    Wandering,
    /// The same of small steps, each spread over a segment: growth of any course.
    Creeping,
}

impl LeakCourse {
    /// As in the table of explanations.
    pub fn id(self) -> &'static str {
        match self {
            Self::Constant => "constant",
            Self::Orifice => "orifice",
            Self::Unfollowed { .. } => "unfollowed",
            Self::Cracking => "cracking",
            Self::Growing => "growing",
            Self::Accelerating => "accelerating",
            Self::Opening(_) | Self::Burst(_) => "opening",
            Self::Sudden(_) => "sudden",
            Self::Wandering => "wandering",
            Self::Creeping => "creeping",
        }
    }
}

/// A free parameter of a leak, which can't be negative unless it is a `step`.
struct Term {
    column: Column,
    course: Course,
    std: f64,
    step: bool,
    /// By how much it is part of the flow at the trace's end.
    at_end: f64,
}

/// What is free of a leak on this course; where there is none, what seeps.
fn terms(leak: usize, course: Option<LeakCourse>, sizes: &Sizes, segments: usize) -> Vec<Term> {
    let seepage = sizes.seepage[Leak::ALL[leak]];
    let own = |course: Course, at_end: f64| Term {
        column: LEAK_COLUMNS[leak],
        course,
        std: LEAK_SIZE,
        step: false,
        at_end,
    };
    let since = |border: usize| {
        let per_flow = sizes.since.get(border).map_or(1.0, |since| since[Leak::ALL[leak]]);
        Term { std: LEAK_SIZE * per_flow, ..own(Course::Since(border), 1.0) }
    };
    let level = || own(Course::Constant, 1.0);
    let step = |course: Course, std: f64| Term { std, step: true, ..own(course, 0.0) };
    match course {
        None => vec![Term { std: seepage, ..level() }],
        Some(LeakCourse::Constant) => vec![level()],
        Some(LeakCourse::Orifice) => vec![level(), Term { column: ORIFICE_COLUMNS[leak], ..level() }],
        Some(LeakCourse::Unfollowed { alone }) => {
            let steady = Term { column: STEADY_COLUMNS[leak], ..level() };
            std::iter::once(steady).chain((!alone).then(level)).collect()
        }
        Some(LeakCourse::Cracking) => {
            let less = Term { column: CRACKING_COLUMNS[leak], at_end: -1.0, ..level() };
            vec![level(), less]
        }
        Some(LeakCourse::Growing) => vec![own(Course::FromBegin, 0.0), own(Course::ToEnd, 1.0)],
        Some(LeakCourse::Accelerating) => {
            vec![level(), own(Course::ToEnd, 1.0), own(Course::Accelerating, 1.0)]
        }
        Some(LeakCourse::Opening(border)) => {
            vec![Term { std: seepage, ..level() }, since(border)]
        }
        Some(LeakCourse::Burst(border)) => {
            let flow = since(border);
            let (column, unit) = if leak == Leak::ExternalA as usize {
                (Column::ZeroA, sizes.zero_units[0])
            } else {
                (Column::ZeroB, sizes.zero_units[1])
            };
            // A steady flow is one whatever the pressures were.
            let (std, at_end) = (LEAK_SIZE / unit, unit * flow.std / LEAK_SIZE);
            vec![Term { std: seepage, ..level() }, Term { column, std, at_end, ..flow }]
        }
        Some(LeakCourse::Sudden(border)) => {
            vec![own(Course::Before(border), 0.0), since(border)]
        }
        Some(LeakCourse::Wandering) => {
            let steps = (1..segments).map(|border| step(Course::Before(border), LEAK_STEP));
            std::iter::once(level()).chain(steps).collect()
        }
        Some(LeakCourse::Creeping) => {
            let steps = (0..segments).map(|segment| step(Course::Fading(segment), LEAK_CREEP));
            std::iter::once(level()).chain(steps).collect()
        }
    }
}

/// Sensors and rig: a zero, a departure, a wander.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct State<'a> {
    pub zeros: &'a Entry,
    pub departure: &'a Entry,
    /// Standard deviation of the zeros of each segment, share of full scale; and how often.
    pub wander: (f64, f64),
    /// The segment from which on a zero that jumps is off.
    pub border: usize,
}

/// An explanation, ready to be weighed.
#[derive(Clone, Debug)]
pub(super) struct Hypothesis<'a> {
    pub state: State<'a>,
    pub leaks: [Option<LeakCourse>; 3],
    pub wiring: Option<&'a Entry>,
    pub ln_prior: f64,
    pub free: Vec<Free>,
    /// Parameters that cannot be negative.
    pub positive: Vec<usize>,
    /// Places among those, whose sum, times these, is each leak's flow at the trace's end.
    pub ends: [Vec<(usize, f64)>; 3],
}

/// A subset of the leaks.
pub(super) type Subset = [bool; 3];

/// All of them, none first.
pub(super) fn subsets() -> impl Iterator<Item = Subset> {
    (0..8_u8).map(|bits| [bits & 1 > 0, bits & 2 > 0, bits & 4 > 0])
}

pub(super) const LEAK_COLUMNS: [Column; 3] = [Column::LeakInternal, Column::LeakA, Column::LeakB];
pub(super) const CRACKING_COLUMNS: [Column; 3] =
    [Column::CrackingInternal, Column::CrackingA, Column::CrackingB];
pub(super) const STEADY_COLUMNS: [Column; 3] = [Column::SteadyInternal, Column::SteadyA, Column::SteadyB];
pub(super) const ORIFICE_COLUMNS: [Column; 3] = [Column::OrificeInternal, Column::OrificeA, Column::OrificeB];

impl State<'_> {
    pub fn ln_prior(&self) -> f64 {
        self.zeros.share.ln() + self.departure.share.ln() + self.wander.1.ln()
    }

    /// Its free parameters: the usual ones, wider where an entry says so.
    fn free(&self, equations: &NormalEquations, sizes: &Sizes, segments: usize) -> Vec<Free> {
        let mut chosen: Vec<(Column, Course, f64)> =
            USUAL.iter().map(|usual| sizes.declared(*usual)).collect();
        for (column, course, std) in self.zeros.free.iter().chain(&self.departure.free) {
            let course = if let Course::Since(_) = course { Course::Since(self.border) } else { *course };
            match chosen.iter_mut().find(|known| (known.0, known.1) == (*column, course)) {
                Some(known) => known.2 = known.2.max(*std),
                None => chosen.push((*column, course, *std)),
            }
        }
        if self.wander.0 > 0.0 {
            for column in [Column::ZeroA, Column::ZeroB] {
                chosen.extend((0..segments).map(|segment| (column, Course::Within(segment), self.wander.0)));
            }
        }
        let place = |(column, course, std): (Column, Course, f64)| {
            Some(Free { column: equations.place(column, course)?, std })
        };
        chosen.into_iter().filter_map(place).collect()
    }
}

/// What the rig file declares of sizes, in the columns' units.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sizes {
    /// What seeps where nothing leaks, share of full scale.
    pub seepage: PerLeak<f64>,
    /// How many times larger the coefficient of a flow is from each border on than through the whole trace: a burst hose takes its chamber's
    /// pressure away.
    pub since: [PerLeak<f64>; SEGMENTS],
    pub compressibility: f64,
    /// Units of the meters' zeros, in that of leaks.
    pub zero_units: [f64; 2],
    pub zeros: [f64; 2],
    pub gains: [f64; 2],
    /// Shares of what is swept.
    pub dead_volumes: [f64; 2],
    /// What may be off of the position's zero, share of the stroke: the piston is within its cylinder.
    pub position_zero: [f64; 2],
}

impl Sizes {
    /// The declared size of a usual parameter, where one is declared.
    fn declared(&self, (column, course, usual): (Column, Course, f64)) -> (Column, Course, f64) {
        let declared = match (column, course) {
            (Column::Compressibility, _) => self.compressibility,
            (Column::ZeroA, Course::Constant) => self.zeros[0],
            (Column::ZeroB, Course::Constant) => self.zeros[1],
            (Column::GainA, _) => self.gains[0],
            (Column::GainB, _) => self.gains[1],
            _ => 0.0,
        };
        (column, course, if declared > 0.0 { declared } else { usual })
    }
}

impl<'a> Hypothesis<'a> {
    /// With leaks of these courses, of which `ln_course` is the prior.
    pub fn new(
        equations: &NormalEquations,
        sizes: &Sizes,
        segments: usize,
        state: State<'a>,
        leaks: [Option<LeakCourse>; 3],
        ln_course: f64,
    ) -> Self {
        let mut own = Self {
            state,
            leaks,
            wiring: None,
            ln_prior: state.ln_prior() + ln_course,
            free: state.free(equations, sizes, segments),
            positive: Vec::new(),
            ends: Default::default(),
        };
        for (leak, course) in leaks.iter().enumerate() {
            if course.is_some() {
                own.ln_prior += (LEAK_SHARE / (1.0 - LEAK_SHARE)).ln();
            }
            for term in terms(leak, *course, sizes, segments) {
                own.add(equations, leak, &term);
            }
        }
        own.ln_prior += own.positive.len() as f64 * LN_2;
        own
    }

    /// Where a column stands among its free parameters.
    pub fn place(&self, equations: &NormalEquations, column: Column, course: Course) -> Option<usize> {
        let place = equations.place(column, course)?;
        self.free.iter().position(|free| free.column == place)
    }

    /// How large a leak is of what rises with time or pressure, share of full scale, with free parameters of these means.
    pub fn level(&self, leak: Leak, means: &[f64]) -> f64 {
        self.rising(leak).map(|place| means[self.positive[place]]).sum()
    }

    /// Places, among the parameters that cannot be negative, of what rises with time or pressure of a leak.
    pub fn rising(&self, leak: Leak) -> impl Iterator<Item = usize> + '_ {
        self.ends[leak as usize].iter().filter(|(_, sign)| *sign > 0.0).map(|(place, _)| *place)
    }

    /// The segment from which on all leaks are as at the end: where one wanders, the last.
    pub fn last_change(&self, segments: usize) -> usize {
        let border = |course: &Option<LeakCourse>| match course {
            Some(LeakCourse::Opening(border) | LeakCourse::Burst(border) | LeakCourse::Sudden(border)) => {
                *border
            }
            Some(LeakCourse::Wandering | LeakCourse::Creeping) => segments.saturating_sub(1),
            _ => 0,
        };
        self.leaks.iter().map(border).max().unwrap_or(0)
    }

    fn add(&mut self, equations: &NormalEquations, leak: usize, term: &Term) {
        let Some(column) = equations.place(term.column, term.course) else { return };
        if !term.step {
            self.ends[leak].push((self.positive.len(), term.at_end));
            self.positive.push(self.free.len());
        }
        self.free.push(Free { column, std: term.std });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn subsets_are_every_choice_of_leaks_once_and_none_first() {
        let all: Vec<Subset> = subsets().collect();
        assert_eq!((all.len(), all[0]), (8, [false; 3]));
        assert!((0..8).all(|i| !all[..i].contains(&all[i])), "{all:?}");
    }
}
