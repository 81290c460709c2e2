//! What each leak was in an hour and in a day, and how it changes over weeks: in bounded memory.

use super::event::{EstimateEvent, LiveLeakage, SummaryEvent};
use crate::units::S_PER_DAY;
use pitchleak_core::{Leak, PerLeak};
use serde::{Deserialize, Serialize};

/// Days that are kept for the trend.
const DAYS: usize = 90;
/// No cylinder leaks as much, L/min: an estimate beyond it is none, and adds up to nothing.
const MOST_LPM: f64 = 1e6;
/// Fewer tell no trend over days.
const LEAST_DAYS: usize = 3;

/// A span of time that is summed up.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Span {
    /// 3600 s, of the clock where samples have time stamps.
    Hour,
    /// 86400 s.
    Day,
}

impl Span {
    fn seconds(self) -> f64 {
        match self {
            Self::Hour => 3600.0,
            Self::Day => S_PER_DAY,
        }
    }

    /// Its name in files and topics, as in JSON.
    pub fn id(self) -> &'static str {
        match self {
            Self::Hour => "hour",
            Self::Day => "day",
        }
    }
}

/// A leak in an hour or a day.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct LeakSummary {
    /// Mean of the estimates, L/min.
    pub mean_lpm: f64,
    /// Standard deviation of the last one's error, L/min; none where it gave none.
    pub std_lpm: Option<f64>,
    /// Largest of them, L/min.
    pub max_lpm: f64,
    /// Share of the estimates that had it among their faults: its alarm stood, or it was apparent in a verdict in doubt.
    pub alarm_share: f64,
    /// Change over the days kept, the last with it, L/min per day; none of an hour, or where too few days tell.
    pub trend_lpm_per_day: Option<DayTrend>,
}

/// A slope over days.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct DayTrend {
    /// L/min per day.
    pub slope: f64,
    /// Standard deviation of its error, from how far the days lie off the line, L/min per day.
    pub std: f64,
    /// Days that it rests on.
    pub days: usize,
}

/// What is known of a cylinder's past.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(super) struct History {
    hour: Sums,
    day: Sums,
    days: Vec<DayMean>,
}

/// Over the estimates of a span.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
struct Sums {
    /// Which span since the axis' zero.
    index: f64,
    estimates: u64,
    leaks: PerLeak<LeakSums>,
}

#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
struct LeakSums {
    mean_lpm: f64,
    std_lpm: Option<f64>,
    max_lpm: f64,
    alarms: u64,
}

/// Means of a day.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
struct DayMean {
    index: f64,
    mean_lpm: PerLeak<f64>,
}

impl History {
    /// Whether estimates can have led to it, as far as its counts tell.
    pub(super) fn is_possible(&self) -> bool {
        let sums = |sums: &Sums| sums.leaks.iter().all(|(_, leak)| leak.alarms <= sums.estimates);
        sums(&self.hour) && sums(&self.day) && self.days.len() <= DAYS
    }

    /// Mean flow of each leak on the days kept, L/min, by the number of the day since the axis' zero.
    pub(super) fn days(&self) -> impl Iterator<Item = (f64, PerLeak<f64>)> {
        self.days.iter().map(|day| (day.index, day.mean_lpm))
    }

    /// Takes in an estimate of the time `at_s`, s since any one moment; gives the spans that ended before it.
    pub(super) fn add(&mut self, at_s: f64, estimate: &EstimateEvent) -> Vec<SummaryEvent> {
        let hour = self.hour.add(Span::Hour, at_s, estimate);
        let day = self.day.add(Span::Day, at_s, estimate).map(|day| self.with_trend(day));
        hour.into_iter().chain(day).collect()
    }

    fn with_trend(&mut self, mut day: SummaryEvent) -> SummaryEvent {
        let index = day.from_s / Span::Day.seconds();
        // A clock that was set back lives days again.
        self.days.retain(|known| known.index < index);
        self.days.push(DayMean { index, mean_lpm: day.leakage.map(|leak| leak.mean_lpm) });
        let beyond = self.days.len().saturating_sub(DAYS);
        self.days.drain(..beyond);
        for leak in Leak::ALL {
            day.leakage[leak].trend_lpm_per_day = self.trend(leak);
        }
        day
    }

    /// Least squares of a line through the days' means.
    fn trend(&self, leak: Leak) -> Option<DayTrend> {
        let count = self.days.len();
        if count < LEAST_DAYS {
            return None;
        }
        let mean = |of: &dyn Fn(&DayMean) -> f64| self.days.iter().map(of).sum::<f64>() / count as f64;
        let (day0, flow0) = (mean(&|day| day.index), mean(&|day| day.mean_lpm[leak]));
        let spread = mean(&|day| (day.index - day0).powi(2)) * count as f64;
        let slope = mean(&|day| (day.index - day0) * (day.mean_lpm[leak] - flow0)) * count as f64 / spread;
        let off = |day: &DayMean| day.mean_lpm[leak] - flow0 - slope * (day.index - day0);
        let variance = mean(&|day| off(day).powi(2)) * count as f64 / (count - 2) as f64;
        let std = (variance / spread).sqrt();
        (slope.is_finite() && std.is_finite()).then_some(DayTrend { slope, std, days: count })
    }
}

impl Sums {
    fn add(&mut self, span: Span, at_s: f64, estimate: &EstimateEvent) -> Option<SummaryEvent> {
        let index = (at_s / span.seconds()).floor();
        let over = self.estimates > 0 && (index - self.index).abs() > 0.5;
        let ended = over.then(|| std::mem::take(self).summary(span, estimate));
        self.index = index;
        self.estimates = self.estimates.saturating_add(1);
        for leak in Leak::ALL {
            let alarm = estimate.faults.contains(&leak);
            self.leaks[leak].add(estimate.leakage[leak], alarm, self.estimates == 1);
        }
        ended
    }

    /// As an event of the cylinder whose estimate came after it.
    fn summary(self, span: Span, after: &EstimateEvent) -> SummaryEvent {
        let count = self.estimates as f64;
        let leakage = self.leaks.map(|leak| LeakSummary {
            mean_lpm: leak.mean_lpm / count,
            std_lpm: leak.std_lpm,
            max_lpm: leak.max_lpm,
            alarm_share: leak.alarms as f64 / count,
            trend_lpm_per_day: None,
        });
        let from_s = self.index * span.seconds();
        SummaryEvent {
            cylinder: after.cylinder.clone(),
            span,
            from_s,
            estimates: self.estimates,
            leakage,
            time_ns: after.time_ns.map(|_| (from_s * 1e9) as i64),
        }
    }
}

impl LeakSums {
    fn add(&mut self, leakage: LiveLeakage, alarm: bool, first: bool) {
        let possible = |lpm: &f64| lpm.abs() <= MOST_LPM;
        let mean_lpm = Some(leakage.mean_lpm).filter(possible).unwrap_or_default();
        self.mean_lpm += mean_lpm;
        self.max_lpm = if first { mean_lpm } else { self.max_lpm.max(mean_lpm) };
        self.alarms = self.alarms.saturating_add(u64::from(alarm));
        self.std_lpm = leakage.std_lpm.filter(possible);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::Status;

    fn estimate(mean_lpm: f64) -> EstimateEvent {
        let leakage = LiveLeakage { mean_lpm, std_lpm: Some(0.1) };
        EstimateEvent {
            cylinder: String::new(),
            t_s: 0.0,
            status: Status::Leak,
            faults: vec![Leak::Internal],
            leakage: PerLeak { internal: leakage, external_a: leakage, external_b: leakage },
            changed_at_s: None,
            trend: PerLeak::default(),
            probability: None,
            explanation: None,
            reasons: Vec::new(),
            time_ns: None,
        }
    }

    #[test]
    fn an_hour_is_summed_up_when_the_next_begins() {
        let mut history = History::default();
        let hour_s = 472_222.0 * 3600.0;
        let summaries: Vec<_> = (0..=60)
            .flat_map(|minute| history.add(hour_s + 60.0 * f64::from(minute), &estimate(f64::from(minute))))
            .collect();
        let hours: Vec<_> = summaries.iter().map(|hour| (hour.span, hour.estimates, hour.from_s)).collect();
        assert_eq!(hours, [(Span::Hour, 60, hour_s)]);
        let leak = summaries[0].leakage.internal;
        assert_eq!((leak.mean_lpm, leak.max_lpm, leak.alarm_share), (29.5, 59.0, 1.0));
        assert_eq!(leak.std_lpm, Some(0.1));
    }

    #[test]
    fn a_leak_that_grows_over_weeks_has_a_trend_and_the_past_is_bounded() {
        let mut history = History::default();
        let mut last = None;
        for day in 0..200_u32 {
            let wobble = if day % 2 == 0 { 0.01 } else { -0.01 };
            let summaries =
                history.add(86_400.0 * f64::from(day), &estimate(0.002 * f64::from(day) + wobble));
            last = summaries.into_iter().find(|summary| summary.span == Span::Day).or(last);
        }
        let trend = last.unwrap().leakage.internal.trend_lpm_per_day.unwrap();
        assert_eq!((trend.days, history.days.len()), (DAYS, DAYS));
        assert!((trend.slope - 0.002).abs() < 3.0 * trend.std && trend.std < 1e-4, "{trend:?}");
    }
}
