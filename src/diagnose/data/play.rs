//! On which side of its play a sensor lies, read from what it shows: behind a pressure that rises or falls, or on its way from one side to the
//! other, while its reading stands. How far on that way it is nothing shows of a pressure. Of a position the flows do: they say how far the
//! piston goes, with no noise of the position in it; what moves a sensor with play saturates, so that a slow drift of that way is forgotten
//! at each turn.

use crate::diagnose::thresholds::{
    BLOCK_S, EVIDENT_SIGMA, HALVINGS, NEXT_PLAY, OF_STRAIGHT_WAY, ROUNDING, SIGNIFICANT_SIGMA,
};
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

    /// Of a reading that is smoothed, with what noise is left, behind a play of this size as far as it is known.
    pub(super) fn of(t_s: &[f64], smooth: &[f64], noise_std: f64, known: f64) -> Self {
        let play = SIGNIFICANT_SIGMA * noise_std;
        let before = moved(t_s.iter().zip(smooth), play);
        let mut after = moved(t_s.iter().zip(smooth).rev(), play);
        after.reverse();
        after.iter_mut().for_each(|one| one.way = -one.way);
        let pairs = t_s.iter().zip(before.iter().zip(&after));
        // What a smaller play hides, noise hides, too.
        let held = if known > 0.0 { OF_STRAIGHT_WAY * known / (known + EVIDENT_SIGMA * play) } else { 0.0 };
        let (side, side_std) = pairs.map(|(t, (before, after))| between(*t, *before, *after, held)).unzip();
        Self { side, side_std }
    }

    /// Standard deviation of what a sensor with this play reads beside what its side says through a row, as if white from sample to sample; the
    /// play and this in standard deviations of its noise. A row is a test function over two blocks of m samples: white noise has a variance of 2/3 m
    /// there, what stays the same has m².
    pub(crate) fn noise_factor(&self, samples: Range<usize>, play: f64) -> f64 {
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

/// The side at a time between two motions, and its standard deviation; `held` is what is left of it where the reading stands and goes on as before.
fn between(t_s: f64, before: Moved, after: Moved, held: f64) -> (f64, f64) {
    let still_s = after.t_s - before.t_s;
    match (before.way, after.way) {
        (a, b) if a * b < 0.0 => {
            let share = if still_s > 0.0 { (t_s - before.t_s) / still_s } else { 0.5 };
            (OF_STRAIGHT_WAY * (a + (b - a) * share), ANYWHERE)
        }
        // Nothing moved before, or nothing will.
        (a, b) if a * b == 0.0 => (held * (a + b), ANYWHERE),
        // Noise alone hides slow motion for half a block; for longer it may have gone and come back.
        (a, _) if still_s > BLOCK_S / 2.0 => (held * a, ANYWHERE),
        (a, _) => (a, 0.0),
    }
}

/// A position reading along a trace and the way that the flows say beside it, m.
pub(super) struct Followed<'a> {
    pub(super) stretches: Vec<Range<usize>>,
    pub(super) samples_per_block: usize,
    pub(super) x_m: &'a [f64],
    pub(super) way_m: &'a [f64],
    /// Of one reading.
    pub(super) noise_std_m: f64,
}

impl<'a> Followed<'a> {
    pub(super) fn new(
        (stretches, step_s): (Vec<Range<usize>>, f64),
        (x_m, way_m): (&'a [f64], &'a [f64]),
        noise_std_m: f64,
    ) -> Self {
        let samples_per_block = ((BLOCK_S / step_s.max(1e-9)).round() as usize).max(1);
        Self { stretches, samples_per_block, x_m, way_m, noise_std_m }
    }

    /// The sides, with the play that explains most of how way and reading differ; none where that is no more than noise makes.
    pub(super) fn sides(&self) -> Sides {
        self.likely_play().map_or_else(|| Sides::none(self.x_m.len()), |play_m| self.sides_with(play_m))
    }

    fn sides_with(&self, play_m: f64) -> Sides {
        let mut own = Sides { side: vec![0.0; self.x_m.len()], side_std: vec![ANYWHERE; self.x_m.len()] };
        for stretch in &self.stretches {
            let Some(first) = self.way_m.get(stretch.start) else { continue };
            let (mut play, mut is_known) = (Play::new(*first), false);
            for at in stretch.clone() {
                let side = play.side(play_m, self.way_m[at]);
                is_known |= side.abs() > 1.0 - ROUNDING;
                (own.side[at], own.side_std[at]) = (side, if is_known { 0.0 } else { ANYWHERE });
            }
        }
        own
    }

    /// The play with the least squares of the rest of the difference between way and reading, block by block; none where it is
    /// hardly less than without any.
    fn likely_play(&self) -> Option<f64> {
        let gone = without_mean(self.steps(|at| self.way_m[at] - self.x_m[at]));
        let left = |play_m: f64| {
            let own = self.sides_with(play_m);
            let turned = without_mean(self.steps(|at| play_m * own.side[at]));
            gone.iter().zip(&turned).map(|(gone, turned)| (gone - turned).powi(2)).sum::<f64>()
        };
        let ends =
            self.way_m.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |e, w| (e.0.min(*w), e.1.max(*w)));
        let (mut tried, mut play_m) = (vec![], self.noise_std_m / 2.0);
        while play_m > 0.0 && play_m < (ends.1 - ends.0) / 2.0 {
            tried.push((left(play_m), play_m));
            play_m *= NEXT_PLAY;
        }
        let none = gone.iter().map(|gone| gone * gone).sum::<f64>();
        let evident =
            none - EVIDENT_SIGMA.powi(2) * 2.0 * self.noise_std_m.powi(2) / self.samples_per_block as f64;
        let best = tried.into_iter().min_by(|a, b| a.0.total_cmp(&b.0)).filter(|best| best.0 < evident)?;
        let refine = |(best, share): ((f64, f64), f64), _| {
            let beside = [best.1 * share, best.1 / share].map(|play_m| (left(play_m), play_m));
            (beside.into_iter().fold(best, |best, one| if one.0 < best.0 { one } else { best }), share.sqrt())
        };
        Some((0..HALVINGS).fold((best, NEXT_PLAY.sqrt()), refine).0.1)
    }

    /// Differences of the means of neighbouring blocks.
    fn steps(&self, value: impl Fn(usize) -> f64) -> Vec<f64> {
        let samples = self.samples_per_block;
        let of_stretch = |stretch: &Range<usize>| {
            let blocks = stretch.clone().step_by(samples).filter(|from| from + samples <= stretch.end);
            let means: Vec<f64> =
                blocks.map(|from| (from..from + samples).map(&value).sum::<f64>() / samples as f64).collect();
            means.windows(2).map(|pair| pair[1] - pair[0]).collect::<Vec<_>>()
        };
        self.stretches.iter().flat_map(of_stretch).collect()
    }
}

/// A steady drift is no sign of a play.
fn without_mean(mut values: Vec<f64>) -> Vec<f64> {
    let mean = values.iter().sum::<f64>() / values.len().max(1) as f64;
    values.iter_mut().for_each(|value| *value -= mean);
    values
}

#[cfg(test)]
mod pressure_tests {
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
            let own = Sides::of(&t, &read, NOISE_PA, PLAY_PA);
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

    /// It rises, stands for a second and goes on: behind a play wider than noise it stays where it was, else noise hides what it did.
    #[test]
    fn what_a_play_smaller_than_noise_does_meanwhile_is_not_said() {
        let t: Vec<f64> = (0..300_u32).map(|k| 0.01 * f64::from(k)).collect();
        let read: Vec<f64> = t.iter().map(|t| 1e6 * (t.min(1.0) + (t - 2.0).max(0.0))).collect();
        let side = |known_pa: f64| Sides::of(&t, &read, NOISE_PA, known_pa).side[150];
        assert!(side(0.0) == 0.0 && side(NOISE_PA) < 0.1 && side(40.0 * NOISE_PA) > 0.5);
        let without_noise = Sides::of(&t, &read, 0.0, 0.0);
        assert!(without_noise.side.iter().all(|side| side.is_finite()));
    }

    #[test]
    fn noise_alone_turns_nothing() {
        let (t, read, _) = hanging(0.5 * PLAY_PA);
        let own = Sides::of(&t, &read, NOISE_PA, PLAY_PA);
        let moving = own.side_std.iter().filter(|std| **std <= 0.0).count();
        assert!(moving < 30, "{moving} of 6000");
        assert!(own.noise_factor(1000..1020, 0.0) == 0.0 && own.noise_factor(1000..1020, 40.0) > 50.0);
    }
}

#[cfg(test)]
mod position_tests {
    use super::*;
    use pitchleak_testkit::white_noise;

    const NOISE_M: f64 = 6e-5;

    /// A minute at 100 Hz: what a sensor with play reads of a position, the way that drifts away from it, and the true side.
    fn hanging(play_m: f64) -> (Vec<f64>, Vec<f64>, Vec<f64>) {
        let mut play = Play::new(0.0);
        let each = (0..6000_u32).zip(white_noise(3)).map(|(k, noise)| {
            let t = 0.01 * f64::from(k);
            let truth = 2e-3 * ((1.3 * t).sin() + 0.6 * (3.1 * t).sin());
            let read = play.update(play_m, truth);
            (read + NOISE_M * noise, (truth + 2e-4 * t, (truth - read) / play_m.max(1e-12)))
        });
        let (read, (way, side)): (Vec<_>, (Vec<_>, Vec<_>)) = each.unzip();
        (read, way, side)
    }

    fn followed<'a>(read: &'a [f64], way: &'a [f64]) -> Followed<'a> {
        Followed::new((std::iter::once(0..read.len()).collect(), 0.01), (read, way), NOISE_M)
    }

    #[test]
    fn the_play_and_its_side_are_seen_beside_a_drifting_way() {
        for play_m in [1e-4, 5e-4] {
            let (read, way, truth) = hanging(play_m);
            let own = followed(&read, &way);
            let likely = own.likely_play().expect("hangs behind");
            assert!((likely / play_m - 1.0).abs() < 0.15, "{likely} of {play_m}");
            let sides = own.sides();
            let known: Vec<usize> = (0..6000).filter(|at| sides.side_std[*at] == 0.0).collect();
            let squares: f64 = known.iter().map(|at| (sides.side[*at] - truth[*at]).powi(2)).sum();
            let error = (squares / known.len() as f64).sqrt();
            assert!(known.len() > 5800 && error < 0.3, "{} {error}", known.len());
        }
    }

    #[test]
    fn a_sensor_without_play_has_none_and_a_new_stretch_begins_unknown() {
        let (read, way, _) = hanging(0.0);
        let own = followed(&read, &way);
        let likely = own.likely_play();
        assert!(likely.is_none(), "{likely:?}");
        assert!(own.sides().side.iter().all(|side| *side == 0.0));
        let two = Followed { stretches: vec![0..3000, 3000..6000], ..followed(&read, &way) };
        let sides = two.sides_with(5e-4);
        assert!(sides.side_std[3000] > 0.0 && sides.side_std[2999] == 0.0 && sides.side_std[5999] == 0.0);
    }
}
