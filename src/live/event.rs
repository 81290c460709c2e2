//! What goes out.

use super::history::{LeakSummary, Span};
use crate::hold::HoldSummary;
use crate::report::{LeakTrend, Leakage, Reason, Status};
use pitchleak_core::{AlarmState, Leak, PerLeak};
use serde::Serialize;
use std::collections::BTreeMap;

/// How events are written.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum OutputFormat {
    /// A JSON object a line.
    #[default]
    Ndjson,
    /// Influx line protocol.
    Influx,
}

/// One line of the output.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(tag = "type", rename_all = "snake_case")]
pub enum Event {
    /// What is known of a cylinder.
    Estimate(Box<EstimateEvent>),
    /// An alarm raised or cleared.
    Alarm(AlarmEvent),
    /// Lines that were left out.
    Notice(NoticeEvent),
    /// What the leaks were in an hour or a day.
    Summary(SummaryEvent),
    /// What a hold test found.
    Hold(Box<HoldEvent>),
}

/// What is known of a cylinder.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct EstimateEvent {
    /// None where the lines name none.
    #[serde(skip_serializing_if = "String::is_empty")]
    pub cylinder: String,
    /// Time of the sample, s; since the first one where lines have time stamps.
    pub t_s: f64,
    /// What a replay's verdict on the samples so far would be.
    pub status: Status,
    /// Leaks whose alarm stands, and those that come and go.
    pub faults: Vec<Leak>,
    /// Mean leak flows since the start, or since `changed_at_s`.
    pub leakage: PerLeak<LiveLeakage>,
    /// When the leak last changed, s.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub changed_at_s: Option<f64>,
    /// How fast each leak changes; none where the data don't tell.
    pub trend: PerLeak<Option<LeakTrend>>,
    /// Why the status is doubtful or not sure, and what to check, first things first; none where it is sure.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub reasons: Vec<Reason>,
    /// That each leak is above its threshold, as weighed last: at most a minute ago, and since an alarm changed.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub probability: Option<PerLeak<f64>>,
    /// The likeliest explanation's id.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub explanation: Option<String>,
    /// Time of the sample, ns since 1970, where lines have time stamps.
    #[serde(skip)]
    pub time_ns: Option<i64>,
}

/// Mean flow of a leak.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct LiveLeakage {
    /// Mean size of the flow, L/min.
    pub mean_lpm: f64,
    /// Standard deviation of its error, L/min; none from the paper's law.
    pub std_lpm: Option<f64>,
}

impl LiveLeakage {
    /// As fields of line protocol, each behind a comma.
    fn influx(self, leak: Leak) -> String {
        let std = self.std_lpm.map(|std_lpm| format!(",{}_std_lpm={std_lpm}", leak.id()));
        format!(",{}_mean_lpm={}", leak.id(), self.mean_lpm) + &std.unwrap_or_default()
    }
}

impl From<Leakage> for LiveLeakage {
    fn from(leakage: Leakage) -> Self {
        Self { mean_lpm: leakage.mean_lpm, std_lpm: leakage.std_lpm }
    }
}

/// An alarm raised or cleared.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct AlarmEvent {
    /// Follows from the samples alone: a repeated alarm has the same.
    pub id: String,
    /// None where the lines name none.
    #[serde(skip_serializing_if = "String::is_empty")]
    pub cylinder: String,
    /// Time of the sample, s.
    pub t_s: f64,
    /// Which leak.
    pub fault: Leak,
    /// What happened.
    pub state: AlarmState,
    /// Of all estimates at that time: an alarm beside `doubtful` is one to check.
    pub status: Status,
    /// The leak as known by then.
    #[serde(flatten)]
    pub leakage: LiveLeakage,
    /// As of [`EstimateEvent`].
    #[serde(skip)]
    pub time_ns: Option<i64>,
}

/// What the leaks were in an hour or a day.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SummaryEvent {
    /// None where the lines name none.
    #[serde(skip_serializing_if = "String::is_empty")]
    pub cylinder: String,
    /// Hour or day.
    pub span: Span,
    /// Its begin, s since 1970, or as the samples count where they have no time stamps.
    pub from_s: f64,
    /// Estimates in it.
    pub estimates: u64,
    /// Each leak.
    pub leakage: PerLeak<LeakSummary>,
    /// As of [`EstimateEvent`], of its begin.
    #[serde(skip)]
    pub time_ns: Option<i64>,
}

/// What a [hold test](crate::hold) found: when it has ended, or as far as it is at the end of the input.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct HoldEvent {
    /// None where the lines name none.
    #[serde(skip_serializing_if = "String::is_empty")]
    pub cylinder: String,
    /// Time of the sample that ended it, s.
    pub t_s: f64,
    /// Of this test alone.
    pub status: Status,
    /// Leaks that it found, also below their threshold.
    pub faults: Vec<Leak>,
    /// Mean flows over the usable time.
    pub leakage: PerLeak<LiveLeakage>,
    /// How much was usable, and what it could find.
    pub hold: HoldSummary,
    /// The verdict in words.
    pub text: String,
    /// Why the status is doubtful or not sure, and what to check, first things first; none where it is sure.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub reasons: Vec<Reason>,
    /// As of [`EstimateEvent`].
    #[serde(skip)]
    pub time_ns: Option<i64>,
}

/// Lines that were left out.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct NoticeEvent {
    /// None where the lines name none, or cannot be read.
    #[serde(skip_serializing_if = "String::is_empty")]
    pub cylinder: String,
    /// Time of the cylinder's last good sample, s; none before it.
    pub t_s: Option<f64>,
    /// What is wrong with them.
    pub kind: String,
    /// How many since the last notice of this kind.
    pub count: u64,
    /// The first of them.
    pub text: String,
}

impl NoticeEvent {
    /// Of a cylinder, said at once; no sample goes with it.
    pub(super) fn once(cylinder: String, kind: &str, text: String) -> Self {
        Self { cylinder, t_s: None, kind: kind.to_owned(), count: 1, text }
    }
}

impl Event {
    /// The event as a line, without its end.
    ///
    /// # Errors
    /// None in practice: every field has its form.
    pub fn line(&self, format: OutputFormat) -> Result<String, serde_json::Error> {
        match format {
            OutputFormat::Ndjson => serde_json::to_string(self),
            OutputFormat::Influx => Ok(self.influx()),
        }
    }

    fn influx(&self) -> String {
        let (name, cylinder, time_ns, [tag, value]) = match self {
            Self::Estimate(event) => ("pitchleak", &event.cylinder, event.time_ns, [""; 2]),
            Self::Alarm(event) => {
                ("pitchleak_alarm", &event.cylinder, event.time_ns, ["fault", event.fault.id()])
            }
            Self::Notice(event) => ("pitchleak_notice", &event.cylinder, None, ["kind", &event.kind]),
            Self::Summary(event) => {
                ("pitchleak_summary", &event.cylinder, event.time_ns, ["span", event.span.id()])
            }
            Self::Hold(event) => ("pitchleak_hold", &event.cylinder, event.time_ns, [""; 2]),
        };
        let series = tagged(&tagged(name, "cylinder", cylinder), tag, value);
        let time = time_ns.map(|time_ns| format!(" {time_ns}")).unwrap_or_default();
        format!("{series} {}{time}", self.influx_fields())
    }

    fn influx_fields(&self) -> String {
        let quoted =
            |text: &str| text.replace(char::is_control, " ").replace('\\', "\\\\").replace('"', "\\\"");
        let each_leak = |fields: &dyn Fn(Leak) -> String| Leak::ALL.map(fields).concat();
        match self {
            Self::Estimate(event) => {
                let reason = event.reasons.first().map(|reason| format!(",reason=\"{}\"", reason.id.name()));
                let leaks = each_leak(&|leak| {
                    let (name, mean, alarm) = (leak.id(), event.leakage[leak], event.faults.contains(&leak));
                    let slope = event.trend[leak]
                        .map(|trend| format!(",{name}_slope_lpm_per_h={}", trend.slope_lpm_per_h));
                    format!("{}{},{name}_alarm={alarm}", mean.influx(leak), slope.unwrap_or_default())
                });
                let (t_s, status, reason) = (event.t_s, event.status.id(), reason.unwrap_or_default());
                format!("t_s={t_s},status=\"{status}\"{reason}{leaks}")
            }
            Self::Alarm(event) => {
                let raised = event.state == AlarmState::Raised;
                let (id, status, mean) = (quoted(&event.id), event.status.id(), event.leakage.mean_lpm);
                let t_s = event.t_s;
                format!("id=\"{id}\",t_s={t_s},raised={raised},status=\"{status}\",mean_lpm={mean}")
            }
            Self::Notice(event) => format!("count={}u,text=\"{}\"", event.count, quoted(&event.text)),
            Self::Summary(event) => {
                let leaks = each_leak(&|leak| {
                    let (name, leakage) = (leak.id(), event.leakage[leak]);
                    let LeakSummary { mean_lpm, max_lpm, .. } = leakage;
                    let slope = leakage.trend_lpm_per_day;
                    let slope = slope.map(|trend| format!(",{name}_slope_lpm_per_day={}", trend.slope));
                    let slope = slope.unwrap_or_default();
                    format!(",{name}_mean_lpm={mean_lpm},{name}_max_lpm={max_lpm}{slope}")
                });
                format!("estimates={}u{leaks}", event.estimates)
            }
            Self::Hold(event) => {
                let HoldEvent { t_s, status, hold, faults, .. } = &**event;
                let leaks = each_leak(&|leak| {
                    let mean = event.leakage[leak].influx(leak);
                    format!("{mean},{}_found={}", leak.id(), faults.contains(&leak))
                });
                let (status, usable_s, text) = (status.id(), hold.usable_s, quoted(&event.text));
                format!("t_s={t_s},status=\"{status}\",usable_s={usable_s},text=\"{text}\"{leaks}")
            }
        }
    }
}

/// With a tag; one without a value is left out.
fn tagged(series: &str, tag: &str, value: &str) -> String {
    if value.is_empty() {
        return series.to_owned();
    }
    let mut text = format!("{series},{tag}=");
    for c in value.chars().map(|c| if c.is_control() { ' ' } else { c }) {
        if [' ', ',', '=', '\\'].contains(&c) {
            text.push('\\');
        }
        text.push(c);
    }
    text
}

/// Time of the samples between two notices of a kind, s.
const EVERY_S: f64 = 60.0;

/// What was wrong since the last notice of each kind.
#[derive(Clone, Default)]
pub(super) struct Notices(BTreeMap<String, Kind>);

#[derive(Clone, Default)]
struct Kind {
    told_s: Option<f64>,
    count: u64,
    /// Also those that were told.
    total: u64,
    text: String,
}

impl Notices {
    /// Counts a line that was left out; says so at once where nothing was said for a minute. `seen_s` is the time of the last
    /// line, `t_s` of the last good one.
    pub(super) fn add(
        &mut self,
        cylinder: &str,
        [seen_s, t_s]: [Option<f64>; 2],
        kind: &str,
        text: String,
    ) -> Option<NoticeEvent> {
        let is_new = !self.0.contains_key(kind);
        if is_new {
            self.0.insert(kind.to_owned(), Kind::default());
        }
        let entry = self.0.get_mut(kind)?;
        if entry.count == 0 {
            entry.text = text;
        }
        entry.count += 1;
        entry.total += 1;
        (is_new || entry.due(seen_s)).then(|| entry.tell(cylinder, [seen_s, t_s], kind))
    }

    /// How many of each kind there were, told or not.
    pub(super) fn totals(&self) -> impl Iterator<Item = (&str, u64)> {
        self.0.iter().map(|(kind, entry)| (kind.as_str(), entry.total))
    }

    /// What was counted and not said.
    pub(super) fn rest(&mut self, cylinder: &str, times_s: [Option<f64>; 2]) -> Vec<NoticeEvent> {
        let counted = self.0.iter_mut().filter(|(_, entry)| entry.count > 0);
        counted.map(|(kind, entry)| entry.tell(cylinder, times_s, kind)).collect()
    }
}

impl Kind {
    /// Also where the clock was set back.
    fn due(&self, t_s: Option<f64>) -> bool {
        match (self.told_s, t_s) {
            (Some(told_s), Some(t_s)) => t_s < told_s || t_s - told_s >= EVERY_S,
            (None, Some(_)) => true,
            (_, None) => false,
        }
    }

    fn tell(&mut self, cylinder: &str, [seen_s, t_s]: [Option<f64>; 2], kind: &str) -> NoticeEvent {
        self.told_s = seen_s;
        let (count, text) = (std::mem::take(&mut self.count), std::mem::take(&mut self.text));
        NoticeEvent { cylinder: cylinder.to_owned(), t_s, kind: kind.to_owned(), count, text }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_flood_is_one_notice_a_minute() {
        let mut notices = Notices::default();
        let told: Vec<_> = (0..13_000)
            .filter_map(|k| notices.add("a", [Some(f64::from(k) * 0.01); 2], "missing", format!("line {k}")))
            .collect();
        assert_eq!(told.iter().map(|notice| notice.count).collect::<Vec<_>>(), [1, 6000, 6000]);
        assert_eq!(told[1].text, "line 1");
        assert_eq!(notices.rest("a", [Some(130.0); 2]).first().map(|notice| notice.count), Some(999));
        assert!(notices.rest("a", [Some(130.0); 2]).is_empty());
    }
}
