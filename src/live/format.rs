//! How lines, and messages of many samples, are written: JSON (`json.rs`), a header and rows, influx line protocol.

use super::json;
use crate::header::shorten;
use jiff::Timestamp;
use serde_json::value::RawValue;
use std::borrow::Cow;

/// How a line says what was measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LineFormat {
    /// A JSON object: `{"cylinder": "T7/B2", "t_s": 12.34, "x_mm": 40.6, …}`.
    Ndjson,
    /// A header row, then rows; a column `cylinder` where there are many.
    Csv,
    /// Influx line protocol: `pitch,cylinder=T7/B2 x_mm=40.6,… 1700000000000000000`.
    Influx,
}

impl LineFormat {
    /// All, by their names on the command line.
    pub const NAMES: [(&'static str, Self); 3] =
        [("ndjson", Self::Ndjson), ("csv", Self::Csv), ("influx", Self::Influx)];

    /// The format of a first line: braces are JSON's, an equals sign is no part of a header.
    pub fn of(line: &str) -> Self {
        if line.starts_with('{') {
            Self::Ndjson
        } else if line.contains('=') {
            Self::Influx
        } else {
            Self::Csv
        }
    }
}

/// One line, taken apart.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Fields<'a> {
    /// Empty where the line names none.
    pub cylinder: Cow<'a, str>,
    /// Names of the cells, as of a trace's columns.
    pub names: Vec<Cow<'a, str>>,
    pub cells: Vec<Cow<'a, str>>,
}

/// Name of the cell that holds the cylinder.
pub(super) const CYLINDER: &str = "cylinder";

/// Cells of a line at the most, as a rule: all signals and a name.
const ROOM: usize = 16;

impl<'a> Fields<'a> {
    /// None yet, and room for those of a line.
    pub(super) fn with_room() -> Self {
        Self { names: Vec::with_capacity(ROOM), cells: Vec::with_capacity(ROOM), ..Self::default() }
    }

    /// That nothing else has to outlive.
    fn into_owned(self) -> Fields<'static> {
        let owned =
            |cells: Vec<Cow<'_, str>>| cells.into_iter().map(|cell| cell.into_owned().into()).collect();
        Fields {
            cylinder: self.cylinder.into_owned().into(),
            names: owned(self.names),
            cells: owned(self.cells),
        }
    }

    /// Name of its cylinder: its own, else this.
    pub(super) fn cylinder_or<'b>(&'b self, other: &'b str) -> &'b str {
        if self.cylinder.is_empty() { other } else { &self.cylinder }
    }

    pub(super) fn push(&mut self, name: Cow<'a, str>, cell: Cow<'a, str>) {
        if name == CYLINDER {
            self.cylinder = cell;
        } else {
            self.names.push(name);
            self.cells.push(cell);
        }
    }
}

/// Takes lines apart.
pub(super) struct Parser {
    format: LineFormat,
    csv: Csv,
}

impl Parser {
    pub(super) fn new(format: LineFormat) -> Self {
        Self { format, csv: Csv::default() }
    }

    /// The line's fields; none where it is a header or a comment.
    pub(super) fn parse<'a>(&'a mut self, line: &'a str) -> Result<Option<Fields<'a>>, String> {
        match self.format {
            LineFormat::Ndjson => json::parse(line).map(Some),
            LineFormat::Csv => self.csv.parse(line),
            LineFormat::Influx => parse_influx(line),
        }
    }
}

/// A header row, then rows.
#[derive(Default)]
struct Csv {
    delimiter: char,
    /// Of the header; empty before it.
    names: Vec<String>,
}

impl Csv {
    /// The first line is the header; so is one that repeats it, as after a feed began anew.
    fn parse<'a>(&'a mut self, line: &'a str) -> Result<Option<Fields<'a>>, String> {
        if self.names.is_empty() {
            let line = line.trim_start_matches('\u{feff}');
            let most = |delimiter: &char| line.matches(*delimiter).count();
            self.delimiter = [',', ';', '\t'].into_iter().rev().max_by_key(most).unwrap_or(',');
            self.names = split(line, self.delimiter).map(Cow::into_owned).collect();
            return Ok(None);
        }
        let mut fields = Fields::default();
        let mut cells = split(line, self.delimiter);
        let mut repeated = true;
        for name in &self.names {
            let cell = cells.next().ok_or_else(|| format!("{} cells expected", self.names.len()))?;
            repeated &= cell == name.as_str();
            fields.push(Cow::Borrowed(name), cell);
        }
        if cells.next().is_some() {
            return Err(format!("{} cells expected", self.names.len()));
        }
        Ok((!repeated).then_some(fields))
    }
}

/// Cells without blanks and quotes around them.
fn split(line: &str, delimiter: char) -> impl Iterator<Item = Cow<'_, str>> {
    let mut quoted = false;
    line.split(move |c| {
        quoted ^= c == '"';
        c == delimiter && !quoted
    })
    .map(|cell| {
        let cell = cell.trim();
        match cell.strip_prefix('"').and_then(|cell| cell.strip_suffix('"')) {
            Some(inner) => Cow::Owned(inner.replace("\"\"", "\"")),
            None => Cow::Borrowed(cell),
        }
    })
}

/// The fields of a line of influx line protocol (measurement, tags, fields, time in ns); none of a comment.
fn parse_influx(line: &str) -> Result<Option<Fields<'_>>, String> {
    if line.starts_with('#') {
        return Ok(None);
    }
    let mut found = parts(line, ' ').filter(|part| !part.is_empty());
    let (Some(series), Some(values)) = (found.next(), found.next()) else {
        return Err("measurement, fields and time expected".to_owned());
    };
    let mut fields = Fields::default();
    for tag in parts(series, ',').skip(1) {
        let (name, value) = pair(tag)?;
        if name == CYLINDER {
            fields.cylinder = value;
        }
    }
    for field in parts(values, ',') {
        let (name, value) = pair(field)?;
        fields.push(name, value);
    }
    if let Some(time) = found.next() {
        let time: i128 = time.trim().parse().map_err(|_| format!("`{time}` is no time in ns"))?;
        let stamp = Timestamp::from_nanosecond(time).map_err(|_| format!("{time} ns is no time"))?;
        if !fields.names.iter().any(|name| name == "t_s" || name == "t_ms") {
            fields.push("timestamp".into(), stamp.to_string().into());
        }
    }
    Ok(Some(fields))
}

/// Parts between delimiters that are neither escaped nor within quotes.
fn parts(text: &str, delimiter: char) -> impl Iterator<Item = &str> {
    let (mut quoted, mut escaped) = (false, false);
    text.split(move |c| {
        let here = c == delimiter && !quoted && !escaped;
        quoted ^= c == '"' && !escaped;
        escaped = c == '\\' && !escaped;
        here
    })
}

fn pair(text: &str) -> Result<(Cow<'_, str>, Cow<'_, str>), String> {
    let mut sides = parts(text, '=');
    match (sides.next(), sides.next(), sides.next()) {
        (Some(name), Some(value), None) if !name.is_empty() => Ok((plain(name), plain(number(value)))),
        _ => Err(format!("`{}` is no name=value", shorten(text, 40))),
    }
}

/// A whole number carries a letter.
fn number(value: &str) -> &str {
    match value.strip_suffix(['i', 'u']) {
        Some(digits) if digits.trim_start_matches('-').bytes().all(|b| b.is_ascii_digit()) => digits,
        _ => value,
    }
}

/// Without escapes and quotes.
fn plain(text: &str) -> Cow<'_, str> {
    let text = text.strip_prefix('"').and_then(|text| text.strip_suffix('"')).unwrap_or(text);
    if !text.contains('\\') {
        return Cow::Borrowed(text);
    }
    let mut escaped = false;
    let kept = |c: &char| {
        escaped = *c == '\\' && !escaped;
        !escaped
    };
    Cow::Owned(text.chars().filter(kept).collect())
}

/// How a message holds its samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum BatchFormat {
    /// A JSON array of objects such as the lines of [`LineFormat::Ndjson`], or those lines.
    Json,
    /// A header row, then rows.
    Csv,
    /// What Neuron uploads: one sample, in its values format or its tags format.
    Neuron,
}

/// A message.
#[derive(Clone, Copy, Debug)]
pub struct Batch<'a> {
    /// Of the samples that name none themselves.
    pub cylinder: &'a str,
    /// How to read it.
    pub format: BatchFormat,
    /// What came.
    pub payload: &'a [u8],
    /// Whether it may have come before: then late samples in it say nothing about the sender's clock.
    pub resent: bool,
}

/// The samples of a message, or why one is none; an error where the whole message is of no use.
pub(super) fn parse_batch<'a>(batch: &Batch<'a>) -> Result<Vec<Result<Fields<'a>, String>>, String> {
    let payload = std::str::from_utf8(batch.payload).map_err(|_| "not UTF-8".to_owned())?;
    Ok(match batch.format {
        BatchFormat::Json if payload.trim_start().starts_with('[') => array(payload)?,
        BatchFormat::Json => lines(payload).map(json::parse).collect(),
        BatchFormat::Csv => {
            let mut csv = Csv::default();
            let row = |line| csv.parse(line).map(|row| row.map(Fields::into_owned)).transpose();
            lines(payload).filter_map(row).collect()
        }
        BatchFormat::Neuron => vec![json::parse_neuron(payload)],
    })
}

/// All at once where each is a sample, else one by one.
fn array(payload: &str) -> Result<Vec<Result<Fields<'_>, String>>, String> {
    if let Ok(samples) = serde_json::from_str::<Vec<Fields<'_>>>(payload) {
        return Ok(samples.into_iter().map(Ok).collect());
    }
    let samples: Vec<&RawValue> =
        serde_json::from_str(payload).map_err(|error| format!("not a JSON array: {error}"))?;
    Ok(samples.into_iter().map(|sample| json::parse(sample.get())).collect())
}

fn lines(payload: &str) -> impl Iterator<Item = &str> {
    payload.lines().filter(|line| !line.trim().is_empty())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_header_names_the_cells_of_the_rows() {
        let mut csv = Csv::default();
        assert_eq!(csv.parse("cylinder;t_s;x_mm"), Ok(None));
        let fields = csv.parse("\"T7; B2\"; 0.1;4e1").unwrap().unwrap();
        assert_eq!((fields.cylinder.as_ref(), fields.names.join(" ")), ("T7; B2", "t_s x_mm".to_owned()));
        assert_eq!(fields.cells, ["0.1", "4e1"]);
        assert_eq!(csv.parse("cylinder;t_s;x_mm"), Ok(None));
        assert!(csv.parse("a;1").is_err() && csv.parse("a;1;2;3").is_err());
    }

    #[test]
    fn tags_fields_and_time() {
        let line = r"pitch,cylinder=T7\ a\,b,host=gw x_mm=40.5,pa_bar=3i,qa_lpm=-1e-3 1700000000500000000";
        let fields = parse_influx(line).unwrap().unwrap();
        assert_eq!(fields.cylinder, "T7 a,b");
        assert_eq!(fields.names, ["x_mm", "pa_bar", "qa_lpm", "timestamp"]);
        assert_eq!(fields.cells, ["40.5", "3", "-1e-3", "2023-11-14T22:13:20.5Z"]);
        assert_eq!(parse_influx("# comment"), Ok(None));
    }

    #[test]
    fn what_is_no_line_is_refused() {
        for line in ["pitch", "pitch x", "pitch =3", "pitch x=1=2", "pitch x=1 soon"] {
            assert!(parse_influx(line).is_err(), "{line}");
        }
    }

    fn cells(format: BatchFormat, payload: &str) -> Vec<Result<String, ()>> {
        let batch = Batch { cylinder: "", format, payload: payload.as_bytes(), resent: false };
        let joined =
            |fields: Result<Fields<'_>, _>| fields.map(|fields| fields.cells.join(" ")).map_err(|_| ());
        parse_batch(&batch)
            .map_or_else(|_| vec![Err(())], |samples| samples.into_iter().map(joined).collect())
    }

    #[test]
    fn samples_stand_in_an_array_in_lines_or_in_rows() {
        let two = [Ok("1 2".to_owned()), Ok("2 3".to_owned())];
        assert_eq!(cells(BatchFormat::Json, r#" [{"t_s": 1, "x_mm": 2}, {"t_s": 2, "x_mm": 3}]"#), two);
        assert_eq!(cells(BatchFormat::Json, "{\"t_s\": 1, \"x_mm\": 2}\n\n{\"t_s\": 2, \"x_mm\": 3}\n"), two);
        assert_eq!(cells(BatchFormat::Csv, "t_s,x_mm\n1,2\n2,3\n"), two);
    }

    #[test]
    fn one_that_is_none_does_not_hide_the_others() {
        assert_eq!(cells(BatchFormat::Json, r#"[{"t_s": 1}, 7, {"t_s": 2}]"#).len(), 3);
        assert_eq!(cells(BatchFormat::Csv, "t_s,x_mm\n1\n2,3"), [Err(()), Ok("2 3".to_owned())]);
        assert_eq!(cells(BatchFormat::Json, "[{\"t_s\": 1}"), [Err(())]);
    }
}
