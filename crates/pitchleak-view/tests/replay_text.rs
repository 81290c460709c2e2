//! A replay's report as text: verdict first, then what backs it.

#![allow(clippy::unwrap_used)]

use pitchleak::core::{AlarmState, Estimate, Leak, PerLeak};
use pitchleak::report::{
    Alarm, Episode, EstimateEntry, Estimates, Leakage, ReplayReport, Spell, Status, TraceSummary, Verdict,
};
use pitchleak::rig::{EstimatorKind, Rig};
use pitchleak::times::{Clock, TimeFormat, Zone};
use pitchleak_view::{Palette, Text};

/// A minute in which the internal leak is seen and nothing is known of external B.
fn report(status: Status) -> ReplayReport {
    let entry = |value, std| EstimateEntry::new(Estimate { value, std }, EstimateEntry::COEFFICIENT_UNIT);
    let lpm = |mean_lpm, std| Leakage { mean_lpm, std_lpm: Some(std), net_mean_lpm: None, since: None };
    ReplayReport {
        schema: ReplayReport::SCHEMA,
        verdict: Verdict {
            status,
            faults: vec![Leak::Internal],
            probability: None,
            explanations: Vec::new(),
            text: "Oil passes the seal.".to_owned(),
            reasons: Vec::new(),
        },
        rig: "rig.toml".to_owned(),
        estimator: EstimatorKind::Rls,
        flow_meter_offsets: None,
        normalised_innovation: None,
        estimates: Estimates {
            internal_leak_coefficient: entry(1.2e-11, 2e-14),
            external_leak_a_coefficient: entry(-1e-14, 2e-14),
            external_leak_b_coefficient: entry(0.0, 3e-12).not_identifiable("pressure B hardly moves"),
            bulk_modulus: EstimateEntry::without_spread(0.9e9, EstimateEntry::BULK_MODULUS_UNIT),
        },
        leakage: PerLeak {
            internal: lpm(0.4785, 0.0011),
            external_a: lpm(-0.0004, 0.0011),
            external_b: lpm(0.0, 0.2),
        },
        hold: None,
        wiring: None,
        valve: None,
        changed_at_s: None,
        trend: PerLeak::default(),
        spells: Vec::new(),
        episodes: Vec::new(),
        trace: TraceSummary {
            path: "h02.csv.gz".to_owned(),
            samples: 6001,
            skipped: 0,
            begins: None,
            duration_s: 60.0,
            sample_rate_hz: Some(100.000_000_001),
            slowest_hz: None,
            is_out_of_order: false,
            gaps: 0,
            reading: None,
            warnings: Vec::new(),
        },
        alarms: vec![Alarm { time_s: 3.25, fault: Leak::Internal, state: AlarmState::Raised }],
        score: None,
    }
}

#[test]
fn text_puts_the_verdict_first() {
    let text = report(Status::Leak).to_text(&Palette::PLAIN);
    let expected = "\
LEAK  Oil passes the seal.

leak        L/min, 95 %             L/min/bar, 95 %
internal    0.4785 ± 0.0022         0.07200 ± 0.00024
external A  -0.0004 ± 0.0022        -0.00006 ± 0.00024
external B  –                       –                       not identifiable: pressure B hardly moves
oil         bulk modulus 0.9000 GPa

alarm raised at 3.25 s: internal leak

trace      h02.csv.gz: 6001 samples over 60.0 s at 100 Hz, 0 rows skipped, 0 gaps
rig        rig.toml
estimator  rls
";
    assert_eq!(text, expected);
    assert!(report(Status::Leak).to_text(&Palette::ANSI).starts_with("\x1b[1;31mLEAK\x1b[0m"));
}

/// Fourteen hours with these episodes.
fn day(episodes: Vec<Episode>) -> ReplayReport {
    let mut day = report(Status::Leak);
    day.trace.duration_s = 50_000.0;
    day.spells = Spell::of(&episodes, day.trace.duration_s, day.trace.duration_s);
    ReplayReport { episodes, ..day }
}

fn episode(from_s: f64, to_s: Option<f64>) -> Episode {
    Episode { fault: Leak::Internal, from_s, to_s, mean_lpm: 0.5, peak_lpm: 0.6 }
}

#[test]
fn a_long_trace_is_told_from_its_beginning_on_by_its_clock() {
    let berlin = TimeFormat { zone: Zone::by_name("+01:00"), ..TimeFormat::default() };
    let mut day = day(vec![episode(3600.0, Some(7260.0)), episode(40_000.0, None)]);
    day.trace.begins = Clock::new(1_763_676_631_000_000_000, &berlin);
    let text = day.to_text(&Palette::PLAIN);
    assert!(text.contains("leaks through the trace, which begins 2025-11-20 23:10:31 +01\n"), "{text}");
    assert!(text.contains("internal    21 Nov 00:10 to 21 Nov 01:11 "), "{text}");
    assert!(text.contains("internal    from 21 Nov 10:17 on "), "{text}");
    assert!(text.contains("50000.0 s (14 h)"), "{text}");
}

#[test]
fn a_long_trace_without_an_episode_says_so() {
    let text = day(Vec::new()).to_text(&Palette::PLAIN);
    assert!(text.contains("leaks through the trace\nno alarm at any time\n"), "{text}");
}

#[test]
fn a_doubt_without_a_rig_file_says_so() {
    let text =
        |status, rig: &str| ReplayReport { rig: rig.to_owned(), ..report(status) }.to_text(&Palette::PLAIN);
    assert!(text(Status::NotSure, Rig::PAPER_NAME).contains("also  no rig file was given"));
    assert!(!text(Status::NotSure, "rig.toml").contains("no rig file"));
    assert!(!text(Status::Sound, Rig::PAPER_NAME).contains("also"));
}
