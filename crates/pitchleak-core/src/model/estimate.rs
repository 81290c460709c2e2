use crate::Real;

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
    /// The interval that holds the true value with 95 % probability, `[low, high]`.
    pub fn ci95(&self) -> [T; 2] {
        let half = T::lit(1.959_963_984_540_054) * self.std;
        [self.value - half, self.value + half]
    }

    /// The same quantity in another unit: value and spread times `factor`.
    pub fn scaled(&self, factor: T) -> Self {
        Self { value: self.value * factor, std: self.std * factor.abs() }
    }
}

/// One value per kind of leak.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct PerLeak<V> {
    /// Past the piston seal, chamber A to chamber B.
    pub internal: V,
    /// Out of chamber A.
    pub external_a: V,
    /// Out of chamber B.
    pub external_b: V,
}

impl<V> PerLeak<V> {
    /// Applies `f` to each value.
    pub fn map<W>(self, mut f: impl FnMut(V) -> W) -> PerLeak<W> {
        PerLeak { internal: f(self.internal), external_a: f(self.external_a), external_b: f(self.external_b) }
    }

    /// Pairs each value with that of `other`.
    pub fn zip<W>(self, other: PerLeak<W>) -> PerLeak<(V, W)> {
        PerLeak {
            internal: (self.internal, other.internal),
            external_a: (self.external_a, other.external_a),
            external_b: (self.external_b, other.external_b),
        }
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
