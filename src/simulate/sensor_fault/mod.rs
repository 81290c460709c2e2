//! Sensor faults: what dead meters, exchanged wires and wrong units make of honest readings.

mod text;

pub use text::SensorFaultError;

use super::sensing::unit;
use super::span::Span;
use crate::rig::Instruments;
use crate::signal::Signal;
use crate::simulate::Reading;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use std::collections::VecDeque;

/// One mistake of the sensors, their wires or their recorder; see [`SensorFault::from_str`](std::str::FromStr).
#[derive(Clone, Debug, PartialEq)]
pub struct SensorFault {
    /// As given.
    text: String,
    mistake: Mistake,
    during: Span,
}

/// What a mistake does.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Mistake {
    /// One channel shows something else.
    Channel(Signal, Distortion),
    /// Two channels are exchanged.
    Swap(Signal, Signal),
    /// This share of the rows is not recorded.
    RowsLost(f64),
}

/// What one channel makes of its readings.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Distortion {
    /// Zero.
    Dead,
    /// No reading.
    Missing,
    Reversed,
    Absolute,
    /// Distance from the other end of the stroke.
    OtherEnd,
    Offset(Amount),
    /// Growth of the zero per hour.
    Drift(Amount),
    /// The reading times this.
    Times(f64),
    /// Never more than this, either way.
    Clipped(Amount),
    /// One reading for this long, s: the first again and again where it is infinite.
    Held(f64),
    /// The reading of this time ago, s.
    Late(f64),
    /// This share of the readings is full scale.
    Spikes(f64),
}

/// A quantity of a channel.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Amount {
    /// In SI.
    Si(f64),
    /// A share of the sensor's full scale.
    OfFullScale(f64),
}

impl Amount {
    fn si(self, full_scale: f64) -> f64 {
        match self {
            Self::Si(value) => value,
            Self::OfFullScale(share) => share * full_scale,
        }
    }
}

impl std::fmt::Display for SensorFault {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.text)
    }
}

/// The mistakes of a recording; each gets what the one before it left, as a signal passes sensor, wire and recorder.
///
/// The same seed loses the same rows and spikes the same readings.
#[derive(Clone, Debug)]
pub struct SensorFaults {
    running: Vec<Running>,
    random: ChaCha8Rng,
}

/// One mistake with what it remembers.
#[derive(Clone, Debug)]
struct Running {
    mistake: Mistake,
    during: Span,
    /// Of the channel's sensor.
    full_scale: f64,
    stroke_m: f64,
    /// Time and reading that a channel is stuck or held at.
    kept: Option<(f64, f64)>,
    /// Times and readings that a late channel has still to show, the oldest first.
    waiting: VecDeque<(f64, f64)>,
}

impl SensorFaults {
    /// Mistakes in the order in which they happen; `instruments` have the full scales, the cylinder the stroke.
    pub fn new(faults: &[SensorFault], instruments: &Instruments, stroke_m: f64, seed: u64) -> Self {
        let running = |fault: &SensorFault| Running {
            mistake: fault.mistake,
            during: fault.during,
            full_scale: match fault.mistake {
                Mistake::Channel(channel, _) => full_scale(instruments, channel),
                Mistake::Swap(..) | Mistake::RowsLost(_) => 1.0,
            },
            stroke_m,
            kept: None,
            waiting: VecDeque::new(),
        };
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        // Streams 0 and 1 are those of noise and biases.
        random.set_stream(2);
        Self { running: faults.iter().map(running).collect(), random }
    }

    /// What is recorded of an honest reading; none where the row is lost.
    pub fn show(&mut self, honest: &Reading) -> Option<Reading> {
        let Self { running, random } = self;
        let mut shown = *honest;
        // The mistake's own times are true times, whatever the clock shows.
        let t_s = honest.get(Signal::Time).unwrap_or(f64::NAN);
        let mut kept = true;
        for one in running {
            if !one.during.contains(t_s) {
                one.kept = None;
                one.waiting.clear();
                continue;
            }
            match one.mistake {
                Mistake::RowsLost(share) => kept &= unit(random) >= share,
                Mistake::Swap(a, b) => {
                    let (at_a, at_b) = (shown.get(a), shown.get(b));
                    shown.set(a, at_b);
                    shown.set(b, at_a);
                }
                Mistake::Channel(channel, distortion) => {
                    let chance = unit(random);
                    if let Some(reading) = shown.get(channel) {
                        shown.set(channel, one.distorted(distortion, t_s, reading, chance));
                    }
                }
            }
        }
        kept.then_some(shown)
    }
}

impl Running {
    /// What the channel shows instead; `chance` is drawn from 0 to 1.
    fn distorted(&mut self, distortion: Distortion, t_s: f64, reading: f64, chance: f64) -> Option<f64> {
        let Self { full_scale, stroke_m, .. } = *self;
        Some(match distortion {
            Distortion::Missing => return None,
            Distortion::Dead => 0.0,
            Distortion::Held(time_s) => self.kept_for(time_s, t_s, reading),
            Distortion::Late(time_s) => self.late_by(time_s, t_s, reading),
            Distortion::Reversed => -reading,
            Distortion::Absolute => reading.abs(),
            Distortion::OtherEnd => stroke_m - reading,
            Distortion::Offset(offset) => reading + offset.si(full_scale),
            Distortion::Drift(per_hour) => {
                reading + per_hour.si(full_scale) * (t_s - self.during.from_s.max(0.0)) / 3600.0
            }
            Distortion::Times(factor) => reading * factor,
            Distortion::Clipped(most) => {
                let most = most.si(full_scale).abs();
                reading.clamp(-most, most)
            }
            Distortion::Spikes(share) if chance < share => full_scale,
            Distortion::Spikes(_) => reading,
        })
    }

    /// The reading that is kept, renewed after `time_s`.
    fn kept_for(&mut self, time_s: f64, t_s: f64, reading: f64) -> f64 {
        let old = self.kept.filter(|(since_s, _)| t_s - since_s < time_s - 1e-9);
        self.kept.insert(old.unwrap_or((t_s, reading))).1
    }

    /// The reading of `time_s` ago, or the oldest there is.
    fn late_by(&mut self, time_s: f64, t_s: f64, reading: f64) -> f64 {
        self.waiting.push_back((t_s, reading));
        while self.waiting.get(1).is_some_and(|(next_s, _)| *next_s <= t_s - time_s + 1e-9) {
            self.waiting.pop_front();
        }
        self.waiting.front().map_or(reading, |(_, oldest)| *oldest)
    }
}

/// Full scale of a channel's sensor; of one without a data sheet, 1 in SI.
fn full_scale(instruments: &Instruments, channel: Signal) -> f64 {
    match channel {
        Signal::Position => instruments.position.full_scale,
        Signal::PressureA | Signal::PressureB => instruments.pressure.full_scale,
        Signal::FlowA => instruments.flow_a.full_scale,
        Signal::FlowB => instruments.flow_b.full_scale,
        Signal::Force => instruments.force.full_scale,
        _ => 1.0,
    }
}

#[cfg(test)]
mod tests;
