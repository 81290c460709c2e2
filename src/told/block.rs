use crate::trace::Record;
use serde::{Deserialize, Serialize};

/// Shortest block, s, and its fewest readings: as of the statistic.
const BLOCK_S: f64 = 0.25;
const BLOCK_READINGS: u32 = 8;

/// Means of a quarter of a second.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Block {
    /// It follows the one before without a pause.
    pub follows: bool,
    pub time_s: f64,
    pub readings: u32,
    /// Slope of the position, m/s, and its standard deviation as the readings lie about it.
    pub speed_mps: f64,
    pub speed_std_mps: f64,
    /// The same for a standard deviation of 1 m of each reading.
    pub speed_std_per_m: f64,
    /// x, P_A, P_B, Q_A, Q_B, F: SI; none of what was not read all through.
    pub means: [Option<f64>; CHANNELS],
    /// Whether Q_A and Q_B were never negative.
    pub unsigned: [bool; 2],
}

const CHANNELS: usize = 6;

/// Gathers records to blocks; a rest that a gap cuts off is lost.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub(crate) struct Gatherer {
    sums: [f64; CHANNELS],
    counts: [u32; CHANNELS],
    unsigned: [bool; 2],
    readings: u32,
    time_s: f64,
    /// Σt, Σt², Σtx and Σx².
    moments: [f64; 4],
    follows: bool,
}

impl Gatherer {
    /// Takes in the next record; gives the block that it ends.
    pub fn add(&mut self, record: &Record) -> Option<Block> {
        let step_s = record.step_s();
        if step_s <= 0.0 {
            *self = Self::default();
        }
        self.take(record, step_s.max(0.0));
        if self.time_s < BLOCK_S || self.readings < BLOCK_READINGS {
            return None;
        }
        let block = self.block();
        *self = Self { follows: true, ..Self::default() };
        Some(block)
    }

    fn take(&mut self, record: &Record, step_s: f64) {
        let s = &record.sample;
        self.time_s += step_s;
        if self.readings == 0 {
            self.unsigned = [true; 2];
        }
        self.readings += 1;
        let readings = s.readings().into_iter().chain([s.force_n]);
        for ((sum, count), reading) in self.sums.iter_mut().zip(&mut self.counts).zip(readings) {
            if let Some(reading) = reading {
                *sum += reading;
                *count += 1;
            }
        }
        for (unsigned, flow) in self.unsigned.iter_mut().zip([s.qa_m3s, s.qb_m3s]) {
            *unsigned &= flow.is_none_or(|flow| flow >= 0.0);
        }
        let [t, tt, tx, xx] = &mut self.moments;
        *t += self.time_s;
        *tt += self.time_s * self.time_s;
        *tx += self.time_s * s.x_m;
        *xx += s.x_m * s.x_m;
    }

    fn block(&self) -> Block {
        let n = f64::from(self.readings);
        let [t, tt, tx, xx] = self.moments;
        let power = tt - t * t / n;
        let x = self.sums[0];
        let speed_mps = (tx - t * x / n) / power;
        let left = (xx - x * x / n - speed_mps * speed_mps * power).max(0.0);
        let mean = |channel: usize| (self.counts[channel] == self.readings).then(|| self.sums[channel] / n);
        Block {
            follows: self.follows,
            time_s: self.time_s,
            readings: self.readings,
            speed_mps,
            speed_std_mps: (left / (n - 2.0) / power).sqrt(),
            speed_std_per_m: power.sqrt().recip(),
            means: std::array::from_fn(mean),
            unsigned: self.unsigned,
        }
    }
}
