//! Which traces there are, and what is known of each before it is read.

use super::{FleetError, RigTable, TraceIdentity, doubles};
use crate::Rig;
use crate::output::{Inputs, identity};
use std::collections::{HashMap, HashSet};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// A trace of a fleet.
#[derive(Clone, Debug)]
pub struct FleetTrace {
    /// The file.
    pub path: PathBuf,
    /// Its other names among those given, by links: it is judged once.
    pub other_names: Vec<PathBuf>,
    /// Files of the same bytes for the same rig: they count as this one.
    pub copies: Vec<PathBuf>,
    /// Whose it is, and from when.
    pub identity: TraceIdentity,
    /// The rig file; none for the built-in rig.
    pub rig_file: Option<PathBuf>,
    /// The rig, or why its file can't be used.
    pub rig: Result<Arc<Rig>, Arc<str>>,
}

/// Where the rigs of a fleet come from.
#[derive(Clone, Debug, Default)]
pub enum FleetRig {
    /// `rig.toml` beside each trace, else the built-in one.
    #[default]
    Beside,
    /// One rig file for all.
    One(PathBuf),
    /// A table file.
    Table(PathBuf),
}

impl FleetRig {
    /// A `.csv` file is a table, another a rig.
    pub fn from_file(file: Option<PathBuf>) -> Self {
        match file {
            None => Self::Beside,
            Some(file) if file.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("csv")) => {
                Self::Table(file)
            }
            Some(file) => Self::One(file),
        }
    }
}

impl FleetTrace {
    /// The traces that paths and patterns (`*`, `**`, `?`, `[…]`) name, each file once, with their rigs.
    ///
    /// # Errors
    /// Where a pattern names nothing, the table of rigs or the one rig file can't be used, or the table leaves a trace out.
    pub fn find(patterns: &[String], rigs: &FleetRig) -> Result<Vec<Self>, FleetError> {
        let paths = expand(patterns)?;
        let table = if let FleetRig::Table(file) = rigs { Some(RigTable::load(file)?) } else { None };
        let mut shelf = Shelf::default();
        if let FleetRig::One(file) = rigs {
            shelf.rigs.insert(file.clone(), Ok(Arc::new(Rig::load(file)?)));
        }
        let trace = |(path, other_names): (PathBuf, Vec<PathBuf>)| {
            let mut identity = TraceIdentity::of(&path);
            let rig_file = match (rigs, &table) {
                (FleetRig::One(file), _) => Some(file.clone()),
                (_, None) => shelf.beside(&path),
                (_, Some(table)) => {
                    let Some(row) = table.row_of(&path) else { return Err(path) };
                    identity.cylinder = row.cylinder.clone().unwrap_or(identity.cylinder);
                    Some(row.rig.clone())
                }
            };
            let rig = match &rig_file {
                Some(file) => shelf.load(file),
                None => Ok(shelf.paper()),
            };
            Ok(Self { path, other_names, copies: Vec::new(), identity, rig_file, rig })
        };
        let found: Vec<Result<Self, PathBuf>> = paths.into_iter().map(trace).collect();
        let mut without = found.iter().filter_map(|found| found.as_ref().err());
        match (without.next(), rigs) {
            (Some(trace), FleetRig::Table(table)) => Err(FleetError::NotInTable {
                table: table.display().to_string(),
                trace: trace.display().to_string(),
                others: without.count(),
            }),
            _ => Ok(doubles::merge(found.into_iter().flatten().collect())),
        }
    }

    /// The files that judging `traces` reads, which are not to be written over.
    pub fn inputs(traces: &[Self], rigs: &FleetRig) -> Inputs {
        let table = if let FleetRig::Table(file) = rigs { Some(file) } else { None };
        let rig_files: HashSet<_> = traces.iter().filter_map(|trace| trace.rig_file.as_ref()).collect();
        let named = traces.iter().flat_map(|Self { path, other_names, copies, .. }| {
            std::iter::once(path).chain(other_names).chain(copies)
        });
        Inputs::of(named.chain(rig_files).chain(table))
    }

    /// A sentence for each file that is judged as another of `traces`.
    pub fn doubles(traces: &[Self]) -> impl Iterator<Item = String> {
        traces.iter().flat_map(|trace| {
            let Self { path, identity, .. } = trace;
            let say = move |what| {
                move |other: &PathBuf| {
                    let (other, first, cylinder) = (other.display(), path.display(), &identity.cylinder);
                    format!("{other} is {what} {first}: judged once, as a trace of {cylinder}")
                }
            };
            let links = trace.other_names.iter().map(say("the same file as"));
            links.chain(trace.copies.iter().map(say("a copy of")))
        })
    }
}

/// Files in the order of the patterns, each with its other names.
fn expand(patterns: &[String]) -> Result<Vec<(PathBuf, Vec<PathBuf>)>, FleetError> {
    let (mut files, mut seen): (Vec<(PathBuf, Vec<PathBuf>)>, _) = (Vec::new(), HashMap::new());
    for pattern in patterns {
        let found = matches(pattern)?;
        if found.is_empty() {
            return Err(FleetError::NoTrace(pattern.clone()));
        }
        for path in found {
            let at = identity(&path).map_or(files.len(), |known| *seen.entry(known).or_insert(files.len()));
            match files.get_mut(at) {
                None => files.push((path, Vec::new())),
                Some((known, others)) if *known != path && !others.contains(&path) => others.push(path),
                Some(_) => {}
            }
        }
    }
    Ok(files)
}

/// A file that is there is itself, whatever characters its name has.
fn matches(pattern: &str) -> Result<Vec<PathBuf>, FleetError> {
    let path = Path::new(pattern);
    if path.is_dir() {
        return Err(FleetError::Folder(pattern.trim_end_matches('/').to_owned()));
    }
    if path.exists() {
        return Ok(vec![path.to_owned()]);
    }
    let wrong = |why: String| FleetError::Pattern { pattern: pattern.to_owned(), why };
    let entries = glob::glob(pattern).map_err(|error| wrong(error.to_string()))?;
    let files = entries.filter(|entry| !entry.as_ref().is_ok_and(|path| path.is_dir()));
    files.collect::<Result<_, _>>().map_err(|error| wrong(error.to_string()))
}

/// Rig files, each read once.
#[derive(Default)]
struct Shelf {
    paper: Option<Arc<Rig>>,
    rigs: HashMap<PathBuf, Result<Arc<Rig>, Arc<str>>>,
    beside: HashMap<PathBuf, Option<PathBuf>>,
}

impl Shelf {
    fn paper(&mut self) -> Arc<Rig> {
        self.paper.get_or_insert_with(|| Arc::new(Rig::paper())).clone()
    }

    fn load(&mut self, file: &Path) -> Result<Arc<Rig>, Arc<str>> {
        let load = || Rig::load(file).map(Arc::new).map_err(|error| error.to_string().into());
        self.rigs.entry(file.to_owned()).or_insert_with(load).clone()
    }

    fn beside(&mut self, trace: &Path) -> Option<PathBuf> {
        let file = trace.with_file_name("rig.toml");
        self.beside.entry(file).or_insert_with_key(|file| file.is_file().then(|| file.clone())).clone()
    }
}
