//! Which cylinders there are, and their rigs.

use crate::Rig;
use crate::rig::RigError;
use serde::Deserialize;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// What to watch.
#[derive(Clone, Debug, PartialEq)]
pub struct LiveConfig {
    /// Rig of each cylinder that is not named; none where only named ones are watched.
    pub rig: Option<Rig>,
    /// Rigs of cylinders by name.
    pub cylinders: BTreeMap<String, Rig>,
    /// Time between two estimates, s of samples.
    pub interval_s: f64,
    /// Cylinders at most; more are left out, so that a feed that invents names does not eat the memory.
    pub most_cylinders: usize,
    /// Samples that stay before the last one taken for so long are of a clock that was set back, s.
    pub set_back_after_s: f64,
}

/// Error returned by [`LiveConfig::load`].
#[derive(Debug, thiserror::Error)]
pub enum ConfigError {
    /// The file cannot be read.
    #[error("cannot read {file}: {source}")]
    Read {
        /// As named by the user.
        file: String,
        /// What the system says.
        source: std::io::Error,
    },
    /// It is no configuration.
    #[error("{file}: {why}")]
    Content {
        /// As named by the user.
        file: String,
        /// What is wrong, and where.
        why: String,
    },
    /// A rig file that it names.
    #[error(transparent)]
    Rig(#[from] RigError),
}

const MOST_CYLINDERS: usize = 10_000;
const SET_BACK_AFTER_S: f64 = 60.0;

/// What a configuration file says of cylinders.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LiveDocument {
    rig: Option<PathBuf>,
    interval_s: Option<f64>,
    most_cylinders: Option<usize>,
    set_back_after_s: Option<f64>,
    #[serde(default)]
    cylinders: BTreeMap<String, Entry>,
}

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Entry {
    rig: PathBuf,
}

impl LiveConfig {
    /// One rig for all cylinders, and an estimate a second.
    pub fn of(rig: Rig) -> Self {
        Self {
            rig: Some(rig),
            cylinders: BTreeMap::new(),
            interval_s: 1.0,
            most_cylinders: MOST_CYLINDERS,
            set_back_after_s: SET_BACK_AFTER_S,
        }
    }

    /// Reads a configuration: `rig` for all cylinders, `[cylinders."T7/B2"] rig = …` for one of its own (paths from the
    /// file's folder), `interval_s`. Without `rig`, other cylinders than those named are not watched.
    ///
    /// # Errors
    /// Where the file or a rig file that it names cannot be used.
    pub fn load(path: &Path) -> Result<Self, ConfigError> {
        let file = path.display().to_string();
        let text = std::fs::read_to_string(path)
            .map_err(|source| ConfigError::Read { file: file.clone(), source })?;
        let content = |why: String| ConfigError::Content { file: file.clone(), why };
        let document: LiveDocument =
            toml::from_str(&text).map_err(|error| content(error.to_string().trim().replace('\n', " ")))?;
        document.load(path)
    }

    /// The rig of a cylinder; none where it is not watched.
    pub fn rig_of(&self, cylinder: &str) -> Option<&Rig> {
        self.cylinders.get(cylinder).or(self.rig.as_ref())
    }
}

impl LiveDocument {
    /// With the rig files that it names; `path` is where it stands.
    ///
    /// # Errors
    /// Where a value is impossible or a rig file cannot be used.
    pub fn load(&self, path: &Path) -> Result<LiveConfig, ConfigError> {
        let content = |why: String| ConfigError::Content { file: path.display().to_string(), why };
        let folder = path.parent().unwrap_or(Path::new(""));
        let load = |rig: &PathBuf| Rig::load(folder.join(rig));
        let seconds = |name: &str, value: Option<f64>, default: f64| match value.unwrap_or(default) {
            value if (1e-3..=86_400.0).contains(&value) => Ok(value),
            value => Err(content(format!("{name} = {value}: 0.001 to 86400 is allowed"))),
        };
        let interval_s = seconds("interval_s", self.interval_s, 1.0)?;
        let set_back_after_s = seconds("set_back_after_s", self.set_back_after_s, SET_BACK_AFTER_S)?;
        let named = self.cylinders.iter().map(|(name, entry)| Ok((name.clone(), load(&entry.rig)?)));
        let cylinders = named.collect::<Result<BTreeMap<_, _>, RigError>>()?;
        let rig = self.rig.as_ref().map(load).transpose()?;
        if rig.is_none() && cylinders.is_empty() {
            return Err(content("neither `rig` nor a cylinder under `[cylinders]`".to_owned()));
        }
        let most_cylinders = self.most_cylinders.unwrap_or(MOST_CYLINDERS).max(cylinders.len());
        Ok(LiveConfig { rig, cylinders, interval_s, most_cylinders, set_back_after_s })
    }
}
