//! An independent check: the leak found in motion against what leaves a chamber while the piston stands under
//! pressure. There speed, drag and friction have no say, and most sensor errors none either.

use crate::diagnose::data::{Declared, SensorCheck, Series};
use crate::diagnose::equation::Equation;
use crate::diagnose::fit::{Fit, MeanFlow, Problem, Progress};
use crate::diagnose::outcome::{HoldLeak, Holds};
use crate::diagnose::search::Selection;
use crate::diagnose::thresholds::{
    BLOCK_S, EVIDENT_SIGMA, LEAST_HELD_PA, SAMPLES_PER_BLOCK, STILL_SHARE_OF_TRAVEL,
};
use crate::diagnose::weak_form::Term;
use pitchleak_core::{Estimate, Signals};
use std::ops::Range;

/// A hold lasts so many blocks, s.
const HOLD_S: f64 = SAMPLES_PER_BLOCK as f64 * BLOCK_S;

/// Between holds that are cut out, s.
const APART_S: f64 = 1e3;

/// The check on the holds of `judged`, with the models fitted to what moves in `train`; `None` without holds.
pub(crate) fn check(
    selection: &Selection<'_>,
    (train, judged): (&[Series], &[Series]),
    declared: &Declared,
    checks: &[SensorCheck],
    progress: Progress<'_>,
) -> Option<Holds> {
    let Selection { fit, effects, .. } = selection;
    if fit.has_leak_changes() {
        // Which leak a hold has depends on when it is.
        return None;
    }
    let held: Vec<Series> = judged.iter().map(|series| cut(series, &rests(series, declared))).collect();
    let held = [Equation::ChamberA, Equation::ChamberB].map(|one| Held::of(one, fit, &held, declared));
    if held.iter().all(Option::is_none) {
        return None;
    }
    let moving: Vec<Series> = train.iter().map(|series| without(series, &rests(series, declared))).collect();
    let problem = Problem::new(&moving, declared, checks);
    let before = Fit::declared(&problem, progress);
    let effects: Vec<_> = effects.iter().map(|one| (one.term, fit.constants(one.term))).collect();
    let after = before.changed(&[], &effects, progress);
    let [chamber_a, chamber_b] = held.map(|held| held.map(|held| held.compare(&before, &after)));
    Some(Holds { chamber_a, chamber_b })
}

/// Stretches of one hold's length in which the piston stands.
fn rests(series: &Series, declared: &Declared) -> Vec<Range<usize>> {
    let step_s = series.step_s();
    let length = (HOLD_S / step_s.max(1e-9)).round() as usize;
    let piece = length / SAMPLES_PER_BLOCK;
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
    let noise_m = EVIDENT_SIGMA * declared.sensors.position.noise_std / (piece as f64).sqrt();
    let still_m = (STILL_SHARE_OF_TRAVEL * farthest_m).max(noise_m);
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
    chamber: Equation,
    count: usize,
    /// Means of all holds: pressures drive the leaks.
    mean: Signals<f64>,
    leak: Estimate<f64>,
}

/// Pressure of a chamber and the flow into it.
fn pressure_and_flow(at: &Signals<f64>, chamber: Equation) -> (f64, f64) {
    if chamber == Equation::ChamberA { (at.pa_pa, at.qa_m3s) } else { (at.pb_pa, at.qb_m3s) }
}

impl Held {
    /// One chamber's holds of `traces`, which have nothing else.
    fn of(chamber: Equation, fit: &Fit<'_>, traces: &[Series], declared: &Declared) -> Option<Self> {
        let mut own = fit.leak_flows(traces, HOLD_S / 2.0);
        own.retain(|one| {
            one.chamber == chamber && pressure_and_flow(&one.row.mean, chamber).0 >= LEAST_HELD_PA
        });
        if own.len() < 2 {
            return None;
        }
        let n = own.len() as f64;
        let average = |of: &dyn Fn(&MeanFlow) -> f64| own.iter().map(of).sum::<f64>() / n;
        let mean = Signals {
            pa_pa: average(&|one| one.row.mean.pa_pa),
            pb_pa: average(&|one| one.row.mean.pb_pa),
            qa_m3s: average(&|one| one.row.mean.qa_m3s),
            qb_m3s: average(&|one| one.row.mean.qb_m3s),
            ..own.first()?.row.mean
        };
        let leak_m3s = average(&|one| one.flow.value);
        let noise = own.iter().map(|one| one.flow.std * one.flow.std).sum::<f64>().sqrt() / n;
        let scatter = own.iter().map(|one| (one.flow.value - leak_m3s).powi(2)).sum::<f64>();
        let scatter = (scatter / (n - 1.0) / n).sqrt();
        let sensors = &declared.sensors;
        let meter = if chamber == Equation::ChamberA { &sensors.flow_a } else { &sensors.flow_b };
        let meter = meter.bias_std.hypot(meter.gain_std * pressure_and_flow(&mean, chamber).1);
        let leak = Estimate { value: leak_m3s, std: noise.max(scatter).hypot(meter) };
        Some(Self { chamber, count: own.len(), mean, leak })
    }

    fn compare(self, before: &Fit<'_>, after: &Fit<'_>) -> HoldLeak {
        let at = &self.mean;
        let load = at.pa_pa - at.pb_pa;
        let drives = match self.chamber {
            Equation::ChamberA => [(Term::Internal, load), (Term::ExternalA, at.pa_pa)],
            _ => [(Term::Internal, -load), (Term::ExternalB, at.pb_pa)],
        };
        let (predicted_before, laminar) = (before.sum(&drives), after.sum(&drives));
        HoldLeak {
            count: self.count,
            mean_pressure_pa: pressure_and_flow(at, self.chamber).0,
            leak_m3s: self.leak.value,
            std_m3s: self.leak.std,
            predicted_before_m3s: predicted_before.value,
            predicted_before_std_m3s: predicted_before.std,
            predicted_after_m3s: laminar.value + after.effect_leak(at, self.chamber),
            predicted_after_std_m3s: laminar.std,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Rig;
    use crate::diagnose::{Diagnosis, diagnose};
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
