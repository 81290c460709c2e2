//! The weak form: each equation of the cylinder integrated against test functions.
//!
//! For blocks of m samples, the difference of two neighbouring block means of any running integral
//! is that integrand weighted by a test function over both blocks. So ∫ φ ẋ dt is x̄_{k+1} − x̄_k, the difference
//! of two averages: no signal is differentiated, and the noise of a row is known exactly (`noise.rs`).
//! Weak forms for identification: Messenger and Bortz (2021), "Weak SINDy", Multiscale Model. Simul. 19.

use super::integrals::{ActiveTerm, Integrals, Integrand, Step, TestFunctions};
use super::linearisation::Linearisation;
use super::terms::Term;
use crate::diagnose::data::{Motion, Series};
use crate::diagnose::equation::{Equation, PerEquation};
use crate::diagnose::thresholds::ROUNDING;
use pitchleak_core::Signals;
use rayon::prelude::*;
use std::ops::Range;

/// Two neighbouring blocks of samples.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Row {
    /// Consecutive rows with the same number share a block.
    pub(crate) stretch: usize,
    /// Time at the test function's peak, s.
    pub(crate) t_s: f64,
    /// Length of a block, s, and its samples.
    pub(crate) block_s: f64,
    pub(crate) samples: usize,
    /// Averages over both blocks.
    pub(crate) mean: Signals<f64>,
    /// Share of the test function during which the direction of motion is unknown.
    pub(crate) unsure_share: f64,
    /// Whether its balance of forces is not seen: the speed jumps between samples, and neither pressures nor load show the impulse that it
    /// takes; or a pressure sensor lies somewhere in a play that is larger than its noise.
    pub(crate) has_unseen_force: bool,
    /// Whether a leak changes while it lasts.
    pub(crate) has_leak_change: bool,
}

impl Row {
    /// Which of the traces it is of.
    pub(crate) fn trace(&self) -> usize {
        self.stretch / MOST_STRETCHES
    }

    /// Its samples in the times of its trace.
    pub(super) fn samples_in(&self, t_s: &[f64]) -> Range<usize> {
        let peak = t_s.partition_point(|t| *t < self.t_s);
        peak.saturating_sub(self.samples)..peak + self.samples
    }
}

/// A variable that a residual may go with.
pub(crate) struct Variable {
    pub(crate) name: &'static str,
    pub(crate) of: fn(&Row) -> f64,
}

/// P_L, P_A, P_B, x, ẋ, its sign, flows, force, temperature, time.
pub(crate) const VARIABLES: [Variable; 11] = [
    Variable { name: "load_pressure_pa", of: |row| row.mean.pa_pa - row.mean.pb_pa },
    Variable { name: "pa_pa", of: |row| row.mean.pa_pa },
    Variable { name: "pb_pa", of: |row| row.mean.pb_pa },
    Variable { name: "x_m", of: |row| row.mean.x_m },
    Variable { name: "v_mps", of: |row| row.mean.v_mps },
    Variable { name: "direction", of: |row| row.mean.v_mps.signum() },
    Variable { name: "qa_m3s", of: |row| row.mean.qa_m3s },
    Variable { name: "qb_m3s", of: |row| row.mean.qb_m3s },
    Variable { name: "force_n", of: |row| row.mean.force_n },
    Variable { name: "temp_k", of: |row| row.mean.temp_k },
    Variable { name: "t_s", of: |row| row.t_s },
];

/// How many residuals are held against a variable each. Derived.
pub(crate) const RESIDUAL_TESTS: usize = Equation::ALL.len() * VARIABLES.len();

/// One equation of one row: an entry of the regression.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Entry {
    pub(crate) row: usize,
    pub(crate) equation: Equation,
}

/// All traces as one regression y = Σ θ column + noise, in m³ (chambers) and N·s (force).
pub(crate) struct Rows {
    pub(crate) rows: Vec<Row>,
    pub(crate) entries: Vec<Entry>,
    /// The residual at the linearisation.
    pub(crate) y: Vec<f64>,
    /// One column per term; empty where it was not asked for.
    pub(crate) columns: Vec<Vec<f64>>,
}

/// Numbers set aside for the stretches of one trace.
const MOST_STRETCHES: usize = 1 << 32;
/// Blocks that are integrated in one go: enough that the block before, which each part needs too, costs nothing, and
/// few enough for all cores to have work.
const PART_BLOCKS: usize = 512;

/// Some samples of a stretch, of which all blocks but the first end a test function.
pub(super) struct Part {
    pub(super) trace: usize,
    stretch: usize,
    pub(super) samples: Range<usize>,
    pub(super) samples_per_block: usize,
}

/// The parts of all traces. Each begins with the last block of the part before.
pub(super) fn parts(traces: &[Series], block_s: f64) -> Vec<Part> {
    let mut parts = Vec::new();
    for (trace, series) in traces.iter().enumerate() {
        let samples_per_block = ((block_s / series.step_s().max(1e-9)).round() as usize).max(1);
        for (stretch, range) in series.stretches().into_iter().enumerate() {
            let stretch = trace * MOST_STRETCHES + stretch;
            for from in range.clone().step_by(PART_BLOCKS * samples_per_block) {
                let until = (from + (PART_BLOCKS + 1) * samples_per_block).min(range.end);
                parts.push(Part { trace, stretch, samples: from..until, samples_per_block });
            }
        }
    }
    parts
}

impl Rows {
    /// The rows of all traces, in their order, on all cores; `motions` has one entry per trace, `block_s` is the
    /// length of a block, s.
    pub(crate) fn build(
        traces: &[Series],
        motions: &[Motion],
        integrand: &Integrand<'_>,
        block_s: f64,
    ) -> Self {
        let of_part = |part: &Part| {
            let mut rows = Self::empty(integrand.width());
            rows.add_part(&traces[part.trace], &motions[part.trace], part, integrand);
            rows
        };
        let parts: Vec<Self> = parts(traces, block_s).par_iter().map(of_part).collect();
        let mut all = Self::empty(integrand.width());
        parts.into_iter().for_each(|part| all.append(part));
        all
    }

    fn empty(terms: usize) -> Self {
        Self { rows: vec![], entries: vec![], y: vec![], columns: vec![vec![]; terms] }
    }

    /// Leaks that would let past all the oil that the meters count, m³/(s·Pa); no bound of the forces.
    pub(super) fn leak_of_all_oil(&self) -> PerEquation<f64> {
        let size = |signal: fn(&Signals<f64>) -> f64| -> f64 {
            self.rows.iter().map(|row| signal(&row.mean).powi(2)).sum::<f64>().sqrt().max(f64::MIN_POSITIVE)
        };
        // In both pressures an internal leak is as large.
        let load = size(|at| at.pa_pa - at.pb_pa) / std::f64::consts::SQRT_2;
        PerEquation {
            chamber_a: size(|at| at.qa_m3s) / load.min(size(|at| at.pa_pa)),
            chamber_b: size(|at| at.qb_m3s) / load.min(size(|at| at.pb_pa)),
            force: f64::INFINITY,
        }
    }

    /// The row with its columns at these places among `count`.
    pub(crate) fn at_places(self, places: &[usize], count: usize) -> Self {
        let mut columns = vec![vec![]; count];
        places.iter().zip(self.columns).for_each(|(place, column)| columns[*place] = column);
        Self { columns, ..self }
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

    fn add_part(&mut self, series: &Series, motion: &Motion, part: &Part, integrand: &Integrand<'_>) {
        let mut functions = TestFunctions::new(integrand.width());
        let mut step = Integrals::zero(integrand.width());
        let (samples, range) = (part.samples_per_block, part.samples.clone());
        let mut in_block = 0;
        for at in range.clone() {
            if at > range.start {
                integrand.step(series, motion, at, &mut step);
                functions.add_step(&step);
            }
            functions.end_sample();
            in_block += 1;
            if in_block < samples {
                continue;
            }
            in_block = 0;
            if let Some(weighted) = functions.end_block(samples) {
                self.add_row(part.stretch, series.t_s[at + 1 - samples], samples, &weighted);
            }
        }
    }

    fn add_row(&mut self, stretch: usize, t_s: f64, samples: usize, weighted: &Integrals) {
        let block_s = weighted.time_s;
        let mean = weighted.signals.zip(Signals::default(), |sum, _| sum / block_s);
        let row = self.rows.len();
        self.rows.push(Row {
            stretch,
            t_s,
            block_s,
            samples,
            mean,
            unsure_share: weighted.unsure_s / block_s,
            has_unseen_force: false,
            has_leak_change: false,
        });
        for equation in Equation::ALL {
            if weighted.missing_s[equation] > ROUNDING * block_s {
                continue;
            }
            self.entries.push(Entry { row, equation });
            self.y.push(weighted.residual[equation]);
            for (column, integral) in self.columns.iter_mut().zip(&weighted.columns) {
                column.push(integral[equation]);
            }
        }
    }

    /// The columns of the scales of readings meet what the model says that is read, not the reading: were it the reading, an equation
    /// whose readings, areas and leaks are all times nothing would leave nothing.
    pub(super) fn meet_scales(&mut self, terms: &[Term]) {
        let mut columns = std::mem::take(&mut self.columns);
        for (term, column) in terms.iter().zip(&mut columns) {
            self.meet_scale(*term, column, &self.y);
        }
        self.columns = columns;
    }

    /// What `residual` brings into a column by [`Self::meet_scales`].
    pub(super) fn meet_scale(&self, term: Term, column: &mut [f64], residual: &[f64]) {
        // Most terms scale nothing that is read.
        if term.by_reading(&Signals::default()).is_none() {
            return;
        }
        for ((cell, entry), residual) in column.iter_mut().zip(&self.entries).zip(residual) {
            let scaled = term.by_reading(&self.rows[entry.row].mean);
            if let Some((_, slope)) = scaled.filter(|(equation, _)| *equation == entry.equation) {
                *cell += slope * residual;
            }
        }
    }

    /// What the machine does at `row`, read from the second test function after it: that shares no sample with it, so
    /// that the noise of the residual at `row` does not show in what it is held against.
    pub(crate) fn beside(&self, row: usize) -> Option<&Row> {
        let (own, later) = (self.rows.get(row)?, self.rows.get(row + 2)?);
        (own.stretch == later.stretch).then_some(later)
    }

    /// Whether the entry takes part in the fit: not a force while the direction of motion is unknown, nor where its forces are unseen, nor
    /// a chamber while its leak changes.
    pub(crate) fn counts(&self, entry: &Entry) -> bool {
        let row = &self.rows[entry.row];
        match entry.equation {
            Equation::Force => row.unsure_share <= ROUNDING && !row.has_unseen_force,
            _ => !row.has_leak_change,
        }
    }
}

/// The corrected signals of all traces, in the order of their rows.
pub(super) struct Steps(Vec<StepsOfPart>);

struct StepsOfPart {
    /// From its first sample to its last.
    steps: Vec<Step>,
    samples_per_block: usize,
}

impl Steps {
    pub(super) fn of(traces: &[Series], motions: &[Motion], at: &Linearisation, block_s: f64) -> Self {
        let parts = parts(traces, block_s);
        let steps = parts.par_iter().map(|part| {
            let (series, motion) = (&traces[part.trace], &motions[part.trace]);
            let steps =
                part.samples.clone().skip(1).map(|number| Step::ending_at(number, series, motion, at).0);
            StepsOfPart { steps: steps.collect(), samples_per_block: part.samples_per_block }
        });
        Self(steps.collect())
    }

    /// The column of one term in `rows`.
    pub(super) fn column(&self, term: &ActiveTerm, at: &Linearisation, rows: &Rows) -> Vec<f64> {
        let functions: Vec<PerEquation<f64>> =
            self.0.par_iter().flat_map_iter(|part| part.functions(term, at)).collect();
        rows.entries.iter().map(|entry| functions[entry.row][entry.equation]).collect()
    }
}

impl StepsOfPart {
    /// The term's integrals weighted by test functions, as in [`super::integrals`].
    fn functions(&self, term: &ActiveTerm, at: &Linearisation) -> Vec<PerEquation<f64>> {
        let none = PerEquation::<f64>::default();
        let (mut integral, mut block, mut before) = (none, none, None);
        let mut functions = Vec::with_capacity(self.steps.len() / self.samples_per_block);
        let steps = std::iter::once(none).chain(self.steps.iter().map(|step| step.column(term, at)));
        for (number, step) in (1..).zip(steps) {
            integral = integral.zip(step, |sum, more| sum + more);
            block = block.zip(integral, |sum, more| sum + more);
            if number % self.samples_per_block == 0 {
                let mean = std::mem::take(&mut block).map(|sum| sum / self.samples_per_block as f64);
                functions.extend(before.map(|before| mean.zip(before, |now, before| now - before)));
                before = Some(mean);
            }
        }
        functions
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::testing::declared;
    use crate::diagnose::weak_form::{Linearisation, Term};
    use pitchleak_core::Sample;
    use pitchleak_core::effects::EffectConstants;

    const SPEED_MPS: f64 = 0.02;
    const LOST_M3S: f64 = 1e-6;
    const RESISTANCE_N: f64 = 50.0;

    /// Four blocks of ten samples at constant speed: more flows into A than the piston sweeps, and a force resists.
    fn rows(last_flow_b: usize) -> Rows {
        let declared = declared();
        let cylinder = declared.cylinder;
        let mut series = Series::default();
        for k in 0..40_u32 {
            let t = 0.01 * f64::from(k);
            let force = 4e6 * cylinder.area_a_m2 - 3e6 * cylinder.area_b_m2 - RESISTANCE_N;
            let sample = Sample {
                x_m: 0.05 + SPEED_MPS * t,
                pa_pa: 4e6,
                pb_pa: 3e6,
                qa_m3s: Some(cylinder.area_a_m2 * SPEED_MPS + LOST_M3S),
                qb_m3s: (k as usize <= last_flow_b).then_some(-cylinder.area_b_m2 * SPEED_MPS),
                force_n: Some(force),
            };
            series.push(t, &sample, None);
        }
        let at = Linearisation::declared(&declared);
        let series = [series];
        let motions = at.motions(&series, &declared.sensors);
        let integrand = Integrand::new(&at, &[Term::Internal], &[EffectConstants::default()]);
        Rows::build(&series, &motions, &integrand, 0.1)
    }

    #[test]
    fn a_hat_holds_what_is_left_times_its_length() {
        let rows = rows(39);
        assert_eq!((rows.rows.len(), rows.entries.len()), (3, 9));
        for (entry, (y, column)) in rows.entries.iter().zip(rows.y.iter().zip(&rows.columns[0])) {
            let row = &rows.rows[entry.row];
            assert!((row.block_s - 0.1).abs() < 1e-12 && rows.counts(entry));
            let (left, load) = match entry.equation {
                Equation::ChamberA => (LOST_M3S, 1e6),
                Equation::ChamberB => (0.0, -1e6),
                Equation::Force => (RESISTANCE_N, 0.0),
            };
            assert!((y - 0.1 * left).abs() < 1e-9 * left.max(LOST_M3S), "{entry:?}: {y}");
            assert!((column - 0.1 * load).abs() < 1e-3, "{entry:?}: {column}");
            assert!((row.mean.x_m - 0.05 - SPEED_MPS * (row.t_s - 0.005)).abs() < 1e-9, "{row:?}");
        }
    }

    #[test]
    fn an_equation_rests_where_its_flow_is_missing() {
        let of_b = |entry: &&Entry| entry.equation == Equation::ChamberB;
        assert_eq!(rows(35).entries.iter().filter(of_b).map(|entry| entry.row).collect::<Vec<_>>(), [0, 1]);
    }
}
