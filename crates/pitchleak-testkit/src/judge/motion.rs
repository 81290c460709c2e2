//! What the controller asks of the piston, and how the blade pulls at it: winds of a spectrum and other motions, from a seed.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use std::f64::consts::TAU;

/// Kinds of motion.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Kind {
    /// Mean wind, m/s.
    Wind(u8),
    Sine,
    MostlyAtRest,
    Ramps,
    Steps,
}

impl Kind {
    pub const ALL: [Self; 8] = [
        Self::Wind(5),
        Self::Wind(13),
        Self::Wind(21),
        Self::Wind(30),
        Self::Sine,
        Self::MostlyAtRest,
        Self::Ramps,
        Self::Steps,
    ];

    pub fn name(self) -> String {
        match self {
            Self::Wind(mps) => format!("wind {mps}"),
            Self::Sine => "sine".into(),
            Self::MostlyAtRest => "rest".into(),
            Self::Ramps => "ramps".into(),
            Self::Steps => "steps".into(),
        }
    }
}

/// Samples of place and load per second; between them straight lines.
const RATE_HZ: f64 = 20.0;
/// Time tabulated before zero, s.
const BEFORE_S: f64 = 5.0;
/// Wind from which on blades are pitched, m/s, and share of the stroke per m/s above it.
const RATED_MPS: f64 = 11.4;
const SHARE_PER_MPS: f64 = 0.03;
/// Place at fine pitch, as a share of the stroke.
const FINE: f64 = 0.15;
/// Turbulence intensity and length, m: IEC 61400-1 (2019) §6.3, class B at large, rounded.
const INTENSITY: f64 = 0.14;
const LENGTH_M: f64 = 150.0;
/// Sines that make up a spectrum.
const LINES: usize = 48;

/// Place as a share of the stroke and load in units of [`super::plant::LOAD_N`], over time.
pub struct Motion {
    places: Vec<f64>,
    loads: Vec<f64>,
}

fn at(table: &[f64], t: f64) -> f64 {
    let place = ((t + BEFORE_S) * RATE_HZ).max(0.0);
    let index = (place as usize).min(table.len() - 2);
    let part = (place - index as f64).min(1.0);
    table[index] + part * (table[index + 1] - table[index])
}

/// First-order low pass of a table.
fn smooth(table: &mut [f64], tau_s: f64) {
    let share = 1.0 / (1.0 + tau_s * RATE_HZ);
    let mut value = table[0];
    for cell in table {
        value += share * (*cell - value);
        *cell = value;
    }
}

/// Turbulence of unit variance in a wind of `mps`: lines of von Kármán's spectrum with random phases.
fn turbulence(random: &mut ChaCha8Rng, mps: f64, times: &[f64]) -> Vec<f64> {
    let (low, high) = (0.008_f64, 2.0_f64);
    let lines: Vec<[f64; 3]> = (0..LINES)
        .map(|i| {
            let share = (i as f64 + random.random::<f64>()) / LINES as f64;
            let f = low * (high / low).powf(share);
            // Lines stand as far apart as they are high: power is spectrum times frequency.
            let power = f * (1.0 + 70.8 * (f * LENGTH_M / mps).powi(2)).powf(-5.0 / 6.0);
            [power, f, TAU * random.random::<f64>()]
        })
        .collect();
    let whole: f64 = lines.iter().map(|[power, ..]| power).sum();
    let value = |t: &f64| {
        let sum = |[power, f, phase]: &[f64; 3]| (2.0 * power / whole).sqrt() * (TAU * f * t + phase).sin();
        lines.iter().map(sum).sum()
    };
    times.iter().map(value).collect()
}

impl Motion {
    /// Of a seed.
    pub fn draw(kind: Kind, seconds: f64, random: &mut ChaCha8Rng) -> Self {
        let times: Vec<f64> = (0..((seconds + 2.0 * BEFORE_S) * RATE_HZ) as usize)
            .map(|k| k as f64 / RATE_HZ - BEFORE_S)
            .collect();
        let mps = if let Kind::Wind(mps) = kind { f64::from(mps) } else { 15.0 };
        let gusts = turbulence(random, mps, &times);
        let mean = random.random_range(1.5..3.5);
        let swing = mean * random.random_range(0.12..0.25);
        let mut number = |low: f64, high: f64| random.random_range(low..high);
        let (ripple_hz, phase) = (number(0.5, 0.8), number(0.0, TAU));
        let load = |(t, gust): (&f64, &f64)| {
            mean + swing * gust + 0.15 * swing * (TAU * ripple_hz * t + phase).sin()
        };
        let loads = times.iter().zip(&gusts).map(load).collect();
        let mut places: Vec<f64> = match kind {
            Kind::Wind(_) => gusts.iter().map(|gust| pitched(mps * (1.0 + INTENSITY * gust))).collect(),
            Kind::Sine => {
                let (f, wide, middle) = (number(0.05, 0.3), number(0.08, 0.2), number(0.35, 0.6));
                times.iter().map(|t| middle + wide * (TAU * f * t + phase).sin()).collect()
            }
            Kind::Ramps => {
                let (f, wide, middle) = (number(0.02, 0.08), number(0.15, 0.3), number(0.4, 0.6));
                let triangle = |t: &f64| (4.0 * ((f * t + phase).rem_euclid(1.0) - 0.5).abs() - 1.0) * wide;
                times.iter().map(|t| middle + triangle(t)).collect()
            }
            Kind::Steps => held(&times, 6.0, || number(0.2, 0.7)),
            Kind::MostlyAtRest => held(&times, 30.0, || number(0.3, 0.5)),
        };
        smooth(&mut places, if matches!(kind, Kind::Wind(_)) { 0.6 } else { 0.15 });
        Self { places, loads }
    }

    /// Share of the stroke.
    pub fn place(&self, t: f64) -> f64 {
        at(&self.places, t)
    }

    /// In units of [`super::plant::LOAD_N`], against extension.
    pub fn load(&self, t: f64) -> f64 {
        at(&self.loads, t)
    }
}

/// Where the pitch controller puts the piston in a wind.
fn pitched(mps: f64) -> f64 {
    (FINE + SHARE_PER_MPS * (mps - RATED_MPS).max(0.0)).min(0.88)
}

/// A new value every `every_s`.
fn held(times: &[f64], every_s: f64, mut next: impl FnMut() -> f64) -> Vec<f64> {
    let (mut value, mut count) = (next(), f64::NEG_INFINITY);
    let place = |t: &f64| {
        let now = (t / every_s).floor();
        if now > count {
            (value, count) = (next(), now);
        }
        value
    };
    times.iter().map(place).collect()
}
