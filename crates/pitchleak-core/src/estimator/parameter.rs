/// Parameters that are leaks.
pub(super) const LEAKS: usize = 3;

/// Place of a leak, in the order of [`Leak::ALL`](crate::Leak::ALL), among the parameters.
#[inline]
pub(super) const fn leak_column(leak: usize) -> usize {
    Parameter::Internal as usize + leak
}

/// Parameters of [`Rls`](super::Rls) in their fixed order: an estimator of N parameters has the first N.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(rename_all = "snake_case"))]
pub enum Parameter {
    /// 1/β.
    Compressibility,
    /// C_ip.
    Internal,
    /// C_epA.
    ExternalA,
    /// C_epB.
    ExternalB,
    /// Offset of flow meter A.
    OffsetA,
    /// Offset of flow meter B.
    OffsetB,
    /// Scale error of flow meter A.
    GainA,
    /// Scale error of flow meter B.
    GainB,
    /// Scale error of the position sensor.
    GainPosition,
}

impl Parameter {
    /// All, in order.
    pub const ALL: [Self; 9] = [
        Self::Compressibility,
        Self::Internal,
        Self::ExternalA,
        Self::ExternalB,
        Self::OffsetA,
        Self::OffsetB,
        Self::GainA,
        Self::GainB,
        Self::GainPosition,
    ];
}
