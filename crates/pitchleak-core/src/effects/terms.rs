//! What long entries of the table are made of: terms of physical effects on the right of eq. (1)–(2), and what sensors show of
//! the truth.

use super::EffectConstants;
use crate::{ATMOSPHERE_PA, Cylinder, Model, Real, Signals, Terms};

/// Absolute pressure below which no gas law is evaluated, Pa.
const LEAST_ABSOLUTE_PA: f64 = 1_000.0;

pub(super) fn chamber_a<T: Real>(flow_m3s: T) -> Terms<T> {
    Terms { chamber_a_m3s: flow_m3s, ..Terms::default() }
}

pub(super) fn chamber_b<T: Real>(flow_m3s: T) -> Terms<T> {
    Terms { chamber_b_m3s: flow_m3s, ..Terms::default() }
}

/// A flow from chamber A to chamber B.
pub(super) fn past_piston<T: Real>(flow_m3s: T) -> Terms<T> {
    Terms { chamber_a_m3s: flow_m3s, chamber_b_m3s: -flow_m3s, force_n: T::zero() }
}

pub(super) fn force<T: Real>(force_n: T) -> Terms<T> {
    Terms { force_n, ..Terms::default() }
}

/// One square metre more at chamber A, in eq. (1)–(2): it sweeps, it holds oil, and the pressure pushes on it.
pub(super) fn area_a<T: Real>(at: &Signals<T>, model: &Model<T>) -> Terms<T> {
    let stored = at.x_m / model.fluid.bulk_modulus_pa * at.dpa_pas;
    Terms { chamber_a_m3s: at.v_mps + stored, chamber_b_m3s: T::zero(), force_n: -at.pa_pa }
}

/// One square metre more at chamber B.
pub(super) fn area_b<T: Real>(at: &Signals<T>, model: &Model<T>) -> Terms<T> {
    let stored = (model.cylinder.stroke_m - at.x_m) / model.fluid.bulk_modulus_pa * at.dpb_pas;
    Terms { chamber_a_m3s: T::zero(), chamber_b_m3s: stored - at.v_mps, force_n: at.pb_pa }
}

/// Free gas, polytropic: per volume of oil, 1/β grows by (α/n) P_0^{1/n} / P^{1/n + 1}, absolute
/// pressures (Gholizadeh, Burton and Schoenau, "Fluid bulk modulus: comparison of low pressure
/// models", Int. J. Fluid Power 13, 2012, the compression-only model at small gas share α).
pub(super) fn entrained_air<T: Real>(
    at: &Signals<T>,
    cylinder: &Cylinder<T>,
    constants: &EffectConstants<T>,
) -> Terms<T> {
    let atmosphere = T::lit(ATMOSPHERE_PA);
    Terms {
        chamber_a_m3s: cylinder.volume_a_m3(at.x_m)
            * gas_compressibility(at.pa_pa, atmosphere, constants)
            * at.dpa_pas,
        chamber_b_m3s: cylinder.volume_b_m3(at.x_m)
            * gas_compressibility(at.pb_pa, atmosphere, constants)
            * at.dpb_pas,
        force_n: T::zero(),
    }
}

/// Oil per pascal that one cubic metre of gas takes, the gas volume counted at the precharge;
/// none while the pressure is below the precharge.
pub(super) fn accumulator<T: Real>(pressure_pa: T, constants: &EffectConstants<T>) -> T {
    if pressure_pa < constants.precharge_pa {
        return T::zero();
    }
    gas_compressibility(pressure_pa, constants.precharge_pa + T::lit(ATMOSPHERE_PA), constants)
}

/// −dV/dP of gas with volume 1 at the absolute pressure `from_pa`: V = (P_0/P)^{1/n}.
fn gas_compressibility<T: Real>(pressure_pa: T, from_pa: T, constants: &EffectConstants<T>) -> T {
    let absolute = (pressure_pa + T::lit(ATMOSPHERE_PA)).max(T::lit(LEAST_ABSOLUTE_PA));
    let exponent = T::one() / constants.polytropic_exponent;
    // The two take half the time of a power.
    let volume = (exponent * (from_pa.max(T::zero()) / absolute).libm_ln()).libm_exp();
    exponent * volume / absolute
}

/// Pressure beyond that at which a valve or seal opens, either way; none within.
pub(super) fn beyond_cracking<T: Real>(pressure_pa: T, constants: &EffectConstants<T>) -> T {
    let within = pressure_pa.max(-constants.cracking_pa).min(constants.cracking_pa);
    pressure_pa - within
}

/// A smooth direction of motion as both meters show it, which are quieter than a position's rate: what a piston at rest would leave of
/// both chambers' equations, which has no leak in it.
pub(super) fn flow_direction<T: Real>(
    at: &Signals<T>,
    model: &Model<T>,
    constants: &EffectConstants<T>,
) -> T {
    let (qa_m3s, qb_m3s) = (known(at.qa_m3s), known(at.qb_m3s));
    let at_rest = Signals { qa_m3s, qb_m3s, pa_pa: at.pa_pa, pb_pa: at.pb_pa, ..Signals::default() };
    let left = model.residual(&at_rest);
    let swept_m3s = left.chamber_a_m3s - left.chamber_b_m3s;
    let turning_m3s = constants.slip_speed_mps * (model.cylinder.area_a_m2 + model.cylinder.area_b_m2);
    (swept_m3s / turning_m3s).libm_tanh()
}

/// How much of a worn spot the piston stands on, 0 to 1.
pub(super) fn bell<T: Real>(x_m: T, constants: &EffectConstants<T>) -> T {
    let distance = (x_m - constants.spot_position_m) / constants.spot_width_m;
    (-distance * distance).libm_exp()
}

/// A smooth sign of the speed.
pub(super) fn direction<T: Real>(at: &Signals<T>, constants: &EffectConstants<T>) -> T {
    (at.v_mps / constants.slip_speed_mps).libm_tanh()
}

/// Armstrong-Hélouvry, Dupont and Canudas de Wit (1994), Automatica 30, eq. (6), exponent 2.
pub(super) fn stribeck<T: Real>(at: &Signals<T>, constants: &EffectConstants<T>) -> T {
    let speed = at.v_mps / constants.stribeck_speed_mps;
    (-speed * speed).libm_exp()
}

/// What one unit of a sensor effect does to the readings, signal by signal.
pub(super) enum Distortion<T> {
    /// Readings as the truth.
    None,
    /// `reading = truth · (1 + value · scale)`.
    Scale(Signals<T>),
    /// `reading = truth + value · shift`.
    Shift(Signals<T>),
}

impl<T: Real> Distortion<T> {
    /// What the sensors show of the truth.
    #[inline(always)]
    pub fn read(&self, value: T, truth: &Signals<T>) -> Signals<T> {
        match self {
            Self::None => *truth,
            Self::Scale(scale) => truth.zip(*scale, |signal, gain| signal * (T::one() + value * gain)),
            Self::Shift(shift) => truth.zip(*shift, |signal, more| signal + value * more),
        }
    }

    /// The truth behind a reading: [`read`](Self::read) undone.
    #[inline(always)]
    pub fn correct(&self, value: T, reading: &Signals<T>) -> Signals<T> {
        match self {
            Self::None => *reading,
            Self::Scale(scale) => reading.zip(*scale, |signal, gain| signal / (T::one() + value * gain)),
            Self::Shift(shift) => reading.zip(*shift, |signal, more| signal - value * more),
        }
    }
}

/// A flow that is not measured is none: what is read in its place stays as it was.
pub(super) fn known<T: Real>(flow: T) -> T {
    if flow.is_finite() { flow } else { T::zero() }
}

/// The dynamic form of [`Effect::FlowMeterLag`](super::Effect::FlowMeterLag) and [`Effect::PressureLagA`](super::Effect::PressureLagA): τ y' + y = u by backward Euler,
/// stable for every step; [`Effect::read`](super::Effect::read)'s `−τ du/dt` is its first-order part.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct LaggedReading<T> {
    reading: T,
}

impl<T: Real> LaggedReading<T> {
    /// A sensor that has shown `signal` for long.
    pub fn new(signal: T) -> Self {
        Self { reading: signal }
    }

    /// The reading `step_s` later; `lag_s` is τ. What is not a number is passed over.
    pub fn update(&mut self, step_s: T, lag_s: T, signal: T) -> T {
        let reading = self.reading + (signal - self.reading) * step_s / (step_s + lag_s);
        if reading.is_finite() {
            self.reading = reading;
        }
        self.reading
    }
}

/// The dynamic form of [`Effect::PressureHysteresisA`](super::Effect::PressureHysteresisA): what is moved with play hangs behind what moves it (the play operator of
/// Krasnosel'skii and Pokrovskii 1989, "Systems with Hysteresis"). [`Effect::read`](super::Effect::read) knows it by the side of the play alone.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Play<T> {
    middle: T,
}

impl<T: Real> Play<T> {
    /// In the middle of its play at `signal`.
    pub fn new(signal: T) -> Self {
        Self { middle: signal }
    }

    /// What hangs behind `signal` by no more than `play` either way. What is not a number is passed over.
    pub fn update(&mut self, play: T, signal: T) -> T {
        let (low, high) = (signal - play, signal + play);
        if low.is_finite() && high.is_finite() {
            self.middle = self.middle.max(low).min(high);
        }
        self.middle
    }

    /// Moves on to `signal`, and says where in a play of this width it lies: 1 as far ahead as it can be, −1 as far behind.
    pub fn side(&mut self, play: T, signal: T) -> T {
        let ahead = (signal - self.update(play, signal)) / play;
        if ahead.is_finite() { ahead } else { T::zero() }
    }
}
