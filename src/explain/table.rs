//! The table of explanations: what may be the matter with leaks, sensors, rig and wiring, one entry each.
//!
//! An explanation is a choice from each kind: ln prior odds add. Shares are guesses until fleets teach them, in four
//! classes; sizes (1 σ of what is set free) are a data sheet's or guesses. What a choice between guesses changes is small
//! (docs/explanations.md): a factor of five in the shares moves one or two verdicts in a hundred.

use super::columns::{Column, Course};
use super::mistakes::mistakes;
use super::odds::Prior;
use super::readings::Mistake;
use pitchleak_core::Leak;

/// Shares of explanations, by how often an engineer meets them. Guesses.
mod share {
    /// Clocks of different devices are seldom aligned; zeros drift a little beyond the sheet.
    pub const COMMON: f64 = 0.06;
    pub const UNCOMMON: f64 = 0.02;
    pub const RARE: f64 = 0.01;
    /// Two at once.
    pub const VERY_RARE: f64 = 0.002;
    /// What a leak that opens at once is always taken for, unless the pressures tell it from one.
    pub const FREAK: f64 = 3e-6;
}

/// Prior probability of each leak. A guess.
pub(crate) const LEAK_SHARE: f64 = 0.03;
/// Size of a leak, share of the flow meters' full scale, half normal. A guess.
pub(super) const LEAK_SIZE: f64 = 0.05;
/// How far a leak that wanders steps at a segment's border, 1 σ in shares of full scale. A guess.
pub(super) const LEAK_STEP: f64 = 0.02;
/// The same of a leak that changes little by little. A guess.
pub(super) const LEAK_CREEP: f64 = 0.005;
/// What seeps where nothing leaks, half normal, share of what is a fault: no seal is tight, and few fittings are. A guess.
pub(super) const USUAL_SEEPAGE: f64 = 0.3;
/// Zero of a meter that declares none: a tenth of the usual accuracy of 1 % of full scale. A guess.
pub(crate) const USUAL_ZERO: f64 = 0.001;
/// Drift of that zero along a trace. A guess.
pub(crate) const USUAL_DRIFT: f64 = 0.0005;
/// Gain of a meter that declares none. A guess.
pub(crate) const USUAL_GAIN: f64 = 0.005;
/// Lag of a meter, s: one or two periods of its own averaging. A guess.
const USUAL_LAG_S: f64 = 0.010;
/// Hose and port, share of the swept volume: 20 cm³ of the paper's 250 cm³. A guess.
pub(super) const USUAL_DEAD_VOLUME: f64 = 0.08;
/// Zero of a pressure sensor that declares none, share of full scale: of the usual class 0.5. A guess.
pub(super) const USUAL_PRESSURE: f64 = 0.005;

/// Which choice an entry belongs to.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Kind {
    /// How a leak goes on.
    Course,
    /// Zeros of the flow meters.
    Zeros,
    /// One thing of sensors or rig that is not as declared.
    Departure,
    /// Zeros that wander.
    Wander,
    /// Mistakes of wiring, sign, unit or geometry.
    Wiring,
}

/// An explanation.
#[derive(Clone, Debug, PartialEq)]
pub struct Entry {
    /// Its name, stable.
    pub id: &'static str,
    /// Which choice it is one of.
    pub kind: Kind,
    /// Its prior probability within its kind.
    pub share: f64,
    /// Columns set free, with the standard deviation of each in its own unit.
    pub free: Vec<(Column, Course, f64)>,
    /// What the readings are instead.
    pub mistake: Option<Mistake>,
    /// In words.
    pub text: &'static str,
    /// What to do.
    pub remedy: &'static str,
    /// Lines of the rig file that mend it; `{}` is the value found.
    pub mends: Option<&'static str>,
    /// Entries that no trace of these readings tells it from.
    pub alike: &'static [&'static str],
}

impl Kind {
    /// As in the list of explanations.
    pub fn name(self) -> &'static str {
        match self {
            Self::Course => "course",
            Self::Zeros => "zeros",
            Self::Departure => "departure",
            Self::Wander => "wander",
            Self::Wiring => "wiring",
        }
    }
}

/// What to do about an area that is not as declared.
pub(super) const AREA: &str = "Measure piston and rod, or compare the data sheet.";

impl Entry {
    pub(super) fn new(id: &'static str, kind: Kind, share: f64, text: &'static str) -> Self {
        Self { id, kind, share, free: Vec::new(), mistake: None, text, remedy: "", mends: None, alike: &[] }
    }

    fn free(mut self, column: Column, std: f64) -> Self {
        self.free.push((column, Course::Constant, std));
        self
    }

    /// Whether it acts through the leak past the piston alone.
    pub(super) fn is_through_seal(&self) -> bool {
        self.free.iter().any(|free| matches!(free.0, Column::ThroughSealA | Column::ThroughSealB))
    }

    /// Whether it acts through a leak as a first pass found that.
    pub(super) fn is_through_found(&self, leak: Leak) -> bool {
        use Column as C;
        self.free.iter().any(|free| match free.0 {
            C::PressureZeroA | C::PressureGainA => leak != Leak::ExternalB,
            C::PressureZeroB | C::PressureGainB => leak != Leak::ExternalA,
            _ => false,
        })
    }

    /// From a moment on, which is found.
    fn jumping(mut self, column: Column, std: f64) -> Self {
        self.free.push((column, Course::Since(0), std));
        self
    }

    /// Whether it begins at a moment.
    pub(super) fn jumps(&self) -> bool {
        self.free.iter().any(|free| matches!(free.1, Course::Since(_)))
    }

    fn drifting(mut self, column: Column, std: f64) -> Self {
        self.free.push((column, Course::Drift, std));
        self
    }

    pub(super) fn remedy(mut self, remedy: &'static str, mends: Option<&'static str>) -> Self {
        (self.remedy, self.mends) = (remedy, mends);
        self
    }

    pub(super) fn alike(mut self, alike: &'static [&'static str]) -> Self {
        self.alike = alike;
        self
    }
}

/// What is free in every explanation: what no data sheet declares to the last digit.
pub(super) const USUAL: [(Column, Course, f64); 11] = [
    (Column::Compressibility, Course::Constant, 0.25),
    (Column::ZeroA, Course::Constant, USUAL_ZERO),
    (Column::ZeroB, Course::Constant, USUAL_ZERO),
    (Column::ZeroA, Course::Drift, USUAL_DRIFT),
    (Column::ZeroB, Course::Drift, USUAL_DRIFT),
    (Column::GainA, Course::Constant, USUAL_GAIN),
    (Column::GainB, Course::Constant, USUAL_GAIN),
    (Column::LagA, Course::Constant, USUAL_LAG_S),
    (Column::LagB, Course::Constant, USUAL_LAG_S),
    (Column::DeadVolumeA, Course::Constant, USUAL_DEAD_VOLUME),
    (Column::DeadVolumeB, Course::Constant, USUAL_DEAD_VOLUME),
];

/// All that is weighed: a line for each choice of each kind, with its share of the kind.
pub fn explanations() -> Vec<Entry> {
    let of_leaks = pressures();
    let known = |entry: &Entry| of_leaks.iter().any(|other| other.id == entry.id);
    let departures = departures().into_iter().filter(|entry| !known(entry));
    let wander = WANDERS.iter().map(|(_, share)| share).sum();
    let wander = Entry::new("wandering_zeros", Kind::Wander, wander, "the flow meters' zeros wander");
    let mut all: Vec<Entry> =
        courses().into_iter().chain(zeros()).chain(departures).chain(pressures()).chain([wander]).collect();
    for mistake in mistakes() {
        match all.iter_mut().find(|entry| entry.id == mistake.id) {
            Some(entry) => entry.share += mistake.share,
            None => all.push(mistake),
        }
    }
    let of_kinds = all.clone();
    for entry in all.iter_mut().filter(|entry| !matches!(entry.kind, Kind::Wander | Kind::Wiring)) {
        let others = of_kinds.iter().filter(|other| other.kind == entry.kind);
        entry.share /= others.map(|other| other.share).sum::<f64>();
    }
    all
}

/// Zeros of the flow meters, as shares of full scale.
pub(super) fn zeros() -> Vec<Entry> {
    const REZERO: &str = "Shut both ports and read the meters: what they show is their zero.";
    let (slight, gross) = (0.004, 0.02);
    let entry = |id, share, text, a, b| {
        Entry::new(id, Kind::Zeros, share, text)
            .free(Column::ZeroA, a)
            .free(Column::ZeroB, b)
            .remedy(REZERO, Some("qa = { name = \"qa\", offset = \"{} L/min\" }"))
    };
    let jump = |id, text, column| {
        Entry::new(id, Kind::Zeros, share::FREAK, text)
            .jumping(column, gross)
            .remedy("Look for what befell the meter at that time: a restart, air in it, a lost range.", None)
    };
    vec![
        entry("zeros_usual", 0.75, "both flow meters' zeros are as usual", USUAL_ZERO, USUAL_ZERO),
        entry("flow_zeros", 0.20, "the flow meters' zeros are slightly off", slight, slight),
        entry("flow_zero_a", share::UNCOMMON, "flow meter A's zero is off", gross, USUAL_ZERO),
        entry("flow_zero_b", share::UNCOMMON, "flow meter B's zero is off", USUAL_ZERO, gross),
        entry("flow_zeros_gross", share::RARE, "both flow meters' zeros are off", gross, gross),
        jump("flow_zero_jump_a", "flow meter A's zero jumped", Column::ZeroA),
        jump("flow_zero_jump_b", "flow meter B's zero jumped", Column::ZeroB),
    ]
}

/// How a leak goes along the trace, beside being constant.
pub(super) fn courses() -> Vec<Entry> {
    vec![
        Entry::new("constant", Kind::Course, 0.68, "is steady"),
        Entry::new("cracking", Kind::Course, share::UNCOMMON, "opens at a pressure"),
        Entry::new(
            "unfollowed",
            Kind::Course,
            share::UNCOMMON,
            "flows steadily while the pressures change: their sensors hang or lag",
        ),
        Entry::new("orifice", Kind::Course, 0.07, "goes through an orifice, with the root of the pressure"),
        Entry::new("growing", Kind::Course, 0.04, "grows or shrinks steadily"),
        Entry::new("accelerating", Kind::Course, share::UNCOMMON, "grows faster and faster"),
        Entry::new("opening", Kind::Course, 0.04, "opened at once, where there was none"),
        Entry::new("sudden", Kind::Course, 0.05, "changed at once"),
        Entry::new("wandering", Kind::Course, 0.03, "comes and goes"),
        Entry::new("creeping", Kind::Course, 0.03, "changes little by little"),
    ]
}

/// Zeros that wander from segment to segment, share of full scale, and their prior shares. Guesses.
const WANDERS: [(f64, f64); 3] = [(0.003, 0.03), (0.01, 0.02), (0.03, 0.01)];

/// Zeros that wander or, first, do not.
pub(super) fn wanders(prior: &Prior<'_>) -> Vec<(f64, f64)> {
    let factor = prior.factor(Kind::Wander, "wandering_zeros");
    let wandering = WANDERS.map(|(size, share)| (size, factor * share));
    let steady = 1.0 - wandering.iter().map(|(_, share)| share).sum::<f64>();
    std::iter::once((0.0, steady)).chain(wandering).collect()
}

/// What tells the gain of a pressure sensor.
const GAUGE: &str = "Compare both pressure sensors with a gauge.";

/// One thing of sensors or rig that is not as declared.
pub(super) fn departures() -> Vec<Entry> {
    use Column as C;
    use share::{COMMON, RARE, UNCOMMON, VERY_RARE};
    const METER: &str = "Compare the meter with the piston's travel over a long stroke.";
    const BOTH_WAYS: &str = "Compare the meter with the piston's travel over a long stroke, out and in.";
    const CLOCK: &str = "Compare the clocks and filters of flow meters, position and pressures.";
    // Meters come with a certificate; an area is a rod of another size, or a slip.
    let (late_s, very_late_s, meter_gain, one_way, gain, gross) = (0.1, 1.0, 0.02, 0.01, 0.05, 0.01);
    let entry = |id, share, text| Entry::new(id, Kind::Departure, share, text);
    let as_declared = entry("as_declared", 0.80, "sensors and rig are as declared");
    let mut all = vec![
        as_declared,
        entry("flow_lag", COMMON, "both flow meters lag, or the position leads")
            .free(C::Lags, late_s)
            .remedy(CLOCK, None)
            .alike(&["position_lag"]),
        entry("flow_lag_a", UNCOMMON, "flow meter A lags").free(C::LagA, late_s).remedy(CLOCK, None),
        entry("flow_lag_b", UNCOMMON, "flow meter B lags").free(C::LagB, late_s).remedy(CLOCK, None),
        entry("flow_lag_gross", 0.5 * RARE, "both flow meters lag far behind")
            .free(C::Lags, very_late_s)
            .remedy(CLOCK, None),
        entry("flow_gain_a", UNCOMMON, "flow meter A's gain is off")
            .free(C::GainA, meter_gain)
            .remedy(METER, None)
            .alike(&["area_a"]),
        entry("flow_gain_b", UNCOMMON, "flow meter B's gain is off")
            .free(C::GainB, meter_gain)
            .remedy(METER, None)
            .alike(&["area_b"]),
        entry("flow_gain", UNCOMMON, "both flow meters' gain, or the position's, is off")
            .free(C::Gains, gain)
            .remedy(METER, None)
            .alike(&["position_gain", "areas"]),
        entry("flow_direction_a", RARE, "flow meter A reads more one way than the other")
            .free(C::DirectionA, one_way)
            .remedy(BOTH_WAYS, None),
        entry("flow_direction_b", RARE, "flow meter B reads more one way than the other")
            .free(C::DirectionB, one_way)
            .remedy(BOTH_WAYS, None),
        entry("flow_drift_a", RARE, "flow meter A's zero drifts").drifting(C::ZeroA, gross),
        entry("flow_drift_b", RARE, "flow meter B's zero drifts").drifting(C::ZeroB, gross),
        entry("area_a", RARE, "piston area A is not as declared")
            .free(C::AreaA, gain)
            .remedy(AREA, Some("area_a = \"{} cm^2\""))
            .alike(&["flow_gain_a"]),
        entry("area_b", RARE, "piston area B is not as declared")
            .free(C::AreaB, gain)
            .remedy(AREA, Some("area_b = \"{} cm^2\""))
            .alike(&["flow_gain_b"]),
        entry("position_gain", RARE, "the position sensor's gain is off")
            .free(C::PositionGain, gain)
            .remedy("Compare the position with the stroke's both ends.", None)
            .alike(&["flow_gain", "areas"]),
        entry("position_zero", RARE, "the position sensor's zero is off")
            .free(C::PositionZero, 0.1)
            .remedy("Compare the position with the stroke's both ends.", None)
            .alike(&["dead_volume_a", "dead_volume_b"]),
        entry("dead_volume_a", RARE, "the dead volume of chamber A is not as declared")
            .free(C::DeadVolumeA, 0.5)
            .remedy("Declare hoses and ports.", Some("dead_volume_a = \"{} cm^3\"")),
        entry("dead_volume_b", RARE, "the dead volume of chamber B, or the stroke, is not as declared")
            .free(C::DeadVolumeB, 0.5)
            .remedy("Declare hoses and ports, and the stroke.", Some("dead_volume_b = \"{} cm^3\""))
            .alike(&["stroke"]),
        entry("bulk_modulus", RARE, "the oil is softer or stiffer than declared")
            .free(C::Compressibility, 1.0)
            .remedy("Declare the bulk modulus found, or look for air.", Some("bulk_modulus = \"{} GPa\"")),
        entry("pressure_noise", UNCOMMON, "both pressures are noisier than declared, or hum")
            .free(C::Unpressed, 1.0)
            .remedy("Look at the pressures at rest: earth, shield and amplifier.", None),
        entry("flow_lag_and_gains", VERY_RARE, "the flow meters lag and their gains are off")
            .free(C::Lags, late_s)
            .free(C::GainA, gain)
            .free(C::GainB, gain),
    ];
    all.extend([
        entry("pressure_gain_a", RARE, "the gain of pressure sensor A is off")
            .free(C::ThroughSealA, 0.1 * gain)
            .remedy(GAUGE, None),
        entry("pressure_gain_b", RARE, "the gain of pressure sensor B is off")
            .free(C::ThroughSealB, 0.1 * gain)
            .remedy(GAUGE, None),
    ]);
    all
}

/// Pressure sensors seen through the leaks that a first pass found.
pub(super) fn pressures() -> Vec<Entry> {
    use Column as C;
    const OPEN_TO_AIR: &str = "Open the sensor to air: what it shows is its zero.";
    let entry = |id, text| Entry::new(id, Kind::Departure, share::RARE, text).remedy(OPEN_TO_AIR, None);
    let gross = 0.05;
    vec![
        entry("pressure_zero_gross_a", "the zero of pressure sensor A is far off")
            .free(C::PressureZeroA, gross),
        entry("pressure_zero_gross_b", "the zero of pressure sensor B is far off")
            .free(C::PressureZeroB, gross),
        entry("pressure_zero_a", "the zero of pressure sensor A is off").free(C::PressureZeroA, 0.01),
        entry("pressure_zero_b", "the zero of pressure sensor B is off").free(C::PressureZeroB, 0.01),
        entry("pressure_gain_a", "the gain of pressure sensor A is off")
            .free(C::PressureGainA, 0.05)
            .remedy(GAUGE, None),
        entry("pressure_gain_b", "the gain of pressure sensor B is off")
            .free(C::PressureGainB, 0.05)
            .remedy(GAUGE, None),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_sensor_shows_in_air_is_a_remedy_of_zeros_and_a_gauge_one_of_gains() {
        for entry in departures().into_iter().chain(pressures()) {
            assert!(!entry.remedy.contains("its zero") || entry.id.contains("zero"), "{}", entry.id);
            assert_eq!(entry.remedy == GAUGE, entry.id.starts_with("pressure_gain"), "{}", entry.id);
        }
    }
}
