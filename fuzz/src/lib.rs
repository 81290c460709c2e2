//! Every door by which something comes in, and what is asked of the answer: numbers, or a typed error.
//!
//! Also a part of `tests/doors.rs`, which takes the seeds through each door on every run of the tests.

mod checkpoint;
mod columns;
mod diagnose;
mod effects;
mod followed;
mod inspect;
mod lines;
mod mat;
mod messages;
mod openfast;
mod paper;
mod parquet;
mod rig;
mod scratch;
mod simulate;
mod state;
mod trace;

use pitchleak::Rig;
use pitchleak::live::{Event, LiveLeakage, OutputFormat};
use pitchleak::replay::{ReplayError, replay};
use pitchleak::report::ReplayReport;
use pitchleak::trace::TraceReader;
use pitchleak_view::{Palette, Text};
use std::fmt::Write;
use std::io::Cursor;

/// A way in: any bytes are taken or refused.
pub type Door = fn(&[u8]);

/// All, by the names of their folders in `seeds`.
pub const DOORS: [(&str, Door); 16] = [
    ("trace", trace::enter),
    ("parquet", parquet::enter),
    ("mat", mat::enter),
    ("inspect", inspect::enter),
    ("paper", paper::enter),
    ("rig", rig::enter),
    ("effects", effects::enter),
    ("columns", columns::enter),
    ("state", state::enter),
    ("lines", lines::enter),
    ("messages", messages::enter),
    ("checkpoint", checkpoint::enter),
    ("diagnose", diagnose::enter),
    ("simulate", simulate::enter),
    ("followed", followed::enter),
    ("openfast", openfast::enter),
];

/// A report holds numbers only.
///
/// # Panics
/// Where it doesn't.
pub fn assert_numbers(report: &ReplayReport) {
    for (leak, entry) in report.estimates.leaks().iter() {
        assert!(entry.value.is_finite(), "{leak:?} {}", entry.value);
        assert!(entry.std.is_none_or(f64::is_finite), "{leak:?} {:?}", entry.std);
        let flow = report.leakage[leak];
        assert!(flow.mean_lpm.is_finite() && flow.std_lpm.is_none_or(f64::is_finite), "{leak:?} {flow:?}");
    }
    assert!(report.estimates.bulk_modulus.value.is_finite());
    for text in [report.to_json().expect("a report has a JSON form"), report.to_text(&Palette::PLAIN)] {
        assert!(!text.contains("NaN") && !text.contains("Infinity"), "{text}");
    }
}

/// What a watch says holds numbers only, and is one line in either format.
///
/// # Panics
/// Where it doesn't.
pub fn assert_told(events: &[Event]) {
    let flow = |flow: LiveLeakage| flow.mean_lpm.is_finite() && flow.std_lpm.is_none_or(f64::is_finite);
    for event in events {
        let finite = match event {
            Event::Estimate(event) => {
                let trend = |leak| event.trend[leak].is_none_or(|trend| trend.slope_lpm_per_h.is_finite());
                event.t_s.is_finite() && event.leakage.iter().all(|(leak, size)| flow(*size) && trend(leak))
            }
            Event::Alarm(event) => event.t_s.is_finite() && flow(event.leakage),
            Event::Summary(event) => event.leakage.iter().all(|(_, leak)| {
                let trend = leak.trend_lpm_per_day.is_none_or(|trend| trend.slope.is_finite());
                let size = LiveLeakage { mean_lpm: leak.mean_lpm, std_lpm: leak.std_lpm };
                trend && flow(size) && leak.max_lpm.is_finite() && (0.0..=1.0).contains(&leak.alarm_share)
            }),
            Event::Hold(event) => {
                event.leakage.iter().all(|(_, size)| flow(*size)) && event.hold.usable_s >= 0.0
            }
            Event::Notice(event) => event.t_s.is_none_or(f64::is_finite),
        };
        assert!(finite, "{event:?}");
        for format in [OutputFormat::Ndjson, OutputFormat::Influx] {
            let line = event.line(format).expect("an event is a line");
            assert!(!line.contains('\n'), "{line}");
        }
    }
}

/// Replays any bytes as a trace.
///
/// # Panics
/// Where the report holds what is no number.
pub fn replay_bytes(bytes: &[u8], rig: &Rig) {
    let stream = Box::new(Cursor::new(bytes.to_vec()));
    let Ok(mut reader) = TraceReader::from_stream("fuzz", stream, rig) else { return };
    if let Ok(report) = replay(&mut reader, rig, |_, _, _| Ok::<(), ReplayError>(())) {
        assert_numbers(&report);
    }
}

/// A trace of a leaking cylinder, 100 Hz, as a file; rows from `from` on.
pub fn trace_text(from: usize, rows: usize) -> String {
    let mut text = String::from("t_s,x_m,pa_pa,pb_pa,qa_m3s,qb_m3s,force_n\n");
    for k in from..from + rows {
        let t = k as f64 * 0.01;
        let x = 0.1 + 0.05 * (0.7 * t).sin();
        let v = 0.035 * (0.7 * t).cos();
        let (pa, pb) = (5e6 + 1e6 * (1.3 * t).sin(), 4e6 + 8e5 * (1.9 * t).cos());
        let leak = 1.2e-11 * (pa - pb);
        let (qa, qb) = (1.26e-3 * v + leak, -0.94e-3 * v - leak);
        let _ = writeln!(
            text,
            "{t:.2},{x:.6},{pa:.1},{pb:.1},{qa:.9e},{qb:.9e},{:.3}",
            1.26e-3 * pa - 0.94e-3 * pb
        );
    }
    text
}

/// Numbers and choices out of bytes.
pub struct Dice<'a>(pub &'a [u8]);

impl Dice<'_> {
    /// The next byte, zero at the end.
    pub fn byte(&mut self) -> u8 {
        let Some((first, rest)) = self.0.split_first() else { return 0 };
        self.0 = rest;
        *first
    }

    /// Any number, more often one that could be.
    pub fn number(&mut self) -> f64 {
        let kind = self.byte();
        let mut bits = [0; 8];
        bits.iter_mut().for_each(|byte| *byte = self.byte());
        let any = f64::from_bits(u64::from_le_bytes(bits));
        match kind % 4 {
            0 => any,
            1 => f64::from(kind) * 10f64.powi(i32::from(bits[0] as i8) % 40),
            2 => f64::from(bits[0]) * 0.01,
            _ => f64::from_bits(u64::from_le_bytes(bits) % (2 << 52) + (1020 << 52)),
        }
    }
}
