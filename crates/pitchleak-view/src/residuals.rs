//! Residuals for people: names and units, several traces on one axis, and figures: over time, autocorrelation and distribution,
//! against each variable.

use crate::figure::{FigureError, Ink, Line, Panel, svg};
use pitchleak::diagnose::{
    BinnedResidual, Diagnosis, Equation, EquationResidual, HoldLeak, LeakEstimate, LeakEstimates,
};
use pitchleak::report::with_interval;
use pitchleak::units::{LPM_PER_M3S, effect_unit};

/// Lags of the autocorrelation, in rows.
const LAGS: usize = 30;
/// Classes of the histogram, each half a standard deviation wide, from −4 to 4.
const CLASSES: usize = 16;
const COLUMNS: usize = 3;

/// One figure per equation, by file name: `residual_chamber_a.svg` and so on. Grey: the declared model; blue:
/// with the effects found.
///
/// # Errors
/// [`FigureError`] when the plotting library gives up.
pub fn residual_figures(diagnosis: &Diagnosis) -> Result<Vec<(String, String)>, FigureError> {
    let mut figures = Vec::new();
    for (equation, before) in diagnosis.before.residuals.iter() {
        let (Some(before), Some(after)) = (before, &diagnosis.after.residuals[equation]) else { continue };
        let mut panels = vec![
            over_time(diagnosis, equation),
            autocorrelation(equation, before, after),
            distribution(equation, before, after),
        ];
        panels.extend(drawn_bins(diagnosis, equation).map(|(before, after)| against(before, after)));
        figures.push((format!("residual_{}.svg", equation.id()), svg(&panels, COLUMNS)?));
    }
    Ok(figures)
}

/// An equation's residual against each variable that is drawn, before and after.
pub(crate) fn drawn_bins(
    diagnosis: &Diagnosis,
    equation: Equation,
) -> impl Iterator<Item = (&BinnedResidual, &BinnedResidual)> {
    let bins = diagnosis.before.binned_residuals.iter().zip(&diagnosis.after.binned_residuals);
    bins.filter(move |(one, _)| one.equation == equation && one.varies() && one.against != "direction")
}

fn over_time(diagnosis: &Diagnosis, equation: Equation) -> Panel {
    let (factor, _) = people_unit(equation);
    let scaled =
        |points: &[(f64, f64)]| in_a_row(points).into_iter().map(|(t, value)| (t, value * factor)).collect();
    let (before, after) = (&diagnosis.before.residual_over_time, &diagnosis.after.residual_over_time);
    Panel {
        title: format!("{}, held-out samples", name(equation)),
        x_label: "time (s)",
        y_label: label(equation),
        lines: vec![
            line("declared model", Ink::Measured, scaled(&before[equation])),
            line("with the effects found", Ink::Ours, scaled(&after[equation])),
        ],
        y_range: None,
    }
}

/// The label of the residual.
fn label(equation: Equation) -> &'static str {
    if equation == Equation::Force { "residual (N)" } else { "residual (L/min)" }
}

fn line(label: &'static str, ink: Ink, points: Vec<(f64, f64)>) -> Line {
    Line { label, ink, points }
}

fn autocorrelation(equation: Equation, before: &EquationResidual, after: &EquationResidual) -> Panel {
    let points = |residual: &EquationResidual| {
        let lags = residual.autocorrelation(LAGS).into_iter().enumerate();
        lags.map(|(at, value)| ((at + 1) as f64, value)).collect()
    };
    // White numbers stay within ± 1.96/√n with 95 % probability.
    let bound = 1.96 / (after.count as f64).sqrt();
    let level = |value: f64| line("", Ink::Limit, vec![(1.0, value), (LAGS as f64, value)]);
    Panel {
        title: format!("{}: autocorrelation, white within the lines", name(equation)),
        x_label: "lag (0.1 s)",
        y_label: "correlation",
        lines: vec![
            line("", Ink::Measured, points(before)),
            line("", Ink::Ours, points(after)),
            level(bound),
            level(-bound),
        ],
        y_range: None,
    }
}

fn distribution(equation: Equation, before: &EquationResidual, after: &EquationResidual) -> Panel {
    let normal = |z: f64| (-0.5 * z * z).exp() / std::f64::consts::TAU.sqrt();
    let curve = (-80..=80).map(|k| f64::from(k) / 20.0).map(|z| (z, normal(z))).collect();
    Panel {
        title: format!("{}: distribution, normal dark", name(equation)),
        x_label: "standard deviations",
        y_label: "density",
        lines: vec![
            line("", Ink::Measured, histogram(&before.white)),
            line("", Ink::Ours, histogram(&after.white)),
            line("", Ink::Limit, curve),
        ],
        y_range: None,
    }
}

/// The outline of a histogram of density one; numbers beyond its ends count in the last class.
fn histogram(white: &[f64]) -> Vec<(f64, f64)> {
    let (width, start) = (0.5, -4.0);
    let mut counts = [0_usize; CLASSES];
    for value in white {
        let class = ((value - start) / width).clamp(0.0, (CLASSES - 1) as f64) as usize;
        if let Some(count) = counts.get_mut(class) {
            *count += 1;
        }
    }
    let density = |count: usize| count as f64 / (white.len().max(1) as f64 * width);
    let classes = counts.into_iter().enumerate();
    classes
        .flat_map(|(class, count)| {
            let left = start + class as f64 * width;
            [(left, density(count)), (left + width, density(count))]
        })
        .collect()
}

/// Means in bins; thin lines: two standard errors about the residual with the effects.
fn against(before: &BinnedResidual, after: &BinnedResidual) -> Panel {
    let (factor, _) = people_unit(after.equation);
    let (x_label, scale) = axis(after.against);
    let points = |bins: &BinnedResidual, errors: f64| {
        let values = bins.at.iter().zip(&bins.mean).zip(&bins.std_error);
        values.map(|((at, mean), error)| (at * scale, (mean + errors * error) * factor)).collect()
    };
    Panel {
        title: format!("{} against {}", name(after.equation), symbol(after.against)),
        x_label,
        y_label: label(after.equation),
        lines: vec![
            line("", Ink::Measured, points(before, 0.0)),
            line("", Ink::Limit, points(after, -2.0)),
            line("", Ink::Limit, points(after, 2.0)),
            line("", Ink::Ours, points(after, 0.0)),
        ],
        y_range: None,
    }
}

/// A step so many times the usual one is a pause.
const PAUSE: f64 = 5.0;

/// One trace after the other: each begins where the one before ended. Where one ends, or pauses, a point without a value
/// breaks the line.
pub(crate) fn in_a_row(points: &[(f64, f64)]) -> Vec<(f64, f64)> {
    let mut steps: Vec<f64> =
        points.windows(2).filter_map(|pair| Some(pair.last()?.0 - pair.first()?.0)).collect();
    steps.retain(|step| *step > 0.0);
    steps.sort_by(f64::total_cmp);
    let usual = steps.get(steps.len() / 2).copied().unwrap_or(f64::INFINITY);
    let (mut row, mut start, mut last) = (Vec::with_capacity(points.len()), 0.0, None);
    for &(t, value) in points {
        if let Some(last) = last {
            let step = t - last;
            if step < 0.0 {
                start += last;
            }
            if step < 0.0 || step > PAUSE * usual {
                row.push((start + t - usual.min(0.5 * t.max(0.0)), f64::NAN));
            }
        }
        row.push((start + t, value));
        last = Some(t);
    }
    row
}

/// Each equation's error on held-out samples, before and after, in people's unit.
pub(crate) fn rms_errors(diagnosis: &Diagnosis) -> impl Iterator<Item = (Equation, [f64; 2], &'static str)> {
    Equation::ALL.into_iter().filter_map(|equation| {
        let [before, after] = [&diagnosis.before, &diagnosis.after].map(|fit| fit.quality.rmse[equation]);
        let (factor, unit) = people_unit(equation);
        Some((equation, [before? * factor, after? * factor], unit))
    })
}

/// Each equation's residual before and, where effects were found, after.
pub(crate) fn before_and_after(
    diagnosis: &Diagnosis,
) -> impl Iterator<Item = (Equation, &'static str, &EquationResidual)> {
    let sides = [("before", &diagnosis.before.residuals), ("after", &diagnosis.after.residuals)];
    let shown = if diagnosis.effects.is_empty() { 1 } else { 2 };
    let of = move |equation| {
        let shown = sides.into_iter().take(shown);
        shown.filter_map(move |(side, residuals)| Some((equation, side, residuals[equation].as_ref()?)))
    };
    Equation::ALL.into_iter().flat_map(of)
}

/// Chambers that were held under pressure, and what leaves them.
pub(crate) fn holds(diagnosis: &Diagnosis) -> impl Iterator<Item = (&'static str, HoldLeak)> {
    let holds = diagnosis.holds.unwrap_or_default();
    [("A", holds.chamber_a), ("B", holds.chamber_b)]
        .into_iter()
        .filter_map(|(name, hold)| Some((name, hold?)))
}

/// Leaks and bulk modulus of a fit.
pub(crate) fn estimates(leaks: &LeakEstimates) -> [LeakEstimate; 4] {
    [
        leaks.internal_leak_coefficient,
        leaks.external_leak_a_coefficient,
        leaks.external_leak_b_coefficient,
        leaks.bulk_modulus,
    ]
}

/// Name of an equation in text and figures.
pub(crate) fn name(equation: Equation) -> &'static str {
    match equation {
        Equation::ChamberA => "chamber A",
        Equation::ChamberB => "chamber B",
        Equation::Force => "force",
    }
}

/// Factor from SI to people's unit of an equation's residual, and that unit.
pub(crate) fn people_unit(equation: Equation) -> (f64, &'static str) {
    if equation == Equation::Force { (1.0, "N") } else { (LPM_PER_M3S, "L/min") }
}

/// Variables with their axes, and the factor from SI to the axis' unit.
const VARIABLES: [(&str, &str, f64); 10] = [
    ("load_pressure_pa", "P_L (bar)", 1e-5),
    ("pa_pa", "P_A (bar)", 1e-5),
    ("pb_pa", "P_B (bar)", 1e-5),
    ("x_m", "x (mm)", 1e3),
    ("v_mps", "speed (mm/s)", 1e3),
    ("direction", "direction", 1.0),
    ("qa_m3s", "Q_A (L/min)", LPM_PER_M3S),
    ("qb_m3s", "Q_B (L/min)", LPM_PER_M3S),
    ("force_n", "force (kN)", 1e-3),
    ("temp_k", "temperature (K)", 1.0),
];

/// The axis of a variable, and the factor to its unit.
fn axis(variable: &str) -> (&'static str, f64) {
    let known = VARIABLES.into_iter().find(|(id, ..)| *id == variable);
    known.map_or(("time (s)", 1.0), |(_, axis, factor)| (axis, factor))
}

/// Name of a variable in text and figures.
pub(crate) fn symbol(variable: &str) -> &'static str {
    let (axis, _) = axis(variable);
    axis.split_once(" (").map_or(axis, |(symbol, _)| symbol)
}

/// Factor to people's unit, and that unit.
pub(crate) fn people(variable: &str) -> (f64, &'static str) {
    let (axis, factor) = axis(variable);
    (factor, axis.split_once(" (").map_or("", |(_, unit)| unit.trim_end_matches(')')))
}

/// With its 95 % interval, in people's units.
pub(crate) fn quantity(value: f64, std: Option<f64>, unit: &str) -> String {
    let (factor, unit) = effect_unit(unit);
    let size = with_interval(value * factor, std.map(|std| std * factor));
    format!("{size} {}", unit.replace('*', "·"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_histogram_holds_every_number() {
        let outline = histogram(&[-9.0, -0.1, 0.1, 0.2, 7.0]);
        let area: f64 = outline.chunks(2).map(|class| (class[1].0 - class[0].0) * class[0].1).sum();
        assert!((area - 1.0).abs() < 1e-12, "{area}");
    }

    #[test]
    fn a_line_breaks_where_a_trace_pauses_and_between_traces() {
        let seconds = |from: u32, to: u32| (from..to).map(|t| (f64::from(t), 1.0));
        let points: Vec<_> = seconds(0, 10).chain(seconds(60, 70)).chain(seconds(1, 10)).collect();
        let row = in_a_row(&points);
        let breaks: Vec<_> = row.iter().filter(|point| point.1.is_nan()).map(|point| point.0).collect();
        assert_eq!(breaks, [59.0, 69.5]);
        assert!(row.windows(2).all(|pair| pair[0].0 < pair[1].0), "{row:?}");
        assert_eq!(row.last(), Some(&(78.0, 1.0)));
    }
}
