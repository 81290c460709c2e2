//! What was found of a fleet, and in which order it asks for somebody.

use super::{CylinderTrend, FleetRow, LongTrend};
use crate::report::Status;
use pitchleak_core::Leak;
use serde::Serialize;
use std::collections::HashSet;

/// What was found of a fleet, as `fleet --json` prints it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FleetReport<'a> {
    /// `pitchleak.fleet/1`.
    pub schema: &'static str,
    /// Traces.
    pub traces: usize,
    /// Cylinders.
    pub cylinders: usize,
    /// Traces by what was found.
    pub counts: Counts,
    /// How leaks change over the traces of a cylinder, where there are three or more with dates.
    pub trends: Vec<CylinderTrend>,
    /// A row per cylinder and trace.
    pub rows: &'a [FleetRow],
}

/// Traces by what was found.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Counts {
    /// Oil leaks.
    pub leak: usize,
    /// Nothing leaks.
    pub sound: usize,
    /// Something contradicts the model or the sensors.
    pub doubtful: usize,
    /// The trace says too little.
    pub not_sure: usize,
    /// The trace could not be judged.
    pub error: usize,
}

impl Counts {
    /// Counts rows.
    pub fn of<'a>(rows: impl IntoIterator<Item = &'a FleetRow>) -> Self {
        let mut counts = Self::default();
        for row in rows {
            *match row.status {
                Some(Status::Leak) => &mut counts.leak,
                Some(Status::Sound) => &mut counts.sound,
                Some(Status::Doubtful) => &mut counts.doubtful,
                Some(Status::NotSure) => &mut counts.not_sure,
                None => &mut counts.error,
            } += 1;
        }
        counts
    }
}

impl<'a> FleetReport<'a> {
    /// Name and version of the JSON form.
    pub const SCHEMA: &'static str = "pitchleak.fleet/1";

    /// The report on `rows`.
    pub fn of(rows: &'a [FleetRow]) -> Self {
        let counts = Counts::of(rows);
        let cylinders = rows.iter().map(|row| row.cylinder.as_str()).collect::<HashSet<_>>().len();
        Self {
            schema: Self::SCHEMA,
            traces: rows.len(),
            cylinders,
            counts,
            trends: CylinderTrend::all(rows),
            rows,
        }
    }

    /// JSON.
    ///
    /// # Errors
    /// None in practice: every field has a JSON form.
    pub fn to_json(&self) -> Result<String, serde_json::Error> {
        serde_json::to_string_pretty(self)
    }

    /// The traces that ask for somebody, the worst first.
    pub fn worst(&self) -> Vec<&'a FleetRow> {
        let urgency = |row: &FleetRow| match row.status {
            Some(Status::Leak) => 0,
            Some(Status::Doubtful) => 1,
            Some(Status::NotSure) => 2,
            None => 3,
            Some(Status::Sound) => 4,
        };
        let mut worst: Vec<_> = self.rows.iter().filter(|row| row.status != Some(Status::Sound)).collect();
        worst.sort_by(|a, b| urgency(a).cmp(&urgency(b)).then(b.worst_lpm().total_cmp(&a.worst_lpm())));
        worst
    }

    /// The leaks that grow from trace to trace beyond doubt, the fastest first, with their cylinders.
    pub fn growing(&self) -> Vec<(&str, Leak, &LongTrend)> {
        let mut growing = Vec::new();
        for CylinderTrend { cylinder, leaks } in &self.trends {
            let known = leaks.iter().filter_map(|(leak, long)| Some((leak, long.as_ref()?)));
            let grows = known.filter(|(_, long)| long.grows());
            growing.extend(grows.map(|(leak, long)| (cylinder.as_str(), leak, long)));
        }
        growing.sort_by(|(_, _, a), (_, _, b)| b.trend.slope_lpm_per_h.total_cmp(&a.trend.slope_lpm_per_h));
        growing
    }
}

/// With an `s` behind many.
pub fn count(number: usize, what: &str) -> String {
    format!("{number} {what}{}", if number == 1 { "" } else { "s" })
}
