//! The weak form: each equation of the cylinder integrated against hat functions.
//!
//! For blocks of m samples, the difference of two neighbouring block means of any running integral
//! is that integrand weighted by a hat over both blocks. So ∫ hat·ẋ dt is x̄_{k+1} − x̄_k, the difference
//! of two averages: no signal is differentiated, and the noise of a row is known exactly (`noise.rs`).
//! Weak forms for identification: Messenger and Bortz (2021), "Weak SINDy", Multiscale Model. Simul. 19.

use super::motion::Motion;
use super::point::Point;
use super::series::Series;
use super::term::Term;
use pitchleak_core::Signals;
use pitchleak_core::effects::EffectConstants;
use rayon::prelude::*;
use std::ops::Range;

/// One of the three equations.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Balance {
    /// Continuity of chamber A.
    ChamberA,
    /// Continuity of chamber B.
    ChamberB,
    /// Forces on the piston.
    Force,
}

impl Balance {
    pub(super) const ALL: [Self; 3] = [Self::ChamberA, Self::ChamberB, Self::Force];

    pub(super) fn index(self) -> usize {
        self as usize
    }
}

/// Two neighbouring blocks of samples.
#[derive(Clone, Copy, Debug)]
pub(super) struct Row {
    /// Consecutive rows with the same number share a block.
    pub(super) stretch: usize,
    /// Time at the hat's peak, s.
    pub(super) t_s: f64,
    /// Length of a block, s, and its samples.
    pub(super) block_s: f64,
    pub(super) samples: usize,
    /// Averages over both blocks.
    pub(super) mean: Signals<f64>,
    /// Share of the hat during which the direction of motion is unknown.
    pub(super) stuck: f64,
}

/// One equation of one row: an entry of the regression.
#[derive(Clone, Copy, Debug)]
pub(super) struct Entry {
    pub(super) row: usize,
    pub(super) balance: Balance,
}

/// All traces as one regression y = Σ θ column + noise, in m³ (chambers) and N·s (force).
pub(super) struct Rows {
    pub(super) rows: Vec<Row>,
    pub(super) entries: Vec<Entry>,
    /// What the model at the point leaves over.
    pub(super) y: Vec<f64>,
    /// One column per term.
    pub(super) columns: Vec<Vec<f64>>,
}

/// What the rows are computed with.
pub(super) struct Recipe<'a> {
    pub(super) point: &'a Point,
    pub(super) terms: &'a [Term],
    pub(super) shapes: &'a [EffectConstants<f64>],
    /// Length of a block, s.
    pub(super) block_s: f64,
}

/// Running integrals of `width` numbers, block by block.
struct Hats {
    integral: Vec<f64>,
    block: Vec<f64>,
    previous: Option<Vec<f64>>,
}

impl Hats {
    fn new(width: usize) -> Self {
        Self { integral: vec![0.0; width], block: vec![0.0; width], previous: None }
    }

    fn add_step(&mut self, increments: &[f64]) {
        for (integral, increment) in self.integral.iter_mut().zip(increments) {
            *integral += increment;
        }
    }

    fn end_sample(&mut self) {
        for (block, integral) in self.block.iter_mut().zip(&self.integral) {
            *block += integral;
        }
    }

    /// Ends a block of `samples`; the hat over it and the block before, once there is one.
    fn end_block(&mut self, samples: usize) -> Option<Vec<f64>> {
        let mean: Vec<f64> = self.block.iter().map(|sum| sum / samples as f64).collect();
        self.block.fill(0.0);
        let hat = self.previous.as_ref().map(|before| mean.iter().zip(before).map(|(a, b)| a - b).collect());
        self.previous = Some(mean);
        hat
    }
}

/// Numbers that are integrated beside y and the columns: time, stuck time, what is missing, means.
const EXTRA: usize = 13;
/// Numbers set aside for the stretches of one trace.
const MOST_STRETCHES: usize = 1 << 32;
/// A share of a hat that is rounding, not time.
const SLIVER: f64 = 1e-6;

impl Rows {
    /// The rows of all traces, in their order; `motions` has one entry per trace. Traces are shared out
    /// over the cores; the result does not depend on how many there are.
    pub(super) fn build(traces: &[Series], motions: &[Motion], recipe: &Recipe<'_>) -> Self {
        let of_trace = |(number, (series, motion))| Self::of_trace(number, series, motion, recipe);
        let parts: Vec<Self> = traces.par_iter().zip(motions).enumerate().map(of_trace).collect();
        let mut all = Self::empty(recipe.terms.len());
        parts.into_iter().for_each(|part| all.append(part));
        all
    }

    /// No row, but a place for each term's column.
    pub(super) fn empty(terms: usize) -> Self {
        Self { rows: vec![], entries: vec![], y: vec![], columns: vec![vec![]; terms] }
    }

    fn of_trace(number: usize, series: &Series, motion: &Motion, recipe: &Recipe<'_>) -> Self {
        let mut rows = Self::empty(recipe.terms.len());
        let samples = ((recipe.block_s / series.step_s().max(1e-9)).round() as usize).max(1);
        for (stretch, range) in series.stretches().into_iter().enumerate() {
            let stretch = number * MOST_STRETCHES + stretch;
            rows.add_stretch(series, motion, range, (stretch, samples), recipe);
        }
        rows
    }

    fn append(&mut self, part: Self) {
        let first = self.rows.len();
        self.rows.extend(part.rows);
        self.entries.extend(part.entries.into_iter().map(|entry| Entry { row: first + entry.row, ..entry }));
        self.y.extend(part.y);
        for (column, more) in self.columns.iter_mut().zip(part.columns) {
            column.extend(more);
        }
    }

    fn add_stretch(
        &mut self,
        series: &Series,
        motion: &Motion,
        range: Range<usize>,
        (stretch, samples): (usize, usize),
        recipe: &Recipe<'_>,
    ) {
        let width = 3 * (1 + recipe.terms.len());
        let mut hats = Hats::new(width + EXTRA);
        let mut increments = vec![0.0; width + EXTRA];
        let mut in_block = 0;
        let mut run = usize::MAX;
        for at in range.clone() {
            if at > range.start {
                step(series, motion, at, recipe, &mut increments);
                hats.add_step(&increments);
            }
            hats.end_sample();
            in_block += 1;
            if in_block < samples {
                continue;
            }
            in_block = 0;
            if let Some(hat) = hats.end_block(samples) {
                run = run.wrapping_add(1);
                let row = Row {
                    stretch,
                    t_s: series.t_s[at + 1 - samples],
                    block_s: hat[width],
                    samples,
                    stuck: hat[width + 1] / hat[width],
                    mean: means(&hat[width + 5..], hat[width]),
                };
                self.add_row(row, &hat, width);
            }
        }
    }

    fn add_row(&mut self, row: Row, hat: &[f64], width: usize) {
        let at = self.rows.len();
        self.rows.push(row);
        for balance in Balance::ALL {
            let b = balance.index();
            if hat[width + 2 + b] > SLIVER * row.block_s {
                continue;
            }
            self.entries.push(Entry { row: at, balance });
            self.y.push(hat[b]);
            for (term, column) in self.columns.iter_mut().enumerate() {
                column.push(hat[3 * (term + 1) + b]);
            }
        }
    }

    /// Whether the entry takes part in the fit: not a force while the direction of motion is unknown.
    /// What the machine does at `row`, read from the second hat after it: that shares no sample with it, so
    /// that the noise of what is left at `row` does not show in what it is held against.
    pub(super) fn beside(&self, row: usize) -> Option<&Row> {
        let (own, later) = (self.rows.get(row)?, self.rows.get(row + 2)?);
        (own.stretch == later.stretch).then_some(later)
    }

    pub(super) fn counts(&self, entry: &Entry) -> bool {
        entry.balance != Balance::Force || self.rows[entry.row].stuck <= SLIVER
    }
}

/// Integrals over the step that ends at sample `at`: y and the columns by balance, then the extras.
fn step(series: &Series, motion: &Motion, at: usize, recipe: &Recipe<'_>, out: &mut [f64]) {
    let dt = series.t_s[at] - series.t_s[at - 1];
    let (reading, felt) = moments(series, motion, at, dt);
    let point = recipe.point;
    let (seen, felt) = (point.effects.correct(&reading), point.effects.correct(&felt));
    let chambers = point.residual(&seen);
    let force = point.residual(&felt).force_n;
    let width = out.len() - EXTRA;
    out[0] = chambers.chamber_a_m3s * dt;
    out[1] = chambers.chamber_b_m3s * dt;
    out[2] = force * dt;
    for ((term, shape), cell) in recipe.terms.iter().zip(recipe.shapes).zip(out[3..width].chunks_exact_mut(3))
    {
        let unit = point.unit_term(*term, &seen, shape);
        cell[0] = unit.chamber_a_m3s * dt;
        cell[1] = unit.chamber_b_m3s * dt;
        cell[2] = if term.in_force() { point.unit_term(*term, &felt, shape).force_n * dt } else { 0.0 };
    }
    let missing = |value: f64| if value.is_finite() { 0.0 } else { dt };
    let unsure = felt.v_mps.is_nan() || felt.v_mps.abs() < motion.least_sure_mps();
    out[width] = dt;
    out[width + 1] = if unsure { dt } else { 0.0 };
    out[width + 2] = missing(reading.qa_m3s);
    out[width + 3] = missing(reading.qb_m3s);
    out[width + 4] = missing(reading.force_n);
    let means = [
        reading.x_m,
        reading.v_mps,
        reading.pa_pa,
        reading.pb_pa,
        reading.qa_m3s,
        reading.qb_m3s,
        reading.force_n,
        reading.temp_k,
    ];
    for (cell, value) in out[width + 5..].iter_mut().zip(means) {
        *cell = value * dt;
    }
    for cell in out {
        if !cell.is_finite() {
            *cell = 0.0;
        }
    }
}

fn means(hat: &[f64], block_s: f64) -> Signals<f64> {
    let mean = |i: usize| hat.get(i).map_or(0.0, |sum| sum / block_s);
    Signals {
        x_m: mean(0),
        v_mps: mean(1),
        pa_pa: mean(2),
        pb_pa: mean(3),
        qa_m3s: mean(4),
        qb_m3s: mean(5),
        force_n: mean(6),
        temp_k: mean(7),
        ..Signals::default()
    }
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

/// The mean over a step as the chambers see it (speed from the position) and as friction feels it.
fn moments(series: &Series, motion: &Motion, at: usize, dt: f64) -> (Signals<f64>, Signals<f64>) {
    let even = is_even(series, at, dt);
    let middle = |values: &[f64]| step_mean(values, at, even);
    let rate = |values: &[f64]| (values[at] - values[at - 1]) / dt;
    let chambers = Signals {
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
    let felt = Signals { v_mps: middle(&motion.v_mps), ..chambers };
    (chambers, felt)
}
