//! The blind bench of the diagnosis: rigs with one ailment each as traces, and how often the exact likelihood itself would put
//! the true effect first.

#![allow(missing_docs, reason = "cells of the bench's own tables")]

pub mod tables;

use pitchleak::Rig;
use pitchleak::core::effects::EffectConstants;
use pitchleak::core::{Effect, EffectSet, PerLeak, Sensors};
use pitchleak::curve::Curve;
use pitchleak::diagnose::{Collinearity, Declared, Diagnosis, Series, diagnose};
use pitchleak::reference::Reference;
use pitchleak::simulate::{Biases, LeakSize, Scenario, Sensing, Truth};
use pitchleak::wind::{Emulation, History, Wind, WindCase};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use std::f64::consts::TAU;

const SAMPLE_RATE_HZ: f64 = 100.0;
const DURATION_S: f64 = 60.0;
/// What the sound rig leaks, m³/(s·Pa).
pub const LEAKS: PerLeak<f64> = PerLeak { internal: 1e-11, external_a: 3e-12, external_b: 1e-12 };

#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub enum Excitation {
    Wind,
    MultiSine,
}

/// What is wrong with the rig.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum Ailment {
    None,
    Known(Effect),
    /// A leak past the piston that opens with the valve: not among the candidates.
    SpoolLeak,
    /// Pump ripple in the reading of P_A: not among the candidates.
    Ripple,
}

impl Ailment {
    pub fn name(self) -> &'static str {
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
pub struct Case {
    pub excitation: Excitation,
    pub ailment: Ailment,
    pub accuracy: f64,
    /// Of what a sound trace says it could have shown (five standard deviations).
    pub multiple: f64,
    pub size: f64,
    /// What the exact likelihood would make of it; none for what is not among the candidates.
    pub expected: Option<Attainable>,
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

pub fn rig(accuracy: f64) -> Rig {
    let mut rig = Rig::paper();
    rig.instruments = rig.instruments.with_accuracy(accuracy);
    rig
}

/// The truth of a rig with this ailment, sampled.
pub fn truth(excitation: Excitation, ailment: Ailment, size: f64) -> Option<Vec<Truth>> {
    let mut effects = EffectSet::default();
    if let Ailment::Known(effect) = ailment {
        effects.set(effect, size, constants()).ok()?;
    }
    let reference = reference(excitation);
    let scenario = Scenario {
        leaks: LEAKS.map(|leak| LeakSize::Coefficient(leak).into()),
        effects,
        start_s: 5.0,
        warm_up_s: 3.0,
        duration_s: DURATION_S,
        sample_rate_hz: SAMPLE_RATE_HZ,
        ..Scenario::new(rig(1e-2), reference)
    };
    let mut truths = scenario.collect(scenario.leak_coefficients().ok()?).ok()?;
    for truth in &mut truths {
        let (signals, sample) = (&truth.signals, &mut truth.sample);
        match ailment {
            Ailment::SpoolLeak => {
                let drop_pa = (10e6 - signals.pa_pa).max(1e5);
                let opening = signals.qa_m3s.abs() / drop_pa.sqrt() / 3e-8;
                let leak = size * opening * (signals.pa_pa - signals.pb_pa);
                sample.qa_m3s = sample.qa_m3s.map(|q| q + leak);
                sample.qb_m3s = sample.qb_m3s.map(|q| q - leak);
            }
            Ailment::Ripple => sample.pa_pa += size * (TAU * 233.7 * truth.t_s).sin(),
            _ => {}
        }
    }
    Some(truths)
}

/// A worn spot where the piston often is, and a valve that opens at a load pressure it sometimes has.
fn constants() -> EffectConstants<f64> {
    EffectConstants {
        spot_position_m: 0.09,
        spot_width_m: 0.015,
        cracking_pa: 1e6,
        ..EffectConstants::default()
    }
}

pub fn seen(truths: &[Truth], sensors: Sensors<f64>, seed: u64) -> Series {
    let mut sensing = Sensing::new(sensors, Biases::default(), seed);
    let mut series = Series::default();
    truths.iter().for_each(|truth| series.push(truth.t_s, &sensing.read(&truth.sample), None));
    series
}

pub fn ask(truths: &[Truth], accuracy: f64, seed: u64) -> Diagnosis {
    let rig = rig(accuracy);
    diagnose(&[seen(truths, rig.sensors(), seed)], &[], &Declared::of(&rig), &|| ())
}

/// The cases of one excitation: what a sound trace could have shown sets the sizes.
pub fn cases(excitation: Excitation, accuracies: &[f64], multiples: &[f64]) -> Vec<Case> {
    let sound = truth(excitation, Ailment::None, 0.0).expect("the sound rig runs");
    let mut cases = Vec::new();
    for accuracy in accuracies.iter().copied() {
        let case =
            |ailment, multiple, size| Case { excitation, ailment, accuracy, multiple, size, expected: None };
        cases.push(case(Ailment::None, 0.0, 0.0));
        let rig = rig(accuracy);
        let (series, declared) = (seen(&sound, rig.sensors(), 1), Declared::of(&rig));
        let collinearity = Collinearity::of(std::slice::from_ref(&series), &declared, &[constants()]);
        let limits = diagnose(&[series], &[], &declared, &|| ()).not_detectable_below;
        for effect in Effect::ALL {
            let Some(limit) = limits.get(effect.spec().id) else { continue };
            for multiple in multiples {
                let size = multiple * limit.value;
                if size < 0.8 * effect.spec().upper {
                    let expected = attainable(&collinearity, *effect, constants(), size);
                    cases.push(Case { expected, ..case(Ailment::Known(*effect), *multiple, size) });
                }
            }
        }
        for (ailment, sizes) in [(Ailment::SpoolLeak, [2e-12, 8e-12]), (Ailment::Ripple, [5e4, 2e5])] {
            cases.extend(sizes.map(|size| case(ailment, 0.0, size)));
        }
    }
    cases
}

const DRAWS: u64 = 2000;
/// Added to the correlations' diagonal, which fitted constants leave nearly singular.
const WHIFF: f64 = 1e-9;

/// What could be expected of one effect of one size.
#[derive(Clone, Copy, Default, Debug)]
pub struct Attainable {
    /// Share of draws in which its score is the largest and large enough to be named.
    pub first: f64,
    /// Standard deviations between it and its nearest rival.
    pub apart_sigma: f64,
    pub rival: &'static str,
}

/// Lower Cholesky factor.
fn factor(matrix: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let n = matrix.len();
    let mut lower = vec![vec![0.0; n]; n];
    for i in 0..n {
        for j in 0..=i {
            let sum: f64 = (0..j).map(|k| lower[i][k] * lower[j][k]).sum();
            lower[i][j] = if i == j {
                (matrix[i][i] + WHIFF - sum).max(WHIFF).sqrt()
            } else {
                (matrix[i][j] - sum) / lower[j][j]
            };
        }
    }
    lower
}

/// Draws the scores of all candidates: their mean follows from the correlation with the truth's column, their
/// covariance is the correlation itself. Sizes that physics forbids do not compete, and fitted constants
/// pay for their trials as in the diagnosis.
pub fn attainable(
    collinearity: &Collinearity,
    truth: Effect,
    constants: EffectConstants<f64>,
    size: f64,
) -> Option<Attainable> {
    let candidates = &collinearity.candidates;
    let at = candidates.iter().rposition(|one| one.effect == truth && one.constants == constants);
    let at = at.or_else(|| candidates.iter().position(|one| one.effect == truth))?;
    let sigma = size / candidates[at].std;
    let toward = &collinearity.correlation[at];
    let rivals = candidates.iter().zip(toward).filter(|(one, _)| one.effect != truth);
    let (nearest, r) = rivals.max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()))?;
    let lower = factor(&collinearity.correlation);
    let mut random = ChaCha8Rng::seed_from_u64(truth as u64);
    let first = (0..DRAWS)
        .filter(|_| {
            let unit: Vec<f64> = candidates.iter().map(|_| StandardNormal.sample(&mut random)).collect();
            let scores = lower.iter().zip(toward).map(|(row, r)| {
                let noise: f64 = row.iter().zip(&unit).map(|(l, u)| l * u).sum();
                r * sigma + noise
            });
            let named = candidates
                .iter()
                .zip(scores)
                .filter(|(one, z)| one.effect.spec().lower < 0.0 || *z > 0.0)
                .map(|(one, z)| (one.effect, z * z - one.critical_sigma.powi(2)))
                .max_by(|a, b| a.1.total_cmp(&b.1));
            named.is_some_and(|(effect, beyond)| effect == truth && beyond > 0.0)
        })
        .count();
    Some(Attainable {
        first: first as f64 / DRAWS as f64,
        apart_sigma: sigma * (1.0 - r * r).max(0.0).sqrt(),
        rival: nearest.effect.spec().id,
    })
}
