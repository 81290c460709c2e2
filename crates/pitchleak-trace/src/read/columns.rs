//! Which column of a file holds which signal, and in which unit, by the names of the contract and those of `[columns]`.

use super::error::{BadReason, BadRow, Counted, TraceFault};
use crate::header::{near, shorten};
use crate::rig::{ColumnMap, ForeignColumn, Rig};
use crate::signal::Signal;
use crate::times::TimeFormat;
use crate::units::Unit;

/// One column of the file.
#[derive(Clone, Debug)]
pub(super) struct Column {
    /// As in the header row.
    pub(super) header: String,
    /// None where it is not read.
    pub(super) content: Option<Content>,
}

/// What is read from a column.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Content {
    pub(super) signal: Signal,
    /// Of numbers; none where they are SI already, and of time stamps.
    pub(super) unit: Option<Unit>,
}

impl Column {
    pub(super) fn signal(&self) -> Option<Signal> {
        self.content.map(|content| content.signal)
    }

    pub(super) fn is_time(&self) -> bool {
        self.signal().is_some_and(Signal::is_time)
    }

    pub(super) fn is_timestamp(&self) -> bool {
        self.signal() == Some(Signal::Timestamp)
    }
}

/// The columns of a trace in the order of the file.
#[derive(Clone, Debug, Default)]
pub(super) struct Layout {
    pub(super) columns: Vec<Column>,
    /// Mapped columns of optional signals that the header does not have.
    pub(super) absent: Vec<String>,
    /// How rows are numbered in messages.
    pub(super) counted: Counted,
    /// How time stamps are written.
    pub(super) time: TimeFormat,
    /// How the file was read where it is not as the contract writes one.
    pub(super) reading: Option<String>,
}

impl Layout {
    /// Reads the header row of a trace, which must have what is `required`.
    pub(super) fn new(
        headers: &[String],
        map: &ColumnMap,
        required: &[(Signal, &str)],
        rig: &Rig,
    ) -> Result<Self, TraceFault> {
        let column = |header: &str| Column { header: header.to_owned(), content: content_of(header, map) };
        let mut columns: Vec<_> = headers.iter().map(|header| column(header.trim())).collect();
        prefer_time(&mut columns);
        let layout = Self {
            columns,
            absent: absent(headers, map)
                .map(|(_, name, near)| near.map_or(name.clone(), |near| format!("{name} (`{near}` is near)")))
                .collect(),
            time: declared_time(map),
            ..Self::default()
        };
        layout.check_units()?;
        layout.check(map, required)?;
        layout.of_stroke(rig)
    }

    /// Of the parts of one recording.
    pub(super) fn joined<'l>(parts: impl Iterator<Item = &'l Self>) -> Self {
        let mut whole = Self::default();
        for part in parts {
            // Each file has a time of its own.
            let known = whole.gives(Signal::Time);
            whole.columns.extend(part.columns.iter().filter(|column| !(known && column.is_time())).cloned());
            whole.reading = whole.reading.or_else(|| part.reading.clone());
            whole.time = part.time.clone();
        }
        whole
    }

    /// As shares of its stroke what is read of the spool in millimetres. Without a valve nothing asks for them.
    ///
    /// # Errors
    /// Where `[valve]` does not say the stroke.
    fn of_stroke(mut self, rig: &Rig) -> Result<Self, TraceFault> {
        let Some(valve) = &rig.valve else { return Ok(self) };
        for column in &mut self.columns {
            let Some(Content { signal: Signal::Spool | Signal::Command, unit: Some(unit) }) =
                &mut column.content
            else {
                continue;
            };
            if !unit.is_length() {
                continue;
            }
            let stroke_m = valve.stroke_m.ok_or_else(|| TraceFault::Ambiguous {
                what: format!("column `{}` is in {}", shorten(&column.header, 40), unit.text),
                settle:
                    "say the spool's stroke in the rig file, [valve] stroke = \"2 mm\", or give percent of it"
                        .to_owned(),
            })?;
            *unit = unit.scaled(1.0 / stroke_m, 0.0);
        }
        Ok(self)
    }

    /// Whether the trace has a column for `signal`.
    pub(super) fn has(&self, signal: Signal) -> bool {
        self.header_of(signal).is_some()
    }

    /// The chamber pressure that is not measured: the one a trace without flows may lack where its valve is recorded.
    pub(super) fn unread(&self) -> Option<Signal> {
        let has_any = |signals: [Signal; 2]| signals.into_iter().any(|signal| self.has(signal));
        let is_valves = has_any([Signal::Spool, Signal::Command]) && !has_any([Signal::FlowA, Signal::FlowB]);
        match [Signal::PressureA, Signal::PressureB].map(|signal| self.has(signal)) {
            [true, false] if is_valves => Some(Signal::PressureB),
            [false, true] if is_valves => Some(Signal::PressureA),
            _ => None,
        }
    }

    /// As [`has`](Self::has), where a timestamp is as good as a time.
    fn gives(&self, signal: Signal) -> bool {
        self.has(signal) || (signal == Signal::Time && self.has(Signal::Timestamp))
    }

    /// Each signal's column as a rig file's `[columns]` would name it.
    pub(super) fn column_map(&self, map: &ColumnMap) -> ColumnMap {
        let entry = |column: &Column| {
            let Content { signal, unit } = column.content?;
            let is_it =
                |mapped: &&ForeignColumn| column.is_timestamp() || mapped.name.trim() == column.header;
            let own = || ForeignColumn::new(&column.header, unit.or_else(|| signal.si()));
            Some((signal, map.get(&signal).filter(is_it).cloned().unwrap_or_else(own)))
        };
        self.columns.iter().filter_map(entry).collect()
    }

    /// A row that is bad for what stands in `column`, or as a whole.
    #[cold]
    pub(super) fn bad_row(
        &self,
        line: u64,
        column: Option<&Column>,
        reason: BadReason,
        detail: String,
    ) -> BadRow {
        let column = column.map(|column| shorten(&column.header, 40));
        BadRow { line, counted: self.counted, column, reason, detail }
    }

    pub(super) fn column_of(&self, signal: Signal) -> Option<&Column> {
        self.columns.iter().find(|column| column.signal() == Some(signal))
    }

    /// The header of the column that holds `signal`.
    pub(super) fn header_of(&self, signal: Signal) -> Option<&str> {
        self.column_of(signal).map(|column| column.header.as_str())
    }

    /// The unit of the column that holds `signal`; none where it is SI.
    pub(super) fn unit_of(&self, signal: Signal) -> Option<Unit> {
        self.column_of(signal)?.content?.unit
    }

    pub(super) fn ignored(&self) -> Vec<String> {
        let is_named = |column: &&Column| column.content.is_none() && !column.header.is_empty();
        self.columns.iter().filter(is_named).map(|column| shorten(&column.header, 40)).collect()
    }

    fn check_doubled(&self) -> Result<(), TraceFault> {
        for signal in Signal::ALL {
            let mut columns = self.columns.iter().filter(|column| column.signal() == Some(signal));
            if let (Some(first), Some(second)) = (columns.next(), columns.next()) {
                return Err(doubled(signal, &first.header, &second.header));
            }
        }
        Ok(())
    }

    /// A column such as `pa_psi` is an error, unless the signal also comes in a unit that is known.
    fn check_units(&self) -> Result<(), TraceFault> {
        let ignored = self.columns.iter().filter(|column| column.content.is_none());
        for column in ignored {
            let Some((signal, unit)) = foreign_unit(&column.header) else { continue };
            let Some(dimension) = signal.dimension() else { continue };
            if !self.gives(signal) {
                return Err(TraceFault::UnknownUnit {
                    column: shorten(&column.header, 40),
                    signal: signal.name(),
                    unit: shorten(unit, 40),
                    allowed: dimension.suffixes(),
                });
            }
        }
        Ok(())
    }

    /// Whether each signal comes once, and those that are required come.
    pub(super) fn check(&self, map: &ColumnMap, required: &[(Signal, &str)]) -> Result<(), TraceFault> {
        self.check_doubled()?;
        for &(signal, words) in required {
            if self.gives(signal) || self.unread() == Some(signal) {
                continue;
            }
            return Err(self.without(signal, words, map));
        }
        Ok(())
    }

    /// Whether both chamber pressures are measured.
    pub(super) fn check_pressures(&self, map: &ColumnMap) -> Result<(), TraceFault> {
        let unread = REQUIRED.into_iter().find(|(signal, _)| self.unread() == Some(*signal));
        unread.map_or(Ok(()), |(signal, words)| Err(self.without(signal, words, map)))
    }

    fn without(&self, signal: Signal, words: &str, map: &ColumnMap) -> TraceFault {
        let mut headers: Vec<_> = self.columns.iter().map(|column| column.header.as_str()).collect();
        if headers.is_empty() {
            headers.push("no column");
        }
        TraceFault::MissingColumn {
            signal: words.to_owned(),
            accepted: accepted(signal, map),
            found: shorten(&headers.join(", "), 160),
            hint: String::new(),
        }
    }
}

/// Two columns, by their headers, of one signal.
pub(super) fn doubled(signal: Signal, first: &str, second: &str) -> TraceFault {
    let [first, second] = [first, second].map(|header| shorten(header, 40));
    TraceFault::DoubledColumn { signal: signal.name(), first, second }
}

/// What every trace must have, in words.
pub(super) const REQUIRED: [(Signal, &str); 4] = [
    (Signal::Time, "time"),
    (Signal::Position, "piston position"),
    (Signal::PressureA, "pressure A"),
    (Signal::PressureB, "pressure B"),
];

/// What a header says by itself.
pub(super) fn content_of(header: &str, map: &ColumnMap) -> Option<Content> {
    let Content { signal, unit } = match mapped(header, map) {
        Some((signal, column)) => Content { signal, unit: column.reading() },
        None => standard(header)?,
    };
    let is_whole = unit.is_some() || signal.dimension().is_none();
    is_whole.then_some(Content { signal, unit: unit.filter(|unit| !unit.is_si()) })
}

/// The entry of `map` that names this header.
pub(super) fn mapped<'m>(header: &str, map: &'m ColumnMap) -> Option<(Signal, &'m ForeignColumn)> {
    let entry = map.iter().find(|(_, column)| column.name.trim() == header);
    entry.map(|(signal, column)| (*signal, column))
}

/// The signal of a header as the contract writes it, and its unit; a timestamp has none, nor has `shut`.
pub(super) fn standard(header: &str) -> Option<Content> {
    let unitless = [Signal::Timestamp, Signal::Shut].into_iter().find(|signal| header == signal.name());
    if let Some(signal) = unitless {
        return Some(Content { signal, unit: None });
    }
    let (name, suffix) = header.rsplit_once('_')?;
    let signal = Signal::by_name(name)?;
    Some(Content { signal, unit: Some(signal.dimension()?.by_suffix(suffix)?) })
}

/// As `[columns]` says it; ISO 8601 where it doesn't.
fn declared_time(map: &ColumnMap) -> TimeFormat {
    let declared = map.get(&Signal::Timestamp);
    TimeFormat {
        kind: declared.and_then(|column| column.format.clone()).unwrap_or_default(),
        zone: declared.and_then(|column| column.zone.clone()),
    }
}

/// Where both a number and a timestamp give the time, the number does.
fn prefer_time(columns: &mut [Column]) {
    if columns.iter().any(|column| column.signal() == Some(Signal::Time)) {
        columns.iter_mut().filter(|column| column.is_timestamp()).for_each(|column| column.content = None);
    }
}

/// The signal and the one word after it, of a header that names no unit we know.
fn foreign_unit(header: &str) -> Option<(Signal, &str)> {
    if let Some(signal) = Signal::by_name(header) {
        return Some((signal, ""));
    }
    let (name, unit) = header.rsplit_once('_')?;
    Signal::by_name(name).map(|signal| (signal, unit))
}

/// Mapped columns that are not among the headers: the signal, its name, and one that is near.
pub(super) fn absent(
    headers: &[String],
    map: &ColumnMap,
) -> impl Iterator<Item = (Signal, String, Option<String>)> {
    let names = || headers.iter().map(|header| header.trim());
    let absent = map.iter().filter(move |(_, column)| !names().any(|name| name == column.name.trim()));
    absent.map(move |(signal, column)| {
        let near = near(&column.name, names()).map(|near| shorten(near, 40));
        (*signal, shorten(&column.name, 40), near)
    })
}

fn accepted(signal: Signal, map: &ColumnMap) -> String {
    let suffixes = signal.dimension().map(crate::units::Dimension::units).unwrap_or_default();
    let mut names: Vec<_> = suffixes
        .iter()
        .filter_map(|unit| unit.suffix)
        .map(|suffix| format!("{}_{suffix}", signal.name()))
        .collect();
    if signal == Signal::Time {
        names.push(Signal::Timestamp.name().to_owned());
    }
    names.extend(map.get(&signal).map(|column| format!("`{}` of [columns]", shorten(&column.name, 40))));
    names.join(" or ")
}
