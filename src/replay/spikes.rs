//! Single wild readings, as a disturbed cable makes them, are left out before anything is estimated.
//!
//! A reading is wild where it steps away from the one before by far more than the channel usually does; where it stays
//! there, it was none, and the row or two left out are no loss.

use crate::trace::Record;
use pitchleak_core::Sensors;
use std::array::from_fn;

/// A step this many times the usual one, beyond so many standard deviations of the declared noise, is wild.
const USUAL_STEPS: f64 = 10.0;
const NOISE_STDS: f64 = 8.0;
/// … and beyond so many steps of the reading's resolution.
const QUANTA: f64 = 2.5;
/// Wild rows in a row that are left out at the most.
const MOST_IN_A_ROW: u32 = 2;
/// Steps over which the usual one is averaged; as long, at first, every reading is taken. Later one of so many is enough.
const MEMORY: u32 = 64;
const THINNED: u64 = 4;

const CHANNELS: usize = 5;

/// Watches steps; a few instructions per reading.
#[derive(Clone, Copy, Debug, serde::Serialize, serde::Deserialize)]
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
    in_a_row: u32,
    /// Time of the rows left out since the last one taken, s.
    left_out_s: f64,
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
            in_a_row: 0,
            left_out_s: 0.0,
            rows: 0,
        }
    }

    /// Whether to leave this record out.
    #[inline]
    pub fn leave_out(&mut self, record: &Record) -> bool {
        let s = &record.sample;
        let now = [s.x_m, s.pa_pa, s.pb_pa, s.qa_m3s.unwrap_or(f64::NAN), s.qb_m3s.unwrap_or(f64::NAN)];
        // By place: zipped iterators are made by calls here, for every record. Of what was not read there is no step.
        let steps = from_fn(|channel| (now[channel] - self.last[channel]).abs());
        let is_wild = |channel: usize| steps[channel] > self.wild_step[channel];
        let wild = (0..CHANNELS).fold(false, |wild, channel| wild | is_wild(channel));
        if (wild || self.in_a_row > 0) && self.is_spike(wild, record) {
            return true;
        }
        let last = self.last;
        self.last = from_fn(|channel| if now[channel].is_nan() { last[channel] } else { now[channel] });
        self.taken += 1;
        if self.taken <= u64::from(MEMORY) || self.taken.is_multiple_of(THINNED) {
            self.learn(&steps, record);
        }
        false
    }

    /// Whether a record that steps away, or follows one that did, is to be left out.
    #[cold]
    fn is_spike(&mut self, wild: bool, record: &Record) -> bool {
        let follows = !record.after_gap && record.dt_s > 0.0;
        if wild && follows && self.in_a_row < MOST_IN_A_ROW {
            self.in_a_row += 1;
            self.rows += 1;
            self.left_out_s += record.dt_s;
            return true;
        }
        // What stays is no spike.
        self.rows -= if wild { u64::from(self.in_a_row) } else { 0 };
        self.in_a_row = 0;
        false
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

    /// The time that the rows left out before this one stood for, s; it is then forgotten.
    #[inline]
    pub fn take_left_out_s(&mut self) -> f64 {
        std::mem::take(&mut self.left_out_s)
    }

    /// Whether the last record was left out.
    pub fn left_out(&self) -> bool {
        self.in_a_row > 0
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

    /// A slow motion with noise of which row `wild` reads `pa_pa`.
    fn left_out(change: impl Fn(usize, &mut Record)) -> Vec<usize> {
        let sensors = Rig::paper().sensors();
        let mut spikes = Spikes::new(&sensors);
        let mut normal = Normal::stream(1, 0);
        let rows = (0..2000).filter(|k| {
            let t_s = 0.01 * *k as f64;
            let mut record = Record { t_s, dt_s: 0.01, ..Record::default() };
            record.sample.x_m = 0.1 + 0.05 * t_s.sin() + sensors.position.noise_std * normal.draw();
            record.sample.pa_pa = 5e6 + 1e6 * (3.0 * t_s).sin() + sensors.pressure.noise_std * normal.draw();
            record.sample.qa_m3s = Some(sensors.flow_a.noise_std * normal.draw());
            change(*k, &mut record);
            spikes.leave_out(&record)
        });
        rows.collect()
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
        assert_eq!(stepped, [1000, 1001]);
    }
}
