//! What a reader noticed about a trace.

use super::error::{BadReason, BadRow};
use super::row::Record;
use crate::units::duration;
use pitchleak_core::Sample;

/// How many bad rows are kept with their place.
const KEPT: usize = 5;

/// What a reader noticed so far; whole once [`next_record`](super::TraceReader::next_record) has
/// given its last.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct TraceQuality {
    /// Good rows.
    pub rows: u64,
    /// Bad rows, skipped.
    pub skipped: u64,
    /// The bad rows by reason.
    pub reasons: std::collections::BTreeMap<BadReason, u64>,
    /// The first few bad rows.
    pub first_bad: Vec<BadRow>,
    /// Pauses much longer than the usual step.
    pub gaps: u64,
    /// The longest of them, s.
    pub longest_gap_s: f64,
    /// All of them together, s.
    pub gap_time_s: f64,
    /// How often the time began anew further back.
    pub clock_restarts: u64,
    /// From the first to the last good row, s.
    pub duration_s: f64,
    /// Rows without Q_A and without Q_B.
    pub flow_rests: [u64; 2],
    /// Columns that no signal is read from.
    pub ignored_columns: Vec<String>,
    /// How the file was read, where it is not as this program writes one.
    #[serde(default)]
    pub reading: Option<String>,
    /// Mapped columns that the header does not have.
    pub absent_columns: Vec<String>,
    /// Why the rest of a broken stream was not read.
    pub cut_off: Option<String>,
    /// Time of the first row, or of the first after the clock's last restart.
    pub(super) first_s: f64,
    pub(super) before_restart_s: f64,
    pub(super) regular_steps: u64,
    pub(super) regular_time_s: f64,
}

impl TraceQuality {
    /// Samples per second where they come regularly; none for a trace of one row.
    pub fn sample_rate_hz(&self) -> Option<f64> {
        (self.regular_steps > 0).then(|| self.regular_steps as f64 / self.regular_time_s)
    }

    /// The same of the flow that is read most seldom, of those that are read at all.
    pub fn slowest_hz(&self) -> Option<f64> {
        let share = |rests: u64| (self.rows - rests) as f64 / self.rows as f64;
        let least = self.flow_rests.into_iter().map(share).filter(|share| *share > 0.0).fold(1.0, f64::min);
        self.sample_rate_hz().map(|rate_hz| least * rate_hz)
    }

    /// Whether most bad rows go back in time.
    pub fn is_out_of_order(&self) -> bool {
        2 * self.reasons.get(&BadReason::TimeBack).copied().unwrap_or(0) > self.skipped
    }

    /// Whether more rows are bad than good.
    pub fn is_mostly_bad(&self) -> bool {
        self.skipped > self.rows
    }

    /// One line each on what a reader of results should know.
    pub fn warnings(&self) -> Vec<String> {
        let mut warnings = Vec::new();
        if self.skipped > 0 {
            warnings.push(self.skipped_text());
        }
        warnings.extend(self.cut_off.as_ref().map(|why| format!("{why}: the rows before are used")));
        if self.clock_restarts > 0 {
            warnings.push(format!("the clock was set back ({} times)", self.clock_restarts));
        }
        if self.gaps > 0 {
            let longest = match self.longest_gap_s {
                short_s if short_s < 120.0 => format!("{short_s:.3} s"),
                long_s => duration(long_s),
            };
            warnings.push(match self.gaps {
                1 => format!("1 gap in time, {longest}"),
                gaps => format!("{gaps} gaps in time, the longest {longest}"),
            });
        }
        if !self.absent_columns.is_empty() {
            warnings.push(format!("mapped but not in the trace: {}", self.absent_columns.join(", ")));
        }
        if !self.ignored_columns.is_empty() {
            warnings.push(format!("columns ignored: {}", self.ignored_columns.join(", ")));
        }
        warnings
    }

    fn skipped_text(&self) -> String {
        let reasons: Vec<_> =
            self.reasons.iter().map(|(reason, count)| format!("{count} {}", reason.text())).collect();
        let total = self.rows + self.skipped;
        let mut text = format!("{} of {total} rows skipped ({})", self.skipped, reasons.join(", "));
        for (index, bad) in self.first_bad.iter().enumerate() {
            text.push_str(if index == 0 { ": " } else { "; " });
            text.push_str(&bad.to_string());
        }
        if self.skipped > self.first_bad.len() as u64 {
            text.push_str("; …");
        }
        text
    }

    pub(super) fn count_bad(&mut self, bad: BadRow) {
        self.skipped += 1;
        *self.reasons.entry(bad.reason).or_default() += 1;
        if self.first_bad.len() < KEPT {
            self.first_bad.push(bad);
        }
    }

    #[inline]
    pub(super) fn count_step(&mut self, dt_s: f64, regular: bool, gap: bool) {
        if regular {
            self.regular_steps += 1;
            self.regular_time_s += dt_s;
        }
        if gap {
            self.gaps += 1;
            self.gap_time_s += dt_s;
            self.longest_gap_s = self.longest_gap_s.max(dt_s);
        }
    }

    /// The time counts from `t_s` on: at the first row, and where the clock was set back.
    #[cold]
    pub(super) fn count_from(&mut self, t_s: f64) {
        self.before_restart_s = self.duration_s;
        self.first_s = t_s;
    }

    #[inline]
    pub(super) fn count_row(&mut self, record: &Record) {
        self.rows += 1;
        self.duration_s = self.before_restart_s + (record.t_s - self.first_s);
        let Sample { qa_m3s, qb_m3s, .. } = record.sample;
        let [a, b] = &mut self.flow_rests;
        *a += u64::from(qa_m3s.is_none());
        *b += u64::from(qb_m3s.is_none());
    }
}
