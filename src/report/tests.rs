use super::*;
use crate::channels::{ChannelFault, ChannelFaultKind};
use crate::explain::{Belief, Decision, Explained, Mistake, Note};
use crate::rig::{ColumnMap, Rig};
use crate::signal::Signal;
use crate::times::{Clock, TimeFormat, Zone};
use crate::wiring::Wiring;

fn entry(value: f64, std: f64) -> EstimateEntry {
    EstimateEntry::new(Estimate { value, std }, EstimateEntry::COEFFICIENT_UNIT)
}

/// What a test changes of a minute's findings.
struct Found {
    active: PerLeak<bool>,
    leakage: PerLeak<Leakage>,
    estimates: Estimates,
    trends: PerLeak<Option<LeakTrend>>,
    episodes: Vec<Episode>,
    trace: TraceSummary,
    knows_noise: bool,
    restarts: u64,
    changed_at_s: Option<f64>,
    channels: Vec<ChannelFault>,
    earlier_channels: Vec<ChannelFault>,
    wiring: Option<Wiring>,
    decision: Option<Decision>,
}

impl Found {
    fn verdict(&self) -> Verdict {
        Verdict::of(&Findings {
            active: self.active,
            leakage: self.leakage,
            trends: self.trends,
            episodes: self.episodes.clone(),
            threshold_lpm: PerLeak { internal: 0.1, external_a: 0.1, external_b: 0.1 },
            trace: self.trace.clone(),
            assumed: crate::rig::Assumed::default(),
            alpha: 0.05,
            end_s: 60.0,
            knows_noise: self.knows_noise,
            restarts_in_all: self.restarts,
            changed_at_s: self.changed_at_s,
            channels: self.channels.clone(),
            earlier_channels: self.earlier_channels.clone(),
            wiring: self.wiring.clone(),
            decision: self.decision.as_ref(),
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
            wiring: None,
            hold: None,
            valve: None,
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

/// Sure of leaks where alarms stand, and that there are no others.
fn decision(active: PerLeak<bool>) -> Decision {
    let (faults, ruled_out): (Vec<Leak>, Vec<Leak>) = Leak::ALL.into_iter().partition(|leak| active[*leak]);
    Decision {
        status: if faults.is_empty() { Status::Sound } else { Status::Leak },
        faults,
        ruled_out,
        probability: active.map(|active| if active { 0.999 } else { 0.001 }),
        present: active.map(|active| if active { 1.0 } else { 0.03 }),
        leakage: PerLeak::from_fn(|_| Belief::default()),
        changed_ago_s: None,
        pressures_pa: PerLeak::default(),
        explanations: Vec::new(),
        as_declared: true,
        notes: Vec::new(),
        misfit: 1.0,
        strained: false,
        wander: 0.0,
        wiring: 0.0,
        residuals: [None; 2],
    }
}

fn explained(id: &str, cause: &str, probability: f64) -> Explained {
    Explained {
        id: id.to_owned(),
        probability,
        text: cause.to_owned(),
        cause: cause.to_owned(),
        wiring: id.starts_with("exchanged"),
        mistake: None,
        sensors: Vec::new(),
        remedy: None,
        columns: vec!["qa = \"qb\"".to_owned()],
        cannot_be_told_from: Vec::new(),
        leakage: PerLeak::default(),
    }
}

fn found(active: PerLeak<bool>) -> Found {
    let estimates = Estimates {
        internal_leak_coefficient: entry(1.2e-11, 2e-14),
        external_leak_a_coefficient: entry(-1e-14, 2e-14),
        external_leak_b_coefficient: entry(0.0, 3e-12).not_identifiable("pressure B hardly moves"),
        bulk_modulus: EstimateEntry::without_spread(0.9e9, EstimateEntry::BULK_MODULUS_UNIT),
    };
    let lpm = |mean_lpm, std| Leakage { mean_lpm, std_lpm: Some(std), net_mean_lpm: None, since: None };
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
        slowest_hz: None,
        is_out_of_order: false,
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
        knows_noise: true,
        restarts: 0,
        changed_at_s: None,
        channels: Vec::new(),
        earlier_channels: Vec::new(),
        wiring: None,
        decision: Some(decision(active)),
    }
}

fn report(active: PerLeak<bool>) -> ReplayReport {
    found(active).report()
}

/// All leaks known, none above its threshold.
fn sound() -> Found {
    let mut found = found(PerLeak::default());
    found.leakage.internal.mean_lpm = 0.01;
    found
}

const INTERNAL: PerLeak<bool> = PerLeak { internal: true, external_a: false, external_b: false };

/// The data say as much of external B as before they came: nothing. Where its interval is narrow they do.
#[test]
fn no_alarm_is_not_sound_where_the_trace_cannot_tell() {
    let mut found = sound();
    let decision = found.decision.as_mut().unwrap();
    (decision.status, decision.ruled_out) = (Status::NotSure, vec![Leak::Internal, Leak::ExternalA]);
    decision.probability.external_b = 0.02;
    found.leakage.external_b.std_lpm = Some(0.01);
    assert_eq!(found.judged(), (Status::NotSure, vec!["undecided"]));
    let narrow = found.verdict().text;
    assert!(narrow.starts_with("External B leak above 0.10 L/min with 2 %: "), "{narrow}");
    found.leakage.external_b.std_lpm = Some(0.1);
    assert_eq!(found.judged(), (Status::NotSure, vec!["not_identifiable"]));
    let text = found.verdict().text;
    assert!(text.starts_with("This trace cannot tell about external B leaks."), "{text}");
    assert!(text.contains("No internal or external A leak above 0.10 L/min."), "{text}");
}

#[test]
fn a_leak_that_is_likely_and_not_sure_says_what_else_it_may_be() {
    assert_eq!(sound().judged(), (Status::Sound, vec![]));
    let mut close = sound();
    let decision = close.decision.as_mut().unwrap();
    (decision.status, decision.ruled_out) = (Status::NotSure, vec![Leak::ExternalA, Leak::ExternalB]);
    decision.probability.internal = 0.6;
    assert_eq!(close.judged(), (Status::NotSure, vec!["undecided"]));
    let text = close.verdict().text;
    assert!(text.contains("Internal leak above 0.10 L/min with 60 %: 0.0100 ± 0.0022 L/min."), "{text}");
    assert!(!text.contains("No internal"), "{text}");
    close.decision.as_mut().unwrap().explanations = vec![
        Explained {
            leakage: PerLeak { internal: 0.4, ..PerLeak::default() },
            ..explained("internal", "", 0.6)
        },
        Explained {
            sensors: vec![Signal::FlowA],
            ..explained("flow_zero_a", "flow meter A's zero is off", 0.4)
        },
    ];
    assert_eq!(close.verdict().reasons[0].sensors, [Signal::FlowA]);
    assert_eq!(close.judged(), (Status::NotSure, vec!["offset_or_leak"]));
    let text = close.verdict().text;
    assert!(text.contains("with 60 %, or flow meter A's zero is off (40 %)."), "{text}");
    // Likelier than any zero is a leak just below its threshold.
    let below = Explained {
        leakage: PerLeak { internal: 0.09, ..PerLeak::default() },
        ..explained("internal", "", 0.5)
    };
    close.decision.as_mut().unwrap().explanations.insert(1, below);
    assert_eq!(close.judged(), (Status::NotSure, vec!["undecided"]));
}

#[test]
fn an_alarm_that_the_whole_trace_speaks_against_is_explained() {
    let mut standing = Found { active: INTERNAL, ..sound() };
    standing.decision.as_mut().unwrap().ruled_out = Leak::ALL.to_vec();
    assert_eq!(standing.judged(), (Status::Sound, vec![]));
    assert!(standing.verdict().text.contains("That explains the alarm of the internal leak."));
    standing.active = PerLeak { internal: true, external_a: true, external_b: false };
    assert!(
        standing.verdict().text.contains("That explains the alarms of the internal and external A leaks.")
    );
}

/// That the last seconds show none is no news of a leak that comes and goes; of one that stopped it is.
#[test]
fn a_leak_that_comes_and_goes_is_not_gone_while_its_alarm_stands() {
    let with = |id: &str, active: PerLeak<bool>| {
        let mut away = Found { active, ..sound() };
        let decision = away.decision.as_mut().unwrap();
        decision.ruled_out = Leak::ALL.to_vec();
        decision.explanations = vec![explained(id, "", 0.9)];
        away
    };
    let away = with("internal:wandering", INTERNAL);
    assert_eq!(away.judged(), (Status::NotSure, vec!["undecided"]));
    let text = away.verdict().text;
    assert!(text.contains("Internal leaks come and go, and the last seconds show none."), "{text}");
    assert!(text.contains("No external A or external B leak"), "{text}");
    let rules_out = |id: &str, leak| with(id, INTERNAL).decision.unwrap().rules_out_alarm(leak);
    assert!(!rules_out("internal:wandering", Leak::Internal));
    assert!(rules_out("internal:wandering", Leak::ExternalA) && rules_out("internal:sudden", Leak::Internal));
    assert_eq!(with("internal:sudden", INTERNAL).judged(), (Status::Sound, vec![]));
    assert_eq!(with("internal:wandering", PerLeak::default()).judged(), (Status::Sound, vec![]));
}

/// A sensor that is off is told, and spoils no verdict that does not hang on it.
#[test]
fn what_is_not_as_declared_is_told_beside_a_sure_verdict() {
    let mut leaking = found(INTERNAL);
    leaking.decision.as_mut().unwrap().notes = vec![Note {
        id: "flow_zero_a".to_owned(),
        probability: 0.99,
        text: "flow meter A's zero is off".to_owned(),
        cannot_be_told_from: Vec::new(),
    }];
    assert_eq!(leaking.judged(), (Status::Leak, vec![]));
    assert!(leaking.verdict().text.contains("Besides, flow meter A's zero is off."));
}

#[test]
fn apparent_leaks_are_told_one_by_one() {
    let text = |active| {
        let mut found = found(active);
        let decision = found.decision.as_mut().unwrap();
        (decision.status, decision.misfit) = (Status::Doubtful, 6.0);
        found.verdict().text
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
fn an_alarm_that_the_posterior_leaves_open_is_a_gap() {
    let mut found = found(INTERNAL);
    let decision = found.decision.as_mut().unwrap();
    (decision.status, decision.faults) = (Status::NotSure, vec![]);
    decision.probability.internal = 0.4;
    assert_eq!(found.judged(), (Status::NotSure, vec!["undecided"]));
    let text = found.verdict().text;
    assert!(text.starts_with("Internal leak above 0.10 L/min with 40 %: "), "{text}");
}

#[test]
fn what_no_explanation_fits_is_a_doubt() {
    let mut strange = found(INTERNAL);
    let decision = strange.decision.as_mut().unwrap();
    (decision.status, decision.misfit) = (Status::Doubtful, 6.0);
    assert_eq!(strange.judged(), (Status::Doubtful, vec!["model_does_not_fit"]));
    assert!(strange.verdict().text.contains("what remains is 6.0 times what the readings scatter"));
}

#[test]
fn what_remains_within_the_intervals_is_told_beside_the_verdict() {
    let text = |misfit| {
        let mut found = found(INTERNAL);
        found.decision.as_mut().unwrap().misfit = misfit;
        assert_eq!(found.judged(), (Status::Leak, vec![]));
        found.verdict().text
    };
    assert!(text(2.3).contains("What remains unexplained is 2.3 times what the readings scatter"));
    assert!(!text(1.9).contains("remains"));
}

#[test]
fn a_change_at_once_is_told() {
    let once = Found { restarts: 1, changed_at_s: Some(50.0), ..found(INTERNAL) };
    assert_eq!(once.judged(), (Status::Leak, vec![]));
    assert!(once.verdict().text.contains("The leaks changed at 50.00 s"));
    let often = Found { restarts: 5, changed_at_s: Some(50.0), ..found(INTERNAL) };
    assert!(often.verdict().text.contains("changed 5 times, last at 50.00 s"));
}

#[test]
fn a_mistake_of_wiring_that_is_likelier_than_not_is_named_with_its_lines() {
    let mut exchanged = found(INTERNAL);
    let decision = exchanged.decision.as_mut().unwrap();
    (decision.status, decision.wiring) = (Status::Doubtful, 0.97);
    decision.explanations = vec![explained("exchanged_flows", "qa and qb are exchanged", 0.97)];
    assert_eq!(exchanged.judged(), (Status::Doubtful, vec!["wiring"]));
    let reason = &exchanged.verdict().reasons[0];
    assert_eq!(reason.text, "the trace is explained if qa and qb are exchanged (97 %)");
    assert!(reason.suggestion.as_ref().is_some_and(|mend| mend.contains("[columns] qa = \"qb\"")));
}

#[test]
fn a_mistake_of_wiring_that_leaves_more_than_any_scatter_explains_nothing() {
    let mut pulsing = found(INTERNAL);
    let decision = pulsing.decision.as_mut().unwrap();
    (decision.status, decision.wiring, decision.misfit) = (Status::Doubtful, 0.97, 5.4);
    decision.explanations = vec![explained("exchanged_flows", "qa and qb are exchanged", 0.97)];
    assert_eq!(pulsing.judged(), (Status::Doubtful, vec!["model_does_not_fit"]));
}

#[test]
fn channels_come_before_wiring_and_that_before_what_follows_from_it() {
    let stuck = ChannelFault {
        channel: Signal::PressureA,
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
        cylinder: Vec::new(),
        sensors: vec![Signal::FlowA, Signal::FlowB],
        alternatives: Vec::new(),
    };
    let mut doubtful = Found { channels: vec![stuck], wiring: Some(wiring), ..found(INTERNAL) };
    doubtful.trace.skipped = 7000;
    doubtful.decision.as_mut().unwrap().misfit = 6.0;
    assert_eq!(doubtful.judged().1, ["channel_stuck", "wiring", "mostly_bad_rows"]);
    let sensors: Vec<_> = doubtful.verdict().reasons.into_iter().map(|reason| reason.sensors).collect();
    assert_eq!(sensors, [vec![Signal::PressureA], vec![Signal::FlowA, Signal::FlowB], vec![]]);
    let text = doubtful.verdict().text;
    assert!(text.starts_with("Pa reads 50 bar from 10 s to 60 s. Check the sensor."), "{text}");
    let wiring = &doubtful.verdict().reasons[1];
    assert!(
        wiring.suggestion.as_ref().is_some_and(|mend| mend.contains("[columns] qa = \"qb_lpm\"")),
        "{wiring:?}"
    );
}

fn episode(from_s: f64, to_s: Option<f64>) -> Episode {
    Episode { fault: Leak::Internal, from_s, to_s, mean_lpm: 0.5, peak_lpm: 0.6 }
}

#[test]
fn what_happened_earlier_is_in_the_sentence() {
    let mended = Found { episodes: vec![episode(5.0, Some(20.0))], ..sound() };
    assert_eq!(mended.judged().0, Status::Sound);
    assert!(mended.verdict().text.contains("Earlier: internal leak of 0.50 L/min from 5.0 s to 20.0 s."));
    let mut intermittent =
        Found { episodes: vec![episode(5.0, Some(15.0)), episode(40.0, Some(50.0))], ..sound() };
    assert_eq!(intermittent.judged().0, Status::Sound, "of what no explanation has there is no leak");
    intermittent.decision.as_mut().expect("is weighed").present.internal = 0.99;
    let verdict = intermittent.verdict();
    assert_eq!((verdict.status, verdict.faults), (Status::Leak, vec![Leak::Internal]));
    assert!(verdict.text.starts_with("Internal leak that comes and goes, 2 times"), "{}", verdict.text);
}

#[test]
fn the_papers_law_is_never_sure() {
    assert_eq!(
        Found { knows_noise: false, decision: None, ..sound() }.judged(),
        (Status::NotSure, vec!["no_uncertainty"])
    );
}

/// A sound cylinder whose internal leak has this slope by the estimator, and this course by the posterior with this probability.
fn changing(slope_lpm_ps: f64, course: &str, probability: f64) -> String {
    let mut found = sound();
    let flow = Estimate { value: 0.01, std: 1e-3 };
    let slope = Estimate { value: slope_lpm_ps, std: 0.1 * slope_lpm_ps.abs() };
    found.trends.internal = LeakTrend::new(flow, slope, 0.1);
    found.leakage.internal =
        Leakage { mean_lpm: flow.value, std_lpm: Some(flow.std), net_mean_lpm: None, since: None };
    found.decision.as_mut().unwrap().explanations =
        vec![explained(&format!("internal:{course}+as_declared"), "", probability)];
    found.verdict().text
}

#[test]
fn a_leak_that_grows_says_when_it_matters() {
    let text = changing(1e-4, "growing", 0.9);
    assert!(text.contains("internal leak grows by 0.360 ± 0.071 L/min per hour"), "{text}");
    assert!(text.contains("it is at 0.10 L/min in 15 min (13 min to 19 min)"), "{text}");
    let text = changing(-1e-4, "creeping", 0.6);
    assert!(text.contains("internal leak falls by 0.360"), "{text}");
}

/// The estimator's slope is one of its leaks, by sensors as declared.
#[test]
fn no_leak_grows_that_is_likelier_to_be_steady() {
    for (course, probability) in [("growing", 0.4), ("constant", 0.9), ("sudden", 0.9)] {
        let text = changing(1e-4, course, probability);
        assert!(!text.contains("grows"), "{text}");
    }
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

/// Where nothing is left of the readings as declared, a mistake is not the explanation for that alone: chambers were exchanged, for sure
/// and 14 times louder than noise, where the rig file had both areas the wrong way round.
#[test]
fn a_mistake_that_leaves_more_than_noise_explains_nothing() {
    let mistake = Mistake::ChambersExchanged;
    let named = |before: Option<f64>, after: f64| {
        let chambers =
            Explained { mistake: Some(mistake), ..explained("exchanged_chambers", "exchanged", 0.99) };
        let decision = Decision {
            explanations: vec![chambers],
            wiring: 0.99,
            residuals: [before, Some(after)],
            ..decision(PerLeak::default())
        };
        Wiring::of(&decision, &ColumnMap::new(), &Rig::paper()).is_some()
    };
    assert!(named(None, 1.1) && named(Some(29.0), 1.1) && named(Some(29.0), 3.0));
    assert!(!named(None, 14.0) && !named(Some(29.0), 14.0));
}
