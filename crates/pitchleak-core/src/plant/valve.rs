//! The valve, and the supply that feeds it.

use crate::{LPM_PER_M3S, Real, metering};

/// Four-edge proportional valve: a spool of second order with its stroke limited, square-root
/// metering at each edge (Merritt, "Hydraulic Control Systems", §5-1), lap and area ratio.
/// Spool positions are shares of the stroke, positive: supply to A, B to tank.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Valve<T> {
    /// Flow over one fully open A edge at [`Valve::rated_drop_pa`], m³/s.
    pub rated_flow_m3s: T,
    /// Pressure drop over one edge at which that holds, Pa.
    pub rated_drop_pa: T,
    /// Natural frequency of the spool, Hz.
    pub bandwidth_hz: T,
    /// Damping ratio of the spool.
    pub damping: T,
    /// Opening of every edge at the spool's centre, share of the stroke; negative: overlap.
    pub underlap: T,
    /// Area of the B edges relative to the A edges.
    pub area_ratio_b: T,
    /// Pressure drop below which an edge turns laminar, Pa.
    pub laminar_drop_pa: T,
    /// What passes each edge by its clearance, wherever the spool is, m³/(s·Pa).
    pub clearance_m3spa: T,
}

/// Flows through the valve at one instant.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct ValveFlows<T> {
    /// Into chamber A, m³/s.
    pub a_m3s: T,
    /// Into chamber B, m³/s.
    pub b_m3s: T,
    /// Out of the supply, m³/s.
    pub supply_m3s: T,
}

impl<T: Real> Valve<T> {
    /// A valve that fits the paper's cylinder: 20 L/min at 35 bar per edge, 50 Hz, 3 % underlap,
    /// edges in the ratio of the piston areas.
    pub fn paper() -> Self {
        Self {
            rated_flow_m3s: T::lit(20.0 / LPM_PER_M3S),
            rated_drop_pa: T::lit(3.5e6),
            bandwidth_hz: T::lit(50.0),
            damping: T::lit(0.8),
            underlap: T::lit(0.03),
            area_ratio_b: T::lit(0.746),
            laminar_drop_pa: T::lit(1e5),
            clearance_m3spa: T::zero(),
        }
    }

    pub(crate) fn is_physical(&self) -> bool {
        let positive = [
            self.rated_flow_m3s,
            self.rated_drop_pa,
            self.bandwidth_hz,
            self.damping,
            self.area_ratio_b,
            self.laminar_drop_pa,
        ];
        positive.into_iter().all(T::is_positive)
            && self.underlap.abs() < T::one()
            && self.clearance_m3spa.is_not_negative()
    }

    /// Time derivative of spool position and speed for a command (share of the stroke).
    #[inline]
    pub fn spool_rates(&self, position: T, speed_ps: T, command: T) -> [T; 2] {
        let omega = T::lit(core::f64::consts::TAU) * self.bandwidth_hz;
        let target = command.max(-T::one()).min(T::one());
        [speed_ps, omega * (omega * (target - position) - T::lit(2.0) * self.damping * speed_ps)]
    }

    /// Flows over the four edges.
    #[inline]
    pub fn flows(&self, spool: T, supply_pa: T, pa_pa: T, pb_pa: T) -> ValveFlows<T> {
        let (extend, retract) = self.edges(spool);
        // Together, so that a processor takes two roots at a time.
        let drops_pa = [supply_pa - pa_pa, supply_pa - pb_pa, pa_pa, pb_pa];
        let [from_supply_a, from_supply_b, to_tank_a, to_tank_b] =
            drops_pa.map(|drop| metering(drop, self.laminar_drop_pa));
        let [passing_a, passing_b, leaving_a, leaving_b] = drops_pa.map(|drop| self.clearance_m3spa * drop);
        let supply_to_a = extend * from_supply_a + passing_a;
        let supply_to_b = retract * self.area_ratio_b * from_supply_b + passing_b;
        ValveFlows {
            a_m3s: supply_to_a - retract * to_tank_a - leaving_a,
            b_m3s: supply_to_b - extend * self.area_ratio_b * to_tank_b - leaving_b,
            supply_m3s: supply_to_a + supply_to_b,
        }
    }

    /// Upper bounds of dQ/dP at ports A and B, m³/(s·Pa): how stiff the valve is.
    pub(crate) fn conductances_m3spa(&self, spool: T, supply_pa: T, pa_pa: T, pb_pa: T) -> (T, T) {
        let (extend, retract) = self.edges(spool);
        // From twice the laminar drop on, a root's slope is 0.50 to 0.57 of that of the laminar edge there.
        let slope = |drop: T| {
            let most =
                if drop.abs() > self.laminar_drop_pa + self.laminar_drop_pa { T::lit(0.6) } else { T::one() };
            most * drop.abs().max(self.laminar_drop_pa).sqrt().recip()
        };
        (
            extend * slope(supply_pa - pa_pa) + retract * slope(pa_pa),
            self.area_ratio_b * (retract * slope(supply_pa - pb_pa) + extend * slope(pb_pa)),
        )
    }

    /// Flow per root of pressure drop of the A edges to supply and to tank.
    fn edges(&self, spool: T) -> (T, T) {
        let gain = self.rated_flow_m3s / self.rated_drop_pa.sqrt();
        let spool = spool.max(-T::one()).min(T::one());
        (gain * (self.underlap + spool).max(T::zero()), gain * (self.underlap - spool).max(T::zero()))
    }
}

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
        positive.into_iter().all(T::is_positive)
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
