use super::*;
use crate::rig::Rig;
use crate::simulate::{Reading, Truth};
use pitchleak_core::Sample;
use proptest::prelude::*;

fn fault(text: &str) -> SensorFault {
    text.parse().unwrap_or_else(|error| panic!("{text}: {error}"))
}

fn honest(t_s: f64) -> Reading {
    let wave = |period_s: f64| libm::sin(t_s / period_s);
    let sample = Sample {
        x_m: 0.1 + 0.05 * wave(2.0),
        pa_pa: 4e6 + 1e6 * wave(1.3),
        pb_pa: 3e6 + 5e5 * wave(0.7),
        qa_m3s: Some(1e-4 * wave(0.9)),
        qb_m3s: Some(-8e-5 * wave(1.1)),
        force_n: Some(2e3 * wave(1.7)),
    };
    Reading::at(&Truth { t_s, temp_k: Some(313.15), ..Truth::default() }, &sample, None)
}

fn value(reading: &Reading, channel: Signal) -> f64 {
    reading.get(channel).unwrap_or(f64::NAN)
}

/// What is recorded of ten seconds at 100 Hz; none where a row is lost.
fn recorded(faults: &[&str], seed: u64) -> Vec<(Reading, Option<Reading>)> {
    let rig = Rig::paper();
    let faults: Vec<_> = faults.iter().map(|text| fault(text)).collect();
    let mut faults = SensorFaults::new(&faults, &rig.instruments, rig.cylinder.stroke_m, seed);
    (0..1000).map(|k| honest(0.01 * f64::from(k))).map(|reading| (reading, faults.show(&reading))).collect()
}

/// Each row's true and shown value of one channel.
fn channel(fault: &str, channel: Signal) -> Vec<(f64, f64, f64)> {
    let of = |reading: &Reading| value(reading, channel);
    let rows = recorded(&[fault], 1).into_iter();
    rows.map(|(honest, shown)| {
        (value(&honest, Signal::Time), of(&honest), shown.map_or(f64::NAN, |shown| of(&shown)))
    })
    .collect()
}

fn near(one: f64, other: f64) -> bool {
    (one - other).abs() <= 1e-9 * one.abs().max(other.abs())
}

#[test]
fn each_way_to_lie_shows_what_it_says() {
    type Law = fn(f64, f64) -> f64;
    let laws: [(&str, Signal, Law); 16] = [
        ("qa dead", Signal::FlowA, |_, _| 0.0),
        ("qa stuck", Signal::FlowA, |_, _| 0.0),
        ("qb reversed", Signal::FlowB, |_, q| -q),
        ("qb absolute", Signal::FlowB, |_, q| q.abs()),
        ("x other_end", Signal::Position, |_, x| 0.2 - x),
        ("pa offset 10 bar", Signal::PressureA, |_, p| p + 1e6),
        ("pb offset -1 %", Signal::PressureB, |_, p| p - 16e4),
        ("qa drift 0.6 L/min/h", Signal::FlowA, |t, q| q + 1e-5 * t / 3600.0),
        ("qa drift 1 %/h", Signal::FlowA, |t, q| q + 20.0 / 60e3 * 0.01 * t / 3600.0),
        ("qa gain 20 %", Signal::FlowA, |_, q| 1.2 * q),
        ("force times -10", Signal::Force, |_, f| -10.0 * f),
        ("pa in psi", Signal::PressureA, |_, p| p / 6_894.757_293_168 * 1e5),
        ("qa in m³/h", Signal::FlowA, |_, q| 0.06 * q),
        ("qa in gal/min", Signal::FlowA, |_, q| q / 3.785_411_784),
        ("x in cm", Signal::Position, |_, x| 0.1 * x),
        ("qa clipped 3 L/min", Signal::FlowA, |_, q| q.clamp(-5e-5, 5e-5)),
    ];
    for (text, signal, law) in laws {
        for (t_s, value, shown) in channel(text, signal) {
            assert!(near(shown, law(t_s, value)) || value == 0.0, "{text}: {shown} at {t_s} s");
        }
    }
    assert!(channel("t in ms", Signal::Time).iter().all(|(t, _, shown)| near(1e3 * t, *shown)));
    assert!(channel("qa missing", Signal::FlowA).iter().all(|(.., shown)| shown.is_nan()));
}

#[test]
fn time_is_kept_by_what_is_stuck_held_or_late() {
    let pa_pa = |t_s: f64| value(&honest(t_s), Signal::PressureA);
    for (t_s, value, shown) in channel("pa stuck 2 s..4 s", Signal::PressureA) {
        let expected = if (1.995..3.995).contains(&t_s) { pa_pa(2.0) } else { value };
        assert!(near(shown, expected), "stuck at {t_s} s");
    }
    for (t_s, _, shown) in channel("pa held 200 ms", Signal::PressureA) {
        let taken = 0.2 * (t_s / 0.2 + 1e-6).floor();
        assert!(near(shown, pa_pa(taken)), "held at {t_s} s");
    }
    for (t_s, _, shown) in channel("pa late 100 ms", Signal::PressureA) {
        assert!((shown - pa_pa((t_s - 0.1).max(0.0))).abs() < 1.0, "late at {t_s} s");
    }
}

#[test]
fn chance_loses_rows_and_makes_spikes_as_often_as_it_should_and_by_the_seed() {
    let lost =
        |seed| recorded(&["rows lost 20 %"], seed).iter().map(|(_, s)| s.is_none()).collect::<Vec<_>>();
    let count = lost(1).iter().filter(|lost| **lost).count();
    assert!((150..250).contains(&count), "{count} of 1000");
    assert!(lost(1) == lost(1) && lost(1) != lost(2));
    let gap = recorded(&["rows lost 2 s..5 s"], 1);
    let is_lost = |honest: &Reading| (1.995..4.995).contains(&value(honest, Signal::Time));
    assert!(gap.iter().all(|(honest, shown)| shown.is_none() == is_lost(honest)));
    let spikes = channel("pa spikes 10 %", Signal::PressureA);
    let count = spikes.iter().filter(|(_, value, shown)| !near(*value, *shown)).count();
    assert!((60..140).contains(&count), "{count} of 1000");
}

#[test]
fn mistakes_pass_on_what_the_one_before_left() {
    for (honest, shown) in recorded(&["swap qa qb", "qa gain 50 %"], 1) {
        let shown = shown.expect("no row is lost");
        let [of_honest, of_shown] = [honest, shown].map(|row| {
            [Signal::FlowA, Signal::FlowB, Signal::Position, Signal::PressureA].map(|one| row.get(one))
        });
        let [qa, qb, x, pa] = of_honest;
        assert_eq!(of_shown, [qb.map(|q| 1.5 * q), qa, x, pa]);
    }
}

#[test]
fn what_no_sensor_does_is_refused_with_what_it_can() {
    for (text, words) in [
        ("qa", "CHANNEL WAY"),
        ("qc dead", "channels t, x, pa, pb, qa, qb, force, temp"),
        ("qa asleep", "spikes 0.1 %"),
        ("qa dead 3 bar", "ways to lie"),
        ("qa offset 3 bar", "L/min"),
        ("qa offset", "not a quantity"),
        ("qa drift 1 %", "drift 1 %"),
        ("qa in bar", "unit `bar`"),
        ("qa held 0 s", "more than zero"),
        ("qa stuck 4 s..2 s", "ends before"),
        ("qa other_end", "cannot be other_end"),
        ("t stuck", "`t` cannot be stuck"),
        ("pa missing", "cannot be missing"),
        ("swap qa pa", "one kind"),
        ("rows shuffled", "rows lost 2 %"),
        ("rows lost", "not a quantity"),
    ] {
        let message = text.parse::<SensorFault>().expect_err(text).to_string();
        assert!(message.contains(words), "{text}: {message}");
    }
}

/// Ways that undo themselves, or change nothing when done again.
const INVOLUTIONS: [&str; 5] = ["qa reversed", "x other_end", "swap qa qb", "swap pa pb", "pa times -1"];
const PROJECTIONS: [&str; 4] = ["qa dead", "qa absolute", "qa clipped 2 L/min", "qa missing"];

proptest! {
    #[test]
    fn a_mistake_done_twice_is_undone_or_the_same(seed in 0..9u64) {
        for text in INVOLUTIONS {
            for (honest, shown) in recorded(&[text, text], seed) {
                let shown = shown.expect("no row is lost");
                prop_assert!((value(&honest, Signal::Position) - value(&shown, Signal::Position)).abs() < 1e-15, "{}", text);
                let same = |channel| honest.get(channel) == shown.get(channel);
                prop_assert!(Signal::ALL.into_iter().filter(|c| *c != Signal::Position).all(same), "{}", text);
            }
        }
        for text in PROJECTIONS {
            let (once, twice) = (recorded(&[text], seed), recorded(&[text, text], seed));
            prop_assert!(once.iter().zip(&twice).all(|(a, b)| a.1 == b.1), "{}", text);
        }
    }

    #[test]
    fn outside_its_time_a_mistake_shows_the_truth(from in 0.0..9.0f64, length in 0.1..9.0f64, which in 0..8usize) {
        let way = ["qa dead", "qa stuck", "pa late 50 ms", "pa held 90 ms", "swap pa pb", "x other_end",
                   "qb offset 1 L/min", "rows lost 50 %"][which];
        let to = from + length;
        for (honest, shown) in recorded(&[&format!("{way} @ {from} s..{to} s")], 1) {
            let t_s = value(&honest, Signal::Time);
            prop_assert!((from..to).contains(&(t_s + 1e-9)) || shown == Some(honest));
        }
    }

    #[test]
    fn any_text_is_a_mistake_or_an_error(text in "(swap|rows|qa|pa|x|t)? ?.{0,30}") {
        let _ = text.parse::<SensorFault>();
    }
}
