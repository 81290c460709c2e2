//! Charts of a page: what is drawn, as numbers for the page's script and as a table for those who read or print it.

use crate::envelope::{Range, extremes};
use crate::text::significant;
use maud::{Markup, html};
use pitchleak::times::Clock;
use serde::Serialize;

/// Rows of a table at most.
const MOST_TABLE_ROWS: usize = 16;
/// A line's numbers keep a 300-thousandth of its span or less.
const DIGITS: f64 = 5.5;

/// Colours by what they stand for; the style sheet has them for light, dark and print.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ink {
    /// The internal leak, chamber A, or the estimate.
    Blue,
    /// The external leak at A, or the rival.
    Vermilion,
    /// The external leak at B.
    Green,
    /// What was measured, or asked for.
    Grey,
}

impl Ink {
    fn number(self) -> u8 {
        self as u8
    }

    /// Its class in the style sheet.
    pub(super) fn class(self) -> String {
        format!("ink-{}", self.number())
    }
}

impl Serialize for Ink {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_u8(self.number())
    }
}

/// One line: the best or middle values, with their lower and upper edges where they have any.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Line {
    /// In the legend.
    pub name: String,
    /// None: the script chooses.
    pub ink: Option<Ink>,
    /// Where the values stand; none where that is the page's common time.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub x: Option<Vec<Option<f64>>>,
    /// Lower edges.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub low: Option<Vec<Option<f64>>>,
    /// The values.
    pub mid: Vec<Option<f64>>,
    /// Upper edges.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub high: Option<Vec<Option<f64>>>,
    /// Drawn in dashes.
    pub dashed: bool,
    /// Drawn wide, as a bed for others.
    pub bed: bool,
    /// Its values are marked.
    pub dots: bool,
}

/// A value across the chart.
#[derive(Clone, Debug, Serialize)]
pub struct Limit {
    /// In the chart's unit.
    pub value: f64,
    /// Beside it.
    pub label: String,
}

/// A shaded time.
#[derive(Clone, Debug, Serialize)]
pub struct Span {
    /// s.
    pub from: f64,
    /// s; none: to the end.
    pub to: Option<f64>,
    /// Of the shade.
    pub ink: Ink,
}

/// A chart.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Chart {
    /// Above it.
    #[serde(skip)]
    pub title: String,
    /// What a reader should know to read it.
    #[serde(skip)]
    pub note: &'static str,
    /// Of the vertical axis.
    pub unit: &'static str,
    /// Of the horizontal axis, where it isn't time.
    pub x_label: String,
    /// What it draws.
    pub lines: Vec<Line>,
    /// Values across it.
    pub limits: Vec<Limit>,
    /// Times that are shaded.
    pub spans: Vec<Span>,
    /// Begins wild: the axis takes in what is usual.
    pub settles: bool,
    /// Of the vertical axis, where it is not that of the lines.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub range: Option<[f64; 2]>,
}

impl Line {
    /// A line over the page's common time.
    pub fn over_time(name: impl Into<String>, ink: Ink, ranges: &[Option<Range>]) -> Self {
        let of = |of: fn(&Range) -> f64| ranges.iter().map(|range| range.as_ref().map(of)).collect();
        let (low, mid, high) = (of(|range| range.low), of(|range| range.median), of(|range| range.high));
        Self { name: name.into(), ink: Some(ink), mid, ..Self::default() }.between(low, high)
    }

    /// With edges, unless they are the line itself.
    #[must_use]
    pub fn between(mut self, low: Vec<Option<f64>>, high: Vec<Option<f64>>) -> Self {
        let apart = low.iter().zip(&high).any(|(low, high)| low.zip(*high).is_some_and(|(l, h)| l < h));
        let edge = |edge: Vec<Option<f64>>| apart.then(|| rounded(edge.into_iter()));
        (self.low, self.high) = (edge(low), edge(high));
        self.mid = rounded(self.mid.into_iter());
        self
    }

    /// In dashes.
    #[must_use]
    pub fn dashed(self) -> Self {
        Self { dashed: true, ..self }
    }

    fn is_empty(&self) -> bool {
        self.mid.iter().all(Option::is_none)
    }
}

/// Numbers with the decimals that their span asks for: short in the page, and no eye can tell.
fn rounded(values: impl Iterator<Item = Option<f64>>) -> Vec<Option<f64>> {
    let finite: Vec<_> = values.map(|value| value.filter(|value| value.is_finite())).collect();
    let [low, high] = extremes(finite.iter().flatten().copied());
    let span = (high - low).max(1e-6 * high.abs().max(low.abs())).max(1e-12);
    let scale = 10f64.powf((DIGITS - span.log10()).floor());
    finite.into_iter().map(|value| value.map(|value| (value * scale).round() / scale)).collect()
}

/// The charts of a page, in the order of their places, and the time that those over time share, s.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Charts {
    t: Vec<Option<f64>>,
    /// What the trace's clock shows where its seconds begin, s since midnight.
    #[serde(skip_serializing_if = "Option::is_none")]
    clock: Option<f64>,
    charts: Vec<Chart>,
}

impl Charts {
    /// For charts over these times.
    pub fn over(times_s: impl Iterator<Item = f64>) -> Self {
        Self { t: rounded(times_s.map(Some)), ..Self::default() }
    }

    /// With the trace's clock on the axis.
    #[must_use]
    pub fn by(self, clock: Option<&Clock>) -> Self {
        Self { clock: clock.map(Clock::since_midnight_s), ..self }
    }

    /// Gives a chart its place in the text; nothing where there is nothing to draw.
    pub fn place(&mut self, mut chart: Chart) -> Markup {
        chart.lines.retain(|line| !line.is_empty());
        if chart.lines.is_empty() {
            return html! {};
        }
        let number = self.charts.len();
        let markup = html! {
            figure {
                figcaption {
                    strong { (chart.title) } " " span { (chart.unit) @if !chart.unit.is_empty() && !chart.note.is_empty() { ". " } (chart.note) }
                }
                div .chart data-chart=(number) {}
                details {
                    summary { "Table of " (chart.title) }
                    (self.table(&chart))
                }
            }
        };
        self.charts.push(chart);
        markup
    }

    fn table(&self, chart: &Chart) -> Markup {
        let x_label = if chart.x_label.is_empty() { "time, s" } else { chart.x_label.as_str() };
        html! {
            @for same in chart.lines.chunk_by(|a, b| a.x == b.x) {
                @let x = same.first().and_then(|line| line.x.as_ref()).unwrap_or(&self.t);
                @let rows = x.len().div_ceil(MOST_TABLE_ROWS).max(1);
                div .wide {
                    table .numbers {
                        thead {
                            tr {
                                th scope="col" { (x_label) }
                                @for line in same {
                                    @for head in heads(line) { th scope="col" { (line.name) (head) } }
                                }
                            }
                        }
                        tbody {
                            @for (number, times) in x.chunks(rows).enumerate() {
                                tr {
                                    th scope="row" { (number_of(times.first().copied().flatten())) }
                                    @for line in same {
                                        @for value in cells(line, number * rows, times.len()) {
                                            td { (number_of(value)) }
                                        }
                                    }
                                }
                            }
                        }
                    }
                }
            }
        }
    }

    /// For the page's script; nothing in it ends a script.
    pub fn to_json(&self) -> String {
        serde_json::to_string(self).unwrap_or_default().replace('<', "\\u003c")
    }
}

fn heads(line: &Line) -> &'static [&'static str] {
    if line.low.is_some() { &[", least", ", middle", ", most"] } else { &[""] }
}

/// A row's cells: least, middle and greatest of the values in it.
fn cells(line: &Line, start: usize, count: usize) -> Vec<Option<f64>> {
    let of = |column: &Option<Vec<Option<f64>>>| -> Vec<f64> {
        let values = column.as_ref().unwrap_or(&line.mid);
        values.iter().skip(start).take(count).flatten().copied().collect()
    };
    let mut middle = of(&None);
    middle.sort_by(f64::total_cmp);
    let median = middle.get(middle.len() / 2).copied();
    if line.low.is_none() {
        return vec![median];
    }
    let [low, _] = extremes(of(&line.low));
    let [_, high] = extremes(of(&line.high));
    let known = |value: f64| Some(value).filter(|value| value.is_finite());
    vec![known(low), median, known(high)]
}

/// Four significant digits.
fn number_of(value: Option<f64>) -> String {
    value.map_or_else(|| "–".to_owned(), |value| significant(value, 4, 5))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_keep_what_the_eye_sees_and_no_more() {
        let values = rounded([Some(100.123_456_789_01), Some(100.2), None, Some(f64::NAN)].into_iter());
        assert_eq!(serde_json::to_string(&values).expect("json"), "[100.123457,100.2,null,null]");
        let large = rounded([Some(0.0), Some(123_456_789.0)].into_iter());
        assert_eq!(large, [Some(0.0), Some(123_457_000.0)]);
    }

    #[test]
    fn a_name_ends_no_script_and_opens_no_tag() {
        let name = "</script><img src=x onerror=alert(1)>\"'&";
        let mut charts = Charts::over([0.0, 1.0].into_iter());
        let line = Line { mid: vec![Some(1.0), Some(2.0)], ..Line::over_time(name, Ink::Blue, &[]) };
        let chart = Chart { title: name.to_owned(), lines: vec![line], ..Chart::default() };
        let markup = charts.place(chart).into_string();
        assert!(!markup.contains("<img") && !markup.contains("</script"), "{markup}");
        assert!(!charts.to_json().contains('<'));
    }

    #[test]
    fn a_chart_without_values_is_none() {
        let mut charts = Charts::default();
        let lines = vec![Line::over_time("nothing", Ink::Blue, &[None])];
        assert_eq!(charts.place(Chart { lines, ..Chart::default() }).into_string(), "");
    }
}
