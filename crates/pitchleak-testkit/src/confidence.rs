//! The bench of confidence. One question: a rig with what ails it, the trace that its sensors show, the answer, and what it is worth.

#![allow(missing_docs, reason = "cells of the bench's own tables")]

pub mod plant;
pub mod questions;

use crate::doubts::alone;
use pitchleak::Rig;
use pitchleak::core::{Cylinder, Fluid};
use pitchleak::diagnose::{Declared, Diagnosis, FoundEffect, Traces, Verdict, diagnose};
use pitchleak::rig::{Instrument, Instruments};
use pitchleak::trace::{TraceError, TraceReader};
use plant::{Instant, Physics, Plant, Rest};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use rayon::prelude::*;
use std::fmt::Write;
use std::io::Cursor;

/// What the sensors do to the truth, by the ids of the table; SI and shares.
#[derive(Clone, Copy, Debug, Default)]
pub struct Reading {
    pub flow_gain_a: f64,
    pub flow_offset_a: f64,
    pub flow_offset_b: f64,
    pub flow_lag: f64,
    pub pressure_lag_a: f64,
    pub position_gain: f64,
    /// Meter A reads nothing below this flow.
    pub dead_band: f64,
    /// Play of the position sensor, on each side.
    pub backlash: f64,
    // What no table has.
    /// Meter A reads Q + this × Q².
    pub bent_meter: f64,
    /// Meter A's zero at the end, m³/s.
    pub drifting_zero: f64,
    /// Reading of P_A per square of the pressure.
    pub bent_pressure: f64,
    /// Meter A's reading per stroke of the position.
    pub cross_talk: f64,
    /// Meter A reads no more than this either way; none where zero.
    pub range: f64,
    /// Meter A counts pulses of this volume; none where zero.
    pub pulse_m3: f64,
    /// The meters are late by this at the end, s.
    pub slow_clock: f64,
    /// Play of pressure sensor A, on each side.
    pub pressure_play: f64,
}

/// One question.
#[derive(Clone, Debug)]
pub struct Case {
    pub name: String,
    pub size: f64,
    pub rate_hz: f64,
    pub seconds: f64,
    pub accuracy: f64,
    /// Noise that the sensors really have, in that of their data sheets.
    pub noise_share: f64,
    pub pressure_full_scale: f64,
    pub rest: Rest,
    pub physics: Physics,
    pub reading: Reading,
    /// Effects of the table that are there, with their sizes.
    pub truth: Vec<(&'static str, f64)>,
    pub seed: u64,
}

impl Case {
    /// The paper's rig without an ailment.
    pub fn sound(name: &str, seed: u64) -> Self {
        Self {
            name: name.to_owned(),
            size: 1.0,
            rate_hz: 100.0,
            seconds: 60.0,
            accuracy: 1e-3,
            noise_share: 1.0,
            pressure_full_scale: 16e6,
            rest: Rest::Never,
            physics: Physics::default(),
            reading: Reading::default(),
            truth: vec![],
            seed,
        }
    }

    fn plant(&self) -> Plant {
        Plant { ailment: self.physics, ..Plant::of_size(self.size) }
    }

    fn rig(&self) -> Rig {
        let (plant, mut rig) = (self.plant(), Rig::paper());
        rig.cylinder = Cylinder {
            area_a_m2: plant.area_a,
            area_b_m2: plant.area_b,
            stroke_m: plant.stroke,
            moving_mass_kg: plant.mass,
            dead_volume_a_m3: 0.0,
            dead_volume_b_m3: 0.0,
        };
        rig.fluid = Fluid { bulk_modulus_pa: plant.bulk, ..rig.fluid };
        let full = |full_scale| Instrument::of_full_scale(full_scale);
        let flow = full(20.0 / 60e3 * self.size.powi(3));
        rig.instruments = Instruments {
            flow_a: flow,
            flow_b: flow,
            pressure: full(self.pressure_full_scale),
            position: full(plant.stroke),
            force: full(10.0 * plant.load),
            ..rig.instruments
        }
        .with_accuracy(self.accuracy);
        rig
    }

    /// The trace as the sensors show it, as a file.
    fn trace(&self) -> String {
        let (mut text, mut random) = (
            "t_s,x_m,pa_pa,pb_pa,qa_m3s,qb_m3s,force_n\n".to_owned(),
            ChaCha8Rng::seed_from_u64(77_000 + self.seed),
        );
        let (plant, sensors, own) = (self.plant(), self.rig().sensors(), self.reading);
        let mut noisy = |value: f64, std: f64| {
            let unit: f64 = StandardNormal.sample(&mut random);
            value + self.noise_share * std * unit
        };
        let every = (10_000.0 / self.rate_hz).round() as u64;
        let (mut late, mut position, mut pressure) = (None::<Instant>, Play(plant.stroke / 2.0), Play(5e6));
        let (mut count, mut counted) = (0_u64, 0.0_f64);
        plant.run(self.rest, self.seconds, self.seed, |now| {
            let before = late.unwrap_or(*now);
            let follow = |old: f64, new: f64, lag: f64| old + (new - old) * 1e-4 / (1e-4 + lag);
            let flow_lag = own.flow_lag + own.slow_clock * now.t / self.seconds;
            let shown = Instant {
                qa: follow(before.qa, now.qa, flow_lag),
                qb: follow(before.qb, now.qb, flow_lag),
                pa: follow(before.pa, now.pa, own.pressure_lag_a),
                ..*now
            };
            late = Some(shown);
            let (x, pa) = (position.after(now.x, own.backlash), pressure.after(shown.pa, own.pressure_play));
            counted += shown.qa * 1e-4;
            count += 1;
            if !(count - 1).is_multiple_of(every) {
                return;
            }
            let mut qa = shown.qa * (1.0 + own.flow_gain_a) + own.flow_offset_a;
            qa += own.bent_meter * shown.qa.powi(2) + own.drifting_zero * now.t / self.seconds;
            qa += own.cross_talk * (now.x / plant.stroke - 0.5);
            if shown.qa.abs() < own.dead_band {
                qa = 0.0;
            }
            let mut qa = noisy(qa, sensors.flow_a.noise_std);
            if own.range > 0.0 {
                qa = qa.clamp(-own.range, own.range);
            }
            if own.pulse_m3 > 0.0 {
                let pulses = (counted / own.pulse_m3).trunc();
                counted -= pulses * own.pulse_m3;
                qa = pulses * own.pulse_m3 * self.rate_hz;
            }
            let x = noisy(x * (1.0 + own.position_gain), sensors.position.noise_std);
            let pa = noisy(pa + own.bent_pressure * pa.powi(2), sensors.pressure.noise_std);
            let pb = noisy(shown.pb, sensors.pressure.noise_std);
            let qb = noisy(shown.qb + own.flow_offset_b, sensors.flow_b.noise_std);
            let force = noisy(now.force, sensors.force.noise_std);
            let _ = writeln!(text, "{:.5},{x:.9e},{pa:.9e},{pb:.9e},{qa:.9e},{qb:.9e},{force:.9e}", now.t);
        });
        text
    }

    /// The answer to the trace, read as a file is: of a long one what is held.
    pub fn ask(&self) -> Diagnosis {
        let (rig, mut traces) = (self.rig(), Traces::default());
        let text = Box::new(Cursor::new(self.trace().into_bytes()));
        let mut reader = TraceReader::from_stream("trace", text, &rig).expect("a trace");
        traces.read(&mut reader, &rig, || Ok::<_, TraceError>(())).expect("reads");
        diagnose(&traces.into_series(), &[], &Declared::of(&rig), &|| ())
    }
}

/// Hangs behind what moves it, on each side by as much as there is play.
struct Play(f64);

impl Play {
    fn after(&mut self, moved: f64, play: f64) -> f64 {
        self.0 = self.0.clamp(moved - play, moved + play);
        self.0
    }
}

pub fn ask_all(cases: &[Case]) -> Vec<(Case, Diagnosis)> {
    cases.par_iter().map(|case| (case.clone(), case.ask())).collect()
}

/// Whether the first name is that of an effect that is there.
pub fn first_is_true(case: &Case, answer: &Diagnosis) -> bool {
    answer.effects.first().is_some_and(|effect| is_true(case, effect))
}

/// Whether all that is there is named.
pub fn all_named(case: &Case, answer: &Diagnosis) -> bool {
    case.truth.iter().all(|(id, _)| answer.effects.iter().any(|effect| effect.id == *id))
}

fn is_true(case: &Case, effect: &FoundEffect) -> bool {
    case.truth.iter().any(|(id, _)| *id == effect.id)
}

/// How far the values of the effects that are surely named are off, in standard deviations.
pub fn deviations(case: &Case, answer: &Diagnosis) -> Vec<f64> {
    let off = |effect: &FoundEffect| {
        let (_, truth) = case.truth.iter().find(|(id, _)| *id == effect.id)?;
        effect.confident.then(|| (effect.value - truth).abs() / effect.std)
    };
    answer.effects.iter().filter_map(off).collect()
}

/// One case and what was said of it.
pub fn line(case: &Case, answer: &Diagnosis) -> String {
    let mut out = format!(
        "{:22} size {} {:3} Hz {} of {} {:?} {} s FS {:.0e} seed {}: {:?}",
        case.name,
        case.size,
        case.rate_hz,
        case.noise_share,
        case.accuracy,
        case.rest,
        case.seconds,
        case.pressure_full_scale,
        case.seed,
        answer.verdict
    );
    for one in &answer.effects {
        let sure = if one.confident { "!" } else { "?" };
        let truth = case.truth.iter().find(|(id, _)| *id == one.id).map(|(_, v)| *v);
        let off = truth.map_or(String::new(), |truth| format!(" ({:+.1}σ)", (one.value - truth) / one.std));
        let _ =
            write!(out, " {}{sure} {:.3e}±{:.1e}{off} {:?}", one.id, one.value, one.std, one.confusable_with);
    }
    let _ = write!(out, " | ratio {:?} | {:?}", answer.after.noise_ratio, answer.notes);
    out
}

pub fn summary(answers: &[(Case, Diagnosis)]) -> String {
    let count = |of: &dyn Fn(&Case, &Diagnosis) -> bool| {
        answers.iter().filter(|(case, answer)| of(case, answer)).count()
    };
    let named = |is: &dyn Fn(&FoundEffect) -> bool, right: bool| {
        let of = |(case, answer): &(Case, Diagnosis)| {
            answer.effects.iter().filter(|one| is(one) && (!right || is_true(case, one))).count()
        };
        answers.iter().map(of).sum::<usize>()
    };
    let deviations: Vec<f64> = answers.iter().flat_map(|(case, answer)| deviations(case, answer)).collect();
    let within = deviations.iter().filter(|sigma| **sigma <= 4.0).count();
    format!(
        "{} runs, {} no missing effect, {} explained, {} partly, {} unexplained; {} name something, {} something wrong surely, \
         {} explained with a sure name; first right {}, all named {}, all named and explained {}, all sure {}; {within} of {} sure values within 4 σ; \
         of {} names of at least 95 % {} are right, of {} others {}\n{}",
        answers.len(),
        count(&|_, a| a.verdict == Verdict::NoMissingEffect),
        count(&|_, a| a.verdict == Verdict::Explained),
        count(&|_, a| a.verdict == Verdict::PartlyExplained),
        count(&|_, a| a.verdict == Verdict::Unexplained),
        count(&|_, a| !a.effects.is_empty()),
        count(&|c, a| a.effects.iter().any(|e| e.confident && !is_true(c, e))),
        count(&|_, a| a.verdict == Verdict::Explained && a.effects.iter().any(|e| e.confident)),
        count(&first_is_true),
        count(&all_named),
        count(&|c, a| all_named(c, a) && a.verdict == Verdict::Explained),
        count(&|c, a| all_named(c, a) && a.effects.iter().all(|e| e.confident)),
        deviations.len(),
        named(&|one| one.probability >= 0.95, false),
        named(&|one| one.probability >= 0.95, true),
        named(&|one| one.probability < 0.95, false),
        named(&|one| one.probability < 0.95, true),
        alone(
            answers
                .iter()
                .flat_map(|(case, answer)| answer.effects.iter().map(|one| (one, is_true(case, one))))
        ),
    )
}
