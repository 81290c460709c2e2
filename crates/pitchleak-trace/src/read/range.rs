//! What readings are possible on a rig.

use super::row::Row;
use crate::rig::Rig;
use crate::signal::Signal;
use crate::units::{Dimension, Unit, readable};

/// A vacuum, Pa gauge.
const VACUUM_PA: f64 = -101_325.0;
/// Noise and offset may carry a sound reading this share of full scale past what is possible.
const SLACK: f64 = 0.05;
/// No sensor reads more than this many times its full scale.
pub const OVERRANGE: f64 = 2.0;

#[derive(Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
struct Range {
    signal: Signal,
    least: f64,
    most: f64,
}

/// Signals that have a range: all but the timestamp.
const RANGES: usize = Signal::ALL.len() - 1;

/// The possible range of every reading that has one.
#[derive(Clone, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(from = "[Range; RANGES]", into = "[Range; RANGES]")]
pub(super) struct Ranges {
    listed: [Range; RANGES],
    /// The same in the order of a row's cells, which are compared with all of them at once.
    bounds: [[f64; Signal::ALL.len()]; 2],
}

impl From<[Range; RANGES]> for Ranges {
    fn from(listed: [Range; RANGES]) -> Self {
        let [mut least, mut most] =
            [f64::NEG_INFINITY, f64::INFINITY].map(|bound| [bound; Signal::ALL.len()]);
        for range in &listed {
            least[range.signal as usize] = range.least;
            most[range.signal as usize] = range.most;
        }
        Self { listed, bounds: [least, most] }
    }
}

impl From<Ranges> for [Range; RANGES] {
    fn from(ranges: Ranges) -> Self {
        ranges.listed
    }
}

impl Ranges {
    pub(super) fn of(rig: &Rig) -> Self {
        let sheets = &rig.instruments;
        let slack_m = SLACK * rig.cylinder.stroke_m.max(sheets.position.full_scale);
        let position =
            Range { signal: Signal::Position, least: -slack_m, most: rig.cylinder.stroke_m + slack_m };
        let pressure = |signal| Range {
            signal,
            least: VACUUM_PA - SLACK * sheets.pressure.full_scale,
            most: OVERRANGE * sheets.pressure.full_scale,
        };
        let both_ways = |signal, full_scale: f64| Range {
            signal,
            least: -OVERRANGE * full_scale,
            most: OVERRANGE * full_scale,
        };
        Self::from([
            position,
            pressure(Signal::PressureA),
            pressure(Signal::PressureB),
            both_ways(Signal::FlowA, sheets.flow_a.full_scale),
            both_ways(Signal::FlowB, sheets.flow_b.full_scale),
            both_ways(Signal::Force, sheets.force.full_scale),
            // Absolute zero, and where oil burns.
            Range { signal: Signal::Temperature, least: 0.0, most: 700.0 },
            both_ways(Signal::Speed, 100.0),
            // Three thousand years either way; where seconds are still told apart to 20 µs.
            Range { signal: Signal::Time, least: -1e11, most: 1e11 },
            // As much as the largest meter that a rig may have.
            both_ways(Signal::LeakInternal, 10.0),
            both_ways(Signal::LeakExternalA, 10.0),
            both_ways(Signal::LeakExternalB, 10.0),
        ])
    }

    /// The first reading that is not possible; a missing one is.
    #[inline]
    pub(super) fn broken_by(&self, row: &Row) -> Option<Signal> {
        let [least, most] = &self.bounds;
        let mut broken = false;
        for ((value, least), most) in row.cells.iter().zip(least).zip(most) {
            // A missing reading, NaN, is neither.
            broken |= (value < least) | (value > most);
        }
        if broken { self.first_broken_by(row) } else { None }
    }

    #[cold]
    fn first_broken_by(&self, row: &Row) -> Option<Signal> {
        let broken = self.listed.iter().find(|range| {
            let value = row.get(range.signal);
            value < range.least || value > range.most
        });
        broken.map(|range| range.signal)
    }

    /// In the unit of the column, which is SI where it is none.
    pub(super) fn describe(&self, signal: Signal, value: f64, unit: Option<Unit>) -> String {
        let range = self.listed.iter().find(|range| range.signal == signal);
        let (least, most) = range.map_or((f64::NAN, f64::NAN), |range| (range.least, range.most));
        let source = match signal {
            Signal::Position => "the stroke",
            Signal::Temperature
            | Signal::Speed
            | Signal::Time
            | Signal::LeakInternal
            | Signal::LeakExternalA
            | Signal::LeakExternalB => "what is possible",
            _ => "the range of the sensor in the rig file",
        };
        let text = |value: f64| readable(unit.map_or(value, |unit| unit.from_si(value)), 6);
        let name = unit.map_or_else(|| signal.dimension().map_or("", Dimension::si), |unit| unit.text);
        format!("{} {name} is outside {source} ({} to {} {name})", text(value), text(least), text(most))
    }
}
