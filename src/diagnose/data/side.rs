//! On which side of its play a sensor lies, read from what it shows: behind a pressure that rises or falls, or on its way from one side to the
//! other, while its reading stands. How far on that way it is nothing shows of a pressure; of a position the flows do (`backlash.rs`).

use crate::diagnose::thresholds::{BLOCK_S, TURNED_SIGMA};
use pitchleak_core::effects::Play;
use std::ops::Range;

/// Of one reading, sample by sample.
#[derive(Default)]
pub(crate) struct Sides {
    /// 1 behind what rises, −1 behind what falls; in between what is to be expected.
    pub(crate) side: Vec<f64>,
    /// Standard deviation of that: zero where it is known.
    pub(crate) side_std: Vec<f64>,
}

/// Standard deviation of a side anywhere between −1 and 1.
pub(super) const ANYWHERE: f64 = 0.577_350_269_189_625_8;
/// A reading stands when it has not moved for so long, s: noise alone hides slow motion for less.
const LONGEST_STILL_S: f64 = BLOCK_S / 2.0;
/// Of a reading that stands, what its sensor's side is on average, of the straight way from the last motion to the next.
/// Measured on pressures in wind of 5 to 30 m/s under plays of 0.3 and 2 bar: 0.5 to 0.9 where it turns, 0 to 0.9 where it goes on as before.
const OF_STRAIGHT_WAY: f64 = 0.5;

/// The last motion of a reading before a sample, or its next one after it.
#[derive(Clone, Copy, Default)]
struct Moved {
    t_s: f64,
    /// 1 up, −1 down, in the order of time; zero where there is none.
    way: f64,
}

impl Sides {
    /// Of so many readings without play.
    pub(super) fn none(count: usize) -> Self {
        Self { side: vec![0.0; count], side_std: vec![0.0; count] }
    }

    /// Of a reading that is smoothed, with what noise is left.
    pub(super) fn of(t_s: &[f64], smooth: &[f64], noise_std: f64) -> Self {
        let play = TURNED_SIGMA * noise_std;
        let before = moved(t_s.iter().zip(smooth), play);
        let mut after = moved(t_s.iter().zip(smooth).rev(), play);
        after.reverse();
        after.iter_mut().for_each(|one| one.way = -one.way);
        let pairs = t_s.iter().zip(before.iter().zip(&after));
        let (side, side_std) = pairs.map(|(t, (before, after))| between(*t, *before, *after)).unzip();
        Self { side, side_std }
    }

    /// Standard deviation of what a sensor with this play reads beside what its side says through a row, as if white from sample to sample; the
    /// play and this in standard deviations of its noise. A row is a hat over two blocks of m samples: white noise has a variance of 2/3 m
    /// there, what stays the same has m².
    pub(crate) fn noise_times(&self, samples: Range<usize>, play: f64) -> f64 {
        let own = self.side_std.get(samples).unwrap_or_default();
        let sum: f64 = own.iter().map(|std| std * std).sum();
        play * (0.75 * sum).sqrt()
    }
}

/// When and which way each sample's reading had last moved beyond its noise: a play as wide as that is pushed.
fn moved<'a>(samples: impl Iterator<Item = (&'a f64, &'a f64)>, play: f64) -> Vec<Moved> {
    let mut own: Option<(Play<f64>, f64)> = None;
    let mut last = Moved::default();
    samples
        .map(|(t, value)| {
            let (operator, middle) = own.get_or_insert_with(|| (Play::new(*value), *value));
            let now = operator.update(play, *value);
            if now.to_bits() != middle.to_bits() {
                last = Moved { t_s: *t, way: (now - *middle).signum() };
            }
            *middle = now;
            last
        })
        .collect()
}

/// The side at a time between two motions, and its standard deviation.
fn between(t_s: f64, before: Moved, after: Moved) -> (f64, f64) {
    let still_s = after.t_s - before.t_s;
    match (before.way, after.way) {
        (a, b) if a * b < 0.0 => {
            let share = if still_s > 0.0 { (t_s - before.t_s) / still_s } else { 0.5 };
            (OF_STRAIGHT_WAY * (a + (b - a) * share), ANYWHERE)
        }
        // Nothing moved before, or nothing will.
        (a, b) if a * b == 0.0 => (OF_STRAIGHT_WAY * (a + b), ANYWHERE),
        // It may have gone and come back.
        (a, _) if still_s > LONGEST_STILL_S => (OF_STRAIGHT_WAY * a, ANYWHERE),
        (a, _) => (a, 0.0),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use pitchleak_testkit::white_noise;

    const PLAY_PA: f64 = 2e5;
    const NOISE_PA: f64 = 5e3;

    /// A minute at 100 Hz: time, reading with noise, true side.
    fn hanging(size_pa: f64) -> (Vec<f64>, Vec<f64>, Vec<f64>) {
        let mut play = Play::new(0.0);
        let times = (0..6000_u32).map(|k| 0.01 * f64::from(k));
        let each = times.zip(white_noise(3)).map(|(t, noise)| {
            let truth = size_pa * ((1.3 * t).sin() + 0.6 * (3.1 * t).sin());
            let read = play.update(PLAY_PA, truth);
            (t, (read + NOISE_PA * noise, (truth - read) / PLAY_PA))
        });
        let (t, (read, side)): (Vec<_>, (Vec<_>, Vec<_>)) = each.unzip();
        (t, read, side)
    }

    #[test]
    fn a_side_is_known_while_the_reading_moves_and_on_its_way_while_it_stands() {
        for size_pa in [4e5, 2e6] {
            let (t, read, truth) = hanging(size_pa);
            let own = Sides::of(&t, &read, NOISE_PA);
            let mean = |is_wanted: &dyn Fn(usize) -> bool, of: &dyn Fn(usize) -> f64| {
                let at: Vec<usize> = (100..5900).filter(|at| is_wanted(*at)).collect();
                at.iter().map(|at| of(*at)).sum::<f64>() / at.len() as f64
            };
            let is_known = |at: usize| own.side_std[at] == 0.0;
            let known = mean(&|_| true, &|at| if is_known(at) { 1.0 } else { 0.0 });
            let error = |at: usize| (own.side[at] - truth[at]).powi(2);
            let (sure, unsure) = (mean(&is_known, &error), mean(&|at| !is_known(at), &error));
            assert!(known > 0.25 && sure < 0.01 && unsure < ANYWHERE.powi(2), "{known} {sure} {unsure}");
        }
    }

    #[test]
    fn noise_alone_turns_nothing() {
        let (t, read, _) = hanging(0.5 * PLAY_PA);
        let own = Sides::of(&t, &read, NOISE_PA);
        let moving = own.side_std.iter().filter(|std| **std <= 0.0).count();
        assert!(moving < 30, "{moving} of 6000");
        assert!(own.noise_times(1000..1020, 0.0) == 0.0 && own.noise_times(1000..1020, 40.0) > 50.0);
    }
}
