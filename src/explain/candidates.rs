//! The explanations that are weighed: leaks of each course beside each state of the sensors, and mistakes of wiring.

use super::columns::{Column, Course};
use super::equations::NormalEquations;
use super::evidence::{Fit, fit};
use super::hypothesis::{Hypothesis, LEAK_COLUMNS, LeakCourse, State, Subset, subsets};
use super::posterior::{LEAST_LN, Pass, Scored};
use super::readings::{Mistake, Of};
use super::table::{self, Entry, USUAL};

/// By how much the likelihood of a course may exceed that of leaks that wander, in ln; numerical.
const BEYOND_WANDERING: f64 = 2.0;
/// States of sensors and rig, best first, beside which pairs of leaks have courses of their own; numerical.
const STATES_WITH_PAIRS: usize = 3;
/// Gains and areas that are off by more are units.
const MOST_GAIN: f64 = 0.15;

impl<'a> Pass<'a, '_> {
    /// Constant leaks with every state of the sensors; zeros that wander only beside the two likeliest zeros.
    pub(super) fn constant(&self, equations: &NormalEquations) -> Vec<Scored<'a>> {
        let mut all = Vec::new();
        let declared = self.sizes.zeros.iter().all(|zero| *zero > 0.0);
        for (rank, zeros) in self.tables.zeros.iter().enumerate() {
            // Who declares zeros knows them: they fail, but are not slightly off.
            if declared && zeros.id == "flow_zeros" {
                continue;
            }
            for (place, departure) in self.departures().into_iter().enumerate() {
                for wander in &self.tables.wanders {
                    if wander.0 > 0.0 && (rank > 1 || place > 1) {
                        continue;
                    }
                    let state = State { zeros, departure, wander: *wander };
                    for subset in subsets() {
                        // A pressure's gain acts through the leak past the piston.
                        if departure.is_through_seal() && !subset[0] {
                            continue;
                        }
                        let leaks = subset.map(|there| there.then_some(LeakCourse::Constant));
                        let ln_course =
                            if subset == [false; 3] { 0.0 } else { self.tables.ln_course("constant") };
                        all.push(self.score(equations, state, leaks, ln_course));
                    }
                }
            }
        }
        all
    }

    fn score(
        &self,
        equations: &NormalEquations,
        state: State<'a>,
        leaks: [Option<LeakCourse>; 3],
        ln_course: f64,
    ) -> Scored<'a> {
        let hypothesis = Hypothesis::new(equations, &self.sizes, self.segments, state, leaks, ln_course);
        self.scored(equations, hypothesis)
    }

    fn scored(&self, equations: &NormalEquations, hypothesis: Hypothesis<'a>) -> Scored<'a> {
        let fit = fit(equations, &hypothesis.free);
        let ln_posterior = if self.has_impossible_gain(equations, &hypothesis, &fit) {
            f64::NEG_INFINITY
        } else {
            fit.ln_evidence + hypothesis.ln_prior + equations.ln_chance(fit.scales)
        };
        Scored { hypothesis, ln_posterior, ln_likelihood: fit.ln_likelihood, wiring: 0 }
    }

    fn has_impossible_gain(
        &self,
        equations: &NormalEquations,
        hypothesis: &Hypothesis<'_>,
        fit: &Fit,
    ) -> bool {
        let gains =
            [Column::GainA, Column::GainB, Column::Gains, Column::AreaA, Column::AreaB, Column::PositionGain];
        let places = gains.map(|gain| equations.place(gain, Course::Constant));
        hypothesis
            .free
            .iter()
            .zip(&fit.means)
            .any(|(free, mean)| mean.abs() > MOST_GAIN && places.contains(&Some(free.column)))
    }

    /// Other courses of the leaks, beside the best states. Leaks that wander or creep may do all that the others do: where even
    /// that raises the likelihood by too little, they need not be asked.
    pub(super) fn with_courses(
        &self,
        equations: &NormalEquations,
        states: &[State<'a>],
        all: &mut Vec<Scored<'a>>,
    ) {
        let mut best = all.iter().map(|scored| scored.ln_posterior).fold(f64::NEG_INFINITY, f64::max);
        let courses = self.courses();
        for (rank, state) in states.iter().enumerate() {
            for subset in subsets().skip(1) {
                let Some(steady) = find(all, *state, subset) else { continue };
                let (steady_ln, steady_likelihood) = (steady.ln_posterior, steady.ln_likelihood);
                let together = |course: LeakCourse| subset.map(|there| there.then_some(course));
                let mut most_likely = steady_likelihood;
                for course in [LeakCourse::Wandering, LeakCourse::Creeping] {
                    let free = self.score(equations, *state, together(course), self.ln_course(course));
                    most_likely = most_likely.max(free.ln_likelihood);
                    best = best.max(free.ln_posterior);
                    all.push(free);
                }
                let gain = most_likely - steady_likelihood + BEYOND_WANDERING;
                let most = steady_ln - self.tables.ln_course("constant") + gain;
                for (course, ln_course) in &courses {
                    // The pressure across the seal changes sign: what opens at one is no line of it.
                    let is_line = !(subset[0] && *course == LeakCourse::Cracking);
                    let by_pressure = matches!(course, LeakCourse::Orifice | LeakCourse::Cracking);
                    if is_line && (by_pressure || most + ln_course > best - LEAST_LN) {
                        let scored = self.score(equations, *state, together(*course), *ln_course);
                        best = best.max(scored.ln_posterior);
                        all.push(scored);
                    }
                }
                if rank < STATES_WITH_PAIRS
                    && state.wander.0 <= 0.0
                    && subset.iter().filter(|leak| **leak).count() == 2
                {
                    self.with_pairs(equations, *state, subset, most, &mut best, all);
                }
            }
        }
    }

    /// Of leaks that wander or creep.
    fn ln_course(&self, course: LeakCourse) -> f64 {
        self.tables.ln_course(if course == LeakCourse::Creeping { "creeping" } else { "wandering" })
    }

    /// Courses of leaks beside these and being constant, with their priors.
    fn courses(&self) -> Vec<(LeakCourse, f64)> {
        let borders = self.segments.saturating_sub(1);
        let sudden = self.tables.ln_course("sudden") - (borders.max(1) as f64).ln();
        let mut courses = vec![
            (LeakCourse::Orifice, self.tables.ln_course("orifice")),
            (LeakCourse::Cracking, self.tables.ln_course("cracking")),
            (LeakCourse::Growing, self.tables.ln_course("growing")),
        ];
        courses.extend((1..self.segments).map(|border| (LeakCourse::Sudden(border), sudden)));
        courses
    }

    /// Two leaks each with a course of its own, where those can be as probable as the best.
    fn with_pairs(
        &self,
        equations: &NormalEquations,
        state: State<'a>,
        subset: Subset,
        most: f64,
        best: &mut f64,
        all: &mut Vec<Scored<'a>>,
    ) {
        let mut courses = self.courses();
        courses.retain(|(course, _)| matches!(course, LeakCourse::Growing | LeakCourse::Sudden(_)));
        courses.push((LeakCourse::Constant, self.tables.ln_course("constant")));
        let places: Vec<usize> = (0..3).filter(|leak| subset[*leak]).collect();
        for (course, ln_one) in &courses {
            for (another, ln_other) in courses.iter().filter(|(another, _)| another != course) {
                if most + ln_one + ln_other <= *best - LEAST_LN {
                    continue;
                }
                let mut leaks = [None; 3];
                (leaks[places[0]], leaks[places[1]]) = (Some(*course), Some(*another));
                let scored = self.score(equations, state, leaks, ln_one + ln_other);
                *best = best.max(scored.ln_posterior);
                all.push(scored);
            }
        }
    }

    /// Mistakes of wiring, beside slightly wrong zeros and constant leaks.
    pub(super) fn with_mistakes(
        &self,
        declared: &NormalEquations,
        all: &mut Vec<Scored<'a>>,
    ) -> Vec<NormalEquations> {
        let mut columns = vec![(Column::LeftSide, Course::Constant)];
        columns
            .extend(USUAL.iter().filter(|usual| usual.1 == Course::Constant).map(|usual| (usual.0, usual.1)));
        columns.extend(LEAK_COLUMNS.map(|leak| (leak, Course::Constant)));
        let (Some(zeros), Some(departure), Some(wander)) =
            (self.tables.zeros.get(1), self.tables.departures.first(), self.tables.wanders.first())
        else {
            return Vec::new();
        };
        let state = State { zeros, departure, wander: *wander };
        let best = all.iter().map(|scored| scored.ln_posterior).fold(f64::NEG_INFINITY, f64::max);
        let is_part = |subset: &Subset| subset.iter().any(|leak| *leak) && !subset.iter().all(|leak| *leak);
        let whole = self.products.whole();
        let ln_wired = table::ln_wired(&self.tables.mistakes);
        let mut kept = Vec::new();
        for entry in self.tables.mistakes.iter().filter(|entry| self.is_told(entry)) {
            let ln_jacobian = entry.mistake.map_or(0.0, Mistake::ln_jacobian);
            let mended = self.equations(&whole, Some(entry), &columns);
            let (equations, ln_measure) = mended.measured_as(declared, ln_jacobian);
            let ln_prior = entry.share.ln() - ln_wired + ln_measure;
            let mut none_ln = f64::NEG_INFINITY;
            for subset in [[false; 3], [true; 3]].into_iter().chain(subsets().filter(is_part)) {
                let leaks = subset.map(|there| there.then_some(LeakCourse::Constant));
                let ln_course = if subset == [false; 3] { 0.0 } else { self.tables.ln_course("constant") };
                let mut hypothesis = Hypothesis::new(
                    &equations,
                    &self.sizes,
                    self.segments,
                    state,
                    leaks,
                    ln_course + ln_prior,
                );
                hypothesis.wiring = Some(entry);
                let mut scored = self.scored(&equations, hypothesis);
                scored.wiring = kept.len() + 1;
                // No leak's prior and Occam's factor are lighter than none's, no likelihood is larger than that of all three.
                if subset == [false; 3] {
                    none_ln = scored.ln_posterior - scored.ln_likelihood;
                }
                let hopeless = subset == [true; 3] && none_ln + scored.ln_likelihood < best - LEAST_LN;
                all.push(scored);
                if hopeless {
                    break;
                }
            }
            kept.push(equations);
        }
        kept
    }

    /// Readings without any scatter are of every unit.
    fn is_told(&self, entry: &Entry) -> bool {
        let Some(Mistake::Factor(of, _)) = entry.mistake else { return true };
        let scatter = self.statistic.scatter();
        let has = |channel: usize| scatter[channel].is_some_and(|std| std > 0.0);
        match of {
            Of::Position => has(0),
            Of::PressureA => has(1),
            Of::PressureB => has(2),
            Of::Pressures => has(1) && has(2),
            Of::FlowA => has(3),
            Of::FlowB => has(4),
            Of::Flows => has(3) && has(4),
        }
    }
}

/// These leaks, steady, in this state.
fn find<'b, 'a>(all: &'b [Scored<'a>], state: State<'a>, subset: Subset) -> Option<&'b Scored<'a>> {
    let steady = subset.map(|there| there.then_some(LeakCourse::Constant));
    all.iter().find(|scored| scored.hypothesis.leaks == steady && scored.hypothesis.state == state)
}
