//! Single wild readings, as a disturbed cable makes them, are left out before anything is estimated.
//!
//! A reading is wild where it steps away from the one before by far more than the channel usually does. It waits until the next ones
//! tell: where they stay there, it was none, and is taken in as if nothing had been.

use crate::trace::Record;
use pitchleak_core::Sensors;
use std::array::from_fn;

/// A step this many times the usual one, beyond so many standard deviations of the declared noise, is wild.
const USUAL_STEPS: f64 = 10.0;
const NOISE_STDS: f64 = 8.0;
/// … and beyond so many steps of the reading's resolution.
const QUANTA: f64 = 2.5;
/// Wild rows in a row that are left out at the most.
const MOST_IN_A_ROW: usize = 2;
/// Steps over which the usual one is averaged; as long, at first, every reading is taken. Later one of so many is enough.
const MEMORY: u32 = 64;
const THINNED: u64 = 4;

const CHANNELS: usize = 5;

/// What to do with a record.
#[derive(Debug, PartialEq)]
pub(super) enum Sifted {
    /// It may be a spike: nothing is taken in yet.
    Waits,
    /// Take it.
    Taken,
    /// Take it; those that waited were spikes, and it stands for their time as well, s.
    AfterSpikes(f64),
    /// Take those that waited, which were none, then it.
    AfterAll(Vec<Record>),
}

/// Watches steps; a few instructions per reading.
#[derive(Clone, Debug, serde::Serialize, serde::Deserialize)]
pub(super) struct Spikes {
    /// Position, pressures, flows as last taken.
    last: [f64; CHANNELS],
    usual_step: [f64; CHANNELS],
    least_wild: [f64; CHANNELS],
    /// The smallest step but none: the reading's resolution, at least.
    quantum: [f64; CHANNELS],
    /// The smallest wild step.
    wild_step: [f64; CHANNELS],
    /// Rows taken, and of each channel the steps that were learnt from.
    taken: u64,
    learnt: [u32; CHANNELS],
    /// Wild ones since the last one taken.
    #[serde(default)]
    waiting: Vec<Record>,
    rows: u64,
}

impl Spikes {
    pub fn new(sensors: &Sensors<f64>) -> Self {
        Self {
            last: [0.0; CHANNELS],
            usual_step: [0.0; CHANNELS],
            quantum: [f64::INFINITY; CHANNELS],
            wild_step: [f64::INFINITY; CHANNELS],
            least_wild: sensors.noise_stds().map(|std| NOISE_STDS * std),
            taken: 0,
            learnt: [0; CHANNELS],
            waiting: Vec::new(),
            rows: 0,
        }
    }

    /// What to do with this record.
    #[inline]
    pub fn sift(&mut self, record: &Record) -> Sifted {
        let s = &record.sample;
        let now = [s.x_m, s.pa_pa, s.pb_pa, s.qa_m3s.unwrap_or(f64::NAN), s.qb_m3s.unwrap_or(f64::NAN)];
        // By place: zipped iterators are made by calls here, for every record. Of what was not read there is no step.
        let steps = from_fn(|channel| (now[channel] - self.last[channel]).abs());
        let is_wild = |channel: usize| steps[channel] > self.wild_step[channel];
        let wild = (0..CHANNELS).fold(false, |wild, channel| wild | is_wild(channel));
        let sifted =
            if wild || !self.waiting.is_empty() { self.sift_wild(wild, record) } else { Sifted::Taken };
        if sifted == Sifted::Waits {
            return sifted;
        }
        let last = self.last;
        self.last = from_fn(|channel| if now[channel].is_nan() { last[channel] } else { now[channel] });
        self.taken += 1;
        if self.taken <= u64::from(MEMORY) || self.taken.is_multiple_of(THINNED) {
            self.learn(&steps, record);
        }
        sifted
    }

    /// Of a record that steps away, or follows one that did.
    #[cold]
    fn sift_wild(&mut self, wild: bool, record: &Record) -> Sifted {
        let follows = !record.after_gap && record.dt_s > 0.0;
        if wild && follows && self.waiting.len() < MOST_IN_A_ROW {
            self.waiting.push(*record);
            return Sifted::Waits;
        }
        let waited = std::mem::take(&mut self.waiting);
        if wild && follows {
            return Sifted::AfterAll(waited);
        }
        self.rows += waited.len() as u64;
        Sifted::AfterSpikes(waited.iter().map(|spike| spike.dt_s).sum())
    }

    /// What is usual.
    fn learn(&mut self, steps: &[f64; CHANNELS], record: &Record) {
        if record.after_gap || record.dt_s <= 0.0 {
            return;
        }
        for (channel, step) in steps.iter().enumerate().filter(|(_, step)| !step.is_nan()) {
            self.learnt[channel] = self.learnt[channel].saturating_add(1);
            let share = 1.0 / f64::from(self.learnt[channel].min(MEMORY));
            self.usual_step[channel] += share * (step - self.usual_step[channel]);
            if *step > 0.0 {
                self.quantum[channel] = self.quantum[channel].min(*step);
            }
            if self.learnt[channel] >= MEMORY {
                let usual = USUAL_STEPS * self.usual_step[channel] + self.least_wild[channel];
                self.wild_step[channel] = usual.max(QUANTA * self.quantum[channel]);
            }
        }
    }

    /// What a reader of the results should know of it.
    pub fn warning(&self) -> Option<String> {
        (self.rows > 0)
            .then(|| format!("{} rows with a single wild reading (a spike) were left out", self.rows))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rig::Rig;
    use crate::simulate::Normal;

    /// Rows that are left out of a slow motion with noise and `change`.
    fn left_out(change: impl Fn(usize, &mut Record)) -> Vec<usize> {
        let sensors = Rig::paper().sensors();
        let mut spikes = Spikes::new(&sensors);
        let mut normal = Normal::stream(1, 0);
        let mut taken = Vec::new();
        for k in 0..2000_usize {
            let t_s = 0.01 * k as f64;
            let mut record = Record { line: k as u64, t_s, dt_s: 0.01, ..Record::default() };
            record.sample.x_m = 0.1 + 0.05 * t_s.sin() + sensors.position.noise_std * normal.draw();
            record.sample.pa_pa = 5e6 + 1e6 * (3.0 * t_s).sin() + sensors.pressure.noise_std * normal.draw();
            record.sample.qa_m3s = Some(sensors.flow_a.noise_std * normal.draw());
            change(k, &mut record);
            match spikes.sift(&record) {
                Sifted::Waits => continue,
                Sifted::AfterAll(waited) => taken.extend(waited.iter().map(|waited| waited.line)),
                Sifted::Taken | Sifted::AfterSpikes(_) => {}
            }
            taken.push(record.line);
        }
        assert!(taken.is_sorted());
        assert_eq!(spikes.rows, 2000 - taken.len() as u64);
        (0..2000).filter(|k| !taken.contains(&(*k as u64))).collect()
    }

    #[test]
    fn a_spike_is_left_out_and_nothing_else_is() {
        assert_eq!(left_out(|_, _| ()), [] as [usize; 0]);
        let spiked = left_out(|k, record| {
            if k == 700 || k == 1400 {
                record.sample.pa_pa = 16e6;
            }
        });
        assert_eq!(spiked, [700, 1400]);
    }

    /// A meter that reads whole litres steps seldom, and far beyond its declared noise.
    #[test]
    fn a_coarse_reading_is_no_spike() {
        let rounded = left_out(|k, record| {
            let noisy = 0.3 + 0.08 * Normal::stream(2, k as u64).draw();
            record.sample.qa_m3s = Some(f64::round(noisy) / crate::units::LPM_PER_M3S);
        });
        assert_eq!(rounded, [] as [usize; 0]);
    }

    /// A meter that is read in one row of ten goes further from reading to reading than from row to row.
    #[test]
    fn readings_on_a_clock_of_their_own_are_no_spikes() {
        let seldom = left_out(|k, record| {
            let t_s = 0.01 * k as f64;
            record.sample.qa_m3s = k.is_multiple_of(10).then(|| 5e-4 * (6.0 * t_s).sin());
        });
        assert_eq!(seldom, [] as [usize; 0]);
    }

    #[test]
    fn what_stays_is_taken() {
        let stepped = left_out(|k, record| record.sample.pa_pa += if k < 1000 { 0.0 } else { 4e6 });
        assert_eq!(stepped, [] as [usize; 0]);
    }
}
