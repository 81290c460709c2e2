use crate::{LPM_PER_M3S, Real};

/// Constant-flow pump into a line with a relief valve.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Supply<T> {
    /// Pump flow, m³/s.
    pub pump_flow_m3s: T,
    /// Pressure at which the relief valve opens, Pa.
    pub relief_pressure_pa: T,
    /// Relief flow per pressure above that, m³/(s·Pa).
    pub relief_slope_m3spa: T,
    /// Oil that the supply line takes per pressure, V/β, m³/Pa.
    pub compliance_m3pa: T,
}

impl<T: Real> Supply<T> {
    /// Two pumps of 20 L/min together, relief at 10 MPa with 4 % override, 1 L of line.
    pub fn paper() -> Self {
        let pump_flow_m3s = T::lit(40.0 / LPM_PER_M3S);
        Self {
            pump_flow_m3s,
            relief_pressure_pa: T::lit(10e6),
            relief_slope_m3spa: pump_flow_m3s / T::lit(0.4e6),
            compliance_m3pa: T::lit(1e-3 / 0.8e9),
        }
    }

    pub(crate) fn is_physical(&self) -> bool {
        let positive =
            [self.pump_flow_m3s, self.relief_pressure_pa, self.relief_slope_m3spa, self.compliance_m3pa];
        positive.iter().all(|v| v.is_finite() && *v > T::zero())
    }

    /// Flow over the relief valve, m³/s.
    #[inline]
    pub fn relief_m3s(&self, pressure_pa: T) -> T {
        self.relief_slope_m3spa * (pressure_pa - self.relief_pressure_pa).max(T::zero())
    }

    /// dP_S/dt for a flow drawn by the valves, Pa/s.
    #[inline]
    pub fn rate_pas(&self, pressure_pa: T, drawn_m3s: T) -> T {
        (self.pump_flow_m3s - self.relief_m3s(pressure_pa) - drawn_m3s) / self.compliance_m3pa
    }

    /// Pressure with all of the pump's flow over the relief valve, Pa.
    pub fn idle_pressure_pa(&self) -> T {
        self.relief_pressure_pa + self.pump_flow_m3s / self.relief_slope_m3spa
    }
}

#[cfg(test)]
mod tests {
    use super::Supply;

    /// Relief at 10 MPa with 4 % override: there the line rests.
    #[test]
    fn an_idle_supply_rests_at_its_override() {
        let supply = Supply::<f64>::paper();
        let idle_pa = supply.idle_pressure_pa();
        assert!((idle_pa / 10.4e6 - 1.0).abs() < 1e-12, "{idle_pa} Pa");
        assert!(supply.rate_pas(idle_pa, 0.0).abs() < 1.0);
    }
}
