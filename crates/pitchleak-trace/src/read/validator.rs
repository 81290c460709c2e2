//! From rows to records: what readings are possible on a rig, what time it is, and what was noticed so far.

use super::clock::{Clock, Step};
use super::columns::Layout;
use super::error::{BadReason, BadRow, Counted, TraceFault, TraceQuality};
use super::row::{BadRows, Record, Row, ValveReading};
use crate::rig::Rig;
use crate::signal::Signal;
use crate::units::{Dimension, Unit, readable};
use pitchleak_core::{PerLeak, Sample};

/// From rows to records: what is possible, what time it is, and what was noticed so far. It does not
/// know where the rows come from, so that a trace may come in parts.
#[derive(Clone, serde::Serialize, serde::Deserialize)]
pub struct RowValidator {
    ranges: Ranges,
    clock: Clock,
    bad_rows: BadRows,
    quality: TraceQuality,
    /// The chamber pressure that is not measured.
    #[serde(default)]
    unread: Option<Signal>,
    /// Where the rig file says at which positions of the spool the ports are shut.
    #[serde(default)]
    shut: Option<ShutBySpool>,
    /// The last row, if it was refused as out of range.
    #[serde(skip)]
    refused: Option<Record>,
}

impl RowValidator {
    pub(super) fn new(rig: &Rig, layout: &Layout) -> Self {
        let quality = TraceQuality {
            ignored_columns: layout.ignored(),
            absent_columns: layout.absent.clone(),
            reading: layout.reading.clone(),
            ..TraceQuality::default()
        };
        Self {
            ranges: Ranges::of(rig),
            clock: Clock::default(),
            bad_rows: BadRows::Skip,
            quality,
            unread: layout.unread(),
            shut: ShutBySpool::of(rig),
            refused: None,
        }
    }

    /// Whether it holds rows against what `rig` may read.
    pub fn is_for(&self, rig: &Rig) -> bool {
        let below = |shut: Option<&ShutBySpool>| shut.map(|shut| shut.below);
        self.ranges == Ranges::of(rig) && below(self.shut.as_ref()) == below(ShutBySpool::of(rig).as_ref())
    }

    pub(super) fn unread(&self) -> Option<Signal> {
        self.unread
    }

    /// What was noticed so far.
    pub fn quality(&self) -> &TraceQuality {
        &self.quality
    }

    /// The last row as it was read, where a sensor's reading in it was out of range; once.
    #[cold]
    pub(super) fn take_refused(&mut self) -> Option<Record> {
        self.refused.take()
    }

    /// Time of the last good row, s.
    pub fn time_s(&self) -> Option<f64> {
        self.clock.last_s()
    }

    pub(super) fn set_bad_rows(&mut self, bad_rows: BadRows) {
        self.bad_rows = bad_rows;
    }

    /// Rows taken or skipped.
    pub(super) fn rows_seen(&self) -> u64 {
        self.quality.rows + self.quality.skipped
    }

    /// Whether `row` is good; then it is in `record`.
    #[inline]
    pub(super) fn take(
        &mut self,
        row: &Row,
        layout: &Layout,
        record: &mut Record,
    ) -> Result<bool, TraceFault> {
        match self.check(row, layout, record) {
            None => Ok(true),
            Some(bad) => self.skip(bad).map(|()| false),
        }
    }

    /// As [`take`](Self::take); a bad row is told, and neither counted nor skipped yet.
    #[inline]
    pub(super) fn check(&mut self, row: &Row, layout: &Layout, record: &mut Record) -> Option<BadRow> {
        if let Some(signal) = self.ranges.broken_by(row) {
            self.refused = signal.is_sensor().then(|| self.readings(row));
            let detail = match row.get(signal) {
                value if value.is_finite() => self.ranges.describe(signal, value, layout.unit_of(signal)),
                _ => BadReason::OutOfRange.text().to_owned(),
            };
            return Some(bad_cell(row, layout, signal, BadReason::OutOfRange, detail));
        }
        let t_s = row.get(Signal::Time);
        let (dt_s, after_gap) = match self.clock.step(t_s) {
            Step::First => {
                self.quality.count_from(t_s);
                (0.0, false)
            }
            Step::Next { dt_s, regular, gap } => {
                self.quality.count_step(dt_s, regular, gap);
                (dt_s, gap)
            }
            Step::Restart { usual_s } => {
                self.quality.clock_restarts += 1;
                self.quality.count_from(t_s);
                (usual_s, true)
            }
            Step::Back { last_s } => {
                let detail = format!("{} s is not after {} s", readable(t_s, 12), readable(last_s, 12));
                return Some(bad_cell(row, layout, Signal::Time, BadReason::TimeBack, detail));
            }
        };
        *record = Record { dt_s, after_gap, ..self.readings(row) };
        if let Some(shut) = &mut self.shut {
            shut.tell(record);
        }
        self.quality.count_row(record);
        None
    }

    #[inline]
    fn readings(&self, row: &Row) -> Record {
        let mut record = readings(row);
        match self.unread {
            Some(Signal::PressureA) => record.sample.pa_pa = f64::NAN,
            Some(Signal::PressureB) => record.sample.pb_pa = f64::NAN,
            _ => {}
        }
        record
    }

    #[cold]
    pub(super) fn skip(&mut self, bad: BadRow) -> Result<(), TraceFault> {
        if self.bad_rows == BadRows::Fatal {
            return Err(TraceFault::BadRow(bad));
        }
        self.quality.count_bad(bad);
        Ok(())
    }

    #[cold]
    pub(super) fn cut_off(&mut self, why: String) -> Result<(), TraceFault> {
        if self.bad_rows == BadRows::Fatal {
            return Err(TraceFault::CutOff(why));
        }
        self.quality.cut_off = Some(why);
        Ok(())
    }

    /// The end of a trace, which must have had a good row.
    pub(super) fn end(&self) -> Result<(), TraceFault> {
        if self.quality.rows > 0 {
            return Ok(());
        }
        if let Some(why) = self.quality.cut_off.as_ref().filter(|_| self.quality.skipped == 0) {
            return Err(TraceFault::CutOff(why.clone()));
        }
        let first = self.quality.first_bad.first().cloned();
        Err(TraceFault::NoRows { skipped: self.quality.skipped, first, mistake: None })
    }
}

/// So long the spool has to rest before its ports count as shut, s. Chosen: one that only passes its middle is no hold, and what moved
/// the cylinder has died down.
const RESTS_S: f64 = 1.0;

/// Ports that are shut by the valve's own spool at rest, `[valve] shut`.
#[derive(Clone, serde::Serialize, serde::Deserialize)]
struct ShutBySpool {
    /// Distance from the middle, a share of the stroke.
    below: f64,
    /// The first of the readings so far that are all below it, s.
    since_s: Option<f64>,
}

impl ShutBySpool {
    fn of(rig: &Rig) -> Option<Self> {
        let below = rig.valve.as_ref()?.shut_below?;
        Some(Self { below, since_s: None })
    }

    /// Says of a record that does not say so itself whether its ports are shut. Where there are meters, they go on.
    fn tell(&mut self, record: &mut Record) {
        let Some(valve) = record.valve.as_ref().filter(|_| !record.has_flow()) else { return };
        if valve.spool.abs() >= self.below {
            self.since_s = None;
        } else if record.after_gap || self.since_s.is_none() {
            self.since_s = Some(record.t_s);
        }
        let rests = self.since_s.is_some_and(|since_s| record.t_s - since_s >= RESTS_S);
        record.shut = record.shut.or(Some(rests));
    }
}

#[inline]
fn readings(row: &Row) -> Record {
    let reading = |signal| Some(row.get(signal)).filter(|value| !value.is_nan());
    Record {
        line: row.line,
        t_s: row.get(Signal::Time),
        sample: Sample {
            x_m: row.get(Signal::Position),
            pa_pa: row.get(Signal::PressureA),
            pb_pa: row.get(Signal::PressureB),
            qa_m3s: reading(Signal::FlowA),
            qb_m3s: reading(Signal::FlowB),
            force_n: reading(Signal::Force),
        },
        speed_mps: reading(Signal::Speed),
        temperature_k: reading(Signal::Temperature),
        valve: reading(Signal::Spool).or_else(|| reading(Signal::Command)).map(|spool| ValveReading {
            spool,
            supply_pa: reading(Signal::Supply),
            tank_pa: reading(Signal::Tank),
        }),
        shut: reading(Signal::Shut).map(|shut| shut > 0.5),
        leak_m3s: PerLeak {
            internal: reading(Signal::LeakInternal),
            external_a: reading(Signal::LeakExternalA),
            external_b: reading(Signal::LeakExternalB),
        },
        ..Record::default()
    }
}

#[cold]
fn bad_cell(row: &Row, layout: &Layout, signal: Signal, reason: BadReason, detail: String) -> BadRow {
    let column = layout.column_of(signal).or_else(|| layout.column_of(Signal::Timestamp));
    layout.bad_row(row.line, column, reason, detail)
}

/// A row without a reading that it must have.
#[cold]
pub(super) fn missing(row: &Row, layout: &Layout, signal: Signal) -> BadRow {
    let detail = match layout.counted {
        Counted::Lines => "empty",
        Counted::Rows => "missing",
    };
    bad_cell(row, layout, signal, BadReason::Missing, detail.to_owned())
}

/// A vacuum, Pa gauge.
const VACUUM_PA: f64 = -101_325.0;
/// Three thousand years either way; where seconds are still told apart to 20 µs.
pub(crate) const MOST_TIME_S: f64 = 1e11;
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
    /// The bounds in the order of a row's cells, which are compared with all of them together.
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
        let range = |signal, least, most| Range { signal, least, most };
        let both_ways = |signal, most: f64| range(signal, -OVERRANGE * most, OVERRANGE * most);
        let stroke_m = rig.cylinder.stroke_m;
        let slack_m = SLACK * stroke_m.max(sheets.position.full_scale);
        let pressure_pa = sheets.pressure.full_scale;
        let pressure = |signal| range(signal, VACUUM_PA - SLACK * pressure_pa, OVERRANGE * pressure_pa);
        // No data sheet need be declared of these: as much as any sensor that a rig may have.
        let valve_pressure = |signal| range(signal, 2.0 * VACUUM_PA, 1e9);
        Self::from([
            range(Signal::Position, -slack_m, stroke_m + slack_m),
            pressure(Signal::PressureA),
            pressure(Signal::PressureB),
            both_ways(Signal::FlowA, sheets.flow_a.full_scale),
            both_ways(Signal::FlowB, sheets.flow_b.full_scale),
            both_ways(Signal::Force, sheets.force.full_scale),
            // Absolute zero, and where oil burns.
            range(Signal::Temperature, 0.0, 700.0),
            both_ways(Signal::Speed, 100.0),
            range(Signal::Time, -MOST_TIME_S, MOST_TIME_S),
            // A share of the stroke, with what a sensor may read beyond its ends.
            both_ways(Signal::Spool, 1.0),
            both_ways(Signal::Command, 1.0),
            valve_pressure(Signal::Supply),
            valve_pressure(Signal::Tank),
            range(Signal::Shut, 0.0, 1.0),
            // As much as the largest meter that a rig may have.
            both_ways(Signal::LeakInternal, 10.0),
            both_ways(Signal::LeakExternalA, 10.0),
            both_ways(Signal::LeakExternalB, 10.0),
        ])
    }

    /// The first reading that is not possible; a missing one is.
    #[inline]
    pub(super) fn broken_by(&self, row: &Row) -> Option<Signal> {
        let ([least, most], cells) = (&self.bounds, &row.cells);
        // A missing reading, NaN, is neither. By place: zipped iterators are made by calls here, for every row.
        let is_broken = |place: usize| (cells[place] < least[place]) | (cells[place] > most[place]);
        let broken = (0..cells.len()).fold(false, |broken, place| broken | is_broken(place));
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

    /// In the unit of the column, else in SI.
    pub(super) fn describe(&self, signal: Signal, value: f64, unit: Option<Unit>) -> String {
        let range = self.listed.iter().find(|range| range.signal == signal);
        let (least, most) = range.map_or((f64::NAN, f64::NAN), |range| (range.least, range.most));
        let source = match signal {
            Signal::Position => "the stroke",
            signal if signal.is_sensor() => "the range of the sensor in the rig file",
            _ => "what is possible",
        };
        let text = |value: f64| readable(unit.map_or(value, |unit| unit.from_si(value)), 6);
        let name = unit.map_or_else(|| signal.dimension().map_or("", Dimension::si), |unit| unit.text);
        let name = if name.is_empty() { String::new() } else { format!(" {name}") };
        format!("{}{name} is outside {source} ({} to {}{name})", text(value), text(least), text(most))
    }
}
