//! The posterior over the table: which explanations of the readings are left, and how large each leak is under them.

use super::columns::{Column, Course, Scales};
use super::equations::NormalEquations;
use super::evidence::{Fit, fit};
use super::hypothesis::{
    CRACKING_COLUMNS, Hypothesis, LEAK_COLUMNS, LeakCourse, ORIFICE_COLUMNS, Sizes, State, Subset, subsets,
};
use super::independence::inflation;
use super::orthant::{POINTS, normal_quantile, positive_orthant, uniform};
use super::raw_products::{RawProducts, Statistic};
use super::readings::{Mistake, Of, Readings};
use super::sizes::Found;
use super::table::{self, Entry, USUAL, USUAL_PRESSURE};
use crate::rig::Rig;
use pitchleak_core::continuity::CHANNELS;
use pitchleak_core::{Estimate, Leak, PerLeak};

/// Explanations so much less probable than the best (e⁻⁹) are left out; numerical.
const LEAST_LN: f64 = 9.0;
/// As much in the first look, which asks for the best and for means alone; numerical.
const FIRST_LOOK_LN: f64 = 3.0;
/// States of sensors and rig beside which other courses of leaks are tried; numerical.
const STATES_WITH_COURSES: usize = 5;
/// By how much the likelihood of a course may exceed that of leaks that wander, in ln; numerical.
const BEYOND_WANDERING: f64 = 2.0;
/// Of those, beside which pairs of leaks have courses of their own; numerical.
const STATES_WITH_PAIRS: usize = 3;
/// Gains and areas that are off by more are units.
const MOST_GAIN: f64 = 0.15;
/// Leaks below this share of their threshold say nothing of the pressure sensors; a guess.
const LEAST_LEAK: f64 = 0.5;
/// A noise scale of so many times the readings' own scatter, squared, may be chance; above, an effect is missing, which is
/// alike in about ten blocks: a push of the pitch. Guesses.
const CHANCE_MISFIT2: f64 = 1.15;
const MISFIT_WORTH: f64 = 10.0;
/// Rows of an equation below which nothing can be said.
const LEAST_ROWS: f64 = 8.0;

/// A weighed explanation.
#[derive(Clone, Debug)]
pub(super) struct Weighed<'a> {
    pub hypothesis: Hypothesis<'a>,
    pub probability: f64,
    /// Noise scale over what the readings scatter.
    pub misfit: f64,
    /// How long before the end a leak last changed at once, s; none where none did.
    pub changed_ago_s: Option<f64>,
    /// Mean size of the pressures across the leaks since then, Pa.
    pub pressures_pa: PerLeak<f64>,
    /// What is not as declared, in its columns' units.
    pub found: Vec<Found>,
    /// Mean of C P of each leak, m³/s.
    pub levels_m3s: [f64; 3],
    /// Flow of each leak at the trace's end, m³/s, and weights of sum 1.
    pub leaks_m3s: Vec<[f64; 3]>,
    pub weights: Vec<f64>,
}

/// The table as it is weighed.
pub(super) struct Tables {
    zeros: Vec<Entry>,
    departures: Vec<Entry>,
    pressures: Vec<Entry>,
    wanders: Vec<(f64, f64)>,
    mistakes: Vec<Entry>,
    courses: Vec<Entry>,
}

impl Tables {
    pub fn new() -> Self {
        Self {
            zeros: table::zeros(),
            departures: table::departures(),
            pressures: table::pressures(),
            wanders: table::wanders(),
            mistakes: table::mistakes(),
            courses: table::courses(),
        }
    }

    fn ln_course(&self, id: &str) -> f64 {
        self.courses
            .iter()
            .find(|course| course.id == id)
            .map_or(f64::NEG_INFINITY, |course| course.share.ln())
    }
}

/// Weighs the whole table; `None` where there is too little to weigh.
pub(super) fn weigh<'a>(
    statistic: &Statistic,
    rig: &Rig,
    tables: &'a Tables,
    doubts_m3s: PerLeak<f64>,
) -> Option<Vec<Weighed<'a>>> {
    let rows: f64 =
        (0..2).map(|c| statistic.segments().iter().map(|s| s.rows(c)).sum::<f64>()).fold(0.0, f64::max);
    if rows < LEAST_ROWS {
        return None;
    }
    let products = RawProducts::of(statistic, rig);
    let (first, inflation) = Pass::new(statistic, &products, rig, tables, PerLeak::default()).look();
    let mean_m3s = PerLeak::from_fn(|leak| mean_level(&first, leak as usize));
    let least_m3s = rig.alarms.threshold_m3s.map(|threshold| LEAST_LEAK * threshold);
    let is_sound = mean_m3s.zip(least_m3s).iter().all(|(_, (mean, least))| mean < least);
    let found_m3s = if is_sound { PerLeak::default() } else { mean_m3s };
    let products = products.worth(inflation);
    let last = Pass { doubts_m3s, ..Pass::new(statistic, &products, rig, tables, found_m3s) };
    let weighed = last.weigh();
    (!weighed.is_empty()).then_some(weighed)
}

/// Mean of C P: of a leak that opens at a pressure more than what flows, as a sensor's zero acts through C.
fn mean_level(weighed: &[Weighed<'_>], leak: usize) -> f64 {
    weighed.iter().map(|one| one.probability * one.levels_m3s[leak]).sum()
}

/// All that one pass over the table needs.
struct Pass<'a, 's> {
    statistic: &'s Statistic,
    products: &'s RawProducts,
    rig: &'s Rig,
    tables: &'a Tables,
    found_m3s: PerLeak<f64>,
    /// Spreads of the leaks beside what the trace leaves open.
    doubts_m3s: PerLeak<f64>,
    sizes: Sizes,
    segments: usize,
    full_scale_m3s: f64,
    /// Scatter of the readings over the declared noise, at least 1: of flows, and of the position.
    scatter: [f64; 2],
}

/// An explanation and its evidence before leaks are cut at zero.
struct Scored<'a> {
    hypothesis: Hypothesis<'a>,
    ln_posterior: f64,
    ln_likelihood: f64,
    /// Among the equations of this mistake of wiring, or the declared.
    wiring: usize,
}

impl<'a, 's> Pass<'a, 's> {
    fn new(
        statistic: &'s Statistic,
        products: &'s RawProducts,
        rig: &'s Rig,
        tables: &'a Tables,
        found_m3s: PerLeak<f64>,
    ) -> Self {
        let flows = [rig.instruments.flow_a, rig.instruments.flow_b];
        let full_scale_m3s = flows[0].full_scale.max(flows[1].full_scale);
        Self {
            statistic,
            products,
            rig,
            tables,
            found_m3s,
            doubts_m3s: PerLeak::default(),
            sizes: Sizes {
                seepage: table::USUAL_SEEPAGE * rig.alarms.threshold_m3s.internal / full_scale_m3s,
                compressibility: rig.fluid.bulk_modulus_std_pa / rig.fluid.bulk_modulus_pa,
                zeros: flows.map(|flow| flow.bias),
                gains: flows.map(|flow| flow.gain),
            },
            segments: statistic.segments().len(),
            full_scale_m3s,
            scatter: scatter(statistic, rig),
        }
    }

    /// A first look, without mistakes of wiring: which leaks there are, and how many blocks are independent.
    fn look(&self) -> (Vec<Weighed<'a>>, [f64; 2]) {
        let columns = self.columns();
        let declared = self.equations(self.products, None, &columns);
        let mut all = self.constant(&declared);
        let states = best_states(&mut all);
        self.with_courses(&declared, &states, &mut all);
        all.sort_by(|a, b| b.ln_posterior.total_cmp(&a.ln_posterior));
        let weighed = self.mix(std::slice::from_ref(&declared), all, FIRST_LOOK_LN);
        let inflation = weighed.first().map_or([1.0; 2], |best| {
            let fit = fit(&declared, &best.hypothesis.free);
            let coloured =
                inflation(self.products, &self.scales(None), &declared, &columns, &best.hypothesis, &fit);
            [0, 1].map(|c| {
                let misfit2 = fit.scales[c] / self.scatter[c].powi(2);
                coloured[c].max(1.0 + MISFIT_WORTH * (misfit2 - CHANCE_MISFIT2).max(0.0))
            })
        });
        (weighed, inflation)
    }

    fn weigh(&self) -> Vec<Weighed<'a>> {
        let declared = self.equations(self.products, None, &self.columns());
        let mut all = self.constant(&declared);
        let states = best_states(&mut all);
        self.with_courses(&declared, &states, &mut all);
        let mistaken = self.with_mistakes(&declared, &mut all);
        let mut equations = vec![declared];
        equations.extend(mistaken);
        all.sort_by(|a, b| b.ln_posterior.total_cmp(&a.ln_posterior));
        self.mix(&equations, all, LEAST_LN)
    }

    fn equations(
        &self,
        products: &RawProducts,
        mistake: Option<&Entry>,
        columns: &[(Column, Course)],
    ) -> NormalEquations {
        NormalEquations::new(products, &self.scales(mistake), columns)
    }

    fn scales(&self, mistake: Option<&Entry>) -> Scales<'s> {
        let cylinder = &self.rig.cylinder;
        let mut readings = Readings::declared(cylinder, 1e6 / self.rig.fluid.bulk_modulus_pa);
        let mut pressures_mpa = self.products.mean_pressures_pa(0).map(|p| 1e-6 * p);
        let mut roots = self.statistic.mean_roots();
        if let Some(mistake) = mistake.and_then(|entry| entry.mistake) {
            readings = readings.mended(mistake, cylinder);
            pressures_mpa = mistake.mended_pressures(pressures_mpa);
            roots = mistake.mended_pressures(roots);
        }
        Scales { rig: self.rig, readings, pressures_mpa, roots, leaks_m3s: self.found_m3s }
    }

    /// Departures that are weighed: pressures through the leaks found, where there are any.
    fn departures(&self) -> Vec<&'a Entry> {
        let second = Leak::ALL.iter().any(|leak| self.found_m3s[*leak] > 0.0);
        let pressures = if second { &self.tables.pressures[..] } else { &[] };
        let known = |entry: &&Entry| !pressures.iter().any(|other| other.id == entry.id);
        self.tables.departures.iter().filter(known).chain(pressures).collect()
    }

    fn columns(&self) -> Vec<(Column, Course)> {
        let mut columns = vec![(Column::LeftSide, Course::Constant)];
        columns.extend(USUAL.iter().map(|(column, course, _)| (*column, *course)));
        let entries = self.tables.zeros.iter().chain(self.departures());
        columns.extend(
            entries.flat_map(|entry| entry.free.iter().map(|(column, course, _)| (*column, *course))),
        );
        for leak in LEAK_COLUMNS {
            columns.extend([Course::Constant, Course::FromBegin, Course::ToEnd].map(|course| (leak, course)));
            columns.extend(
                (1..self.segments).flat_map(|k| [(leak, Course::Before(k)), (leak, Course::Since(k))]),
            );
            columns.extend((0..self.segments).map(|k| (leak, Course::Fading(k))));
        }
        let by_law = ORIFICE_COLUMNS.into_iter().chain(CRACKING_COLUMNS);
        columns.extend(by_law.map(|law| (law, Course::Constant)));
        for zero in [Column::ZeroA, Column::ZeroB] {
            columns.extend((0..self.segments).map(|segment| (zero, Course::Within(segment))));
        }
        let mut seen = std::collections::HashSet::new();
        columns.retain(|key| seen.insert(*key));
        columns
    }

    /// Constant leaks with every state of the sensors; zeros that wander only beside the two likeliest zeros.
    fn constant(&self, equations: &NormalEquations) -> Vec<Scored<'a>> {
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
    fn with_courses(&self, equations: &NormalEquations, states: &[State<'a>], all: &mut Vec<Scored<'a>>) {
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
    fn with_mistakes(&self, declared: &NormalEquations, all: &mut Vec<Scored<'a>>) -> Vec<NormalEquations> {
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

    /// Cuts leaks at zero, best first, until what follows cannot matter.
    fn mix(&self, equations: &[NormalEquations], all: Vec<Scored<'a>>, least_ln: f64) -> Vec<Weighed<'a>> {
        let mut best = f64::NEG_INFINITY;
        let mut kept: Vec<(f64, Weighed<'a>)> = Vec::new();
        for scored in all {
            if !scored.ln_posterior.is_finite() || scored.ln_posterior < best - least_ln {
                break;
            }
            let Some(equations) = equations.get(scored.wiring) else { continue };
            let Some((ln, weighed)) = self.cut(equations, scored, best - least_ln) else { continue };
            best = best.max(ln);
            kept.push((ln, weighed));
        }
        kept.retain(|(ln, _)| *ln > best - least_ln);
        let sum: f64 = kept.iter().map(|(ln, _)| (ln - best).exp()).sum();
        kept.sort_by(|a, b| b.0.total_cmp(&a.0));
        kept.into_iter().map(|(ln, one)| Weighed { probability: (ln - best).exp() / sum, ..one }).collect()
    }

    /// An explanation with its leaks at least zero, its evidence and a sample of the leaks.
    fn cut(&self, equations: &NormalEquations, scored: Scored<'a>, least: f64) -> Option<(f64, Weighed<'a>)> {
        let Scored { hypothesis, ln_posterior, .. } = scored;
        let fit = fit(equations, &hypothesis.free);
        let misfit = self.misfit(&fit);
        let mut ln = ln_posterior;
        let mut levels_m3s = [0.0; 3];
        let (leaks_m3s, weights) = if hypothesis.positive.is_empty() {
            (vec![[0.0; 3]], vec![1.0])
        } else {
            let means: Vec<f64> = hypothesis.positive.iter().map(|&i| fit.means[i]).collect();
            let covariance = fit.covariance(&hypothesis.positive);
            let most_negative =
                means.iter().enumerate().map(|(i, mean)| (mean / covariance[i][i].sqrt()).min(0.0));
            if ln - 0.5 * most_negative.fold(0.0, f64::min).powi(2) < least {
                return None;
            }
            let orthant = positive_orthant(&means, &covariance);
            ln += orthant.ln_probability;
            levels_m3s = self.levels_m3s(&hypothesis, &orthant.points, &orthant.weights);
            (self.leaks_m3s(equations, &hypothesis, &fit, &orthant.points), orthant.weights)
        };
        let found = self.found(equations, &hypothesis, &fit);
        let pressures_pa = self.products.mean_pressures_pa(hypothesis.last_change(self.segments));
        let changed = Some(hypothesis.last_change(self.segments)).filter(|border| *border > 0);
        let changed = changed.and_then(|border| self.products.segments.get(border));
        let changed_ago_s = changed.map(|segment| self.products.total_s - segment.begin_s);
        Some((
            ln,
            Weighed {
                hypothesis,
                probability: 0.0,
                misfit,
                changed_ago_s,
                pressures_pa,
                found,
                levels_m3s,
                leaks_m3s,
                weights,
            },
        ))
    }

    /// The columns that its state sets free, as far as they are steady.
    fn found(&self, equations: &NormalEquations, hypothesis: &Hypothesis<'_>, fit: &Fit) -> Vec<Found> {
        let State { zeros, departure, .. } = hypothesis.state;
        let columns = zeros.free.iter().chain(&departure.free).filter(|free| free.1 == Course::Constant);
        let size = |column: Column| {
            let place = equations.place(column, Course::Constant)?;
            let at = hypothesis.free.iter().position(|free| free.column == place)?;
            let variance = fit.covariance(&[at])[0][0];
            Some((column, Estimate { value: fit.means[at], std: variance.max(0.0).sqrt() }))
        };
        columns.filter_map(|(column, ..)| size(*column)).collect()
    }

    fn levels_m3s(&self, hypothesis: &Hypothesis<'_>, points: &[Vec<f64>], weights: &[f64]) -> [f64; 3] {
        [0, 1, 2].map(|leak| {
            let rising = hypothesis.ends[leak].iter().filter(|(_, sign)| *sign > 0.0);
            let places = rising.filter_map(|(end, _)| hypothesis.positive.iter().position(|one| one == end));
            let mean =
                |place: usize| points.iter().zip(weights).map(|(point, w)| w * point[place]).sum::<f64>();
            places.map(mean).sum::<f64>() * self.full_scale_m3s
        })
    }

    /// Noise scales over the scatter of the readings themselves: louder sensors are no doubt about the model.
    fn misfit(&self, fit: &Fit) -> f64 {
        (0..2).map(|c| fit.scales[c].sqrt() / self.scatter[c]).fold(0.0, f64::max)
    }

    /// Flow of each leak at the trace's end and the pressures as they truly are, with the spread of pressure sensors.
    fn leaks_m3s(
        &self,
        equations: &NormalEquations,
        hypothesis: &Hypothesis<'_>,
        fit: &Fit,
        points: &[Vec<f64>],
    ) -> Vec<[f64; 3]> {
        let mut out = vec![[0.0; 3]; points.len()];
        let changed = hypothesis.last_change(self.segments);
        let (all_pa, pressures_pa) =
            (self.products.mean_pressures_pa(0), self.products.mean_pressures_pa(changed));
        for (leak, ends) in hypothesis.ends.iter().enumerate().filter(|(_, ends)| !ends.is_empty()) {
            let place = |(end, sign): &(usize, f64)| {
                Some((hypothesis.positive.iter().position(|one| one == end)?, *sign))
            };
            let places: Vec<(usize, f64)> = ends.iter().filter_map(place).collect();
            let flow = |point: &Vec<f64>| {
                places.iter().map(|(place, sign)| sign * point[*place]).sum::<f64>().max(0.0)
            };
            let pressure_pa = pressures_pa[Leak::ALL[leak]].max(1.0);
            let lately = pressure_pa / all_pa[Leak::ALL[leak]].max(1.0);
            let sheet = USUAL_PRESSURE * self.rig.instruments.pressure.full_scale / pressure_pa;
            let zero = self.pressure_zero_share(equations, hypothesis, fit, leak) / pressure_pa;
            // The mean size of a pressure of changing sign follows a zero by an unknown share.
            let spread = if leak == 0 { f64::hypot(sheet, zero) } else { sheet };
            for (index, (out, point)) in out.iter_mut().zip(points).enumerate() {
                let normal = normal_quantile(uniform((index * 197) % POINTS, 8 + leak));
                let doubt = self.doubts_m3s[Leak::ALL[leak]]
                    * normal_quantile(uniform((index * 59) % POINTS, 11 + leak));
                let pressure = lately * (1.0 + zero + spread * normal);
                out[leak] = (flow(point) * pressure * self.full_scale_m3s + doubt).max(0.0);
            }
        }
        out
    }

    /// By how much the pressure across a leak is larger than read, Pa, where an explanation has a zero of a pressure sensor.
    fn pressure_zero_share(
        &self,
        equations: &NormalEquations,
        hypothesis: &Hypothesis<'_>,
        fit: &Fit,
        leak: usize,
    ) -> f64 {
        let signs = match leak {
            0 => [-1.0, 1.0],
            1 => [-1.0, 0.0],
            _ => [0.0, -1.0],
        };
        let zeros = [Column::PressureZeroA, Column::PressureZeroB];
        let full_scale = self.rig.instruments.pressure.full_scale;
        zeros
            .iter()
            .zip(signs)
            .map(|(zero, sign)| {
                let place = equations.place(*zero, Course::Constant);
                let at = hypothesis.free.iter().position(|free| Some(free.column) == place);
                at.map_or(0.0, |at| sign * fit.means[at] * full_scale)
            })
            .sum()
    }
}

/// These leaks, steady, in this state.
fn find<'b, 'a>(all: &'b [Scored<'a>], state: State<'a>, subset: Subset) -> Option<&'b Scored<'a>> {
    let steady = subset.map(|there| there.then_some(LeakCourse::Constant));
    all.iter().find(|scored| scored.hypothesis.leaks == steady && scored.hypothesis.state == state)
}

/// The states of best evidence, each once, and as-declared with usual and slight zeros.
fn best_states<'a>(all: &mut [Scored<'a>]) -> Vec<State<'a>> {
    all.sort_by(|a, b| b.ln_posterior.total_cmp(&a.ln_posterior));
    let mut states: Vec<State<'a>> = Vec::new();
    for scored in all.iter() {
        if states.len() < STATES_WITH_COURSES && !states.contains(&scored.hypothesis.state) {
            states.push(scored.hypothesis.state);
        }
    }
    let plain = all.iter().map(|scored| scored.hypothesis.state).filter(|state| {
        state.wander.0 <= 0.0
            && state.departure.id == "as_declared"
            && ["zeros_usual", "flow_zeros"].contains(&state.zeros.id)
    });
    for state in plain {
        if !states.contains(&state) {
            states.push(state);
        }
    }
    states
}

/// Scatter of flows and of the position over the declared noise.
fn scatter(statistic: &Statistic, rig: &Rig) -> [f64; 2] {
    let sensors = rig.sensors();
    let found: [Option<f64>; CHANNELS] = statistic.scatter();
    let over = |found: Option<f64>, declared: f64| match found {
        Some(found) if declared > 0.0 => (found / declared).max(1.0),
        _ => 1.0,
    };
    [
        over(found[3], sensors.flow_a.noise_std).max(over(found[4], sensors.flow_b.noise_std)),
        over(found[0], sensors.position.noise_std),
    ]
}
