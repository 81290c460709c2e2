//! The signals that a trace may hold, and what each measures.

use crate::units::{Dimension, Unit};

/// The table of the signals: what each is, its name in a column header, and what it measures.
macro_rules! signals {
    ($($(#[doc = $what:literal])+ $signal:ident, $name:literal, $measures:expr;)+) => {
        /// One signal of a trace; the names are those of the column headers.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, serde::Serialize, serde::Deserialize)]
        pub enum Signal {
            $(#[doc = concat!("`", $name, "`:")] $(#[doc = $what])+ #[serde(rename = $name)] $signal,)+
        }

        impl Signal {
            /// Every signal, in the order of the contract's table.
            pub const ALL: [Self; 18] = [$(Self::$signal),+];

            /// The name that a column header starts with.
            pub fn name(self) -> &'static str {
                match self {
                    $(Self::$signal => $name,)+
                }
            }

            /// What the signal measures; a timestamp has no unit, nor has what is either so or not.
            pub fn dimension(self) -> Option<Dimension> {
                match self {
                    $(Self::$signal => $measures,)+
                }
            }
        }
    };
}

signals! {
    /// time.
    Time, "t", Some(Dimension::Time);
    /// time in ISO 8601, instead of `t`.
    Timestamp, "timestamp", None;
    /// piston position from the A end.
    Position, "x", Some(Dimension::Length);
    /// piston speed.
    Speed, "v", Some(Dimension::Speed);
    /// pressure of the piston-side chamber, gauge.
    PressureA, "pa", Some(Dimension::Pressure);
    /// pressure of the rod-side chamber, gauge.
    PressureB, "pb", Some(Dimension::Pressure);
    /// flow into the piston-side chamber.
    FlowA, "qa", Some(Dimension::Flow);
    /// flow into the rod-side chamber.
    FlowB, "qb", Some(Dimension::Flow);
    /// load force against extension.
    Force, "force", Some(Dimension::Force);
    /// oil temperature.
    Temperature, "temp", Some(Dimension::Temperature);
    /// position of the valve's spool, positive: supply to A.
    Spool, "spool", Some(Dimension::Spool);
    /// what the spool is told, where its position is not measured.
    Command, "valve_command", Some(Dimension::Spool);
    /// supply pressure at the valve, gauge.
    Supply, "ps", Some(Dimension::Pressure);
    /// tank pressure at the valve, gauge.
    Tank, "pt", Some(Dimension::Pressure);
    /// 1 while both ports are shut between valve and cylinder, else 0: no flow, for certain.
    Shut, "shut", None;
    /// reference flow of the internal leak.
    LeakInternal, "q_int", Some(Dimension::Flow);
    /// reference flow of the external leak at A.
    LeakExternalA, "q_ext_a", Some(Dimension::Flow);
    /// reference flow of the external leak at B.
    LeakExternalB, "q_ext_b", Some(Dimension::Flow);
}

impl Signal {
    /// The signal of this name.
    pub fn by_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|signal| signal.name() == name)
    }

    /// Its SI unit.
    pub(crate) fn si(self) -> Option<Unit> {
        self.dimension()?.units().first().copied()
    }

    /// Whether it is the time: a timestamp is as good as a number.
    pub fn is_time(self) -> bool {
        matches!(self, Self::Time | Self::Timestamp)
    }

    /// Whether a sensor of the cylinder reads it, not one of its valve.
    pub fn is_sensor(self) -> bool {
        use Signal::{FlowA, FlowB, Force, Position, PressureA, PressureB};
        matches!(self, Position | PressureA | PressureB | FlowA | FlowB | Force)
    }
}
