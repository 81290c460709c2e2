use super::*;

fn entry(value: f64, std: f64) -> EstimateEntry {
    EstimateEntry::new(Estimate { value, std }, EstimateEntry::COEFFICIENT_UNIT)
}

fn report(active: PerLeak<bool>) -> ReplayReport {
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
    let threshold = 0.1 / LPM_PER_M3S;
    let thresholds = PerLeak { internal: threshold, external_a: threshold, external_b: threshold };
    let trace = TraceSummary {
        path: "h02.csv.gz".to_owned(),
        samples: 6001,
        skipped: 0,
        duration_s: 60.0,
        sample_rate_hz: Some(100.000_000_001),
        gaps: 0,
        warnings: Vec::new(),
    };
    ReplayReport {
        schema: ReplayReport::SCHEMA,
        verdict: Verdict::new(active, &leakage, &estimates, &thresholds, &trace),
        trace,
        rig: "rig.toml".to_owned(),
        estimator: EstimatorKind::Rls,
        flow_meter_offsets: None,
        normalised_innovation: None,
        estimates,
        leakage,
        changed_at_s: None,
        alarms: vec![Alarm { time_s: 3.25, fault: Leak::Internal, state: AlarmState::Raised }],
        score: None,
    }
}

const INTERNAL: PerLeak<bool> = PerLeak { internal: true, external_a: false, external_b: false };

#[test]
fn text_puts_the_verdict_first() {
    let text = report(INTERNAL).to_text(&Palette::PLAIN);
    let expected = "\
LEAK  Internal leak of 0.4785 ± 0.0022 L/min: oil passes the piston seal: plan its change, check the bore for scoring. \
No external A leak above 0.10 L/min. This trace cannot tell about external B leaks.

leak        L/min, 95 %             L/min/bar, 95 %
internal    0.4785 ± 0.0022         0.07200 ± 0.00024
external A  -0.0004 ± 0.0022        -0.00006 ± 0.00024
external B  0.00 ± 0.39             0.000 ± 0.035           not identifiable: pressure B hardly moves
oil         bulk modulus 0.9000 GPa

alarm raised at 3.25 s: internal leak

trace      h02.csv.gz: 6001 samples over 60.0 s at 100 Hz, 0 rows skipped, 0 gaps
rig        rig.toml
estimator  rls
";
    assert_eq!(text, expected);
    assert!(report(INTERNAL).to_text(&Palette::ANSI).starts_with("\x1b[1;31mLEAK\x1b[0m"));
}

#[test]
fn no_alarm_is_not_sound_where_the_trace_cannot_tell() {
    let text = report(PerLeak::default()).to_text(&Palette::PLAIN);
    assert!(text.starts_with("NOT SURE  No internal or external A leak above"), "{text}");
}

#[test]
fn a_negative_leak_is_evidence_against_the_model() {
    let mut report = report(INTERNAL);
    report.leakage.external_a.mean_lpm = -0.2;
    let threshold = PerLeak { internal: 1e-6, external_a: 1e-6, external_b: 1e-6 };
    report.verdict = Verdict::new(INTERNAL, &report.leakage, &report.estimates, &threshold, &report.trace);
    let text = report.to_text(&Palette::PLAIN);
    assert!(text.starts_with("DOUBTFUL  The external A leak comes out negative"), "{text}");
    assert!(text.contains("Internal leak of 0.4785"), "{text}");
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
    assert_eq!(json["alarms"][0]["fault"], "internal");
    assert_eq!(json["alarms"][0]["state"], "raised");
    assert!(json.get("score").is_none());
}

#[test]
fn with_more_bad_rows_than_good_nothing_is_certain() {
    let mut report = report(INTERNAL);
    report.trace.skipped = 7000;
    report.verdict = Verdict::new(
        INTERNAL,
        &report.leakage,
        &report.estimates,
        &PerLeak { internal: 1e-6, external_a: 1e-6, external_b: 1e-6 },
        &report.trace,
    );
    let text = report.to_text(&Palette::PLAIN);
    assert!(text.starts_with("DOUBTFUL  7000 of 13001 rows are bad"), "{text}");
}
