use super::csv::Csv;
use super::{influx, ndjson};
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

impl<'a> Fields<'a> {
    /// With a name for the cylinder where the line names none.
    pub(super) fn into_owned(self, cylinder: &str) -> Fields<'static> {
        let owned =
            |cells: Vec<Cow<'_, str>>| cells.into_iter().map(|cell| cell.into_owned().into()).collect();
        let named = Some(self.cylinder.into_owned()).filter(|name| !name.is_empty());
        Fields {
            cylinder: named.unwrap_or_else(|| cylinder.to_owned()).into(),
            names: owned(self.names),
            cells: owned(self.cells),
        }
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
pub(super) enum Parser {
    Ndjson,
    Csv(Csv),
    Influx,
}

impl Parser {
    pub(super) fn new(format: LineFormat) -> Self {
        match format {
            LineFormat::Ndjson => Self::Ndjson,
            LineFormat::Csv => Self::Csv(Csv::default()),
            LineFormat::Influx => Self::Influx,
        }
    }

    /// The line's fields; none where it is a header or a comment.
    pub(super) fn parse<'a>(&'a mut self, line: &'a str) -> Result<Option<Fields<'a>>, String> {
        match self {
            Self::Ndjson => ndjson::parse(line).map(Some),
            Self::Csv(csv) => csv.parse(line),
            Self::Influx => influx::parse(line),
        }
    }
}
