//! What a trace says of the ways its signals go. The speed that friction feels: from the flows where they are measured, which know it ten times
//! better than the position's difference does, else from the slope of the position.

use super::channel::Channel;
use super::foreseen::{CHAMBER_A, CHAMBER_B, Foreseen, zero_of_line};
use super::play::{Followed, Sides};
use super::series::Series;
use crate::diagnose::thresholds::{BLOCK_S, SIGNIFICANT_SIGMA, SMALL_SHARE};
use pitchleak_core::{Cylinder, Effect, EffectSet, Sensors, Signals, Terms};

/// Speed along a trace, smoothed just enough for the sensors' noise.
#[derive(Default)]
pub(crate) struct Motion {
    /// m/s, one per sample; NaN where it can't be told.
    pub(crate) v_mps: Vec<f64>,
    /// Standard deviation of its noise, m/s.
    pub(crate) std_mps: f64,
    /// The time on either side over which it is a mean, s.
    pub(crate) half_s: f64,
    /// Root mean square, m/s.
    pub(crate) rms_mps: f64,
    /// The speed beyond which the dry friction that the rig file declares has turned, m/s; zero where it declares none.
    pub(crate) turned_mps: f64,
    /// On which side of its play sensor A would read.
    pub(crate) pa: Sides,
    /// On which side of its play sensor B would read.
    pub(crate) pb: Sides,
    /// On which side of its play the position sensor would read.
    pub(crate) x: Sides,
    /// Where in its meter's dead band flow A would lie: zero while the meter shows something.
    pub(crate) qa: Sides,
    /// Where in its meter's dead band flow B would lie.
    pub(crate) qb: Sides,
}

impl Motion {
    /// Of a trace of this cylinder whose sensors have these `effects`, which are undone; `residual` is that of the model at a time.
    pub(crate) fn of(
        series: &Series,
        cylinder: &Cylinder<f64>,
        residual: impl Fn(f64, &Signals<f64>) -> Terms<f64>,
        effects: &EffectSet<f64>,
        sensors: &Sensors<f64>,
    ) -> Self {
        let cylinder = &effects.built(cylinder);
        let has = |flow: &[f64]| flow.iter().any(|q| q.is_finite());
        let own = if has(&series.qa_m3s) || has(&series.qb_m3s) {
            let foreseen = Foreseen::new(series, &residual, effects, sensors);
            let qa = foreseen.within_band(&CHAMBER_A, &CHAMBER_B);
            let qb = foreseen.within_band(&CHAMBER_B, &CHAMBER_A);
            let raw = raw_speed(series, residual, effects, [&qa.side, &qb.side]);
            Self { qa, qb, ..from_flow(series, &raw, cylinder, sensors) }
        } else {
            Self::from_position(series, effects, sensors)
        };
        let half = longest_half(series.step_s()) / 2;
        let noise_std = sensors.pressure.noise_std / ((2 * half + 1) as f64).sqrt();
        let mut plays = Signals::<f64>::default();
        for one in effects.iter() {
            one.effect.hanging(&mut plays).into_iter().for_each(|play| *play = one.value);
        }
        let sides =
            |values: &[f64], known: f64| Sides::of(&series.t_s, &smooth(values, half), noise_std, known);
        let way_m = own.way_m(&series.t_s);
        let stretches = (series.stretches(), series.step_s());
        let x = Followed::new(stretches, (&series.x_m, &way_m), sensors.position.noise_std).sides();
        let (pa, pb) = (sides(&series.pa_pa, plays.pa_pa), sides(&series.pb_pa, plays.pb_pa));
        Self { pa, pb, x, ..own }
    }

    /// The reading in whose play or dead band an effect lies, and where in it; none for an effect without a past.
    pub(crate) fn sides_of(&self, effect: Effect) -> Option<(Channel, &Sides)> {
        let mut all = Signals {
            x_m: Some((Channel::Position, &self.x)),
            pa_pa: Some((Channel::PressureA, &self.pa)),
            pb_pa: Some((Channel::PressureB, &self.pb)),
            qa_m3s: Some((Channel::FlowA, &self.qa)),
            qb_m3s: Some((Channel::FlowB, &self.qb)),
            ..Signals::default()
        };
        let hanging = effect.hanging(&mut all).copied().flatten();
        hanging.or_else(|| effect.deaf(&mut all).copied().flatten())
    }

    /// Where the piston would be by its speed, m.
    fn way_m(&self, t_s: &[f64]) -> Vec<f64> {
        let (mut way_m, mut before_s) = (0.0, t_s.first().copied().unwrap_or_default());
        let each = t_s.iter().zip(&self.v_mps);
        each.map(|(t, v)| {
            way_m += if v.is_finite() { v * (t - before_s).max(0.0) } else { 0.0 };
            before_s = *t;
            way_m
        })
        .collect()
    }

    fn from_position(series: &Series, effects: &EffectSet<f64>, sensors: &Sensors<f64>) -> Self {
        let half = longest_half(series.step_s()).max(1);
        let true_speed = |v_mps: f64| effects.correct(&Signals { v_mps, ..Signals::default() }).v_mps;
        let v_mps: Vec<f64> = slope(&series.t_s, &series.x_m, half).into_iter().map(true_speed).collect();
        let std = slope_std(sensors.position.noise_std, half, series.step_s());
        let rms_mps = root_mean_square(&v_mps);
        let [qa, qb] = [(); 2].map(|()| Sides::none(series.len()));
        let half_s = half as f64 * series.step_s();
        Self { v_mps, std_mps: std, half_s, rms_mps, qa, qb, ..Self::default() }
    }

    /// Whether the direction of motion is known at this speed and acceleration, m/s and m/s²: through its noise, all along the time over
    /// which it is a mean, and beyond the speeds at which a declared dry friction turns, where its force hangs on the speed's last digit.
    pub(crate) fn is_sure(&self, v_mps: f64, a_mps2: f64) -> bool {
        v_mps.abs() >= SIGNIFICANT_SIGMA * self.std_mps + a_mps2.abs() * self.half_s + self.turned_mps
    }
}

/// The motion as the flows tell it.
fn from_flow(series: &Series, raw: &[f64], cylinder: &Cylinder<f64>, sensors: &Sensors<f64>) -> Motion {
    let rms = root_mean_square(raw);
    let std =
        (sensors.flow_a.noise_std / cylinder.area_a_m2).min(sensors.flow_b.noise_std / cylinder.area_b_m2);
    let (half, step) = (half_window(std, rms, 2.0), series.step_s());
    let half = half.min(longest_half(step));
    Motion {
        v_mps: smooth(raw, half),
        std_mps: std / ((2 * half + 1) as f64).sqrt(),
        half_s: half as f64 * step,
        rms_mps: rms,
        ..Motion::default()
    }
}

/// What the sensors show at a sample, and how fast pressures change there; `flows_m3s` are those of A and B.
pub(super) fn shown(series: &Series, [qa_m3s, qb_m3s]: [&[f64]; 2], at: usize) -> Signals<f64> {
    Signals {
        x_m: series.x_m[at],
        pa_pa: series.pa_pa[at],
        pb_pa: series.pb_pa[at],
        dpa_pas: rate(&series.t_s, &series.pa_pa, at),
        dpb_pas: rate(&series.t_s, &series.pb_pa, at),
        qa_m3s: qa_m3s[at],
        qb_m3s: qb_m3s[at],
        temp_k: series.temp_k[at],
        t_s: series.t_s[at],
        ..Signals::default()
    }
}

/// From the sample before to the one after.
pub(super) fn rate(t_s: &[f64], values: &[f64], at: usize) -> f64 {
    let (from, to) = (at.saturating_sub(1), (at + 1).min(values.len() - 1));
    let span = t_s[to] - t_s[from];
    if span > 0.0 { (values[to] - values[from]) / span } else { 0.0 }
}

fn longest_half(step_s: f64) -> usize {
    if step_s > 0.0 { (BLOCK_S / step_s / 2.0) as usize } else { 0 }
}

/// Samples on each side over which noise `std` averages down to the wanted share of `rms`.
fn half_window(std: f64, rms: f64, power: f64) -> usize {
    if rms <= 0.0 {
        return usize::MAX / 4;
    }
    ((std / (SMALL_SHARE * rms)).powf(power) / 2.0).min(1e6) as usize
}

/// The speed at which nothing is left of eq. (1), both chambers averaged where both have a meter. `unread`: where in their dead bands the
/// flows lie.
fn raw_speed(
    series: &Series,
    residual: impl Fn(f64, &Signals<f64>) -> Terms<f64>,
    effects: &EffectSet<f64>,
    [qa_unread, qb_unread]: [&[f64]; 2],
) -> Vec<f64> {
    let speed = |at: usize| {
        let reading = Signals {
            dqa_m3s2: rate(&series.t_s, &series.qa_m3s, at),
            dqb_m3s2: rate(&series.t_s, &series.qb_m3s, at),
            qa_unread: qa_unread[at],
            qb_unread: qb_unread[at],
            ..shown(series, [&series.qa_m3s, &series.qb_m3s], at)
        };
        let seen = effects.correct(&reading);
        let left = |v_mps: f64| residual(series.t_s[at], &Signals { v_mps, ..seen });
        // A chamber's residual is linear in the speed.
        let balanced = left(0.0).zip(left(1.0), zero_of_line);
        match (balanced.chamber_a_m3s, balanced.chamber_b_m3s) {
            (a, b) if a.is_finite() && b.is_finite() => (a + b) / 2.0,
            (a, _) if a.is_finite() => a,
            (_, b) => b,
        }
    };
    (0..series.len()).map(speed).collect()
}

fn root_mean_square(values: &[f64]) -> f64 {
    let (sum, count) =
        values.iter().filter(|v| v.is_finite()).fold((0.0, 0_usize), |(s, n), v| (s + v * v, n + 1));
    if count == 0 { 0.0 } else { (sum / count as f64).sqrt() }
}

fn smooth(values: &[f64], half: usize) -> Vec<f64> {
    if half == 0 {
        return values.to_vec();
    }
    (0..values.len())
        .map(|at| {
            let window = &values[at.saturating_sub(half)..(at + half + 1).min(values.len())];
            window.iter().sum::<f64>() / window.len() as f64
        })
        .collect()
}

/// Standard deviation of [`slope`] by noise.
fn slope_std(noise_std: f64, half: usize, step_s: f64) -> f64 {
    let n = (2 * half + 1) as f64;
    noise_std * (12.0 / (n * n * n)).sqrt() / step_s.max(1e-9)
}

/// Least-squares slope over `half` samples on each side.
fn slope(t: &[f64], x: &[f64], half: usize) -> Vec<f64> {
    (0..x.len())
        .map(|at| {
            let range = at.saturating_sub(half)..(at + half + 1).min(x.len());
            let n = range.len() as f64;
            let (mt, mx) =
                (t[range.clone()].iter().sum::<f64>() / n, x[range.clone()].iter().sum::<f64>() / n);
            let (num, den) = range.fold((0.0, 0.0), |(num, den), i| {
                (num + (t[i] - mt) * (x[i] - mx), den + (t[i] - mt) * (t[i] - mt))
            });
            if den > 0.0 { num / den } else { 0.0 }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::testing::{LEAKS, TURBULENT, declared, seen, torn_seal};
    use pitchleak_core::Model;
    use pitchleak_core::effects::EffectConstants;

    /// Where a mean tells the direction, the piston moves that way at both ends of the time over which it is taken, but for the curve that
    /// a straight line leaves out.
    #[test]
    fn a_mean_over_a_turn_tells_no_direction() {
        let half_s = 0.1;
        let motion = Motion { half_s, ..Motion::default() };
        let mut sure = 0;
        for k in 0..1000 {
            let t_s = f64::from(k) / 100.0;
            let mean = |t_s: f64| t_s.sin() * half_s.sin() / half_s;
            let (from, to) = ((t_s - half_s).sin(), (t_s + half_s).sin());
            if motion.is_sure(mean(t_s), t_s.cos()) {
                sure += 1;
                assert!(from * to > -1e-3, "from {from} to {to} at {t_s} s");
            } else {
                assert!(from * to < 1e-3, "from {from} to {to} at {t_s} s");
            }
        }
        assert!((850..950).contains(&sure), "{sure}");
        assert!(!motion.is_sure(f64::NAN, 0.0));
    }

    /// Load presses oil together, so that one flow is not the other times a ratio of areas; a sample that is a mean shows a part of what flows at
    /// the edge of the band; and a meter hides what it would show, not what flows.
    #[test]
    fn what_a_dead_band_hides_is_what_eq_1_lacks() {
        const BAND_M3S: f64 = 4e-5;
        for (gain, mean_of) in [(0.0, 1), (0.0, 2), (-0.3, 1), (-0.3, 2)] {
            let hidden = std::cell::RefCell::new(vec![]);
            let series = seen(60, |sample| {
                let flow = sample.qa_m3s.map(|flow| (1.0 + gain) * flow);
                let hides = flow.filter(|flow| flow.abs() < BAND_M3S);
                hidden.borrow_mut().push(hides.unwrap_or_default());
                sample.qa_m3s = flow.map(|shown| shown - hides.unwrap_or_default());
            });
            let (declared, hidden) = (declared(), hidden.into_inner());
            let model = Model { cylinder: declared.cylinder, fluid: declared.fluid, leaks_m3spa: LEAKS };
            let mut known = EffectSet::default();
            known.set(Effect::FlowMeterGainA, gain, EffectConstants::default()).expect("is physical");
            let (series, sensors) = (series.thinned(mean_of), &declared.sensors);
            let motion = Motion::of(&series, &model.cylinder, |_, at| model.residual(at), &known, sensors);
            let true_m3s = hidden.chunks_exact(mean_of).map(|all| all.iter().sum::<f64>() / mean_of as f64);
            let pairs: Vec<_> = motion.qa.side.iter().copied().zip(true_m3s).collect();
            let sum = |of: fn((f64, f64)) -> f64| pairs.iter().map(|pair| of(*pair)).sum::<f64>();
            let size_m3s = sum(|(side, flow)| side * flow) / sum(|(side, _)| side * side);
            assert!(
                (size_m3s / BAND_M3S - 1.0).abs() < 0.05,
                "{size_m3s} m³/s of means of {mean_of}, gain {gain}"
            );
        }
    }

    /// What an effect takes past the piston is no motion, once the model has it.
    #[test]
    fn speed_from_flows_knows_the_effects_that_were_found() {
        let (series, declared) = (torn_seal(30), declared());
        let model = Model { cylinder: declared.cylinder, fluid: declared.fluid, leaks_m3spa: LEAKS };
        let off = |effects: &EffectSet<f64>| {
            let residual =
                |_, at: &Signals<f64>| model.residual(at).plus(-1.0, effects.terms(at, &model, |_| true));
            let speed = Motion::of(&series, &model.cylinder, residual, effects, &declared.sensors);
            let (way, steps) = (speed.way_m(&series.t_s), series.len() - 1);
            (way[steps] - way[0] - (series.x_m[steps] - series.x_m[0])).abs()
        };
        let mut known = EffectSet::default();
        known.set(TURBULENT.0, TURBULENT.1, EffectConstants::default()).expect("is physical");
        let (without, with) = (off(&EffectSet::default()), off(&known));
        assert!(with < 1e-3 && without > 10.0 * with, "{without} m without, {with} m with it");
    }
}
