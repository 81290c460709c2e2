use super::*;
use crate::rig::{EffectValue, EstimatorKind};
use crate::simulate::Normal;
use pitchleak_core::Effect;
use pitchleak_testkit::Motion;

/// The paper's rig, of which this is known.
fn with_effect(effect: Effect, value: f64) -> Rig {
    let mut rig = Rig::paper();
    rig.effects.insert(effect, EffectValue::new(value, None));
    rig
}

/// Records at 100 Hz of a cylinder that leaks; a pause of a minute comes before the records `gaps`.
fn records(gaps: &[usize]) -> Vec<Record> {
    let leaks = PerLeak { internal: 1e-11, external_a: 0.0, external_b: 0.0 };
    let (mut t_s, mut normal) = (0.0, Normal::stream(1, 0));
    let read = |(k, mut sample): (usize, pitchleak_core::Sample<f64>)| {
        sample.qa_m3s = sample.qa_m3s.map(|flow| flow + 1e-6 * normal.draw());
        let after_gap = gaps.contains(&k);
        let dt_s = if k == 0 {
            0.0
        } else if after_gap {
            60.0
        } else {
            0.01
        };
        t_s += dt_s;
        Record { t_s, dt_s, after_gap, sample, ..Record::default() }
    };
    Motion::wind_like(leaks).samples(20).into_iter().enumerate().map(read).collect()
}

/// How many records it takes until the alarm is raised.
fn raised_after(rig: &Rig, gaps: &[usize]) -> Option<usize> {
    let mut replay = Replay::new(rig).expect("the paper's rig");
    records(gaps).iter().position(|record| {
        replay.push(record);
        replay.detector.active().internal
    })
}

/// An alarm waits until its evidence has lasted for the hold time: a pause is no evidence.
#[test]
fn a_gap_is_no_hold_time() {
    let mut rig = Rig::paper();
    rig.alarms.hold_time_s = 5.0;
    let first = raised_after(&rig, &[]).expect("a large leak");
    let gapped = raised_after(&rig, &[first - 300]).expect("a large leak");
    assert!(gapped >= first && gapped <= first + 60, "{first} records, with a gap {gapped}");
}

#[test]
fn the_papers_law_waits_as_long() {
    let mut rig = Rig::paper();
    rig.estimator.kind = EstimatorKind::Paper;
    rig.alarms.hold_time_s = 2.0;
    let first = raised_after(&rig, &[]).expect("a large leak");
    let gapped = raised_after(&rig, &[first - 100]).expect("a large leak");
    assert!(gapped >= first, "{first} records, with a gap {gapped}");
}

/// The leak that an effect of the rig file carries is a mean over time that was watched.
#[test]
fn a_gap_does_not_weigh_in_the_mean_leak_of_an_effect() {
    let rig = with_effect(Effect::InternalLeakTurbulent, 6e-9);
    let mean = |gaps: &[usize]| {
        let mut correction = Correction::of(&rig).expect("an effect");
        for record in records(gaps) {
            correction.correct(&record);
        }
        correction.mean_leaks_m3s().internal
    };
    let (whole, gapped) = (mean(&[]), mean(&[700, 1300]));
    assert!((gapped / whole - 1.0).abs() < 1e-3, "{whole} {gapped}");
}

/// What an effect of the rig file lets leak is part of the leak, in the figures over time and in what they are worth.
#[test]
fn an_effects_leak_counts_as_a_leak() {
    let by_root = 6e-9;
    let rig = with_effect(Effect::InternalLeakTurbulent, by_root);
    let mut replay = Replay::new(&rig).expect("the paper's rig");
    let (mut off, mut whole) = (0.0, 0.0);
    for (k, mut record) in records(&[]).into_iter().enumerate() {
        let load_pa = record.sample.load_pressure_pa();
        let orifice = by_root * load_pa.signum() * load_pa.abs().sqrt();
        let leak = orifice + 1e-11 * load_pa;
        record.sample.qa_m3s = record.sample.qa_m3s.map(|flow| flow + orifice);
        record.sample.qb_m3s = record.sample.qb_m3s.map(|flow| flow - orifice);
        record.leak_m3s.internal = Some(leak);
        replay.push(&record);
        if k > 1500 {
            off += (replay.estimate_row(&record).flows_m3s.internal - leak).powi(2);
            whole += leak * leak;
        }
    }
    assert!(off < 0.05_f64.powi(2) * whole, "{}", (off / whole).sqrt());
    let score = replay.scoring.scores().expect("there is a reference").internal.expect("it leaks");
    assert!(score.leakage_mean_error_percent < 5.0 && score.convergence_time_s.is_some(), "{score:?}");
}

/// A reading with a known play is corrected to the truth but for a moment after each turn.
#[test]
fn a_declared_hysteresis_is_taken_out_of_the_readings() {
    use pitchleak_core::effects::Play;
    let width_pa = 1e5;
    let mut rig = with_effect(Effect::PressureHysteresisA, width_pa);
    rig.instruments = rig.instruments.with_accuracy(1e-3);
    let mut correction = Correction::of(&rig).expect("an effect");
    let all = records(&[]);
    let mut play = Play::new(all[0].sample.pa_pa);
    let (mut before, mut after) = (0.0, 0.0);
    for record in all {
        let truth = record.sample.pa_pa;
        let mut shown = record;
        shown.sample.pa_pa = play.update(width_pa, truth);
        before += (shown.sample.pa_pa - truth).powi(2);
        after += (correction.correct(&shown).sample.pa_pa - truth).powi(2);
    }
    assert!(after < 0.25 * before, "{}", (after / before).sqrt());
}

/// What a meter does not show is not known: its chamber rests, and the other flow stays as it is.
#[test]
fn within_a_declared_dead_band_the_flow_is_missing() {
    let band_m3s = 2e-5;
    let rig = with_effect(Effect::FlowMeterDeadBandA, band_m3s);
    let mut correction = Correction::of(&rig).expect("an effect");
    let (mut shown, mut hidden) = (0, 0);
    for record in records(&[]) {
        let truth = record.sample.qa_m3s.expect("is measured");
        let is_hidden = truth.abs() < band_m3s;
        let mut read = record;
        read.sample.qa_m3s = Some(if is_hidden { 0.1 * truth } else { truth });
        let corrected = correction.correct(&read).sample;
        assert_eq!(corrected.qa_m3s, (!is_hidden).then_some(truth));
        assert_eq!(corrected.qb_m3s, record.sample.qb_m3s);
        *if is_hidden { &mut hidden } else { &mut shown } += 1;
    }
    assert!(shown > 200 && hidden > 200, "{shown} {hidden}");
}

#[test]
fn a_rig_that_cannot_be_is_refused() {
    let mut rig = Rig::paper();
    rig.cylinder.area_a_m2 = f64::NAN;
    let error = Replay::new(&rig).err().expect("no such rig").to_string();
    assert_eq!(error, "piston areas must be positive");
}

/// The saved form names its version first; one of before is told apart from rubbish.
#[test]
fn a_state_of_another_version_is_refused_by_name() {
    let stream = Stream::new(&Rig::paper(), crate::trace::BadRows::Skip).expect("the paper's rig");
    let saved = stream.save().expect("saves");
    assert!(Stream::restore(&saved).is_ok());
    let mut older = saved;
    let at = older.windows(8).position(|bytes| bytes == b"state/16").expect("names its version");
    older[at + 7] = b'5';
    assert_eq!(
        Stream::restore(&older).err().map(|error| error.to_string()).as_deref(),
        Some(
            "saved by another version (`pitchleak.state/15`, this one reads `pitchleak.state/16`): start the estimator anew"
        )
    );
}

/// What is held back is told later, with the time at which it was raised; another leak's alarm does not wait for it.
#[test]
fn an_alarm_of_a_leak_that_is_ruled_out_is_held_back() {
    let mut replay = Replay::new(&Rig::paper()).expect("the paper's rig");
    records(&[]).iter().for_each(|record| _ = replay.push(record));
    let raised = |fault, time_s| Alarm { time_s, fault, state: AlarmState::Raised };
    let (of_a, internal) = (raised(Leak::ExternalA, 1.0), raised(Leak::Internal, 1.5));
    replay.alarms.clear();
    replay.held_s = PerLeak { internal: Some(1.5), external_a: Some(1.0), external_b: None };
    let decision = replay.decision().expect("enough to weigh");
    assert!(decision.rules_out_alarm(Leak::ExternalA) && !decision.rules_out_alarm(Leak::Internal));
    replay.weighing.set(replay.end_s, Some(decision));
    replay.release(replay.end_s);
    assert_eq!((replay.alarms(), replay.held_s.external_a), ([internal].as_slice(), Some(1.0)));
    replay.weighing.set(replay.end_s, None);
    replay.release(replay.end_s);
    assert_eq!(replay.take_alarms(), [of_a, internal]);
    assert!(replay.alarms().is_empty());
}
