//! The table that grows: each night's rows beside those of the nights before, a folder for each day of recording.
//!
//! `day=2026-05-01/night-0003.parquet` has the rows of the third run whose traces begin on that day, as partitioned data
//! sets have them. Its columns are those of [`FleetTable`], and two more: `seen`, what the trace and its rig were when
//! they were judged, and `row`, the whole row as JSON. A file is never changed; of two rows of a path the later night's
//! counts.

use super::{FleetError, FleetFile, FleetRow, FleetTable, FleetTrace};
use crate::Rig;
use crate::output::{Inputs, OutputError};
use std::collections::BTreeMap;
use std::fs::{self, File};
use std::hash::{DefaultHasher, Hash, Hasher};
use std::io;
use std::path::{Path, PathBuf};
use std::time::UNIX_EPOCH;

/// What pyarrow, Spark and DuckDB read as no value.
const NO_DAY: &str = "__HIVE_DEFAULT_PARTITION__";

/// Rows of all nights so far, by the paths of their traces.
pub struct FleetNights {
    folder: PathBuf,
    nights: u32,
    rows: BTreeMap<String, Night>,
}

struct Night {
    number: u32,
    seen: String,
    row: FleetRow,
}

impl FleetNights {
    /// Reads the table in `folder`; one that is not there has no rows.
    ///
    /// # Errors
    /// A file of it that can't be read, with its path.
    pub fn open(folder: &Path) -> Result<Self, FleetError> {
        let mut table = Self { folder: folder.to_owned(), nights: 0, rows: BTreeMap::new() };
        let pattern =
            format!("{}/day=*/night-*.parquet", glob::Pattern::escape(&folder.display().to_string()));
        for file in glob::glob(&pattern).into_iter().flatten() {
            let file = file.map_err(|error| unread(error.path(), &error))?;
            let number = number(&file).ok_or_else(|| unread(&file, &"a night's file ends in its number"))?;
            table.nights = table.nights.max(number);
            for (seen, row) in read(&file)? {
                table.put(Night { number, seen, row });
            }
        }
        Ok(table)
    }

    fn put(&mut self, night: Night) {
        let known = self.rows.get(&night.row.path);
        if known.is_none_or(|known| known.number <= night.number) {
            self.rows.insert(night.row.path.clone(), night);
        }
    }

    /// What [`add`](Self::add) is to be told of a trace that no night has judged as it is now, with the rig that it has
    /// now; none where one has.
    pub fn new_as(&self, trace: &Path, rig: Option<&Rig>) -> Option<String> {
        let seen = seen(trace, rig);
        let known = self.rows.get(&trace.display().to_string());
        known.is_none_or(|known| known.seen != seen).then_some(seen)
    }

    /// Those of `traces` that are new, and what each is [`new_as`](Self::new_as).
    pub fn news(&self, traces: Vec<FleetTrace>) -> (Vec<FleetTrace>, Vec<String>) {
        let new_as = |trace: &FleetTrace| self.new_as(&trace.path, trace.rig.as_deref().ok());
        traces.into_iter().filter_map(|trace| new_as(&trace).map(|seen| (trace, seen))).unzip()
    }

    /// Writes this night's rows, and gives those of all nights in the order of their paths. Rows of traces that could not
    /// be judged are not written: the next night tries again.
    ///
    /// # Errors
    /// Where a file can't be written. Days before it are written, and known to the next night.
    pub fn add(mut self, seen: Vec<String>, rows: Vec<FleetRow>) -> Result<Vec<FleetRow>, FleetError> {
        let number = self.nights + 1;
        let mut days: BTreeMap<String, (Vec<String>, Vec<FleetRow>)> = BTreeMap::new();
        for (seen, row) in seen.into_iter().zip(rows) {
            if row.error.is_none() {
                let (seens, rows) = days.entry(day(&row)).or_default();
                seens.push(seen.clone());
                rows.push(row.clone());
            }
            self.put(Night { number, seen, row });
        }
        for (day, (seen, rows)) in days {
            let folder = self.folder.join(format!("day={day}"));
            let refused = |source| OutputError::Write { path: folder.clone(), source };
            fs::create_dir_all(&folder).map_err(refused)?;
            let whole = rows.iter().map(serde_json::to_string).collect::<Result<Vec<_>, _>>();
            let whole = whole.map_err(|error| refused(io::Error::other(error)))?;
            let table = FleetTable::of(&rows).with_texts("seen", seen).with_texts("row", whole);
            let file = folder.join(format!("night-{number:04}.parquet"));
            FleetFile::create(&file, &Inputs::default())?.write(&table)?;
        }
        Ok(self.rows.into_values().map(|night| night.row).collect())
    }
}

/// The file's length and time, and the rig: what changes where a trace is to be judged again.
fn seen(trace: &Path, rig: Option<&Rig>) -> String {
    let file = fs::metadata(trace).ok();
    let changed = file.as_ref().and_then(|file| file.modified().ok()?.duration_since(UNIX_EPOCH).ok());
    let mut judged_with = DefaultHasher::new();
    rig.map(Rig::to_toml).hash(&mut judged_with);
    let bytes = file.map_or(0, |file| file.len());
    format!("{bytes} bytes of {}, rig {:016x}", changed.unwrap_or_default().as_nanos(), judged_with.finish())
}

fn day(row: &FleetRow) -> String {
    row.begins.map_or_else(|| NO_DAY.to_owned(), |begins| begins.strftime("%F").to_string())
}

fn number(file: &Path) -> Option<u32> {
    file.file_stem()?.to_str()?.strip_prefix("night-")?.parse().ok()
}

fn unread(file: &Path, why: &impl ToString) -> FleetError {
    FleetError::Content { what: file.display().to_string(), why: why.to_string() }
}

/// What each row of a night's file was seen as, and the row.
fn read(path: &Path) -> Result<Vec<(String, FleetRow)>, FleetError> {
    let file = File::open(path).map_err(|error| unread(path, &error))?;
    let rows = super::table::texts(file, ["seen", "row"]).map_err(|error| unread(path, &error))?;
    let row = |[seen, row]: [String; 2]| Ok((seen, serde_json::from_str(&row)?));
    rows.into_iter().map(row).collect::<Result<_, serde_json::Error>>().map_err(|error| unread(path, &error))
}
