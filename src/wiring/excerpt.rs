use crate::trace::Record;
use pitchleak_core::Sample;

/// Records in a piece: ten seconds at 100 Hz.
const PIECE: usize = 1000;
/// Pieces kept: between half of these and all.
const PIECES: usize = 6;

/// Pieces of a trace, evenly over it, in constant memory however long it is: where there are too many, every other
/// one goes, and from then on every other one is left out.
#[derive(Clone, Debug)]
pub struct Excerpt {
    pieces: Vec<Vec<Kept>>,
    stride: u64,
    seen: u64,
}

const AFTER_GAP: f64 = -1.0;

/// What the equations need of a record, in a third of its memory; NaN is a flow or a force that is missing.
#[derive(Clone, Copy, Debug)]
struct Kept {
    t_s: f64,
    /// Time since the record before, or [`AFTER_GAP`].
    step_s: f64,
    x_m: f64,
    pressures_pa: [f64; 2],
    flows_m3s: [f64; 2],
    force_n: f64,
}

impl Kept {
    fn of(record: &Record, step_s: f64) -> Self {
        let s = &record.sample;
        let missing = |reading: Option<f64>| reading.unwrap_or(f64::NAN);
        Self {
            t_s: record.t_s,
            step_s,
            x_m: s.x_m,
            pressures_pa: [s.pa_pa, s.pb_pa],
            flows_m3s: [missing(s.qa_m3s), missing(s.qb_m3s)],
            force_n: missing(s.force_n),
        }
    }

    fn record(&self) -> Record {
        let ([pa_pa, pb_pa], [qa, qb]) = (self.pressures_pa, self.flows_m3s);
        let measured = |reading: f64| Some(reading).filter(|reading| !reading.is_nan());
        let (qa_m3s, qb_m3s, force_n) = (measured(qa), measured(qb), measured(self.force_n));
        let sample = Sample { x_m: self.x_m, pa_pa, pb_pa, qa_m3s, qb_m3s, force_n };
        let after_gap = self.step_s < 0.0;
        Record { t_s: self.t_s, dt_s: self.step_s.max(0.0), after_gap, sample, ..Record::default() }
    }
}

impl Default for Excerpt {
    fn default() -> Self {
        Self { pieces: Vec::new(), stride: 1, seen: 0 }
    }
}

impl Excerpt {
    /// Takes in the next record.
    #[inline]
    pub fn add(&mut self, record: &Record) {
        let (piece, place) = (self.seen / PIECE as u64, self.seen % PIECE as u64);
        self.seen += 1;
        if piece % self.stride != 0 {
            return;
        }
        if place == 0 {
            self.begin_piece();
            if (piece / self.stride) as usize != self.pieces.len() {
                return;
            }
            self.pieces.push(Vec::with_capacity(PIECE));
        }
        let after_gap = record.after_gap || (place == 0 && self.stride > 1);
        if let Some(piece) = self.pieces.last_mut().filter(|piece| piece.len() as u64 == place) {
            // Rows before it may have been left out.
            let step_s = piece.last().map_or(record.dt_s, |last| record.t_s - last.t_s);
            piece.push(Kept::of(record, if after_gap { AFTER_GAP } else { step_s }));
        }
    }

    /// Makes room for another piece.
    fn begin_piece(&mut self) {
        if self.pieces.len() < PIECES {
            return;
        }
        let mut index = 0;
        self.pieces.retain(|_| {
            index += 1;
            index % 2 == 1
        });
        self.stride *= 2;
        for first in self.pieces.iter_mut().filter_map(|piece| piece.first_mut()) {
            first.step_s = AFTER_GAP;
        }
    }

    /// What was kept, pieces parted by [`Record::after_gap`].
    pub fn records(&self) -> Vec<Record> {
        self.first_records(usize::MAX)
    }

    /// The first `count` of them.
    pub fn first_records(&self, count: usize) -> Vec<Record> {
        let kept = self.pieces.iter().map(Vec::len).sum();
        let mut records = Vec::with_capacity(count.min(kept));
        records.extend(self.pieces.iter().flatten().take(count).map(Kept::record));
        records
    }
}
