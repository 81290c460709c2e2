//! The sign of a flow whose size alone was recorded, by the piston's motion.

use super::readings::Readings;
use crate::rig::{Instrument, Rig};
use crate::signal::Signal;
use crate::trace::Record;

/// Speed is the position's slope over this time on both sides, s.
const HALF_WINDOW_S: f64 = 0.2;
/// A flow's sign is certain where the piston's own flow is this many standard deviations of it and of the meter, …
const SIGMAS: f64 = 4.0;
/// … and more than any leak that is worth a thought, share of the meter's full scale.
const LEAK_SHARE: f64 = 0.04;

/// The records with signs put to the flows of `readings`; a flow is left out where the piston is too slow to say.
pub(super) fn restored(records: &[Record], readings: Readings, rig: &Rig) -> Vec<Record> {
    let sensors = rig.sensors();
    let (cylinder, sheets) = (&rig.cylinder, &rig.instruments);
    let mut out = Vec::with_capacity(records.len());
    for piece in records.chunk_by(|_, next| !next.after_gap) {
        let span_s = piece.last().map_or(0.0, |last| last.t_s) - piece.first().map_or(0.0, |first| first.t_s);
        let step_s = span_s / (piece.len().max(2) - 1) as f64;
        let half = ((HALF_WINDOW_S / step_s) as usize).clamp(1, piece.len().max(2) / 2);
        let speed_std = sensors.position.noise_std * std::f64::consts::SQRT_2
            / ((half as f64).sqrt() * (half as f64 + 1.0) * step_s);
        for (at, record) in piece.iter().enumerate() {
            let speed = speed_mps(piece, at, half);
            let mut record = *record;
            let sample = &mut record.sample;
            for (signal, flow, area, floor) in [
                (Signal::FlowA, &mut sample.qa_m3s, cylinder.area_a_m2, floor_m3s(&sheets.flow_a)),
                (Signal::FlowB, &mut sample.qb_m3s, -cylinder.area_b_m2, floor_m3s(&sheets.flow_b)),
            ] {
                if readings.signals().contains(&signal) {
                    let own = area * speed;
                    let sure = own.abs() > floor + SIGMAS * area.abs() * speed_std;
                    *flow = flow.filter(|_| sure).map(|size| size * own.signum());
                }
            }
            out.push(record);
        }
    }
    out
}

/// Flow below which noise or a leak may turn its sign.
fn floor_m3s(sheet: &Instrument) -> f64 {
    SIGMAS * sheet.spread().noise_std + LEAK_SHARE * sheet.full_scale
}

/// Mean position of the window after the record less that before it, over the time between their middles.
fn speed_mps(piece: &[Record], at: usize, half: usize) -> f64 {
    let mean = |records: &[Record]| {
        let (t, x) = records.iter().fold((0.0, 0.0), |(t, x), r| (t + r.t_s, x + r.sample.x_m));
        (t / records.len() as f64, x / records.len() as f64)
    };
    let before = piece.get(at.saturating_sub(half)..=at).unwrap_or_default();
    let after = piece.get(at..(at + half + 1).min(piece.len())).unwrap_or_default();
    let ((t0, x0), (t1, x1)) = (mean(before), mean(after));
    if t1 > t0 { (x1 - x0) / (t1 - t0) } else { 0.0 }
}
