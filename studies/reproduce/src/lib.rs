//! The paper's experiment again (Wu et al. 2011, Section IV): four winds, two leak settings, its law
//! and ours on the same readings, with many seeds. docs/reproduction.md explains every choice.

pub mod cramer_rao;
mod detection;
mod figures;
mod page;
mod protocol;
mod table;

pub use detection::{Delay, Detection, detection};
pub use figures::Drawing;
pub use page::page;
pub use protocol::{
    Candidate, Case, ReproduceError, Run, SAMPLE_RATE_HZ, WINDOW_S, WINDOWS, best_gains, paper_rig, rig,
};
pub use table::{Bound, EstimateHistory, Row, Scored, TrialScore};

use crate::cramer_rao::CramerRaoModel;
use cramer_rao::Efficient;
use pitchleak::Rig;
use pitchleak::core::{Estimate, ExcitationSettings, Leak, PerLeak, Sample};
use pitchleak::replay::leak_pressures_pa;
use pitchleak::rig::{Instrument, Instruments};
use pitchleak::simulate::{Biases, Normal, Sensing};
use pitchleak::units::LPM_PER_M3S;
use pitchleak::wind::WindCase;
use protocol::map_counted;
use rayon::prelude::*;
use serde::Serialize;
use table::{Entry, mean};

/// Greatest bias of a sensor in the runs with biases, share of full scale.
const BIAS: f64 = 0.01;

/// Samples of the first 2 s, in which the paper's law is said to converge.
const EARLY_SAMPLES: usize = 200;

/// Stream of a seed's random numbers from which the efficient estimator's errors are drawn.
const EFFICIENT_STREAM: u64 = 2;

/// How far the reproduction has come.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Progress {
    /// What is being done.
    pub stage: &'static str,
    /// Pieces done.
    pub done: usize,
    /// Pieces in all.
    pub count: usize,
}

/// How the rig followed its references in one run; the paper gives 3 % and 21.4 % as printed.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Tracking {
    /// Mean wind, m/s.
    pub wind_mps: u32,
    /// Leak setting.
    pub case: Case,
    /// Root mean square position error, % of the stroke.
    pub position_rms_percent_of_stroke: f64,
    /// Largest position error, % of the stroke.
    pub position_peak_percent_of_stroke: f64,
    /// Root mean square load error, % of the largest load asked for.
    pub load_rms_percent_of_peak: f64,
    /// Largest load error, % of the largest load asked for.
    pub load_peak_percent_of_peak: f64,
    /// Mean sizes of the leak flows, L/min.
    pub internal_mean_lpm: f64,
    /// Mean external leak flow, L/min.
    pub external_a_mean_lpm: f64,
}

/// What noise lets a window tell about the oil.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct BulkModulusBound {
    /// Mean wind, m/s.
    pub wind_mps: u32,
    /// Leak setting.
    pub case: Case,
    /// Spread of the bulk modulus before the window, %.
    pub prior_std_percent: f64,
    /// Cramér–Rao bound on its spread after the window, prior included, %: median over the windows.
    pub bound_std_percent: f64,
    /// Whether the window halves the spread.
    pub identifiable: bool,
}

/// Everything `pitchleak reproduce` prints.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Report {
    /// `pitchleak.reproduce/1`.
    pub schema: &'static str,
    /// Seeds per row: each with its own noise, in the windows one after the other.
    pub seeds: u64,
    /// The table, sensors with white noise of 3σ = 1 % of full scale.
    pub rows: Vec<Row>,
    /// The rows with a constant bias of up to 1 % of full scale on every sensor.
    pub rows_with_bias: Vec<Row>,
    /// How the rig followed.
    pub tracking: Vec<Tracking>,
    /// What can be known of the bulk modulus, the parameter that no estimator finds at 5 m/s.
    pub bulk_modulus: Vec<BulkModulusBound>,
    /// Gains tried for the paper's law, the best first; `rows` use the best.
    pub paper_gains: Vec<Candidate>,
    /// What the alarms do, where that was asked for: see [`detection()`].
    pub detection: Option<Detection>,
}

/// A finished reproduction: the report, and the runs behind it for the figures.
pub struct Reproduction {
    /// The report.
    pub report: Report,
    /// One per wind and case, in the table's order.
    pub runs: Vec<Run>,
}

/// Runs the experiment with `seeds` seeds per row. The numbers do not depend on the machine or on
/// how many cores it has.
///
/// # Errors
/// [`ReproduceError`].
pub fn reproduce(seeds: u64, progress: impl Fn(Progress) + Sync) -> Result<Reproduction, ReproduceError> {
    let settings: Vec<(WindCase, Case)> =
        WindCase::ALL.into_iter().flat_map(|wind| Case::ALL.map(|case| (wind, case))).collect();
    let runs = map_counted("simulating", &settings, &progress, |(w, c)| Run::simulate(*w, c.leaks_m3spa()))?;
    let paper_gains = best_gains(&runs, &progress)?;
    let best = paper_gains.first().map_or((10.0, 1.0), |best| (best.lambda_per_s, best.gamma));

    let jobs: Vec<(usize, usize)> = (0..runs.len()).flat_map(|r| (0..WINDOWS).map(move |w| (r, w))).collect();
    let laws = [Law::paper(best), Law::default_estimator(), Law::with_biases()];
    let [paper, plain, biased] = &laws;
    let trials = map_counted("estimating", &jobs, &progress, |&(run, window)| {
        let run = runs.get(run).ok_or(ReproduceError::Empty)?;
        laws.iter().map(|law| law.trials(run, window, seeds)).collect::<Result<Vec<_>, _>>()
    })?;

    let rows = |laws: &[(usize, &Law)]| rows(&settings, &trials, laws);
    let cases: Vec<(Case, &Run)> = settings.iter().map(|(_, case)| *case).zip(&runs).collect();
    let report = Report {
        schema: "pitchleak.reproduce/1",
        seeds,
        rows: rows(&[(0, paper), (1, plain)]),
        rows_with_bias: rows(&[(2, biased)]),
        tracking: cases.iter().map(|(case, run)| tracking(*case, run)).collect(),
        bulk_modulus: cases.par_iter().map(|(case, run)| bulk_modulus(*case, run)).collect(),
        paper_gains,
        detection: None,
    };
    Ok(Reproduction { report, runs })
}

/// An estimator with the sensors it is given.
struct Law {
    name: &'static str,
    rig: Rig,
    bias_share: f64,
}

/// Both leaks' entries of one window, one per seed.
type Trials = Vec<PerLeak<Entry>>;

impl Law {
    fn paper((lambda_per_s, gamma): (f64, f64)) -> Self {
        Self { name: "paper", rig: paper_rig(lambda_per_s, gamma), bias_share: 0.0 }
    }

    fn default_estimator() -> Self {
        Self { name: "rls", rig: rig(), bias_share: 0.0 }
    }

    /// The rig file then says so: a bias uniform within ± 1 % has a standard deviation of 1 %/√3.
    fn with_biases() -> Self {
        let mut rig = rig();
        let biased = |sheet: &mut Instrument| sheet.bias = BIAS / f64::sqrt(3.0);
        let Instruments { flow_a, flow_b, pressure, position, force, .. } = &mut rig.instruments;
        [flow_a, flow_b, pressure, position, force].into_iter().for_each(biased);
        Self { name: "rls", bias_share: BIAS, rig }
    }

    fn trials(&self, run: &Run, window: usize, seeds: u64) -> Result<Trials, ReproduceError> {
        let truths = run.window(window);
        let truth = run.leaks_m3spa;
        let samples: Vec<Sample<f64>> = truths.iter().map(|truth| truth.sample).collect();
        let Rig { cylinder, fluid, .. } = &self.rig;
        let sensors = self.rig.sensors();
        let model = CramerRaoModel { cylinder, fluid, sensors: &sensors, leaks: &truth };
        let efficient = Efficient::new(&model, &samples).ok_or(ReproduceError::Empty)?;
        let stds = efficient.leak_std(samples.len()).zip(efficient.leak_std(EARLY_SAMPLES));
        let sizes = mean_pressures_pa(&samples);
        let mine = (0..seeds).filter(|seed| (seed % WINDOWS as u64) as usize == window);
        mine.map(|seed| {
            let biases = Biases::drawn(&self.rig.instruments, self.bias_share, seed);
            let history = EstimateHistory::run(&self.rig, truths, Sensing::new(sensors, biases, seed))?;
            let unbiased = Sensing::new(sensors, Biases::default(), seed);
            let best = efficient.history(truths, unbiased, &mut Normal::stream(seed, EFFICIENT_STREAM))?;
            Ok(PerLeak::from_fn(|leak| {
                // Nothing leaks out of B here; its errors are relative to 1.
                let coefficient = if leak == Leak::ExternalB { 1.0 } else { truth[leak] };
                let (std, early) = stds[leak];
                let flow_m3s = Estimate { value: coefficient, std }.scaled(sizes[leak]);
                Entry {
                    score: history.score(coefficient, leak),
                    efficient: best.score(coefficient, leak),
                    bound: std / coefficient,
                    bound_early: early / coefficient,
                    identifiable: ExcitationSettings::default().resolves(&flow_m3s),
                }
            }))
        })
        .collect()
    }
}

/// Means of |P_L|, P_A, P_B, Pa.
fn mean_pressures_pa(samples: &[Sample<f64>]) -> PerLeak<f64> {
    let of = |leak, sample: &Sample<f64>| leak_pressures_pa([sample.pa_pa, sample.pb_pa])[leak].abs();
    PerLeak::from_fn(|leak| mean(samples.iter().map(|sample| of(leak, sample))))
}

/// The rows of `laws` (and their places in the trials), in the order wind, case, leak, estimator;
/// `trials` are by run and window, then by law.
fn rows(settings: &[(WindCase, Case)], trials: &[Vec<Trials>], laws: &[(usize, &Law)]) -> Vec<Row> {
    let mut rows = Vec::new();
    for ((wind, case), windows) in settings.iter().zip(trials.chunks(WINDOWS)) {
        for leak in [Leak::Internal, Leak::ExternalA] {
            for (place, law) in laws {
                let entries = windows.iter().filter_map(|window| window.get(*place)).flatten();
                let entries: Vec<Entry> = entries.map(|entry| entry[leak]).collect();
                rows.push(Row::of(wind.mean_mps(), *case, leak.id(), law.name, &entries));
            }
        }
    }
    rows
}

fn bulk_modulus(case: Case, run: &Run) -> BulkModulusBound {
    let rig = rig();
    let (Rig { cylinder, fluid, .. }, sensors) = (&rig, rig.sensors());
    let model = CramerRaoModel { cylinder, fluid, sensors: &sensors, leaks: &run.leaks_m3spa };
    let spread = |window: usize| {
        let samples: Vec<Sample<f64>> = run.window(window).iter().map(|truth| truth.sample).collect();
        let bound = model.bound(1.0 / SAMPLE_RATE_HZ, &samples);
        bound.map_or(f64::INFINITY, |b| b.compressibility_std * rig.fluid.bulk_modulus_pa)
    };
    let prior = rig.fluid.bulk_modulus_std_pa / rig.fluid.bulk_modulus_pa;
    let bound = table::median((0..WINDOWS).map(spread).collect());
    BulkModulusBound {
        wind_mps: run.wind.mean_mps(),
        case,
        prior_std_percent: 100.0 * prior,
        bound_std_percent: 100.0 * bound,
        identifiable: ExcitationSettings::default().learns(bound, prior),
    }
}

fn tracking(case: Case, run: &Run) -> Tracking {
    let stroke = rig().cylinder.stroke_m;
    let most_load = run.truths.iter().map(|t| t.load_reference_n.abs()).fold(0.0, f64::max);
    let position =
        || run.truths.iter().map(|t| 100.0 * (t.signals.x_m - t.position_reference_m).abs() / stroke);
    let load =
        || run.truths.iter().map(|t| 100.0 * (t.signals.force_n - t.load_reference_n).abs() / most_load);
    let rms = |errors: &mut dyn Iterator<Item = f64>| mean(errors.map(|e| e * e)).sqrt();
    Tracking {
        wind_mps: run.wind.mean_mps(),
        case,
        position_rms_percent_of_stroke: rms(&mut position()),
        position_peak_percent_of_stroke: position().fold(0.0, f64::max),
        load_rms_percent_of_peak: rms(&mut load()),
        load_peak_percent_of_peak: load().fold(0.0, f64::max),
        internal_mean_lpm: LPM_PER_M3S * mean(run.truths.iter().map(|t| t.leaks_m3s.internal.abs())),
        external_a_mean_lpm: LPM_PER_M3S * mean(run.truths.iter().map(|t| t.leaks_m3s.external_a)),
    }
}

impl Report {
    /// The report as JSON, schema `pitchleak.reproduce/1`. Rows hold medians over all seeds.
    ///
    /// # Errors
    /// Those of the JSON writer; numbers, texts and lists give none.
    pub fn to_json(&self) -> Result<String, serde_json::Error> {
        serde_json::to_string(self)
    }

    /// The report for people.
    pub fn to_text(&self) -> String {
        let mut out = table::to_text(
            &format!("Medians of {} seeds, worst in brackets; noise 3 sigma = 1 % of full scale", self.seeds),
            &self.rows,
        );
        out.push('\n');
        out += &table::to_text(
            "The same, each sensor with a constant bias of up to 1 % of full scale",
            &self.rows_with_bias,
        );
        out += "\nTracking (position in % of the stroke, load in % of its peak; rms and peak)\n";
        for t in &self.tracking {
            out += &format!(
                "{:>4} m/s case {}: position {:.2} {:.2}  load {:.2} {:.2}  leaks {:.2} and {:.2} L/min\n",
                t.wind_mps,
                u8::from(t.case),
                t.position_rms_percent_of_stroke,
                t.position_peak_percent_of_stroke,
                t.load_rms_percent_of_peak,
                t.load_peak_percent_of_peak,
                t.internal_mean_lpm,
                t.external_a_mean_lpm
            );
        }
        out += "\nBulk modulus: what 20 s can tell, spread before and after (Cramer-Rao)\n";
        for b in &self.bulk_modulus {
            out += &format!(
                "{:>4} m/s case {}: {:.1} % -> {:.1} %{}\n",
                b.wind_mps,
                u8::from(b.case),
                b.prior_std_percent,
                b.bound_std_percent,
                if b.identifiable { "" } else { "  not identifiable" }
            );
        }
        if let Some(best) = self.paper_gains.first() {
            out += &format!(
                "\nPaper's law with the best of {} gains: lambda {} 1/s, gamma {}\n",
                self.paper_gains.len(),
                best.lambda_per_s,
                best.gamma
            );
        }
        out += "Paper: leakage 7.8 % mean, 11 % peak; coefficient 7.3 % mean, 13.3 % peak; converged within 1-2 s\n";
        out + &self.detection.as_ref().map_or_else(String::new, Detection::to_text)
    }
}
