//! Integrals along a trace, weighted by test functions: hats over two neighbouring blocks of samples. Of all columns at once, or of
//! single terms at one linearisation: the search for an effect's constants tries many, and each costs the term alone, because the
//! corrected signals are kept.

use super::linearisation::{Linearisation, as_felt};
use super::terms::{Balances, Columns, Term};
use crate::diagnose::data::{Motion, Series};
use crate::diagnose::equation::PerEquation;
use crate::diagnose::thresholds::{EVEN_SHARE, LEAST_STEP_S, LONG_STEP};
use pitchleak_core::Signals;
use pitchleak_core::effects::EffectConstants;

/// What is integrated along a trace: over a step, up to a sample, over a block or a test function.
#[derive(Clone)]
pub(crate) struct Integrals {
    /// The residual, m³ and N·s.
    pub(crate) residual: PerEquation<f64>,
    /// One unit of each term in the residual.
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
/// weighted by a test function over both blocks.
pub(crate) struct TestFunctions {
    integral: Integrals,
    block: Integrals,
    previous: Option<Integrals>,
}

impl TestFunctions {
    pub(crate) fn new(terms: usize) -> Self {
        Self { integral: Integrals::zero(terms), block: Integrals::zero(terms), previous: None }
    }

    pub(crate) fn add_step(&mut self, step: &Integrals) {
        self.integral.add(step);
    }

    pub(crate) fn end_sample(&mut self) {
        self.block.add(&self.integral);
    }

    /// Ends a block of `samples`; the test function over it and the block before, once there is one.
    pub(crate) fn end_block(&mut self, samples: usize) -> Option<Integrals> {
        let terms = self.block.columns.len();
        let mut mean = std::mem::replace(&mut self.block, Integrals::zero(terms));
        mean.combine(&Integrals::zero(terms), |sum, _| sum / samples as f64);
        let weighted = self.previous.as_ref().map(|before| {
            let mut weighted = mean.clone();
            weighted.combine(before, |now, before| now - before);
            weighted
        });
        self.previous = Some(mean);
        weighted
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
    balances: Balances,
    constants: EffectConstants<f64>,
}

impl ActiveTerm {
    pub(super) fn new(term: Term, constants: EffectConstants<f64>) -> Self {
        Self { term, balances: term.balances(), constants }
    }
}

/// An instant corrected for the sensor effects of a linearisation.
#[derive(Clone, Copy)]
struct Instant {
    /// As the chambers see it: speed from the position.
    seen: Signals<f64>,
    /// As friction feels it.
    felt: Signals<f64>,
}

/// One step of a trace.
pub(super) struct Step {
    dt_s: f64,
    first: Instant,
    /// Long steps have two, which count alike.
    second: Option<Box<Instant>>,
}

impl Step {
    /// The step that ends at sample `number`, and its means as they are read.
    pub(super) fn ending_at(
        number: usize,
        series: &Series,
        motion: &Motion,
        at: &Linearisation,
    ) -> (Self, Means) {
        let dt_s = series.t_s[number] - series.t_s[number - 1];
        let means = mean_signals(series, motion, number, dt_s);
        let instant = |share: f64| {
            let (reading, felt) = means.at(share * dt_s);
            let seen = at.effects.correct(&reading);
            Instant { seen, felt: as_felt(&seen, &felt) }
        };
        let is_long = dt_s > LONG_STEP * LEAST_STEP_S;
        let first = instant(if is_long { -GAUSS } else { 0.0 });
        (Self { dt_s, first, second: is_long.then(|| Box::new(instant(GAUSS))) }, means)
    }

    /// Over the step; what is not a number is nothing.
    fn integral(&self, value: impl Fn(&Signals<f64>, &Signals<f64>) -> PerEquation<f64>) -> PerEquation<f64> {
        let of = |instant: &Instant| value(&instant.seen, &instant.felt);
        let first = of(&self.first);
        let mean = self.second.as_ref().map_or(first, |second| first.zip(of(second), |a, b| (a + b) / 2.0));
        mean.map(|value| if (value * self.dt_s).is_finite() { value * self.dt_s } else { 0.0 })
    }

    /// One unit of a term in the residual, integrated.
    pub(super) fn column(&self, active: &ActiveTerm, at: &Linearisation) -> PerEquation<f64> {
        let ActiveTerm { term, balances, constants } = active;
        self.integral(|seen, felt| at.both_unit_terms((*term, *balances), constants, seen, felt))
    }
}

impl<'a> Integrand<'a> {
    pub(crate) fn new(at: &'a Linearisation, terms: &[Term], constants: &[EffectConstants<f64>]) -> Self {
        let terms = terms.iter().zip(constants).map(|(term, constants)| ActiveTerm::new(*term, *constants));
        Self { at, terms: terms.collect() }
    }

    /// Of the columns that are built.
    pub(super) fn of(at: &'a Linearisation, columns: Columns<'_>) -> Self {
        let Columns { terms, constants, places } = columns;
        let terms = places.iter().map(|place| ActiveTerm::new(terms[*place], constants[*place]));
        Self { at, terms: terms.collect() }
    }

    pub(crate) fn width(&self) -> usize {
        self.terms.len()
    }

    /// Integrals over the step that ends at sample `number`, into `out`.
    pub(crate) fn step(&self, series: &Series, motion: &Motion, number: usize, out: &mut Integrals) {
        let (step, means) = Step::ending_at(number, series, motion, self.at);
        let (dt, reading) = (step.dt_s, means.reading);
        out.residual = step.integral(|seen, felt| self.at.residual_of(seen, felt));
        for (term, column) in self.terms.iter().zip(&mut out.columns) {
            *column = step.column(term, self.at);
        }
        let missing = |value: f64| if value.is_finite() { 0.0 } else { dt };
        out.time_s = dt;
        out.unsure_s = if motion.is_sure(means.felt_v_mps, reading.a_mps2) { 0.0 } else { dt };
        out.missing_s = PerEquation {
            chamber_a: missing(reading.qa_m3s),
            chamber_b: missing(reading.qb_m3s),
            force: missing(reading.force_n),
        };
        let over_step = |value: f64| if (value * dt).is_finite() { value * dt } else { 0.0 };
        out.signals = reading.zip(Signals::default(), |value, _| over_step(value));
    }
}

/// Mean signals over a step.
pub(super) struct Means {
    /// As the chambers see them: speed from the position.
    reading: Signals<f64>,
    /// Change of its speed.
    x_curvature_mps2: f64,
    /// Speed as friction feels it.
    felt_v_mps: f64,
}

/// Products are taken in the middle of a step, or where steps are long at the two points of Gauss and Legendre, as shares of the step
/// from its middle, since the mean of a product is not the product of means.
const GAUSS: f64 = 0.288_675_134_594_812_9;

impl Means {
    /// The instant `after_s` the middle of the step: what the chambers see, and with the motion that forces feel.
    fn at(&self, after_s: f64) -> (Signals<f64>, Signals<f64>) {
        let mean = &self.reading;
        let moved = |value: f64, rate: f64| value + rate * after_s;
        let reading = Signals {
            x_m: moved(mean.x_m, mean.v_mps),
            v_mps: moved(mean.v_mps, self.x_curvature_mps2),
            pa_pa: moved(mean.pa_pa, mean.dpa_pas),
            pb_pa: moved(mean.pb_pa, mean.dpb_pas),
            dpa_pas: moved(mean.dpa_pas, mean.d2pa_pas2),
            dpb_pas: moved(mean.dpb_pas, mean.d2pb_pas2),
            pa_side: moved(mean.pa_side, mean.dpa_side_ps),
            pb_side: moved(mean.pb_side, mean.dpb_side_ps),
            x_side: moved(mean.x_side, mean.dx_side_ps),
            qa_m3s: moved(mean.qa_m3s, mean.dqa_m3s2),
            qb_m3s: moved(mean.qb_m3s, mean.dqb_m3s2),
            ..*mean
        };
        (reading, Signals { v_mps: moved(self.felt_v_mps, mean.a_mps2), ..reading })
    }
}

fn mean_signals(series: &Series, motion: &Motion, at: usize, dt: f64) -> Means {
    let even = Even::about(series, at, dt);
    let middle = |values: &[f64]| step_mean(values, at, even);
    let half_way = |values: &[f64]| (values[at] + values[at - 1]) / 2.0;
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
        pa_side: half_way(&motion.pa.side),
        pb_side: half_way(&motion.pb.side),
        dpa_side_ps: rate(&motion.pa.side),
        dpb_side_ps: rate(&motion.pb.side),
        x_side: half_way(&motion.x.side),
        dx_side_ps: rate(&motion.x.side),
        // As the readings beside which they stand: what both jump by at the band's edge cancels.
        qa_unread: middle(&motion.qa.side),
        qb_unread: middle(&motion.qb.side),
        qa_m3s: middle(&series.qa_m3s),
        qb_m3s: middle(&series.qb_m3s),
        dqa_m3s2: rate(&series.qa_m3s),
        dqb_m3s2: rate(&series.qb_m3s),
        force_n: middle(&series.force_n),
        temp_k: middle(&series.temp_k),
        t_s: series.t_s[at] - dt / 2.0,
    };
    Means {
        reading,
        x_curvature_mps2: curvature(&series.x_m, at, dt, even),
        felt_v_mps: middle(&motion.v_mps),
    }
}

/// Weights of the quintic through six even samples for its mean over the middle step, by their distance from it, in units of
/// 1/[`QUINTIC_UNIT`]. Derived: exact for polynomials of fifth degree.
pub(super) const QUINTIC: [f64; 3] = [802.0, -93.0, 11.0];
/// See [`QUINTIC`].
pub(super) const QUINTIC_UNIT: f64 = 1440.0;

/// Mean over the step that ends at sample `at`, by the quintic through six samples where they stand evenly, else the cubic through
/// four: the trapezoid's error, (ω dt)²/12 of a wave, would pass for a sensor's gain, and at 20 Hz the cubic's,
/// 11 (ω dt)⁴/720, for gas in a port.
fn step_mean(values: &[f64], at: usize, even: Even) -> f64 {
    let pair = |reach: usize| values[at - 1 - reach] + values[at + reach];
    let inner = pair(0);
    let cubic = |next: f64| (13.0 * inner - next) / 24.0;
    let [first, second, third] = QUINTIC;
    let quintic = || (first * inner + second * pair(1) + third * pair(2)) / QUINTIC_UNIT;
    let six = if even >= Even::Six { quintic() } else { f64::NAN };
    let four = if even >= Even::Four { cubic(pair(1)) } else { f64::NAN };
    [six, four].into_iter().find(|mean| mean.is_finite()).unwrap_or(inner / 2.0)
}

/// Second derivative in the middle of the step that ends at sample `at`; none where the steps are not even.
fn curvature(values: &[f64], at: usize, dt: f64, even: Even) -> f64 {
    if even < Even::Four {
        return 0.0;
    }
    (values[at + 1] - values[at] - values[at - 1] + values[at - 2]) / (2.0 * dt * dt)
}

/// How many samples about a step stand evenly.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Even {
    Two,
    Four,
    Six,
}

impl Even {
    fn about(series: &Series, at: usize, dt: f64) -> Self {
        let t = &series.t_s;
        let as_long = |step: f64| (step - dt).abs() < EVEN_SHARE * dt;
        let is_even = |reach: usize| {
            at > reach
                && at + reach < t.len()
                && as_long(t[at - reach] - t[at - reach - 1])
                && as_long(t[at + reach] - t[at + reach - 1])
        };
        match (is_even(1), is_even(2)) {
            (true, true) => Self::Six,
            (true, false) => Self::Four,
            _ => Self::Two,
        }
    }
}
