//! Which traces there are, and what is known of each before it is read.

use super::{FleetError, TraceIdentity};
use crate::Rig;
use crate::output::{Inputs, identity};
use glob::{MatchOptions, Pattern};
use std::collections::{BTreeMap, HashMap, HashSet};
use std::fs::File;
use std::hash::{DefaultHasher, Hasher};
use std::io::Read;
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
    pub rig: LoadedRig,
}

/// A rig, or why its file can't be used.
type LoadedRig = Result<Arc<Rig>, Arc<str>>;

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
        let table = if let FleetRig::Table(file) = rigs { Some(rig_table(file)?) } else { None };
        // Each file is read once.
        let mut known: HashMap<Option<PathBuf>, LoadedRig> = HashMap::new();
        if let FleetRig::One(file) = rigs {
            known.insert(Some(file.clone()), Ok(Arc::new(Rig::load(file)?)));
        }
        let trace = |(path, other_names): (PathBuf, Vec<PathBuf>)| {
            let mut identity = TraceIdentity::of(&path);
            let rig_file = match (rigs, &table) {
                (FleetRig::One(file), _) => Some(file.clone()),
                (_, None) => Some(path.with_file_name("rig.toml")).filter(|file| file.is_file()),
                (_, Some(table)) => {
                    let Some(row) = row_of(table, &path) else { return Err(path) };
                    identity.cylinder = row.cylinder.clone().unwrap_or(identity.cylinder);
                    Some(row.rig.clone())
                }
            };
            let load = |file: &Option<PathBuf>| {
                let rig = file.as_ref().map_or_else(|| Ok(Rig::paper()), Rig::load);
                rig.map(Arc::new).map_err(|error| error.to_string().into())
            };
            let rig = known.entry(rig_file.clone()).or_insert_with_key(load).clone();
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
            _ => Ok(merged(found.into_iter().flatten().collect())),
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
    let wrong = |why: String| FleetError::Content { what: pattern.to_owned(), why };
    let entries = glob::glob(pattern).map_err(|error| wrong(error.to_string()))?;
    let files = entries.filter(|entry| !entry.as_ref().is_ok_and(|path| path.is_dir()));
    files.collect::<Result<_, _>>().map_err(|error| wrong(error.to_string()))
}

/// Within so many bytes the noise of two recordings of one size makes them differ.
const HEAD_BYTES: usize = 64 << 10;

/// A recording counts once, whatever its files are called. Moves copies to the trace that comes first: the same bytes, judged with
/// the same rig. Only files of one size are opened,
/// and only those that begin alike are read to their end.
fn merged(traces: Vec<FleetTrace>) -> Vec<FleetTrace> {
    let looks: [fn(&Path) -> Option<u64>; 3] =
        [size, |path| hash(path, HEAD_BYTES as u64), |path| hash(path, u64::MAX)];
    let mut groups: Vec<Vec<usize>> = vec![(0..traces.len()).collect()];
    for look in looks {
        let same = |group: &Vec<usize>| alike(group, |at| look(&traces.get(*at)?.path));
        groups = groups.iter().flat_map(same).collect();
    }
    let mut first_of = HashMap::new();
    for group in groups {
        let mut firsts: Vec<usize> = Vec::new();
        for at in group {
            let rig = |at: usize| traces.get(at).map(|trace| &trace.rig);
            match firsts.iter().find(|first| rig(**first).zip(rig(at)).is_some_and(|(a, b)| same_rig(a, b))) {
                Some(first) => drop(first_of.insert(at, *first)),
                None => firsts.push(at),
            }
        }
    }
    let mut kept: BTreeMap<usize, FleetTrace> = BTreeMap::new();
    for (at, trace) in traces.into_iter().enumerate() {
        match first_of.get(&at).and_then(|first| kept.get_mut(first)) {
            Some(first) => first.copies.extend([trace.path].into_iter().chain(trace.other_names)),
            None => drop(kept.insert(at, trace)),
        }
    }
    kept.into_values().collect()
}

/// The members that share their key with another, by their keys.
fn alike(group: &[usize], key: impl Fn(&usize) -> Option<u64>) -> Vec<Vec<usize>> {
    let mut by_key: HashMap<u64, Vec<usize>> = HashMap::new();
    for at in group {
        if let Some(key) = key(at) {
            by_key.entry(key).or_default().push(*at);
        }
    }
    by_key.into_values().filter(|group| group.len() > 1).collect()
}

/// Whether a trace is judged alike by both, wherever their files stand.
fn same_rig(a: &LoadedRig, b: &LoadedRig) -> bool {
    let nameless = |rig: &Rig| Rig { name: String::new(), ..rig.clone() };
    match (a, b) {
        (Ok(a), Ok(b)) => Arc::ptr_eq(a, b) || nameless(a) == nameless(b),
        (a, b) => a == b,
    }
}

/// Of what can be opened twice: not of a pipe.
fn size(path: &Path) -> Option<u64> {
    Some(std::fs::metadata(path).ok().filter(std::fs::Metadata::is_file)?.len())
}

/// Of a file's first bytes.
fn hash(path: &Path, most: u64) -> Option<u64> {
    let mut file = File::open(path).ok()?.take(most);
    let mut hasher = DefaultHasher::new();
    let mut block = vec![0; HEAD_BYTES];
    loop {
        let length = file.read(&mut block).ok()?;
        match block.get(..length)? {
            [] => return Some(hasher.finish()),
            bytes => hasher.write(bytes),
        }
    }
}

/// What a table of rigs says of a trace.
struct RigRow {
    pattern: Pattern,
    rig: PathBuf,
    cylinder: Option<String>,
}

/// The first row that fits a trace.
fn row_of<'t>(table: &'t [RigRow], trace: &Path) -> Option<&'t RigRow> {
    let options = MatchOptions { require_literal_separator: true, ..MatchOptions::default() };
    let trace = std::path::absolute(trace).unwrap_or_else(|_| trace.to_owned());
    let trace = trace.to_string_lossy();
    table.iter().find(|row| row.pattern.matches_with(&trace, options))
}

/// A CSV file with the columns `trace` (a path or a pattern), `rig` (a rig file) and, optionally, `cylinder` (its name).
/// Paths count from the table's folder; of one that can't be read the error names the row.
fn rig_table(path: &Path) -> Result<Vec<RigRow>, FleetError> {
    read(path).map_err(|why| FleetError::Content { what: path.display().to_string(), why })
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
