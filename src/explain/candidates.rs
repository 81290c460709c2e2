//! The explanations that are weighed: leaks of each course beside each state of the sensors, and mistakes of wiring.

use super::columns::{Column, Course};
use super::equations::NormalEquations;
use super::evidence::{Fit, LEAST_SCALE, at_scales, chance_of_mean_square, fit, ln_scale};
use super::hypothesis::{Hypothesis, LEAK_COLUMNS, LeakCourse, Sizes, State, Subset, subsets};
use super::mended::Mended;
use super::mistakes::ln_wired;
use super::orthant::ln_most;
use super::pass::Pass;
use super::table::{Entry, USUAL, USUAL_DEAD_VOLUME};
use pitchleak_core::Leak;

/// States of sensors and rig, best first, beside which other courses of leaks are tried; numerical.
const STATES_WITH_COURSES: usize = 3;
/// Gains and areas that are off by more are units.
const MOST_GAIN: f64 = 0.15;
/// Compressibility beyond the declared one, as its share: no oil is four times as stiff as its sheet says, and with six times its
/// compressibility it is foam. Chosen.
const COMPRESSIBILITY: std::ops::RangeInclusive<f64> = -0.75..=5.0;

/// Oil that is stored and is none, as its share: of noise, all. Chosen, with what chance adds.
const UNPRESSED: std::ops::RangeInclusive<f64> = -1.2..=0.0;

/// How each leak goes, as far as it is there.
type Leaks = [Option<LeakCourse>; 3];

/// An explanation and its evidence before leaks are cut at zero.
pub(super) struct Scored<'a> {
    pub hypothesis: Hypothesis<'a>,
    /// At the most: with `ln_sign`.
    pub ln_posterior: f64,
    /// At the most ln of the probability that no leak is negative.
    pub ln_sign: f64,
    ln_likelihood: f64,
    /// Noise scales s² of both equations.
    pub scales: [f64; 2],
    /// Among the equations of this mistake of wiring, or the declared.
    pub wiring: usize,
}

/// What is known of steady leaks beside a state, by which their other courses are asked or not.
struct Steady {
    scales: [f64; 2],
    /// By these scales.
    chi_square: f64,
    ln_likelihood: f64,
    /// ln of its prior and Occam's factor.
    ln_weight: f64,
}

/// Explanations as they are found.
pub(super) struct Candidates<'a, 'p> {
    pass: &'p Pass<'a, 'p>,
    /// Of the readings as declared.
    declared: &'p NormalEquations,
    all: Vec<Scored<'a>>,
    /// The largest ln posterior of them.
    best_ln: f64,
    /// What is less probable than the best by more, in ln, need not be found.
    least_ln: f64,
}

impl<'a, 'p> Candidates<'a, 'p> {
    /// Constant leaks with every state of the sensors; zeros that wander only beside the two likeliest zeros.
    pub fn with_constant_leaks(pass: &'p Pass<'a, 'p>, declared: &'p NormalEquations, least_ln: f64) -> Self {
        let mut own = Self { pass, declared, all: Vec::new(), best_ln: f64::NEG_INFINITY, least_ln };
        let knows_zeros = pass.sizes.zeros.iter().all(|zero| *zero > 0.0);
        for (rank, zeros) in pass.tables.zeros.iter().enumerate() {
            // Who declares zeros knows them: they fail, but are not slightly off.
            if knows_zeros && zeros.id == "flow_zeros" || zeros.jumps() {
                continue;
            }
            for (place, departure) in pass.departures().into_iter().enumerate() {
                for wander in &pass.tables.wanders {
                    if wander.0 > 0.0 && (rank > 1 || place > 1) {
                        continue;
                    }
                    own.add_constant_leaks(State { zeros, departure, wander: *wander, border: 0 });
                }
            }
        }
        own
    }

    fn add_constant_leaks(&mut self, state: State<'a>) {
        let own: Vec<Subset> = subsets().filter(|subset| self.pass.is_asked(state, *subset)).collect();
        self.add_subsets(&own, self.least(), |own, subset| own.with_steady(state, subset));
    }

    /// These sets of leaks, from the smallest to all, unless no leak can make one as probable as `least`.
    fn add_subsets(&mut self, own: &[Subset], least: f64, scored: impl Fn(&Self, Subset) -> Scored<'a>) {
        let [few, between @ ..] = own else { return };
        let few = scored(self, *few);
        let [between @ .., all] = between else { return self.keep(few) };
        let all = scored(self, *all);
        // No others' prior and Occam's factor are lighter than those of few, no likelihood is larger than that of all three.
        let most = few.ln_posterior - few.ln_sign - few.ln_likelihood + all.ln_likelihood;
        let hopeless = few.ln_posterior.is_finite() && most < least;
        self.keep(few);
        self.keep(all);
        if !hopeless {
            for subset in between {
                let one = scored(self, *subset);
                self.keep(one);
            }
        }
    }

    /// ln posterior below which none matters.
    fn least(&self) -> f64 {
        self.best_ln - self.least_ln
    }

    fn keep(&mut self, scored: Scored<'a>) {
        self.best_ln = self.best_ln.max(scored.ln_posterior);
        self.all.push(scored);
    }

    fn with_steady(&self, state: State<'a>, subset: Subset) -> Scored<'a> {
        let leaks = together(subset, LeakCourse::Constant);
        self.scored(self.hypothesis(state, leaks, self.ln_constant(subset)))
    }

    /// Steady leaks beside a state, asked for now where they did not matter before; none where the state has no such leaks.
    fn steady(&mut self, state: State<'a>, subset: Subset) -> Option<Steady> {
        if !self.pass.is_asked(state, subset) {
            return None;
        }
        let leaks = together(subset, LeakCourse::Constant);
        let is_it = |one: &Scored<'_>| one.hypothesis.leaks == leaks && one.hypothesis.state == state;
        let known = self.all.iter().position(is_it);
        let at = known.unwrap_or(self.all.len());
        if known.is_none() {
            let one = self.with_steady(state, subset);
            self.keep(one);
        }
        let Scored { hypothesis, ln_posterior, ln_sign, ln_likelihood, scales, .. } = self.all.get(at)?;
        Some(Steady {
            scales: *scales,
            chi_square: at_scales(self.declared, &hypothesis.free, *scales).0,
            ln_likelihood: *ln_likelihood,
            ln_weight: ln_posterior - ln_sign - ln_likelihood,
        })
    }

    /// Best first.
    pub fn best_first(mut self) -> Vec<Scored<'a>> {
        self.sort();
        self.all
    }

    fn sort(&mut self) {
        self.all.sort_by(|a, b| b.ln_posterior.total_cmp(&a.ln_posterior));
    }

    /// Prior of constant leaks.
    fn ln_constant(&self, subset: Subset) -> f64 {
        if subset == [false; 3] { 0.0 } else { self.pass.tables.ln_course(LeakCourse::Constant) }
    }

    fn scored(&self, hypothesis: Hypothesis<'a>) -> Scored<'a> {
        Scored::new(self.declared, self.pass, hypothesis)
    }

    fn hypothesis(&self, state: State<'a>, leaks: Leaks, ln_course: f64) -> Hypothesis<'a> {
        Hypothesis::new(self.declared, &self.pass.sizes, self.pass.segments, state, leaks, ln_course)
    }

    /// Keeps an explanation, unless by the noise of one with steady leaks it does not matter; its ln likelihood by that noise.
    fn ask(&mut self, steady: &Steady, state: State<'a>, leaks: Leaks, ln_course: f64) -> f64 {
        let hypothesis = self.hypothesis(state, leaks, ln_course);
        let (chi_square, ln_determinant) = at_scales(self.declared, &hypothesis.free, steady.scales);
        let ln_likelihood = steady.ln_likelihood + self.ln_gain(steady.chi_square - chi_square);
        if hypothesis.ln_prior + ln_likelihood - 0.5 * ln_determinant > self.least() {
            let scored = self.scored(hypothesis);
            self.keep(scored);
        }
        ln_likelihood
    }

    /// ln by which χ² that falls by so much raises the likelihood, once the noise scale has followed: −½ n ln(1 − Δ/n).
    fn ln_gain(&self, fall: f64) -> f64 {
        let rows = self.declared.rows.into_iter().filter(|rows| *rows > 0.0).fold(f64::INFINITY, f64::min);
        if fall < rows { -0.5 * rows * (1.0 - fall / rows).ln() } else { f64::INFINITY }
    }

    /// Other courses of the leaks, beside the best states, as far as they can matter.
    pub fn add_courses(&mut self) {
        self.sort();
        let tables = self.pass.tables;
        let courses = self.pass.courses();
        for state in best_states(&self.all) {
            for subset in subsets().skip(1) {
                let Some(steady) = self.steady(state, subset) else { continue };
                let can_crack = Leak::ALL
                    .into_iter()
                    .zip(subset)
                    .all(|(leak, there)| !there || self.pass.keeps_sign(leak));
                for (course, ln_course) in &courses {
                    if can_crack || *course != LeakCourse::Cracking {
                        self.ask(&steady, state, together(subset, *course), *ln_course);
                    }
                }
                // Leaks that wander or creep may do all that pairs do.
                let free = [LeakCourse::Wandering, LeakCourse::Creeping].map(|course| {
                    self.ask(&steady, state, together(subset, course), tables.ln_course(course))
                });
                let are_two = subset.iter().filter(|leak| **leak).count() == 2;
                if state.wander.0 <= 0.0 && are_two {
                    let most = steady.ln_weight + free[0].max(free[1]);
                    self.add_pairs(&steady, state, subset, &courses, most - self.ln_constant(subset));
                }
            }
        }
    }

    /// Two leaks each with a course of its own, where those can be as probable as the best; one that opens, wanders or creeps beside one
    /// that is steady: beside others it is a sudden one, or they do so together.
    fn add_pairs(
        &mut self,
        steady: &Steady,
        state: State<'a>,
        subset: Subset,
        courses: &[(LeakCourse, f64)],
        most: f64,
    ) {
        use LeakCourse::{Accelerating, Constant, Creeping, Growing, Opening, Sudden, Wandering};
        let mut courses = courses.to_vec();
        courses.retain(|(course, _)| matches!(course, Growing | Accelerating | Opening(_) | Sudden(_)));
        courses.extend([Constant, Wandering, Creeping].map(|own| (own, self.pass.tables.ln_course(own))));
        let places: Vec<usize> = (0..3).filter(|leak| subset[*leak]).collect();
        for (course, ln_one) in &courses {
            for (another, ln_other) in courses.iter().filter(|(another, _)| another != course) {
                let is_one_of_many = |own: &LeakCourse| matches!(own, Opening(_) | Wandering | Creeping);
                let is_told = !is_one_of_many(course) && !is_one_of_many(another)
                    || [course, another].contains(&&Constant);
                if is_told && most + ln_one + ln_other > self.least() {
                    let mut leaks = [None; 3];
                    (leaks[places[0]], leaks[places[1]]) = (Some(*course), Some(*another));
                    self.ask(steady, state, leaks, ln_one + ln_other);
                }
            }
        }
    }

    /// Leaks that do not follow the pressures as read, beside the best states, and those with usual zeros: a zero may stand for one.
    pub fn add_unfollowed(&mut self) {
        let Some(zeros) = self.pass.tables.zeros.first() else { return };
        self.sort();
        let mut states = best_states(&self.all);
        for at in 0..states.len() {
            let usual = State { zeros, ..states[at] };
            if !states.contains(&usual) {
                states.push(usual);
            }
        }
        for (state, subset) in
            states.into_iter().flat_map(|state| subsets().skip(1).map(move |own| (state, own)))
        {
            let Some(steady) = self.steady(state, subset) else { continue };
            let ln_course = self.pass.ln_unfollowed(self.declared, subset);
            for alone in [true, false] {
                self.ask(&steady, state, together(subset, LeakCourse::Unfollowed { alone }), ln_course);
            }
        }
    }

    /// Zeros that jump, and leaks that would look the same, beside constant leaks and the best states of the rest.
    pub fn add_jumps(&mut self) {
        let (borders, ln_border) = self.pass.borders();
        self.sort();
        let mut states = best_states(&self.all);
        states.retain(|state| state.wander.0 <= 0.0 && state.zeros.id == "zeros_usual");
        for (state, subset) in states.into_iter().flat_map(|state| subsets().map(move |own| (state, own))) {
            let Some(steady) = self.steady(state, subset) else { continue };
            let leaks = together(subset, LeakCourse::Constant);
            let ln_course = self.ln_constant(subset) + ln_border;
            for zeros in self.pass.tables.zeros.iter().filter(|zeros| zeros.jumps()) {
                for border in borders.clone() {
                    self.ask(&steady, State { zeros, border, ..state }, leaks, ln_course);
                }
            }
            let externals = [Leak::ExternalA, Leak::ExternalB].map(|leak| leak as usize);
            for leak in externals.into_iter().filter(|leak| !subset[*leak]) {
                for border in borders.clone() {
                    let mut leaks = leaks;
                    leaks[leak] = Some(LeakCourse::Burst(border));
                    self.ask(&steady, state, leaks, ln_course + self.pass.ln_burst());
                }
            }
        }
    }

    /// Mistakes of wiring, beside slightly wrong zeros and constant leaks; their equations.
    pub fn add_mistakes(&mut self) -> Vec<Mended> {
        let tables = self.pass.tables;
        let Some(state) = self.pass.slightly_off() else { return Vec::new() };
        let least = self.least();
        let whole = self.pass.products.whole();
        let columns = steady_columns();
        let ln_wired = ln_wired(&tables.mistakes);
        let mut kept = Vec::new();
        let mut most_gained = f64::NEG_INFINITY;
        let scatters = self.pass.over_sheet.all_scatter();
        for (entry, mistake, ln_told) in self.pass.mistakes() {
            let equations = self.pass.equations(&whole, Some(entry), &columns);
            let mended = Mended::new(equations, self.declared, mistake, scatters);
            let ln_share = entry.share.ln() - ln_wired + ln_told;
            let ln_prior = ln_share + mended.ln_measure;
            let begin = self.all.len();
            self.add_mistake(&mended, Mistaken { entry, state, ln_prior, wiring: kept.len() + 1 }, least);
            let own = self.all[begin..].iter().map(|one| one.ln_posterior - ln_share);
            most_gained = own.fold(most_gained, f64::max);
            kept.push(mended);
        }
        self.take_off_what_noise_gains(state, most_gained);
        kept
    }

    /// What steady leaks explain of the readings as declared speaks for no mistake: what the best of them gains beyond the rest, ln
    /// without their shares, it gains by noise, and the others with it.
    fn take_off_what_noise_gains(&mut self, state: State<'_>, most_gained: f64) {
        let steady = self.all.iter().filter(|one| one.is_steady_as_declared(state));
        let best = steady.max_by(|a, b| a.ln_posterior.total_cmp(&b.ln_posterior));
        let by_noise = best.map_or(0.0, |best| most_gained - best.ln_posterior - self.ln_unexplained(best));
        if by_noise > 0.0 && by_noise.is_finite() {
            let mistaken = self.all.iter_mut().filter(|one| one.wiring > 0);
            mistaken.for_each(|one| one.ln_posterior -= by_noise);
        }
    }

    /// ln of how much likelier a model would be that leaves no more than the readings scatter, and chance.
    fn ln_unexplained(&self, steady: &Scored<'_>) -> f64 {
        let ln_perfect = |c: usize| {
            let rows = self.declared.rows[c];
            let scale = self.declared.scatter(c).max(LEAST_SCALE) * (1.0 + chance_of_mean_square(rows));
            ln_scale(rows, scale) - 0.5 * rows
        };
        (ln_perfect(0) + ln_perfect(1) - steady.ln_likelihood).max(0.0) - steady.ln_sign
    }

    /// A mistake with each set of leaks, unless no leak can make it as probable as `least`.
    fn add_mistake(&mut self, mended: &Mended, mistaken: Mistaken<'a>, least: f64) {
        let Mistaken { entry, state, ln_prior, wiring } = mistaken;
        let own: Vec<Subset> = subsets().collect();
        self.add_subsets(&own, least, |own, subset| {
            let ln_prior = own.ln_constant(subset) + ln_prior;
            let (sizes, segments) = (&own.pass.sizes, own.pass.segments);
            let leaks = together(subset, LeakCourse::Constant);
            let mut hypothesis = Hypothesis::new(&mended.equations, sizes, segments, state, leaks, ln_prior);
            hypothesis.wiring = Some(entry);
            let mut scored = Scored::new(&mended.equations, own.pass, hypothesis);
            scored.wiring = wiring;
            scored
        });
    }
}

/// A mistake of wiring as it is weighed.
struct Mistaken<'a> {
    entry: &'a Entry,
    state: State<'a>,
    ln_prior: f64,
    wiring: usize,
}

impl<'a> Scored<'a> {
    fn new(equations: &NormalEquations, pass: &Pass<'_, '_>, hypothesis: Hypothesis<'a>) -> Self {
        let fit = fit(equations, &hypothesis.free);
        let ln_sign = ln_sign(&fit, &hypothesis.positive);
        let is_out = is_impossible(equations, &pass.sizes, &hypothesis, &fit.means)
            || !pass.leaks_as_found(&hypothesis, &fit.means)
            || tells_by_noise(equations, &hypothesis, &fit);
        let ln_posterior =
            if is_out { f64::NEG_INFINITY } else { fit.ln_evidence + hypothesis.ln_prior + ln_sign };
        let Fit { ln_likelihood, scales, .. } = fit;
        Self { hypothesis, ln_posterior, ln_sign, ln_likelihood, scales, wiring: 0 }
    }

    /// Whether leaks are constant, or none, beside this state of the readings as declared.
    fn is_steady_as_declared(&self, state: State<'_>) -> bool {
        self.wiring == 0
            && self.hypothesis.state == state
            && self.hypothesis.leaks.iter().flatten().all(|course| *course == LeakCourse::Constant)
    }
}

/// What the parameters that cannot be negative, and are, cost at the least.
pub(super) fn ln_sign(fit: &Fit, positive: &[usize]) -> f64 {
    let means: Vec<f64> = positive.iter().map(|&i| fit.means[i]).collect();
    if means.iter().all(|mean| *mean >= 0.0) { 0.0 } else { ln_most(&means, &fit.covariance(positive)) }
}

const GAINS: [Column; 8] = [
    Column::GainA,
    Column::GainB,
    Column::Gains,
    Column::AreaA,
    Column::AreaB,
    Column::PositionGain,
    Column::PressureGainA,
    Column::PressureGainB,
];

/// Whether what sensors and rig are said to be off by is sought where there is but noise.
fn tells_by_noise(equations: &NormalEquations, hypothesis: &Hypothesis<'_>, fit: &Fit) -> bool {
    let own = hypothesis.state.departure.free.iter();
    let mut places = own.filter_map(|(column, course, _)| hypothesis.place(equations, *column, *course));
    places.any(|at| fit.is_noise(equations, &hypothesis.free, at))
}

fn is_impossible(
    equations: &NormalEquations,
    sizes: &Sizes,
    hypothesis: &Hypothesis<'_>,
    means: &[f64],
) -> bool {
    let places = GAINS.map(|gain| equations.place(gain, Course::Constant));
    let compressibility = equations.place(Column::Compressibility, Course::Constant);
    let volumes =
        [Column::DeadVolumeA, Column::DeadVolumeB].map(|volume| equations.place(volume, Course::Constant));
    // A chamber holds what is swept; the stroke may be wrong as a gain may.
    let least = |place: Option<usize>| {
        let side = volumes.iter().position(|volume| *volume == place)?;
        Some(-sizes.dead_volumes[side] - MOST_GAIN)
    };
    let [unpressed, position_zero] =
        [Column::Unpressed, Column::PositionZero].map(|column| equations.place(column, Course::Constant));
    let [lowest, highest] = sizes.position_zero;
    hypothesis.free.iter().zip(means).any(|(free, mean)| {
        let place = Some(free.column);
        mean.abs() > MOST_GAIN && places.contains(&place)
            || place == unpressed && !UNPRESSED.contains(mean)
            || place == position_zero && !(lowest..=highest).contains(mean)
            || place == compressibility && !COMPRESSIBILITY.contains(mean)
            || free.std > USUAL_DEAD_VOLUME && least(place).is_some_and(|least| *mean < least)
    })
}

/// All that is free beside a mistake of wiring.
pub(super) fn steady_columns() -> Vec<(Column, Course)> {
    let usual = USUAL.iter().map(|(column, course, _)| (*column, *course));
    std::iter::once((Column::LeftSide, Course::Constant))
        .chain(usual.filter(|(_, course)| *course == Course::Constant))
        .chain(LEAK_COLUMNS.map(|leak| (leak, Course::Constant)))
        .collect()
}

/// These leaks on one course.
pub(super) fn together(subset: Subset, course: LeakCourse) -> Leaks {
    subset.map(|there| there.then_some(course))
}

/// The states of best evidence, each once, of explanations best first, and as-declared with usual and slight zeros.
fn best_states<'a>(all: &[Scored<'a>]) -> Vec<State<'a>> {
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
