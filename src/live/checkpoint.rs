//! The cylinders' states in a folder, a file for each: written whole or not at all, the one before kept, so that what is
//! wrong with one is nobody else's.

use super::cylinder::Cylinder;
use super::event::NoticeEvent;
use super::watch::Watch;
use crate::output::{self, OutputError};
use crate::replay::every_number;
use ciborium::Value;
use flate2::bufread::GzDecoder;
use flate2::{Compression, GzBuilder};
use percent_encoding::{AsciiSet, NON_ALPHANUMERIC, percent_decode_str, utf8_percent_encode};
use std::collections::{BTreeMap, BTreeSet};
use std::fs::{self, File, TryLockError};
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};

/// Name and version of the saved form: gzip, which has a checksum, of CBOR: this, the cylinder's name, and its state.
const SCHEMA: &str = "pitchleak.watch/5";
/// Folder of the states, in the folder that is given.
const CYLINDERS: &str = "cylinders";
/// Whose process has the folder for itself.
const LOCK: &str = "lock";

const STATE: &str = "state";
const BEFORE: &str = "state.before";
/// Being written.
const NEW: &str = "state.new";
/// What a cylinder could not go on from, kept for whoever asks why.
const ASIDE: &str = "state.aside";

/// What stays as it is in the name of a file.
const PLAIN: &AsciiSet = &NON_ALPHANUMERIC.remove(b'-').remove(b'_');
/// Bytes of a cylinder's name in that of a file: with an ending, file systems take 255.
const LONGEST_NAME: usize = 240;
/// No state is larger once unpacked, bytes: a forged one would fill the memory.
const LARGEST: u64 = 16 * 1024 * 1024;
/// Beyond any time in s and any sum of flows in L/min.
const LARGEST_NUMBER: f64 = 1e15;

/// Whether a cylinder may have this name.
pub(super) fn can_name(name: &str) -> bool {
    !name.contains(char::is_control)
        && utf8_percent_encode(name, PLAIN).map(str::len).sum::<usize>() <= LONGEST_NAME
}

/// The folder, which nobody else has meanwhile.
#[derive(Debug)]
pub struct Checkpoint {
    folder: PathBuf,
    _lock: File,
}

/// What a [`Watch`] knew of some cylinders at one moment, to be written while it goes on.
#[derive(Default)]
pub struct Snapshot {
    cylinders: BTreeMap<String, Cylinder>,
    /// States that nobody goes on from.
    aside: BTreeMap<String, Cylinder>,
}

impl Snapshot {
    /// Of the cylinders that changed since the last one.
    pub fn of(watch: &mut Watch) -> Self {
        let changed = watch.cylinders.iter_mut().filter(|(_, cylinder)| cylinder.changed);
        let as_of_now = |(name, cylinder): (&String, &mut Cylinder)| {
            cylinder.changed = false;
            (name.clone(), cylinder.clone())
        };
        let mut cylinders: BTreeMap<_, _> = changed.map(as_of_now).collect();
        cylinders.append(&mut watch.gone);
        Self { cylinders, aside: std::mem::take(&mut watch.replaced) }
    }

    /// Whether nothing changed.
    pub fn is_empty(&self) -> bool {
        self.cylinders.is_empty() && self.aside.is_empty()
    }

    /// It could not be written: all of it goes into the next one.
    pub fn give_back(self, watch: &mut Watch) {
        for (name, cylinder) in self.cylinders {
            match watch.cylinders.get_mut(&name) {
                Some(known) => known.changed = true,
                None => _ = watch.gone.entry(name).or_insert(cylinder),
            }
        }
        for (name, cylinder) in self.aside {
            watch.replaced.entry(name).or_insert(cylinder);
        }
    }
}

/// Why there is no checkpoint.
#[derive(Debug, thiserror::Error)]
pub enum CheckpointError {
    /// There is no folder for it.
    #[error(transparent)]
    Folder(#[from] OutputError),
    /// Another process keeps its state there: both would spoil it.
    #[error("{folder}: another process keeps its state there")]
    Taken {
        /// The folder.
        folder: String,
    },
    /// The system does not let us read it.
    #[error("cannot read {file}: {source}")]
    Read {
        /// Which.
        file: String,
        /// What the system says.
        source: io::Error,
    },
    /// The disk does not take it.
    #[error("cannot write {file}: {source}")]
    Write {
        /// Which.
        file: String,
        /// What the system says.
        source: io::Error,
    },
}

impl Checkpoint {
    /// Makes the folder where it is not there, and takes it for this process.
    ///
    /// # Errors
    /// Where files cannot be made in it, or another process has it.
    pub fn new(folder: impl AsRef<Path>) -> Result<Self, CheckpointError> {
        let folder = folder.as_ref();
        output::make_folder(folder)?;
        let path = folder.join(LOCK);
        let write = |source| CheckpointError::Write { file: path.display().to_string(), source };
        let lock = File::options().create(true).truncate(false).write(true).open(&path).map_err(write)?;
        match lock.try_lock() {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => {
                return Err(CheckpointError::Taken { folder: folder.display().to_string() });
            }
            Err(TryLockError::Error(source)) => return Err(write(source)),
        }
        let folder = folder.join(CYLINDERS);
        output::make_folder(&folder)?;
        Ok(Self { folder, _lock: lock })
    }

    /// Writes what was known; says how many bytes it took.
    ///
    /// # Errors
    /// Where the disk does not take it; then each cylinder's state is the old one or the new one.
    pub fn save(&self, snapshot: &Snapshot) -> Result<usize, CheckpointError> {
        let states = snapshot.cylinders.iter().map(|state| (state, STATE));
        let aside = snapshot.aside.iter().map(|state| (state, ASIDE));
        let all: Vec<_> = states.chain(aside).collect();
        let mut bytes = 0;
        for ((name, cylinder), _) in &all {
            match self.write(name, cylinder) {
                Ok(more) => bytes += more,
                Err(error) => {
                    // Room for what else the disk has to take.
                    all.iter().for_each(|((name, _), _)| _ = fs::remove_file(self.file(name, NEW)));
                    return Err(error);
                }
            }
        }
        for ((name, _), ending) in all {
            self.place(name, ending).map_err(|source| self.not_written(name, source))?;
        }
        let synced = File::open(&self.folder).and_then(|folder| folder.sync_all());
        synced
            .map_err(|source| CheckpointError::Write { file: self.folder.display().to_string(), source })?;
        Ok(bytes)
    }

    /// A new file, all on the disk.
    fn write(&self, name: &str, cylinder: &Cylinder) -> Result<usize, CheckpointError> {
        let written = packed(name, cylinder).and_then(|bytes| {
            let mut new = File::create(self.file(name, NEW))?;
            new.write_all(&bytes)?;
            new.sync_all()?;
            Ok(bytes.len())
        });
        written.map_err(|source| self.not_written(name, source))
    }

    /// Gives it its name. A moment without a state under that name there is not.
    fn place(&self, name: &str, ending: &str) -> io::Result<()> {
        if ending == STATE {
            let before = self.file(name, BEFORE);
            let _ = fs::remove_file(&before);
            // None yet, or a file system that knows no links: then there is no state before.
            let _ = fs::hard_link(self.file(name, STATE), before);
        }
        fs::rename(self.file(name, NEW), self.file(name, ending))
    }

    fn not_written(&self, name: &str, source: io::Error) -> CheckpointError {
        CheckpointError::Write { file: self.file(name, STATE).display().to_string(), source }
    }

    fn file(&self, name: &str, ending: &str) -> PathBuf {
        self.folder.join(format!("{}.{ending}", utf8_percent_encode(name, PLAIN)))
    }

    /// Each cylinder that is not watched yet goes on from its last state, if there is one. Where that is damaged the one
    /// before is used. Where that is damaged, too, or the cylinder has another rig now, it begins anew and its state is put
    /// aside. Both is said; the others know nothing of it.
    ///
    /// # Errors
    /// Where the folder cannot be read.
    pub fn restore(&self, watch: &mut Watch) -> Result<Vec<NoticeEvent>, CheckpointError> {
        let read = |source| CheckpointError::Read { file: self.folder.display().to_string(), source };
        let entries = fs::read_dir(&self.folder).map_err(read)?;
        let names: BTreeSet<_> =
            entries.filter_map(|entry| name_of(&entry.ok()?.file_name().into_string().ok()?)).collect();
        let mut notices = Vec::new();
        for name in names {
            if watch.cylinders.contains_key(&name) || watch.config().rig_of(&name).is_none() {
                continue;
            }
            let restored = self.restore_one(watch, &name);
            notices.extend(restored.err().map(|text| NoticeEvent {
                cylinder: name,
                t_s: None,
                kind: "checkpoint".to_owned(),
                count: 1,
                text,
            }));
        }
        Ok(notices)
    }

    /// What there is to say, if something is wrong.
    fn restore_one(&self, watch: &mut Watch, name: &str) -> Result<(), String> {
        let file = self.file(name, STATE);
        if watch.cylinders() >= watch.config().most_cylinders {
            return Err(format!("{}: there are too many cylinders", file.display()));
        }
        let Some(rig) = watch.config().rig_of(name) else { return Ok(()) };
        let states = [STATE, BEFORE].map(|ending| {
            read(&self.file(name, ending), name).map(|state| match state {
                Ok(cylinder) if cylinder.is_of(rig) => Ok(cylinder),
                Ok(_) => Err("of another rig than it has now".to_owned()),
                Err(why) => Err(why),
            })
        });
        let (why, before) = match states {
            [Some(Ok(cylinder)), _] => {
                watch.cylinders.insert(name.to_owned(), cylinder);
                return Ok(());
            }
            [None, None] => return Ok(()),
            [Some(Err(why)), before] => (why, before),
            [None, before] => ("missing".to_owned(), before),
        };
        // Else the next checkpoint would put it in the place of the one before.
        let is_aside = fs::rename(&file, self.file(name, ASIDE)).is_ok();
        let then = match before {
            Some(Ok(cylinder)) => {
                watch.cylinders.insert(name.to_owned(), cylinder);
                "the one before is used"
            }
            _ => {
                let before = self.file(name, BEFORE);
                let _ = if is_aside {
                    fs::remove_file(before)
                } else {
                    fs::rename(before, self.file(name, ASIDE))
                };
                "the cylinder begins anew"
            }
        };
        Err(format!("{}: {why}: {then}", file.display()))
    }
}

/// Of the cylinder whose state a file holds.
fn name_of(file: &str) -> Option<String> {
    let (stem, ending) = file.split_once('.')?;
    let name = percent_decode_str(stem).decode_utf8().ok()?;
    ([STATE, BEFORE].contains(&ending) && utf8_percent_encode(&name, PLAIN).to_string() == stem)
        .then(|| name.into_owned())
}

/// As in the file.
fn packed(name: &str, cylinder: &Cylinder) -> io::Result<Vec<u8>> {
    let mut out = GzBuilder::new().write(Vec::new(), Compression::fast());
    ciborium::into_writer(&(SCHEMA, name, cylinder), &mut out).map_err(io::Error::other)?;
    out.finish()
}

/// A cylinder's state; none where there is no file.
fn read(path: &Path, name: &str) -> Option<Result<Cylinder, String>> {
    match fs::read(path) {
        Ok(bytes) => Some(unpacked(&bytes, name)),
        Err(error) if error.kind() == io::ErrorKind::NotFound => None,
        Err(error) => Some(Err(error.to_string())),
    }
}

/// What a file holds; else what is wrong with it.
fn unpacked(bytes: &[u8], name: &str) -> Result<Cylinder, String> {
    let mut decoder = GzDecoder::new(bytes);
    let mut body = Vec::new();
    let length = decoder.by_ref().take(LARGEST).read_to_end(&mut body).map_err(|_| "damaged".to_owned())?;
    if length as u64 == LARGEST || !decoder.into_inner().is_empty() {
        return Err("something follows its end".to_owned());
    }
    let version = || format!("of another version, this one reads `{SCHEMA}`");
    // A list whose first is the version.
    if body.get(2..2 + SCHEMA.len()) != Some(SCHEMA.as_bytes()) {
        return Err(version());
    }
    let mut rest = body.as_slice();
    let tree: Value = ciborium::from_reader(&mut rest).map_err(|_| version())?;
    if !rest.is_empty() {
        return Err("something follows its end".to_owned());
    }
    // Of the watch itself; estimators look at their own.
    if !every_number(&tree, &|number| number.abs() <= LARGEST_NUMBER) {
        return Err("a number in it is impossible".to_owned());
    }
    let (_, saved_name, cylinder): (String, String, Cylinder) =
        tree.deserialized().map_err(|ciborium::value::Error::Custom(why)| why)?;
    if saved_name != name {
        return Err(format!("of the cylinder `{}`", crate::header::shorten(&saved_name, 40)));
    }
    if !cylinder.is_possible() {
        return Err("its counts contradict each other".to_owned());
    }
    Ok(cylinder)
}
