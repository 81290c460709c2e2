//! A calibrated valve in a stream: judged at the end of each window of ten seconds, in bounded memory.

use super::calibration::CalibrationError;
use super::meter::ValveMeter;
use super::outcome::ValveTest;
use crate::report::Alarm;
use crate::rig::Rig;
use crate::trace::Record;
use pitchleak_core::LeakDetector;
use serde::{Deserialize, Serialize};

/// Chosen: short, as all readings of a window are kept and saved; a calibrated valve is known, so windows need not be long.
const WINDOW_S: f64 = 10.0;

/// The flows of a calibrated valve as a stream's meter for leaks, with alarms.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct ValveStream {
    meter: ValveMeter,
    detector: LeakDetector<f64>,
    /// Of the last window's end, s.
    judged_s: Option<f64>,
}

impl ValveStream {
    /// For a rig whose `[valve]` is calibrated; none for another: windows are too short to learn a valve from.
    ///
    /// # Errors
    /// Where the calibration cannot be read, or is of another rig.
    pub fn of(rig: &Rig) -> Result<Option<Self>, CalibrationError> {
        let meter = ValveMeter::of(rig)?.filter(|meter| meter.since.is_some());
        Ok(meter.map(|mut meter| {
            meter.window_s = WINDOW_S;
            Self { meter, detector: LeakDetector::new(rig.alarms), judged_s: None }
        }))
    }

    /// Takes in a record of a rig that may have a valve; with the first flow of a meter it has no say any more. Says whether a window
    /// has ended, and adds the alarms that changed with it.
    pub fn record(valve: &mut Option<Self>, record: &Record, rig: &Rig, alarms: &mut Vec<Alarm>) -> bool {
        if record.has_flow() {
            *valve = None;
        }
        let Some(stream) = valve else { return false };
        if !stream.meter.push(record) || !stream.meter.has_ended() {
            return false;
        }
        let t_s = record.t_s;
        let elapsed_s = stream.judged_s.replace(t_s).map_or(WINDOW_S, |before_s| (t_s - before_s).max(0.0));
        let test = stream.test(rig);
        let is_explained = test.as_ref().is_some_and(ValveTest::is_explained);
        if let Some(flows_m3s) = test.and_then(|test| test.flows_m3s()).filter(|_| is_explained) {
            for (fault, change) in stream.detector.update(elapsed_s, &flows_m3s) {
                alarms.extend(change.map(|state| Alarm { time_s: t_s, fault, state }));
            }
        }
        true
    }

    /// What the windows so far say; none before the first reading.
    pub fn test(&self, rig: &Rig) -> Option<ValveTest> {
        self.meter.so_far(rig)
    }
}
