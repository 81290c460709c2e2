use super::{Axis, EmulatorParams};
use crate::Real;
use crate::plant::{CylinderRates, CylinderState, Drive, ValveFlows};

/// The one state vector of the rig; x and ẋ are shared by both cylinders.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct State<T> {
    pub pitch: CylinderState<T>,
    /// Oil in the load cylinder's chambers A and B, m³.
    pub load_oil_m3: [T; 2],
    /// Spool positions of the pitch and the load valve, share of the stroke.
    pub spools: [T; 2],
    /// Spool speeds, 1/s.
    pub spool_speeds_ps: [T; 2],
    pub supply_pa: T,
}

const STATES: usize = 11;

/// Pressures of a state, P_A and P_B of each cylinder, Pa: four logarithms that controllers, step size and rates share.
#[derive(Clone, Copy)]
pub(super) struct Pressures<T> {
    pub pitch_pa: (T, T),
    pub load_pa: (T, T),
}

impl<T: Real> Pressures<T> {
    /// Force of the load cylinder against extension, N.
    pub fn load_force_n(&self, params: &EmulatorParams<T>) -> T {
        push_n(&params.load, self.load_pa)
    }
}

impl<T: Real> State<T> {
    /// Valves centred, chambers B at a quarter of the supply pressure, chambers A in balance.
    pub fn at_rest(params: &EmulatorParams<T>, x_m: T, load_n: T) -> Self {
        let supply_pa = params.supply.idle_pressure_pa();
        let still = |axis: &Axis<T>, x_m: T| {
            let cylinder = &axis.plant.cylinder();
            let pb_pa = supply_pa / T::lit(4.0);
            let pa_pa = (load_n + pb_pa * cylinder.area_b_m2) / cylinder.area_a_m2;
            axis.plant.state_at(x_m, T::zero(), pa_pa.max(T::zero()).min(supply_pa), pb_pa)
        };
        let load = still(&params.load, params.load.plant.model.cylinder.stroke_m - x_m);
        Self {
            pitch: still(&params.pitch, x_m),
            load_oil_m3: [load.oil_a_m3, load.oil_b_m3],
            spools: [T::zero(); 2],
            spool_speeds_ps: [T::zero(); 2],
            supply_pa,
        }
    }

    /// Pressures in both cylinders.
    #[inline]
    pub fn pressures(&self, params: &EmulatorParams<T>) -> Pressures<T> {
        Pressures {
            pitch_pa: params.pitch.plant.pressures_pa(&self.pitch),
            load_pa: params.load.plant.pressures_pa(&self.load(params)),
        }
    }

    /// Rates of the pitching and the load cylinder, and the flow drawn from the supply, m³/s, at the state's pressures.
    #[inline(always)] // else hundreds of bytes are copied that nobody reads
    pub fn rates(
        &self,
        params: &EmulatorParams<T>,
        Pressures { pitch_pa, load_pa }: Pressures<T>,
    ) -> (CylinderRates<T>, CylinderRates<T>, T) {
        let [pitch_spool, load_spool] = self.spools;
        let load_state = self.load(params);
        let load_flows = self.flows(&params.load, load_pa, load_spool);
        let pitch_flows = self.flows(&params.pitch, pitch_pa, pitch_spool);
        let load = rates(&params.load, &load_state, load_pa, &load_flows, T::zero());
        let pitch = rates(&params.pitch, &self.pitch, pitch_pa, &pitch_flows, push_n(&params.load, load_pa));
        (pitch, load, pitch_flows.supply_m3s + load_flows.supply_m3s)
    }

    /// The right side of the differential equation, at the state's pressures.
    #[inline(always)]
    pub fn derivative(
        &self,
        params: &EmulatorParams<T>,
        commands: [T; 2],
        pressures: Pressures<T>,
    ) -> [T; STATES] {
        let (pitch, load, drawn_m3s) = self.rates(params, pressures);
        let ([pitch_spool, load_spool], [pitch_speed, load_speed]) = (self.spools, self.spool_speeds_ps);
        let [pitch_command, load_command] = commands;
        let [dy_pitch, ddy_pitch] = params.pitch.valve.spool_rates(pitch_spool, pitch_speed, pitch_command);
        let [dy_load, ddy_load] = params.load.valve.spool_rates(load_spool, load_speed, load_command);
        [
            self.pitch.v_mps,
            pitch.signals.a_mps2,
            pitch.oil_a_m3s,
            pitch.oil_b_m3s,
            load.oil_a_m3s,
            load.oil_b_m3s,
            dy_pitch,
            dy_load,
            ddy_pitch,
            ddy_load,
            params.supply.rate_pas(self.supply_pa, drawn_m3s),
        ]
    }

    /// Rate of the fastest motion at the state's pressures, 1/s: of the mass on the springs of both cylinders and their
    /// oil, or of the supply line. The valves join the two: a flow through them empties one and fills the other.
    pub fn fastest_rate_ps(&self, params: &EmulatorParams<T>, pressures: &Pressures<T>) -> T {
        let [pitch_spool, load_spool] = self.spools;
        let axes = [
            (&params.pitch, self.pitch, pitch_spool, pressures.pitch_pa),
            (&params.load, self.load(params), load_spool, pressures.load_pa),
        ];
        let mut valves_m3spa = T::zero();
        let (mut springs_ps2, mut brakes_ps) = (T::zero(), T::zero());
        for (axis, cylinder, spool, (pa_pa, pb_pa)) in axes {
            let (at_a, at_b) = axis.valve.conductances_m3spa(spool, self.supply_pa, pa_pa, pb_pa);
            let (spring_ps2, drag_ps) = axis.plant.stiffness(&cylinder, (pa_pa, pb_pa));
            valves_m3spa += at_a + at_b;
            springs_ps2 += spring_ps2;
            brakes_ps += drag_ps + axis.plant.filling_ps(&cylinder, at_a, at_b);
        }
        let (relief, compliance) = (params.supply.relief_slope_m3spa, params.supply.compliance_m3pa);
        // λ² + b λ + ω² + d f = 0 of a spring with brakes b = d + f: a pair of |λ|² ≤ ω² + b²/4, or two that are less than b.
        let half_ps = brakes_ps / T::lit(2.0);
        let mass_ps = (springs_ps2 + half_ps * half_ps).sqrt().max(brakes_ps);
        (relief / compliance).max(mass_ps) + valves_m3spa / compliance
    }

    /// `self` brought back to what can exist, or `last` where a number was lost.
    pub fn limited(self, params: &EmulatorParams<T>, last: Self) -> Self {
        let or = |value: T, fallback: T| if value.is_finite() { value } else { fallback };
        let load = params.load.plant.limited(self.load(params), last.load(params));
        let ([pitch_spool, load_spool], [last_pitch, last_load]) = (self.spools, last.spools);
        Self {
            pitch: params.pitch.plant.limited(self.pitch, last.pitch),
            load_oil_m3: [load.oil_a_m3, load.oil_b_m3],
            spools: [or(pitch_spool, last_pitch), or(load_spool, last_load)],
            spool_speeds_ps: self.spool_speeds_ps.map(|speed| or(speed, T::zero())),
            supply_pa: or(self.supply_pa, last.supply_pa).max(T::zero()),
        }
    }

    pub fn to_array(self) -> [T; STATES] {
        let [x, v, oil_a, oil_b] = self.pitch.to_array();
        let ([load_a, load_b], [u_pitch, u_load], [du_pitch, du_load]) =
            (self.load_oil_m3, self.spools, self.spool_speeds_ps);
        [x, v, oil_a, oil_b, load_a, load_b, u_pitch, u_load, du_pitch, du_load, self.supply_pa]
    }

    pub fn from_array(y: [T; STATES]) -> Self {
        let [x, v, oil_a, oil_b, load_a, load_b, u_pitch, u_load, du_pitch, du_load, supply_pa] = y;
        Self {
            pitch: CylinderState::from_array([x, v, oil_a, oil_b]),
            load_oil_m3: [load_a, load_b],
            spools: [u_pitch, u_load],
            spool_speeds_ps: [du_pitch, du_load],
            supply_pa,
        }
    }

    /// The load cylinder as a cylinder of its own.
    pub fn load(&self, params: &EmulatorParams<T>) -> CylinderState<T> {
        let [oil_a_m3, oil_b_m3] = self.load_oil_m3;
        let stroke = params.load.plant.model.cylinder.stroke_m;
        CylinderState { x_m: stroke - self.pitch.x_m, v_mps: -self.pitch.v_mps, oil_a_m3, oil_b_m3 }
    }

    fn flows(&self, axis: &Axis<T>, (pa_pa, pb_pa): (T, T), spool: T) -> ValveFlows<T> {
        if axis.is_shut {
            return ValveFlows::default();
        }
        axis.valve.flows(spool, self.supply_pa, pa_pa, pb_pa)
    }
}

#[inline(always)]
fn rates<T: Real>(
    axis: &Axis<T>,
    cylinder: &CylinderState<T>,
    pressures_pa: (T, T),
    flows: &ValveFlows<T>,
    force_n: T,
) -> CylinderRates<T> {
    let drive = Drive { qa_m3s: flows.a_m3s, qb_m3s: flows.b_m3s, force_n };
    axis.plant.rates_under(cylinder, pressures_pa, &axis.plant.bounded(drive))
}

/// Force of a cylinder's pressures in the direction of its extension, N.
fn push_n<T: Real>(axis: &Axis<T>, (pa_pa, pb_pa): (T, T)) -> T {
    let cylinder = &axis.plant.model.cylinder;
    pa_pa * cylinder.area_a_m2 - pb_pa * cylinder.area_b_m2
}

#[cfg(test)]
mod tests {
    use super::State;
    use crate::{EmulatorParams, Model};

    #[test]
    fn at_rest_the_pressures_carry_the_load() {
        let params = EmulatorParams::<f64>::for_model(Model::paper()).unwrap();
        let cylinder = params.pitch.plant.model.cylinder;
        for load_n in [0.0, 2e3] {
            let state = State::at_rest(&params, 0.1, load_n);
            let (pa_pa, pb_pa) = params.pitch.plant.pressures_pa(&state.pitch);
            let carried_n = pa_pa * cylinder.area_a_m2 - pb_pa * cylinder.area_b_m2;
            assert!((carried_n - load_n).abs() < 1e-3, "{carried_n} N of {load_n} N");
        }
    }
}
