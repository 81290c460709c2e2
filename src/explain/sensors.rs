//! Which sensors an explanation is about.

use super::{Column, Entry, Mistake, Of, USUAL_ZERO};
use crate::signal::Signal;

impl Entry {
    /// The sensors that err where it is true; none where the rig does.
    pub(super) fn sensors(&self) -> Vec<Signal> {
        let unusual = self.free.iter().filter(|(.., std)| *std > USUAL_ZERO);
        let columns = unusual.flat_map(|(column, ..)| column.sensors());
        let mistaken = self.mistake.map(Mistake::sensors).unwrap_or_default();
        columns.chain(mistaken).copied().collect()
    }
}

impl Column {
    fn sensors(self) -> &'static [Signal] {
        match self {
            Self::ZeroA | Self::GainA | Self::DirectionA | Self::LagA => Of::FlowA.sensors(),
            Self::ZeroB | Self::GainB | Self::DirectionB | Self::LagB => Of::FlowB.sensors(),
            Self::Gains | Self::Lags => Of::Flows.sensors(),
            Self::PositionGain | Self::PositionZero | Self::Travel => Of::Position.sensors(),
            Self::ThroughSealA | Self::PressureZeroA | Self::PressureGainA => Of::PressureA.sensors(),
            Self::ThroughSealB | Self::PressureZeroB | Self::PressureGainB => Of::PressureB.sensors(),
            Self::Unpressed => Of::Pressures.sensors(),
            Self::LeftSide
            | Self::Compressibility
            | Self::DeadVolumeA
            | Self::DeadVolumeB
            | Self::AreaA
            | Self::AreaB
            | Self::LeakInternal
            | Self::LeakA
            | Self::LeakB
            | Self::CrackingInternal
            | Self::CrackingA
            | Self::CrackingB
            | Self::SteadyInternal
            | Self::SteadyA
            | Self::SteadyB
            | Self::OrificeInternal
            | Self::OrificeA
            | Self::OrificeB => &[],
        }
    }
}

impl Mistake {
    /// Whether the rig file is mistaken, and no reading.
    pub(crate) fn is_of_rig(self) -> bool {
        matches!(self, Self::AreasExchanged | Self::Area(..))
    }

    pub(crate) fn sensors(self) -> &'static [Signal] {
        match self {
            Self::FlowsExchanged | Self::FlowsExchangedAndTurned => Of::Flows.sensors(),
            Self::PressuresExchanged => Of::Pressures.sensors(),
            Self::ChambersExchanged => &[Signal::PressureA, Signal::PressureB, Signal::FlowA, Signal::FlowB],
            Self::Sign(of) | Self::LostSign(of) | Self::Factor(of, _) | Self::Absolute(of) => of.sensors(),
            Self::Clock(_) => &[Signal::Time],
            Self::OtherEnd => Of::Position.sensors(),
            Self::AreasExchanged | Self::Area(..) => &[],
        }
    }
}

impl Of {
    pub(crate) fn sensors(self) -> &'static [Signal] {
        match self {
            Self::FlowA => &[Signal::FlowA],
            Self::FlowB => &[Signal::FlowB],
            Self::Flows => &[Signal::FlowA, Signal::FlowB],
            Self::PressureA => &[Signal::PressureA],
            Self::PressureB => &[Signal::PressureB],
            Self::Pressures => &[Signal::PressureA, Signal::PressureB],
            Self::Position => &[Signal::Position],
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::explain::explanations;
    use crate::signal::Signal;

    /// Whoever reads the words looks at these sensors.
    #[test]
    fn an_explanation_is_about_the_sensors_that_it_names() {
        let words = [
            ("flow meter A", vec![Signal::FlowA]),
            ("flow meter B", vec![Signal::FlowB]),
            ("flow meters lag", vec![Signal::FlowA, Signal::FlowB]),
            ("flow meters' gain", vec![Signal::FlowA, Signal::FlowB]),
            ("zeros are off", vec![Signal::FlowA, Signal::FlowB]),
            ("pressure sensor A", vec![Signal::PressureA]),
            ("pressure sensor B", vec![Signal::PressureB]),
            ("the position sensor", vec![Signal::Position]),
            ("qa and qb are exchanged", vec![Signal::FlowA, Signal::FlowB]),
            ("piston area", vec![]),
        ];
        for (word, sensors) in words {
            let named = || explanations().into_iter().filter(|entry| entry.text.contains(word));
            assert!(named().count() > 0, "{word}");
            for entry in named() {
                let mut about = entry.sensors();
                about.sort_unstable();
                about.dedup();
                assert_eq!(about, sensors, "{}: {}", entry.id, entry.text);
            }
        }
    }
}
