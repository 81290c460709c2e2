//! Terms of physical effects on the right of eq. (1)–(2).

use super::EffectConstants;
use super::sensor::known;
use crate::{ATMOSPHERE_PA, Cylinder, LEAST_ABSOLUTE_PA, Model, Real, Signals, Terms};

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
    exponent * (from_pa.max(T::zero()) / absolute).libm_powf(exponent) / absolute
}

/// Pressure beyond that at which a valve or seal opens, either way; none within.
pub(super) fn beyond_cracking<T: Real>(pressure_pa: T, constants: &EffectConstants<T>) -> T {
    let within = pressure_pa.max(-constants.cracking_pa).min(constants.cracking_pa);
    pressure_pa - within
}

/// A smooth direction of motion as both meters show it, which are quieter than a position's rate.
pub(super) fn flow_direction<T: Real>(
    at: &Signals<T>,
    cylinder: &Cylinder<T>,
    constants: &EffectConstants<T>,
) -> T {
    let swept_m3s = known(at.qa_m3s) - known(at.qb_m3s);
    let turning_m3s = constants.slip_speed_mps * (cylinder.area_a_m2 + cylinder.area_b_m2);
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
