//! Readings as means over as long as the signals go in straight lines.
//!
//! Each signal of each reading is found beside the unknowns. Where signals move by less than their noise from reading to reading, that
//! are many numbers of which each is told badly, and by chance any κ explains them (Neyman, Scott 1948, "Consistent estimates based on
//! partially consistent observations"). Over a straight line a mean says all, with so much less noise.

use super::edges::Signals;
use super::equations::Node;
use super::fit::Run;

/// A mean spans so long at the most, s: a tenth of a part.
const MOST_S: f64 = 0.5;
/// Readings that a line is told by at the least, and then twice, four times as many.
const LEAST: usize = 4;
/// Readings go in lines where they scatter around long ones by so much more than around the shortest: squares over squares.
const STRAIGHT: f64 = 1.05;
/// So many standard deviations of that by chance.
const CHANCE_SIGMAS: f64 = 3.0;
/// Noise of means beyond that of the readings they are of: squares over squares. Noise that is not white is louder in means.
const WHITE: f64 = 1.5;

/// Readings as means.
pub(super) struct Means {
    pub runs: Vec<Run>,
    /// Over how many readings each is one.
    pub count: usize,
    /// The readings' own noise, in the declared one's: squares over squares, at least 1.
    noise: f64,
}

impl Means {
    /// Over the most readings that lie in straight lines, none where two are no line already.
    pub fn of(runs: &[Run], variances: &Signals) -> Option<Self> {
        let shortest = scatter(runs, LEAST, variances);
        let readings = runs.iter().map(|run| run.readings.len()).sum::<usize>() as f64;
        let most = MOST_S * readings / runs.iter().map(Run::seconds).sum::<f64>();
        let is_straight = |length: &usize| {
            let blocks: usize = runs.iter().map(|run| run.readings.len() / length).sum();
            let chance = CHANCE_SIGMAS * (2.0 / (blocks * LEAST).max(1) as f64).sqrt();
            let long = scatter(runs, *length, variances);
            (0..5).all(|at| long[at].is_nan() || long[at] <= (STRAIGHT + chance) * shortest[at])
        };
        let lengths = std::iter::successors(Some(2 * LEAST), |length| Some(2 * length));
        let lines = lengths.take_while(|length| *length as f64 <= most).take_while(is_straight);
        let count = lines.last()? / 2;
        let own = shortest.component_div(variances);
        let noise = own.iter().copied().filter(|own| own.is_finite()).fold(1.0, f64::max);
        Some(Self { runs: runs.iter().map(|run| run.of_means(count)).collect(), count, noise })
    }

    /// Whether what is left of them, in the declared noise's squares, is what white noise of the readings leaves.
    pub fn are_white(&self, left: f64) -> bool {
        left <= WHITE * self.noise
    }
}

/// Mean square of what is left of the signals in lines of so many readings each; of a signal without noise at least its rounding.
fn scatter(runs: &[Run], length: usize, variances: &Signals) -> Signals {
    let middle = 0.5 * (length as f64 - 1.0);
    let power: f64 = (0..length).map(|at| (at as f64 - middle).powi(2)).sum();
    let (mut squares, mut free) = (Signals::zeros(), 0.0);
    for block in runs.iter().flat_map(|run| run.readings.chunks_exact(length)) {
        let mean = block.iter().map(|node| node.signals).sum::<Signals>() / length as f64;
        let places = || (0..).map(|at: u32| f64::from(at) - middle);
        let slope = block.iter().zip(places()).map(|(node, at)| node.signals * at).sum::<Signals>() / power;
        for (node, at) in block.iter().zip(places()) {
            let left = node.signals - mean - slope * at;
            squares += left.component_mul(&left);
        }
        free += length as f64 - 2.0;
    }
    (squares / f64::max(free, 1.0)).zip_map(variances, |square, variance| square + 1e-3 * variance)
}

impl Run {
    /// One reading for each `count` of them.
    fn of_means(&self, count: usize) -> Self {
        let mean = |block: &[Node]| {
            let share = 1.0 / block.len() as f64;
            let tank_pa = block.iter().map(|node| node.spool.tank_pa).sum::<f64>() * share;
            let mut mean = block[0];
            mean.t_s = block.iter().map(|node| node.t_s).sum::<f64>() * share;
            mean.signals = block.iter().map(|node| node.signals).sum::<Signals>() * share;
            mean.spool.tank_pa = tank_pa;
            mean
        };
        Self { readings: self.readings.chunks_exact(count).map(mean).collect() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::valve::edges::{PS, X};
    use pitchleak_testkit::white_noise;

    /// A piston that goes to and fro with this frequency, and a supply that is not read.
    fn run(frequency_hz: f64, noise_m: f64) -> Run {
        let node = |(index, noise): (usize, f64)| {
            let t_s = 0.01 * index as f64;
            let mut signals = Signals::zeros();
            signals[X] = 0.1 + 0.05 * (std::f64::consts::TAU * frequency_hz * t_s).sin() + noise_m * noise;
            signals[PS] = 100e5;
            Node { t_s, signals, spool: Default::default() }
        };
        Run { readings: white_noise(7).enumerate().take(6000).map(node).collect() }
    }

    #[test]
    fn readings_are_means_where_signals_go_in_straight_lines() {
        let variances = Signals::repeat(4e-8);
        let [calm, windy] = [0.02, 2.0].map(|hz| Means::of(&[run(hz, 2e-4)], &variances));
        assert!(windy.is_none());
        let calm = calm.expect("lines");
        assert_eq!((calm.count, calm.runs[0].readings.len()), (16, 375));
        let still = run(0.02, 0.0);
        for (mean, readings) in calm.runs[0].readings.iter().zip(still.readings.chunks(16)) {
            assert!(
                (mean.signals[X] - readings.iter().map(|node| node.signals[X]).sum::<f64>() / 16.0).abs()
                    < 5.0 * 2e-4 / 4.0
            );
            assert!((mean.t_s - 0.5 * (readings[0].t_s + readings[15].t_s)).abs() < 1e-9);
        }
    }

    /// A signal without noise has no lines but its own.
    #[test]
    fn what_moves_without_noise_is_left_as_it_is() {
        assert!(Means::of(&[run(0.2, 0.0)], &Signals::repeat(1e-12)).is_none());
    }
}
