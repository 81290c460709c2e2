//! The residual of each equation, before and after, over time and against the variables with which it goes.

use super::super::chart::{Chart, Charts, Ink, Line};
use super::super::machine::table;
use crate::envelope::{Envelopes, Range, Spot};
use crate::residuals::{before_and_after, drawn_bins, in_a_row, name, people, people_unit, symbol};
use maud::{Markup, html};
use pitchleak::diagnose::{BinnedResidual, Diagnosis, Equation};
use pitchleak::report::capital;

/// Variables drawn per equation: those with which the residual goes most.
const MOST_DRAWN: usize = 4;
const BEFORE: &str = "declared model";
const AFTER: &str = "with the effects found";

const COLUMNS: usize = 6;

/// The residual of each equation over time, before and after, in people's units; trace after trace.
pub(super) fn over_time(diagnosis: &Diagnosis) -> Envelopes<COLUMNS> {
    let mut spots: Vec<(f64, usize, f64)> = Vec::new();
    for (side, fit) in [&diagnosis.before, &diagnosis.after].into_iter().enumerate() {
        for (number, (equation, points)) in fit.residual_over_time.iter().enumerate() {
            let (factor, _) = people_unit(equation);
            let column = 2 * number + side;
            spots.extend(in_a_row(points).into_iter().map(|(t, value)| (t, column, value * factor)));
        }
    }
    spots.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut envelopes = Envelopes::default();
    for same in spots.chunk_by(|a, b| a.0.total_cmp(&b.0).is_eq()) {
        if same.iter().all(|(.., value)| value.is_nan()) {
            envelopes.pause();
            continue;
        }
        let mut row = [None; COLUMNS];
        for (_, column, value) in same {
            if let Some(place) = row.get_mut(*column) {
                *place = Some(Spot::at(*value));
            }
        }
        envelopes.add(same.first().map_or(0.0, |first| first.0), &row);
    }
    envelopes
}

pub(super) fn body(diagnosis: &Diagnosis, rows: &Envelopes<COLUMNS>, charts: &mut Charts) -> Markup {
    let rows = rows.rows();
    let column = |column: usize| -> Vec<Option<Range>> {
        rows.iter().map(|row| row.ranges.get(column).copied().flatten()).collect()
    };
    let found = !diagnosis.effects.is_empty();
    let mut body = html! {
        p .note { "The residual of each equation on samples that were not fitted, averaged over 0.2 s: first over time, then against the variables \
            with which it goes most, as means in bins with two standard errors. An effect that the model lacks bends the grey line; with the \
            effects found the blue line lies on zero where they explain it." }
        (quality(diagnosis))
    };
    for (number, equation) in mended_most(diagnosis) {
        let mut lines = vec![Line::over_time(BEFORE, Ink::Grey, &column(2 * number))];
        if found {
            lines.push(Line::over_time(AFTER, Ink::Blue, &column(2 * number + 1)));
        }
        let (_, unit) = people_unit(equation);
        let title = format!("{}: residual", capital(name(equation)));
        let chart = Chart { title, unit, lines, ..Chart::default() };
        body = html! { (body) (charts.place(chart)) div .pair { (against(diagnosis, equation, charts)) } };
    }
    body
}

/// The equations and their numbers, those first of which the effects explain the largest share.
fn mended_most(diagnosis: &Diagnosis) -> Vec<(usize, Equation)> {
    let left = |equation: Equation| {
        let rmse = [&diagnosis.after, &diagnosis.before].map(|fit| fit.quality.rmse[equation]);
        let [Some(after), Some(before)] = rmse else { return 1.0 };
        after / before
    };
    let mut equations: Vec<_> = Equation::ALL.into_iter().enumerate().collect();
    equations.sort_by(|a, b| left(a.1).total_cmp(&left(b.1)));
    equations
}

fn against(diagnosis: &Diagnosis, equation: Equation, charts: &mut Charts) -> Markup {
    let mut own: Vec<_> = drawn_bins(diagnosis, equation).collect();
    own.sort_by(|a, b| b.0.strength().total_cmp(&a.0.strength()));
    let mut drawn = html! {};
    for (before, after) in own.into_iter().take(MOST_DRAWN) {
        let mut lines = vec![binned(BEFORE, Ink::Grey, before)];
        if !diagnosis.effects.is_empty() {
            lines.push(binned(AFTER, Ink::Blue, after));
        }
        let (_, unit) = people_unit(equation);
        let (_, x_unit) = people(before.against);
        let title = format!("{} against {}", capital(name(equation)), symbol(before.against));
        let x_label = format!("{}, {x_unit}", symbol(before.against));
        drawn = html! { (drawn) (charts.place(Chart { title, unit, x_label, lines, ..Chart::default() })) };
    }
    drawn
}

fn binned(label: &str, ink: Ink, bins: &BinnedResidual) -> Line {
    let (factor, _) = people_unit(bins.equation);
    let (scale, _) = people(bins.against);
    let ranges: Vec<_> = bins
        .mean
        .iter()
        .zip(&bins.std_error)
        .map(|(mean, error)| {
            Some(Range {
                low: (mean - 2.0 * error) * factor,
                median: mean * factor,
                high: (mean + 2.0 * error) * factor,
            })
        })
        .collect();
    let x = bins.at.iter().map(|at| Some(at * scale)).collect();
    Line { x: Some(x), dots: true, ..Line::over_time(label, ink, &ranges) }
}

/// Size and nature of the residual.
fn quality(diagnosis: &Diagnosis) -> Markup {
    let p = |p: Option<f64>| {
        p.map_or_else(|| "–".to_owned(), |p| if p < 1e-3 { "< 0.001".to_owned() } else { format!("{p:.3}") })
    };
    html! {
        (table(&["equation", "", "#of the sensors' noise", "#white, p", "#normal, p", "goes with"], html! {
            @for (equation, side, residual) in before_and_after(diagnosis) {
                tr {
                    th scope="row" { (capital(name(equation))) }
                    td { (side) }
                    td .number { (format!("{:.2}", residual.noise_ratio)) " times" }
                    td .number { (p(residual.whiteness_p)) }
                    td .number { (p(residual.normality_p)) }
                    td { (crate::text::companions(residual)) }
                }
            }
        }))
    }
}
