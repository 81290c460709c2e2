//! The estimators' state in a folder: written whole or not at all, the generation before kept.

use super::cylinder::Cylinder;
use super::watch::Watch;
use crate::Rig;
use crate::output::{self, Inputs, OutputError};
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

/// Name and version of the saved form.
const SCHEMA: &str = "pitchleak.watch/1";
const NAME: &str = "watch.state";
const BEFORE: &str = "watch.state.before";

/// The folder.
pub struct Checkpoint {
    folder: PathBuf,
}

/// Why there is no checkpoint.
#[derive(Debug, thiserror::Error)]
pub enum CheckpointError {
    /// It cannot be written.
    #[error(transparent)]
    Output(#[from] OutputError),
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

    /// Writes what `watch` knows.
    ///
    /// # Errors
    /// Where the disk does not take it; then the one before is still there.
    pub fn save(&self, watch: &Watch) -> Result<(), CheckpointError> {
        let path = self.folder.join(NAME);
        let content = |why: String| CheckpointError::Content { file: path.display().to_string(), why };
        let mut bytes = Vec::new();
        ciborium::into_writer(&(SCHEMA, &watch.cylinders), &mut bytes)
            .map_err(|error| content(error.to_string()))?;
        bytes.extend(checksum(&bytes).to_le_bytes());
        // One of the two is whole at any time.
        if path.exists() {
            let moved = fs::rename(&path, self.folder.join(BEFORE));
            moved.map_err(|source| OutputError::Write { path: path.clone(), source })?;
        }
        Ok(output::write(&path, bytes, &Inputs::default())?)
    }

    /// Goes on from the last checkpoint, if there is one; gives what is to be said of a damaged one.
    ///
    /// # Errors
    /// Where there are checkpoints and none can be used, or one is of another rig.
    pub fn restore(&self, watch: &mut Watch) -> Result<Option<String>, CheckpointError> {
        let (newest, before) = (self.folder.join(NAME), self.folder.join(BEFORE));
        let damage = match read(&newest) {
            None => None,
            Some(Ok(cylinders)) => return self.put(watch, cylinders).map(|()| None),
            Some(Err(why)) => Some(why),
        };
        match (read(&before), damage) {
            (Some(Ok(cylinders)), damage) => {
                self.put(watch, cylinders)?;
                let why = damage.unwrap_or_else(|| "not there".to_owned());
                Ok(Some(format!("{}: {why}: the one before is used", newest.display())))
            }
            (None, None) => Ok(None),
            (_, Some(why)) | (Some(Err(why)), None) => {
                Err(CheckpointError::Content { file: newest.display().to_string(), why })
            }
        }
    }

    fn put(&self, watch: &mut Watch, cylinders: BTreeMap<String, Cylinder>) -> Result<(), CheckpointError> {
        for (name, cylinder) in &cylinders {
            // By whatever name.
            if watch.config().rig_of(name).map(Rig::to_toml) != Some(cylinder.rig().to_toml()) {
                let file = self.folder.join(NAME).display().to_string();
                let why = format!("of another rig than `{name}` has now");
                return Err(CheckpointError::Content { file, why });
            }
        }
        watch.cylinders = cylinders;
        Ok(())
    }
}

/// The cylinders of a checkpoint; none where there is no file.
fn read(path: &Path) -> Option<Result<BTreeMap<String, Cylinder>, String>> {
    let bytes = match fs::read(path) {
        Ok(bytes) => bytes,
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => return None,
        Err(error) => return Some(Err(error.to_string())),
    };
    let Some((body, sum)) = bytes.split_last_chunk::<4>() else { return Some(Err("cut short".to_owned())) };
    if checksum(body) != u32::from_le_bytes(*sum) {
        return Some(Err("damaged".to_owned()));
    }
    let read = ciborium::from_reader::<(String, BTreeMap<String, Cylinder>), _>(body);
    Some(match read {
        Ok((schema, cylinders)) if schema == SCHEMA => Ok(cylinders),
        _ => Err(format!("of another version, this one reads `{SCHEMA}`")),
    })
}

/// CRC-32 (ISO-HDLC), as of gzip.
fn checksum(bytes: &[u8]) -> u32 {
    let mut crc = flate2::Crc::new();
    crc.update(bytes);
    crc.sum()
}
