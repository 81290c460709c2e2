//! A cylinder: what all its traces say together.

use super::standing::{Answer, Standing};
use super::{Beside, Counts, FleetLeak, FleetRow, LongTrend};
use crate::report::Status;
use jiff::Timestamp;
use pitchleak_core::{Leak, PerLeak};
use serde::Serialize;
use std::collections::HashMap;

/// What the traces of one cylinder say together.
///
/// The latest trace says how it is now, with one exception: a leak stands until a trace excludes it. One that is in
/// doubt, says too little or can't be judged does not. A trace without a date is neither before nor after another, so a
/// leak that it shows stands; where no trace has a date, the worst says how it is.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FleetCylinder {
    /// Its name.
    pub cylinder: String,
    /// How it is now; none where no trace could be judged.
    pub status: Option<Status>,
    /// Leaks to act on: those that stand; in doubt, those that the latest trace names.
    pub faults: Vec<Leak>,
    /// Why the status is doubtful or not sure: ids, first things first.
    pub reasons: Vec<String>,
    /// Begin of the first trace of the unbroken run that the status lasts; of several faults, the first. None without
    /// dates.
    pub since: Option<Timestamp>,
    /// Begin of the last trace before that said otherwise; none where none did: then it was so from the first trace on.
    pub other_until: Option<Timestamp>,
    /// Place in the report's rows of the trace that says how it is now, or would without the leak that stands; none where
    /// no trace could be judged.
    pub latest: Option<usize>,
    /// Number of its traces.
    pub traces: usize,
    /// Its traces by what was found.
    pub counts: Counts,
    /// Each leak.
    pub leaks: PerLeak<CylinderLeak>,
    /// Places of its traces in the report's rows, by their begin; those without come first.
    pub rows: Vec<usize>,
}

/// One leak of a cylinder.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct CylinderLeak {
    /// Whether it is a leak to act on that no later trace excluded.
    pub stands: bool,
    /// Begin of the first trace that showed it, with none since that excluded it; none where it does not stand, or
    /// without dates.
    pub since: Option<Timestamp>,
    /// Begin of the last trace before that excluded it.
    pub other_until: Option<Timestamp>,
    /// Its flow: of a leak that stands in the last trace that shows it, of another in the last trace that pins it down.
    pub flow: Option<FleetLeak>,
    /// How it changes from trace to trace, and when it is at its threshold.
    pub trend: Option<LongTrend>,
    /// How it differs from that of the cylinder's siblings.
    pub beside: Option<Beside>,
}

impl CylinderLeak {
    /// Since when it is there, by days, for people; none without dates, or where it does not stand.
    pub fn since_text(&self) -> Option<String> {
        since_text(self.since, self.other_until)
    }

    /// How it differs from that of the siblings, where that is news: beyond chance, and no leak to act on yet.
    pub fn differing(&self) -> Option<&Beside> {
        self.beside.as_ref().filter(|beside| beside.differs && !self.stands)
    }
}

impl FleetCylinder {
    /// A turbine has three blades, with a cylinder or two each: a folder with more cylinders is none.
    pub const MOST_OF_A_TURBINE: usize = 6;

    /// The cylinders of `rows`, the worst first.
    pub fn all(rows: &[FleetRow]) -> Vec<Self> {
        let mut places: Vec<Vec<usize>> = Vec::new();
        let mut known: HashMap<&str, usize> = HashMap::new();
        for (place, row) in rows.iter().enumerate() {
            let at = *known.entry(&row.cylinder).or_insert(places.len());
            match places.get_mut(at) {
                Some(own) => own.push(place),
                None => places.push(vec![place]),
            }
        }
        let mut cylinders: Vec<_> = places.into_iter().filter_map(|own| Self::of(rows, own)).collect();
        Beside::compare(&mut cylinders, rows);
        cylinders.sort_by(|a, b| {
            a.urgency().cmp(&b.urgency()).then_with(|| b.worst_lpm().total_cmp(&a.worst_lpm()))
        });
        cylinders
    }

    fn of(rows: &[FleetRow], mut own: Vec<usize>) -> Option<Self> {
        own.sort_by_key(|place| rows.get(*place).and_then(|row| row.begins));
        let traces =
            Traces { rows: own.iter().filter_map(|place| Some((*place, rows.get(*place)?))).collect() };
        let (_, first) = traces.rows.first()?;
        let leaks = PerLeak::from_fn(|leak| traces.leak(leak));
        let mut faults: Vec<_> = Leak::ALL.into_iter().filter(|leak| leaks[*leak].stands).collect();
        let latest = traces.latest();
        let status =
            if faults.is_empty() { latest.and_then(|(_, row)| row.status) } else { Some(Status::Leak) };
        let (since, other_until) = match status {
            Some(Status::Leak) => faults
                .iter()
                .map(|leak| (leaks[*leak].since, leaks[*leak].other_until))
                .min_by_key(|(since, _)| (since.is_none(), *since)),
            Some(now) => traces.when(|row| Answer::on_status(row, now)),
            None => None,
        }
        .unwrap_or_default();
        if let (true, Some((_, row))) = (faults.is_empty(), latest) {
            faults.clone_from(&row.faults);
        }
        let reasons = latest.filter(|(_, row)| row.status == status).map(|(_, row)| row.reasons.clone());
        Some(Self {
            cylinder: first.cylinder.clone(),
            status,
            faults,
            reasons: reasons.unwrap_or_default(),
            since,
            other_until,
            latest: latest.map(|(place, _)| place),
            traces: own.len(),
            counts: Counts::of(traces.all().map(|row| row.status)),
            leaks,
            rows: own,
        })
    }

    /// Its name without the last level, where it has more than one: that of its turbine.
    pub fn turbine(&self) -> Option<&str> {
        self.cylinder.rsplit_once('/').map(|(turbine, _)| turbine)
    }

    /// As at the head of its line.
    pub fn word(&self) -> &'static str {
        self.status.map_or("ERROR", Status::word)
    }

    /// Since when it is so, by days, for people; none without dates.
    pub fn since_text(&self) -> Option<String> {
        since_text(self.since, self.other_until)
    }

    /// The largest flow among the leaks to act on, L/min.
    pub(crate) fn worst_lpm(&self) -> f64 {
        let flow = |leak: &Leak| self.leaks[*leak].flow.map_or(0.0, |flow| flow.mean_lpm);
        self.faults.iter().map(flow).fold(0.0, f64::max)
    }

    /// The least asks for somebody first.
    fn urgency(&self) -> (usize, bool) {
        (urgency(self.status), !self.leaks.iter().any(|(_, leak)| leak.differing().is_some()))
    }
}

fn since_text(since: Option<Timestamp>, other_until: Option<Timestamp>) -> Option<String> {
    let day = since?.strftime("%Y-%m-%d");
    let or_before = if other_until.is_none() { " or before" } else { "" };
    Some(format!("since {day}{or_before}"))
}

fn urgency(status: Option<Status>) -> usize {
    match status {
        Some(Status::Leak) => 0,
        Some(Status::Doubtful) => 1,
        Some(Status::NotSure) => 2,
        None => 3,
        Some(Status::Sound) => 4,
    }
}

/// A cylinder's rows by their begin, with their places.
struct Traces<'a> {
    rows: Vec<(usize, &'a FleetRow)>,
}

impl<'a> Traces<'a> {
    fn all(&self) -> impl DoubleEndedIterator<Item = &'a FleetRow> + Clone {
        self.rows.iter().map(|(_, row)| *row)
    }

    fn dated(&self) -> Vec<&'a FleetRow> {
        self.all().filter(|row| row.begins.is_some()).collect()
    }

    /// The trace that says how it is now, were there no leak that stands.
    fn latest(&self) -> Option<(usize, &'a FleetRow)> {
        let judged = || self.rows.iter().copied().filter(|(_, row)| row.status.is_some());
        let dated = judged().rfind(|(_, row)| row.begins.is_some());
        dated.or_else(|| judged().min_by_key(|(_, row)| urgency(row.status)))
    }

    /// Begin of the run that lasts to the end, and of the trace that said otherwise before.
    fn when(&self, answer: impl Fn(&FleetRow) -> Answer) -> Option<(Option<Timestamp>, Option<Timestamp>)> {
        let dated = self.dated();
        let standing = Standing::of(&dated.iter().map(|row| answer(row)).collect::<Vec<_>>())?;
        let begins = |place: usize| dated.get(place).and_then(|row| row.begins);
        Some((begins(standing.since), standing.other_until.and_then(begins)))
    }

    fn leak(&self, leak: Leak) -> CylinderLeak {
        let answer = |row: &FleetRow| Answer::on_leak(row, leak);
        let when = self.when(answer);
        let dated = when.is_some();
        let shows = |row: &&FleetRow| answer(row) == Answer::Yes && row.begins.is_some() == dated;
        let undated = self.all().any(|row| row.begins.is_none() && answer(row) == Answer::Yes);
        let stands = dated || undated;
        let flow = if stands {
            self.all().rfind(shows).and_then(|row| row.leaks).map(|leaks| leaks[leak])
        } else {
            self.all().rev().find_map(|row| row.pinned(leak))
        };
        let (since, other_until) = when.unwrap_or_default();
        let trend = LongTrend::of(self.all(), leak);
        CylinderLeak { stands, since, other_until, flow, trend, beside: None }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fleet::{FleetReport, TraceIdentity};

    /// A trace of June with this verdict (`L` internal leak, `A` external leak at A, `s` sound, `d` doubtful, `n` not sure,
    /// `e` error) and these flows, L/min; day 0 is none.
    fn row(cylinder: &str, day: u8, verdict: char, internal: f64) -> FleetRow {
        let begins = (day > 0).then(|| format!("2026-06-{day:02}T00:00:00Z").parse().unwrap());
        let identity = TraceIdentity { cylinder: cylinder.to_owned(), begins };
        let mut row = FleetRow::failed(&identity, format!("{cylinder}/{day}.csv"), "broken".to_owned());
        if verdict == 'e' {
            return row;
        }
        let (status, faults) = match verdict {
            'L' => (Status::Leak, vec![Leak::Internal]),
            'A' => (Status::Leak, vec![Leak::ExternalA]),
            's' => (Status::Sound, vec![]),
            'd' => (Status::Doubtful, vec![Leak::Internal]),
            _ => (Status::NotSure, vec![]),
        };
        let leak = |leak| {
            let mean_lpm = if leak == Leak::Internal { internal } else { 0.01 };
            let ci95 = Some([mean_lpm - 0.01, mean_lpm + 0.01]);
            FleetLeak {
                mean_lpm,
                comes_and_goes: false,
                std_lpm: Some(0.0051),
                ci95,
                threshold_lpm: 0.1,
                identifiable: true,
                trend: None,
            }
        };
        row.error = None;
        row.duration_s = Some(60.0);
        row.reasons = if status.is_sure() { vec![] } else { vec!["channel_dead".to_owned()] };
        (row.status, row.faults, row.leaks) = (Some(status), faults, Some(PerLeak::from_fn(leak)));
        row
    }

    /// One cylinder with a verdict a day, from the first of June on.
    fn cylinder(verdicts: &str) -> FleetCylinder {
        let days = (1..).zip(verdicts.chars());
        let mut rows: Vec<_> =
            days.map(|(day, verdict)| row("T7/B1", day, verdict, 0.05 * f64::from(day))).collect();
        // Traces come in any order.
        rows.reverse();
        FleetCylinder::all(&rows).remove(0)
    }

    /// Status, day since, day of the last trace that said otherwise.
    fn course(verdicts: &str) -> (Option<Status>, i8, i8) {
        let found = cylinder(verdicts);
        let day = |at: Option<Timestamp>| at.map_or(0, |at| at.to_zoned(jiff::tz::TimeZone::UTC).day());
        (found.status, day(found.since), day(found.other_until))
    }

    #[test]
    fn the_latest_trace_says_how_it_is_and_the_run_since_when() {
        assert_eq!(course("ssLL"), (Some(Status::Leak), 3, 2));
        assert_eq!(course("LLLL"), (Some(Status::Leak), 1, 0));
        assert_eq!(course("LLss"), (Some(Status::Sound), 3, 2));
        assert_eq!(course("sddd"), (Some(Status::Doubtful), 2, 1));
        assert_eq!(course("ssdn"), (Some(Status::NotSure), 4, 3));
        assert_eq!(course("sdsns"), (Some(Status::Sound), 1, 0));
        assert_eq!(course("sse"), (Some(Status::Sound), 1, 0));
        assert_eq!(course("ee"), (None, 0, 0));
    }

    #[test]
    fn a_leak_stands_until_a_trace_excludes_it() {
        assert_eq!(course("sLdnL"), (Some(Status::Leak), 2, 1));
        assert_eq!(course("sLLdne"), (Some(Status::Leak), 2, 1));
        assert_eq!(course("LLsLL"), (Some(Status::Leak), 4, 3));
        let found = cylinder("sLLd");
        assert_eq!((found.faults, found.reasons.len()), (vec![Leak::Internal], 0));
        // The flow is that of the last trace that shows it.
        assert!((found.leaks.internal.flow.unwrap().mean_lpm - 0.15).abs() < 1e-12);
        let doubtful = cylinder("sd");
        assert_eq!((doubtful.faults, doubtful.reasons.len()), (vec![Leak::Internal], 1));
        assert!(!doubtful.leaks.internal.stands);
    }

    #[test]
    fn another_leak_ends_one_only_where_it_excludes_it() {
        // On the third day the internal leak is 0.15 L/min, above its threshold, whatever the verdict names.
        let found = cylinder("sLA");
        assert_eq!(found.faults, [Leak::Internal, Leak::ExternalA]);
        assert_eq!(found.since.unwrap().to_string(), "2026-06-02T00:00:00Z");
        let rows = [row("T7/B1", 1, 'L', 0.2), row("T7/B1", 2, 'A', 0.0)];
        assert_eq!(FleetCylinder::all(&rows)[0].faults, [Leak::ExternalA]);
    }

    #[test]
    fn without_dates_the_worst_stands() {
        let of = |verdicts: &str| {
            let rows: Vec<_> = verdicts.chars().map(|verdict| row("T7/B1", 0, verdict, 0.2)).collect();
            FleetCylinder::all(&rows).remove(0)
        };
        let found = of("sLs");
        assert_eq!((found.status, found.since, found.since_text()), (Some(Status::Leak), None, None));
        assert_eq!(of("sns").status, Some(Status::NotSure));
        assert_eq!(of("ss").status, Some(Status::Sound));
        // Nobody knows whether it was before the sound one.
        let rows = [row("T7/B1", 0, 'L', 0.2), row("T7/B1", 1, 's', 0.0)];
        let found = FleetCylinder::all(&rows).remove(0);
        assert_eq!((found.status, found.latest), (Some(Status::Leak), Some(1)));
    }

    #[test]
    fn a_report_counts_cylinders_the_worst_first() {
        let mut rows = vec![row("T7/B1", 1, 's', 0.0), row("T7/B2", 1, 'e', 0.0)];
        rows.extend((1..9).map(|day| row("T7/B3", day, 'L', 0.3)));
        rows.extend([row("T8/B1", 1, 'L', 0.5), row("T8/B2", 1, 'd', 0.0)]);
        let report = FleetReport::of(&rows);
        let names: Vec<_> = report.by_cylinder.iter().map(|one| one.cylinder.as_str()).collect();
        assert_eq!(names, ["T8/B1", "T7/B3", "T8/B2", "T7/B2", "T7/B1"]);
        let expected = Counts { leak: 2, sound: 1, doubtful: 1, error: 1, ..Counts::default() };
        assert_eq!((report.cylinder_counts, report.counts.leak), (expected, 9));
        assert_eq!(report.by_cylinder[1].since_text().unwrap(), "since 2026-06-01 or before");
        assert_eq!(report.by_cylinder[1].rows, (2..10).collect::<Vec<_>>());
    }

    #[test]
    fn a_blade_that_differs_from_its_siblings_is_told_before_its_threshold() {
        let mut rows = Vec::new();
        for day in 1..9 {
            let noise = if day % 2 == 0 { 0.004 } else { -0.004 };
            for (blade, flow) in [("B1", 0.01), ("B2", 0.05), ("B3", 0.01)] {
                rows.push(row(&format!("T7/{blade}"), day, 's', flow + noise));
            }
            rows.push(row("alone", day, 's', 0.09 + noise));
            // Leaked before its repair.
            rows.push(row("T8/B1", day, if day < 4 { 'L' } else { 's' }, if day < 4 { 0.5 } else { 0.01 }));
            rows.push(row("T8/B2", day, 's', 0.01));
        }
        let report = FleetReport::of(&rows);
        let told: Vec<_> =
            report.differing().iter().map(|(one, leak, _)| (one.cylinder.as_str(), *leak)).collect();
        assert_eq!(told, [("T7/B2", Leak::Internal)]);
        let beside = report.by_cylinder[0].leaks.internal.beside.unwrap();
        assert!((beside.more_lpm - 0.04).abs() < 1e-9 && beside.siblings == 2, "{beside:?}");
        // Alike: even odds, times fifteen comparisons.
        let alike = report.by_cylinder.iter().find(|one| one.cylinder == "T8/B1").unwrap();
        let p_value = alike.leaks.internal.beside.unwrap().p_value;
        assert!((p_value - 1.0).abs() < 1e-12, "{p_value}");
        assert!(
            report.by_cylinder.iter().filter(|one| one.cylinder == "alone").all(|one| one
                .leaks
                .internal
                .beside
                .is_none())
        );
    }
}
