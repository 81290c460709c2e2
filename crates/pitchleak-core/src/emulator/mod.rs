//! The rig of the paper's Section III (Fig. 2): a pitching cylinder under position control and,
//! back to back with it, a load cylinder under force control, both on one supply.

mod state;

use crate::plant::{CylinderPlant, PlantError, Supply, Valve, number_or_zero, substeps};
use crate::{Cylinder, Model, PerLeak, Real, Signals, rk4_step};
use state::{Pressures, State};

/// One hydraulic axis: a cylinder, its valve and its controller.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Axis<T> {
    /// Cylinder, with its leak circuits and effects.
    pub plant: CylinderPlant<T>,
    /// Valve.
    pub valve: Valve<T>,
    /// Controller: of position, per m; of force, per N.
    pub gains: Gains<T>,
    /// Both ports are shut between valve and cylinder: no flow, whatever the spool does.
    pub is_shut: bool,
}

/// Everything the emulator is built of.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct EmulatorParams<T> {
    /// The pitching cylinder; its moving mass is that of the whole rig.
    pub pitch: Axis<T>,
    /// The load cylinder; it stands at x_L = L − x and pushes against extension.
    pub load: Axis<T>,
    /// Pump and relief valve.
    pub supply: Supply<T>,
    /// Longest internal step of the integration, s.
    pub internal_step_s: T,
}

/// True signals of the rig at one instant.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct EmulatorReading<T> {
    /// Signals of the pitching cylinder; dQ/dt is left at zero. What the sensors make of them:
    /// [`EffectSet::read`](crate::EffectSet::read).
    pub signals: Signals<T>,
    /// Flows through the leak circuits (and leak effects), m³/s.
    pub leaks_m3s: PerLeak<T>,
    /// Supply pressure, Pa.
    pub supply_pa: T,
    /// Spool of the pitching cylinder's valve, share of the stroke.
    pub pitch_spool: T,
    /// Valve command of the pitching cylinder, share of the stroke.
    pub pitch_command: T,
    /// Valve command of the load cylinder, share of the stroke.
    pub load_command: T,
}

/// The running rig.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Emulator<T> {
    params: EmulatorParams<T>,
    state: State<T>,
    position_reference_m: T,
    load_reference_n: T,
    position_integral: T,
    load_integral: T,
    commands: [T; 2],
}

impl<T: Real> EmulatorParams<T> {
    /// The paper's rig with this pitching cylinder: 10 MPa supply, a load cylinder of the same
    /// size with hoses of its own and a damping bypass, controllers tuned from the sizes.
    pub fn for_model(model: Model<T>) -> Result<Self, PlantError> {
        let supply = Supply::paper();
        let plant = CylinderPlant::new(model)?;
        let cylinder = model.cylinder;
        let scale = cylinder.area_a_m2 / T::lit(1.26e-3);
        let valve = Valve {
            rated_flow_m3s: Valve::<T>::paper().rated_flow_m3s * scale,
            area_ratio_b: cylinder.area_b_m2 / cylinder.area_a_m2,
            ..Valve::paper()
        };
        let hose = cylinder.area_a_m2 * cylinder.stroke_m * T::lit(0.1);
        let load_cylinder = Cylinder { dead_volume_a_m3: hose, dead_volume_b_m3: hose, ..cylinder };
        let bypass = PerLeak { internal: T::lit(2e-11) * scale, ..PerLeak::default() };
        let load =
            CylinderPlant::new(Model { cylinder: load_cylinder, fluid: model.fluid, leaks_m3spa: bypass })?;
        let supply = Supply { pump_flow_m3s: supply.pump_flow_m3s * scale, ..supply };
        let drop = supply.relief_pressure_pa / T::lit(3.0);
        let params = Self {
            pitch: Axis { plant, valve, gains: position_gains(&cylinder, &valve, drop), is_shut: false },
            load: Axis { plant: load, valve, gains: force_gains(&load.model, &valve, drop), is_shut: false },
            supply,
            internal_step_s: T::lit(1e-4),
        };
        params.check().map(|()| params)
    }

    /// The same with another valve at the pitching cylinder, and a controller tuned for it.
    #[must_use]
    pub fn with_pitch_valve(mut self, valve: Valve<T>) -> Self {
        let drop = self.supply.relief_pressure_pa / T::lit(3.0);
        self.pitch.gains = position_gains(&self.pitch.plant.model.cylinder, &valve, drop);
        self.pitch.valve = valve;
        self
    }

    /// Says whether a rig like this can exist.
    pub fn check(&self) -> Result<(), PlantError> {
        for axis in [&self.pitch, &self.load] {
            axis.plant.check()?;
            if !axis.valve.is_physical() {
                return Err(PlantError::Valve);
            }
            if !axis.gains.is_physical() {
                return Err(PlantError::Controller);
            }
        }
        if !self.supply.is_physical() {
            Err(PlantError::Supply)
        } else if !self.internal_step_s.is_positive() {
            Err(PlantError::Step)
        } else {
            Ok(())
        }
    }
}

/// Piston speed per valve command with this drop over each edge, m/s.
fn speed_gain_mps<T: Real>(cylinder: &Cylinder<T>, valve: &Valve<T>, drop_pa: T) -> T {
    valve.rated_flow_m3s * (drop_pa / valve.rated_drop_pa).sqrt() / cylinder.area_a_m2
}

/// Position loop crossing over at a tenth of the valve's bandwidth, reset time five radians of it.
fn position_gains<T: Real>(cylinder: &Cylinder<T>, valve: &Valve<T>, drop_pa: T) -> Gains<T> {
    let crossover = T::lit(0.1 * core::f64::consts::TAU) * valve.bandwidth_hz;
    let proportional = crossover / speed_gain_mps(cylinder, valve, drop_pa);
    Gains { proportional, integral_ps: proportional * crossover / T::lit(5.0), derivative_s: T::zero() }
}

/// Force loop of four times that crossover, for the load cylinder at mid-stroke: its oil spring
/// integrates the flow, and its reset time cancels the lag of the oil behind the bypass.
fn force_gains<T: Real>(model: &Model<T>, valve: &Valve<T>, drop_pa: T) -> Gains<T> {
    let cylinder = &model.cylinder;
    let middle = cylinder.stroke_m / T::lit(2.0);
    let stiffness = |volume: T| model.fluid.bulk_modulus_pa / volume;
    let oil_a = stiffness(cylinder.volume_a_m3(middle));
    let oil_b = stiffness(cylinder.volume_b_m3(middle));
    let (a, b) = (cylinder.area_a_m2, cylinder.area_b_m2);
    let spring = a * a * oil_a + b * b * oil_b;
    let bypass_ps = model.leaks_m3spa.internal * (oil_a + oil_b);
    let crossover = T::lit(0.4 * core::f64::consts::TAU) * valve.bandwidth_hz;
    let proportional = crossover / (speed_gain_mps(cylinder, valve, drop_pa) * spring);
    Gains { proportional, integral_ps: proportional * bypass_ps, derivative_s: T::zero() }
}

impl<T: Real> Emulator<T> {
    /// The rig at rest at a position (m) under a load (N against extension).
    pub fn new(params: EmulatorParams<T>, position_m: T, load_n: T) -> Result<Self, PlantError> {
        params.check()?;
        let position_reference_m = params.pitch.clamped_m(position_m);
        let load_reference_n = number_or_zero(load_n);
        Ok(Self {
            state: State::at_rest(&params, position_reference_m, load_reference_n),
            params,
            position_reference_m,
            load_reference_n,
            position_integral: T::zero(),
            load_integral: T::zero(),
            commands: [T::zero(); 2],
        })
    }

    /// What the rig is built of.
    pub fn params(&self) -> &EmulatorParams<T> {
        &self.params
    }

    /// Turns the leak circuits of the pitching cylinder.
    pub fn set_leaks(&mut self, leaks_m3spa: PerLeak<T>) -> Result<(), PlantError> {
        if !leaks_m3spa.is_physical() {
            return Err(PlantError::Leaks);
        }
        self.params.pitch.plant.model.leaks_m3spa = leaks_m3spa;
        Ok(())
    }

    /// Changes the oil's temperature, K, which effects of the pitching cylinder may follow.
    pub fn set_temperature(&mut self, temp_k: T) -> Result<(), PlantError> {
        if !temp_k.is_positive() {
            return Err(PlantError::Temperature);
        }
        self.params.pitch.plant.temp_k = temp_k;
        Ok(())
    }

    /// Says what time it is, s: some effects of the pitching cylinder grow with it. What is not a number is passed over.
    pub fn set_time(&mut self, time_s: T) {
        if time_s.is_finite() {
            self.params.pitch.plant.time_s = time_s;
        }
    }

    /// Shuts both ports of the pitching cylinder, or opens them: a hold test.
    pub fn set_shut(&mut self, is_shut: bool) {
        self.params.pitch.is_shut = is_shut;
    }

    /// Runs the rig for `step_s`, the references moving in a straight line to the given ones.
    /// A reference that is not a number stays where it was, a position outside the stroke is
    /// brought inside; a step that is not positive and finite, or takes more than a hundred million
    /// internal steps, is [`PlantError::Step`] and changes nothing.
    pub fn step(
        &mut self,
        step_s: T,
        position_reference_m: T,
        load_reference_n: T,
    ) -> Result<(), PlantError> {
        self.step_finer(1, step_s, position_reference_m, load_reference_n)
    }

    /// [`step`](Self::step) with each step of the integration divided `finer` times more.
    fn step_finer(
        &mut self,
        finer: u32,
        step_s: T,
        position_reference_m: T,
        load_reference_n: T,
    ) -> Result<(), PlantError> {
        let ticks = (step_s / self.params.internal_step_s).ceil().max(T::one());
        let count = ticks.to_u32().filter(|n| *n <= 100_000_000).ok_or(PlantError::Step)?;
        if !step_s.is_positive() {
            return Err(PlantError::Step);
        }
        let goal = |new: T, old: T| if new.is_finite() { new } else { old };
        let position_goal =
            self.params.pitch.clamped_m(goal(position_reference_m, self.position_reference_m));
        let load_goal = goal(load_reference_n, self.load_reference_n);
        let speed_reference = (position_goal - self.position_reference_m) / step_s;
        let load_slope = (load_goal - self.load_reference_n) / step_s;
        let tick = step_s / T::lit(f64::from(count));
        for _ in 0..count {
            self.position_reference_m += speed_reference * tick;
            self.load_reference_n = number_or_zero(self.load_reference_n + load_slope * tick);
            let pressures = self.state.pressures(&self.params);
            self.control(tick, speed_reference, &pressures);
            self.integrate(finer, tick, pressures);
        }
        self.position_reference_m = position_goal;
        self.load_reference_n = load_goal;
        Ok(())
    }

    /// True signals now.
    pub fn reading(&self) -> EmulatorReading<T> {
        let (pitch, _, _) = self.state.rates(&self.params, self.state.pressures(&self.params));
        let [pitch_command, load_command] = self.commands;
        EmulatorReading {
            signals: pitch.signals,
            leaks_m3s: self.params.pitch.plant.leaks_m3s(&pitch.signals),
            supply_pa: self.state.supply_pa,
            pitch_spool: self.state.spools[0],
            pitch_command,
            load_command,
        }
    }

    /// One tick of both controllers. Either valve is fed forward the opening that the reference's
    /// speed takes; the load cylinder gives way with the piston.
    fn control(&mut self, tick: T, speed_reference: T, pressures: &Pressures<T>) {
        let EmulatorParams { pitch, load, .. } = &self.params;
        let position_error = self.position_reference_m - self.state.pitch.x_m;
        let load_error = self.load_reference_n - pressures.load_force_n(&self.params);
        let pitch_command = pitch.gains.command(
            &mut self.position_integral,
            tick,
            position_error,
            speed_reference - self.state.pitch.v_mps,
            pitch.opening(pressures.pitch_pa, self.state.supply_pa, speed_reference),
        );
        let load_command = load.gains.command(
            &mut self.load_integral,
            tick,
            load_error,
            T::zero(),
            load.opening(pressures.load_pa, self.state.supply_pa, -speed_reference),
        );
        self.commands = [pitch_command, load_command];
    }

    fn integrate(&mut self, finer: u32, tick: T, pressures: Pressures<T>) {
        let (params, commands) = (&self.params, self.commands);
        let (count, step) = substeps(tick, self.state.fastest_rate_ps(params, &pressures));
        // Of the first look at the first state; of all others they are worked out.
        let mut known = Some(pressures);
        let step = step / T::lit(f64::from(finer));
        for _ in 0..count * finer {
            let raw = rk4_step(&self.state.to_array(), step, |_, y| {
                let state = State::from_array(*y);
                let pressures = known.take().unwrap_or_else(|| state.pressures(params));
                state.derivative(params, commands, pressures)
            });
            self.state = State::from_array(raw).limited(params, self.state);
        }
    }
}

impl<T: Real> Axis<T> {
    /// Valve command for a piston speed at the pressures of the moment, half of what supply and
    /// load leave over each edge.
    fn opening(&self, (pa_pa, pb_pa): (T, T), supply_pa: T, speed_mps: T) -> T {
        let load_pa = if speed_mps >= T::zero() { pa_pa - pb_pa } else { pb_pa - pa_pa };
        let drop = ((supply_pa - load_pa) / T::lit(2.0)).max(self.valve.laminar_drop_pa);
        speed_mps / speed_gain_mps(&self.plant.model.cylinder, &self.valve, drop)
    }

    /// The nearest position between the end stops.
    fn clamped_m(&self, position_m: T) -> T {
        let (stroke, gap) = (self.plant.model.cylinder.stroke_m, self.plant.end_stop.gap_m);
        if position_m.is_finite() { position_m.max(gap).min(stroke - gap) } else { stroke / T::lit(2.0) }
    }
}

/// PID controller with its output limited to ±1 and the integral held while it is (Åström and
/// Hägglund, "Advanced PID Control", §3.5). The caller passes the error's rate, as speeds are
/// states here and need no differencing.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Gains<T> {
    /// Valve command per unit of error.
    pub proportional: T,
    /// Valve command per unit of error and second.
    pub integral_ps: T,
    /// Valve command per unit of the error's rate.
    pub derivative_s: T,
}

impl<T: Real> Gains<T> {
    pub(super) fn is_physical(&self) -> bool {
        [self.proportional, self.integral_ps, self.derivative_s].into_iter().all(T::is_not_negative)
    }

    /// The valve command ±1 for an error and its rate; `integral` is the controller's memory.
    pub(super) fn command(&self, integral: &mut T, step_s: T, error: T, rate: T, feedforward: T) -> T {
        let grown = *integral + self.integral_ps * error * step_s;
        let wanted =
            |integral: T| feedforward + self.proportional * error + self.derivative_s * rate + integral;
        let free = wanted(grown);
        let saturated = free.abs() > T::one() && free * error > T::zero();
        if grown.is_finite() && !saturated {
            *integral = grown.max(-T::one()).min(T::one());
        }
        wanted(*integral).max(-T::one()).min(T::one())
    }
}

#[cfg(test)]
mod tests;
