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

/// Cells of a line at the most, as a rule: all signals and a name.
pub(super) const ROOM: usize = 16;

impl<'a> Fields<'a> {
    /// None yet, and so many to come.
    pub(super) fn with_room(room: usize) -> Self {
        let (names, cells) = (Vec::with_capacity(room), Vec::with_capacity(room));
        Self { cylinder: Cow::Borrowed(""), names, cells }
    }

    /// That nothing else has to outlive.
    pub(super) fn into_owned(self) -> Fields<'static> {
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
