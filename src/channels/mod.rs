//! Channels before estimates: a sensor that is dead, stuck, clipped, held or coarse shows it by itself, whatever the
//! cylinder does. Constant memory, a few instructions per reading.
//!
//! What counts as a fault, and why each bound lies where it does: docs/channels-and-wiring.md.

mod channel;
mod faults;

use crate::rig::Rig;
use crate::signal::Signal;
use crate::trace::Record;
use channel::Channel;
use serde::{Serialize, Serializer};

/// What is wrong with a channel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ChannelFaultKind {
    /// One reading through the whole trace, though the cylinder moves.
    Dead,
    /// One reading for a part of the trace, though the channel jitters elsewhere.
    Stuck,
    /// The readings pile up at their largest or smallest.
    Clipped,
    /// Each reading is repeated: the channel is renewed slower than it is sampled.
    Held,
    /// The smallest step between readings is larger than the declared noise.
    Coarse,
}

impl ChannelFaultKind {
    /// Its id, as among the reasons of a verdict.
    pub fn id(self) -> &'static str {
        self.entry().0
    }

    /// Its id, and what to check.
    fn entry(self) -> (&'static str, &'static str) {
        match self {
            Self::Dead => (
                "channel_dead",
                "check the sensor, its supply and its cable, and which column is read in which unit",
            ),
            Self::Stuck => (
                "channel_stuck",
                "check the sensor and its cable; leave its cells empty while it does not measure",
            ),
            Self::Clipped => {
                ("channel_clipped", "check the range of the sensor, its amplifier and the logger's input")
            }
            Self::Held => (
                "channel_held",
                "record at the rate at which the channel is renewed, or leave the cells between empty",
            ),
            Self::Coarse => (
                "channel_coarse",
                "record with more digits, or declare an accuracy that includes the resolution",
            ),
        }
    }
}

impl Serialize for ChannelFaultKind {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.id())
    }
}

/// A fault that a channel shows by itself.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ChannelFault {
    /// Name of the signal, as in the column headers.
    pub channel: Signal,
    /// What is wrong.
    #[serde(rename = "id")]
    pub kind: ChannelFaultKind,
    /// When it begins, s.
    pub from_s: f64,
    /// When it ends, s.
    pub to_s: f64,
    /// What was seen, in one sentence.
    pub text: String,
    /// What to check.
    pub suggestion: &'static str,
}

/// Rows of a piece; the first pieces are looked at whole, then one of so many.
const PIECE_ROWS: u64 = 512;
const WHOLE_PIECES: u64 = 16;
const PIECES: u64 = 16;

/// The channels that are watched.
const CHANNELS: [Signal; 6] =
    [Signal::Position, Signal::PressureA, Signal::PressureB, Signal::FlowA, Signal::FlowB, Signal::Force];

/// Watches every channel of a trace.
#[derive(Clone, Debug, Default, serde::Serialize, serde::Deserialize)]
pub struct ChannelMonitor {
    channels: [Channel; CHANNELS.len()],
    first_s: f64,
    last_s: f64,
    rows: u64,
}

impl ChannelMonitor {
    /// Whether records can have led to it.
    pub fn is_possible(&self) -> bool {
        self.channels.iter().all(Channel::is_possible)
    }

    /// Takes in one record. Of a long trace one piece in a few is looked at: a fault that lasts is in it.
    #[inline]
    pub fn add(&mut self, record: &Record) {
        let piece = self.rows / PIECE_ROWS;
        let begins = self.rows.is_multiple_of(PIECE_ROWS);
        self.rows += 1;
        self.last_s = record.t_s;
        if piece >= WHOLE_PIECES && !piece.is_multiple_of(PIECES) {
            return;
        }
        if begins {
            self.begin_piece(record);
        } else {
            self.each(record, Channel::add);
        }
    }

    #[cold]
    fn begin_piece(&mut self, record: &Record) {
        if self.rows == 1 {
            self.first_s = record.t_s;
        }
        if self.rows / PIECE_ROWS > WHOLE_PIECES {
            self.each(record, Channel::skip_to);
        } else {
            self.each(record, Channel::add);
        }
    }

    #[inline]
    fn each(&mut self, record: &Record, take: impl Fn(&mut Channel, f64, f64)) {
        let s = &record.sample;
        let [x, pa, pb, qa, qb, force] = &mut self.channels;
        take(x, record.t_s, s.x_m);
        take(pa, record.t_s, s.pa_pa);
        take(pb, record.t_s, s.pb_pa);
        for (channel, value) in [(qa, s.qa_m3s), (qb, s.qb_m3s), (force, s.force_n)] {
            if let Some(value) = value {
                take(channel, record.t_s, value);
            }
        }
    }

    /// The faults so far: at most one per channel, the gravest.
    pub fn faults(&self, rig: &Rig) -> Vec<ChannelFault> {
        faults::find(self, rig)
    }

    /// A stream's next stretch begins.
    pub fn next_stretch(&mut self) {
        self.channels.iter_mut().for_each(Channel::next_stretch);
    }

    /// As if channels had been stuck in the last two stretches alone.
    pub fn lately(&self) -> Self {
        Self { channels: self.channels.map(Channel::lately), ..*self }
    }
}
