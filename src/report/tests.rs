use super::*;
use crate::channels::{ChannelFault, ChannelFaultKind};
use crate::rig::Rig;
use crate::times::{Clock, TimeFormat, Zone};
use crate::wiring::{Orifice, SingleZero, Wiring, ZeroCheck};

fn entry(value: f64, std: f64) -> EstimateEntry {
    EstimateEntry::new(Estimate { value, std }, EstimateEntry::COEFFICIENT_UNIT)
}

const SOUND: Misfit = Misfit {
    balance: 1.0,
    balances: 240,
    worst_window: 1.2,
    position: 1.0,
    worst_position: 1.1,
    restarts: 0,
    since_s: f64::NEG_INFINITY,
    unexplained_s: None,
};

/// What a test changes of a minute's findings.
struct Found {
    active: PerLeak<bool>,
    leakage: PerLeak<Leakage>,
    estimates: Estimates,
    trends: PerLeak<Option<LeakTrend>>,
    episodes: Vec<Episode>,
    trace: TraceSummary,
    misfit: Option<Misfit>,
    restarts: u64,
    changed_at_s: Option<f64>,
    channels: Vec<ChannelFault>,
    earlier_channels: Vec<ChannelFault>,
    suspicions: Suspicions,
}

impl Found {
    fn verdict(&self) -> Verdict {
        Verdict::of(&Findings {
            active: self.active,
            leakage: &self.leakage,
            estimates: &self.estimates,
            trends: &self.trends,
            episodes: &self.episodes,
            threshold_lpm: PerLeak { internal: 0.1, external_a: 0.1, external_b: 0.1 },
            meters_lpm: [20.0; 2],
            fluid: Rig::paper().fluid,
            trace: &self.trace,
            end_s: 60.0,
            misfit: self.misfit.map(|misfit| Misfit { restarts: self.restarts, ..misfit }),
            restarts_in_all: self.restarts,
            changed_at_s: self.changed_at_s,
            channels: &self.channels,
            earlier_channels: &self.earlier_channels,
            suspicions: &self.suspicions,
        })
    }

    fn report(self) -> ReplayReport {
        ReplayReport {
            schema: ReplayReport::SCHEMA,
            verdict: self.verdict(),
            rig: "rig.toml".to_owned(),
            estimator: EstimatorKind::Rls,
            flow_meter_offsets: None,
            normalised_innovation: None,
            estimates: self.estimates,
            leakage: self.leakage,
            hold: None,
            changed_at_s: self.changed_at_s,
            trend: self.trends,
            spells: Spell::of(&self.episodes, self.trace.duration_s, 60.0),
            episodes: self.episodes,
            trace: self.trace,
            alarms: vec![Alarm { time_s: 3.25, fault: Leak::Internal, state: AlarmState::Raised }],
            score: None,
        }
    }

    /// Status and ids of the reasons.
    fn judged(&self) -> (Status, Vec<&'static str>) {
        let verdict = self.verdict();
        (verdict.status, verdict.reasons.iter().map(|reason| reason.id.name()).collect())
    }
}

fn found(active: PerLeak<bool>) -> Found {
    let estimates = Estimates {
        internal_leak_coefficient: entry(1.2e-11, 2e-14),
        external_leak_a_coefficient: entry(-1e-14, 2e-14),
        external_leak_b_coefficient: entry(0.0, 3e-12).not_identifiable("pressure B hardly moves"),
        bulk_modulus: EstimateEntry::without_spread(0.9e9, EstimateEntry::BULK_MODULUS_UNIT),
    };
    let lpm = |mean_lpm, std| Leakage { mean_lpm, std_lpm: Some(std), net_mean_lpm: None };
    let leakage = PerLeak {
        internal: lpm(0.4785, 0.0011),
        external_a: lpm(-0.0004, 0.0011),
        external_b: lpm(0.0, 0.2),
    };
    let trace = TraceSummary {
        path: "h02.csv.gz".to_owned(),
        samples: 6001,
        skipped: 0,
        begins: None,
        duration_s: 60.0,
        sample_rate_hz: Some(100.000_000_001),
        gaps: 0,
        reading: None,
        warnings: Vec::new(),
    };
    Found {
        active,
        leakage,
        estimates,
        trends: PerLeak::default(),
        episodes: Vec::new(),
        trace,
        misfit: Some(SOUND),
        restarts: 0,
        changed_at_s: None,
        channels: Vec::new(),
        earlier_channels: Vec::new(),
        suspicions: Suspicions::default(),
    }
}

fn report(active: PerLeak<bool>) -> ReplayReport {
    found(active).report()
}

/// All leaks known, none above its threshold.
fn sound() -> Found {
    let mut found = found(PerLeak::default());
    found.leakage.internal.mean_lpm = 0.01;
    found.leakage.external_b.std_lpm = Some(0.01);
    found.estimates.external_leak_b_coefficient = entry(0.0, 3e-14);
    found
}

const INTERNAL: PerLeak<bool> = PerLeak { internal: true, external_a: false, external_b: false };

#[test]
fn no_alarm_is_not_sound_where_the_trace_cannot_tell() {
    let mut found = found(PerLeak::default());
    found.leakage.internal.mean_lpm = 0.01;
    assert_eq!(found.judged(), (Status::NotSure, vec!["not_identifiable"]));
    let text = found.verdict().text;
    assert!(text.starts_with("This trace cannot tell about external B leaks."), "{text}");
    assert!(text.contains("No internal or external A leak above 0.10 L/min."), "{text}");
}

#[test]
fn sound_is_said_where_every_upper_bound_is_below_the_threshold() {
    assert_eq!(sound().judged(), (Status::Sound, vec![]));
    let mut close = sound();
    close.leakage.internal = Leakage { mean_lpm: 0.06, std_lpm: Some(0.03), net_mean_lpm: None };
    assert_eq!(close.judged(), (Status::NotSure, vec!["undecided"]));
    let text = close.verdict().text;
    assert!(text.contains("Internal leak of 0.060 ± 0.059 L/min: may be above 0.10 L/min or not"), "{text}");
    assert!(!text.contains("No internal"), "{text}");
}

#[test]
fn a_negative_leak_is_evidence_against_the_model_where_it_is_as_large_as_leaks_that_matter() {
    let mut negative = found(INTERNAL);
    negative.leakage.external_a.mean_lpm = -0.2;
    assert_eq!(negative.judged(), (Status::Doubtful, vec!["negative_leak"]));
    let text = negative.verdict().text;
    assert!(text.starts_with("The external A leak comes out negative"), "{text}");
    assert!(text.contains("internal leak of 0.4785"), "{text}");
    let mut little = found(INTERNAL);
    little.leakage.external_a.mean_lpm = -0.02;
    assert_eq!(little.judged(), (Status::Leak, vec![]));
}

#[test]
fn apparent_leaks_are_told_one_by_one() {
    let text = |active| {
        let misfit = Some(Misfit { balance: 9.0, ..SOUND });
        Found { misfit, ..found(active) }.verdict().text
    };
    let one = text(INTERNAL);
    assert!(
        one.contains("Until then an apparent internal leak of 0.4785 ± 0.0022 L/min stays in doubt."),
        "{one}"
    );
    let two = text(PerLeak { external_b: true, ..INTERNAL });
    let expected =
        "Until then these apparent leaks stay in doubt: internal of 0.4785 ± 0.0022 L/min, external B.";
    assert!(two.contains(expected), "{two}");
}

#[test]
fn a_misfit_anywhere_in_the_trace_is_a_doubt() {
    for misfit in [
        Misfit { balance: 3.0, ..SOUND },
        Misfit { worst_window: 6.0, ..SOUND },
        Misfit { worst_position: 4.0, ..SOUND },
    ] {
        let found = Found { misfit: Some(misfit), ..found(INTERNAL) };
        assert_eq!(found.judged(), (Status::Doubtful, vec!["model_does_not_fit"]), "{misfit:?}");
    }
    let short = Misfit { balance: 3.0, balances: 8, ..SOUND };
    assert_eq!(Found { misfit: Some(short), ..found(INTERNAL) }.judged().0, Status::Leak);
}

#[test]
fn estimates_that_begin_anew_again_and_again_are_a_doubt() {
    let restless = Found { restarts: 5, changed_at_s: Some(50.0), ..found(INTERNAL) };
    assert_eq!(restless.judged(), (Status::Doubtful, vec!["keeps_changing"]));
    assert!(restless.verdict().text.contains("changed at once 5 times, last at 50.00 s"));
    let once = Found { restarts: 1, changed_at_s: Some(50.0), ..found(INTERNAL) };
    assert_eq!(once.judged(), (Status::Leak, vec![]));
    assert!(once.verdict().text.contains("The leaks changed at once at 50.00 s"));
}

#[test]
fn leaks_that_come_and_go_by_turns_are_a_doubt_where_the_estimates_begin_anew() {
    let of = |fault, from_s| Episode { fault, ..episode(from_s, Some(from_s + 5.0)) };
    let by_turns = vec![of(Leak::ExternalA, 20.0), of(Leak::ExternalB, 28.0), of(Leak::ExternalB, 40.0)];
    let restless =
        |restarts, episodes| Found { restarts, changed_at_s: Some(50.0), episodes, ..found(INTERNAL) };
    assert_eq!(restless(5, by_turns.clone()).judged(), (Status::Doubtful, vec!["keeps_changing"]));
    assert_eq!(restless(2, by_turns).judged().0, Status::Leak);
    let one = vec![of(Leak::ExternalB, 20.0), of(Leak::ExternalB, 40.0)];
    assert_eq!(restless(5, one).judged().0, Status::Leak);
}

#[test]
fn an_orifice_answers_what_the_law_of_the_leak_leaves_open_and_nothing_else() {
    let mut leaking =
        Found { misfit: Some(Misfit { balance: 9.0, ..SOUND }), restarts: 7, ..found(INTERNAL) };
    leaking.changed_at_s = Some(50.0);
    leaking.episodes = vec![Episode { fault: Leak::ExternalA, ..episode(2.0, Some(39.0)) }];
    leaking.restarts = 9;
    assert_eq!(leaking.judged(), (Status::Doubtful, vec!["keeps_changing", "model_does_not_fit"]));
    let (sizes_m3s, net_m3s) = (PerLeak::default(), PerLeak::default());
    leaking.suspicions.orifice = Some(Orifice { before: 5.0, after: 1.0, sizes_m3s, net_m3s, zeros: None });
    assert_eq!(leaking.judged(), (Status::Leak, vec![]));
    let text = leaking.verdict().text;
    assert!(text.contains("It leaks as through an orifice, by the root of the pressure"), "{text}");
    assert!(text.contains("with that law the residual falls from 5.0 to 1.0 times the noise."), "{text}");
    assert!(!text.contains("Earlier"), "{text}");
    let value = Estimate { value: 20e9, std: 1e9 };
    leaking.estimates.bulk_modulus = EstimateEntry::new(value, EstimateEntry::BULK_MODULUS_UNIT);
    assert_eq!(leaking.judged(), (Status::Doubtful, vec!["bulk_modulus_impossible"]));
}

#[test]
fn a_bulk_modulus_that_no_oil_has_is_a_doubt() {
    let mut stiff = found(INTERNAL);
    let value = Estimate { value: 20e9, std: 1e9 };
    stiff.estimates.bulk_modulus = EstimateEntry::new(value, EstimateEntry::BULK_MODULUS_UNIT);
    assert_eq!(stiff.judged(), (Status::Doubtful, vec!["bulk_modulus_impossible"]));
}

#[test]
fn channels_come_before_wiring_and_that_before_what_follows_from_it() {
    let stuck = ChannelFault {
        channel: "pa",
        kind: ChannelFaultKind::Stuck,
        from_s: 10.0,
        to_s: 60.0,
        text: "pa reads 50 bar from 10 s to 60 s".to_owned(),
        suggestion: "check the sensor",
    };
    let wiring = Wiring {
        suggestion: "with qa and qb exchanged the residual falls from 29 to 1.0 times the noise".to_owned(),
        residual_before: Some(29.0),
        residual_after: Some(1.0),
        columns: vec!["qa = \"qb_lpm\"".to_owned()],
        alternatives: Vec::new(),
    };
    let misfit = Some(Misfit { balance: 9.0, ..SOUND });
    let doubtful = Found {
        channels: vec![stuck],
        suspicions: Suspicions { wiring: Some(wiring), ..Suspicions::default() },
        misfit,
        ..found(INTERNAL)
    };
    assert_eq!(doubtful.judged().1, ["channel_stuck", "wiring", "model_does_not_fit"]);
    let text = doubtful.verdict().text;
    assert!(text.starts_with("Pa reads 50 bar from 10 s to 60 s. Check the sensor."), "{text}");
    let wiring = &doubtful.verdict().reasons[1];
    assert!(
        wiring.suggestion.as_ref().is_some_and(|mend| mend.contains("[columns] qa = \"qb_lpm\"")),
        "{wiring:?}"
    );
}

#[test]
fn a_leak_that_a_zero_explains_as_well_is_in_doubt() {
    let none = Estimate { value: 0.0, std: 1e-8 };
    let off = Estimate { value: 0.2 / LPM_PER_M3S, std: 1e-8 };
    let zeros = |for_leak: f64| ZeroCheck {
        for_leak: PerLeak { internal: for_leak, external_a: 0.0, external_b: 0.0 },
        for_zeros: 0.0,
        offsets_m3s: [none; 2],
        offsets_without_m3s: PerLeak::from_fn(|_| [off, none]),
        leaks_m3spa: PerLeak::default(),
        single: [None; 2],
        duration_s: 60.0,
    };
    let against = |zeros| Found {
        suspicions: Suspicions { zeros: Some(zeros), ..Suspicions::default() },
        ..found(INTERNAL)
    };
    let held = |for_leak| against(zeros(for_leak));
    assert_eq!(held(30.0).judged(), (Status::Leak, vec![]));
    assert_eq!(held(3.0).judged(), (Status::Doubtful, vec!["offset_or_leak"]));
    let text = held(3.0).verdict().text;
    assert!(text.contains("(qa by 0.2000 ± 0.0012 L/min) explain this trace nearly as well"), "{text}");
    // Beside zeros that are off by 2 % of full scale chance alone gives a leak so much.
    let early = against(ZeroCheck { duration_s: 2.5, ..zeros(6.0) });
    assert_eq!(early.judged(), (Status::Doubtful, vec!["offset_or_leak"]));
    assert!(early.verdict().text.contains("explain the 2.5 s that count so far nearly as well"));
    assert_eq!(against(ZeroCheck { for_zeros: 12.0, ..zeros(6.0) }).judged(), (Status::Leak, vec![]));
}

/// A large leak that only zeros beyond belief explain stands, and hides no smaller one that a zero explains.
#[test]
fn a_leak_larger_than_zeros_stands_and_hides_none() {
    let (none, far) = (Estimate { value: 0.0, std: 1e-8 }, Estimate { value: 0.6 / LPM_PER_M3S, std: 1e-8 });
    let zeros = ZeroCheck {
        for_leak: PerLeak::default(),
        for_zeros: 0.0,
        offsets_m3s: [none; 2],
        offsets_without_m3s: PerLeak::from_fn(|_| [far, none]),
        leaks_m3spa: PerLeak::default(),
        single: [None; 2],
        duration_s: 60.0,
    };
    let mut large = found(INTERNAL);
    large.suspicions.zeros = Some(zeros);
    assert_eq!(large.judged(), (Status::Leak, vec![]));
    large.active.external_a = true;
    large.leakage.external_a.mean_lpm = 0.2;
    large.suspicions.zeros =
        Some(ZeroCheck { for_leak: PerLeak { internal: 1e3, ..PerLeak::default() }, ..zeros });
    assert_eq!(large.judged(), (Status::Doubtful, vec!["offset_or_leak"]));
    assert!(large.verdict().text.contains("as the external A leak does"));
}

/// The leak is beyond doubt, how large it is isn't.
#[test]
fn a_zero_that_may_be_off_and_change_a_leak_by_its_threshold_is_a_doubt() {
    let none = Estimate { value: 0.0, std: 1e-8 };
    let judged = |drop, shift_lpm: f64, std_lpm: f64| {
        let beside = Estimate { value: 0.5 + shift_lpm, std: std_lpm }.scaled(1.0 / LPM_PER_M3S);
        let single = SingleZero {
            drop,
            offset_m3s: Estimate { value: 0.2 / LPM_PER_M3S, std: 1e-8 },
            shift_m3s: PerLeak { internal: shift_lpm / LPM_PER_M3S, ..PerLeak::default() },
            flows_m3s: PerLeak { internal: beside, ..PerLeak::default() },
        };
        let zeros = ZeroCheck {
            for_leak: PerLeak { internal: 1e3, ..PerLeak::default() },
            for_zeros: drop,
            offsets_m3s: [none; 2],
            offsets_without_m3s: PerLeak::from_fn(|_| [none; 2]),
            leaks_m3spa: PerLeak::default(),
            // That of the other meter, which explains a little more, changes no leak.
            single: [
                Some(single),
                Some(SingleZero {
                    drop: drop + 1.0,
                    shift_m3s: PerLeak::default(),
                    flows_m3s: PerLeak::default(),
                    ..single
                }),
            ],
            duration_s: 60.0,
        };
        let found = Found {
            suspicions: Suspicions { zeros: Some(zeros), ..Suspicions::default() },
            ..found(INTERNAL)
        };
        (found.judged(), found.verdict().text)
    };
    assert_eq!(judged(40.0, -0.05, 0.01).0, (Status::Leak, vec![]));
    assert_eq!(judged(1.0, -0.05, 0.01).0, (Status::Leak, vec![]));
    assert_eq!(judged(5.0, -0.08, 0.04).0, (Status::Leak, vec![]));
    // Of 0.5 L/min a third is more than the threshold, of 0.2 L/min it isn't.
    assert_eq!(judged(0.0, 0.0, 0.08).0, (Status::Leak, vec![]));
    for (drop, shift_lpm, std_lpm) in [(10.0, -0.08, 0.04), (0.0, 0.0, 0.09), (0.0, -0.3, 0.06)] {
        let (doubted, text) = judged(drop, shift_lpm, std_lpm);
        assert_eq!(doubted, (Status::Doubtful, vec!["offset_or_leak"]));
        assert!(text.contains("How large the internal leak is cannot be told from a zero of qa"), "{text}");
    }
    let (doubted, text) = judged(40.0, -0.2, 0.01);
    assert_eq!(doubted, (Status::Doubtful, vec!["offset_or_leak"]));
    assert!(text.contains("A zero of qa that is off by 0.2000 ± 0.0012 L/min"), "{text}");
    assert!(text.contains("the internal leak is then 0.20 L/min smaller"), "{text}");
}

/// What one leak may leave beyond the noise, several may not.
#[test]
fn several_leaks_at_once_have_to_explain_the_trace_to_the_noise() {
    let mut found = found(INTERNAL);
    found.misfit = Some(Misfit { balance: 2.0, ..SOUND });
    assert_eq!(found.judged().0, Status::Leak);
    found.active.external_b = true;
    assert_eq!(found.judged(), (Status::Doubtful, vec!["several_leaks"]));
}

fn episode(from_s: f64, to_s: Option<f64>) -> Episode {
    Episode { fault: Leak::Internal, from_s, to_s, mean_lpm: 0.5, peak_lpm: 0.6 }
}

#[test]
fn what_happened_earlier_is_in_the_sentence() {
    let mended = Found { episodes: vec![episode(5.0, Some(20.0))], ..sound() };
    assert_eq!(mended.judged().0, Status::Sound);
    assert!(mended.verdict().text.contains("Earlier: internal leak of 0.50 L/min from 5.0 s to 20.0 s."));
    let intermittent =
        Found { episodes: vec![episode(5.0, Some(15.0)), episode(40.0, Some(50.0))], ..sound() };
    let verdict = intermittent.verdict();
    assert_eq!((verdict.status, verdict.faults), (Status::Leak, vec![Leak::Internal]));
    assert!(verdict.text.starts_with("Internal leak that comes and goes, 2 times"), "{}", verdict.text);
}

#[test]
fn the_papers_law_is_never_sure() {
    assert_eq!(Found { misfit: None, ..sound() }.judged(), (Status::NotSure, vec!["no_uncertainty"]));
}

#[test]
fn a_leak_that_grows_says_when_it_matters() {
    let mut growing = sound();
    let (flow, slope) = (Estimate { value: 0.01, std: 1e-3 }, Estimate { value: 1e-4, std: 1e-5 });
    growing.trends.internal = LeakTrend::new(flow, slope, 0.1);
    let text = growing.verdict().text;
    assert!(text.contains("internal leak grows by 0.360 ± 0.071 L/min per hour"), "{text}");
    assert!(text.contains("it is at 0.10 L/min in 15 min (13 min to 19 min)"), "{text}");
    let mut falling = sound();
    falling.trends.internal = LeakTrend::new(flow, slope.scaled(-1.0), 0.1);
    falling.leakage.internal = Leakage { mean_lpm: 0.01, std_lpm: Some(1e-3), net_mean_lpm: None };
    assert!(falling.verdict().text.contains("internal leak falls by 0.360"), "{}", falling.verdict().text);
    falling.leakage.internal = Leakage { mean_lpm: 1e-3, std_lpm: Some(1e-3), net_mean_lpm: None };
    assert!(!falling.verdict().text.contains("falls"), "what may be none does not fall");
}

#[test]
fn json_has_the_contracts_fields_and_no_number_that_is_not_finite() {
    let mut report = report(INTERNAL);
    report.leakage.external_b.mean_lpm = f64::NAN;
    report.estimates.external_leak_b_coefficient.value = f64::INFINITY;
    let json: serde_json::Value = serde_json::from_str(&report.to_json().unwrap()).unwrap();
    assert_eq!(json["schema"], "pitchleak.replay/1");
    assert_eq!(json["trace"]["samples"], 6001);
    assert_eq!(json["estimator"], "rls");
    assert_eq!(json["estimates"]["internal_leak_coefficient"]["unit"], "m3/(s*Pa)");
    assert_eq!(json["estimates"]["internal_leak_coefficient"]["ci95"].as_array().unwrap().len(), 2);
    assert_eq!(json["estimates"]["bulk_modulus"]["std"], serde_json::Value::Null);
    assert_eq!(json["estimates"]["external_leak_b_coefficient"]["value"], serde_json::Value::Null);
    assert_eq!(json["leakage"]["external_b"]["mean_lpm"], serde_json::Value::Null);
    assert_eq!(json["verdict"]["faults"][0], "internal");
    assert_eq!(json["verdict"]["status"], "leak");
    assert_eq!(json["verdict"]["reasons"], serde_json::json!([]));
    assert_eq!(json["trend"]["internal"], serde_json::Value::Null);
    assert_eq!(json["episodes"], serde_json::json!([]));
    assert_eq!(json["alarms"][0]["fault"], "internal");
    assert_eq!(json["alarms"][0]["state"], "raised");
    assert!(json.get("score").is_none());
}

#[test]
fn with_more_bad_rows_than_good_nothing_is_certain() {
    let mut bad = found(INTERNAL);
    bad.trace.skipped = 7000;
    assert_eq!(bad.judged(), (Status::Doubtful, vec!["mostly_bad_rows"]));
    let text = bad.verdict().text;
    assert!(text.starts_with("7000 of 13001 rows are bad"), "{text}");
}

#[test]
fn a_long_trace_tells_times_by_its_clock_or_in_hours() {
    let berlin = TimeFormat { zone: Zone::by_name("+01:00"), ..TimeFormat::default() };
    let mut day =
        Found { episodes: vec![episode(3600.0, Some(7260.0)), episode(40_000.0, None)], ..found(INTERNAL) };
    day.trace.duration_s = 50_000.0;
    day.trace.begins = Clock::new(1_763_676_631_000_000_000, &berlin);
    let json: serde_json::Value = serde_json::from_str(&day.report().to_json().unwrap()).unwrap();
    assert_eq!(json["trace"]["begins"], "2025-11-20T23:10:31+01:00");
    assert_eq!(json["spells"][0]["times"], 1);
    let mut without = Found { episodes: vec![episode(3600.0, Some(7260.0))], ..sound() };
    without.trace.duration_s = 50_000.0;
    let text = without.verdict().text;
    assert!(text.contains("Earlier: internal leak of 0.50 L/min from 1 h 00 min to 2 h 01 min."), "{text}");
}
