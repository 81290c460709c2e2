//! Integrals along a trace, weighted by hats over two neighbouring blocks of samples.

use super::linearisation::Linearisation;
use super::terms::Term;
use crate::diagnose::data::{Motion, Series};
use crate::diagnose::equation::PerEquation;
use pitchleak_core::Signals;
use pitchleak_core::effects::EffectConstants;

/// What is integrated along a trace: over a step, up to a sample, over a block or a hat.
#[derive(Clone)]
pub(crate) struct Integrals {
    /// What the model leaves over, m³ and N·s.
    pub(crate) residual: PerEquation<f64>,
    /// What one unit of each term leaves over.
    pub(crate) columns: Vec<PerEquation<f64>>,
    pub(crate) time_s: f64,
    /// Time during which the direction of motion is unknown.
    pub(crate) unsure_s: f64,
    /// Time during which an equation's flow or force is missing.
    pub(crate) missing_s: PerEquation<f64>,
    /// Readings; what is missing counts as zero.
    pub(crate) signals: Signals<f64>,
}

impl Integrals {
    pub(crate) fn zero(terms: usize) -> Self {
        let none = PerEquation::default();
        Self {
            residual: none,
            columns: vec![none; terms],
            time_s: 0.0,
            unsure_s: 0.0,
            missing_s: none,
            signals: Signals::default(),
        }
    }

    /// Each number becomes `f` of itself and its partner in `other`.
    fn combine(&mut self, other: &Self, f: impl Fn(f64, f64) -> f64 + Copy) {
        self.residual = self.residual.zip(other.residual, f);
        for (own, other) in self.columns.iter_mut().zip(&other.columns) {
            *own = own.zip(*other, f);
        }
        self.time_s = f(self.time_s, other.time_s);
        self.unsure_s = f(self.unsure_s, other.unsure_s);
        self.missing_s = self.missing_s.zip(other.missing_s, f);
        self.signals = self.signals.zip(other.signals, f);
    }

    fn add(&mut self, more: &Self) {
        self.combine(more, |own, more| own + more);
    }
}

/// Running integrals and their means, block by block: the difference of two neighbouring means is the integrand
/// weighted by a hat over both blocks.
pub(crate) struct Hats {
    integral: Integrals,
    block: Integrals,
    previous: Option<Integrals>,
}

impl Hats {
    pub(crate) fn new(terms: usize) -> Self {
        Self { integral: Integrals::zero(terms), block: Integrals::zero(terms), previous: None }
    }

    pub(crate) fn add_step(&mut self, step: &Integrals) {
        self.integral.add(step);
    }

    pub(crate) fn end_sample(&mut self) {
        self.block.add(&self.integral);
    }

    /// Ends a block of `samples`; the hat over it and the block before, once there is one.
    pub(crate) fn end_block(&mut self, samples: usize) -> Option<Integrals> {
        let terms = self.block.columns.len();
        let mut mean = std::mem::replace(&mut self.block, Integrals::zero(terms));
        mean.combine(&Integrals::zero(terms), |sum, _| sum / samples as f64);
        let hat = self.previous.as_ref().map(|before| {
            let mut hat = mean.clone();
            hat.combine(before, |now, before| now - before);
            hat
        });
        self.previous = Some(mean);
        hat
    }
}

/// What is integrated: the model's residual and the terms' columns around a linearisation.
pub(crate) struct Integrand<'a> {
    pub(crate) at: &'a Linearisation,
    terms: Vec<ActiveTerm>,
}

/// A term whose column is built.
#[derive(Clone, Copy)]
pub(super) struct ActiveTerm {
    term: Term,
    in_force: bool,
    constants: EffectConstants<f64>,
}

impl ActiveTerm {
    pub(super) fn new(term: Term, constants: EffectConstants<f64>) -> Self {
        Self { term, in_force: term.in_force(), constants }
    }
}

/// One step of a trace, corrected for the sensor effects of a linearisation.
#[derive(Clone, Copy)]
pub(super) struct Step {
    dt_s: f64,
    /// As the chambers see it: speed from the position.
    seen: Signals<f64>,
    /// As friction feels it.
    felt: Signals<f64>,
}

impl Step {
    /// The step that ends at sample `number`, and its readings as they are.
    pub(super) fn ending_at(
        number: usize,
        series: &Series,
        motion: &Motion,
        at: &Linearisation,
    ) -> (Self, Signals<f64>) {
        let dt_s = series.t_s[number] - series.t_s[number - 1];
        let means = mean_signals(series, motion, number, dt_s);
        let felt = Signals { v_mps: means.felt_v_mps, ..means.reading };
        let (seen, felt) = (at.effects.correct(&means.reading), at.effects.correct(&felt));
        (Self { dt_s, seen, felt }, means.reading)
    }

    fn integral(&self, value: f64) -> f64 {
        let integral = value * self.dt_s;
        if integral.is_finite() { integral } else { 0.0 }
    }

    /// What one unit of a term leaves over, integrated.
    pub(super) fn column(&self, active: &ActiveTerm, at: &Linearisation) -> PerEquation<f64> {
        let ActiveTerm { term, in_force, constants } = active;
        let mut unit = PerEquation::from(at.unit_term(*term, &self.seen, constants));
        unit.force = if *in_force { at.unit_term(*term, &self.felt, constants).force_n } else { 0.0 };
        unit.map(|value| self.integral(value))
    }
}

impl<'a> Integrand<'a> {
    pub(crate) fn new(at: &'a Linearisation, terms: &[Term], constants: &[EffectConstants<f64>]) -> Self {
        let terms = terms.iter().zip(constants).map(|(term, constants)| ActiveTerm::new(*term, *constants));
        Self { at, terms: terms.collect() }
    }

    pub(crate) fn width(&self) -> usize {
        self.terms.len()
    }

    /// Integrals over the step that ends at sample `number`, into `out`.
    pub(crate) fn step(&self, series: &Series, motion: &Motion, number: usize, out: &mut Integrals) {
        let (step, reading) = Step::ending_at(number, series, motion, self.at);
        let Step { dt_s: dt, seen, felt } = step;
        let over_step = |value: f64| step.integral(value);
        let mut residual = PerEquation::from(self.at.residual(&seen));
        residual.force = self.at.residual(&felt).force_n;
        out.residual = residual.map(over_step);
        for (term, column) in self.terms.iter().zip(&mut out.columns) {
            *column = step.column(term, self.at);
        }
        let missing = |value: f64| if value.is_finite() { 0.0 } else { dt };
        let unsure = felt.v_mps.is_nan() || felt.v_mps.abs() < motion.least_sure_mps();
        out.time_s = dt;
        out.unsure_s = if unsure { dt } else { 0.0 };
        out.missing_s = PerEquation {
            chamber_a: missing(reading.qa_m3s),
            chamber_b: missing(reading.qb_m3s),
            force: missing(reading.force_n),
        };
        out.signals = reading.zip(Signals::default(), |value, _| over_step(value));
    }
}

/// Mean signals over a step.
struct Means {
    /// As the chambers see them: speed from the position.
    reading: Signals<f64>,
    /// Speed as friction feels it.
    felt_v_mps: f64,
}

fn mean_signals(series: &Series, motion: &Motion, at: usize, dt: f64) -> Means {
    let even = is_even(series, at, dt);
    let middle = |values: &[f64]| step_mean(values, at, even);
    let rate = |values: &[f64]| (values[at] - values[at - 1]) / dt;
    let reading = Signals {
        x_m: middle(&series.x_m),
        v_mps: rate(&series.x_m),
        a_mps2: rate(&motion.v_mps),
        pa_pa: middle(&series.pa_pa),
        pb_pa: middle(&series.pb_pa),
        dpa_pas: rate(&series.pa_pa),
        dpb_pas: rate(&series.pb_pa),
        d2pa_pas2: curvature(&series.pa_pa, at, dt, even),
        d2pb_pas2: curvature(&series.pb_pa, at, dt, even),
        qa_m3s: middle(&series.qa_m3s),
        qb_m3s: middle(&series.qb_m3s),
        dqa_m3s2: rate(&series.qa_m3s),
        dqb_m3s2: rate(&series.qb_m3s),
        force_n: middle(&series.force_n),
        temp_k: middle(&series.temp_k),
    };
    Means { reading, felt_v_mps: middle(&motion.v_mps) }
}

/// Mean over the step that ends at sample `at`, by the cubic through four samples where they stand evenly: the
/// trapezoid's error, (ω dt)²/12 of a wave, would pass for a sensor's gain.
fn step_mean(values: &[f64], at: usize, even: bool) -> f64 {
    let inner = values[at - 1] + values[at];
    let outer = if even { values[at - 2] + values[at + 1] } else { f64::NAN };
    if outer.is_finite() { (13.0 * inner - outer) / 24.0 } else { inner / 2.0 }
}

/// Second derivative in the middle of the step that ends at sample `at`; none where the steps are not even.
fn curvature(values: &[f64], at: usize, dt: f64, even: bool) -> f64 {
    if !even {
        return 0.0;
    }
    (values[at + 1] - values[at] - values[at - 1] + values[at - 2]) / (2.0 * dt * dt)
}

/// Whether the steps before and after are as long as this one.
fn is_even(series: &Series, at: usize, dt: f64) -> bool {
    let t = &series.t_s;
    let as_long = |step: f64| (step - dt).abs() < 0.1 * dt;
    at >= 2 && at + 1 < t.len() && as_long(t[at - 1] - t[at - 2]) && as_long(t[at + 1] - t[at])
}
