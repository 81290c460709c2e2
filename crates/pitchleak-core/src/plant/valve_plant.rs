use super::{
    CYLINDER_STATES, CylinderPlant, CylinderRates, CylinderState, Drive, PlantError, Supply, Valve,
    number_or_zero, substeps,
};
use crate::{PerLeak, Real, rk4_step};

/// The pitching cylinder with its valve and supply: one state vector of seven numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct ValvePlant<T> {
    /// The cylinder.
    pub cylinder: CylinderPlant<T>,
    /// The valve.
    pub valve: Valve<T>,
    /// The supply.
    pub supply: Supply<T>,
}

/// State of a [`ValvePlant`].
#[derive(Clone, Copy, Debug, PartialEq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct ValvePlantState<T> {
    /// The cylinder's state.
    pub cylinder: CylinderState<T>,
    /// Spool position, share of the stroke.
    pub spool: T,
    /// Spool speed, 1/s.
    pub spool_speed_ps: T,
    /// Supply pressure, Pa.
    pub supply_pa: T,
}

const STATES: usize = CYLINDER_STATES + 3;

impl<T: Real> ValvePlant<T> {
    /// Says whether a plant like this can exist.
    pub fn check(&self) -> Result<(), PlantError> {
        self.cylinder.check()?;
        if !self.valve.is_physical() {
            Err(PlantError::Valve)
        } else if !self.supply.is_physical() {
            Err(PlantError::Supply)
        } else {
            Ok(())
        }
    }

    /// Centred valve and idle supply around a state of the cylinder.
    pub fn state_at(&self, cylinder: CylinderState<T>) -> ValvePlantState<T> {
        let supply_pa = self.supply.idle_pressure_pa();
        ValvePlantState { cylinder, spool: T::zero(), spool_speed_ps: T::zero(), supply_pa }
    }

    /// The state `step_s` later under a constant valve command (share of the stroke, ±1) and load
    /// against extension. What is not a number counts as zero; a step that is not positive and
    /// finite changes nothing.
    pub fn step(&self, state: &ValvePlantState<T>, step_s: T, command: T, load_n: T) -> ValvePlantState<T> {
        let command = number_or_zero(command);
        let (pa_pa, pb_pa) = self.cylinder.pressures_pa(&state.cylinder);
        let (at_a, at_b) = self.valve.conductances_m3spa(state.spool, state.supply_pa, pa_pa, pb_pa);
        let rate = self.cylinder.fastest_rate_ps(&state.cylinder)
            + self.cylinder.filling_ps(&state.cylinder, at_a, at_b)
            + (self.supply.relief_slope_m3spa + at_a + at_b) / self.supply.compliance_m3pa;
        let (count, step) = substeps(step_s, rate);
        let mut next = *state;
        for _ in 0..count {
            let raw = rk4_step(&next.to_array(), step, |_, y| {
                let now = ValvePlantState::from_array(*y);
                let (rates, drawn_m3s) = self.rates(&now, load_n);
                let [spool, spool_speed] = self.valve.spool_rates(now.spool, now.spool_speed_ps, command);
                let supply = self.supply.rate_pas(now.supply_pa, drawn_m3s);
                let a_mps2 = rates.signals.a_mps2;
                [now.cylinder.v_mps, a_mps2, rates.oil_a_m3s, rates.oil_b_m3s, spool, spool_speed, supply]
            });
            next = self.limited(ValvePlantState::from_array(raw), next);
        }
        next
    }

    /// The cylinder's rates, and the flow drawn from the supply, m³/s.
    pub fn rates(&self, state: &ValvePlantState<T>, load_n: T) -> (CylinderRates<T>, T) {
        let pressures_pa = self.cylinder.pressures_pa(&state.cylinder);
        let flows = self.valve.flows(state.spool, state.supply_pa, pressures_pa.0, pressures_pa.1);
        let drive = Drive { qa_m3s: flows.a_m3s, qb_m3s: flows.b_m3s, force_n: load_n };
        let drive = self.cylinder.bounded(drive);
        (self.cylinder.rates_under(&state.cylinder, pressures_pa, &drive), flows.supply_m3s)
    }

    /// Leak flows of a state, m³/s.
    pub fn leaks_m3s(&self, state: &ValvePlantState<T>) -> PerLeak<T> {
        let (rates, _) = self.rates(state, T::zero());
        self.cylinder.leaks_m3s(&rates.signals)
    }

    fn limited(&self, next: ValvePlantState<T>, last: ValvePlantState<T>) -> ValvePlantState<T> {
        let or = |value: T, fallback: T| if value.is_finite() { value } else { fallback };
        ValvePlantState {
            cylinder: self.cylinder.limited(next.cylinder, last.cylinder),
            spool: or(next.spool, last.spool),
            spool_speed_ps: or(next.spool_speed_ps, T::zero()),
            supply_pa: or(next.supply_pa, last.supply_pa).max(T::zero()),
        }
    }
}

impl<T: Real> ValvePlantState<T> {
    fn to_array(self) -> [T; STATES] {
        let [x, v, oil_a, oil_b] = self.cylinder.to_array();
        [x, v, oil_a, oil_b, self.spool, self.spool_speed_ps, self.supply_pa]
    }

    fn from_array([x, v, oil_a, oil_b, spool, spool_speed_ps, supply_pa]: [T; STATES]) -> Self {
        let cylinder = CylinderState::from_array([x, v, oil_a, oil_b]);
        Self { cylinder, spool, spool_speed_ps, supply_pa }
    }
}
