//! The estimators' state in a folder: written whole or not at all, the generation before kept.

use super::cylinder::Cylinder;
use super::event::NoticeEvent;
use super::watch::Watch;
use crate::Rig;
use crate::output::{self, OutputError};
use crate::replay::every_number;
use ciborium::Value;
use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

/// Name and version of the saved form: the cylinders by name, each with its estimator's own bytes, and a checksum.
const SCHEMA: &str = "pitchleak.watch/2";
const NAME: &str = "watch.state";
const BEFORE: &str = "watch.state.before";
/// Being written.
const NEW: &str = "watch.state.new";
/// Found damaged, and kept for whoever asks why.
const DAMAGED: &str = "watch.state.damaged";

/// The folder.
#[derive(Clone, Debug)]
pub struct Checkpoint {
    folder: PathBuf,
}

/// What a [`Watch`] knew at one moment, to be written while it goes on.
pub struct Snapshot {
    cylinders: BTreeMap<String, Cylinder>,
    unsent: Vec<String>,
}

/// What a checkpoint holds.
type Saved = (String, BTreeMap<String, Cylinder>, Vec<String>);

/// What there is to say of a checkpoint that was gone on from.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Restored {
    /// What is wrong with the newest one.
    pub notice: Option<NoticeEvent>,
    /// See [`Snapshot::with_unsent`].
    pub unsent: Vec<String>,
}

impl Snapshot {
    /// As of now.
    pub fn of(watch: &Watch) -> Self {
        Self { cylinders: watch.cylinders.clone(), unsent: Vec::new() }
    }

    /// With what follows from the samples so far and has not reached anybody yet: whoever goes on has to send it.
    #[must_use]
    pub fn with_unsent(self, unsent: Vec<String>) -> Self {
        Self { unsent, ..self }
    }

    /// As in the file.
    fn bytes(&self) -> Result<Vec<u8>, String> {
        let mut bytes = Vec::new();
        ciborium::into_writer(&(SCHEMA, &self.cylinders, &self.unsent), &mut bytes)
            .map_err(|error| error.to_string())?;
        bytes.extend(checksum(&bytes).to_le_bytes());
        Ok(bytes)
    }
}

/// Why there is no checkpoint.
#[derive(Debug, thiserror::Error)]
pub enum CheckpointError {
    /// There is no folder for it.
    #[error(transparent)]
    Folder(#[from] OutputError),
    /// The disk does not take it.
    #[error("cannot write {file}: {source}")]
    Write {
        /// Which.
        file: String,
        /// What the system says.
        source: io::Error,
    },
    /// Neither generation can be used.
    #[error("{file}: {why}: move it away to begin anew")]
    Content {
        /// The newer one.
        file: String,
        /// What is wrong with it.
        why: String,
    },
}

impl Checkpoint {
    /// Makes the folder where it is not there.
    ///
    /// # Errors
    /// Where files cannot be made in it.
    pub fn new(folder: impl Into<PathBuf>) -> Result<Self, CheckpointError> {
        let folder = folder.into();
        output::make_folder(&folder)?;
        Ok(Self { folder })
    }

    /// Writes what was known; says how many bytes it took.
    ///
    /// # Errors
    /// Where the disk does not take it; then both generations are still there.
    pub fn save(&self, snapshot: &Snapshot) -> Result<usize, CheckpointError> {
        let file = self.file(NAME);
        let bytes = snapshot
            .bytes()
            .map_err(|why| CheckpointError::Content { file: file.display().to_string(), why })?;
        match self.write(&bytes) {
            Ok(()) => Ok(bytes.len()),
            Err(source) => Err(CheckpointError::Write { file: file.display().to_string(), source }),
        }
    }

    /// The new one is on the disk before either name is touched.
    fn write(&self, bytes: &[u8]) -> io::Result<()> {
        let mut new = File::create(self.file(NEW))?;
        new.write_all(bytes)?;
        new.sync_all()?;
        match fs::rename(self.file(NAME), self.file(BEFORE)) {
            Err(error) if error.kind() != io::ErrorKind::NotFound => return Err(error),
            _ => {}
        }
        fs::rename(self.file(NEW), self.file(NAME))?;
        File::open(&self.folder)?.sync_all()
    }

    fn file(&self, name: &str) -> PathBuf {
        self.folder.join(name)
    }

    /// Goes on from the last checkpoint, if there is one. Where that is damaged or missing, the one before it is taken, and
    /// a notice says so.
    ///
    /// # Errors
    /// Where there are checkpoints and none can be used, or one is of another rig.
    pub fn restore(&self, watch: &mut Watch) -> Result<Restored, CheckpointError> {
        let newest = self.file(NAME);
        let damage = match read(&newest) {
            None => None,
            Some(Ok((_, cylinders, unsent))) => {
                self.put(watch, cylinders)?;
                return Ok(Restored { notice: None, unsent });
            }
            Some(Err(why)) => Some(why),
        };
        match (read(&self.file(BEFORE)), damage) {
            (Some(Ok((_, cylinders, unsent))), damage) => {
                self.put(watch, cylinders)?;
                if damage.is_some() {
                    // Else the next checkpoint would put it in the place of the good one.
                    let aside = fs::rename(&newest, self.file(DAMAGED));
                    let file = newest.display().to_string();
                    aside.map_err(|source| CheckpointError::Write { file, source })?;
                }
                let why = damage.unwrap_or_else(|| "missing".to_owned());
                let notice = Some(NoticeEvent {
                    cylinder: String::new(),
                    t_s: None,
                    kind: "checkpoint".to_owned(),
                    count: 1,
                    text: format!("{}: {why}: the one before is used", newest.display()),
                });
                Ok(Restored { notice, unsent })
            }
            (None, None) => Ok(Restored::default()),
            (_, Some(why)) | (Some(Err(why)), None) => {
                Err(CheckpointError::Content { file: newest.display().to_string(), why })
            }
        }
    }

    fn put(&self, watch: &mut Watch, cylinders: BTreeMap<String, Cylinder>) -> Result<(), CheckpointError> {
        for (name, cylinder) in &cylinders {
            // By whatever name.
            if watch.config().rig_of(name).map(Rig::to_toml) != Some(cylinder.rig().to_toml()) {
                let file = self.file(NAME).display().to_string();
                let why = format!("of another rig than `{name}` has now");
                return Err(CheckpointError::Content { file, why });
            }
        }
        watch.cylinders = cylinders;
        Ok(())
    }
}

/// A checkpoint; none where there is no file.
fn read(path: &Path) -> Option<Result<Saved, String>> {
    let bytes = match fs::read(path) {
        Ok(bytes) => bytes,
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => return None,
        Err(error) => return Some(Err(error.to_string())),
    };
    let Some((body, sum)) = bytes.split_last_chunk::<4>() else { return Some(Err("cut short".to_owned())) };
    if checksum(body) != u32::from_le_bytes(*sum) {
        return Some(Err("damaged".to_owned()));
    }
    let version = format!("of another version, this one reads `{SCHEMA}`");
    // A list whose first is the version.
    if body.get(2..2 + SCHEMA.len()) != Some(SCHEMA.as_bytes()) {
        return Some(Err(version));
    }
    Some(saved(body).map_err(|why| why.unwrap_or(version)))
}

/// What CBOR holds; else what is wrong with it, where it is of this version.
fn saved(mut body: &[u8]) -> Result<Saved, Option<String>> {
    let tree: Value = ciborium::from_reader(&mut body).map_err(|_| None)?;
    if !body.is_empty() {
        return Err(Some("something follows its end".to_owned()));
    }
    // Of the watch itself; estimators look at their own.
    if !every_number(&tree, &|number| number.abs() <= LARGEST) {
        return Err(Some("a number in it is impossible".to_owned()));
    }
    let saved: Saved = tree.deserialized().map_err(|ciborium::value::Error::Custom(why)| Some(why))?;
    if !saved.1.values().all(Cylinder::is_possible) {
        return Err(Some("its counts contradict each other".to_owned()));
    }
    Ok(saved)
}

/// Beyond any time in s and any flow in L/min.
const LARGEST: f64 = 1e15;

/// CRC-32 (ISO-HDLC), as of gzip.
fn checksum(bytes: &[u8]) -> u32 {
    let mut crc = flate2::Crc::new();
    crc.update(bytes);
    crc.sum()
}
