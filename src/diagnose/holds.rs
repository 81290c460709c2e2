//! An independent check: the leak found in motion against what leaves a chamber while the piston stands under
//! pressure. There speed, drag and friction have no say, and most sensor errors none either.

use super::fit::Fit;
use super::rows::{Balance, Row};
use super::select::Named;
use super::series::Series;
use super::term::Term;
use super::{Declared, Progress, adequacy, declared_fit};
use pitchleak_core::Sensors;
use serde::Serialize;
use std::ops::Range;

/// A hold lasts so long, s.
const HOLD_S: f64 = 1.0;
/// Pieces of a hold whose mean positions are compared.
const PIECES: usize = 10;
/// The piston stands while those means stay within this share of what it travels elsewhere in the trace in the
/// same time (under load it creeps by what leaks), of the stroke, or within their noise.
const STILL_SHARE_OF_TRAVEL: f64 = 0.05;
const STILL_SHARE_OF_STROKE: f64 = 1e-4;
const STILL_SIGMA: f64 = 6.0;
/// Below this a chamber is not under pressure, Pa gauge.
const LEAST_PRESSURE_PA: f64 = 1e6;
/// Fewer holds than this are no check.
const FEWEST: usize = 3;
/// Between holds that are cut out, s.
const APART_S: f64 = 1e3;

/// Leak flows at rest and as predicted from motion; none for a chamber that was never held under pressure.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Holds {
    /// Out of chamber A.
    pub chamber_a: Option<HoldLeak>,
    /// Out of chamber B.
    pub chamber_b: Option<HoldLeak>,
}

/// Flow that leaves one chamber, to the outside or past the piston, while the piston stands.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct HoldLeak {
    /// Holds of 1 s.
    pub count: usize,
    /// Mean pressure in them, Pa.
    pub mean_pressure_pa: f64,
    /// Mean leak flow, m³/s.
    pub leak_m3s: f64,
    /// Its standard deviation, m³/s: the larger of sensor noise and scatter between holds, and the declared bias
    /// and gain of the flow meter.
    pub std_m3s: f64,
    /// The same flow from the declared model, fitted to what moves.
    pub predicted_before_m3s: f64,
    /// Its standard deviation, m³/s.
    pub predicted_before_std_m3s: f64,
    /// The same with the effects found.
    pub predicted_after_m3s: f64,
    /// Its standard deviation, m³/s.
    pub predicted_after_std_m3s: f64,
}

impl HoldLeak {
    /// How far flow at rest and prediction are apart in standard deviations, before and after.
    pub fn apart_sigma(&self) -> [f64; 2] {
        let apart = |value: f64, std: f64| (self.leak_m3s - value).abs() / self.std_m3s.hypot(std);
        [
            apart(self.predicted_before_m3s, self.predicted_before_std_m3s),
            apart(self.predicted_after_m3s, self.predicted_after_std_m3s),
        ]
    }
}

/// The check on the holds of `judged`, with the models fitted to what moves in `train`; `None` without holds.
pub(super) fn check(
    fit: &Fit<'_>,
    named: &[Named],
    (train, judged): (&[Series], &[Series]),
    declared: &Declared,
    checks: &[adequacy::SensorCheck],
    progress: Progress<'_>,
) -> Option<Holds> {
    let held: Vec<Series> = judged.iter().map(|series| cut(series, &rests(series, declared))).collect();
    let held = Held::of(fit, &held, &declared.sensors);
    if held.iter().all(Option::is_none) {
        return None;
    }
    let moving: Vec<Series> = train.iter().map(|series| without(series, &rests(series, declared))).collect();
    let before = declared_fit(&moving, declared, checks, progress);
    let mut after = declared_fit(&moving, declared, checks, progress);
    for one in named {
        after.reshape(one.term, fit.shapes[one.term]);
        after.active.push(one.term);
    }
    after.refit(progress);
    let compare = |held: Option<Held>| held.map(|held| held.compare(&before, &after));
    let [chamber_a, chamber_b] = held.map(compare);
    Some(Holds { chamber_a, chamber_b })
}

/// Stretches of one hold's length in which the piston stands.
fn rests(series: &Series, declared: &Declared) -> Vec<Range<usize>> {
    let step_s = series.step_s();
    let length = (HOLD_S / step_s.max(1e-9)).round() as usize;
    let piece = length / PIECES;
    if piece == 0 {
        return vec![];
    }
    let travel_m = |window: &Range<usize>| {
        let means = series.x_m[window.clone()].chunks(piece).map(|x| x.iter().sum::<f64>() / x.len() as f64);
        let (low, high) = means.fold((f64::MAX, f64::MIN), |(low, high), x| (low.min(x), high.max(x)));
        high - low
    };
    let windows = series.stretches().into_iter().flat_map(|stretch| {
        let starts = stretch.clone().step_by(length);
        starts.map(move |start| start..start + length).filter(move |window| window.end <= stretch.end)
    });
    let windows: Vec<(Range<usize>, f64)> =
        windows.map(|window| (window.clone(), travel_m(&window))).collect();
    let farthest_m = windows.iter().map(|(_, travel)| *travel).fold(0.0, f64::max);
    let noise_m = STILL_SIGMA * declared.sensors.position.noise_std / (piece as f64).sqrt();
    let still_m = (STILL_SHARE_OF_TRAVEL * farthest_m)
        .max(STILL_SHARE_OF_STROKE * declared.cylinder.stroke_m)
        .max(noise_m);
    windows.into_iter().filter(|(_, travel)| *travel <= still_m).map(|(window, _)| window).collect()
}

/// The holds alone, far apart in time.
fn cut(series: &Series, holds: &[Range<usize>]) -> Series {
    let mut out = Series { name: series.name.clone(), ..Series::default() };
    for (number, hold) in holds.iter().enumerate() {
        for at in hold.clone() {
            out.t_s.push(series.t_s[at] + APART_S * number as f64);
            let into = [
                (&mut out.x_m, &series.x_m),
                (&mut out.pa_pa, &series.pa_pa),
                (&mut out.pb_pa, &series.pb_pa),
                (&mut out.qa_m3s, &series.qa_m3s),
                (&mut out.qb_m3s, &series.qb_m3s),
                (&mut out.force_n, &series.force_n),
                (&mut out.temp_k, &series.temp_k),
            ];
            into.into_iter().for_each(|(column, values)| column.push(values[at]));
        }
    }
    out
}

/// The trace with the flows of its holds taken out: their chambers' equations rest.
fn without(series: &Series, holds: &[Range<usize>]) -> Series {
    let mut out = series.clone();
    for hold in holds {
        out.qa_m3s[hold.clone()].fill(f64::NAN);
        out.qb_m3s[hold.clone()].fill(f64::NAN);
    }
    out
}

/// The holds of one chamber together.
#[derive(Clone, Copy)]
struct Held {
    balance: Balance,
    count: usize,
    /// Mean of all holds: pressures drive the leaks.
    mean: Row,
    leak_m3s: f64,
    std_m3s: f64,
}

impl Held {
    /// Both chambers' holds of `traces`, which have nothing else.
    fn of(fit: &Fit<'_>, traces: &[Series], sensors: &Sensors<f64>) -> [Option<Self>; 2] {
        let found = fit.leak_flows(traces, HOLD_S / 2.0);
        [(Balance::ChamberA, &sensors.flow_a), (Balance::ChamberB, &sensors.flow_b)].map(
            |(balance, meter)| {
                let own =
                    |row: &Row| if balance == Balance::ChamberA { row.mean.pa_pa } else { row.mean.pb_pa };
                let mine = found.iter().filter(|(b, row, ..)| *b == balance && own(row) >= LEAST_PRESSURE_PA);
                let mine: Vec<_> = mine.collect();
                let n = mine.len() as f64;
                let (_, first, ..) = mine.first().filter(|_| mine.len() >= FEWEST)?;
                let average =
                    |f: &dyn Fn(&Row) -> f64| mine.iter().map(|(_, row, ..)| f(row)).sum::<f64>() / n;
                let mut mean = *first;
                mean.mean.pa_pa = average(&|row| row.mean.pa_pa);
                mean.mean.pb_pa = average(&|row| row.mean.pb_pa);
                mean.mean.qa_m3s = average(&|row| row.mean.qa_m3s);
                mean.mean.qb_m3s = average(&|row| row.mean.qb_m3s);
                let leak_m3s = mine.iter().map(|(.., flow, _)| flow).sum::<f64>() / n;
                let noise = mine.iter().map(|(.., std)| std * std).sum::<f64>().sqrt() / n;
                let scatter = mine.iter().map(|(.., flow, _)| (flow - leak_m3s).powi(2)).sum::<f64>();
                let scatter = (scatter / (n - 1.0) / n).sqrt();
                let flow = if balance == Balance::ChamberA { mean.mean.qa_m3s } else { mean.mean.qb_m3s };
                let meter = meter.bias_std.hypot(meter.gain_std * flow);
                let std_m3s = noise.max(scatter).hypot(meter);
                Some(Self { balance, count: mine.len(), mean, leak_m3s, std_m3s })
            },
        )
    }

    fn compare(self, before: &Fit<'_>, after: &Fit<'_>) -> HoldLeak {
        let at = &self.mean.mean;
        let load = at.pa_pa - at.pb_pa;
        let (drives, own) = match self.balance {
            Balance::ChamberA => ([(Term::Internal, load), (Term::ExternalA, at.pa_pa)], at.pa_pa),
            _ => ([(Term::Internal, -load), (Term::ExternalB, at.pb_pa)], at.pb_pa),
        };
        let (predicted_before_m3s, predicted_before_std_m3s) = before.sum(&drives);
        let (laminar, predicted_after_std_m3s) = after.sum(&drives);
        HoldLeak {
            count: self.count,
            mean_pressure_pa: own,
            leak_m3s: self.leak_m3s,
            std_m3s: self.std_m3s,
            predicted_before_m3s,
            predicted_before_std_m3s,
            predicted_after_m3s: laminar + after.effect_leak(&self.mean.mean, self.balance),
            predicted_after_std_m3s,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Diagnosis, diagnose};
    use super::*;
    use crate::Rig;
    use crate::simulate::{Biases, Sensing};
    use pitchleak_core::Sample;

    const INTERNAL: f64 = 1.2e-11;
    const EXTERNAL_A: f64 = 6e-12;

    /// A minute at 0.3 % of full scale: x goes to and fro, and stands from 6 to 10 s of every ten where
    /// `holds`.
    fn ask(holds: bool, seed: u64) -> Diagnosis {
        let mut rig = Rig::paper();
        let sheets = &mut rig.instruments;
        for sheet in [&mut sheets.flow_a, &mut sheets.flow_b, &mut sheets.pressure, &mut sheets.position] {
            sheet.accuracy = 3e-3;
        }
        let (cylinder, bulk) = (rig.cylinder, rig.fluid.bulk_modulus_pa);
        let mut sensing = Sensing::new(rig.sensors(), Biases::default(), seed);
        let mut series = Series::default();
        for k in 0..6000 {
            let t = f64::from(k) * 0.01;
            let phase = if holds { (t % 10.0).min(6.0) } else { t };
            let moving = !holds || t % 10.0 < 6.0;
            let turn = std::f64::consts::TAU / 3.0;
            let x = 0.1 + 0.03 * (turn * phase).sin();
            let v = if moving { 0.03 * turn * (turn * phase).cos() } else { 0.0 };
            let (pa, pb) = (4e6 + 1e6 * (0.9 * t).sin(), 2.5e6 + 6e5 * (1.3 * t).cos());
            let (pa_rate, pb_rate) = (0.9e6 * (0.9 * t).cos(), -7.8e5 * (1.3 * t).sin());
            let past = INTERNAL * (pa - pb);
            let stored_a = cylinder.volume_a_m3(x) / bulk * pa_rate;
            let stored_b = cylinder.volume_b_m3(x) / bulk * pb_rate;
            let qa = cylinder.area_a_m2 * v + stored_a + past + EXTERNAL_A * pa;
            let qb = -cylinder.area_b_m2 * v + stored_b - past;
            let truth =
                Sample { x_m: x, pa_pa: pa, pb_pa: pb, qa_m3s: Some(qa), qb_m3s: Some(qb), force_n: None };
            series.push(t, &sensing.read(&truth), None);
        }
        diagnose(&[series], &[], &Declared::of(&rig), &|| ())
    }

    #[test]
    fn holds_and_motion_agree_on_a_known_leak() {
        for seed in 0..5 {
            let held = ask(true, seed).holds.and_then(|holds| holds.chamber_a).expect("it stands");
            assert!((20..=24).contains(&held.count), "{held:?}");
            let truth = INTERNAL * 1.5e6 + EXTERNAL_A * 4e6;
            assert!((held.leak_m3s / truth - 1.0).abs() < 0.3, "{held:?} for {truth}");
            assert!(held.apart_sigma().iter().all(|sigma| *sigma < 3.5), "{held:?}");
            assert!(held.std_m3s < 0.3 * truth && held.predicted_after_std_m3s < 0.2 * truth, "{held:?}");
        }
    }

    #[test]
    fn a_piston_that_never_stands_gives_no_check() {
        assert_eq!(ask(false, 0).holds, None);
    }
}
