//! The blind bench of the diagnosis: effects drawn from the plant at 1 kHz, sampled at 100 Hz, seen
//! through noisy sensors; the diagnosis gets the trace and the plain rig file, nothing else.
//!
//! `cargo bench --bench blind` prints the table of `docs/blind-bench.md`. After `--`: seeds per cell, seeds
//! for the sound rig, and words to pick effects, e.g. `-- 5 100 friction sound`.

use pitchleak::Rig;
use pitchleak::core::effects::{EffectKind, Shape};
use pitchleak::core::{Effect, EffectSet, PerLeak, Sensors};
use pitchleak::curve::Curve;
use pitchleak::diagnose::{Declared, Diagnosis, Series, Verdict, diagnose};
use pitchleak::reference::Reference;
use pitchleak::simulate::{Biases, LeakSize, Scenario, Sensing, Truth};
use pitchleak::wind::{Emulation, History, Wind, WindCase};
use std::collections::BTreeMap;
use std::f64::consts::TAU;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

const ACCURACIES: [f64; 3] = [1e-3, 3e-3, 1e-2];
/// Sizes as multiples of what a sound trace says it could have shown (five standard deviations).
const SIZES: [f64; 3] = [1.0, 2.0, 5.0];
const SAMPLE_RATE_HZ: f64 = 100.0;
const DURATION_S: f64 = 60.0;
/// What the sound rig leaks, m³/(s·Pa).
const LEAKS: PerLeak<f64> = PerLeak { internal: 1e-11, external_a: 3e-12, external_b: 1e-12 };

#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
enum Excitation {
    Wind,
    MultiSine,
}

/// What is wrong with the rig.
#[derive(Clone, Copy, PartialEq, Debug)]
enum Ailment {
    None,
    Known(Effect),
    /// A leak past the piston that opens with the valve: not among the candidates.
    SpoolLeak,
    /// Pump ripple in the reading of P_A: not among the candidates.
    Ripple,
}

impl Ailment {
    fn name(self) -> &'static str {
        match self {
            Self::None => "(sound)",
            Self::Known(effect) => effect.spec().id,
            Self::SpoolLeak => "(leak that follows the spool)",
            Self::Ripple => "(pump ripple in P_A)",
        }
    }
}

/// One trace's worth of work.
#[derive(Clone, Copy)]
struct Case {
    excitation: Excitation,
    ailment: Ailment,
    accuracy: f64,
    multiple: f64,
    size: f64,
}

/// What came of the seeds of one case.
#[derive(Default, Clone)]
struct Tally {
    runs: usize,
    named_first: usize,
    in_group: usize,
    anything_else: usize,
    verdicts: BTreeMap<&'static str, usize>,
    error_before: f64,
    error_after: f64,
    leak_bias_before_lpm: f64,
    leak_bias_after_lpm: f64,
}

fn multi_sine(lines: &[f64], amplitude: f64, offset: f64, phase: f64) -> Curve {
    let t: Vec<f64> = (0..=7000).map(|i| 0.01 * f64::from(i)).collect();
    let value = |t: &f64| {
        let wave = |(k, f): (usize, &f64)| (TAU * f * t + phase + 2.4 * (k * k) as f64).sin();
        offset + amplitude * lines.iter().enumerate().map(wave).sum::<f64>() / (lines.len() as f64).sqrt()
    };
    let values: Vec<f64> = t.iter().map(value).collect();
    Curve::through(&t, &values).expect("is a curve")
}

fn reference(excitation: Excitation) -> Reference {
    match excitation {
        Excitation::Wind => {
            let history = History::of(&Wind::BuiltIn(WindCase::Mps21)).expect("is built in");
            Emulation::paper().reference(&history, 0.2).expect("fits the rig")
        }
        Excitation::MultiSine => Reference::of(
            multi_sine(&[0.05, 0.09, 0.16, 0.27, 0.42, 0.61, 0.83, 1.0], 0.03, 0.1, 0.3),
            multi_sine(&[0.04, 0.07, 0.13, 0.21, 0.35, 0.56, 0.9, 1.3], 900.0, 1800.0, 1.1),
        ),
    }
}

fn rig(accuracy: f64) -> Rig {
    let mut rig = Rig::paper();
    let sheets = &mut rig.instruments;
    for sheet in [
        &mut sheets.flow_a,
        &mut sheets.flow_b,
        &mut sheets.pressure,
        &mut sheets.position,
        &mut sheets.force,
    ] {
        sheet.accuracy = accuracy;
    }
    rig
}

/// The truth of a rig with this ailment, sampled.
fn truth(excitation: Excitation, ailment: Ailment, size: f64) -> Option<Vec<Truth>> {
    let mut effects = EffectSet::default();
    if let Ailment::Known(effect) = ailment {
        effects.set(effect, size, shape()).ok()?;
    }
    let scenario = Scenario {
        rig: rig(1e-2),
        reference: reference(excitation),
        leaks: LEAKS.map(LeakSize::Coefficient),
        onset_s: 0.0,
        effects,
        start_s: 5.0,
        warm_up_s: 3.0,
        duration_s: DURATION_S,
        sample_rate_hz: SAMPLE_RATE_HZ,
    };
    let mut truths = scenario.collect(scenario.leak_coefficients().ok()?).ok()?;
    for truth in &mut truths {
        let (moment, sample) = (&truth.moment, &mut truth.sample);
        match ailment {
            Ailment::SpoolLeak => {
                let drop_pa = (10e6 - moment.pa_pa).max(1e5);
                let opening = moment.qa_m3s.abs() / drop_pa.sqrt() / 3e-8;
                let leak = size * opening * (moment.pa_pa - moment.pb_pa);
                sample.qa_m3s = sample.qa_m3s.map(|q| q + leak);
                sample.qb_m3s = sample.qb_m3s.map(|q| q - leak);
            }
            Ailment::Ripple => sample.pa_pa += size * (TAU * 233.7 * truth.t_s).sin(),
            _ => {}
        }
    }
    Some(truths)
}

fn shape() -> Shape<f64> {
    Shape { spot_position_m: 0.09, spot_width_m: 0.015, ..Shape::default() }
}

fn seen(truths: &[Truth], sensors: Sensors<f64>, seed: u64) -> Series {
    let mut sensing = Sensing::new(sensors, Biases::default(), seed);
    let mut series = Series::default();
    truths.iter().for_each(|truth| series.push(truth.t_s, &sensing.read(&truth.sample), None));
    series
}

fn ask(truths: &[Truth], accuracy: f64, seed: u64) -> Diagnosis {
    let rig = rig(accuracy);
    diagnose(&[seen(truths, rig.sensors(), seed)], &[], &Declared::of(&rig), &|| ())
}

fn verdict_name(verdict: Verdict) -> &'static str {
    match verdict {
        Verdict::Explained => "explained",
        Verdict::PartlyExplained => "partly",
        Verdict::NoMissingEffect => "none",
        Verdict::Unexplained => "unexplained",
        Verdict::InsufficientExcitation => "insufficient",
    }
}

impl Tally {
    fn add(&mut self, ailment: Ailment, answer: &Diagnosis) {
        self.runs += 1;
        *self.verdicts.entry(verdict_name(answer.verdict)).or_default() += 1;
        let id = ailment.name();
        let first = answer.effects.first();
        let right = first.is_some_and(|effect| effect.id == id);
        self.named_first += usize::from(right);
        self.in_group +=
            usize::from(right || first.is_some_and(|effect| effect.confusable_with.contains(&id)));
        self.anything_else += usize::from(answer.effects.iter().any(|effect| effect.id != id));
        let in_force = matches!(ailment, Ailment::Known(effect) if effect.spec().kind == EffectKind::Force);
        let error = |rmse: &pitchleak::diagnose::Rmse| {
            let chambers = rmse.chamber_a_m3s.unwrap_or(0.0).hypot(rmse.chamber_b_m3s.unwrap_or(0.0)) * 60e3;
            if in_force { rmse.force_n.unwrap_or(0.0) } else { chambers }
        };
        self.error_before += error(&answer.before.rmse);
        self.error_after += error(&answer.after.rmse);
        let bias = |leaks: &pitchleak::diagnose::LeakEstimates| {
            let off = |value: f64, truth: f64, pressure_pa: f64| (value - truth).abs() * pressure_pa * 60e3;
            off(leaks.internal_leak_coefficient.value, LEAKS.internal, 2e6)
                .max(off(leaks.external_leak_a_coefficient.value, LEAKS.external_a, 4e6))
                .max(off(leaks.external_leak_b_coefficient.value, LEAKS.external_b, 4e6))
        };
        self.leak_bias_before_lpm += bias(&answer.leaks.before);
        self.leak_bias_after_lpm += bias(&answer.leaks.after);
    }

    fn row(&self, case: &Case) -> String {
        let share = |count: usize| 100.0 * count as f64 / self.runs as f64;
        let mean = |sum: f64| sum / self.runs as f64;
        let verdicts: Vec<String> = self.verdicts.iter().map(|(name, n)| format!("{name} {n}")).collect();
        format!(
            "| {:?} | {} | {:.1} % | {:.0}x = {:.2e} | {} | {:.0} | {:.0} | {:.0} | {:.3} | {:.3} | {:.4} | {:.4} | {} |",
            case.excitation,
            case.ailment.name(),
            100.0 * case.accuracy,
            case.multiple,
            case.size,
            self.runs,
            share(self.named_first),
            share(self.in_group),
            share(self.anything_else),
            mean(self.error_before),
            mean(self.error_after),
            mean(self.leak_bias_before_lpm),
            mean(self.leak_bias_after_lpm),
            verdicts.join(", ")
        )
    }
}

/// The cases of one excitation: what a sound trace could have shown sets the sizes.
fn cases(excitation: Excitation) -> Vec<Case> {
    let sound = truth(excitation, Ailment::None, 0.0).expect("the sound rig runs");
    let mut cases = Vec::new();
    for accuracy in ACCURACIES {
        cases.push(Case { excitation, ailment: Ailment::None, accuracy, multiple: 0.0, size: 0.0 });
        let reach = ask(&sound, accuracy, 1).not_detectable_below;
        for effect in Effect::ALL {
            let Some(limit) = reach.get(effect.spec().id) else { continue };
            for multiple in SIZES {
                let size = multiple * limit.value;
                if size < 0.8 * effect.spec().upper {
                    cases.push(Case {
                        excitation,
                        ailment: Ailment::Known(*effect),
                        accuracy,
                        multiple,
                        size,
                    });
                }
            }
        }
        for (ailment, sizes) in [(Ailment::SpoolLeak, [2e-12, 8e-12]), (Ailment::Ripple, [5e4, 2e5])] {
            for size in sizes {
                cases.push(Case { excitation, ailment, accuracy, multiple: 0.0, size });
            }
        }
    }
    cases
}

fn main() {
    let numbers: Vec<u64> = std::env::args().filter_map(|argument| argument.parse().ok()).collect();
    let words: Vec<String> =
        std::env::args().skip(1).filter(|a| a.parse::<u64>().is_err() && !a.starts_with("--")).collect();
    let seeds = numbers.first().copied().unwrap_or(20);
    let sound_seeds = numbers.get(1).copied().unwrap_or(10 * seeds);
    let wanted =
        |case: &Case| words.is_empty() || words.iter().any(|w| case.ailment.name().contains(w.as_str()));
    let all: Vec<Case> =
        [Excitation::Wind, Excitation::MultiSine].into_iter().flat_map(cases).filter(wanted).collect();
    let rows: Mutex<BTreeMap<usize, String>> = Mutex::default();
    let next = AtomicUsize::new(0);
    let work = || {
        while let Some((at, case)) =
            Some(next.fetch_add(1, Ordering::Relaxed)).and_then(|i| Some((i, all.get(i)?)))
        {
            let Some(truths) = truth(case.excitation, case.ailment, case.size) else { continue };
            let mut tally = Tally::default();
            let seeds = if case.ailment == Ailment::None { sound_seeds } else { seeds };
            for seed in 0..seeds {
                tally.add(case.ailment, &ask(&truths, case.accuracy, 1000 * at as u64 + seed));
            }
            rows.lock().expect("no worker panicked").insert(at, tally.row(case));
        }
    };
    let workers = std::thread::available_parallelism().map_or(1, usize::from);
    std::thread::scope(|scope| (0..workers).for_each(|_| drop(scope.spawn(work))));
    println!(
        "| excitation | effect | accuracy | size | runs | first % | in group % | anything else % | error before | after | leak bias before L/min | after | verdicts |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|---|---|---|");
    rows.lock().expect("no worker panicked").values().for_each(|row| println!("{row}"));
}
