//! On which side of its play a position sensor lies. The flows say how far the piston goes, with no noise of the position in it; what moves a
//! sensor with play saturates, so that a slow drift of that way is forgotten at each turn.

use super::side::{ANYWHERE, Sides};
use crate::diagnose::thresholds::BLOCK_S;
use pitchleak_core::effects::Play;
use std::ops::Range;

/// A position reading along a trace and the way that the flows say beside it, m.
pub(super) struct Followed<'a> {
    pub(super) stretches: Vec<Range<usize>>,
    pub(super) samples_per_block: usize,
    pub(super) x_m: &'a [f64],
    pub(super) way_m: &'a [f64],
    /// Of one reading.
    pub(super) noise_std_m: f64,
}

/// χ² by which a play must explain the reading better than none does: six standard deviations, for the best of many plays is taken.
const EVIDENT_CHI2: f64 = 36.0;
/// Ratio of two plays that are tried one after the other.
const NEXT_PLAY: f64 = 1.2;
/// Steps of the last search between two of them.
const REFINEMENTS: usize = 6;

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
                is_known |= side.abs() > 0.999;
                (own.side[at], own.side_std[at]) = (side, if is_known { 0.0 } else { ANYWHERE });
            }
        }
        own
    }

    /// The play with the least sum of squares of the difference between way and reading, block by block; none where it
    /// is hardly less than without any.
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
        let evident = none - EVIDENT_CHI2 * 2.0 * self.noise_std_m.powi(2) / self.samples_per_block as f64;
        let best = tried.into_iter().min_by(|a, b| a.0.total_cmp(&b.0)).filter(|best| best.0 < evident)?;
        let refine = |(best, share): ((f64, f64), f64), _| {
            let beside = [best.1 * share, best.1 / share].map(|play_m| (left(play_m), play_m));
            (beside.into_iter().fold(best, |best, one| if one.0 < best.0 { one } else { best }), share.sqrt())
        };
        Some((0..REFINEMENTS).fold((best, NEXT_PLAY.sqrt()), refine).0.1)
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
mod tests {
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
