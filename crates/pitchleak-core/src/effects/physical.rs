use super::{Effect, EffectConstants};
use crate::{ATMOSPHERE_PA, Cylinder, LEAST_ABSOLUTE_PA, Model, Real, Signals, Terms, signed_root};

/// The extra term of one unit of a physical effect on the right of eq. (1)–(2). Sensor effects
/// have none: the plant does not feel them.
pub(super) fn unit_term<T: Real>(
    effect: Effect,
    at: &Signals<T>,
    model: &Model<T>,
    constants: &EffectConstants<T>,
) -> Terms<T> {
    let Model { cylinder, fluid, .. } = model;
    let load_pressure = at.pa_pa - at.pb_pa;
    match effect {
        Effect::DeadVolumeA => chamber_a(at.dpa_pas / fluid.bulk_modulus_pa),
        Effect::DeadVolumeB => chamber_b(at.dpb_pas / fluid.bulk_modulus_pa),
        Effect::InternalLeakTurbulent => past_piston(signed_root(load_pressure)),
        Effect::ExternalLeakATurbulent => chamber_a(signed_root(at.pa_pa)),
        Effect::ExternalLeakBTurbulent => chamber_b(signed_root(at.pb_pa)),
        Effect::ExternalLeakB => chamber_b(at.pb_pa),
        Effect::EntrainedAir => entrained_air(at, cylinder, constants),
        Effect::AccumulatorA => chamber_a(accumulator(at.pa_pa, constants) * at.dpa_pas),
        Effect::AccumulatorB => chamber_b(accumulator(at.pb_pa, constants) * at.dpb_pas),
        Effect::DragLeak => past_piston(cylinder.area_a_m2 * at.v_mps),
        Effect::PositionDependentLeak => past_piston(bell(at.x_m, constants) * load_pressure),
        Effect::InternalLeakTemperature => {
            past_piston((at.temp_k - constants.reference_temp_k) * load_pressure)
        }
        Effect::ViscousFriction => force(at.v_mps),
        Effect::CoulombFriction => force(direction(at, constants)),
        Effect::StribeckFriction => force(direction(at, constants) * stribeck(at, constants)),
        Effect::SealFriction => force(direction(at, constants) * (at.pa_pa.abs() + at.pb_pa.abs())),
        Effect::LoadOffset => force(T::one()),
        Effect::LoadStiffness => force(at.x_m),
        Effect::AddedMass => force(at.a_mps2),
        Effect::FlowMeterOffsetA
        | Effect::FlowMeterOffsetB
        | Effect::FlowMeterGainA
        | Effect::FlowMeterGainB
        | Effect::FlowMeterLag
        | Effect::PositionGain
        | Effect::PositionOffset
        | Effect::PressureOffsetA
        | Effect::PressureOffsetB
        | Effect::PressureGainA
        | Effect::PressureGainB
        | Effect::PressureLagA
        | Effect::PressureLagB
        | Effect::LineResistanceA
        | Effect::LineResistanceB
        | Effect::ForceGain => Terms::default(),
    }
}

fn chamber_a<T: Real>(flow_m3s: T) -> Terms<T> {
    Terms { chamber_a_m3s: flow_m3s, ..Terms::default() }
}

fn chamber_b<T: Real>(flow_m3s: T) -> Terms<T> {
    Terms { chamber_b_m3s: flow_m3s, ..Terms::default() }
}

/// A flow from chamber A to chamber B.
fn past_piston<T: Real>(flow_m3s: T) -> Terms<T> {
    Terms { chamber_a_m3s: flow_m3s, chamber_b_m3s: -flow_m3s, force_n: T::zero() }
}

fn force<T: Real>(force_n: T) -> Terms<T> {
    Terms { force_n, ..Terms::default() }
}

/// Free gas, polytropic: per volume of oil, 1/β grows by (α/n) P_0^{1/n} / P^{1/n + 1}, absolute
/// pressures (Gholizadeh, Burton and Schoenau, "Fluid bulk modulus: comparison of low pressure
/// models", Int. J. Fluid Power 13, 2012, the compression-only model at small gas share α).
fn entrained_air<T: Real>(
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
fn accumulator<T: Real>(pressure_pa: T, constants: &EffectConstants<T>) -> T {
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

/// How much of a worn spot the piston stands on, 0 to 1.
fn bell<T: Real>(x_m: T, constants: &EffectConstants<T>) -> T {
    let distance = (x_m - constants.spot_position_m) / constants.spot_width_m;
    (-distance * distance).libm_exp()
}

/// A smooth sign of the speed.
fn direction<T: Real>(at: &Signals<T>, constants: &EffectConstants<T>) -> T {
    (at.v_mps / constants.slip_speed_mps).libm_tanh()
}

/// Armstrong-Hélouvry, Dupont and Canudas de Wit (1994), Automatica 30, eq. (6), exponent 2.
fn stribeck<T: Real>(at: &Signals<T>, constants: &EffectConstants<T>) -> T {
    let speed = at.v_mps / constants.stribeck_speed_mps;
    (-speed * speed).libm_exp()
}
