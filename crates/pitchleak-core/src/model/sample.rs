use crate::Real;

/// One reading of the sensors. A flow is `None` while its chamber has no meter (or is not fed
/// through it): then only that chamber's equation rests.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Sample<T> {
    /// Piston position x from the A end, m.
    pub x_m: T,
    /// Pressure P_A of the piston-side chamber, Pa gauge.
    pub pa_pa: T,
    /// Pressure P_B of the rod-side chamber, Pa gauge.
    pub pb_pa: T,
    /// Flow Q_A into the piston-side chamber, m³/s.
    pub qa_m3s: Option<T>,
    /// Flow Q_B into the rod-side chamber, m³/s.
    pub qb_m3s: Option<T>,
    /// Load force F against extension, N.
    pub force_n: Option<T>,
}

impl<T: Real> Sample<T> {
    /// P_L = P_A − P_B, Pa.
    #[inline]
    pub fn load_pressure_pa(&self) -> T {
        self.pa_pa - self.pb_pa
    }

    /// x, P_A, P_B, Q_A and Q_B: what the continuity equations need.
    #[inline]
    pub fn readings(&self) -> [Option<T>; 5] {
        [Some(self.x_m), Some(self.pa_pa), Some(self.pb_pa), self.qa_m3s, self.qb_m3s]
    }

    /// Whether every reading that is there is a finite number.
    #[inline]
    pub fn is_finite(&self) -> bool {
        let ok = |q: Option<T>| q.is_none_or(|v| v.is_finite());
        self.x_m.is_finite()
            && self.pa_pa.is_finite()
            && self.pb_pa.is_finite()
            && ok(self.qa_m3s)
            && ok(self.qb_m3s)
            && ok(self.force_n)
    }
}
