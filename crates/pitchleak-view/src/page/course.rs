//! A cylinder's leaks from trace to trace, small enough to stand in a row.

use super::history::ink;
use crate::envelope::{Envelopes, Row, Spot};
use maud::{Markup, html};
use pitchleak::core::Leak;
use pitchleak::fleet::{FleetCylinder, FleetLeak, FleetReport, FleetRow};
use pitchleak::units::S_PER_DAY;
use std::fmt::Write;

const WIDTH: f64 = 240.0;
const HEIGHT: f64 = 64.0;
const MARGIN: f64 = 4.0;
/// Points of a line: about one for each of its dots' widths.
const MOST_POINTS: usize = 64;

/// One scale for cylinders that stand beside each other.
pub struct Scale {
    /// The earliest trace; none where not all have dates: then they stand in their order.
    from_s: Option<f64>,
    length: f64,
    top_lpm: f64,
    thresholds_lpm: Vec<f64>,
}

impl Scale {
    /// Over all traces of some cylinders, from no leak to the largest flow or alarm level.
    pub fn of(cylinders: &[&FleetCylinder], report: &FleetReport<'_>) -> Self {
        let rows: Vec<_> = cylinders.iter().flat_map(|cylinder| traces(cylinder, report)).collect();
        let times: Option<Vec<f64>> = rows.iter().map(|row| begin_s(row)).collect();
        let ends = times.map(|times| {
            times
                .iter()
                .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), t| (low.min(*t), high.max(*t)))
        });
        let most = cylinders.iter().map(|cylinder| traces(cylinder, report).count()).max().unwrap_or(0);
        let flows =
            || rows.iter().filter_map(|row| row.leaks).flat_map(|leaks| Leak::ALL.map(|leak| leaks[leak]));
        let seen = flows().filter(|flow| flow.identifiable).map(|flow| flow.mean_lpm);
        let mut thresholds_lpm: Vec<f64> = flows().map(|flow| flow.threshold_lpm).collect();
        thresholds_lpm.sort_by(f64::total_cmp);
        thresholds_lpm.dedup();
        Self {
            from_s: ends.map(|(from, _)| from),
            length: ends.map_or(most.saturating_sub(1) as f64, |(from, to)| to - from),
            top_lpm: seen.chain(thresholds_lpm.iter().copied()).fold(0.0, f64::max),
            thresholds_lpm,
        }
    }

    fn x(&self, t: f64) -> f64 {
        let share = if self.length > 0.0 { t / self.length } else { 0.5 };
        MARGIN + (WIDTH - 2.0 * MARGIN) * share
    }

    fn y(&self, lpm: f64) -> f64 {
        let share = (lpm / self.top_lpm.max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
        HEIGHT - MARGIN - (HEIGHT - 2.0 * MARGIN) * share
    }

    /// Dots with their 95 % intervals, a colour for each leak, the alarm levels dashed.
    pub fn draw(&self, cylinder: &FleetCylinder, report: &FleetReport<'_>) -> Markup {
        let rows = self.rows(cylinder, report);
        let level = |lpm: &f64| format!("M0 {y:.1}H{WIDTH}", y = self.y(*lpm));
        html! {
            svg .course viewBox={ "0 0 " (WIDTH) " " (HEIGHT) } role="img" aria-label=(self.label(cylinder)) {
                path .axis d=(format!("M0 {y:.1}H{WIDTH}", y = self.y(0.0))) {}
                path .limit d=(self.thresholds_lpm.iter().map(level).collect::<String>()) {}
                @for leak in Leak::ALL { (self.line(leak, &rows)) }
            }
        }
    }

    fn rows(&self, cylinder: &FleetCylinder, report: &FleetReport<'_>) -> Vec<Row<3>> {
        let mut points = Envelopes::<3>::of_at_most(MOST_POINTS);
        for (number, row) in traces(cylinder, report).enumerate() {
            let t = self.from_s.zip(begin_s(row)).map_or(number as f64, |(from, begin)| begin - from);
            points.add(t, &Leak::ALL.map(|leak| row.pinned(leak).map(spot)));
        }
        points.rows()
    }

    fn line(&self, leak: Leak, rows: &[Row<3>]) -> Markup {
        let (mut line, mut dots, mut intervals) = (String::new(), String::new(), String::new());
        for row in rows {
            let Some(range) = row.ranges.get(leak as usize).copied().flatten() else { continue };
            let [x, y, low, high] =
                [self.x(row.t_s), self.y(range.median), self.y(range.low), self.y(range.high)];
            let _ = write!(line, "{}{x:.1} {y:.1}", if line.is_empty() { 'M' } else { 'L' });
            let _ = write!(dots, "M{x:.1} {y:.1}h0");
            let _ = write!(intervals, "M{x:.1} {low:.1}V{high:.1}");
        }
        html! {
            g class=(ink(leak).class()) { path .interval d=(intervals) {} path .line d=(line) {} path .dots d=(dots) {} }
        }
    }

    fn label(&self, cylinder: &FleetCylinder) -> String {
        let span = self.from_s.map_or_else(
            || format!("{} traces", cylinder.traces),
            |_| format!("{:.0} days", (self.length / S_PER_DAY).ceil()),
        );
        format!("Leaks over {span}, from 0 to {:.2} L/min", self.top_lpm)
    }
}

fn spot(found: FleetLeak) -> Spot {
    let [low, high] = found.ci95.unwrap_or([found.mean_lpm; 2]);
    Spot { low, value: found.mean_lpm, high }
}

fn traces<'a>(cylinder: &'a FleetCylinder, report: &FleetReport<'a>) -> impl Iterator<Item = &'a FleetRow> {
    let rows = report.rows;
    cylinder.rows.iter().filter_map(|place| rows.get(*place)).filter(|row| row.error.is_none())
}

fn begin_s(row: &FleetRow) -> Option<f64> {
    row.begins.map(|begins| begins.as_millisecond() as f64 / 1e3)
}
