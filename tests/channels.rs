//! Faults that a channel shows by itself: each is found where it is, and nothing is found on sound channels.

#![allow(clippy::unwrap_used)]

use pitchleak::Rig;
use pitchleak::channels::{ChannelFaultKind, ChannelMonitor};
use pitchleak::core::{PerLeak, Sample};
use pitchleak::trace::{Record, TraceReader};
use pitchleak_testkit::{Motion, hopsan, noisy, seeded, sensors_of};

const LEAKS: PerLeak<f64> = PerLeak { internal: 1e-11, external_a: 0.0, external_b: 0.0 };

fn rig(accuracy: f64) -> Rig {
    let mut rig = Rig::paper();
    rig.instruments = rig.instruments.with_accuracy(accuracy);
    rig
}

/// A minute of wind-like motion with sensors of this accuracy (3 σ, share of full scale); none: perfect ones.
fn readings(accuracy: Option<f64>, rate_hz: f64) -> Vec<Record> {
    let motion = Motion::wind_like(LEAKS);
    let mut random = seeded(1);
    let record = |k: u32| {
        let t_s = f64::from(k) / rate_hz;
        let clean = motion.sample(t_s);
        let sample = accuracy.map_or(clean, |accuracy| noisy(&clean, &sensors_of(accuracy), &mut random));
        Record { t_s, dt_s: if k == 0 { 0.0 } else { 1.0 / rate_hz }, sample, ..Record::default() }
    };
    (0..(60.0 * rate_hz) as u32).map(record).collect()
}

type Reading = fn(&mut Sample<f64>) -> &mut f64;

const CHANNELS: [(&str, Reading); 5] = [
    ("x", |s| &mut s.x_m),
    ("pa", |s| &mut s.pa_pa),
    ("pb", |s| &mut s.pb_pa),
    ("qa", |s| s.qa_m3s.as_mut().unwrap()),
    ("qb", |s| s.qb_m3s.as_mut().unwrap()),
];

/// The readings of one channel, changed by what `change` makes of place, time, reading and the reading before.
fn changed(records: &[Record], of: Reading, change: impl Fn(usize, f64, f64, f64) -> f64) -> Vec<Record> {
    let mut out = records.to_vec();
    let mut before = f64::NAN;
    for (at, record) in out.iter_mut().enumerate() {
        let t_s = record.t_s;
        let reading = of(&mut record.sample);
        *reading = change(at, t_s, *reading, before);
        before = *reading;
    }
    out
}

fn found(records: &[Record], rig: &Rig) -> Vec<(&'static str, ChannelFaultKind, f64, f64)> {
    let mut monitor = ChannelMonitor::default();
    records.iter().for_each(|record| monitor.add(record));
    monitor
        .faults(rig)
        .into_iter()
        .map(|fault| (fault.channel.name(), fault.kind, fault.from_s, fault.to_s))
        .collect()
}

#[test]
fn each_fault_is_found_on_its_channel_alone() {
    for accuracy in [0.001, 0.003, 0.01] {
        let (rig, sound) = (rig(accuracy), readings(Some(accuracy), 100.0));
        for (name, of) in CHANNELS {
            let mut values: Vec<f64> = sound.iter().map(|r| *of(&mut r.sample.clone())).collect();
            let middle = values[2000];
            values.sort_by(f64::total_cmp);
            let (low, high) = (values[600], values[5400]);
            let quantum = 10.0 * accuracy / 3.0
                * match name {
                    "x" => 0.2,
                    "pa" | "pb" => 16e6,
                    _ => 20.0 / 60e3,
                };
            let one = |kind, from_s: f64, to_s: f64, wrong: Vec<Record>| {
                let faults = found(&wrong, &rig);
                let near = |(channel, k, a, b): &(&str, _, f64, f64)| {
                    *channel == name && *k == kind && (a - from_s).abs() < 0.5 && (b - to_s).abs() < 0.5
                };
                assert!(
                    faults.len() == 1 && faults.iter().all(near),
                    "{name} {kind:?} {accuracy}: {faults:?}"
                );
            };
            one(ChannelFaultKind::Dead, 0.0, 60.0, changed(&sound, of, |_, _, _, _| 0.0));
            one(ChannelFaultKind::Dead, 0.0, 60.0, changed(&sound, of, |_, _, _, _| middle));
            let half = |_, t_s: f64, now: f64, before: f64| if t_s < 30.0 { now } else { before };
            one(ChannelFaultKind::Stuck, 30.0, 60.0, changed(&sound, of, half));
            let while_ago = |_, t_s: f64, now, before| if (10.0..13.0).contains(&t_s) { before } else { now };
            one(ChannelFaultKind::Stuck, 10.0, 13.0, changed(&sound, of, while_ago));
            for times in [2, 5, 10] {
                let held = |at: usize, _, now, before| if at.is_multiple_of(times) { now } else { before };
                one(ChannelFaultKind::Held, 0.0, 60.0, changed(&sound, of, held));
            }
            one(
                ChannelFaultKind::Coarse,
                0.0,
                60.0,
                changed(&sound, of, |_, _, now, _| (now / quantum).round() * quantum),
            );
            for clipped in [
                changed(&sound, of, |_, _, now, _| now.min(high)),
                changed(&sound, of, |_, _, now, _| now.max(low)),
            ] {
                let faults = found(&clipped, &rig);
                let right = |fault: &(&str, ChannelFaultKind, f64, f64)| {
                    fault.0 == name && fault.1 == ChannelFaultKind::Clipped
                };
                assert!(
                    faults.len() == 1 && faults.iter().all(right),
                    "{name} clipped {accuracy}: {faults:?}"
                );
            }
        }
    }
}

/// In m³/s under a name of L/min a flow is 60,000 times too small: its meter as good as rests, while the piston moves.
#[test]
fn a_flow_that_never_leaves_a_part_of_its_noise_is_dead() {
    for accuracy in [0.001, 0.003, 0.01] {
        let wrong = changed(&readings(Some(accuracy), 100.0), CHANNELS[3].1, |_, _, now, _| now / 6e4);
        let faults = found(&wrong, &rig(accuracy));
        assert_eq!(faults.len(), 1, "{accuracy}: {faults:?}");
        assert_eq!((faults[0].0, faults[0].1), (CHANNELS[3].0, ChannelFaultKind::Dead));
    }
}

/// A standing piston's pressure follows its load; where that stands still, too, a coarse sensor may read one value.
#[test]
fn a_pressure_that_stands_still_under_a_changing_load_is_dead() {
    let (rig, motion) = (rig(0.003), Motion::wind_like(LEAKS));
    let at_rest = |load: f64| {
        let mut random = seeded(2);
        let record = |k: u32| {
            let t_s = 0.01 * f64::from(k);
            let pb_pa = 4e6 + load * (motion.pressure_b_pa.value(t_s) - 4e6);
            let sample =
                Sample { x_m: 0.1, pb_pa, qa_m3s: Some(0.0), qb_m3s: Some(0.0), ..motion.sample(0.0) };
            let sample = Sample { pa_pa: 5e6, ..noisy(&sample, &sensors_of(0.003), &mut random) };
            Record { t_s, dt_s: if k == 0 { 0.0 } else { 0.01 }, sample, ..Record::default() }
        };
        found(&(0..6000).map(record).collect::<Vec<_>>(), &rig)
    };
    let dead: Vec<_> = at_rest(1.0).iter().map(|(channel, kind, ..)| (*channel, *kind)).collect();
    assert_eq!(dead, [("pa", ChannelFaultKind::Dead)]);
    assert_eq!(at_rest(0.0), []);
}

/// Of a long trace pieces are looked at, and each begins a new run: none is counted that was not read.
#[test]
fn a_sensor_that_holds_its_readings_is_found_in_long_traces_too() {
    let mut sound = readings(Some(0.01), 1000.0);
    sound.truncate(50_000);
    let held = |at: usize, _, now, before| if at.is_multiple_of(4) { now } else { before };
    for (name, of) in CHANNELS {
        let faults = found(&changed(&sound, of, held), &rig(0.01));
        let right =
            |fault: &(&str, ChannelFaultKind, f64, f64)| (fault.0, fault.1) == (name, ChannelFaultKind::Held);
        assert!(faults.len() == 1 && faults.iter().all(right), "{name}: {faults:?}");
    }
}

/// Perfect sensors, whatever is declared; a piston at rest; slow sampling; rows lost, gaps, spikes; digits of a file.
#[test]
fn sound_channels_are_silent() {
    for accuracy in [0.001, 0.003, 0.01] {
        let rig = rig(accuracy);
        for (name, noise) in
            [("noisy", Some(accuracy)), ("perfect", None), ("better than declared", Some(accuracy / 5.0))]
        {
            for rate_hz in [20.0, 100.0] {
                let sound = readings(noise, rate_hz);
                let silent = |what: &str, records: Vec<Record>| {
                    let faults = found(&records, &rig);
                    assert!(faults.is_empty(), "{name}, {what}, {accuracy}, {rate_hz} Hz: {faults:?}");
                };
                silent("as it is", sound.clone());
                let rows = |keep: fn(usize) -> bool| {
                    sound.iter().enumerate().filter(|(at, _)| keep(*at)).map(|(_, r)| *r).collect()
                };
                silent("rows lost", rows(|at| at % 7 != 3));
                silent("a gap", rows(|at| !(400..800).contains(&at)));
                silent("half", rows(|at| at < 600));
                for (_, of) in CHANNELS {
                    silent(
                        "spikes",
                        changed(&sound, of, |at, _, now, _| if at % 301 == 300 { 1.5 * now } else { now }),
                    );
                }
                // A third of the minute the piston rests: all readings stay as they were, but for the noise.
                let rest: Vec<_> = sound
                    .iter()
                    .map(|r| {
                        if r.t_s < 40.0 { *r } else { Record { sample: sound[sound.len() / 2].sample, ..*r } }
                    })
                    .collect();
                if noise.is_none() {
                    silent("a rest", rest);
                }
                let digits = |value: f64, digits: f64| (value * digits).round() / digits;
                let written = |r: &Record| {
                    let s = &r.sample;
                    let flow = |q: Option<f64>| q.map(|q| digits(q * 60e3, 100.0) / 60e3);
                    let sample = Sample {
                        x_m: digits(s.x_m, 1e5),
                        pa_pa: digits(s.pa_pa, 1e-3),
                        pb_pa: digits(s.pb_pa, 1e-3),
                        qa_m3s: flow(s.qa_m3s),
                        qb_m3s: flow(s.qb_m3s),
                        ..*s
                    };
                    Record { sample, ..*r }
                };
                silent("few digits", sound.iter().map(written).collect());
            }
        }
    }
}

#[test]
fn recorded_traces_are_silent() {
    let recorded =
        ["healthy", "internal", "external_a", "both"].map(|name| format!("data/traces/{name}.csv.gz"));
    let simulated = ["h02", "h06", "u04", "u07"].map(|name| hopsan::path(name).display().to_string());
    for path in recorded.into_iter().chain(simulated) {
        for accuracy in [0.001, 0.01] {
            let rig = rig(accuracy);
            let mut reader = TraceReader::open(&path, &rig).unwrap();
            let (mut record, mut monitor) = (Record::default(), ChannelMonitor::default());
            while reader.next_record(&mut record).unwrap() {
                monitor.add(&record);
            }
            assert_eq!(monitor.faults(&rig), [], "{path}");
        }
    }
}

/// A monitor that is saved and restored goes on as if nothing had been.
#[test]
fn the_state_of_a_monitor_can_be_kept() {
    let records = changed(
        &readings(Some(0.003), 100.0),
        CHANNELS[1].1,
        |_, t, now, before| if t < 30.0 { now } else { before },
    );
    let (rig, mut whole, mut parted) = (rig(0.003), ChannelMonitor::default(), ChannelMonitor::default());
    for (at, record) in records.iter().enumerate() {
        whole.add(record);
        parted.add(record);
        if at == 3500 {
            let mut bytes = Vec::new();
            ciborium::into_writer(&parted, &mut bytes).unwrap();
            parted = ciborium::from_reader(bytes.as_slice()).unwrap();
        }
    }
    assert_eq!(whole.faults(&rig), parted.faults(&rig));
}

/// What the monitor costs a sample; run it by hand: `cargo test --release --test channels -- --ignored --nocapture`.
#[test]
#[ignore = "a measurement"]
fn cost_per_sample() {
    let records = readings(Some(0.003), 100.0);
    let mut monitor = ChannelMonitor::default();
    let begin = std::time::Instant::now();
    for _ in 0..500 {
        records.iter().for_each(|record| monitor.add(record));
    }
    let each = begin.elapsed().as_secs_f64() / (500.0 * records.len() as f64);
    println!(
        "{:.1} ns per sample, {} bytes; {:?}",
        1e9 * each,
        size_of::<ChannelMonitor>(),
        monitor.faults(&rig(0.003)).len()
    );
}
