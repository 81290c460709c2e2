use crate::CylinderError;

/// Error returned by the `check` functions of the plant and the emulator.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum PlantError {
    /// Cylinder or oil cannot exist.
    Cylinder(CylinderError),
    /// A leak coefficient is negative or not a number.
    Leaks,
    /// Gap, stiffness or damping of the end stops is not usable.
    EndStop,
    /// The vapour pressure is not between minus one atmosphere and zero gauge.
    VapourPressure,
    /// The temperature is not positive and finite.
    Temperature,
    /// A figure of a valve is not usable.
    Valve,
    /// A figure of the supply is not usable.
    Supply,
    /// A gain of a controller is negative or not a number.
    Controller,
    /// A step is not positive and finite, or far too long.
    Step,
}

impl core::fmt::Display for PlantError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str(match self {
            Self::Cylinder(error) => return error.fmt(f),
            Self::Leaks => "leak coefficients must not be negative",
            Self::EndStop => "end stops need a gap below half the stroke and a positive stiffness",
            Self::VapourPressure => "the vapour pressure must lie between -101325 Pa and 0 Pa gauge",
            Self::Temperature => "the oil temperature must be positive",
            Self::Valve => "figures of a valve must be positive and its lap below its stroke",
            Self::Supply => "figures of the supply must be positive",
            Self::Controller => "gains of a controller must not be negative",
            Self::Step => "the step must be positive and of sensible length",
        })
    }
}

impl core::error::Error for PlantError {}

impl From<CylinderError> for PlantError {
    fn from(error: CylinderError) -> Self {
        Self::Cylinder(error)
    }
}
