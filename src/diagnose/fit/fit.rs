//! The declared model and the effects found so far, fitted to all traces at once.
//!
//! Gauss–Newton on the generalised least-squares criterion: rows are rebuilt around the last estimate,
//! with sensor effects undone on the readings. Columns that carry the residual's own noise are corrected
//! for it (errors in variables: Söderström 2018, "Errors-in-Variables Methods in System Identification").

use super::motion::Motion;
use super::noise::{SharedNoise, Spread, Whitening};
use super::point::Point;
use super::regression::{self, FOLDS, Prepared, Prior, Regression, Score, Solution};
use super::rows::{Balance, Recipe, Row, Rows};
use super::series::Series;
use super::term::{self, Term};
use super::{Declared, Progress};
use pitchleak_core::effects::{EffectConstants, EffectKind};
use pitchleak_core::{Effect, Sensors, Signals};
use std::cell::RefCell;

/// Usual length of a block, s: short against the machine's motion, long against a sample.
const BLOCK_S: f64 = 0.1;
/// Rounds of Gauss–Newton from scratch, and after a small change.
const FIRST_ROUNDS: usize = 4;
const NEXT_ROUNDS: usize = 3;

/// Realisations of sensor noise whose mean products correct the columns that carry it.
const NOISE_DRAWS: u64 = 4;
/// Halvings of the interval that holds the equation error.
const BISECTIONS: usize = 16;
/// What is left counts as noise unless its variance is this many standard deviations too large.
const CHANCE_SIGMA: f64 = 3.7;
/// A term held at a value has this share of its own standard deviation as prior.
const HELD: f64 = 1e-4;

/// Place of 1/β among the terms.
const SOFTNESS: usize = 0;

/// A fit, and what it takes to fit again with one more effect.
pub(super) struct Fit<'a> {
    pub(super) traces: &'a [Series],
    pub(super) sensors: Sensors<f64>,
    pub(super) terms: Vec<Term>,
    pub(super) shapes: Vec<EffectConstants<f64>>,
    /// The constants that every effect starts from.
    pub(super) plain_shape: EffectConstants<f64>,
    pub(super) priors: Vec<Option<Prior>>,
    /// Terms that are fitted, those of the declared model first.
    pub(super) active: Vec<usize>,
    pub(super) point: Point,
    motions: Vec<Motion>,
    pub(super) rows: Rows,
    pub(super) regression: Regression,
    pub(super) solution: Solution,
    /// The same with 1/β free to leave its range: what candidates are scored against, since the right one
    /// takes it back.
    pub(super) scoring: Solution,
    /// Variance by balance of what the model cannot explain, m⁶/s² and N²: zero while what is left can be
    /// the sensors' noise.
    pub(super) equation_error: [f64; 3],
    /// The end of the oil's range at which 1/β is held, because the data would take it further.
    pub(super) held_softness: Option<f64>,
    whitening: Whitening,
    /// Whitened columns of other shapes at this point, as they were asked for.
    shaped: RefCell<Vec<Shaped>>,
}

/// A whitened column of a term with constants that are not its present ones.
struct Shaped {
    term: usize,
    shape: EffectConstants<f64>,
    white: Vec<f64>,
}

impl<'a> Fit<'a> {
    /// Best fit of the declared model.
    pub(super) fn declared(
        traces: &'a [Series],
        declared: &Declared,
        sensors: Sensors<f64>,
        shape: EffectConstants<f64>,
        progress: Progress<'_>,
    ) -> Self {
        let terms = term::all();
        let priors = terms.iter().map(|term| prior(*term, declared)).collect::<Vec<_>>();
        let is_declared = |i: &usize| term::DECLARED.contains(&terms[*i]) || priors[*i].is_some();
        let active = (0..terms.len()).filter(is_declared).collect();
        let point = Point::declared(declared);
        let shapes = vec![shape; terms.len()];
        let rows = Rows::empty(0);
        let equation_error = [0.0; 3];
        let whitening = Whitening::new(&rows, &Spread { point: &point, sensors: &sensors, equation_error });
        let regression = Regression::new(&rows, &whitening, &[]);
        let solution = regression.solve(&[], &priors);
        let scoring = regression.solve(&[], &priors);
        let mut fit = Self {
            traces,
            sensors,
            terms,
            shapes,
            plain_shape: shape,
            priors,
            active,
            point,
            motions: vec![],
            rows,
            regression,
            solution,
            scoring,
            equation_error,
            held_softness: None,
            whitening,
            shaped: RefCell::default(),
        };
        for _ in 0..FIRST_ROUNDS {
            progress();
            fit.round();
        }
        fit
    }

    /// Fits again after `active` or a shape has changed.
    pub(super) fn refit(&mut self, progress: Progress<'_>) {
        for _ in 0..NEXT_ROUNDS {
            progress();
            self.round();
        }
    }

    /// Moves the point to the last solution and solves around it.
    fn round(&mut self) {
        self.move_point();
        self.shaped.get_mut().clear();
        self.motions = motions(self.traces, &self.point, &self.sensors);
        let rows = Rows::build(self.traces, &self.motions, &self.recipe(&self.terms, &self.shapes));
        let equation_error = self.equation_error;
        let spread = Spread { point: &self.point, sensors: &self.sensors, equation_error };
        self.whitening = Whitening::new(&rows, &spread);
        self.regression = self.regress(&rows);
        self.scoring = self.regression.solve(&self.active, &self.increments());
        self.held_softness = self.softness_beyond_range();
        self.solution = self.regression.solve(&self.active, &self.held_increments());
        if self.is_incomplete() {
            let spread = self.regression.jackknife(&self.active, &self.held_increments());
            self.solution.std.iter_mut().zip(spread).for_each(|(std, wide)| *std = std.max(wide));
        }
        self.equation_error = self.updated_error(&rows);
        self.rows = rows;
    }

    /// The end of the oil's range beyond which the data alone would take 1/β.
    fn softness_beyond_range(&self) -> Option<f64> {
        let at = self.scoring.terms.iter().position(|term| *term == SOFTNESS)?;
        let value = self.point.value(Term::InverseBulk) + self.scoring.value[at];
        let (low, high) = self.point.softness;
        (!(low..=high).contains(&value)).then(|| value.clamp(low, high))
    }

    fn regress(&self, rows: &Rows) -> Regression {
        let spread =
            Spread { point: &self.point, sensors: &self.sensors, equation_error: self.equation_error };
        let draw = |number| SharedNoise::draw(rows, &spread, &self.terms, number);
        let shared: Vec<_> = (0..NOISE_DRAWS).map(draw).collect();
        Regression::new(rows, &self.whitening, &shared)
    }

    /// Gives a candidate's column another shape, at the same point.
    pub(super) fn reshape(&mut self, term: usize, shape: EffectConstants<f64>) {
        if self.shapes[term] == shape {
            return;
        }
        self.shapes[term] = shape;
        let (terms, shapes) = ([self.terms[term]], [shape]);
        let column = Rows::build(self.traces, &self.motions, &self.recipe(&terms, &shapes)).columns.pop();
        self.rows.columns[term] = column.unwrap_or_default();
        self.regression = self.regress(&self.rows);
    }

    /// Equation error with which what is left would be as large as the noise says: the variance
    /// component of an incomplete model, so that neither priors nor weak effects are overrun by it.
    fn updated_error(&self, rows: &Rows) -> [f64; 3] {
        let left = regression::leftover(rows, &self.solution);
        let count = |balance| self.regression.innovations(rows, &self.solution, balance).len().max(1) as f64;
        let counts = Balance::ALL.map(count);
        let levels = |equation_error: [f64; 3]| {
            let spread = Spread { point: &self.point, sensors: &self.sensors, equation_error };
            let white = Whitening::new(rows, &spread).whiten(&left);
            let mut squares = [0.0; 3];
            for (entry, e) in rows.entries.iter().zip(&white).filter(|(entry, _)| rows.counts(entry)) {
                squares[entry.balance.index()] += e * e;
            }
            Balance::ALL.map(|balance| squares[balance.index()] / counts[balance.index()])
        };
        let mut low = [0.0; 3];
        let mut high = Balance::ALL.map(|balance| {
            let pairs =
                rows.entries.iter().zip(&left).filter(|(e, _)| e.balance == balance && rows.counts(e));
            let spread = Spread { point: &self.point, sensors: &self.sensors, equation_error: [0.0; 3] };
            4.0 * pairs.map(|(e, v)| spread.as_white(&rows.rows[e.row], v * v)).sum::<f64>()
                / counts[balance.index()]
        });
        let sensors_only = levels([0.0; 3]);
        for balance in Balance::ALL.map(Balance::index) {
            let chance = CHANCE_SIGMA * (2.0 / counts[balance]).sqrt();
            if sensors_only[balance] <= 1.0 + chance {
                high[balance] = 0.0;
            }
        }
        if high.iter().all(|error| *error <= 0.0) {
            return high;
        }
        for _ in 0..BISECTIONS {
            let middle: [f64; 3] = std::array::from_fn(|i| (low[i] + high[i]) / 2.0);
            for (i, level) in levels(middle).into_iter().enumerate() {
                if level > 1.0 { low[i] = middle[i] } else { high[i] = middle[i] }
            }
        }
        high
    }

    /// Whether more is left than the sensors' noise.
    pub(super) fn is_incomplete(&self) -> bool {
        self.equation_error.iter().any(|error| *error > 0.0)
    }

    /// Size of what is left in a balance as a multiple of the noise that the sensors bring.
    pub(super) fn excess(&self, balance: Balance) -> f64 {
        let of = |equation_error| {
            let spread = Spread { point: &self.point, sensors: &self.sensors, equation_error };
            let entry = self.rows.entries.iter().find(|entry| entry.balance == balance);
            entry.map_or(1.0, |entry| spread.white_variance(&self.rows.rows[entry.row], balance))
        };
        (of(self.equation_error) / of([0.0; 3])).sqrt()
    }

    /// Power of what is left beyond the sensors' noise, as a multiple of that, over the balances.
    pub(super) fn excess_power(&self) -> f64 {
        Balance::ALL.map(|balance| self.excess(balance).powi(2) - 1.0).iter().sum()
    }

    fn move_point(&mut self) {
        let found: Vec<(usize, f64)> =
            self.solution.terms.iter().copied().zip(self.solution.value.iter().copied()).collect();
        for (term, increment) in found {
            let value = self.point.value(self.terms[term]) + increment;
            self.point.set(self.terms[term], value, &self.shapes[term]);
        }
    }

    pub(super) fn recipe<'b>(&'b self, terms: &'b [Term], shapes: &'b [EffectConstants<f64>]) -> Recipe<'b> {
        Recipe { point: &self.point, terms, shapes, block_s: BLOCK_S }
    }

    /// The priors as increments from the point.
    pub(super) fn increments(&self) -> Vec<Option<Prior>> {
        let at = |(prior, term): (&Option<Prior>, &Term)| {
            prior.map(|prior| Prior { mean: prior.mean - self.point.value(*term), ..prior })
        };
        self.priors.iter().zip(&self.terms).map(at).collect()
    }

    /// The same with 1/β held where it would leave its range.
    fn held_increments(&self) -> Vec<Option<Prior>> {
        let mut increments = self.increments();
        if let Some(held) = self.held_softness {
            let mean = held - self.point.value(Term::InverseBulk);
            increments[SOFTNESS] = Some(Prior { mean, std: HELD * held });
        }
        increments
    }

    /// Value and standard deviation of a fitted term.
    pub(super) fn estimate(&self, term: usize) -> Option<(f64, f64)> {
        let at = self.solution.terms.iter().position(|t| *t == term)?;
        Some((self.point.value(self.terms[term]) + self.solution.value[at], self.solution.std[at]))
    }

    /// How much larger the remainder is than the declared noise: 1 for a model that is complete.
    pub(super) fn dispersion(&self, chi2: f64) -> f64 {
        (chi2 / self.regression.count().max(1) as f64).max(1.0)
    }

    /// What one further term would bring to a model; none where it can't be or would be unphysical.
    pub(super) fn score(&self, model: &Solution, term: usize) -> Option<Score> {
        let score = self.regression.score(model, term)?;
        self.allowed(&score).then_some(score)
    }

    /// The same for another shape of the term's effect.
    pub(super) fn score_shape(
        &self,
        model: &Solution,
        term: usize,
        shape: EffectConstants<f64>,
    ) -> Option<Score> {
        let score = self.regression.score_column(model, term, &self.prepare(model, term, shape)?)?;
        self.allowed(&score).then_some(score)
    }

    /// Fall of the sum of squares by a term that is not among the candidates.
    pub(super) fn gain_of(&self, term: Term, shape: EffectConstants<f64>) -> Option<f64> {
        let column = self.regression.prepare(&self.scoring, &self.white_column(term, shape))?;
        Some(self.regression.gain(&self.scoring, &column))
    }

    /// The column of a term with this shape, with what a model's terms explain of it.
    pub(super) fn prepare(
        &self,
        model: &Solution,
        term: usize,
        shape: EffectConstants<f64>,
    ) -> Option<Prepared> {
        let known = |one: &&Shaped| one.term == term && one.shape == shape;
        if let Some(one) = self.shaped.borrow().iter().find(known) {
            return self.regression.prepare(model, &one.white);
        }
        let white = self.white_column(self.terms[term], shape);
        let prepared = self.regression.prepare(model, &white);
        self.shaped.borrow_mut().push(Shaped { term, shape, white });
        prepared
    }

    fn white_column(&self, term: Term, shape: EffectConstants<f64>) -> Vec<f64> {
        let (terms, shapes) = ([term], [shape]);
        let rows = Rows::build(self.traces, &self.motions, &self.recipe(&terms, &shapes));
        rows.columns.first().map(|column| self.whitening.whiten(column)).unwrap_or_default()
    }

    pub(super) fn allowed(&self, score: &Score) -> bool {
        let (lower, upper) = self.terms[score.term].bounds();
        (lower..=upper).contains(&score.value)
    }

    /// The fit with some effects held at zero: no new pass over the data.
    pub(super) fn solve_without(&self, terms: &[usize]) -> Solution {
        let mut priors = self.increments();
        for term in terms {
            let mean = -self.point.value(self.terms[*term]);
            priors[*term] = self.estimate(*term).map(|(_, std)| Prior { mean, std: HELD * std });
        }
        self.regression.solve(&self.active, &priors)
    }

    /// Takes an effect out for a while: the noise stays that of the fit with it.
    pub(super) fn set_aside(&mut self, term: usize, progress: Progress<'_>) {
        let equation_error = self.equation_error;
        self.remove(term);
        progress();
        self.round();
        self.equation_error = equation_error;
    }

    /// Takes an effect out again.
    pub(super) fn remove(&mut self, term: usize) {
        self.active.retain(|t| *t != term);
        let at = self.solution.terms.iter().position(|t| *t == term);
        if let Some(at) = at {
            self.solution.value[at] = -self.point.value(self.terms[term]);
        }
    }

    /// What is left of each entry when its fold is not fitted, in the balance's unit.
    pub(super) fn held_out_leftover(&self) -> Vec<f64> {
        let priors = self.held_increments();
        let mut left = vec![0.0; self.rows.y.len()];
        for fold in 0..FOLDS {
            let solution = self.regression.solve_without(fold, &self.active, &priors);
            for (i, value) in regression::leftover(&self.rows, &solution).into_iter().enumerate() {
                if self.regression.fold_of(i) == fold {
                    left[i] = value;
                }
            }
        }
        self.in_units(&self.rows, left)
    }

    /// What is left of traces that were not fitted.
    pub(super) fn judge(&self, traces: &[Series]) -> (Rows, Vec<f64>) {
        let point = self.solved_point();
        let recipe = Recipe { point: &point, terms: &[], shapes: &[], block_s: BLOCK_S };
        let rows = Rows::build(traces, &motions(traces, &point, &self.sensors), &recipe);
        let left = rows.y.clone();
        let left = self.in_units(&rows, left);
        (rows, left)
    }

    /// What leaves each chamber along `traces`, in hats over blocks of `block_s`: balance, hat, flow and standard
    /// deviation of its noise, m³/s. The model without its leaks leaves that over.
    pub(super) fn leak_flows(&self, traces: &[Series], block_s: f64) -> Vec<(Balance, Row, f64, f64)> {
        let mut point = self.solved_point();
        for (term, shape) in self.terms.iter().zip(&self.shapes) {
            if term.is_leak() && point.value(*term).abs() > 0.0 {
                point.set(*term, 0.0, shape);
            }
        }
        let recipe = Recipe { point: &point, terms: &[], shapes: &[], block_s };
        let rows = Rows::build(traces, &motions(traces, &point, &self.sensors), &recipe);
        let solved = self.solved_point();
        let spread = Spread { point: &solved, sensors: &self.sensors, equation_error: [0.0; 3] };
        let entries = rows.entries.iter().zip(&rows.y).filter(|(entry, _)| entry.balance != Balance::Force);
        entries
            .map(|(entry, left)| {
                let row = rows.rows[entry.row];
                let std = spread.mean_flow_std(&row, entry.balance);
                (entry.balance, row, left / row.block_s, std)
            })
            .collect()
    }

    /// Σ factor × value over `terms`, and its standard deviation by the jackknife, which holds their correlation.
    pub(super) fn sum(&self, terms: &[(Term, f64)]) -> (f64, f64) {
        let of = |solution: &Solution| {
            let one = |(term, factor): &(Term, f64)| {
                let own = |at: &usize| self.terms[*at] == *term;
                let at = solution.terms.iter().position(own);
                factor * (self.point.value(*term) + at.map_or(0.0, |at| solution.value[at]))
            };
            terms.iter().map(one).sum::<f64>()
        };
        let pieces = self.regression.leave_one_out(&self.active, &self.held_increments());
        (of(&self.solution), regression::jackknife_std(pieces.iter().map(of)))
    }

    /// Flow out of a chamber by the leak effects that are fitted, m³/s.
    pub(super) fn effect_leak(&self, at: &Signals<f64>, balance: Balance) -> f64 {
        let point = self.solved_point();
        let leaks = point.effects.terms(at, &point.model, EffectKind::is_leak);
        if balance == Balance::ChamberA { leaks.chamber_a_m3s } else { leaks.chamber_b_m3s }
    }

    /// The point moved to the solution.
    fn solved_point(&self) -> Point {
        let mut point = self.point.clone();
        for (term, increment) in self.solution.terms.iter().zip(&self.solution.value) {
            let value = point.value(self.terms[*term]) + increment;
            point.set(self.terms[*term], value, &self.shapes[*term]);
        }
        point
    }

    /// From integrals over a hat to averages. While the piston stands, dry friction is whatever
    /// balances the forces up to its own size: only what is beyond counts.
    fn in_units(&self, rows: &Rows, mut left: Vec<f64>) -> Vec<f64> {
        let coulomb = self.terms.iter().position(|t| *t == Term::Effect(Effect::CoulombFriction));
        let friction = coulomb.and_then(|term| self.estimate(term)).map_or(0.0, |(value, _)| value.max(0.0));
        for (cell, entry) in left.iter_mut().zip(&rows.entries) {
            let row = &rows.rows[entry.row];
            *cell /= row.block_s;
            if entry.balance == Balance::Force {
                let free = (cell.abs() - friction * row.stuck).max(0.0);
                *cell = cell.signum() * free;
            }
        }
        left
    }
}

fn motions(traces: &[Series], point: &Point, sensors: &Sensors<f64>) -> Vec<Motion> {
    traces.iter().map(|series| Motion::of(series, &point.model, sensors)).collect()
}

fn prior(term: Term, declared: &Declared) -> Option<Prior> {
    match term {
        Term::InverseBulk => {
            let bulk = declared.fluid.bulk_modulus_pa;
            let share = (declared.fluid.bulk_modulus_std_pa / bulk).max(1e-6);
            Some(Prior { mean: 1.0 / bulk, std: share / bulk })
        }
        Term::Effect(effect) => effect.prior_std(&declared.sensors).map(|std| Prior { mean: 0.0, std }),
        _ => None,
    }
}
