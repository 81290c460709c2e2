//! From a residual to the missing effect, with a figure of the residual before and after.
//!
//! ```text
//! cargo run --release --example closing_the_loop -- OUT.svg                    a worn spot, simulated
//! cargo run --release --example closing_the_loop -- OUT.svg RIG.toml TRACE…    your own traces
//! ```

use pitchleak::Rig;
use pitchleak::core::effects::EffectConstants;
use pitchleak::core::{Effect, EffectSet, LPM_PER_M3S, PerLeak};
use pitchleak::diagnose::{Declared, Diagnosis, Series, diagnose};
use pitchleak::simulate::{Biases, LeakSize, Scenario, Sensing};
use pitchleak::trace::TraceReader;
use pitchleak::wind::{Emulation, History, Wind, WindCase};
use pitchleak_view::figure::{Ink, Line, Panel, svg};
use pitchleak_view::{Palette, Text};
use std::error::Error;

/// A minute of wind on a cylinder with a worn spot, through sensors of 0.3 % of full scale.
fn worn_spot() -> Result<(Rig, Vec<Series>), Box<dyn Error>> {
    let mut rig = Rig::paper();
    rig.instruments = rig.instruments.with_accuracy(3e-3);
    let mut effects = EffectSet::default();
    let constants =
        EffectConstants { spot_position_m: 0.09, spot_width_m: 0.01, ..EffectConstants::default() };
    effects.set(Effect::PositionDependentLeak, 1e-11, constants)?;
    let history = History::of(&Wind::BuiltIn(WindCase::Mps21))?;
    let reference = Emulation::paper().reference(&history, rig.cylinder.stroke_m)?;
    let scenario = Scenario {
        leaks: PerLeak { internal: 5e-12, external_a: 1e-12, external_b: 0.0 }
            .map(|leak| LeakSize::Coefficient(leak).into()),
        effects,
        start_s: 5.0,
        warm_up_s: 3.0,
        ..Scenario::new(rig.clone(), reference)
    };
    let mut sensing = Sensing::new(rig.sensors(), Biases::default(), 1);
    let mut series = Series::default();
    let leaks = scenario.leak_coefficients()?;
    scenario.run(leaks, |truth| series.push(truth.t_s, &sensing.read(&truth.sample), None))?;
    Ok((rig, vec![series]))
}

fn read(rig: &str, traces: &[String]) -> Result<(Rig, Vec<Series>), Box<dyn Error>> {
    let rig = Rig::load(rig)?;
    let read = |path: &String| Ok(Series::read(&mut TraceReader::open(path, &rig)?)?);
    let series = traces.iter().map(read).collect::<Result<_, Box<dyn Error>>>()?;
    Ok((rig, series))
}

/// The residual over time, before in grey and after in blue.
fn panels(diagnosis: &Diagnosis) -> Vec<Panel> {
    let (before, after) = (&diagnosis.before.residual_over_time, &diagnosis.after.residual_over_time);
    let balances = [
        ("Chamber A", "residual, L/min", &before.chamber_a, &after.chamber_a, LPM_PER_M3S),
        ("Chamber B", "residual, L/min", &before.chamber_b, &after.chamber_b, LPM_PER_M3S),
        ("Forces", "residual, N", &before.force, &after.force, 1.0),
    ];
    let line = |label, ink, points: &[(f64, f64)], factor: f64| Line {
        label,
        ink,
        points: points.iter().map(|(t, v)| (*t, v * factor)).collect(),
    };
    balances
        .into_iter()
        .filter(|(_, _, before, _, _)| !before.is_empty())
        .map(|(title, y_label, before, after, factor)| Panel {
            title: title.to_owned(),
            x_label: "time (s)",
            y_label,
            lines: vec![
                line("declared model", Ink::Measured, before, factor),
                line("with the effects found", Ink::Ours, after, factor),
            ],
            y_range: None,
        })
        .collect()
}

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let (out, (rig, traces)) = match arguments.as_slice() {
        [out] => (out, worn_spot()?),
        [out, rig, traces @ ..] => (out, read(rig, traces)?),
        [] => return Err("say where the figure goes: OUT.svg [RIG.toml TRACE…]".into()),
    };
    // The last of several traces is judged, not fitted.
    let (train, test) = traces.split_at(traces.len().saturating_sub(1).max(1));
    let diagnosis = diagnose(train, test, &Declared::of(&rig), &|| ());
    print!("{}", diagnosis.to_text(&Palette::PLAIN));
    std::fs::write(out, svg(&panels(&diagnosis), 1)?)?;
    Ok(())
}
