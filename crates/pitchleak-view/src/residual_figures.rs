//! Figures of the residual: over time, its autocorrelation and distribution, and against each variable.

use crate::figure::{FigureError, Ink, Line, Panel, svg};
use crate::in_a_row::in_a_row;
use crate::labels::{name, people, people_unit, symbol};
use pitchleak::diagnose::{BinnedResidual, Diagnosis, Equation, EquationResidual};

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
        let bins = diagnosis.before.binned_residuals.iter().zip(&diagnosis.after.binned_residuals);
        let own = bins.filter(|(before, _)| {
            before.equation == equation && before.varies() && before.against != "direction"
        });
        panels.extend(own.map(|(before, after)| against(before, after)));
        figures.push((format!("residual_{}.svg", equation.id()), svg(&panels, COLUMNS)?));
    }
    Ok(figures)
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
    let (scale, _) = people(after.against);
    let points = |bins: &BinnedResidual, errors: f64| {
        let values = bins.at.iter().zip(&bins.mean).zip(&bins.std_error);
        values.map(|((at, mean), error)| (at * scale, (mean + errors * error) * factor)).collect()
    };
    Panel {
        title: format!("{} against {}", name(after.equation), symbol(after.against)),
        x_label: axis(after.against),
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

fn axis(variable: &str) -> &'static str {
    match variable {
        "load_pressure_pa" => "P_L (bar)",
        "pa_pa" => "P_A (bar)",
        "pb_pa" => "P_B (bar)",
        "x_m" => "x (mm)",
        "v_mps" => "speed (mm/s)",
        "direction" => "direction of motion",
        "qa_m3s" => "Q_A (L/min)",
        "qb_m3s" => "Q_B (L/min)",
        "force_n" => "force (kN)",
        "temp_k" => "temperature (K)",
        _ => "time (s)",
    }
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
}
