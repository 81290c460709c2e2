//! A case as a page: words from the table of effects, figures from the diagnosis.

use crate::case::{ACCURACY, ALIKE, Case, DURATION_S, Rival};
use pitchleak::core::{Effect, LPM_PER_M3S};
use pitchleak::diagnose::{BinnedResidual, Equation, FoundEffect};
use pitchleak::units::effect_unit;
use pitchleak_view::figure::{FigureError, Ink, Line, Panel, svg};
use std::fmt::Write;

/// The effect's name in words.
pub fn title(effect: Effect) -> String {
    let words = effect.spec().id.split('_').map(|word| match word {
        "a" | "b" => word.to_uppercase(),
        _ => word.to_owned(),
    });
    let words = words.collect::<Vec<_>>().join(" ");
    words.chars().take(1).flat_map(char::to_uppercase).chain(words.chars().skip(1)).collect()
}

pub fn text(case: &Case) -> String {
    let spec = case.effect.spec();
    let mut out = format!("# {}\n\n`{}`: {}\n\n", title(case.effect), spec.id, spec.cause);
    let _ = writeln!(out, "![Residual before and after]({}.svg)\n", spec.id);
    let _ = writeln!(
        out,
        "*{DURATION_S:.0} s of wind at 21 m/s, sensors of {} % of full scale, and {} of this effect. Grey: the \
         residual of the declared model. Blue: the residual with what `pitchleak diagnose` named.{}*\n",
        100.0 * ACCURACY,
        amount(case.effect, case.size),
        strongest(case).map_or(String::new(), |bins| format!(
            " On the right against {}, with which it goes; dark lines: two standard errors.",
            variable(bins.against).0
        )),
    );
    let _ = writeln!(out, "## What to do\n\n{}\n", spec.remedy);
    let _ = writeln!(out, "## The measurement that tells\n\n{}\n", spec.measurement);
    out.push_str("## What looks like it\n\n");
    write_rivals(&mut out, case.effect, &case.rivals);
    out.push_str("\n## What the diagnosis makes of this trace\n\n");
    write_found(&mut out, case);
    out
}

fn write_rivals(out: &mut String, effect: Effect, rivals: &[Rival]) {
    if rivals.is_empty() {
        let _ = writeln!(
            out,
            "Nothing: in this trace no other effect of the table has a residual like it (correlation above {:.0} %).",
            100.0 * ALIKE
        );
        return;
    }
    out.push_str(
        "In this trace; a motion that excites other things parts them otherwise. *Alike* is the correlation of what \
         both leave over.\n\n| rival | alike | told apart from | the measurement that shows the rival |\n|---|---|---|---|\n",
    );
    for rival in rivals {
        let apart = if rival.told_apart_from < effect.spec().upper {
            amount(effect, rival.told_apart_from)
        } else {
            "not by this trace".to_owned()
        };
        let spec = rival.effect.spec();
        let _ = writeln!(
            out,
            "| [{}]({}.md) | {:.0}\u{a0}% | {apart} | {} |",
            title(rival.effect),
            spec.id,
            100.0 * rival.correlation.abs(),
            spec.measurement
        );
    }
}

fn write_found(out: &mut String, case: &Case) {
    let found = &case.diagnosis;
    if found.effects.is_empty() {
        out.push_str("No effect is named.\n");
    }
    for one in &found.effects {
        let _ = writeln!(out, "- {}", named(case, one));
    }
    let verdict = pitchleak_view::text::sentence(found.verdict).split(':').next().unwrap_or_default();
    let _ = writeln!(out, "\nIts verdict: *{verdict}*.");
    if let Some(limit) = case.limit {
        let _ = writeln!(
            out,
            "Below {} (five standard deviations, if nothing else is missing) this trace would not show the effect.",
            amount(case.effect, limit)
        );
    }
}

fn named(case: &Case, one: &FoundEffect) -> String {
    let (factor, unit) = effect_unit(one.unit);
    let mut text = format!(
        "`{}` of {} ± {} {unit}",
        one.id,
        rounded(one.value * factor),
        rounded(1.96 * one.std * factor)
    );
    if one.id == case.effect.spec().id {
        let _ = write!(text, " (simulated: {})", amount(case.effect, case.size));
    }
    match (one.doubts_in_words(), one.confident) {
        (Some(doubt), _) => format!("{text}, in doubt: {doubt}"),
        (None, true) => format!("{text}, without doubt"),
        (None, false) => text,
    }
}

/// In people's units.
fn amount(effect: Effect, value: f64) -> String {
    let (factor, unit) = effect_unit(effect.spec().unit);
    format!("{} {unit}", rounded(value * factor))
}

/// To three digits.
fn rounded(value: f64) -> String {
    let digits = if value.abs() > 0.0 { value.abs().log10().floor() } else { 0.0 };
    if (-4.0..6.0).contains(&digits) {
        let decimals = (2.0 - digits).max(0.0) as usize;
        format!("{value:.decimals$}")
    } else {
        format!("{value:.2e}")
    }
}

/// The residual of the declared model against the variable that shows best what the effects found mend.
fn strongest(case: &Case) -> Option<&BinnedResidual> {
    let chi2 = |bins: &BinnedResidual| -> f64 {
        bins.mean.iter().zip(&bins.std_error).map(|(mean, error)| (mean / error).powi(2)).sum()
    };
    let (before, after) = (&case.diagnosis.before.binned_residuals, &case.diagnosis.after.binned_residuals);
    before
        .iter()
        .zip(after)
        .filter(|(before, _)| before.against != "direction" && variable(before.against).0 != "time")
        .filter(|(before, _)| varies(&before.at))
        .map(|(before, after)| (before, chi2(before) - chi2(after)))
        .filter(|(_, mended)| mended.is_finite())
        .max_by(|a, b| a.1.total_cmp(&b.1))
        .map(|(before, _)| before)
}

fn varies(values: &[f64]) -> bool {
    let (low, high) =
        values.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(*v), h.max(*v)));
    high - low > 1e-6 * high.abs().max(low.abs())
}

/// The residual over time, and against the variable with which it goes most.
pub fn figure(case: &Case) -> Result<String, FigureError> {
    let Some(bins) = strongest(case) else { return svg(&[], 1) };
    let (before, after) = (&case.diagnosis.before, &case.diagnosis.after);
    let (name, unit, y_label) = match bins.equation {
        Equation::ChamberA => ("chamber A", LPM_PER_M3S, "residual (L/min)"),
        Equation::ChamberB => ("chamber B", LPM_PER_M3S, "residual (L/min)"),
        Equation::Force => ("forces", 1.0, "residual (N)"),
    };
    let line = |label, ink, points| Line { label, ink, points };
    let over_time = |points: &[(f64, f64)]| points.iter().map(|(t, value)| (*t, value * unit)).collect();
    let (said, x_label, scale) = variable(bins.against);
    let binned = |bins: &BinnedResidual, errors: f64| {
        let values = bins.at.iter().zip(&bins.mean).zip(&bins.std_error);
        values.map(|((at, mean), error)| (at * scale, (mean + errors * error) * unit)).collect()
    };
    let mut lines = vec![line("declared model", Ink::Measured, binned(bins, 0.0))];
    let same = |other: &&BinnedResidual| other.equation == bins.equation && other.against == bins.against;
    if let Some(after) = after.binned_residuals.iter().find(same) {
        lines.push(line("", Ink::Limit, binned(after, -2.0)));
        lines.push(line("", Ink::Limit, binned(after, 2.0)));
        lines.push(line("with the effects found", Ink::Ours, binned(after, 0.0)));
    }
    let panels = [
        Panel {
            title: format!("{name}: over time"),
            x_label: "time (s)",
            y_label,
            lines: vec![
                line("declared model", Ink::Measured, over_time(&before.residual_over_time[bins.equation])),
                line(
                    "with the effects found",
                    Ink::Ours,
                    over_time(&after.residual_over_time[bins.equation]),
                ),
            ],
            y_range: None,
        },
        Panel { title: format!("{name}: against {said}"), x_label, y_label, lines, y_range: None },
    ];
    svg(&panels, 2)
}

/// A variable in words, its axis, and the factor to the axis' unit.
fn variable(id: &str) -> (&'static str, &'static str, f64) {
    match id {
        "load_pressure_pa" => ("the load pressure", "P_A − P_B (bar)", 1e-5),
        "pa_pa" => ("the pressure A", "P_A (bar)", 1e-5),
        "pb_pa" => ("the pressure B", "P_B (bar)", 1e-5),
        "x_m" => ("the position", "x (mm)", 1e3),
        "v_mps" => ("the speed", "speed (mm/s)", 1e3),
        "qa_m3s" => ("the flow A", "Q_A (L/min)", LPM_PER_M3S),
        "qb_m3s" => ("the flow B", "Q_B (L/min)", LPM_PER_M3S),
        "force_n" => ("the load", "force (kN)", 1e-3),
        "temp_k" => ("the oil's temperature", "temperature (K)", 1.0),
        _ => ("time", "time (s)", 1.0),
    }
}
