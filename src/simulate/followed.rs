use super::PlanError;
use crate::Rig;
use crate::reference::{Reference, constant_or_file};
use crate::units::Dimension;
use crate::wind::{Emulation, History, Wind};
use std::fmt;
use std::path::Path;

/// What a simulated rig follows, as a person says it.
#[derive(Clone, Debug, PartialEq)]
pub enum Followed {
    /// Wind on a turbine, brought onto the rig.
    Wind(Wind, Emulation),
    /// Piston position and load, each a quantity that never changes or a CSV file.
    Given {
        /// E.g. `100 mm`.
        position: String,
        /// E.g. `2 kN`.
        load: String,
    },
}

impl Followed {
    pub(super) fn reference(&self, rig: &Rig) -> Result<Reference, PlanError> {
        match self {
            Self::Wind(wind, emulation) => {
                Ok(emulation.reference(&History::of(wind)?, rig.cylinder.stroke_m)?)
            }
            Self::Given { position, load } => {
                let reference = Reference::of(
                    constant_or_file(position, "x", Dimension::Length)?,
                    constant_or_file(load, "force", Dimension::Force)?,
                );
                let (position_m, _) = reference.at(0.0);
                let stroke_m = rig.cylinder.stroke_m;
                // Where a recorded position is beyond its end, the piston stays there.
                if reference.span_s().is_none() && !(0.0..=stroke_m).contains(&position_m) {
                    return Err(PlanError::BeyondStroke {
                        position: position.clone(),
                        stroke_mm: 1e3 * stroke_m,
                    });
                }
                Ok(reference)
            }
        }
    }
}

impl Followed {
    /// What may be the path of a file.
    pub(super) fn files(&self) -> Vec<&Path> {
        match self {
            Self::Wind(Wind::File(path), _) => vec![path],
            Self::Wind(..) => Vec::new(),
            Self::Given { position, load } => vec![Path::new(position), Path::new(load)],
        }
    }
}

impl fmt::Display for Followed {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Wind(wind, _) => write!(f, "wind {wind}"),
            Self::Given { position, load } => write!(f, "position {position}, load {load}"),
        }
    }
}
