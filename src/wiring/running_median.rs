use serde::{Deserialize, Serialize};

/// The median of numbers as they come, by five markers: the P² algorithm (Jain and Chlamtac 1985, "The P² algorithm for
/// dynamic calculation of quantiles and histograms without storing observations").
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub(super) struct RunningMedian {
    /// Of least, lower quartile, median, upper quartile, largest; in the order in which they came below five numbers.
    heights: [f64; MARKERS],
    /// Numbers up to each marker, less one.
    places: [f64; MARKERS],
    count: u32,
}

const MARKERS: usize = 5;
/// Where the inner markers should be, as shares of the numbers.
const SHARES: [(usize, f64); 3] = [(1, 0.25), (2, 0.5), (3, 0.75)];

impl RunningMedian {
    /// Takes in the next number.
    #[inline]
    pub fn add(&mut self, value: f64) {
        let count = self.count as usize;
        self.count = self.count.saturating_add(1);
        if let Some(height) = self.heights.get_mut(count) {
            *height = value;
            if count + 1 == MARKERS {
                self.heights.sort_by(f64::total_cmp);
                self.places = [0.0, 1.0, 2.0, 3.0, 4.0];
            }
            return;
        }
        let [least, .., most] = &mut self.heights;
        (*least, *most) = (least.min(value), most.max(value));
        for (place, height) in self.places.iter_mut().zip(&self.heights).skip(1) {
            *place += f64::from(u8::from(value < *height));
        }
        self.places[MARKERS - 1] = count as f64;
        for (at, share) in SHARES {
            self.adjust(at, share * count as f64);
        }
    }

    /// Moves a marker by a place where it is a whole one off.
    #[inline]
    fn adjust(&mut self, at: usize, wanted: f64) {
        let ([n0, n, n2], [q0, q, q2]) = (self.around(&self.places, at), self.around(&self.heights, at));
        let off = wanted - n;
        if !(off >= 1.0 && n2 - n > 1.0 || off <= -1.0 && n0 - n < -1.0) {
            return;
        }
        let step = off.signum();
        let slopes = [(q - q0) / (n - n0), (q2 - q) / (n2 - n)];
        let parabola = q + step / (n2 - n0) * ((n - n0 + step) * slopes[1] + (n2 - n - step) * slopes[0]);
        let line = q + step * if step > 0.0 { slopes[1] } else { slopes[0] };
        self.heights[at] = if q0 < parabola && parabola < q2 { parabola } else { line };
        self.places[at] += step;
    }

    fn around(&self, of: &[f64; MARKERS], at: usize) -> [f64; 3] {
        [of[at - 1], of[at], of[at + 1]]
    }

    /// As far as the numbers tell; none of fewer than five.
    pub fn value(&self) -> Option<f64> {
        (self.count as usize >= MARKERS).then_some(self.heights[2])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::Normal;

    #[test]
    fn it_is_that_of_all_numbers_to_two_hundredths() {
        for seed in 1..=20 {
            let mut normal = Normal::stream(seed, 0);
            let mut numbers: Vec<f64> = (0..3000).map(|_| normal.draw().abs()).collect();
            let mut median = RunningMedian::default();
            numbers.iter().for_each(|number| median.add(*number));
            numbers.sort_by(f64::total_cmp);
            let found = median.value().unwrap_or_default();
            assert!((found / numbers[1500] - 1.0).abs() < 0.02, "{found} {}", numbers[1500]);
        }
    }

    #[test]
    fn equal_numbers_are_their_own_median() {
        let mut median = RunningMedian::default();
        assert_eq!(median.value(), None);
        (0..100).for_each(|_| median.add(0.5));
        assert_eq!(median.value(), Some(0.5));
    }
}
