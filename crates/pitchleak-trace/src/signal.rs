//! The signals that a trace may hold, and what each measures.

use crate::units::Dimension;

/// One signal of a trace; the names are those of the column headers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, serde::Serialize, serde::Deserialize)]
pub enum Signal {
    /// `t`: time.
    #[serde(rename = "t")]
    Time,
    /// `timestamp`: time in ISO 8601, instead of `t`.
    #[serde(rename = "timestamp")]
    Timestamp,
    /// `x`: piston position from the A end.
    #[serde(rename = "x")]
    Position,
    /// `v`: piston speed.
    #[serde(rename = "v")]
    Speed,
    /// `pa`: pressure of the piston-side chamber, gauge.
    #[serde(rename = "pa")]
    PressureA,
    /// `pb`: pressure of the rod-side chamber, gauge.
    #[serde(rename = "pb")]
    PressureB,
    /// `qa`: flow into the piston-side chamber.
    #[serde(rename = "qa")]
    FlowA,
    /// `qb`: flow into the rod-side chamber.
    #[serde(rename = "qb")]
    FlowB,
    /// `force`: load force against extension.
    #[serde(rename = "force")]
    Force,
    /// `temp`: oil temperature.
    #[serde(rename = "temp")]
    Temperature,
    /// `spool`: position of the valve's spool, positive: supply to A.
    #[serde(rename = "spool")]
    Spool,
    /// `valve_command`: what the spool is told, where its position is not measured.
    #[serde(rename = "valve_command")]
    Command,
    /// `ps`: supply pressure at the valve, gauge.
    #[serde(rename = "ps")]
    Supply,
    /// `pt`: tank pressure at the valve, gauge.
    #[serde(rename = "pt")]
    Tank,
    /// `shut`: 1 while both ports are shut between valve and cylinder, else 0: no flow, for certain.
    #[serde(rename = "shut")]
    Shut,
    /// `q_int`: reference flow of the internal leak.
    #[serde(rename = "q_int")]
    LeakInternal,
    /// `q_ext_a`: reference flow of the external leak at A.
    #[serde(rename = "q_ext_a")]
    LeakExternalA,
    /// `q_ext_b`: reference flow of the external leak at B.
    #[serde(rename = "q_ext_b")]
    LeakExternalB,
}

impl Signal {
    /// Every signal, in the order of the contract's table.
    pub const ALL: [Self; 18] = [
        Self::Time,
        Self::Timestamp,
        Self::Position,
        Self::Speed,
        Self::PressureA,
        Self::PressureB,
        Self::FlowA,
        Self::FlowB,
        Self::Force,
        Self::Temperature,
        Self::Spool,
        Self::Command,
        Self::Supply,
        Self::Tank,
        Self::Shut,
        Self::LeakInternal,
        Self::LeakExternalA,
        Self::LeakExternalB,
    ];

    /// The name that a column header starts with.
    pub fn name(self) -> &'static str {
        match self {
            Self::Time => "t",
            Self::Timestamp => "timestamp",
            Self::Position => "x",
            Self::Speed => "v",
            Self::PressureA => "pa",
            Self::PressureB => "pb",
            Self::FlowA => "qa",
            Self::FlowB => "qb",
            Self::Force => "force",
            Self::Temperature => "temp",
            Self::Spool => "spool",
            Self::Command => "valve_command",
            Self::Supply => "ps",
            Self::Tank => "pt",
            Self::Shut => "shut",
            Self::LeakInternal => "q_int",
            Self::LeakExternalA => "q_ext_a",
            Self::LeakExternalB => "q_ext_b",
        }
    }

    /// The signal of this name.
    pub fn by_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|signal| signal.name() == name)
    }

    /// What the signal measures; a timestamp has no unit, nor has what is either so or not.
    pub fn dimension(self) -> Option<Dimension> {
        match self {
            Self::Time => Some(Dimension::Time),
            Self::Timestamp | Self::Shut => None,
            Self::Position => Some(Dimension::Length),
            Self::Speed => Some(Dimension::Speed),
            Self::PressureA | Self::PressureB | Self::Supply | Self::Tank => Some(Dimension::Pressure),
            Self::Spool | Self::Command => Some(Dimension::Spool),
            Self::Force => Some(Dimension::Force),
            Self::Temperature => Some(Dimension::Temperature),
            Self::FlowA | Self::FlowB | Self::LeakInternal | Self::LeakExternalA | Self::LeakExternalB => {
                Some(Dimension::Flow)
            }
        }
    }

    /// Whether a sensor of the cylinder reads it, not one of its valve.
    pub fn is_sensor(self) -> bool {
        use Signal::{FlowA, FlowB, Force, Position, PressureA, PressureB};
        matches!(self, Position | PressureA | PressureB | FlowA | FlowB | Force)
    }
}
