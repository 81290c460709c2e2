//! What a terminal can show beside the text: the worst leak of each line against its alarm level, and the course of each
//! leak that grows.

use crate::Palette;
use crate::bar::{Bar, INTERVAL, LIMIT, VALUE, scale, scale_text};
use crate::envelope::{Envelopes, Spot};
use crate::spark::course;
use pitchleak::core::Leak;
use pitchleak::fleet::{FleetCylinder, FleetReport, Point};

/// Cells of a bar or a course.
pub(super) const CELLS: usize = 20;

/// The bars of some lines, on one scale.
pub(super) struct Bars {
    ends: [f64; 2],
}

impl Bars {
    /// None where no line tells of a leak.
    pub(super) fn of(cylinders: &[&FleetCylinder]) -> Option<Self> {
        let bars: Vec<Bar> = cylinders.iter().filter_map(|cylinder| bar(cylinder)).collect();
        scale(&bars).map(|ends| Self { ends })
    }

    /// What the bars show.
    pub(super) fn legend(&self, palette: &Palette) -> String {
        let (faint, reset) = palette.faint();
        let scale = scale_text(self.ends);
        format!(
            "{faint}{:<10}{scale:<CELLS$}  {VALUE} largest leak  {INTERVAL} 95 %  {LIMIT} alarm level{reset}\n",
            ""
        )
    }

    /// Blank where the cylinder has no leak to act on.
    pub(super) fn text(&self, cylinder: &FleetCylinder) -> String {
        let text = bar(cylinder).map_or_else(String::new, |bar| bar.text(self.ends, CELLS));
        format!("{text:<CELLS$}  ")
    }
}

/// Of the largest leak to act on.
fn bar(cylinder: &FleetCylinder) -> Option<Bar> {
    let leaks = cylinder.faults.iter().filter_map(|leak| cylinder.leaks[*leak].flow);
    let worst = leaks.max_by(|a, b| a.mean_lpm.total_cmp(&b.mean_lpm))?;
    let value = worst.mean_lpm;
    Some(Bar {
        interval: worst.ci95.unwrap_or([value; 2]),
        value: (value, VALUE),
        limit: worst.threshold_lpm,
    })
}

/// A leak over a cylinder's traces, from none to the largest flow or the alarm level, whichever is more.
pub(super) fn course_of(report: &FleetReport<'_>, cylinder: &str, leak: Leak) -> String {
    let own = report.rows.iter().filter(|row| row.cylinder == cylinder);
    let mut points: Vec<Point> = own.filter_map(|row| Point::of(row, leak)).collect();
    points.sort_by_key(|point| point.at);
    let Some(first) = points.first().map(|point| point.at) else { return String::new() };
    let top = points.iter().map(|point| point.flow.value.max(point.threshold_lpm)).fold(0.0, f64::max);
    let mut flows = Envelopes::<1>::default();
    for point in &points {
        let t_s = first.duration_until(point.at).as_secs_f64();
        flows.add(t_s, &[Some(Spot::at(point.flow.value))]);
    }
    let [flows] = flows.courses(CELLS);
    course(&flows, [0.0, top])
}
