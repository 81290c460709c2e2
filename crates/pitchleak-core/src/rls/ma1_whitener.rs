use crate::Real;

/// Last whitened balance and its weight on the next: the pressure noise at a block's end stands in two
/// blocks with opposite sign (a moving average of order 1, inverted recursively).
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(
    feature = "serde",
    serde(bound(
        serialize = "T: serde::Serialize + Copy",
        deserialize = "T: Real + serde::Deserialize<'de>"
    ))
)]
pub(super) struct Ma1Whitener<T, const N: usize> {
    pub left: T,
    #[cfg_attr(feature = "serde", serde(with = "crate::number::arrays::vector"))]
    pub columns: [T; N],
    /// Variance of the stored oil's pressure noise at the block's end.
    pub stored: T,
    /// Variance of the block's innovation.
    pub variance: T,
}

impl<T: Real, const N: usize> Ma1Whitener<T, N> {
    /// Share of this block's innovation that is expected to come back in the next.
    pub fn share(&self) -> T {
        self.stored / self.variance
    }
}
