use crate::signal::Signal;
use crate::trace::Record;
use crate::units::Dimension;
use serde::Serialize;

/// What one signal did over a trace, SI.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Reading {
    /// Name of the signal, as in the column headers.
    pub signal: &'static str,
    /// SI unit.
    pub unit: &'static str,
    /// Lowest reading.
    pub least: f64,
    /// Highest reading.
    pub most: f64,
    /// Share of the rows that have it, %.
    pub present_percent: f64,
}

/// Extremes of every signal in constant memory.
#[derive(Clone, Debug)]
pub(super) struct Extremes {
    rows: u64,
    channels: [Channel; SIGNALS.len()],
}

#[derive(Clone, Copy, Debug)]
struct Channel {
    count: u64,
    least: f64,
    most: f64,
}

/// What a check tells of, in the order of its table.
pub const SIGNALS: [Signal; 8] = [
    Signal::Position,
    Signal::PressureA,
    Signal::PressureB,
    Signal::FlowA,
    Signal::FlowB,
    Signal::Force,
    Signal::Spool,
    Signal::Supply,
];

/// Of each of [`SIGNALS`], SI.
pub fn values(record: &Record) -> [Option<f64>; SIGNALS.len()] {
    let (s, valve) = (&record.sample, record.valve);
    [
        Some(s.x_m),
        Some(s.pa_pa).filter(|reading| !reading.is_nan()),
        Some(s.pb_pa).filter(|reading| !reading.is_nan()),
        s.qa_m3s,
        s.qb_m3s,
        s.force_n,
        valve.map(|valve| valve.spool),
        valve.and_then(|valve| valve.supply_pa),
    ]
}

impl Default for Extremes {
    fn default() -> Self {
        let empty = Channel { count: 0, least: f64::INFINITY, most: f64::NEG_INFINITY };
        Self { rows: 0, channels: [empty; SIGNALS.len()] }
    }
}

impl Extremes {
    pub fn add(&mut self, record: &Record) {
        self.rows += 1;
        for (channel, value) in self.channels.iter_mut().zip(values(record)) {
            if let Some(value) = value {
                channel.count += 1;
                channel.least = channel.least.min(value);
                channel.most = channel.most.max(value);
            }
        }
    }

    /// The signals that the trace has.
    pub fn readings(&self) -> Vec<Reading> {
        let present = SIGNALS.iter().zip(&self.channels).filter(|(_, channel)| channel.count > 0);
        let reading = |(signal, channel): (&Signal, &Channel)| Reading {
            signal: signal.name(),
            unit: signal.dimension().map_or("", Dimension::si),
            least: channel.least,
            most: channel.most,
            present_percent: 100.0 * channel.count as f64 / self.rows as f64,
        };
        present.map(reading).collect()
    }
}
