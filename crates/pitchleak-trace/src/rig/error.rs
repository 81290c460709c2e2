use crate::units::UnitError;
use std::fmt;

/// Where in a rig file something stands.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Place {
    /// The file as the user named it.
    pub file: String,
    /// Line, from 1, where one is known.
    pub line: Option<usize>,
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.line {
            Some(line) => write!(f, "{}:{line}", self.file),
            None => f.write_str(&self.file),
        }
    }
}

/// What is wrong with a rig file.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Fault {
    /// The text is not TOML.
    #[error("not a TOML file: {0}")]
    Syntax(String),
    /// A key that no rig file has.
    #[error("unknown key `{key}`; allowed here: {allowed}")]
    UnknownKey {
        /// With its section, e.g. `cylinder.aera_a`.
        key: String,
        /// The keys that may stand there.
        allowed: String,
    },
    /// A key that every rig file must have.
    #[error("missing key `{key}`: {wanted}")]
    MissingKey {
        /// With its section.
        key: String,
        /// What belongs there.
        wanted: String,
    },
    /// The value is of another kind, e.g. a list.
    #[error("`{key}` must be {wanted}")]
    Kind {
        /// With its section.
        key: String,
        /// What belongs there.
        wanted: String,
    },
    /// The value is no quantity, or has a wrong unit.
    #[error("`{key}`: {source}")]
    Quantity {
        /// With its section.
        key: String,
        /// What is wrong with the quantity.
        source: UnitError,
    },
    /// The value can't be.
    #[error("`{key}` is {value}; it must be {allowed}")]
    Impossible {
        /// With its section.
        key: String,
        /// The value as understood.
        value: String,
        /// The values allowed.
        allowed: String,
    },
}

/// Error returned by [`Rig::load`](super::Rig::load) and [`Rig::parse`](super::Rig::parse).
#[derive(Debug, thiserror::Error)]
pub enum RigError {
    /// The file cannot be read.
    #[error("{file}: {source}")]
    Read {
        /// The file as the user named it.
        file: String,
        /// What the system says.
        source: std::io::Error,
    },
    /// The file does not describe a rig.
    #[error("{place}: {fault}")]
    Content {
        /// File and line.
        place: Place,
        /// What is wrong there.
        fault: Fault,
    },
}
