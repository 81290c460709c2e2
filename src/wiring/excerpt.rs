use crate::trace::Record;

/// Records in a piece: ten seconds at 100 Hz.
const PIECE: usize = 1000;
/// Pieces kept: between half of these and all.
const PIECES: usize = 12;

/// Pieces of a trace, evenly over it, in constant memory however long it is: where there are too many, every other
/// one goes, and from then on every other one is left out.
#[derive(Clone, Debug)]
pub struct Excerpt {
    pieces: Vec<Vec<Record>>,
    stride: u64,
    seen: u64,
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
            piece.push(Record { after_gap, ..*record });
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
            first.after_gap = true;
        }
    }

    /// What was kept, pieces parted by [`Record::after_gap`].
    pub fn records(&self) -> Vec<Record> {
        self.pieces.concat()
    }
}
