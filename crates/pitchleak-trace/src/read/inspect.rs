//! How a file would be read, for a person to look at before it is.

use super::columns::{Content, absent};
use super::dialect::Dialect;
use super::error::{TraceError, TraceFault};
use super::format;
use super::number::decimal;
use super::proposal::{BY_NAME, contents, proposals};
use super::table_text::TextTable;
use crate::header::shorten;
use crate::rig::{Decimal, ForeignColumn, Rig};
use crate::signal::Signal;
use serde::Serialize;
use std::fmt::Write;
use std::fs::File;
use std::path::Path;

/// How a file would be read, as `columns --json` prints it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FileReading {
    /// `pitchleak.columns/1`.
    pub schema: &'static str,
    /// As the user named it.
    pub path: String,
    /// How its text is written; none of a binary file.
    pub text: Option<TextReading>,
    /// How times are written; none where a column gives seconds.
    pub time_format: Option<String>,
    /// Its columns in their order.
    pub columns: Vec<ColumnReading>,
    /// Lines of `[columns]` that say what is read of foreign names without them.
    pub named: Vec<ProposedLine>,
    /// Why it is not read as it is.
    pub problem: Option<String>,
    /// Lines of `[columns]` that would name what is missing, each with what speaks for it.
    pub proposals: Vec<ProposedLine>,
    /// Names in `[columns]` that the file does not have, with a near one.
    pub misspelt: Vec<String>,
}

/// How a text file is written.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct TextReading {
    /// `comma`, `semicolon`, `tab` or `bar`.
    pub delimiter: &'static str,
    /// `point` or `comma`; none where it is not clear.
    pub decimal: Option<&'static str>,
    /// The line that names the columns, from 1.
    pub header_line: u64,
    /// The line of units below it.
    pub units_line: Option<u64>,
}

/// One column.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ColumnReading {
    /// As in the file.
    pub header: String,
    /// The signal that is read from it.
    pub signal: Option<&'static str>,
    /// Its unit.
    pub unit: Option<&'static str>,
    /// Its first cells.
    pub first: Vec<String>,
}

/// A line for `[columns]`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ProposedLine {
    /// E.g. `pa = { name = "Head pressure", unit = "bar" }`.
    pub line: String,
    /// What speaks for it.
    pub why: &'static str,
}

impl FileReading {
    /// Name and version of the JSON form.
    pub const SCHEMA: &'static str = "pitchleak.columns/1";
    /// So many cells of a column are shown.
    const SHOWN: usize = 4;

    /// Looks at a file's first lines, or at the names of its columns.
    ///
    /// # Errors
    /// Where there is nothing to look at: the file cannot be opened, or is of no known format.
    pub fn of(path: impl AsRef<Path>, rig: &Rig) -> Result<Self, TraceError> {
        let name = path.as_ref().display().to_string();
        Self::look(path.as_ref(), rig)
            .map(|reading| Self { path: name.clone(), ..reading })
            .map_err(|fault| fault.of(&name))
    }

    fn look(path: &Path, rig: &Rig) -> Result<Self, TraceFault> {
        let (format, stream) = if path == Path::new("-") {
            format::start(Box::new(std::io::stdin()), None)?
        } else {
            let file = File::open(path).map_err(TraceFault::Open)?;
            format::start(Box::new(file.try_clone().map_err(TraceFault::Open)?), Some(file))?
        };
        Ok(Self::of_table((format.look)(stream, rig)?, rig))
    }

    fn of_table(table: TextTable, rig: &Rig) -> Self {
        let everything: Vec<Vec<&str>> = (0..table.headers.len()).map(|index| table.column(index)).collect();
        let marks = rig.csv.decimal.or_else(|| decimal(&everything).ok());
        let text = (table.header_line > 0).then(|| TextReading {
            delimiter: table.delimiter.name(),
            decimal: marks.map(Decimal::name),
            header_line: table.header_line,
            units_line: table.units.as_ref().map(|row| row.line),
        });
        let foreign = table.bound.iter().flat_map(|bound| &bound.foreign);
        let named = foreign.map(|(signal, column)| ProposedLine::of(*signal, column, BY_NAME)).collect();
        let found = contents(&table, rig);
        let columns = table.headers.iter().zip(found.iter()).enumerate().map(|(index, (header, content))| {
            let first =
                table.column(index).into_iter().take(Self::SHOWN).map(|cell| shorten(cell, 40)).collect();
            read_column(header, *content, first)
        });
        let columns = columns.collect();
        let proposals = proposals(&table, rig);
        let proposals =
            proposals.iter().map(|one| ProposedLine::of(one.signal, &one.column, one.why)).collect();
        let misspelt = absent(&table.headers, &rig.columns).map(misspelt).collect();
        let (mut time_format, mut problem) = (None, None);
        if text.is_none() {
            problem = table.bound.err().map(|fault| fault.to_string());
        } else {
            match Dialect::of(table, super::records::Encoding::Utf8, rig) {
                Ok(Dialect { layout, .. }) if layout.has(Signal::Timestamp) => {
                    time_format = Some(format!("{}{}", layout.time.kind, layout.time.zone_text()));
                }
                Ok(_) => {}
                Err(fault) => problem = Some(fault.to_string()),
            }
        }
        let (schema, path) = (Self::SCHEMA, String::new());
        Self { schema, path, text, time_format, columns, named, problem, proposals, misspelt }
    }

    /// One line of JSON.
    ///
    /// # Errors
    /// None in practice: every field has a JSON form.
    pub fn to_json(&self) -> Result<String, serde_json::Error> {
        serde_json::to_string(self)
    }
}

fn read_column(header: &str, content: Option<Content>, first: Vec<String>) -> ColumnReading {
    let unit = content.and_then(|Content { signal, unit }| unit.or_else(|| signal.si()));
    ColumnReading {
        header: shorten(header, 60),
        signal: content.map(|content| content.signal.name()),
        unit: unit.map(|unit| unit.text),
        first,
    }
}

impl ProposedLine {
    fn of(signal: Signal, column: &ForeignColumn, why: &'static str) -> Self {
        Self { line: format!("{} = {}", signal.name(), column.to_toml(signal)), why }
    }
}

fn misspelt((signal, name, near): (Signal, String, Option<String>)) -> String {
    let near = near.map(|near| format!("; `{near}` is near")).unwrap_or_default();
    format!("{}: the file has no column `{name}`{near}", signal.name())
}

impl FileReading {
    /// For people, on a terminal.
    pub fn to_text(&self) -> String {
        let mut out = format!("file     {}\n", self.path);
        if let Some(text) = &self.text {
            let decimal = text.decimal.unwrap_or("not clear");
            let _ = writeln!(out, "cells    {} between them, decimal {decimal}", text.delimiter);
            let units = text.units_line.map(|line| format!(", units in line {line}")).unwrap_or_default();
            let _ = writeln!(out, "header   in line {}{units}", text.header_line);
        }
        if let Some(format) = &self.time_format {
            let _ = writeln!(out, "times    {format}");
        }
        self.write_columns(&mut out);
        if let Some(problem) = &self.problem {
            let _ = writeln!(out, "\nNot read as it is: {problem}");
        }
        if !self.misspelt.is_empty() {
            let _ = writeln!(out, "\nNamed under [columns], and not in the file:");
            self.misspelt.iter().for_each(|line| _ = writeln!(out, "    {line}"));
        }
        if !self.proposals.is_empty() {
            let _ =
                writeln!(out, "\nWhere that is so, this in the rig file names the columns:\n    [columns]");
            let width =
                self.proposals.iter().map(|proposal| proposal.line.chars().count()).max().unwrap_or(0);
            for proposal in &self.proposals {
                let _ = writeln!(out, "    {:<width$}  # {}", proposal.line, proposal.why);
            }
        }
        if self.problem.is_none() {
            let _ = writeln!(out, "\nIt is read as it is.");
        }
        out
    }

    fn write_columns(&self, out: &mut String) {
        let width = |text: fn(&ColumnReading) -> &str, least: usize| {
            self.columns.iter().map(|column| text(column).chars().count()).max().unwrap_or(0).max(least)
        };
        let name = width(|column| &column.header, 6);
        let _ = writeln!(out, "\n{:<name$}  {:<9}  {:<6}  first rows", "column", "signal", "unit");
        for column in &self.columns {
            let (signal, unit) = (column.signal.unwrap_or("-"), column.unit.unwrap_or_default());
            let line =
                format!("{:<name$}  {signal:<9}  {unit:<6}  {}", column.header, column.first.join("  "));
            let _ = writeln!(out, "{}", line.trim_end());
        }
    }
}
