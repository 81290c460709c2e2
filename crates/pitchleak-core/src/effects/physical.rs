use super::{Effect, Shape};
use crate::{Cylinder, Model, Moment, Real, Terms, plant};

/// The extra term of one unit of a physical effect on the right of eq. (1)–(2). Sensor effects
/// have none: the plant does not feel them.
pub(super) fn unit_term<T: Real>(
    effect: Effect,
    at: &Moment<T>,
    model: &Model<T>,
    shape: &Shape<T>,
) -> Terms<T> {
    let Model { cylinder, fluid, .. } = model;
    let load_pressure = at.pa_pa - at.pb_pa;
    match effect {
        Effect::DeadVolumeA => chamber_a(at.dpa_pas / fluid.bulk_modulus_pa),
        Effect::DeadVolumeB => chamber_b(at.dpb_pas / fluid.bulk_modulus_pa),
        Effect::InternalLeakTurbulent => past_piston(plant::signed_root(load_pressure)),
        Effect::ExternalLeakATurbulent => chamber_a(plant::signed_root(at.pa_pa)),
        Effect::ExternalLeakBTurbulent => chamber_b(plant::signed_root(at.pb_pa)),
        Effect::ExternalLeakB => chamber_b(at.pb_pa),
        Effect::EntrainedAir => entrained_air(at, cylinder, shape),
        Effect::AccumulatorA => chamber_a(accumulator(at.pa_pa, shape) * at.dpa_pas),
        Effect::AccumulatorB => chamber_b(accumulator(at.pb_pa, shape) * at.dpb_pas),
        Effect::DragLeak => past_piston(cylinder.area_a_m2 * at.v_mps),
        Effect::PositionDependentLeak => past_piston(bell(at.x_m, shape) * load_pressure),
        Effect::InternalLeakTemperature => past_piston((at.temp_k - shape.reference_temp_k) * load_pressure),
        Effect::ViscousFriction => force(at.v_mps),
        Effect::CoulombFriction => force(direction(at, shape)),
        Effect::StribeckFriction => force(direction(at, shape) * stribeck(at, shape)),
        Effect::SealFriction => force(direction(at, shape) * (at.pa_pa.abs() + at.pb_pa.abs())),
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
fn entrained_air<T: Real>(at: &Moment<T>, cylinder: &Cylinder<T>, shape: &Shape<T>) -> Terms<T> {
    let atmosphere = T::lit(plant::ATMOSPHERE_PA);
    Terms {
        chamber_a_m3s: cylinder.volume_a_m3(at.x_m) * gas_softness(at.pa_pa, atmosphere, shape) * at.dpa_pas,
        chamber_b_m3s: cylinder.volume_b_m3(at.x_m) * gas_softness(at.pb_pa, atmosphere, shape) * at.dpb_pas,
        force_n: T::zero(),
    }
}

/// Oil per pascal that one cubic metre of gas takes, the gas volume counted at the precharge;
/// none while the pressure is below the precharge.
fn accumulator<T: Real>(pressure_pa: T, shape: &Shape<T>) -> T {
    if pressure_pa < shape.precharge_pa {
        return T::zero();
    }
    gas_softness(pressure_pa, shape.precharge_pa + T::lit(plant::ATMOSPHERE_PA), shape)
}

/// −dV/dP of gas with volume 1 at the absolute pressure `from_pa`: V = (P_0/P)^{1/n}.
fn gas_softness<T: Real>(pressure_pa: T, from_pa: T, shape: &Shape<T>) -> T {
    let absolute = (pressure_pa + T::lit(plant::ATMOSPHERE_PA)).max(T::lit(plant::LEAST_ABSOLUTE_PA));
    let exponent = T::one() / shape.polytropic_exponent;
    exponent * (from_pa.max(T::zero()) / absolute).libm_powf(exponent) / absolute
}

/// How much of a worn spot the piston stands on, 0 to 1.
fn bell<T: Real>(x_m: T, shape: &Shape<T>) -> T {
    let distance = (x_m - shape.spot_position_m) / shape.spot_width_m;
    (-distance * distance).libm_exp()
}

/// A smooth sign of the speed.
fn direction<T: Real>(at: &Moment<T>, shape: &Shape<T>) -> T {
    (at.v_mps / shape.slip_speed_mps).libm_tanh()
}

/// Armstrong-Hélouvry, Dupont and Canudas de Wit (1994), Automatica 30, eq. (6), exponent 2.
fn stribeck<T: Real>(at: &Moment<T>, shape: &Shape<T>) -> T {
    let speed = at.v_mps / shape.stribeck_speed_mps;
    (-speed * speed).libm_exp()
}
