//! Sensor faults: what dead meters, exchanged wires and wrong units make of honest readings.

mod apply;
#[cfg(test)]
mod tests;
mod text;

pub use apply::SensorFaults;
pub use text::SensorFaultError;

use super::span::Span;
use crate::signal::Signal;

/// One mistake of the sensors, their wires or their recorder; see [`SensorFault::from_str`](std::str::FromStr).
#[derive(Clone, Debug, PartialEq)]
pub struct SensorFault {
    /// As given.
    text: String,
    mistake: Mistake,
    during: Span,
}

/// What a mistake does.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Mistake {
    /// One channel shows something else.
    Channel(Signal, Distortion),
    /// Two channels are exchanged.
    Swap(Signal, Signal),
    /// This share of the rows is not recorded.
    RowsLost(f64),
}

/// What one channel makes of its readings.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Distortion {
    /// Zero.
    Dead,
    /// The first reading, again and again.
    Stuck,
    /// No reading.
    Missing,
    Reversed,
    Absolute,
    /// Distance from the other end of the stroke.
    OtherEnd,
    Offset(Amount),
    /// Growth of the zero per hour.
    Drift(Amount),
    /// The reading times this.
    Times(f64),
    /// Never more than this, either way.
    Clipped(Amount),
    /// One reading for this long, s.
    Held(f64),
    /// The reading of this time ago, s.
    Late(f64),
    /// This share of the readings is full scale.
    Spikes(f64),
}

/// A quantity of a channel.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Amount {
    /// In SI.
    Si(f64),
    /// A share of the sensor's full scale.
    OfFullScale(f64),
}

impl Amount {
    fn si(self, full_scale: f64) -> f64 {
        match self {
            Self::Si(value) => value,
            Self::OfFullScale(share) => share * full_scale,
        }
    }
}

impl std::fmt::Display for SensorFault {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.text)
    }
}
