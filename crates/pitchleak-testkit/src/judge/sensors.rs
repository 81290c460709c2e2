//! What sensors and recorder make of the truth: a trace as CSV.

use super::plant::{Instant, Machine, STEPS_HZ};
use super::worlds::{Ailment, Wires};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use std::collections::VecDeque;
use std::f64::consts::TAU;
use std::fmt::Write;

/// Pressure sensors' full scale, Pa, and the force sensor's at the paper's size, N.
pub const PRESSURE_SCALE: f64 = 16e6;
pub const FORCE_SCALE: f64 = 10e3;

/// x, P_A, P_B, Q_A, Q_B, F.
type Channels = [f64; 6];

/// Everything between the machine and the file.
pub struct Recorder<'a> {
    ailment: &'a Ailment,
    seconds: f64,
    scales: Channels,
    /// 3 σ as a share of full scale.
    accuracy: f64,
    random: ChaCha8Rng,
    hum_hz: f64,
    steps: u64,
    lagged: Option<Channels>,
    /// The flows of the last second.
    past: VecDeque<[f64; 2]>,
    position: f64,
    held: [f64; 2],
    coloured: Channels,
    /// So far, with a header.
    pub text: String,
}

impl<'a> Recorder<'a> {
    pub fn new(ailment: &'a Ailment, machine: &Machine, accuracy: f64, seconds: f64, seed: u64) -> Self {
        let flow = machine.flow_scale();
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        Self {
            ailment,
            seconds,
            scales: [
                machine.stroke,
                PRESSURE_SCALE,
                PRESSURE_SCALE,
                flow,
                flow,
                FORCE_SCALE * machine.size.powi(2),
            ],
            accuracy,
            hum_hz: random.random_range(46.0..49.0),
            coloured: std::array::from_fn(|_| StandardNormal.sample(&mut random)),
            random,
            steps: 0,
            lagged: None,
            past: VecDeque::new(),
            position: 0.0,
            held: [0.0; 2],
            text: "t_s,x_m,pa_pa,pb_pa,qa_m3s,qb_m3s,force_n\n".to_owned(),
        }
    }

    /// Takes every instant, and records some; whether this one.
    pub fn take(&mut self, now: &Instant) -> bool {
        let shown = self.followed(now);
        let every = (STEPS_HZ / self.ailment.rate_hz).round() as u64;
        let step = self.steps;
        self.steps += 1;
        if !step.is_multiple_of(every) {
            return false;
        }
        let read = self.read(shown, now.t);
        let row = step / every;
        let lost = self.random.random::<f64>() < self.ailment.lost;
        if lost || (self.ailment.gaps && now.t.rem_euclid(20.0) < 2.0) {
            return false;
        }
        let jitter: f64 = StandardNormal.sample(&mut self.random);
        // Half a period at the most: the order stays.
        let jitter =
            (self.ailment.jitter * jitter).clamp(-0.45 / self.ailment.rate_hz, 0.45 / self.ailment.rate_hz);
        let resting = self.ailment.flow_rate_hz.is_some_and(|hz| {
            let every = (self.ailment.rate_hz / hz).round() as u64;
            row % every != 3 % every
        });
        self.write(now.t + jitter, read, resting);
        true
    }

    /// What has memory: lags, delays, means, play.
    fn followed(&mut self, now: &Instant) -> Channels {
        let ailment = self.ailment;
        let truth = [now.x, now.pa, now.pb, now.qa, now.qb, now.force];
        let [lag_a, lag_b] = ailment.lags;
        let lags = [0.0, ailment.pressure_lags[0], ailment.pressure_lags[1], lag_a, lag_b, 0.0];
        let before = self.lagged.unwrap_or(truth);
        let follow = |i: usize| before[i] + (truth[i] - before[i]) / (1.0 + lags[i] * STEPS_HZ);
        let mut shown: Channels = std::array::from_fn(follow);
        self.lagged = Some(shown);
        self.past.push_front([shown[3], shown[4]]);
        self.past.truncate(STEPS_HZ as usize);
        let steps = |s: f64| ((s * STEPS_HZ) as usize).min(self.past.len() - 1);
        let apart = ailment.clock * now.t / self.seconds;
        for (i, delay) in ailment.delays.into_iter().enumerate() {
            shown[3 + i] = self.past[steps(delay + apart)][i];
        }
        if ailment.averaged > 0.0 && self.steps.is_multiple_of((STEPS_HZ / ailment.rate_hz) as u64) {
            let count = steps(ailment.averaged) + 1;
            for i in 0..2 {
                shown[3 + i] = self.past.iter().take(count).map(|q| q[i]).sum::<f64>() / count as f64;
            }
        }
        if let Some(hz) = ailment.held_hz {
            if self.steps.is_multiple_of((STEPS_HZ / hz) as u64) {
                self.held = [shown[3], shown[4]];
            }
            [shown[3], shown[4]] = self.held;
        }
        let play = ailment.backlash * self.scales[0];
        self.position = self.position.clamp(now.x - play, now.x + play);
        shown[0] = self.position;
        shown
    }

    /// What has none, and noise.
    fn read(&mut self, mut shown: Channels, t: f64) -> Channels {
        let (ailment, scales) = (self.ailment, self.scales);
        let share = t / self.seconds;
        shown[0] = shown[0] * (1.0 + ailment.position_gain) + ailment.position_zero * scales[0];
        shown[0] += ailment.bent * scales[0] * (TAU * shown[0] / scales[0]).sin();
        shown[3] *= 1.0 + ailment.by_direction.copysign(shown[3]);
        shown[3] += scales[3] * if share > 0.4 { ailment.jump } else { 0.0 };
        shown[3] += scales[3] * ailment.sway * (TAU * t / 20.0).sin();
        for i in 0..2 {
            let pressure = &mut shown[1 + i];
            *pressure *= 1.0 + ailment.pressure_gains[i];
            *pressure += (ailment.pressure_zeros[i] + ailment.pressure_drift * share) * PRESSURE_SCALE;
            let (flow, full) = (&mut shown[3 + i], scales[3 + i]);
            if flow.abs() < ailment.dead_bands[i] * full {
                *flow = 0.0;
            }
            *flow *= 1.0 + ailment.gains[i] - ailment.curved * flow.abs() / full;
            *flow += (ailment.zeros[i] + ailment.drifts[i] * share) * full;
            if ailment.cut > 0.0 {
                *flow = (*flow / (ailment.cut * full)).round() * ailment.cut * full;
            }
        }
        let hum = ailment.hum * (TAU * self.hum_hz * t).sin();
        for (i, value) in shown.iter_mut().enumerate() {
            let fresh: f64 = StandardNormal.sample(&mut self.random);
            let kept = ailment.correlation;
            self.coloured[i] = kept * self.coloured[i] + (1.0 - kept * kept).sqrt() * fresh;
            if i == 4 && ailment.common_noise {
                self.coloured[4] = self.coloured[3];
            }
            if (3..=4).contains(&i) && ailment.turbulent > 0.0 {
                let rough: f64 = StandardNormal.sample(&mut self.random);
                *value *= 1.0 + ailment.turbulent * rough;
            }
            let wild = if self.random.random::<f64>() < ailment.outliers { 10.0 } else { 1.0 };
            *value += scales[i] * self.accuracy / 3.0 * ailment.noise * wild * self.coloured[i];
            if (1..=4).contains(&i) {
                *value += hum * scales[i];
            }
            if let Some(bits) = ailment.bits {
                // Flows and forces go both ways.
                let range = if i >= 3 { 2.0 } else { 1.0 } * scales[i];
                let count = range / 2.0_f64.powi(bits as i32);
                *value = (*value / count).round() * count;
            }
        }
        shown[1] = shown[1].min(ailment.pressure_limit * PRESSURE_SCALE);
        self.wired(shown)
    }

    fn wired(&self, mut shown: Channels) -> Channels {
        match self.ailment.wires {
            Wires::Right => (),
            Wires::FlowsExchanged => shown.swap(3, 4),
            Wires::PressuresExchanged => shown.swap(1, 2),
            Wires::BothExchanged => {
                shown.swap(3, 4);
                shown.swap(1, 2);
            }
            Wires::SignOfA => shown[3] = -shown[3],
            Wires::BothSigns => (shown[3], shown[4]) = (-shown[3], -shown[4]),
            Wires::OtherEnd => shown[0] = self.scales[0] - shown[0],
            Wires::TenfoldA => shown[3] *= 10.0,
            Wires::WithoutSign => (shown[3], shown[4]) = (shown[3].abs(), shown[4].abs()),
        }
        shown
    }

    fn write(&mut self, t: f64, [x, pa, pb, qa, qb, force]: Channels, without_flows: bool) {
        let text = &mut self.text;
        let _ = write!(text, "{t:.5},{x:.6},{pa:.0},{pb:.0},");
        let _ = if without_flows { write!(text, ",,") } else { write!(text, "{qa:.6e},{qb:.6e},") };
        let _ = writeln!(text, "{force:.2}");
    }
}
