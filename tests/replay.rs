//! Replay from text to report, on exact traces.

#![allow(clippy::unwrap_used)]

use std::fmt::Write;

use pitchleak::Rig;
use pitchleak::core::{Leak, PerLeak};
use pitchleak::replay::{ReplayError, replay};
use pitchleak::report::ReplayReport;
use pitchleak::trace::TraceReader;
use pitchleak_testkit::Motion;
use pitchleak_testkit::rig::PAPER;

const LEAKS: PerLeak<f64> = PerLeak { internal: 1e-11, external_a: 3e-12, external_b: 0.0 };

fn run(rig: &str, trace: String) -> ReplayReport {
    let rig = Rig::parse(rig, "test").unwrap();
    let stream = Box::new(std::io::Cursor::new(trace.into_bytes()));
    let mut reader = TraceReader::from_stream("test", stream, &rig).unwrap();
    replay(&mut reader, &rig, |_, _, _| Ok::<(), ReplayError>(())).unwrap()
}

/// A 30 s trace; `row` gives the cells of one instant.
fn trace(header: &str, row: impl Fn(f64, [f64; 5], [f64; 2]) -> Vec<f64>) -> String {
    let motion = Motion::wind_like(LEAKS);
    let mut text = String::from(header);
    for k in 0..3000 {
        let t = f64::from(k) * 0.01;
        let s = motion.sample(t);
        let leaks = [LEAKS.internal * s.load_pressure_pa(), LEAKS.external_a * s.pa_pa];
        let signals = [s.x_m, s.pa_pa, s.pb_pa, s.qa_m3s.unwrap(), s.qb_m3s.unwrap()];
        let cells: Vec<String> = row(t, signals, leaks).iter().map(|c| format!("{c:e}")).collect();
        write!(text, "\n{}", cells.join(",")).unwrap();
    }
    text
}

fn plain() -> String {
    trace("t_s,x_m,pa_pa,pb_pa,qa_m3s,qb_m3s,q_int_m3s,q_ext_a_m3s", |t, [x, pa, pb, qa, qb], [i, a]| {
        vec![t, x, pa, pb, qa, qb, i, a]
    })
}

fn coefficients(report: &ReplayReport) -> [f64; 3] {
    let leaks = report.estimates.leaks();
    [leaks.internal.value, leaks.external_a.value, leaks.external_b.value]
}

#[test]
fn finds_the_leaks_and_says_so() {
    let report = run(PAPER, plain());
    for (found, truth) in coefficients(&report).into_iter().zip([1e-11, 3e-12, 0.0]) {
        // Where nothing leaks, a little may seep all the same.
        assert!((found - truth).abs() < 2e-14, "{found} for {truth}");
    }
    assert_eq!(report.verdict.faults, [Leak::Internal, Leak::ExternalA]);
    let score = report.score.unwrap();
    let internal = score.internal.unwrap();
    assert!(internal.leakage_mean_error_percent < 0.5, "{internal:?}");
    assert!(internal.convergence_time_s.unwrap() < 2.0, "{internal:?}");
}

/// The same readings in people's units give the same estimates.
#[test]
fn units_do_not_matter() {
    let si = run(PAPER, plain());
    let practice = run(
        PAPER,
        trace("t_ms,x_mm,pa_bar,pb_kpa,qa_lpm,qb_lpm", |t, [x, pa, pb, qa, qb], _| {
            vec![t * 1e3, x * 1e3, pa / 1e5, pb / 1e3, qa * 6e4, qb * 6e4]
        }),
    );
    for (a, b) in coefficients(&si).into_iter().zip(coefficients(&practice)) {
        assert!((a - b).abs() < 1e-9 * 1e-11, "{a} and {b}");
    }
}

/// An effect that the rig file declares is taken out of the readings: a position sensor that reads 2 % too
/// much, a dead volume, and a leak of another law, which then counts as leak.
#[test]
fn declared_effects_are_corrected() {
    let turbulent = 2e-9_f64;
    let text = trace("t_s,x_m,pa_pa,pb_pa,qa_m3s,qb_m3s", |t, [x, pa, pb, qa, qb], _| {
        vec![t, 1.02 * x, pa, pb, qa + turbulent * pa.sqrt(), qb]
    });
    let blind = run(PAPER, text.clone());
    let effects = "[effects]\nposition_gain = 0.02\nexternal_leak_a_turbulent = 2e-9\n";
    let told = run(&format!("{PAPER}{effects}"), text);
    let error = |report: &ReplayReport| {
        let pairs = coefficients(report).into_iter().zip([1e-11, 3e-12, 0.0]);
        pairs.map(|(found, truth)| (found - truth).abs()).fold(0.0, f64::max)
    };
    assert!(error(&told) < 2e-14, "{:?}", coefficients(&told));
    assert!(error(&blind) > 1e-13, "{:?}", coefficients(&blind));
    let expected = 3e-12 * 5.2e6 * 6e4 + turbulent * 5.2e6_f64.sqrt() * 6e4;
    assert!(
        (told.leakage.external_a.mean_lpm / expected - 1.0).abs() < 0.05,
        "{:?}",
        told.leakage.external_a
    );
}

/// An effect that is a standard deviation larger than the file says throws the leaks off by as much as their
/// intervals then hold.
#[test]
fn uncertain_effects_widen_the_intervals() {
    let text = trace("t_s,x_m,pa_pa,pb_pa,qa_m3s,qb_m3s", |t, [x, pa, pb, qa, qb], _| {
        vec![t, x, pa, pb, qa + 1.5e-9 * pa.sqrt(), qb]
    });
    let effects = "[effects]\nexternal_leak_a_turbulent = { value = 1e-9, std = 0.5e-9 }\n";
    let report = run(&format!("{PAPER}{effects}"), text.clone());
    let certain = run(&format!("{PAPER}[effects]\nexternal_leak_a_turbulent = 1e-9\n"), text);
    let leak = |report: &ReplayReport| report.estimates.leaks().external_a.clone();
    let (wide, narrow) = (leak(&report), leak(&certain));
    let error = (wide.value - 3e-12).abs();
    let (wide, narrow) = (wide.std.unwrap(), narrow.std.unwrap());
    assert!(error > 3.0 * narrow, "the effect matters here: {error} with {narrow}");
    // Zeros of the meters, which nobody declared, take up some of the error.
    assert!((0.9..2.5).contains(&(wide / error)), "{wide} for {error}");
}

#[test]
fn the_papers_law_runs_and_is_scored() {
    let report = run(&format!("{PAPER}[estimator]\nkind = \"paper\"\n"), plain());
    assert!(coefficients(&report).iter().all(|c| c.is_finite()));
    assert!(report.estimates.internal_leak_coefficient.std.is_none());
    assert!(report.score.unwrap().internal.is_some());
}

/// Flows of a leak that opens within the trace are those since then: the pressures of before never drove it.
#[test]
fn a_leak_that_opens_counts_from_then_on() {
    let mut since = (0.0, 0.0);
    let motion = Motion::wind_like(LEAKS);
    let mut text = String::from("t_s,x_m,pa_pa,pb_pa,qa_m3s,qb_m3s");
    for k in 0..6000 {
        let t = f64::from(k) * 0.01;
        let mut s = motion.sample(t);
        if t < 30.0 {
            // The pump held P_A up before the hose burst.
            s.pa_pa += 5e6;
            let leak = LEAKS.internal + LEAKS.external_a;
            s.qa_m3s = s.qa_m3s.map(|q| q + leak * 5e6);
            s.qb_m3s = s.qb_m3s.map(|q| q - LEAKS.internal * 5e6);
        } else {
            s.qa_m3s = s.qa_m3s.map(|q| q + 2e-11 * s.pa_pa);
            since = (since.0 + 60e3 * (LEAKS.external_a + 2e-11) * s.pa_pa, since.1 + 1.0);
        }
        let signals = [t, s.x_m, s.pa_pa, s.pb_pa, s.qa_m3s.unwrap(), s.qb_m3s.unwrap()];
        let cells: Vec<String> = signals.iter().map(|c| format!("{c:e}")).collect();
        write!(text, "\n{}", cells.join(",")).unwrap();
    }
    let report = run(PAPER, text);
    assert!((30.0..32.0).contains(&report.changed_at_s.unwrap()), "{:?}", report.changed_at_s);
    let found = report.leakage.external_a.mean_lpm;
    assert!((found / (since.0 / since.1) - 1.0).abs() < 0.02, "{found} for {}", since.0 / since.1);
}
