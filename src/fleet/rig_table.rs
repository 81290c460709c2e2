//! A table that says which rig file goes with which trace.

use super::FleetError;
use glob::{MatchOptions, Pattern};
use std::path::{Path, PathBuf};

/// A CSV file with the columns `trace` (a path or a pattern), `rig` (a rig file) and, optionally, `cylinder` (its name).
/// Paths count from the table's folder; the first row that fits a trace is taken.
#[derive(Clone, Debug)]
pub struct RigTable {
    rows: Vec<RigRow>,
}

/// What the table says of a trace.
#[derive(Clone, Debug)]
pub(super) struct RigRow {
    pattern: Pattern,
    pub(super) rig: PathBuf,
    pub(super) cylinder: Option<String>,
}

impl RigTable {
    /// Reads a table.
    ///
    /// # Errors
    /// [`FleetError::RigTable`], with the row.
    pub fn load(path: &Path) -> Result<Self, FleetError> {
        let file = path.display().to_string();
        read(path).map(|rows| Self { rows }).map_err(|why| FleetError::RigTable { file, why })
    }

    pub(super) fn row_of(&self, trace: &Path) -> Option<&RigRow> {
        let options = MatchOptions { require_literal_separator: true, ..MatchOptions::default() };
        let trace = std::path::absolute(trace).unwrap_or_else(|_| trace.to_owned());
        let trace = trace.to_string_lossy();
        self.rows.iter().find(|row| row.pattern.matches_with(&trace, options))
    }
}

fn read(path: &Path) -> Result<Vec<RigRow>, String> {
    let folder = path.parent().unwrap_or(Path::new(""));
    let absolute = std::path::absolute(folder).or_else(|_| std::env::current_dir());
    let absolute = absolute.map_err(|error| error.to_string())?;
    let mut reader = csv::ReaderBuilder::new().trim(csv::Trim::All).from_path(path).map_err(|e| say(&e))?;
    let headers = reader.headers().map_err(|error| say(&error))?.clone();
    let column = |name| headers.iter().position(|header| header.trim_start_matches('\u{feff}') == name);
    let (Some(trace), Some(rig)) = (column("trace"), column("rig")) else {
        let found = headers.iter().collect::<Vec<_>>().join(",");
        return Err(format!("a header `trace,rig` or `trace,rig,cylinder` is expected; it is `{found}`"));
    };
    let cylinder = column("cylinder");
    let row = |record: Result<csv::StringRecord, csv::Error>| {
        let record = record.map_err(|error| say(&error))?;
        let line = record.position().map_or(0, csv::Position::line);
        let cell = |column: usize| record.get(column).filter(|cell| !cell.is_empty());
        let needed = |column, name| cell(column).ok_or_else(|| format!("line {line}: no {name}"));
        let pattern = in_folder(&absolute, needed(trace, "trace")?);
        let pattern = Pattern::new(&pattern).map_err(|error| format!("line {line}: {error}"))?;
        let rig = folder.join(needed(rig, "rig")?);
        Ok(RigRow { pattern, rig, cylinder: cylinder.and_then(cell).map(str::to_owned) })
    };
    reader.records().map(row).collect()
}

/// A pattern that counts from a folder whose own name is no pattern.
fn in_folder(folder: &Path, pattern: &str) -> String {
    let pattern = pattern.strip_prefix("./").unwrap_or(pattern);
    if Path::new(pattern).is_absolute() {
        return pattern.to_owned();
    }
    let folder = Pattern::escape(&folder.to_string_lossy());
    format!("{}/{pattern}", folder.trim_end_matches('/'))
}

fn say(error: &csv::Error) -> String {
    error.to_string().replace('\n', " ")
}
