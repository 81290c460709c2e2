//! What was found of a fleet.

use super::{Beside, CylinderLeak, CylinderTrend, FleetCylinder, FleetOdds, FleetRow, LongTrend};
use crate::report::Status;
use pitchleak_core::Leak;
use serde::Serialize;

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
    /// Cylinders by how they are now.
    pub cylinder_counts: Counts,
    /// What the traces of each cylinder say together, the worst first.
    pub by_cylinder: Vec<FleetCylinder>,
    /// How leaks change over the traces of a cylinder, where there are three or more with dates.
    pub trends: Vec<CylinderTrend>,
    /// How often explanations are true in this fleet; where asked for.
    pub odds: Option<FleetOdds>,
    /// A row per cylinder and trace.
    pub rows: &'a [FleetRow],
}

/// Traces, or cylinders, by what was found.
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
    /// The trace, or no trace of the cylinder, could be judged.
    pub error: usize,
}

impl Counts {
    /// Counts verdicts; none is an error.
    pub fn of(verdicts: impl IntoIterator<Item = Option<Status>>) -> Self {
        let mut counts = Self::default();
        for status in verdicts {
            *match status {
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
        let by_cylinder = FleetCylinder::all(rows);
        Self {
            schema: Self::SCHEMA,
            traces: rows.len(),
            cylinders: by_cylinder.len(),
            counts: Counts::of(rows.iter().map(|row| row.status)),
            cylinder_counts: Counts::of(by_cylinder.iter().map(|cylinder| cylinder.status)),
            trends: CylinderTrend::all(&by_cylinder),
            by_cylinder,
            odds: None,
            rows,
        }
    }

    /// With the odds that its traces teach.
    #[must_use]
    pub fn with_odds(self) -> Self {
        Self { odds: Some(FleetOdds::learn(self.rows)), ..self }
    }

    /// JSON.
    ///
    /// # Errors
    /// None in practice: every field has a JSON form.
    pub fn to_json(&self) -> Result<String, serde_json::Error> {
        serde_json::to_string_pretty(self)
    }

    /// The cylinders that ask for somebody, the worst first.
    pub fn worst(&self) -> impl Iterator<Item = &FleetCylinder> {
        self.by_cylinder.iter().filter(|cylinder| cylinder.status != Some(Status::Sound))
    }

    /// The traces that could not be judged.
    pub fn failed(&self) -> impl Iterator<Item = &'a FleetRow> {
        self.rows.iter().filter(|row| row.error.is_some())
    }

    /// The leaks that differ from those of the cylinder's siblings and do not stand, the surest first.
    pub fn differing(&self) -> Vec<(&FleetCylinder, Leak, &Beside)> {
        let mut differing = self.leaks(CylinderLeak::differing);
        differing.sort_by(|(_, _, a), (_, _, b)| a.p_value.total_cmp(&b.p_value));
        differing
    }

    /// The leaks that grow from trace to trace beyond doubt, the fastest first, with their cylinders.
    pub fn growing(&self) -> Vec<(&str, Leak, &LongTrend)> {
        let mut growing = self.leaks(|of| of.trend.as_ref().filter(|long| long.grows()));
        growing.sort_by(|(_, _, a), (_, _, b)| b.trend.slope_lpm_per_h.total_cmp(&a.trend.slope_lpm_per_h));
        growing.into_iter().map(|(one, leak, long)| (one.cylinder.as_str(), leak, long)).collect()
    }

    /// What is told of some leaks, with their cylinders.
    fn leaks<'r, T>(
        &'r self,
        told: impl Fn(&'r CylinderLeak) -> Option<&'r T>,
    ) -> Vec<(&'r FleetCylinder, Leak, &'r T)> {
        let of_one = |cylinder: &'r FleetCylinder| {
            Leak::ALL.map(|leak| Some((cylinder, leak, told(&cylinder.leaks[leak])?)))
        };
        self.by_cylinder.iter().flat_map(of_one).flatten().collect()
    }
}

/// With an `s` behind many.
pub fn count(number: usize, what: &str) -> String {
    format!("{number} {what}{}", if number == 1 { "" } else { "s" })
}
