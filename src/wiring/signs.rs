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
/// A lost sign: the variance of the readings about the piston's own flow over that about its size, with so many readings
/// in motion each way.
const CLOSER: f64 = 10.0;
const LEAST_MOVING: usize = 30;
/// Leaks into or out of a chamber that are tried, on either side of none.
const LEAK_STEPS: i32 = 10;

/// A flow as the piston's motion gives it.
#[derive(Clone, Copy)]
struct Own {
    flow_m3s: f64,
    /// Whether it is more than noise …
    moves: bool,
    /// … and than the reading's noise and any leak, which may turn the reading's sign.
    sure: bool,
}

/// The piston's own flows into both chambers, record by record.
fn own_flows(records: &[Record], rig: &Rig) -> Vec<[Own; 2]> {
    let position_std_m = rig.sensors().position.noise_std;
    let chambers = [
        (rig.cylinder.area_a_m2, floor_m3s(&rig.instruments.flow_a)),
        (-rig.cylinder.area_b_m2, floor_m3s(&rig.instruments.flow_b)),
    ];
    let mut out = Vec::with_capacity(records.len());
    for piece in records.chunk_by(|_, next| !next.after_gap) {
        let span_s = piece.last().map_or(0.0, |last| last.t_s) - piece.first().map_or(0.0, |first| first.t_s);
        let step_s = span_s / (piece.len().max(2) - 1) as f64;
        let half = ((HALF_WINDOW_S / step_s) as usize).clamp(1, piece.len().max(2) / 2);
        let speed_std =
            position_std_m * std::f64::consts::SQRT_2 / ((half as f64).sqrt() * (half as f64 + 1.0) * step_s);
        out.extend((0..piece.len()).map(|at| {
            let speed = speed_mps(piece, at, half);
            chambers.map(|(area, floor)| {
                let flow_m3s = area * speed;
                let noise = SIGMAS * area.abs() * speed_std;
                Own { flow_m3s, moves: flow_m3s.abs() > noise, sure: flow_m3s.abs() > floor + noise }
            })
        }));
    }
    out
}

/// The records with signs put to the flows of `readings`; a flow is left out where the piston is too slow to say.
pub(super) fn restored(records: &[Record], readings: Readings, rig: &Rig) -> Vec<Record> {
    let wanted = |signal| readings.signals().contains(&signal);
    let put =
        |size: Option<f64>, own: Own| size.filter(|_| own.sure).map(|size| size * own.flow_m3s.signum());
    let one = |(record, [a, b]): (&Record, [Own; 2])| {
        let mut record = *record;
        let sample = &mut record.sample;
        if wanted(Signal::FlowA) {
            sample.qa_m3s = put(sample.qa_m3s, a);
        }
        if wanted(Signal::FlowB) {
            sample.qb_m3s = put(sample.qb_m3s, b);
        }
        record
    };
    records.iter().zip(own_flows(records, rig)).map(one).collect()
}

/// A flow's reading, the piston's own flow then, and P_L over its mean size.
struct Reading {
    flow_m3s: f64,
    own: Own,
    load: f64,
}

/// The flows that lost their sign: never negative, although the piston moves both ways, and the size of its own flow with
/// some leak's follows them far closer than its own flow; the likeliest first. With the number of readings that would be
/// negative for sure.
pub(super) fn lost(records: &[Record], rig: &Rig) -> Option<(Vec<Readings>, usize)> {
    let own = own_flows(records, rig);
    let load_pa = |r: &Record| r.sample.pa_pa - r.sample.pb_pa;
    let mean_pa = records.iter().map(|r| load_pa(r).abs()).sum::<f64>() / records.len().max(1) as f64;
    let readings = |chamber: usize, flow: fn(&Record) -> Option<f64>| {
        let read = |(r, own): (&Record, &[Own; 2])| {
            Some(Reading { flow_m3s: flow(r)?, own: own[chamber], load: load_pa(r) / mean_pa.max(1.0) })
        };
        records.iter().zip(&own).filter_map(read).collect::<Vec<_>>()
    };
    let (a, b) = (readings(0, |r| r.sample.qa_m3s), readings(1, |r| r.sample.qb_m3s));
    let (lost_a, lost_b) = (turned(&a, &rig.instruments.flow_a), turned(&b, &rig.instruments.flow_b));
    let one = |lost, other: &[Reading]| {
        if goes_both_ways_unsigned(other) { vec![lost, Readings::Flows] } else { vec![lost] }
    };
    match (lost_a, lost_b) {
        (Some(a), Some(b)) => Some((vec![Readings::Flows], a.max(b))),
        (Some(turned), None) => Some((one(Readings::FlowA, &b), turned)),
        (None, Some(turned)) => Some((one(Readings::FlowB, &a), turned)),
        (None, None) => None,
    }
}

/// Never negative although the piston moves both ways.
fn goes_both_ways_unsigned(readings: &[Reading]) -> bool {
    let unsigned = readings.iter().all(|r| r.flow_m3s >= 0.0);
    unsigned && moving(readings, false).min(moving(readings, true)) >= LEAST_MOVING
}

/// Readings in whose time the piston's own flow is of this sign for sure.
fn moving(readings: &[Reading], negative: bool) -> usize {
    readings.iter().filter(|r| r.own.moves && (r.own.flow_m3s < 0.0) == negative).count()
}

/// How many readings would be negative with their sign; `None` where it was not lost.
fn turned(readings: &[Reading], sheet: &Instrument) -> Option<usize> {
    if !goes_both_ways_unsigned(readings) {
        return None;
    }
    let signed = variance(readings.iter().map(|r| r.flow_m3s - r.own.flow_m3s));
    let leaks = (-LEAK_STEPS..=LEAK_STEPS)
        .map(|at| LEAK_SHARE * sheet.full_scale * f64::from(at) / f64::from(LEAK_STEPS));
    // Out of the chamber at a steady pressure, or past the piston.
    let sizes = leaks.flat_map(|leak| {
        [|_: f64| 1.0, |load: f64| load].map(|shape| {
            variance(readings.iter().map(|r| r.flow_m3s - (r.own.flow_m3s + leak * shape(r.load)).abs()))
        })
    });
    (signed > CLOSER * sizes.fold(f64::MAX, f64::min)).then(|| moving(readings, true))
}

/// About the mean.
fn variance(values: impl Iterator<Item = f64>) -> f64 {
    let (count, sum, squares) = values
        .fold((0.0, 0.0, 0.0), |(n, sum, squares), value| (n + 1.0, sum + value, squares + value * value));
    let mean = sum / count;
    squares / count - mean * mean
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
