use super::*;
use crate::signal::Signal;
use pitchleak_core::Effect;
use pitchleak_testkit::rig::with_sensors_of;
use proptest::prelude::*;

/// The paper's rig, every sensor declared.
fn declared() -> String {
    with_sensors_of("1 %")
}

fn message(text: &str) -> String {
    Rig::parse(text, "rig.toml").unwrap_err().to_string()
}

#[test]
fn the_contracts_file_is_the_papers_rig() {
    let mut rig = Rig::parse(&declared(), Rig::PAPER_NAME).unwrap();
    let paper = Rig::paper();
    let area_b_m2 = &mut rig.cylinder.area_b_m2;
    assert!((*area_b_m2 / paper.cylinder.area_b_m2 - 1.0).abs() < 3e-16);
    *area_b_m2 = paper.cylinder.area_b_m2;
    assert_eq!(rig, paper);
    assert_eq!(rig.sensors(), pitchleak_core::Sensors::paper());
}

#[test]
fn optional_sections_are_read() {
    let text = declared().replace("flow = {", "flow_a = {")
        + r#"flow_b = { full_scale = 1e-4, accuracy = 0.005, bias = "1 %", gain = "20 %" }
[estimator]
kind = "paper"
forgetting_time = "30 s"
filter_cutoff = 5
gains = { lambda = 50, gamma = 0.5 }
[alarms]
internal = "0.2 L/min"
hysteresis = "25 %"
hold_time = "5 s"
[columns]
pa = { name = "Head pressure", unit = "bar", scale = -1.5, offset = "2 bar" }
timestamp = { name = "Zeit" }
[effects]
position_gain = { value = 0.02, std = 0.001 }
load_offset = 12
"#;
    let rig = Rig::parse(&text, "rig.toml").unwrap();
    assert_eq!(
        rig.instruments.flow_b,
        Instrument { full_scale: 1e-4, accuracy: 0.005, bias: 0.01, gain: 0.2 }
    );
    assert_eq!(rig.estimator.kind, EstimatorKind::Paper);
    assert_eq!(rig.estimator.filter_cutoff_hz, Some(5.0));
    assert_eq!(rig.estimator.lambda_per_s, Some(50.0));
    assert!((rig.alarms.threshold_m3s.internal * 60e3 / 0.2 - 1.0).abs() < 1e-15);
    assert!((rig.alarms.threshold_m3s.external_b * 60e3 / 0.1 - 1.0).abs() < 1e-15);
    assert!((rig.alarms.clear_share - 0.75).abs() < 1e-15);
    assert_eq!(rig.columns[&Signal::PressureA].name, "Head pressure");
    assert_eq!(rig.effects[&Effect::PositionGain], EffectValue::new(0.02, Some(0.001)));
    let again = Rig::parse(&rig.to_toml(), "rig.toml").unwrap();
    assert_eq!(again, rig);
}

#[test]
fn errors_name_file_line_key_and_the_values_allowed() {
    let cases = [
        (
            declared().replace("area_a", "aera_a"),
            "rig.toml:2: unknown key `cylinder.aera_a`; allowed here: area_a,",
        ),
        (
            declared().replace("12.6 cm^2", "12.6 cm"),
            "rig.toml:2: `cylinder.area_a`: unit `cm` is not one of: m^2,",
        ),
        (
            declared().replace("12.6 cm^2", "-12.6 cm^2"),
            "rig.toml:2: `cylinder.area_a` is -0.00126 m^2; it must be above 0 to 10 m^2",
        ),
        (declared().replace("\"12.6 cm^2\"", "nan"), "rig.toml:2: `cylinder.area_a` is NaN"),
        (declared().replace("\"12.6 cm^2\"", "[1]"), "rig.toml:2: `cylinder.area_a` must be a quantity"),
        (
            declared().replace("stroke = \"0.2 m\"", ""),
            "rig.toml:1: missing key `cylinder.stroke`: above 0 to 100 m",
        ),
        (declared().replace("[fluid]", "[fluids]"), "rig.toml:6: unknown key `fluids`"),
        (declared().replace("20 L/min", "20 cfm"), "rig.toml:10: `sensors.flow.full_scale`: unit `cfm`"),
        (
            declared().replace("accuracy = \"1 %\"", "accuracy = \"200 %\""),
            "rig.toml:10: `sensors.flow.accuracy` is 2;",
        ),
        (declared().replace("[fluid]", "[fluid"), "rig.toml:6: not a TOML file:"),
        (declared() + "[estimator]\nkind = \"kalman\"", "it must be rls or paper"),
        (
            declared() + "[columns]\npa = { name = \"p\" }",
            "missing key `columns.pa.unit`: one of pa, kpa, mpa, bar",
        ),
        (declared() + "[effects]\nmagic = 1", "unknown key `effects.magic`"),
        (String::new(), "rig.toml: missing key `cylinder.area_a`"),
    ];
    for (text, expected) in cases {
        let message = message(&text);
        assert!(message.contains(expected), "{message}\nexpected {expected}");
        assert!(!message.contains('\n'), "{message}");
    }
}

proptest! {
    #[test]
    fn any_text_is_a_rig_or_one_line(text in r#"([\[\]a-z_={}" .0-9\n]|cylinder|area_a|sensors|flow){0,40}"#) {
        if let Err(error) = Rig::parse(&text, "r") {
            prop_assert!(!error.to_string().contains('\n'));
        }
    }

    #[test]
    fn a_saved_rig_reads_back(area in 1e-6..1.0f64, stroke in 1e-3..10.0f64, beta in 1e7..1e10f64, accuracy in 0.0..1.0f64) {
        let mut rig = Rig::paper();
        rig.cylinder.area_a_m2 = area;
        rig.cylinder.stroke_m = stroke;
        rig.fluid.bulk_modulus_pa = beta;
        rig.instruments.force.accuracy = accuracy;
        prop_assert_eq!(Rig::parse(&rig.to_toml(), Rig::PAPER_NAME).unwrap(), rig);
    }
}
