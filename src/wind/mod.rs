//! From turbulent wind to what a pitch cylinder has to do: the paper's Section IV, Fig. 5 and 6.
//!
//! A [`History`] is what a turbine simulation says about one blade: pitch angle and pitch moment
//! over time. [`Emulation`] turns it into the position and load the rig follows, by eq. (17) and
//! (18) and the two scale factors of the rig.

mod emulation;
mod history;

pub use emulation::{Emulation, EmulationError};
pub use history::{History, HistoryError};

use std::path::PathBuf;

/// Where a wind history comes from.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Wind {
    /// One of the paper's four, built in.
    BuiltIn(WindCase),
    /// A file: OpenFAST output, text or binary, or CSV with the columns of `data/wind`.
    File(PathBuf),
}

/// The paper's wind cases by their mean speed (Section IV); `data/wind/README.md` says how they
/// were simulated.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum WindCase {
    /// 5 m/s, 20 % turbulence: below rated power, the pitch stands still.
    Mps5,
    /// 13 m/s, 20 % turbulence.
    Mps13,
    /// 21 m/s, 20 % turbulence.
    Mps21,
    /// 30 m/s, 20 % turbulence: the extreme case, above cut-out.
    Mps30,
}

impl WindCase {
    /// All four, in the paper's order.
    pub const ALL: [Self; 4] = [Self::Mps5, Self::Mps13, Self::Mps21, Self::Mps30];

    /// Mean wind speed, m/s.
    pub fn mean_mps(self) -> u32 {
        match self {
            Self::Mps5 => 5,
            Self::Mps13 => 13,
            Self::Mps21 => 21,
            Self::Mps30 => 30,
        }
    }
}

impl std::str::FromStr for Wind {
    type Err = std::convert::Infallible;

    /// A mean speed of [`WindCase::ALL`], as `13` or `13mps`; anything else is a file's path.
    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let speed = text.strip_suffix("mps").unwrap_or(text).trim();
        let case = WindCase::ALL.into_iter().find(|case| speed == case.mean_mps().to_string());
        Ok(case.map_or_else(|| Self::File(text.into()), Self::BuiltIn))
    }
}

impl std::fmt::Display for Wind {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::BuiltIn(case) => write!(f, "{} m/s", case.mean_mps()),
            Self::File(path) => write!(f, "{}", path.display()),
        }
    }
}
