//! What counts as a fault of a channel.

use super::channel::{Channel, Extreme, Run};
use super::{CHANNELS, ChannelFault, ChannelFaultKind, ChannelMonitor};
use crate::rig::Rig;
use crate::signal::Signal;

/// Fewer readings say nothing of a channel.
const LEAST_READINGS: u64 = 100;
/// White noise bends back after 0.73 of its steps, a motion hardly ever: in between.
const BENDS_BACK: f64 = 0.5;
/// Rounding bends like noise of q/√12: only scatter above this many quanta is a sensor's own.
const SCATTER_QUANTA: f64 = 1.0;
/// A channel that repeats a reading more often than this is no witness of noise.
const SELDOM_REPEATS: f64 = 0.3;
/// Noise of at least this share of the declared one shows that the trace is of real sensors.
const AS_DECLARED: f64 = 0.1;
/// A stuck run lasts at least this long, s, …
const STUCK_S: f64 = 1.0;
/// … and comes by chance with a probability below e to this power.
const STUCK_LOG_CHANCE: f64 = -40.0;
/// A dead channel never reads anything else, but for a first transient and spikes of this share.
const DEAD_SHARE: f64 = 0.98;
/// Piston travel or a flow's range that counts as motion: share of stroke or full scale, and standard deviations of noise.
const MOTION_SHARE: f64 = 0.02;
const MOTION_SIGMAS: f64 = 12.0;
/// Readings at the extreme: at least so many, and this share of all.
const CLIPPED_READINGS: u64 = 20;
const CLIPPED_SHARE: f64 = 0.003;
/// … most of which follow one another.
const CLIPPED_REPEATS: f64 = 0.5;
/// Share of single readings among the runs of a held channel, the runs needed to say so, and how many quanta its steps
/// have: those of a coarse channel have one.
const HELD_SINGLES: f64 = 0.15;
const HELD_RUNS: u64 = 30;
const HELD_QUANTA: f64 = 8.0;
/// A quantum of √12 σ makes as much noise as the sensor itself: twice that.
const COARSE_SIGMAS: f64 = 7.0;
const COARSE_STEPS: u64 = 20;

/// One channel as it stands, with what the rig file declares of it.
struct Judged {
    signal: Signal,
    channel: Channel,
    noise_std: f64,
    full_scale: f64,
}

impl Judged {
    /// Share of readings that repeat the one before, outside of long runs.
    fn repeat_share(&self) -> f64 {
        let (runs, _) = self.channel.short_runs();
        1.0 - runs as f64 / self.channel.in_short_runs().max(1) as f64
    }

    /// Standard deviation of its noise, where that is more than its motion.
    fn scatter(&self) -> f64 {
        self.channel.bend() / 6f64.sqrt()
    }

    /// Whether its readings scatter as a sensor's do, not only by rounding.
    fn scatters(&self) -> bool {
        let least = (AS_DECLARED * self.noise_std).max(SCATTER_QUANTA * self.channel.smallest_step);
        self.channel.steps >= 20 && self.channel.turn_share() > BENDS_BACK && self.scatter() > least
    }

    /// Whether it scatters with hardly a reading repeated.
    fn jitters(&self) -> bool {
        self.scatters() && self.repeat_share() < SELDOM_REPEATS
    }

    fn range(&self) -> f64 {
        self.channel.most.value - self.channel.least.value
    }

    fn moves(&self) -> bool {
        self.range() > MOTION_SHARE * self.full_scale + MOTION_SIGMAS * self.noise_std
    }

    fn fault(&self, kind: ChannelFaultKind, (from_s, to_s): (f64, f64), text: String) -> ChannelFault {
        let (_, suggestion) = kind.entry();
        ChannelFault { channel: self.signal, kind, from_s, to_s, text, suggestion }
    }

    fn reading(&self, value: f64) -> String {
        let (factor, unit) = match self.signal {
            Signal::Position => (1e3, "mm"),
            Signal::PressureA | Signal::PressureB => (1e-5, "bar"),
            Signal::FlowA | Signal::FlowB => (crate::units::LPM_PER_M3S, "L/min"),
            _ => (1.0, "N"),
        };
        let shown = value * factor + 0.0;
        if shown.abs() < 0.1 && shown != 0.0 {
            format!("{shown:.2e} {unit}")
        } else {
            format!("{} {unit}", (shown * 1e3).round() / 1e3)
        }
    }
}

pub(super) fn find(monitor: &ChannelMonitor, rig: &Rig) -> Vec<ChannelFault> {
    let sheets = &rig.instruments;
    let sheet = |signal| match signal {
        Signal::Position => &sheets.position,
        Signal::PressureA | Signal::PressureB => &sheets.pressure,
        Signal::FlowA => &sheets.flow_a,
        Signal::FlowB => &sheets.flow_b,
        _ => &sheets.force,
    };
    let judged = CHANNELS.into_iter().zip(&monitor.channels).map(|(signal, channel)| {
        let (noise_std, full_scale) = (sheet(signal).spread().noise_std, sheet(signal).full_scale);
        Judged { signal, channel: channel.closed(), noise_std, full_scale }
    });
    let judged: Vec<_> = judged.filter(|one| one.channel.readings >= LEAST_READINGS).collect();
    judged.iter().filter_map(|one| gravest(one, &judged, monitor)).collect()
}

fn gravest(one: &Judged, all: &[Judged], monitor: &ChannelMonitor) -> Option<ChannelFault> {
    let others = || all.iter().filter(|other| other.signal != one.signal);
    let witnesses = others().filter(|other| other.jitters()).count();
    let seldom_repeated = others().filter(|other| other.repeat_share() < SELDOM_REPEATS).count();
    // Force and pressure may change on a standing piston: only travel and flow are motion.
    let kinematic =
        |other: &&Judged| matches!(other.signal, Signal::Position | Signal::FlowA | Signal::FlowB);
    let moves = others().filter(kinematic).any(Judged::moves);
    let load = others().any(|other| !kinematic(&other) && other.moves());
    let whole = (monitor.first_s, monitor.last_s);
    dead(one, witnesses, Activity { moves, load }, whole)
        .or_else(|| held(one, seldom_repeated, whole))
        .or_else(|| clipped(one))
        .or_else(|| stuck(one))
        .or_else(|| coarse(one, whole))
}

/// What the other channels show that the cylinder does: it moves, its load changes.
struct Activity {
    moves: bool,
    load: bool,
}

/// Constant though the cylinder moves: where other channels show that this trace has noise, or at exactly zero. An
/// unused force column of zeros harms nobody. A flow whose range is a small part of its noise is constant, too: with m³/s under a
/// name of L/min the meter as good as rests.
fn dead(one: &Judged, witnesses: usize, activity: Activity, whole: (f64, f64)) -> Option<ChannelFault> {
    let Run { value, count, .. } = one.channel.longest;
    // Only a meter's resolution could make it rest, and nothing rests as long as others scatter.
    let flow = matches!(one.signal, Signal::FlowA | Signal::FlowB);
    let repeats = count as f64 >= DEAD_SHARE * one.channel.readings as f64;
    let constant = repeats || flow && one.range() < AS_DECLARED * one.noise_std;
    let zero = value == 0.0;
    let force = one.signal == Signal::Force;
    let pressure = matches!(one.signal, Signal::PressureA | Signal::PressureB);
    let alive = activity.moves || (witnesses >= 2 && (flow || (pressure && activity.load)));
    if !constant || !alive || (force && zero) || !(zero || witnesses >= 2) {
        return None;
    }
    let reads = match (repeats, zero) {
        (true, true) => format!("exactly {}", one.reading(value)),
        (true, false) => one.reading(value),
        (false, _) => {
            let [least, most] = [&one.channel.least, &one.channel.most].map(|end| one.reading(end.value));
            format!("{least} to {most}")
        }
    };
    let text = format!(
        "{} reads {reads} all the time although {}",
        one.signal.name(),
        if activity.moves {
            "the cylinder moves"
        } else if pressure {
            "the load changes"
        } else {
            "other channels scatter"
        }
    );
    Some(one.fault(ChannelFaultKind::Dead, whole, text))
}

/// A run of identical readings that the channel's own scatter elsewhere makes impossible.
fn stuck(one: &Judged) -> Option<ChannelFault> {
    let Run { value, count, from_s, to_s } = one.channel.longest;
    let chance = one.repeat_share().max(0.01).ln() * count as f64;
    if !one.jitters() || to_s - from_s < STUCK_S || chance > STUCK_LOG_CHANCE {
        return None;
    }
    let often = match one.channel.long_runs {
        1 => String::new(),
        runs => format!(" (the longest of {runs} such runs)"),
    };
    let text = format!(
        "{} reads {} from {from_s:.2} s to {to_s:.2} s without the scatter that it has elsewhere{often}",
        one.signal.name(),
        one.reading(value)
    );
    Some(one.fault(ChannelFaultKind::Stuck, (from_s, to_s), text))
}

/// Readings that scatter, but again and again are just the largest or the smallest of all.
fn clipped(one: &Judged) -> Option<ChannelFault> {
    let channel = &one.channel;
    let piles_up = |extreme: &Extreme| {
        extreme.count >= CLIPPED_READINGS
            && extreme.count as f64 >= CLIPPED_SHARE * channel.readings as f64
            && extreme.repeats as f64 >= CLIPPED_REPEATS * extreme.count as f64
            // One run alone is a stuck sensor.
            && extreme.count - extreme.repeats >= 3
    };
    if !one.scatters() {
        return None;
    }
    let (extreme, which) = if piles_up(&channel.most) {
        (&channel.most, "largest")
    } else if piles_up(&channel.least) {
        (&channel.least, "smallest")
    } else {
        return None;
    };
    let share = 100.0 * extreme.count as f64 / channel.readings as f64;
    let text = format!(
        "{} reads its {which}, {}, in {share:.1} % of the rows, many in a row: it is clipped there",
        one.signal.name(),
        one.reading(extreme.value)
    );
    Some(one.fault(ChannelFaultKind::Clipped, (extreme.from_s, extreme.to_s), text))
}

/// Hardly any reading stands alone, and from one to the next new one it goes many quanta at once.
fn held(one: &Judged, seldom_repeated: usize, whole: (f64, f64)) -> Option<ChannelFault> {
    let channel = &one.channel;
    let (short_runs, singles) = channel.short_runs();
    let runs = short_runs + channel.long_runs;
    let jumps = one.scatters() || channel.bend() > one.noise_std;
    if runs < HELD_RUNS
        || singles as f64 > HELD_SINGLES * runs as f64
        || channel.bend() < HELD_QUANTA * channel.smallest_step
        || !jumps
        || seldom_repeated < 2
    {
        return None;
    }
    let times = channel.readings as f64 / runs as f64;
    let text = format!("{} repeats each reading about {times:.1} times", one.signal.name());
    Some(one.fault(ChannelFaultKind::Held, whole, text))
}

/// Steps in multiples of a quantum that outweighs the declared noise.
fn coarse(one: &Judged, whole: (f64, f64)) -> Option<ChannelFault> {
    let channel = &one.channel;
    let limit = COARSE_SIGMAS * one.noise_std;
    if channel.steps < COARSE_STEPS || channel.smallest_step <= limit || one.noise_std == 0.0 {
        return None;
    }
    let text = format!(
        "{} changes in steps of {}, {:.0} times the declared noise",
        one.signal.name(),
        one.reading(channel.smallest_step),
        channel.smallest_step / one.noise_std
    );
    Some(one.fault(ChannelFaultKind::Coarse, whole, text))
}
