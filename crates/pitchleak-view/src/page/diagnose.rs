//! The page of a diagnosis: from the residual to the effect that explains it, and how sure that is.
//!
//! The residual of each equation, before and after, over time and against the variables with which it goes.

use super::chart::{Chart, Charts, Ink, Line};
use super::machine::{channels, facts, prose, rig, short, table};
use super::{Card, Head, Page, Section, Tone};
use crate::envelope::{Envelopes, Range, Spot};
use crate::residuals::{
    before_and_after, drawn_bins, estimates, holds, in_a_row, name, people, people_unit, quantity,
    rms_errors, symbol,
};
use crate::text::{ESTIMATES, constants};
use maud::{Markup, html};
use pitchleak::diagnose::{
    BinnedResidual, Diagnosis, Equation, FoundEffect, HoldLeak, LeakEstimate, Verdict,
};
use pitchleak::report::{capital, with_interval};
use pitchleak::rig::Rig;
use pitchleak::units::LPM_PER_M3S;

impl Page {
    /// The report of a diagnosis of `traces` of `machine`.
    pub fn of_diagnosis(diagnosis: &Diagnosis, machine: &Rig, traces: &[String]) -> Self {
        let rows = over_time(diagnosis);
        let mut charts = Charts::over(rows.rows().iter().map(|row| row.t_s));
        let mut sections = vec![
            Section { id: "effects", title: "What the model lacks", body: effects(diagnosis) },
            Section {
                id: "residuals",
                title: "From residual to effect",
                body: residual(diagnosis, &rows, &mut charts),
            },
            Section { id: "leaks", title: "Leaks before and after", body: leaks(diagnosis) },
            Section { id: "sure", title: "What it would take to be sure", body: sure(diagnosis) },
            Section { id: "rig", title: "Rig", body: rig(machine) },
            Section { id: "made", title: "How this was made", body: made(diagnosis, traces) },
        ];
        if diagnosis.wiring.is_some() {
            let body = channels(&[], diagnosis.wiring.as_ref());
            sections.insert(0, Section { id: "channels", title: "Wiring", body });
        }
        let subject = match traces {
            [first, _, ..] => format!("{first} and {} more", traces.len() - 1),
            _ => traces.concat(),
        };
        Self { kind: "diagnose", subject, head: head(diagnosis), sections, charts }
    }
}

// The first screen: verdict, what to do, what stays open, and the error before and after.

fn head(diagnosis: &Diagnosis) -> Head {
    let (word, tone) = match diagnosis.verdict {
        _ if diagnosis.wiring.is_some() => ("CHECK THE WIRING", Tone::Caution),
        Verdict::Explained => ("EXPLAINED", Tone::Sound),
        Verdict::PartlyExplained => ("PARTLY EXPLAINED", Tone::Caution),
        Verdict::NoMissingEffect => ("NO MISSING EFFECT", Tone::Sound),
        Verdict::Unexplained => ("UNEXPLAINED", Tone::Caution),
        Verdict::InsufficientExcitation => ("TOO LITTLE HAPPENS", Tone::Caution),
    };
    let samples = diagnosis.samples;
    let cards = vec![
        Card { title: "What to do", body: to_do(diagnosis) },
        Card { title: "What these traces do not tell", body: open(diagnosis) },
        Card { title: "Error on samples that were not fitted (rms)", body: errors(diagnosis) },
    ];
    Head {
        word: word.to_owned(),
        tone,
        sentence: sentence(diagnosis),
        data: format!("{} samples, {} of them fitted", samples.read, samples.fitted),
        cards,
    }
}

fn sentence(diagnosis: &Diagnosis) -> String {
    if let Some(wiring) = &diagnosis.wiring {
        return format!("{}.", capital(&wiring.suggestion));
    }
    let (_, says) = crate::text::sentence(diagnosis.verdict).split_once(": ").unwrap_or_default();
    let named: Vec<_> =
        diagnosis.effects.iter().map(|effect| format!("{} of {}", spoken(effect.id), size(effect))).collect();
    let named = if named.is_empty() { String::new() } else { format!(": {}", named.join(", ")) };
    let changes = match diagnosis.leak_changes.len() {
        0 => String::new(),
        1 => " A leak changes once.".to_owned(),
        count => format!(" Leaks change {count} times."),
    };
    format!("{}{named}.{changes}", capital(says))
}

fn to_do(diagnosis: &Diagnosis) -> Markup {
    if diagnosis.wiring.is_some() {
        return html! { p { "Mend the wiring or the rig file, as below, and diagnose again: beside such a mistake no effect is worth a word." } };
    }
    match diagnosis.verdict {
        Verdict::NoMissingEffect => {
            html! { p { "Nothing: " code { "pitchleak replay" } " can be believed with this rig file." } }
        }
        Verdict::InsufficientExcitation => {
            html! { p { "Record longer, with the piston moving, both pressures changing, and all that is \
            normal for this machine in it." } }
        }
        _ if diagnosis.effects.is_empty() => {
            html! { p { "Look below with which variable the residual goes: that is where the missing \
            effect acts." } }
        }
        _ => html! {
            ol {
                @for effect in &diagnosis.effects {
                    li {
                        strong { (capital(&spoken(effect.id))) ": " }
                        @if effect.confident { (prose(effect.remedy)) } @else { "not sure yet; see what would settle it. If so: " (prose(effect.remedy)) }
                    }
                }
                @if let Some(next) = &diagnosis.next_measurement {
                    @let [one, other] = next.between.map(spoken);
                    li { strong { "To tell " (one) " from " (other) ": " } (next.measurement) }
                }
                li { code { "pitchleak diagnose --save-rig corrected.toml" } " writes what was found into a rig file, which "
                    code { "pitchleak replay" } " then corrects for." }
            }
        },
    }
}

fn open(diagnosis: &Diagnosis) -> Markup {
    let after = ESTIMATES.into_iter().zip(estimates(&diagnosis.after.leaks));
    let unknown: Vec<_> = after.filter(|(_, entry)| !entry.identifiable).map(|(name, _)| name).collect();
    let doubtful: Vec<_> = diagnosis.effects.iter().filter(|effect| !effect.confident).collect();
    html! {
        @if unknown.is_empty() && doubtful.is_empty() {
            p { "Nothing is open: what is named stands by itself, and leaks and bulk modulus are identified." }
        } @else {
            ul {
                @for effect in doubtful {
                    li { strong { (capital(&spoken(effect.id))) } @if let Some(doubt) = effect.doubts_in_words() { ": " (doubt) } "." }
                }
                @for name in unknown { li { strong { (capital(name)) } ": these traces tell no more than the rig file does." } }
            }
        }
    }
}

fn errors(diagnosis: &Diagnosis) -> Markup {
    let found = !diagnosis.effects.is_empty();
    html! {
        table {
            thead { tr {
                td {} th .number scope="col" { "before" }
                @if found { th .number scope="col" { "after" } th .number scope="col" { "less by" } }
            } }
            tbody {
                @for (equation, [before, after], unit) in rms_errors(diagnosis) {
                    tr {
                        th scope="row" { (name(equation)) ", " (unit) }
                        td .number { (short(before)) }
                        @if found {
                            td .number { (short(after)) }
                            td .number { (percent(1.0 - after / before)) }
                        }
                    }
                }
            }
        }
    }
}

/// No zero is negative.
fn percent(share: f64) -> String {
    format!("{:.0} %", (100.0 * share).round() + 0.0)
}

// The sections below it.

/// An effect's id as words.
fn spoken(id: &str) -> String {
    id.replace('_', " ")
}

fn made(diagnosis: &Diagnosis, traces: &[String]) -> Markup {
    html! {
        ul { @for trace in traces { li { bdi { (trace) } } } }
        (facts(&[
            ("Program", super::generator()),
            ("Samples read", diagnosis.samples.read.to_string()),
            ("Samples fitted", diagnosis.samples.fitted.to_string()),
            ("Form of the data", "pitchleak.diagnose/1".to_owned()),
        ]))
    }
}

/// Rivals and the measurements that part them, what speaks for and against, what would not have shown.
fn sure(diagnosis: &Diagnosis) -> Markup {
    let separating: Vec<_> =
        diagnosis.effects.iter().filter(|effect| effect.separated_by.is_some()).collect();
    html! {
        @if separating.is_empty() {
            p { "No rival explains these traces as well; a second recording on another day, given with " code { "--test" } ", would confirm it." }
        } @else {
            p { "Measurements that tell the rivals apart:" }
            ul { @for effect in separating { li { strong { (capital(&spoken(effect.id))) } ": " (effect.separated_by.as_deref().unwrap_or_default()) } } }
        }
        @if !diagnosis.interactions.is_empty() {
            h3 { "Effects that act on each other" }
            ul { @for one in &diagnosis.interactions {
                li { (one.effects.map(spoken).join(" and ")) ": " (format!("{:.0} σ, would mend {:.1} %", one.sigma, one.mended_percent)) }
            } }
        }
        @if !diagnosis.notes.is_empty() {
            h3 { "What speaks for the verdict, and against it" }
            ul { @for note in &diagnosis.notes { li { (prose(&capital(note))) } } }
        }
        @if !diagnosis.not_detectable_below.is_empty() {
            details {
                summary { "What would not have shown: the smallest size of each further effect that these traces would have told (5 σ)" }
                (facts(&diagnosis.not_detectable_below.iter().map(|(id, size)| (*id, quantity(size.value, None, size.unit))).collect::<Vec<_>>()))
            }
        }
    }
}

/// What the model lacks, each effect with its remedy, doubt and rivals.
fn effects(diagnosis: &Diagnosis) -> Markup {
    html! {
        @if diagnosis.effects.is_empty() { p { "No effect is named." } }
        @for effect in &diagnosis.effects {
            h3 { (capital(&spoken(effect.id))) ": " (size(effect)) " "
                @if effect.confident { span .tag .is-sound { "sure of the name" } } @else { span .tag .is-caution { "doubtful" } } }
            p { (prose(effect.cause)) " " strong { (prose(effect.remedy)) } }
            @if let Some(doubt) = effect.doubts_in_words() { p { "Doubtful: " (doubt) "." } }
            (rivals(effect))
            p .note { "With it the error on samples that were not fitted falls by " (format!("{:.1}", effect.rmse_reduction_percent)) " % in the balance it \
                mends most; chance would show as much with a probability of " (chance(effect.p_value)) "."
                @for (_, constant) in constants(effect) { " " (constant) "." } }
        }
        @if !diagnosis.calibration.is_empty() {
            h3 { "Sensors, within what the rig file allows" }
            (facts(&diagnosis.calibration.iter().map(|one| (one.id, quantity(one.value, Some(one.std), one.unit))).collect::<Vec<_>>()))
        }
    }
}

fn size(effect: &FoundEffect) -> String {
    quantity(effect.value, Some(effect.std), effect.unit)
}

fn rivals(effect: &FoundEffect) -> Markup {
    html! {
        @if !effect.confusable_with.is_empty() {
            p { "Rivals that these traces cannot tell from it: " (effect.confusable_with.iter().map(|id| spoken(id)).collect::<Vec<_>>().join(", ")) "."
                @if let Some(separated_by) = &effect.separated_by { " What would tell: " strong { (separated_by) } } }
        }
    }
}

fn chance(p: f64) -> String {
    if p < 1e-6 { "less than one in a million".to_owned() } else { format!("{p:.1e}") }
}

/// Leaks before and after, in motion and at rest.
fn leaks(diagnosis: &Diagnosis) -> Markup {
    let [before, after] = [&diagnosis.before, &diagnosis.after].map(|fit| estimates(&fit.leaks));
    let text = |entry: LeakEstimate| {
        if entry.unit == "Pa" {
            format!("{} GPa", with_interval(entry.value * 1e-9, Some(entry.std * 1e-9)))
        } else {
            quantity(entry.value, Some(entry.std), entry.unit)
        }
    };
    let mark = |entry: LeakEstimate| match entry {
        LeakEstimate { physical: false, .. } => " (impossible)",
        LeakEstimate { identifiable: false, .. } => " (not identified)",
        _ => "",
    };
    html! {
        (table(&["", "#before, 95 %", "#after, 95 %"], html! {
            @for (name, (before, after)) in ESTIMATES.into_iter().zip(before.into_iter().zip(after)) {
                tr {
                    th scope="row" { (capital(name)) }
                    td .number { (text(before)) (mark(before)) }
                    td .number { (text(after)) (mark(after)) }
                }
            }
        }))
        @if diagnosis.holds.is_some() {
            h3 { "At rest against in motion" }
            p .note { "Flow that leaves a chamber while the piston stands, measured, beside what the model fitted to motion foretells." }
            @for (chamber, hold) in holds(diagnosis) { (held(chamber, &hold)) }
        }
    }
}

fn held(chamber: &str, hold: &HoldLeak) -> Markup {
    let flow = |value: f64, std: f64| with_interval(value * LPM_PER_M3S, Some(std * LPM_PER_M3S));
    let [before, after] = hold.apart_sigma();
    html! {
        p { "Chamber " (chamber) ", " (hold.count) " holds of 1 s at " (format!("{:.0} bar", hold.mean_pressure_pa / 1e5)) ": "
            strong { (flow(hold.leak_m3s, hold.std_m3s)) " L/min" } " measured; foretold " (flow(hold.predicted_before_m3s, hold.predicted_before_std_m3s))
            " before (" (format!("{before:.1}")) " σ apart), " (flow(hold.predicted_after_m3s, hold.predicted_after_std_m3s)) " after ("
            (format!("{after:.1}")) " σ apart)." }
    }
}

/// Variables drawn per equation: those with which the residual goes most.
const MOST_DRAWN: usize = 4;
const BEFORE: &str = "declared model";
const AFTER: &str = "with the effects found";

const COLUMNS: usize = 6;

/// The residual of each equation over time, before and after, in people's units; trace after trace.
fn over_time(diagnosis: &Diagnosis) -> Envelopes<COLUMNS> {
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

fn residual(diagnosis: &Diagnosis, rows: &Envelopes<COLUMNS>, charts: &mut Charts) -> Markup {
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

#[cfg(test)]
mod tests {

    #[test]
    fn no_zero_is_negative() {
        assert_eq!([-1e-4, 1e-4, -0.6].map(super::percent), ["0 %", "0 %", "-60 %"]);
    }
}
