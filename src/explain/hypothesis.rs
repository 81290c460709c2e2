//! One explanation: a choice of leaks, their courses, and the state of sensors, rig and wiring.

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
    /// Opens at a pressure: C P less a constant flow.
    Cracking,
    /// Linear, from start ≥ 0 to end ≥ 0.
    Growing,
    /// Another level from this segment on.
    Sudden(usize),
    /// A random walk at the segments' borders.
    Wandering,
    /// The same of small steps, each spread over a segment: growth of any course.
    Creeping,
}

/// Sensors and rig: a zero, a departure, a wander.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct State<'a> {
    pub zeros: &'a Entry,
    pub departure: &'a Entry,
    /// Standard deviation of the zeros of each segment, share of full scale; and how often.
    pub wander: (f64, f64),
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
    /// Parameters whose sum, with these signs, is each leak's flow at the trace's end.
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
            match chosen.iter_mut().find(|known| (known.0, known.1) == (*column, *course)) {
                Some(known) => known.2 = known.2.max(*std),
                None => chosen.push((*column, *course, *std)),
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
    pub compressibility: f64,
    pub zeros: [f64; 2],
    pub gains: [f64; 2],
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
            match course {
                Some(course) => {
                    own.ln_prior += (LEAK_SHARE / (1.0 - LEAK_SHARE)).ln();
                    own.add_leak(equations, leak, *course, segments);
                }
                None => own.add_seepage(equations, leak, sizes.seepage[Leak::ALL[leak]]),
            }
        }
        own.ln_prior += own.positive.len() as f64 * LN_2;
        own
    }

    /// The segment from which on all leaks are as at the end: where one wanders, the last.
    pub fn last_change(&self, segments: usize) -> usize {
        let border = |course: &Option<LeakCourse>| match course {
            Some(LeakCourse::Sudden(border)) => *border,
            Some(LeakCourse::Wandering | LeakCourse::Creeping) => segments.saturating_sub(1),
            _ => 0,
        };
        self.leaks.iter().map(border).max().unwrap_or(0)
    }

    fn add_seepage(&mut self, equations: &NormalEquations, leak: usize, std: f64) {
        if let Some(column) = equations.place(LEAK_COLUMNS[leak], Course::Constant) {
            let at = self.free.len();
            self.free.push(Free { column, std });
            self.positive.push(at);
            self.ends[leak].push((at, 1.0));
        }
    }

    fn add_leak(&mut self, equations: &NormalEquations, leak: usize, course: LeakCourse, segments: usize) {
        let column = LEAK_COLUMNS[leak];
        let mut add = |column: Column, course: Course, std: f64| {
            let place = equations.place(column, course)?;
            self.free.push(Free { column: place, std });
            Some(self.free.len() - 1)
        };
        let (positive, ends) = match course {
            LeakCourse::Constant => {
                let level = add(column, Course::Constant, LEAK_SIZE);
                (vec![level], vec![level])
            }
            LeakCourse::Orifice => {
                let level = add(column, Course::Constant, LEAK_SIZE);
                let root = add(ORIFICE_COLUMNS[leak], Course::Constant, LEAK_SIZE);
                (vec![level, root], vec![level, root])
            }
            LeakCourse::Cracking => {
                let level = add(column, Course::Constant, LEAK_SIZE);
                let less = add(CRACKING_COLUMNS[leak], Course::Constant, LEAK_SIZE);
                self.ends[leak] =
                    level.map(|at| (at, 1.0)).into_iter().chain(less.map(|at| (at, -1.0))).collect();
                (vec![level, less], vec![])
            }
            LeakCourse::Growing => {
                let start = add(column, Course::FromBegin, LEAK_SIZE);
                let end = add(column, Course::ToEnd, LEAK_SIZE);
                (vec![start, end], vec![end])
            }
            LeakCourse::Sudden(border) => {
                let before = add(column, Course::Before(border), LEAK_SIZE);
                let since = add(column, Course::Since(border), LEAK_SIZE);
                (vec![before, since], vec![since])
            }
            LeakCourse::Wandering => {
                let level = add(column, Course::Constant, LEAK_SIZE);
                for border in 1..segments {
                    add(column, Course::Before(border), LEAK_STEP);
                }
                (vec![level], vec![level])
            }
            LeakCourse::Creeping => {
                let level = add(column, Course::Constant, LEAK_SIZE);
                for segment in 0..segments {
                    add(column, Course::Fading(segment), LEAK_CREEP);
                }
                (vec![level], vec![level])
            }
        };
        self.positive.extend(positive.into_iter().flatten());
        self.ends[leak].extend(ends.into_iter().flatten().map(|at: usize| (at, 1.0)));
    }
}
