use super::readings::Readings;
use crate::rig::Rig;
use crate::trace::Record;
use pitchleak_core::ATMOSPHERE_PA;

/// What may be exchanged.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Exchange {
    /// P_A and P_B.
    Pressures,
    /// Q_A and Q_B.
    Flows,
    /// Both.
    Chambers,
}

/// A mistake of wiring, sign or unit that readings may carry.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Mistake {
    /// A and B are exchanged.
    Exchanged(Exchange),
    /// Flows have the wrong sign.
    Sign(Readings),
    /// Only the size of a flow is recorded.
    Size(Readings),
    /// The position is measured from the B end.
    OtherEnd,
    /// Readings are this many times too large.
    Scaled(Readings, f64),
    /// Pressures are absolute, not gauge.
    Absolute(Readings),
    /// Flow readings are this much too large, m³/s.
    Zero(Readings, f64),
    /// Readings of meters A and B are this much too large, m³/s.
    Zeros([f64; 2]),
    /// Readings come late by this time, s.
    Late(Readings, f64),
}

impl Mistake {
    /// The records that this mistake makes of right ones.
    pub fn make(self, records: &[Record], rig: &Rig) -> Vec<Record> {
        match self {
            Self::Scaled(readings, factor) => each(records, |r| readings.map(r, |value| value * factor)),
            Self::Absolute(readings) => each(records, |r| readings.map(r, |value| value + ATMOSPHERE_PA)),
            Self::Zero(readings, by_m3s) => each(records, |r| readings.map(r, |value| value + by_m3s)),
            Self::Zeros(by_m3s) => Self::zero_of_each(by_m3s)
                .iter()
                .fold(records.to_vec(), |records, mistake| mistake.make(&records, rig)),
            Self::Size(readings) => each(records, |r| readings.map(r, f64::abs)),
            Self::Late(readings, by_s) => shifted(records, readings, -by_s),
            Self::Exchanged(_) | Self::Sign(_) | Self::OtherEnd => self.mend(records, rig),
        }
    }

    /// The right records where the given ones carry this mistake. Where a flow's sign cannot be told, its reading
    /// is left out; where a late reading's own time lies outside of the trace, the record is.
    pub fn mend(self, records: &[Record], rig: &Rig) -> Vec<Record> {
        match self {
            Self::Exchanged(exchange) => each(records, |r| exchanged(r, exchange)),
            Self::Sign(readings) => each(records, |r| readings.map(r, |value| -value)),
            Self::Size(readings) => super::signs::restored(records, readings, rig),
            Self::OtherEnd => each(records, |r| Readings::Position.map(r, |x| rig.cylinder.stroke_m - x)),
            Self::Scaled(readings, factor) => each(records, |r| readings.map(r, |value| value / factor)),
            Self::Absolute(readings) => each(records, |r| readings.map(r, |value| value - ATMOSPHERE_PA)),
            Self::Zero(readings, by_m3s) => each(records, |r| readings.map(r, |value| value - by_m3s)),
            Self::Zeros(by_m3s) => Self::Zeros(by_m3s.map(|zero| -zero)).make(records, rig),
            Self::Late(readings, by_s) => shifted(records, readings, by_s),
        }
    }

    /// The mistakes of one meter each that [`Self::Zeros`] is.
    pub(super) fn zero_of_each([a_m3s, b_m3s]: [f64; 2]) -> [Self; 2] {
        [Self::Zero(Readings::FlowA, a_m3s), Self::Zero(Readings::FlowB, b_m3s)]
    }

    /// The same kind of mistake on the same readings, of whatever size: what a trace that tells them apart by a hair
    /// need not list twice.
    pub(super) fn is_like(self, other: Self) -> bool {
        match (self, other) {
            (Self::Late(a, _), Self::Late(b, _)) => a == b,
            _ => self == other,
        }
    }
}

fn each(records: &[Record], change: impl Fn(&Record) -> Record) -> Vec<Record> {
    records.iter().map(change).collect()
}

fn exchanged(record: &Record, exchange: Exchange) -> Record {
    let mut out = *record;
    let s = &mut out.sample;
    if exchange != Exchange::Flows {
        std::mem::swap(&mut s.pa_pa, &mut s.pb_pa);
    }
    if exchange != Exchange::Pressures {
        std::mem::swap(&mut s.qa_m3s, &mut s.qb_m3s);
    }
    out
}

/// Every record with `readings` as they were `by_s` later (earlier where negative), between two records by a straight
/// line. Records without such a time before the next gap are left out.
fn shifted(records: &[Record], readings: Readings, by_s: f64) -> Vec<Record> {
    let mut out = Vec::with_capacity(records.len());
    let mut cut = true;
    for piece in records.chunk_by(|_, next| !next.after_gap) {
        let mut at = 0;
        for record in piece {
            let wanted = record.t_s + by_s;
            while piece.get(at + 1).is_some_and(|next| next.t_s < wanted) {
                at += 1;
            }
            let (Some(before), Some(after)) = (piece.get(at), piece.get(at + 1)) else { break };
            cut |= record.after_gap;
            if wanted < before.t_s || wanted > after.t_s {
                continue;
            }
            let share = (wanted - before.t_s) / (after.t_s - before.t_s);
            let late = readings.between(record, before, after, share);
            out.push(Record { after_gap: std::mem::take(&mut cut), ..late });
        }
        cut = true;
    }
    out
}
