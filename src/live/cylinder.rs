//! One cylinder's estimator, and what it has to say.

use super::event::{AlarmEvent, EstimateEvent, Event, LiveLeakage};
use super::notices::Notices;
use crate::Rig;
use crate::replay::Stream;
use crate::report::ReplayReport;
use crate::trace::{BadRows, LineLayout, Taken, TraceFault};
use pitchleak_core::RlsError;
use serde::{Deserialize, Serialize};

#[derive(Clone, Serialize, Deserialize)]
pub(super) struct Cylinder {
    /// Its alarms are those not yet said.
    #[serde(with = "stream_bytes")]
    stream: Stream,
    /// Intervals that had begun at the last sample: a new one asks for an estimate.
    intervals: Option<f64>,
    /// Time of the last estimate said, s.
    told_s: Option<f64>,
    #[serde(skip)]
    notices: Notices,
}

impl Cylinder {
    pub(super) fn new(rig: &Rig) -> Result<Self, RlsError> {
        let stream = Stream::new(rig, BadRows::Skip)?;
        Ok(Self { stream, intervals: None, told_s: None, notices: Notices::default() })
    }

    pub(super) fn rig(&self) -> &Rig {
        self.stream.rig()
    }

    /// Takes in a line; `interval_s` is the time between two estimates.
    pub(super) fn take(
        &mut self,
        name: &str,
        interval_s: f64,
        layout: &LineLayout,
        line: u64,
        cells: &[&[u8]],
        events: &mut Vec<Event>,
    ) -> Result<(), TraceFault> {
        match self.stream.take_line(layout, line, cells)? {
            Taken::Bad(bad) => {
                let kind = serde_json::to_value(bad.reason).unwrap_or_default();
                let kind = kind.as_str().unwrap_or("bad");
                self.notice(name, kind, bad.to_string(), events);
            }
            Taken::Good { renewed } => {
                if renewed && !self.stream.replay().alarms().is_empty() {
                    self.tell_alarms(name, events);
                }
                self.tell_estimate_if_due(name, interval_s, events);
            }
        }
        Ok(())
    }

    /// Counts a line that was left out.
    pub(super) fn notice(&mut self, name: &str, kind: &str, text: String, events: &mut Vec<Event>) {
        let notice = self.notices.add(name, self.stream.time_s(), kind, text);
        events.extend(notice.map(Event::Notice));
    }

    /// At the end of the input: what has not been said.
    pub(super) fn finish(&mut self, name: &str, events: &mut Vec<Event>) {
        if self.stream.time_s() != self.told_s {
            self.tell_estimate(name, events);
        }
        events.extend(self.notices.rest(name, self.stream.time_s()).into_iter().map(Event::Notice));
    }

    fn tell_estimate_if_due(&mut self, name: &str, interval_s: f64, events: &mut Vec<Event>) {
        let intervals = self.stream.time_s().map(|t_s| (t_s / interval_s).floor());
        let before = std::mem::replace(&mut self.intervals, intervals);
        if before.is_some() && before != intervals {
            self.tell_estimate(name, events);
        }
    }

    fn tell_estimate(&mut self, name: &str, events: &mut Vec<Event>) {
        let (Some(t_s), Some(report)) = (self.stream.time_s(), self.stream.report(name)) else { return };
        self.told_s = Some(t_s);
        events.push(Event::Estimate(EstimateEvent {
            cylinder: name.to_owned(),
            t_s,
            status: report.verdict.status,
            faults: report.verdict.faults,
            leakage: report.leakage.map(LiveLeakage::from),
            trend: report.trend,
            time_ns: self.time_ns(t_s),
        }));
    }

    fn tell_alarms(&mut self, name: &str, events: &mut Vec<Event>) {
        let Some(ReplayReport { leakage, alarms, .. }) = self.stream.report(name) else { return };
        for alarm in alarms {
            let time_ns = self.time_ns(alarm.time_s);
            let time = time_ns.map_or_else(|| format!("{} s", alarm.time_s), |ns| format!("{ns} ns"));
            let words = [serde_json::to_value(alarm.fault), serde_json::to_value(alarm.state)]
                .map(|word| word.ok().and_then(|word| word.as_str().map(str::to_owned)).unwrap_or_default());
            events.push(Event::Alarm(AlarmEvent {
                id: format!("{name}:{}:{time}", words.join(":")),
                cylinder: name.to_owned(),
                t_s: alarm.time_s,
                fault: alarm.fault,
                state: alarm.state,
                leakage: leakage[alarm.fault].into(),
                time_ns,
            }));
        }
        self.stream.forget_alarms();
    }

    fn time_ns(&self, t_s: f64) -> Option<i64> {
        self.stream.epoch_ns.map(|epoch_ns| epoch_ns.saturating_add((t_s * 1e9).round() as i64))
    }
}

/// A stream as its own bytes, which are checked as they are read.
mod stream_bytes {
    use super::Stream;
    use ciborium::Value;
    use serde::{Deserialize, Deserializer, Serializer, de, ser};

    pub(super) fn serialize<S: Serializer>(stream: &Stream, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_bytes(&stream.save().map_err(ser::Error::custom)?)
    }

    pub(super) fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Stream, D::Error> {
        let Value::Bytes(bytes) = Value::deserialize(deserializer)? else {
            return Err(de::Error::custom("bytes expected"));
        };
        Stream::restore(&bytes).map_err(de::Error::custom)
    }
}
