//! The page of the reproduced experiment: the paper's figures beside ours, and the charts behind them.

use crate::table::five_digits;
use crate::{BulkModulusBound, Detection, Drawing, Report, ReproduceError, Reproduction, Row, Scored};
use maud::{Markup, html};
use pitchleak_view::figure::{self, Panel};
use pitchleak_view::page::chart::{Chart, Charts, Ink, Limit, Line};
use pitchleak_view::page::machine::{facts, rig, rough, short, table};
use pitchleak_view::page::{Card, Head, Page, Section, Tone};
use pitchleak_view::{Envelopes, Range, Spot};

/// Points of a curve: each chart has half the page's width.
const MOST_POINTS: usize = 320;

/// What the paper prints: leakage error, mean and peak, coefficient error, mean and peak, %, and convergence, s.
const PAPER: [&str; 5] = ["7.8", "11", "7.3", "13.3", "1–2"];
const PAPER_COEFFICIENT_MEAN_PERCENT: f64 = 7.3;

/// The report of a reproduction.
///
/// # Errors
/// Where a figure's window cannot be estimated.
pub fn page(reproduction: &Reproduction) -> Result<Page, ReproduceError> {
    let report = &reproduction.report;
    let drawings = reproduction.drawings()?;
    let longest = drawings
        .iter()
        .flat_map(|one| &one.panels)
        .flat_map(|panel| &panel.lines)
        .max_by_key(|line| line.points.len());
    let times = longest.map_or_else(Vec::new, |line| stretches(&line.points));
    let mut charts = Charts::over(times.iter().map(|(t_s, _)| *t_s));
    let mut sections = vec![Section { id: "table", title: "The paper's table", body: tables(report) }];
    for Drawing { id, title, panels, .. } in drawings {
        sections.push(Section { id, title, body: drawn(panels, &mut charts) });
    }
    sections.push(Section { id: "rest", title: "Tracking and bulk modulus", body: rest(report) });
    if let Some(detection) = &report.detection {
        sections.push(Section { id: "alarms", title: "Alarms", body: alarms(detection) });
    }
    sections.push(Section { id: "rig", title: "Rig", body: rig(&crate::rig()) });
    sections.push(Section { id: "made", title: "How this was made", body: made(report) });
    let subject = "Wu et al. 2011, Section IV".to_owned();
    Ok(Page { kind: "reproduce", subject, head: head(report), sections, charts })
}

fn head(report: &Report) -> Head {
    let errors = |estimator| range(report, estimator, |scored| scored.coefficient_mean_error_percent);
    let ([least, most], [law_least, law_most]) = (errors("rls"), errors("paper"));
    let [told, rows] = [true, false].map(|only| {
        report.rows.iter().filter(|row| row.estimator == "rls" && (row.identifiable || !only)).count()
    });
    let within = told > 0 && most <= PAPER_COEFFICIENT_MEAN_PERCENT;
    let sentence = format!(
        "The paper prints leak coefficients off by {PAPER_COEFFICIENT_MEAN_PERCENT} % on average. Here the default estimator's are off by {} to {} %, \
         those of the paper's law with its best gains by {} to {} % (medians of {} seeds, in the {told} of {rows} rows where 20 s tell the leak).",
        short_percent(least),
        short_percent(most),
        short_percent(law_least),
        short_percent(law_most),
        report.seeds
    );
    Head {
        word: if within { "ACCURACY MET" } else { "ACCURACY NOT MET" }.to_owned(),
        tone: if within { Tone::Sound } else { Tone::Caution },
        sentence,
        data: format!("4 winds, 2 leak settings, {} seeds a row", report.seeds),
        cards: vec![
            Card {
                title: "How to read it",
                body: html! { p { "The paper's experiment again on the emulated rig: its law and the default estimator on \
                the same noisy readings, beside what no estimator can better (the Cramér–Rao bound)." } },
            },
            Card { title: "What these windows do not tell", body: open(report) },
            Card { title: "Error beside the paper's, %", body: brief(report) },
        ],
    }
}

/// Least and greatest of a figure over the rows of an estimator in which the leak can be told.
fn range(report: &Report, estimator: &str, of: fn(&Scored) -> Option<f64>) -> [f64; 2] {
    let told = report.rows.iter().filter(|row| row.estimator == estimator && row.identifiable);
    let values = told.filter_map(|row| of(&row.median));
    values.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], value| [low.min(value), high.max(value)])
}

fn short_percent(value: f64) -> String {
    if value.is_finite() { rough(value) } else { "–".to_owned() }
}

fn open(report: &Report) -> Markup {
    let unknown = report.rows.iter().filter(|row| row.estimator == "rls" && !row.identifiable);
    let setting =
        |row: &Row| format!("{} m/s, case {}: {}", row.wind_mps, u8::from(row.case), leak(row.leak));
    let unknown: Vec<_> = unknown.map(setting).collect();
    let oil = report.bulk_modulus.iter().filter(|bound| !bound.identifiable).count();
    html! {
        ul {
            @for row in &unknown { li { (row) " leak: too little happens, by the bound." } }
            @if oil > 0 { li { "The bulk modulus of the oil in " (oil) " of " (report.bulk_modulus.len()) " settings." } }
            @if unknown.is_empty() && oil == 0 { li { "Nothing: every leak and the bulk modulus can be told everywhere." } }
        }
    }
}

fn leak(id: &str) -> String {
    id.replace("_a", " A").replace('_', " ")
}

fn brief(report: &Report) -> Markup {
    let text = |estimator, of| range(report, estimator, of).map(short_percent).join(" – ");
    html! {
        table {
            thead { tr { td {} th .number scope="col" { "leakage" } th .number scope="col" { "coefficient" } } }
            tbody {
                tr { th scope="row" { "the paper, printed" } td .number { (PAPER[0]) } td .number { (PAPER[2]) } }
                @for (name, id) in [("its law, here", "paper"), ("default estimator", "rls")] {
                    tr {
                        th scope="row" { (name) }
                        td .number { (text(id, |scored| scored.leakage_mean_error_percent)) }
                        td .number { (text(id, |scored| scored.coefficient_mean_error_percent)) }
                    }
                }
            }
        }
        p .note { "Mean error; medians, least to greatest over the rows." }
    }
}

fn tables(report: &Report) -> Markup {
    html! {
        p .note { "Medians over all seeds, worst in brackets; sensors with white noise of 3 σ = 1 % of full scale. The bound is that of the \
            coefficient at the end of a window, 1 σ." }
        (rows(&report.rows))
        h3 { "The same, each sensor with a constant bias of up to 1 % of full scale" }
        (rows(&report.rows_with_bias))
    }
}

/// Heads of the paper's table.
const HEADS: [&str; 10] = [
    "wind, case",
    "leak",
    "law",
    "#leakage, mean %",
    "#peak %",
    "#coefficient, mean %",
    "#peak %",
    "#within 5 % after s",
    "#bound %",
    "#covered %",
];

fn rows(rows: &[Row]) -> Markup {
    table(
        &HEADS,
        html! {
            @for row in rows {
                tr {
                    th scope="row" { (row.wind_mps) " m/s, " (u8::from(row.case)) }
                    td { (leak(row.leak)) }
                    td { (row.estimator) }
                    @for cell in cells(row) { td .number { (cell) } }
                    td .number { (rough(row.bound.coefficient_std_percent)) }
                    td .number { @match row.coverage_percent { Some(share) => (format!("{share:.0}")), None => "–" } }
                }
            }
        },
    )
}

/// The five figures, median and worst.
fn cells(row: &Row) -> [String; 5] {
    let Some(worst) = row.worst else {
        return ["not identifiable", "", "", "", ""].map(str::to_owned);
    };
    let text = |value: Option<f64>| value.map_or("–".to_owned(), five_digits).replace('>', "> ");
    let (medians, worst) = (row.median.values(), worst.values());
    std::array::from_fn(|at| format!("{} ({})", text(medians[at]), text(worst[at])))
}

/// A curve as a screen shows it.
fn stretches(points: &[(f64, f64)]) -> Vec<(f64, Option<Range>)> {
    let mut envelopes = Envelopes::<1>::of_at_most(MOST_POINTS);
    points.iter().for_each(|(t_s, value)| envelopes.add(*t_s, &[Some(Spot::at(*value))]));
    envelopes.rows().into_iter().map(|row| (row.t_s, row.ranges.first().copied().flatten())).collect()
}

fn drawn(panels: Vec<Panel>, charts: &mut Charts) -> Markup {
    let mut body = html! {};
    for panel in panels {
        let mut limits = Vec::new();
        let mut lines = Vec::new();
        for line in &panel.lines {
            if let [(_, value), _] = *line.points.as_slice() {
                limits.push(Limit { value, label: line.label.to_owned() });
                continue;
            }
            let name = if line.label.is_empty() { panel.y_label } else { line.label };
            let ranges: Vec<_> = stretches(&line.points).into_iter().map(|(_, range)| range).collect();
            lines.push(Line {
                bed: line.ink == figure::Ink::Measured,
                ..Line::over_time(name, ink(line.ink), &ranges)
            });
        }
        let range = panel.y_range.map(|(low, high)| [low, high]);
        let unit = panel.y_label.split_once('(').map_or("", |(_, unit)| unit.trim_end_matches(')'));
        body = html! { (body) (charts.place(Chart { title: panel.title, unit, lines, limits, range, ..Chart::default() })) };
    }
    html! { div .pair { (body) } }
}

fn ink(ink: figure::Ink) -> Ink {
    match ink {
        figure::Ink::Measured | figure::Ink::Limit => Ink::Grey,
        figure::Ink::Ours => Ink::Blue,
        figure::Ink::Paper => Ink::Vermilion,
    }
}

fn rest(report: &Report) -> Markup {
    let oil = |bound: &BulkModulusBound| {
        let text = format!("{} % → {} %", short(bound.prior_std_percent), rough(bound.bound_std_percent));
        if bound.identifiable { text } else { format!("{text}, not identifiable") }
    };
    html! {
        (table(&["wind, case", "#position error, % of stroke (rms, peak)", "#load error, % of peak (rms, peak)", "#leaks, L/min", "#bulk modulus, spread before and after 20 s"], html! {
            @for (t, bound) in report.tracking.iter().zip(&report.bulk_modulus) {
                tr {
                    th scope="row" { (t.wind_mps) " m/s, " (u8::from(t.case)) }
                    td .number { (format!("{:.2}, {:.2}", t.position_rms_percent_of_stroke, t.position_peak_percent_of_stroke)) }
                    td .number { (format!("{:.2}, {:.2}", t.load_rms_percent_of_peak, t.load_peak_percent_of_peak)) }
                    td .number { (format!("{:.2}, {:.2}", t.internal_mean_lpm, t.external_a_mean_lpm)) }
                    td .number { (oil(bound)) }
                }
            }
        }))
    }
}

fn alarms(detection: &Detection) -> Markup {
    let seconds = |delay: Option<f64>| delay.map_or_else(|| "–".to_owned(), |delay| format!("{delay:.1}"));
    html! {
        p { (detection.false_alarms) " false alarms in " (short(detection.sound_hours)) " hours of sound operation; with biases of up to 1 % of full scale "
            (detection.biased_false_alarms) " of " (detection.biased_runs) " sound runs raised one." }
        (table(&["wind", "leak", "#L/min", "#found within a minute", "#delay, s (longest)", "#another named as well"], html! {
            @for delay in &detection.delays {
                tr {
                    th scope="row" { (delay.wind_mps) " m/s" }
                    td { (leak(delay.leak)) }
                    td .number { (delay.size_lpm) }
                    td .number { (format!("{:.0} %", delay.detected_percent)) }
                    td .number { (seconds(delay.median_delay_s)) " (" (seconds(delay.longest_delay_s)) ")" }
                    td .number { (format!("{:.0} %", delay.misnamed_percent)) }
                }
            }
        }))
    }
}

fn made(report: &Report) -> Markup {
    let gains = report.paper_gains.first().map_or_else(String::new, |best| {
        format!(
            "the best of {}: lambda {} 1/s, gamma {}",
            report.paper_gains.len(),
            best.lambda_per_s,
            best.gamma
        )
    });
    facts(&[
        ("Program", pitchleak_view::page::generator()),
        ("Seeds per row", report.seeds.to_string()),
        ("Gains of the paper's law", gains),
        (
            "The paper prints",
            format!(
                "leakage error {} % mean, {} % peak; coefficient {} %, {} %; converged within {} s",
                PAPER[0], PAPER[1], PAPER[2], PAPER[3], PAPER[4]
            ),
        ),
        ("Form of the data", report.schema.to_owned()),
    ])
}
