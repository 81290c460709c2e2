//! Which readings a hold test rests on.

use crate::presence::EMPTY_PA;
use crate::rig::Rig;
use crate::trace::Record;
use serde::{Deserialize, Serialize};

/// A piston that moves further isn't held: the load carries it away, m.
const MOST_TRAVEL_M: f64 = 2e-3;
/// Pressure and position are held against these ends as means of so many readings that their noise is this small, …
const PRESSURE_STD_PA: f64 = 0.1e5;
const POSITION_STD_M: f64 = 0.1e-3;
/// … but of no more than these.
const MOST_AVERAGED: usize = 50;
/// A hold is read no further than this: 16 minutes at 100 Hz, 8 MB.
const MOST_READINGS: usize = 100_000;
/// Fewer readings than these tell nothing.
pub(super) const LEAST_READINGS: usize = 8;

/// What ended a hold.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum EndedBy {
    /// The trace, or a pause of it.
    Trace,
    /// A chamber's pressure fell below 5 bar.
    Pressure,
    /// The piston moved by 2 mm.
    Motion,
    /// A port was opened.
    Opened,
    /// There were as many readings as are kept.
    Enough,
}

/// One reading while the ports are shut; SI.
#[derive(Clone, Copy, Debug, PartialEq, Default, Serialize, Deserialize)]
pub(super) struct Reading {
    pub t_s: f64,
    pub x_m: f64,
    pub pa_pa: f64,
    pub pb_pa: f64,
}

/// A hold's usable readings.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Held {
    pub readings: Vec<Reading>,
    pub ended_by: EndedBy,
}

impl Held {
    /// Time that the readings span, s.
    pub fn usable_s(&self) -> f64 {
        match self.readings.as_slice() {
            [first, .., last] => last.t_s - first.t_s,
            _ => 0.0,
        }
    }
}

/// Keeps the readings of a trace's holds.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Recorder {
    averaged: [usize; 2],
    /// Noise of a pressure reading.
    pressure_std_pa: f64,
    now: Option<Held>,
    /// Over: what follows until a port opens is not usable.
    is_over: bool,
    pub(super) done: Vec<Held>,
    was_shut: bool,
}

impl Recorder {
    /// For the sensors of this rig.
    pub fn new(rig: &Rig) -> Self {
        let sensors = rig.sensors();
        let averaged = |noise_std: f64, wanted: f64| {
            ((noise_std / wanted).powi(2).ceil() as usize).clamp(1, MOST_AVERAGED)
        };
        Self {
            pressure_std_pa: sensors.pressure.noise_std,
            averaged: [
                averaged(sensors.pressure.noise_std, PRESSURE_STD_PA),
                averaged(sensors.position.noise_std, POSITION_STD_M),
            ],
            now: None,
            is_over: false,
            done: Vec::new(),
            was_shut: false,
        }
    }

    /// Takes in a record where there may be holds: `recorder` is none up to the first.
    #[inline]
    pub fn record(recorder: &mut Option<Self>, record: &Record, rig: &Rig) {
        if record.shut == Some(true) && recorder.is_none() {
            *recorder = Some(Self::new(rig));
        }
        if let Some(recorder) = recorder {
            recorder.push(record);
        }
    }

    /// Takes in one record. An empty cell of `shut` says that nothing changed.
    pub fn push(&mut self, record: &Record) {
        if !record.has_both_pressures() {
            return;
        }
        let is_shut = record.shut.unwrap_or(self.was_shut);
        self.was_shut |= is_shut;
        if !is_shut {
            self.end(EndedBy::Opened);
            (self.is_over, self.was_shut) = (false, false);
            return;
        }
        if record.after_gap {
            self.end(EndedBy::Trace);
        }
        if self.is_over {
            return;
        }
        let held = self.now.get_or_insert_with(|| Held { readings: Vec::new(), ended_by: EndedBy::Trace });
        let sample = &record.sample;
        held.readings.push(Reading {
            t_s: record.t_s,
            x_m: sample.x_m,
            pa_pa: sample.pa_pa,
            pb_pa: sample.pb_pa,
        });
        if let Some(ended_by) = ending(&held.readings, self.averaged) {
            self.is_over = true;
            if ended_by == EndedBy::Pressure {
                held.readings.truncate(filled(&held.readings, self.pressure_std_pa));
            }
            self.end(ended_by);
        }
    }

    fn end(&mut self, ended_by: EndedBy) {
        self.done.extend(self.now.take().map(|held| Held { ended_by, ..held }));
    }

    /// The holds of the trace; none where no port was shut.
    pub(super) fn holds(mut self) -> Vec<Held> {
        self.end(EndedBy::Trace);
        self.done
    }

    /// Drops all holds that have ended but the last: a stream that nobody asks for them would grow.
    pub fn keep_last(&mut self) {
        let first = self.done.len().saturating_sub(1);
        self.done.drain(..first);
    }
}

/// Whether the last reading ends the hold, and how.
fn ending(readings: &[Reading], [of_pressure, of_position]: [usize; 2]) -> Option<EndedBy> {
    let mean = |part: &[Reading], of: fn(&Reading) -> f64| {
        part.iter().map(of).sum::<f64>() / part.len().max(1) as f64
    };
    let count = readings.len();
    if count >= of_pressure {
        let last = &readings[count - of_pressure..];
        if mean(last, |r| r.pa_pa).min(mean(last, |r| r.pb_pa)) < EMPTY_PA {
            return Some(EndedBy::Pressure);
        }
    }
    if count > of_position {
        let [first, last] = [&readings[..of_position], &readings[count - of_position..]];
        if (mean(last, |r| r.x_m) - mean(first, |r| r.x_m)).abs() > MOST_TRAVEL_M {
            return Some(EndedBy::Motion);
        }
    }
    (count >= MOST_READINGS).then_some(EndedBy::Enough)
}

/// How many readings there are before a chamber may be empty: a mean that is below 5 bar has readings of none in it.
fn filled(readings: &[Reading], std_pa: f64) -> usize {
    let surely_pa = EMPTY_PA + 2.0 * std_pa;
    let low = |reading: &Reading| reading.pa_pa.min(reading.pb_pa) < surely_pa;
    readings.iter().position(low).unwrap_or(readings.len())
}

#[cfg(test)]
mod tests {
    use super::*;
    use pitchleak_core::Sample;

    fn record(t_s: f64, shut: Option<bool>, x_m: f64, pa_pa: f64) -> Record {
        let sample = Sample { x_m, pa_pa, pb_pa: 40e5, ..Sample::default() };
        Record { t_s, shut, sample, ..Record::default() }
    }

    /// A rig whose sensors have hardly any noise, so that one reading is its own mean.
    fn precise() -> Rig {
        let mut rig = Rig::paper();
        rig.instruments = rig.instruments.with_accuracy(1e-6);
        rig
    }

    fn holds(records: impl IntoIterator<Item = Record>) -> Vec<Held> {
        let mut recorder = Recorder::new(&precise());
        records.into_iter().for_each(|record| recorder.push(&record));
        recorder.holds()
    }

    #[test]
    fn a_hold_ends_at_five_bar_at_two_millimetres_when_a_port_opens_or_with_the_trace() {
        let time = |k: i32| f64::from(k) * 0.01;
        let falling = holds((0..100).map(|k| record(time(k), Some(true), 0.1, 50e5 - 1e5 * f64::from(k))));
        assert_eq!(
            (falling.len(), falling[0].ended_by, falling[0].readings.len()),
            (1, EndedBy::Pressure, 45)
        );
        let moving = holds((0..100).map(|k| record(time(k), Some(true), 0.1 - 1e-4 * f64::from(k), 50e5)));
        assert_eq!((moving.len(), moving[0].ended_by), (1, EndedBy::Motion));
        assert!((20..=22).contains(&moving[0].readings.len()), "{}", moving[0].readings.len());
        let twice = holds((0..100).map(|k| record(time(k), Some(k % 50 != 0), 0.1, 50e5)));
        let ends: Vec<_> = twice.iter().map(|held| held.ended_by).collect();
        assert_eq!(ends, [EndedBy::Opened, EndedBy::Trace]);
        assert!((twice[1].usable_s() - 0.48).abs() < 1e-9);
    }

    #[test]
    fn an_empty_cell_changes_nothing_and_an_open_valve_is_no_hold() {
        let held = holds((0..20).map(|k| record(f64::from(k), (k == 5).then_some(true), 0.1, 50e5)));
        assert_eq!((held.len(), held[0].readings.len()), (1, 15));
        assert!(holds((0..20).map(|k| record(f64::from(k), Some(false), 0.1, 50e5))).is_empty());
    }
}
