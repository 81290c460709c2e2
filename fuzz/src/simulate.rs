//! Any order to the simulation, a line for each part: numbers or a typed error.

use pitchleak::Rig;
use pitchleak::core::PerLeak;
use pitchleak::simulate::{EffectSize, Followed, LeakCourse, Noise, Plan};
use pitchleak::units::{self, Dimension};

pub fn enter(bytes: &[u8]) {
    let Ok(text) = std::str::from_utf8(bytes) else { return };
    let mut lines = text.lines();
    let mut next = || lines.next().unwrap_or_default();
    let leak = |text: &str| text.parse::<LeakCourse>().unwrap_or_else(|_| "0".parse().expect("none"));
    let time = |text: &str| units::parse(text, Dimension::Time).ok();
    let quantity = |text: &str, usual: &str| match units::parse(text, Dimension::Force) {
        Ok(_) => text.to_owned(),
        Err(_) => usual.to_owned(),
    };
    let plan = Plan {
        // Quantities only: no file of this machine is read.
        followed: Followed::Given { position: "0.1 m".to_owned(), load: quantity(next(), "1 kN") },
        leaks: PerLeak { internal: leak(next()), external_a: leak(next()), external_b: leak(next()) },
        onset_s: time(next()).unwrap_or(0.0),
        oil_temperature: next().split_once("->").map(|(from, to)| format!("{from}->{to}")),
        shut: None,
        valve_flaws: Vec::new(),
        noise: next().parse().unwrap_or(Noise::None),
        bias_share: pitchleak::simulate::share_of_full_scale(next()).unwrap_or(0.0),
        start_s: time(next()),
        seed: next().parse().unwrap_or(1),
        effects: {
            let effect = |text: &str| text.parse::<EffectSize>().ok();
            [next(), next()].into_iter().filter_map(effect).collect()
        },
        sensor_faults: lines.filter_map(|line| line.parse().ok()).take(4).collect(),
        duration_s: Some(0.3),
        sample_rate_hz: 100.0,
    };
    let Ok(recording) = plan.recording(Rig::paper()) else { return };
    let Ok((columns, truth)) = recording.columns(|_| std::ops::ControlFlow::Continue(())) else { return };
    assert!(columns.iter().all(|(_, values)| !values.iter().any(|value| value.is_infinite())));
    assert!(columns.iter().find(|(name, _)| *name == "x_mm").is_some());
    serde_json::to_string(&truth).expect("a truth has a JSON form");
}
