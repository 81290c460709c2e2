//! The leaks, and what is told of each: its value and how well that is known.

use crate::Real;
use core::ops::{Index, IndexMut};

/// Where oil can leak.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(rename_all = "snake_case"))]
pub enum Leak {
    /// Past the piston seal, chamber A to chamber B.
    Internal,
    /// Out of chamber A.
    ExternalA,
    /// Out of chamber B.
    ExternalB,
}

impl Leak {
    /// Every leak, in the order of [`PerLeak`]'s fields.
    pub const ALL: [Self; 3] = [Self::Internal, Self::ExternalA, Self::ExternalB];

    /// Its name in files, that of its field in [`PerLeak`].
    pub const fn id(self) -> &'static str {
        match self {
            Self::Internal => "internal",
            Self::ExternalA => "external_a",
            Self::ExternalB => "external_b",
        }
    }

    /// Its name for people.
    pub const fn label(self) -> &'static str {
        match self {
            Self::Internal => "internal",
            Self::ExternalA => "external A",
            Self::ExternalB => "external B",
        }
    }
}

/// One value per kind of leak: a coefficient in m³/(s·Pa), a flow in m³/s, …; the name of what holds it says
/// which.
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
    /// What `f` says of each leak.
    pub fn from_fn(mut f: impl FnMut(Leak) -> V) -> Self {
        Self { internal: f(Leak::Internal), external_a: f(Leak::ExternalA), external_b: f(Leak::ExternalB) }
    }

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

    /// Each leak with its value, in the order of [`Leak::ALL`].
    pub fn iter(&self) -> core::array::IntoIter<(Leak, &V), 3> {
        Leak::ALL.map(|leak| (leak, &self[leak])).into_iter()
    }
}

impl<V> PerLeak<Option<V>> {
    /// All values, where none is missing.
    pub fn complete(self) -> Option<PerLeak<V>> {
        Some(PerLeak { internal: self.internal?, external_a: self.external_a?, external_b: self.external_b? })
    }
}

impl<T: Real> PerLeak<T> {
    /// Whether every value is a number and none is negative, as a leak's coefficient must be.
    pub fn is_physical(&self) -> bool {
        self.iter().all(|(_, value)| value.is_not_negative())
    }
}

impl<V> Index<Leak> for PerLeak<V> {
    type Output = V;

    #[inline]
    fn index(&self, leak: Leak) -> &V {
        match leak {
            Leak::Internal => &self.internal,
            Leak::ExternalA => &self.external_a,
            Leak::ExternalB => &self.external_b,
        }
    }
}

impl<V> IndexMut<Leak> for PerLeak<V> {
    #[inline]
    fn index_mut(&mut self, leak: Leak) -> &mut V {
        match leak {
            Leak::Internal => &mut self.internal,
            Leak::ExternalA => &mut self.external_a,
            Leak::ExternalB => &mut self.external_b,
        }
    }
}

impl<'a, V> IntoIterator for &'a PerLeak<V> {
    type Item = (Leak, &'a V);
    type IntoIter = core::array::IntoIter<(Leak, &'a V), 3>;

    fn into_iter(self) -> Self::IntoIter {
        self.iter()
    }
}

impl<V> IntoIterator for PerLeak<V> {
    type Item = (Leak, V);
    type IntoIter = core::array::IntoIter<(Leak, V), 3>;

    fn into_iter(self) -> Self::IntoIter {
        let [internal, external_a, external_b] = Leak::ALL;
        [(internal, self.internal), (external_a, self.external_a), (external_b, self.external_b)].into_iter()
    }
}

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
    use super::*;

    #[test]
    fn a_leak_finds_its_own_value() {
        let mut names = PerLeak::from_fn(Leak::id);
        assert_eq!(
            (names.internal, names.external_a, names.external_b),
            ("internal", "external_a", "external_b")
        );
        for (leak, name) in names {
            assert_eq!((names[leak], name), (leak.id(), leak.id()));
        }
        names[Leak::ExternalA] = "port";
        assert_eq!(names, PerLeak { external_a: "port", ..PerLeak::from_fn(Leak::id) });
        let owned: std::vec::Vec<_> = names.into_iter().map(|(leak, name)| (leak, name.len())).collect();
        assert_eq!(owned, [(Leak::Internal, 8), (Leak::ExternalA, 4), (Leak::ExternalB, 10)]);
        assert_eq!(names.zip(PerLeak::from_fn(|leak| leak)).external_b, ("external_b", Leak::ExternalB));
    }

    #[test]
    fn one_that_is_missing_leaves_none() {
        for gap in Leak::ALL {
            assert_eq!(PerLeak::from_fn(|leak| (leak != gap).then_some(1)).complete(), None);
        }
        assert_eq!(PerLeak::from_fn(Some).complete(), Some(PerLeak::from_fn(|leak| leak)));
    }

    #[test]
    fn a_coefficient_is_a_number_and_not_negative() {
        for leak in Leak::ALL {
            for (value, physical) in
                [(0.0, true), (1e-11, true), (-1e-20, false), (f64::NAN, false), (f64::INFINITY, false)]
            {
                let mut coefficients = PerLeak::default();
                coefficients[leak] = value;
                assert_eq!(coefficients.is_physical(), physical, "{leak:?} {value}");
            }
        }
    }

    #[test]
    fn the_interval_lies_around_the_value() {
        let [low, high] = Estimate { value: 3.0_f64, std: 0.5 }.ci95();
        assert!((low - 2.020_018).abs() < 1e-6 && (high - 3.979_982).abs() < 1e-6, "{low} to {high}");
    }
}
