//! How a channel's readings scatter about its motion.

use crate::Real;

/// Mean size of a third difference of white noise of unit standard deviation: √(20 · 2/π).
const THIRD_DIFFERENCE: f64 = 3.568_248_232;

/// Mean size of the third differences of a channel's readings.
#[derive(Clone, Copy, Debug, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Scatter<T> {
    last: [T; 3],
    known: u32,
    sum: T,
    count: T,
}

impl<T: Real> Scatter<T> {
    /// Takes in the next reading.
    pub fn add(&mut self, reading: Option<T>, after_gap: bool) {
        if after_gap {
            self.known = 0;
        }
        let Some(now) = reading else { return };
        let [one, two, three] = self.last;
        if self.known >= 3 {
            self.sum += (now - T::lit(3.0) * (one - two) - three).abs();
            self.count += T::one();
        }
        self.last = [now, one, two];
        self.known = self.known.saturating_add(1);
    }

    /// Standard deviation of their white noise; none of fewer than four.
    pub fn std(&self) -> Option<T> {
        (self.count > T::zero()).then(|| self.sum / (self.count * T::lit(THIRD_DIFFERENCE)))
    }
}
