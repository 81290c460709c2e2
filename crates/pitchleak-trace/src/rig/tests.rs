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

/// A diagnosis changes a few numbers: what people wrote around them is theirs.
#[test]
fn comments_and_units_stay_where_a_rig_file_is_written_over() {
    let text = "# Turbine 7\n[cylinder]\narea_a = \"12.6 cm^2\"   # data sheet\narea_b = \"9.4 cm^2\"\nstroke = \"200 mm\"\nmoving_mass = \"20 kg\"\n\
                \n[fluid] # HLP 46\nbulk_modulus = \"0.8 GPa\" # guessed\n\n[columns]\npa = \"Head [bar]\" # rewired in May\n";
    let mut rig = Rig::parse(text, "rig.toml").expect("a rig");
    assert_eq!(rig.to_toml_over(text), text);
    rig.fluid.bulk_modulus_pa = 9e8;
    rig.effects.insert(pitchleak_core::Effect::ALL[0], EffectValue::new(1e-6, None));
    let written = rig.to_toml_over(text);
    let expected = text.replace("\"0.8 GPa\"", "\"900000000 Pa\"");
    let expected = expected.split("\n\n[columns]").next().expect("a part");
    assert!(written.starts_with(expected), "{written}");
    assert!(written.contains("bulk_modulus_std = \"200000000 Pa\"\n"), "{written}");
    assert!(written.contains("# rewired in May\n") && written.contains("[effects]\n"), "{written}");
    assert_eq!(Rig::parse(&written, "rig.toml").expect("a rig"), rig);
    // A text that is no rig file is replaced.
    assert_eq!(rig.to_toml_over("nothing"), rig.to_toml());
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
        + r#"flow_b = { full_scale = 1e-4, accuracy = 0.005, bias = "1 %", gain = "20 %", drift = "3 %" }
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
        Instrument { full_scale: 1e-4, accuracy: 0.005, bias: 0.01, gain: 0.2, drift: 0.03 }
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
            "rig.toml:2: `cylinder.area_a` is -0.00126 m^2; it must be from 0.000001 to 10 m^2",
        ),
        (declared().replace("\"12.6 cm^2\"", "nan"), "rig.toml:2: `cylinder.area_a` is NaN"),
        (declared().replace("\"12.6 cm^2\"", "[1]"), "rig.toml:2: `cylinder.area_a` must be a quantity"),
        (
            declared().replace("stroke = \"0.2 m\"", ""),
            "rig.toml:1: missing key `cylinder.stroke`: from 0.001 to 100 m",
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
        (
            declared() + "[columns]\npa = \"p [bar]\"\npb = \"p [bar]\"",
            "`columns.pb` is p [bar]; it must be another column than that of `pa`",
        ),
        (declared() + "[effects]\nmagic = 1", "unknown key `effects.magic`"),
        (declared() + "[decision]\nodds = { flow_zeroo = 0.1 }", "unknown key `decision.odds.flow_zeroo`"),
        (
            declared() + "[decision]\nodds = { flow_lag = \"120 %\" }",
            "`decision.odds.flow_lag` is 1.2; it must be",
        ),
        (
            declared() + "[decision]\nodds = { flow_lag = 0.6, area_a = 0.6 }",
            "1.200 together with the others of its kind",
        ),
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

    /// In whatever unit it is written.
    #[test]
    fn an_offset_that_is_written_is_the_one_that_is_read(signal in 0..Signal::ALL.len(), offset in any::<f64>(), few in -99999..99999i32) {
        let signal = Signal::ALL[signal];
        let Some(dimension) = signal.dimension() else { return Ok(()) };
        prop_assume!(!offset.is_nan());
        let unit = dimension.units().iter().find(|unit| unit.suffix.is_some()).copied();
        for offset in [offset, f64::from(few) / 60e6, f64::from(few) * 1e2] {
            let mut rig = Rig::paper();
            let expected = bound::offset(crate::units::Dimension::Pressure).nearest(offset);
            rig.columns.insert(signal, ForeignColumn { offset, ..ForeignColumn::new("c", unit) });
            let again = Rig::parse(&rig.to_toml(), "rig.toml").map_err(|error| TestCaseError::fail(error.to_string()))?;
            prop_assert_eq!(again.columns[&signal].offset.abs().to_bits(), expected.abs().to_bits(), "{}", rig.to_toml());
        }
    }

    /// Whatever a fit came to.
    #[test]
    fn every_rig_that_is_written_can_be_read(
        numbers in prop::collection::vec(any::<f64>(), 19),
        settings in prop::collection::vec(prop::option::of(any::<f64>()), 5),
        effects in prop::collection::vec((0..Effect::ALL.len(), any::<f64>(), prop::option::of(any::<f64>())), 0..12),
        name in ".*",
        scale in any::<f64>(),
    ) {
        let mut rig = Rig::paper();
        let [a, b, c, d, e, f, g, h, i, j, k, l, m, n, o, p, q, r, s] = numbers[..] else { return Ok(()) };
        let cylinder = &mut rig.cylinder;
        (cylinder.area_a_m2, cylinder.area_b_m2, cylinder.stroke_m, cylinder.moving_mass_kg) = (a, b, c, d);
        (cylinder.dead_volume_a_m3, cylinder.dead_volume_b_m3) = (e, f);
        (rig.fluid.bulk_modulus_pa, rig.fluid.bulk_modulus_std_pa) = (g, h);
        rig.instruments.flow_a = Instrument { full_scale: i, accuracy: j, bias: k, gain: l, drift: 0.5 * l };
        (rig.instruments.flow_b.full_scale, rig.instruments.pressure.full_scale) = (m, n);
        (rig.instruments.position.full_scale, rig.instruments.force.full_scale) = (o, p);
        (rig.alarms.threshold_m3s.internal, rig.alarms.clear_share, rig.alarms.hold_time_s) = (q, r, s);
        let estimator = &mut rig.estimator;
        (estimator.forgetting_time_s, estimator.block_time_s) = (settings[0], settings[1]);
        (estimator.filter_cutoff_hz, estimator.lambda_per_s, estimator.gamma) = (settings[2], settings[3], settings[4]);
        for (effect, value, std) in effects {
            rig.effects.insert(Effect::ALL[effect], EffectValue::new(value, std));
        }
        let unit = Signal::PressureA.dimension().and_then(|dimension| dimension.units().first().copied());
        let column = ForeignColumn { scale, offset: scale, ..ForeignColumn::new(name, unit) };
        rig.columns.insert(Signal::PressureA, column);
        let text = rig.to_toml();
        let again = Rig::parse(&text, "rig.toml").map_err(|error| TestCaseError::fail(format!("{error}\n{text}")))?;
        // A ninth effect stands as a comment.
        let said: Vec<_> = text.lines().filter(|line| !line.starts_with('#')).collect();
        let again = again.to_toml();
        prop_assert_eq!(again.lines().collect::<Vec<_>>(), said);
    }
}

#[test]
fn what_no_machine_has_is_refused() {
    for (line, value) in [
        ("area_a = \"12.6 cm^2\"", "area_a = 5e-324"),
        ("stroke = \"0.2 m\"", "stroke = 1e-9"),
        ("moving_mass = \"20 kg\"", "moving_mass = 1e-300"),
        ("full_scale = \"20 L/min\"", "full_scale = 1e-200"),
        ("full_scale = \"16 MPa\"", "full_scale = 1e-12"),
    ] {
        assert!(declared().contains(line), "{line}");
        assert!(message(&declared().replace(line, value)).contains("it must be from"), "{value}");
    }
}

/// Its default alarm would be above what its meters show.
#[test]
fn small_flow_meters_have_alarms_within_their_range() {
    let rig = Rig::parse(&declared().replace("20 L/min", "0.05 L/min"), "rig.toml").unwrap();
    assert!(
        rig.alarms.threshold_m3s.iter().all(|(_, threshold)| *threshold <= rig.instruments.flow_a.full_scale)
    );
    assert_eq!(Rig::parse(&rig.to_toml(), "rig.toml").unwrap(), rig);
}

const VALVE: &str = r#"
[cylinder]
area_a = "12.6 cm^2"
area_b = "9.4 cm^2"
stroke = "0.2 m"
moving_mass = "20 kg"
[fluid]
bulk_modulus = "0.8 GPa"
[sensors]
pressure = { full_scale = "16 MPa", accuracy = "0.5 %" }
spool = { accuracy = "0.3 %" }
[valve]
rated_flow = "4 L/min"
rated_drop = "35 bar"
drift = { gain = "1 %" }
supply = "100 bar"
calibration = "valve.toml"
"#;

#[test]
fn a_valve_is_read_and_written() {
    let rig = Rig::parse(VALVE, "valve").expect("a rig");
    let valve = rig.valve.clone().expect("a valve");
    assert!((valve.rated_flow_m3s - 4.0 / 60e3).abs() < 1e-18 && (valve.rated_drop_pa - 35e5).abs() < 1e-6);
    assert!((valve.supply_std_pa - 10e5).abs() < 1e-6, "a tenth of the supply");
    assert!((valve.drift.gain - 0.01).abs() < 1e-15 && (valve.drift.null_leak - 0.1).abs() < 1e-15);
    assert_eq!(rig.instruments.supply, rig.instruments.pressure, "as the chambers' sensors");
    assert_eq!(Rig::parse(&rig.to_toml(), "valve").expect("its own text"), rig);
    assert_eq!(Rig::parse(&rig.to_toml_over(VALVE), "valve").expect("its own text"), rig);

    let shut = VALVE.replace("supply = ", "stroke = \"2 mm\"\nshut = \"below 0.5 %\"\nsupply = ");
    let rig = Rig::parse(&shut, "valve").expect("a rig");
    let valve = rig.valve.clone().expect("a valve");
    assert_eq!((valve.stroke_m, valve.shut_below), (Some(2e-3), Some(5e-3)));
    assert_eq!(Rig::parse(&rig.to_toml(), "valve").expect("its own text"), rig);

    let wrong = [
        ("rated_drop = \"35 bar\"", "rated_drop = \"35 mm\"", "valve.rated_drop"),
        ("rated_flow = \"4 L/min\"", "", "valve.rated_flow"),
        ("spool = { accuracy", "spool = { full_scale = 1, accuracy", "sensors.spool.full_scale"),
        ("supply = \"100 bar\"", "shut = \"above 1 %\"", "valve.shut"),
        ("supply = \"100 bar\"", "shut = \"below 120 %\"", "valve.shut"),
        ("supply = \"100 bar\"", "stroke = \"2 bar\"", "valve.stroke"),
    ];
    for (is, becomes, key) in wrong {
        let message = Rig::parse(&VALVE.replace(is, becomes), "valve").expect_err(becomes).to_string();
        assert!(message.contains(key), "{message}");
    }
}

#[test]
fn odds_are_read_by_name_for_both_chambers_at_once_and_written_as_they_were_read() {
    let text = declared() + "[decision]\nodds = { flow_zero = \"1 %\", unit_x = 1e-4 }";
    let rig = Rig::parse(&text, "rig.toml").unwrap();
    let odds: Vec<_> = rig.decision.odds.iter().collect();
    assert_eq!(odds, [("flow_zero_a", 0.005), ("flow_zero_b", 0.005), ("unit_x", 1e-4)]);
    let again = Rig::parse(&rig.to_toml(), "rig.toml").unwrap();
    assert_eq!(again.decision, rig.decision);
}
