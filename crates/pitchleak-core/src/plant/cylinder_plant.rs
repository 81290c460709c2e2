use super::chamber::Chamber;
use super::{EndStop, PlantError};
use crate::effects::{EffectKind, EffectSet};
use crate::{Cylinder, Model, PerLeak, Real, Signals, Terms, rk4_step};

/// Numbers in the state vector of one cylinder: x, ẋ, oil in A, oil in B.
const STATES: usize = 4;

/// Largest step times rate that RK4 is given (its stability limit is 2.78).
const STEP_RATE: f64 = 1.4;
const MOST_SUBSTEPS: u32 = 256;

/// The pitching cylinder of eq. (1)–(2) with end stops, cavitation and whatever effects are on.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct CylinderPlant<T> {
    /// Geometry, oil and laminar leaks.
    pub model: Model<T>,
    /// End stops.
    pub end_stop: EndStop<T>,
    /// Least pressure of a chamber, Pa gauge; about −1 bar.
    pub vapour_pressure_pa: T,
    /// Oil temperature, K.
    pub temp_k: T,
    /// Time since the run began, s, with which some effects grow.
    pub time_s: T,
    /// Effects beyond the model, friction among them; sensor effects do not act here.
    pub effects: EffectSet<T>,
}

/// State of a cylinder. Oil is counted at zero gauge pressure; see [`CylinderPlant::state_at`].
#[derive(Clone, Copy, Debug, PartialEq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct CylinderState<T> {
    /// Piston position x, m.
    pub x_m: T,
    /// Piston speed ẋ, m/s.
    pub v_mps: T,
    /// Oil in chamber A, m³.
    pub oil_a_m3: T,
    /// Oil in chamber B, m³.
    pub oil_b_m3: T,
}

/// What acts on the cylinder from outside.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Drive<T> {
    /// Flow Q_A into chamber A, m³/s.
    pub qa_m3s: T,
    /// Flow Q_B into chamber B, m³/s.
    pub qb_m3s: T,
    /// Load force F against extension, N.
    pub force_n: T,
}

/// How a cylinder changes at one instant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CylinderRates<T> {
    /// Signals at this instant; dQ/dt is left at zero.
    pub signals: Signals<T>,
    /// dW_A/dt, m³/s.
    pub oil_a_m3s: T,
    /// dW_B/dt, m³/s.
    pub oil_b_m3s: T,
    /// Force left to accelerate the mass, N.
    pub net_force_n: T,
    /// Mass that it accelerates, kg.
    pub mass_kg: T,
}

impl<T: Real> CylinderPlant<T> {
    /// The plant of a model: end stops at its stroke, vapour at −1 bar, 40 °C, no effects.
    pub fn new(model: Model<T>) -> Result<Self, PlantError> {
        let plant = Self {
            model,
            end_stop: EndStop::for_cylinder(&model.cylinder),
            vapour_pressure_pa: T::lit(-1e5),
            temp_k: T::lit(313.15),
            time_s: T::zero(),
            effects: EffectSet::default(),
        };
        plant.check().map(|()| plant)
    }

    /// Says whether a plant like this can exist.
    pub fn check(&self) -> Result<(), PlantError> {
        self.cylinder().check()?;
        self.model.fluid.check()?;
        let vapour = self.vapour_pressure_pa;
        if !self.model.leaks_m3spa.is_physical() {
            Err(PlantError::Leaks)
        } else if !self.end_stop.is_physical(self.model.cylinder.stroke_m) {
            Err(PlantError::EndStop)
        } else if !(vapour >= T::lit(-crate::ATMOSPHERE_PA) && vapour <= T::zero()) {
            Err(PlantError::VapourPressure)
        } else if !self.temp_k.is_positive() {
            Err(PlantError::Temperature)
        } else {
            Ok(())
        }
    }

    /// The state with these pressures; what is out of range is brought to the nearest that exists.
    pub fn state_at(&self, x_m: T, v_mps: T, pa_pa: T, pb_pa: T) -> CylinderState<T> {
        let (volume_a, volume_b) = self.volumes_m3(x_m);
        let chamber = self.chamber();
        let (oil_a_m3, oil_b_m3) = (chamber.oil_m3(pa_pa, volume_a), chamber.oil_m3(pb_pa, volume_b));
        let middle = self.model.cylinder.stroke_m / T::lit(2.0);
        let rest = CylinderState { x_m: middle, v_mps: T::zero(), oil_a_m3: volume_a, oil_b_m3: volume_b };
        self.limited(CylinderState { x_m, v_mps, oil_a_m3, oil_b_m3 }, rest)
    }

    /// Pressures P_A, P_B of a state, Pa.
    pub fn pressures_pa(&self, state: &CylinderState<T>) -> (T, T) {
        let (volume_a, volume_b) = self.volumes_m3(state.x_m);
        let chamber = self.chamber();
        (chamber.pressure_pa(state.oil_a_m3, volume_a), chamber.pressure_pa(state.oil_b_m3, volume_b))
    }

    /// Volumes of vapour in A and B, m³; zero unless the chamber cavitates.
    pub fn vapour_m3(&self, state: &CylinderState<T>) -> (T, T) {
        let (volume_a, volume_b) = self.volumes_m3(state.x_m);
        let chamber = self.chamber();
        (chamber.vapour_m3(state.oil_a_m3, volume_a), chamber.vapour_m3(state.oil_b_m3, volume_b))
    }

    /// Leak flows at an instant, those of effects included, m³/s.
    pub fn leaks_m3s(&self, at: &Signals<T>) -> PerLeak<T> {
        let leaks = &self.model.leaks_m3spa;
        let by = |kind| self.effects.terms(at, &self.model, |other| other == kind);
        PerLeak {
            internal: leaks.internal * (at.pa_pa - at.pb_pa) + by(EffectKind::InternalLeak).chamber_a_m3s,
            external_a: leaks.external_a * at.pa_pa + by(EffectKind::ExternalLeakA).chamber_a_m3s,
            external_b: leaks.external_b * at.pb_pa + by(EffectKind::ExternalLeakB).chamber_b_m3s,
        }
    }

    /// The right side of the differential equation.
    pub fn rates(&self, state: &CylinderState<T>, drive: &Drive<T>) -> CylinderRates<T> {
        self.rates_under(state, self.pressures_pa(state), drive)
    }

    /// [`rates`](Self::rates) where the pressures P_A, P_B of the state are known already.
    #[inline(always)]
    pub(crate) fn rates_under(
        &self,
        state: &CylinderState<T>,
        (pa_pa, pb_pa): (T, T),
        drive: &Drive<T>,
    ) -> CylinderRates<T> {
        let model = Model { cylinder: self.cylinder(), ..self.model };
        let cylinder = &model.cylinder;
        let chamber = self.chamber();
        let (volume_a, volume_b) = self.volumes_m3(state.x_m);
        let mut signals = Signals {
            x_m: self.end_stop.guarded_m(state.x_m, cylinder.stroke_m),
            v_mps: state.v_mps,
            pa_pa,
            pb_pa,
            qa_m3s: drive.qa_m3s,
            qb_m3s: drive.qb_m3s,
            force_n: drive.force_n,
            temp_k: self.temp_k,
            t_s: self.time_s,
            ..Signals::default()
        };
        let acts = |kind| !matches!(kind, EffectKind::Storage | EffectKind::Cylinder);
        let effects = self.effects.terms(&signals, &model, acts);
        let net = model.residual(&signals).plus(-T::one(), effects);
        let storage = self.storage(&signals);

        let bulk = self.model.fluid.bulk_modulus_pa;
        let (soft_a, soft_b) =
            (volume_a / bulk + storage.chamber_a_m3s, volume_b / bulk + storage.chamber_b_m3s);
        signals.dpa_pas = chamber.slope_pas(pa_pa, net.chamber_a_m3s, soft_a);
        signals.dpb_pas = chamber.slope_pas(pb_pa, net.chamber_b_m3s, soft_b);

        let least_mass = cylinder.moving_mass_kg * T::lit(0.1);
        let mass_kg = (cylinder.moving_mass_kg + storage.force_n).max(least_mass);
        let stop = self.end_stop.force_n(state.x_m, state.v_mps, cylinder.stroke_m);
        let net_force_n = net.force_n - stop;
        signals.a_mps2 = net_force_n / mass_kg;

        let inflow_a =
            net.chamber_a_m3s + cylinder.area_a_m2 * state.v_mps - storage.chamber_a_m3s * signals.dpa_pas;
        let inflow_b =
            net.chamber_b_m3s - cylinder.area_b_m2 * state.v_mps - storage.chamber_b_m3s * signals.dpb_pas;
        CylinderRates {
            signals,
            oil_a_m3s: chamber.oil_rate_m3s(state.oil_a_m3, volume_a, inflow_a),
            oil_b_m3s: chamber.oil_rate_m3s(state.oil_b_m3, volume_b, inflow_b),
            net_force_n,
            mass_kg,
        }
    }

    /// The state `step_s` later under a drive that `drive_at(elapsed_s)` gives, for instance
    /// recorded flows and load. The step is divided where the oil is stiff. A step that is not
    /// positive and finite changes nothing; a drive that is not a number counts as zero.
    pub fn step(
        &self,
        state: &CylinderState<T>,
        step_s: T,
        drive_at: impl Fn(T) -> Drive<T>,
    ) -> CylinderState<T> {
        let (count, step) = substeps(step_s, self.fastest_rate_ps(state));
        let mut next = *state;
        let mut start = T::zero();
        for _ in 0..count {
            let raw = rk4_step(&next.to_array(), step, |elapsed, y| {
                let drive = self.bounded(drive_at(start + elapsed));
                let rates = self.rates(&CylinderState::from_array(*y), &drive);
                [y[1], rates.signals.a_mps2, rates.oil_a_m3s, rates.oil_b_m3s]
            });
            next = self.limited(CylinderState::from_array(raw), next);
            start += step;
        }
        next
    }

    /// Rate of the fastest motion near a state, 1/s.
    pub(crate) fn fastest_rate_ps(&self, state: &CylinderState<T>) -> T {
        let (spring_ps2, drag_ps) = self.stiffness(state, self.pressures_pa(state));
        spring_ps2.sqrt() + drag_ps
    }

    /// Springs and drags on the mass near a state with these pressures P_A, P_B: the square of the rate at which oil and end
    /// stop swing it, 1/s², and the rate at which friction and end stop brake it, 1/s.
    pub(crate) fn stiffness(&self, state: &CylinderState<T>, (pa_pa, pb_pa): (T, T)) -> (T, T) {
        let cylinder = &self.cylinder();
        let (volume_a, volume_b) = self.volumes_m3(state.x_m);
        let bulk = self.model.fluid.bulk_modulus_pa;
        let (area_a, area_b) = (cylinder.area_a_m2, cylinder.area_b_m2);
        let oil_spring = bulk * (area_a * area_a / volume_a + area_b * area_b / volume_b);
        let mass = cylinder.moving_mass_kg;
        let slow = T::lit(1e-4);
        let friction = |v_mps: T| {
            let signals = Signals { v_mps, pa_pa, pb_pa, x_m: state.x_m, ..Signals::default() };
            self.effects.terms(&signals, &self.model, |kind| kind == EffectKind::Force).force_n
        };
        let drag = (friction(slow) - friction(-slow)).abs() / (slow + slow);
        let (stop_spring, stop_drag) = self.end_stop.near(state.x_m, cylinder.stroke_m);
        ((oil_spring + stop_spring) / mass, (drag + stop_drag) / mass)
    }

    /// Rate at which conductances at A and B, m³/(s·Pa), fill their chambers, 1/s.
    pub(crate) fn filling_ps(&self, state: &CylinderState<T>, at_a: T, at_b: T) -> T {
        let (volume_a, volume_b) = self.volumes_m3(state.x_m);
        self.model.fluid.bulk_modulus_pa * (at_a / volume_a).max(at_b / volume_b)
    }

    /// `next` brought back to what can exist, or `last` where a number was lost. Only here may oil
    /// get lost: above a pressure of β, where neither the oil law nor the steel holds.
    pub(crate) fn limited(&self, next: CylinderState<T>, last: CylinderState<T>) -> CylinderState<T> {
        let or = |value: T, fallback: T| if value.is_finite() { value } else { fallback };
        let stroke = self.model.cylinder.stroke_m;
        let x_m = or(next.x_m, last.x_m).max(T::zero()).min(stroke);
        let fastest = stroke * T::lit(1e3);
        let v_mps = or(next.v_mps, T::zero()).max(-fastest).min(fastest);
        let outward = (next.x_m < T::zero() && v_mps < T::zero()) || (next.x_m > stroke && v_mps > T::zero());
        let (volume_a, volume_b) = self.volumes_m3(x_m);
        let held = |oil: T, last: T, volume: T| {
            or(oil, last).max(volume * T::lit(1e-6)).min(volume * T::lit(core::f64::consts::E))
        };
        CylinderState {
            x_m,
            v_mps: if outward { T::zero() } else { v_mps },
            oil_a_m3: held(next.oil_a_m3, last.oil_a_m3, volume_a),
            oil_b_m3: held(next.oil_b_m3, last.oil_b_m3, volume_b),
        }
    }

    /// A drive within what steel could bear: ten times the stroke volume per second, 1 GPa.
    pub(crate) fn bounded(&self, drive: Drive<T>) -> Drive<T> {
        let cylinder = &self.model.cylinder;
        let within = |value: T, most: T| number_or_zero(value).max(-most).min(most);
        let flow = cylinder.area_a_m2.max(cylinder.area_b_m2) * cylinder.stroke_m * T::lit(10.0);
        Drive {
            qa_m3s: within(drive.qa_m3s, flow),
            qb_m3s: within(drive.qb_m3s, flow),
            force_n: within(drive.force_n, cylinder.area_a_m2 * T::lit(1e9)),
        }
    }

    /// What the storage effects take per unit of Ṗ_A, Ṗ_B and ẍ.
    #[inline]
    fn storage(&self, at: &Signals<T>) -> Terms<T> {
        if self.effects.is_empty() {
            return Terms::default();
        }
        let unit = Signals { dpa_pas: T::one(), dpb_pas: T::one(), a_mps2: T::one(), ..*at };
        self.effects.terms(&unit, &self.model, |kind| kind == EffectKind::Storage)
    }

    /// The cylinder as it is built: its numbers are not those of the model where an effect says so.
    #[inline]
    pub(crate) fn cylinder(&self) -> Cylinder<T> {
        if self.effects.is_empty() { self.model.cylinder } else { self.effects.built(&self.model.cylinder) }
    }

    fn volumes_m3(&self, x_m: T) -> (T, T) {
        let cylinder = self.cylinder();
        let x = self.end_stop.guarded_m(x_m, cylinder.stroke_m);
        (cylinder.volume_a_m3(x), cylinder.volume_b_m3(x))
    }

    fn chamber(&self) -> Chamber<T> {
        Chamber {
            bulk_modulus_pa: self.model.fluid.bulk_modulus_pa,
            vapour_pressure_pa: self.vapour_pressure_pa,
        }
    }
}

impl<T: Real> CylinderState<T> {
    pub(crate) fn to_array(self) -> [T; STATES] {
        [self.x_m, self.v_mps, self.oil_a_m3, self.oil_b_m3]
    }

    pub(crate) fn from_array([x_m, v_mps, oil_a_m3, oil_b_m3]: [T; STATES]) -> Self {
        Self { x_m, v_mps, oil_a_m3, oil_b_m3 }
    }
}

pub(crate) fn number_or_zero<T: Real>(value: T) -> T {
    if value.is_finite() { value } else { T::zero() }
}

/// Into how many steps of what length a step is divided, for motions of a rate.
pub(crate) fn substeps<T: Real>(step_s: T, rate_ps: T) -> (u32, T) {
    if !step_s.is_positive() {
        return (0, T::zero());
    }
    let wanted = (step_s * rate_ps / T::lit(STEP_RATE)).ceil().max(T::one());
    let count = wanted.to_u32().unwrap_or(MOST_SUBSTEPS).min(MOST_SUBSTEPS);
    (count, step_s / T::lit(f64::from(count)))
}
