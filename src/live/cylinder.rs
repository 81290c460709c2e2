//! One cylinder's estimator, and what it has to say.

use super::config::LiveConfig;
use super::event::{AlarmEvent, EstimateEvent, Event, HoldEvent, LiveLeakage, NoticeEvent, Notices};
use super::history::History;
use super::order::{Order, Turn};
use crate::Rig;
use crate::explain::Decision;
use crate::hold::HoldTest;
use crate::replay::{ReplayError, Stream, Taken};
use crate::report::{Alarm, ReplayReport};
use crate::trace::{BadReason, BadRows, LineLayout};
use pitchleak_core::AlarmState;
use serde::{Deserialize, Serialize};

#[derive(Clone, Serialize, Deserialize)]
pub(super) struct Cylinder {
    /// Its alarms are those not yet said.
    #[serde(with = "stream_bytes")]
    pub stream: Stream,
    /// Time of the last estimate said, s.
    told_s: Option<f64>,
    order: Order,
    pub history: History,
    #[serde(skip)]
    pub notices: Notices,
    /// Something came since the last [`Snapshot`](super::Snapshot).
    #[serde(skip)]
    pub changed: bool,
}

/// A line, taken apart.
pub(super) struct Line<'a> {
    /// The cylinder's.
    pub name: &'a str,
    pub layout: &'a LineLayout,
    /// In the input; none where samples are counted one by one for each cylinder, so that a restart changes no number.
    pub number: Option<u64>,
    pub cells: &'a [&'a [u8]],
}

/// A reason's name in JSON is the kind of its notices.
fn id(reason: BadReason) -> &'static str {
    match reason {
        BadReason::NotANumber => "not_a_number",
        BadReason::NotATime => "not_a_time",
        BadReason::Missing => "missing",
        BadReason::ShortRow => "short_row",
        BadReason::LongRow => "long_row",
        BadReason::OutOfRange => OUT_OF_RANGE,
        BadReason::TimeBack => "time_back",
    }
}

/// Kind of notice of [`BadReason::OutOfRange`].
const OUT_OF_RANGE: &str = "out_of_range";

impl Cylinder {
    pub(super) fn new(rig: &Rig) -> Result<Self, ReplayError> {
        let stream = Stream::new(rig, BadRows::Skip)?;
        Ok(Self {
            stream,
            told_s: None,
            order: Order::default(),
            history: History::default(),
            notices: Notices::default(),
            changed: true,
        })
    }

    pub(super) fn rig(&self) -> &Rig {
        self.stream.rig()
    }

    /// Whether it is watched by this rig, by whatever name.
    pub(super) fn is_of(&self, rig: &Rig) -> bool {
        self.rig().to_toml() == rig.to_toml()
    }

    /// Whether samples can have led to it; its stream has been looked at as it was read.
    pub(super) fn is_possible(&self) -> bool {
        self.history.is_possible() && self.order.is_possible()
    }

    /// Takes in a line if it is its turn: one that came before changes nothing, to the last bit.
    pub(super) fn take(
        &mut self,
        config: &LiveConfig,
        resent: bool,
        line: &Line<'_>,
        events: &mut Vec<Event>,
    ) {
        self.changed = true;
        let t_s = match line.layout.time_s(self.stream.epoch_ns, line.cells) {
            Ok(t_s) => t_s,
            Err(reason) => {
                let at = line.number.map(|number| format!("line {number}: ")).unwrap_or_default();
                return self.notice(line.name, id(reason), format!("{at}time: {}", reason.text()), events);
            }
        };
        match self.order.turn(t_s, resent, config.set_back_after_s) {
            Turn::Next => self.take_next(config, t_s, line, events),
            Turn::Late => {
                let kind = if resent { "sent_again" } else { "late" };
                self.notice(line.name, kind, format!("{t_s} s is not after the last sample"), events);
            }
            Turn::SetBack => {
                self.tell_counted(line.name, events);
                let text = format!("samples go on from {t_s} s: the clock was set back");
                self.notice(line.name, "clock_set_back", text, events);
                self.take_next(config, t_s, line, events);
            }
        }
    }

    fn take_next(&mut self, config: &LiveConfig, t_s: f64, line: &Line<'_>, events: &mut Vec<Event>) {
        let before_s = self.stream.time_s();
        let number = line.number.unwrap_or(self.order.count);
        let taken = self.stream.take_line(line.layout, number, line.cells);
        if matches!(taken, Ok(Taken::Good { .. })) {
            self.order.took(t_s);
        } else {
            self.order.left_out(t_s);
        }
        match taken {
            Ok(Taken::Bad(bad)) => self.notice(line.name, id(bad.reason), bad.to_string(), events),
            Ok(Taken::Good { renewed }) => {
                if renewed && !self.stream.replay().alarms().is_empty() {
                    self.tell_alarms(line.name, events);
                }
                self.tell_estimate_if_due(line.name, before_s, config.interval_s, events);
                let hold = self.stream.ended_hold(line.name);
                events.extend(self.hold(line.name, hold));
            }
            Err(fault) => self.notice(line.name, "unreadable", fault.to_string(), events),
        }
    }

    /// Counts a line that was left out.
    pub(super) fn notice(&mut self, name: &str, kind: &str, text: String, events: &mut Vec<Event>) {
        let notice = self.notices.add(name, self.times_s(), kind, text);
        events.extend(notice.map(|notice| Event::Notice(self.explained(notice))));
    }

    /// At the end of the input: what has not been said.
    pub(super) fn finish(&mut self, name: &str, events: &mut Vec<Event>) {
        if [self.told_s, self.stream.weighed_s()] != [self.stream.time_s(); 2] {
            // Kept apart: a run that goes on from here says what one run says.
            let decision = self.stream.decision();
            events.extend(self.estimate(name, decision.as_ref()).map(|told| Event::Estimate(Box::new(told))));
        }
        events.extend(self.hold(name, self.stream.hold_so_far(name)));
        self.tell_counted(name, events);
    }

    /// Of a hold test's report; none of another.
    fn hold(&self, name: &str, report: Option<ReplayReport>) -> Option<Event> {
        let t_s = self.stream.time_s()?;
        let report = report.filter(|report| HoldTest::tells(report, self.rig()))?;
        Some(Event::Hold(Box::new(HoldEvent {
            cylinder: name.to_owned(),
            t_s,
            status: report.verdict.status,
            faults: report.verdict.faults,
            leakage: report.leakage.map(LiveLeakage::from),
            hold: report.hold?,
            text: report.verdict.text,
            reasons: report.verdict.reasons,
            time_ns: self.time_ns(t_s),
        })))
    }

    /// What was counted and not said.
    pub(super) fn tell_counted(&mut self, name: &str, events: &mut Vec<Event>) {
        let rest = self.notices.rest(name, self.times_s());
        events.extend(rest.into_iter().map(|notice| Event::Notice(self.explained(notice))));
    }

    /// Of the last line, and of the last good one.
    fn times_s(&self) -> [Option<f64>; 2] {
        [self.stream.seen_s(), self.stream.time_s()]
    }

    /// With the unit that would bring within range what lines are left out for.
    fn explained(&self, notice: NoticeEvent) -> NoticeEvent {
        if notice.kind != OUT_OF_RANGE {
            return notice;
        }
        let mistake = self.stream.refused_for().map(|wiring| format!("; {}", wiring.sentence()));
        NoticeEvent { text: notice.text + &mistake.unwrap_or_default(), ..notice }
    }

    /// With the first sample of every interval but the first.
    fn tell_estimate_if_due(
        &mut self,
        name: &str,
        before_s: Option<f64>,
        interval_s: f64,
        events: &mut Vec<Event>,
    ) {
        let intervals = |t_s: Option<f64>| t_s.map(|t_s| (t_s / interval_s).floor());
        if before_s.is_none() || intervals(before_s) == intervals(self.stream.time_s()) {
            return;
        }
        self.stream.renew();
        let Some(estimate) = self.estimate(name, self.stream.weighed()) else { return };
        self.told_s = Some(estimate.t_s);
        let at_s = estimate.time_ns.map_or(estimate.t_s, |ns| ns as f64 / 1e9);
        let ended = self.history.add(at_s, &estimate);
        events.extend(ended.into_iter().map(Event::Summary));
        events.push(Event::Estimate(Box::new(estimate)));
    }

    fn estimate(&self, name: &str, decision: Option<&Decision>) -> Option<EstimateEvent> {
        let (t_s, report) = (self.stream.time_s()?, self.stream.report_as(name, decision)?);
        Some(EstimateEvent {
            cylinder: name.to_owned(),
            t_s,
            status: report.verdict.status,
            faults: report.verdict.faults,
            leakage: report.leakage.map(LiveLeakage::from),
            changed_at_s: report.changed_at_s,
            trend: report.trend,
            probability: report.verdict.probability,
            explanation: report.verdict.explanations.into_iter().next().map(|best| best.id),
            reasons: report.verdict.reasons,
            time_ns: self.time_ns(t_s),
        })
    }

    fn tell_alarms(&mut self, name: &str, events: &mut Vec<Event>) {
        let due = self.stream.take_alarms();
        self.stream.renew();
        let Some(report) = self.stream.report_as(name, self.stream.weighed()) else { return };
        events.extend(due.into_iter().map(|alarm| Event::Alarm(self.alarm(name, alarm, &report))));
    }

    fn alarm(&self, name: &str, alarm: Alarm, report: &ReplayReport) -> AlarmEvent {
        let time_ns = self.time_ns(alarm.time_s);
        let time = time_ns.map_or_else(|| format!("{} s", alarm.time_s), |ns| format!("{ns} ns"));
        let (state, status) = match alarm.state {
            AlarmState::Raised => ("raised", report.verdict.status_of(alarm.fault)),
            AlarmState::Cleared => ("cleared", report.verdict.status),
        };
        AlarmEvent {
            id: format!("{name}:{}:{state}:{time}", alarm.fault.id()),
            cylinder: name.to_owned(),
            t_s: alarm.time_s,
            fault: alarm.fault,
            state: alarm.state,
            status,
            leakage: report.leakage[alarm.fault].into(),
            time_ns,
        }
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
