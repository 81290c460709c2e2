use crate::{PerLeak, Real};

/// A number with its standard deviation, both in the unit of the quantity.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Estimate<T> {
    /// Best value.
    pub value: T,
    /// Standard deviation of its error.
    pub std: T,
}

impl<T: Real> Estimate<T> {
    /// Half width of [`ci95`](Self::ci95).
    pub fn half_width95(&self) -> T {
        T::lit(1.959_963_984_540_054) * self.std
    }

    /// The interval that holds the true value with 95 % probability, `[low, high]`.
    pub fn ci95(&self) -> [T; 2] {
        let half = self.half_width95();
        [self.value - half, self.value + half]
    }

    /// The same quantity in another unit: value and spread times `factor`.
    pub fn scaled(&self, factor: T) -> Self {
        Self { value: self.value * factor, std: self.std * factor.abs() }
    }
}

/// Mean pressures that drive the leaks, as the sensors read them.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct LeakPressures<T> {
    /// Means of |P_L|, P_A, P_B, Pa.
    pub sizes_pa: PerLeak<T>,
    /// Mean sign of P_L, −1 to 1: how much of a bias of P_L stays in the mean of |P_L|.
    pub load_sign: T,
}

#[cfg(test)]
mod tests {
    use super::Estimate;

    #[test]
    fn the_interval_lies_around_the_value() {
        let [low, high] = Estimate { value: 3.0_f64, std: 0.5 }.ci95();
        assert!((low - 2.020_018).abs() < 1e-6 && (high - 3.979_982).abs() < 1e-6, "{low} to {high}");
    }
}
