use crate::Real;

/// How [`Rls`](super::Rls) remembers and averages.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct RlsSettings<T> {
    /// Longest memory, s; infinite to remember everything. How much of it counts is learnt from the data.
    pub forgetting_time_s: T,
    /// Length of the balance's blocks, s: the estimates are renewed after every second block, by the sixth sample that
    /// follows it. A block has eight samples at least.
    pub block_time_s: T,
    /// A step longer than this, s, is a gap: nothing is integrated over it.
    pub max_step_s: T,
}

impl<T: Real> Default for RlsSettings<T> {
    fn default() -> Self {
        Self { forgetting_time_s: T::infinity(), block_time_s: T::lit(0.25), max_step_s: T::lit(0.5) }
    }
}
