//! The one table of effects: all that an effect is stands in its entry, and nowhere else.
//!
//! ```text
//! Variant "id" [unit] Kind lower .. upper, default size;
//!     term |at, model, constants| …;    what one unit takes, on the right of eq. (1)–(2), or
//!     reads |at, one, none| …;          what one unit does to the readings
//!     late [signals];                   sensors that answer late: the signals that the value delays, s
//!     hangs [signal];                   sensors with play: the signal that hangs behind by the value, either way
//!     deaf [signal];                    meters with a dead band: the signal that reads zero while it is smaller than the value
//!     constants [names];                in which the term is not linear, and which a fit may vary
//!     given [names];                    the same, but taken as they are
//!     prior sensor.spread;              the declared error of the sensor that the effect is
//!     carries LeftSide;                 the measured left side of an equation to which the term is in proportion
//!     shares [LeftSide];                further ones whose noise the term shares with the residual
//!     dry |at| …;                       dry friction: the force with which one unit can hold a piston that stands, N
//!     adds field;                       the declared number of the cylinder to which the value adds
//!     "cause" "remedy" "measurement"
//! ```

use super::entry::effects;
use super::terms::Distortion::{Scale, Shift};
use super::terms::{
    accumulator, area_a, area_b, bell, beyond_cracking, chamber_a, chamber_b, direction, entrained_air,
    flow_direction, force, known, past_piston, stribeck,
};
use crate::signed_root;

effects! {
    DeadVolumeA "dead_volume_a" ["m3"] Storage -2e-2 .. 2e-2, 1e-4;
        term |at, model, _| chamber_a(at.dpa_pas / model.fluid.bulk_modulus_pa);
        adds dead_volume_a_m3;
        "More (or less) oil than declared is compressed at chamber A: hose, port or manifold, a hose that swells."
        "Measure hose length and bore and declare dead_volume_a in the rig file."
        "Pressure steps on side A with the piston at the A end, at low and at high pressure: a volume takes the same oil at both."
    DeadVolumeB "dead_volume_b" ["m3"] Storage -2e-2 .. 2e-2, 1e-4;
        term |at, model, _| chamber_b(at.dpb_pas / model.fluid.bulk_modulus_pa);
        adds dead_volume_b_m3;
        "More (or less) oil than declared is compressed at chamber B: hose, port or manifold, a hose that swells, or another stroke than declared, which is area_b times as much."
        "Measure hose length and bore and declare dead_volume_b in the rig file, and compare its stroke with the data sheet."
        "Pressure steps on side B with the piston at the B end, at low and at high pressure: a volume takes the same oil at both."
    InternalLeakTurbulent "internal_leak_turbulent" ["m3/(s*sqrt(Pa))"] InternalLeak 0.0 .. 1e-6, 6e-9;
        term |at, _, _| past_piston(signed_root(at.pa_pa - at.pb_pa));
        "Oil passes the piston through a short, wide path (a torn seal, an open bypass), so flow grows with the root of the pressure difference."
        "Inspect the piston seal for a cut and the bypass valve for a seat that does not close."
        "Holds at a quarter and at the whole of the load pressure: a laminar leak falls to a quarter, a turbulent one to a half, an offset not at all."
    ExternalLeakATurbulent "external_leak_a_turbulent" ["m3/(s*sqrt(Pa))"] ExternalLeakA 0.0 .. 1e-6, 6e-9;
        term |at, _, _| chamber_a(signed_root(at.pa_pa));
        "Oil leaves chamber A through an orifice-like opening (a cracked fitting, a valve off its seat, a relief valve that opens too early)."
        "Inspect fittings, drain and relief valves on side A."
        "Holds at a quarter and at the whole of the pressure A: a laminar leak falls to a quarter, a turbulent one to a half, an offset not at all, and a relief valve shuts."
    ExternalLeakBTurbulent "external_leak_b_turbulent" ["m3/(s*sqrt(Pa))"] ExternalLeakB 0.0 .. 1e-6, 6e-9;
        term |at, _, _| chamber_b(signed_root(at.pb_pa));
        "Oil leaves chamber B through an orifice-like opening (a cracked fitting, a valve off its seat, a relief valve that opens too early)."
        "Inspect fittings, drain and relief valves on side B."
        "Holds at a quarter and at the whole of the pressure B: a laminar leak falls to a quarter, a turbulent one to a half, an offset not at all, and a relief valve shuts."
    InternalLeakCracking "internal_leak_cracking" ["m3/(s*Pa)"] InternalLeak 0.0 .. 1e-9, 2e-11;
        term |at, _, constants| past_piston(beyond_cracking(at.pa_pa - at.pb_pa, constants));
        constants [CrackingPressure];
        "Oil passes the piston, or a valve beside it, only above a certain pressure difference (a cross-port relief valve set low or with dirt on its seat, a seal that lifts)."
        "Test the cross-port relief valve at the pressure named, then the piston seal."
        "Holds at rising load: below the cracking pressure only the laminar leak is there, above it the leak grows with what is beyond."
    EntrainedAir "entrained_air" ["1"] Storage 0.0 .. 0.2, 1e-2;
        term |at, model, constants| entrained_air(at, &model.cylinder, constants);
        constants [PolytropicExponent];
        "Free air in the oil makes both chambers soft, most of all at low pressure."
        "Bleed the cylinder, check suction line and tank level; a share above 1 % calls for service."
        "Pressure steps from below 5 bar and from above 50 bar at mid stroke: free air is soft at the lower ones, in both chambers."
    AccumulatorA "accumulator_a" ["m3"] Storage 0.0 .. 1e-2, 2e-5;
        term |at, _, constants| chamber_a(accumulator(at.pa_pa, constants) * at.dpa_pas);
        constants [Precharge, PolytropicExponent];
        "Gas at port A (an accumulator or a trapped bubble) takes oil, less and less as the pressure rises."
        "Bleed port A, or declare the accumulator's volume and precharge."
        "Pressure steps on side A from below 5 bar and from above 50 bar: gas is soft at the lower ones."
    AccumulatorB "accumulator_b" ["m3"] Storage 0.0 .. 1e-2, 2e-5;
        term |at, _, constants| chamber_b(accumulator(at.pb_pa, constants) * at.dpb_pas);
        constants [Precharge, PolytropicExponent];
        "Gas at port B (an accumulator or a trapped bubble) takes oil, less and less as the pressure rises."
        "Bleed port B, or declare the accumulator's volume and precharge."
        "Pressure steps on side B from below 5 bar and from above 50 bar: gas is soft at the lower ones."
    FlowMeterOffsetA "flow_meter_offset_a" ["m3/s"] Sensor -1e-3 .. 1e-3, 3.3e-6;
        reads |_, one, none| Shift(Signals { qa_m3s: one, ..none });
        prior flow_a.bias_std;
        "Flow meter A does not read zero at rest; it passes for a leak that does not depend on pressure."
        "Zero flow meter A with the valves shut."
        "A minute with the valves shut and line A vented: what flow meter A still reads is its offset."
    FlowMeterOffsetB "flow_meter_offset_b" ["m3/s"] Sensor -1e-3 .. 1e-3, 3.3e-6;
        reads |_, one, none| Shift(Signals { qb_m3s: one, ..none });
        prior flow_b.bias_std;
        "Flow meter B does not read zero at rest; it passes for a leak that does not depend on pressure."
        "Zero flow meter B with the valves shut."
        "A minute with the valves shut and line B vented: what flow meter B still reads is its offset."
    FlowMeterDriftA "flow_meter_drift_a" ["m3/s2"] Sensor -1e-5 .. 1e-5, 5e-8;
        reads |at, one, none| Shift(Signals { qa_m3s: at.t_s, dqa_m3s2: one, ..none });
        "The zero of flow meter A moves while the trace runs (an amplifier that warms up); it passes for a leak that grows."
        "Let flow meter A warm up, zero it, and take a trace again."
        "A minute with the valves shut and line A vented before and after the trace: by what flow meter A differs."
    FlowMeterDriftB "flow_meter_drift_b" ["m3/s2"] Sensor -1e-5 .. 1e-5, 5e-8;
        reads |at, one, none| Shift(Signals { qb_m3s: at.t_s, dqb_m3s2: one, ..none });
        "The zero of flow meter B moves while the trace runs (an amplifier that warms up); it passes for a leak that grows."
        "Let flow meter B warm up, zero it, and take a trace again."
        "A minute with the valves shut and line B vented before and after the trace: by what flow meter B differs."
    FlowMeterGainA "flow_meter_gain_a" ["1"] Sensor -0.5 .. 0.5, 2e-2;
        reads |_, one, none| Scale(Signals { qa_m3s: one, dqa_m3s2: one, ..none });
        prior flow_a.gain_std; carries FlowA;
        "Flow meter A reads a constant share too much or too little (wrong viscosity, worn turbine, wrong scale)."
        "Calibrate flow meter A against the swept volume of one full stroke."
        "A full stroke at constant speed: flow meter A against the swept volume of side A."
    FlowMeterGainB "flow_meter_gain_b" ["1"] Sensor -0.5 .. 0.5, 2e-2;
        reads |_, one, none| Scale(Signals { qb_m3s: one, dqb_m3s2: one, ..none });
        prior flow_b.gain_std; carries FlowB;
        "Flow meter B reads a constant share too much or too little (wrong viscosity, worn turbine, wrong scale)."
        "Calibrate flow meter B against the swept volume of one full stroke."
        "A full stroke at constant speed: flow meter B against the swept volume of side B."
    FlowMeterLag "flow_meter_lag" ["s"] Sensor 0.0 .. 1.0, 2e-2;
        reads |at, _, none| Shift(Signals { qa_m3s: -at.dqa_m3s2, qb_m3s: -at.dqb_m3s2, ..none });
        late [qa_m3s, qb_m3s];
        "Both flow meters answer late (inertia of the turbine, averaging, transport delay of the bus)."
        "Shorten the meters' averaging or shift the flow channels by the lag."
        "A step of the valve: how long the meters answer after the piston."
    PositionGain "position_gain" ["1"] Sensor -0.5 .. 0.5, 2e-2;
        reads |_, one, none| Scale(Signals { x_m: one, v_mps: one, a_mps2: one, ..none });
        prior position.gain_std; carries Speed;
        "The position sensor reads a constant share too much or too little, so the swept flow is wrong in both chambers."
        "Calibrate the position sensor at both end stops."
        "A full stroke between the end stops: the position sensor against the stroke of the data sheet."
    PositionOffset "position_offset" ["m"] Sensor -0.1 .. 0.1, 2e-3;
        reads |_, one, none| Shift(Signals { x_m: one, ..none });
        prior position.bias_std;
        "The position sensor's zero is not at the A end; chamber volumes are wrong by a constant."
        "Set the position sensor's zero with the piston at the A end."
        "The piston at the A end stop: the position sensor's zero."
    PressureOffsetA "pressure_offset_a" ["Pa"] Sensor -2e6 .. 2e6, 1e5;
        reads |_, one, none| Shift(Signals { pa_pa: one, ..none });
        prior pressure.bias_std;
        "Pressure sensor A does not read zero without pressure."
        "Zero pressure sensor A with the line vented."
        "Line A vented: what pressure sensor A still reads."
    PressureOffsetB "pressure_offset_b" ["Pa"] Sensor -2e6 .. 2e6, 1e5;
        reads |_, one, none| Shift(Signals { pb_pa: one, ..none });
        prior pressure.bias_std;
        "Pressure sensor B does not read zero without pressure."
        "Zero pressure sensor B with the line vented."
        "Line B vented: what pressure sensor B still reads."
    PressureGainA "pressure_gain_a" ["1"] Sensor -0.5 .. 0.5, 2e-2;
        reads |_, one, none| Scale(Signals { pa_pa: one, dpa_pas: one, d2pa_pas2: one, ..none });
        prior pressure.gain_std; carries PressureA;
        "Pressure sensor A reads a constant share too much or too little; the force balance shows it."
        "Calibrate pressure sensor A against a reference gauge."
        "A reference gauge at port A at high pressure."
    PressureGainB "pressure_gain_b" ["1"] Sensor -0.5 .. 0.5, 2e-2;
        reads |_, one, none| Scale(Signals { pb_pa: one, dpb_pas: one, d2pb_pas2: one, ..none });
        prior pressure.gain_std; carries PressureB;
        "Pressure sensor B reads a constant share too much or too little; the force balance shows it."
        "Calibrate pressure sensor B against a reference gauge."
        "A reference gauge at port B at high pressure."
    PressureLagA "pressure_lag_a" ["s"] Sensor 0.0 .. 1.0, 2e-2;
        reads |at, _, none| Shift(Signals { pa_pa: -at.dpa_pas, dpa_pas: -at.d2pa_pas2, ..none });
        late [pa_pa];
        "Pressure sensor A answers late: a thin or air-filled gauge line, a snubber, or a filter in its electronics."
        "Bleed or shorten the gauge line, take the snubber out, or declare the lag."
        "A step of the valve: how long pressure sensor A answers after the piston and the flow."
    PressureLagB "pressure_lag_b" ["s"] Sensor 0.0 .. 1.0, 2e-2;
        reads |at, _, none| Shift(Signals { pb_pa: -at.dpb_pas, dpb_pas: -at.d2pb_pas2, ..none });
        late [pb_pa];
        "Pressure sensor B answers late: a thin or air-filled gauge line, a snubber, or a filter in its electronics."
        "Bleed or shorten the gauge line, take the snubber out, or declare the lag."
        "A step of the valve: how long pressure sensor B answers after the piston and the flow."
    LineResistanceA "line_resistance_a" ["Pa*s/m3"] Sensor 0.0 .. 1e12, 1e9;
        reads |at, _, none| Shift(Signals { pa_pa: known(at.qa_m3s), dpa_pas: known(at.dqa_m3s2), ..none });
        "Pressure sensor A sits at the valve, a line away from the cylinder, and reads the line's loss on top while oil flows."
        "Move the sensor to the cylinder port, or declare the line's resistance."
        "A second pressure sensor at the cylinder's port A while oil flows."
    LineResistanceB "line_resistance_b" ["Pa*s/m3"] Sensor 0.0 .. 1e12, 1e9;
        reads |at, _, none| Shift(Signals { pb_pa: known(at.qb_m3s), dpb_pas: known(at.dqb_m3s2), ..none });
        "Pressure sensor B sits at the valve, a line away from the cylinder, and reads the line's loss on top while oil flows."
        "Move the sensor to the cylinder port, or declare the line's resistance."
        "A second pressure sensor at the cylinder's port B while oil flows."
    DragLeak "drag_leak" ["1"] InternalLeak -0.1 .. 0.1, 1e-2;
        term |at, model, _| past_piston(model.cylinder.area_a_m2 * at.v_mps);
        carries Speed;
        "The moving seal carries a share of the swept oil past the piston (positive: from A to B while extending)."
        "Check seal type and fit; at low speed it vanishes, so hold tests do not see it."
        "Strokes at full and at a tenth of the speed under the same load: the share of the flow that passes with the seal stays."
    PositionDependentLeak "position_dependent_leak" ["m3/(s*Pa)"] InternalLeak 0.0 .. 1e-9, 1e-11;
        term |at, _, constants| past_piston(bell(at.x_m, constants) * (at.pa_pa - at.pb_pa));
        constants [SpotPosition, SpotWidth];
        "A worn spot in the bore lets oil past the piston only while the piston stands there."
        "Inspect the bore at the position named; honing or a new barrel, not a new seal, cures it."
        "Holds under load at several positions: only at the worn spot the leak is larger."
    InternalLeakTemperature "internal_leak_temperature" ["m3/(s*Pa*K)"] InternalLeak -1e-11 .. 1e-11, 3e-13;
        term |at, _, constants| past_piston((at.temp_k - constants.reference_temp_k) * (at.pa_pa - at.pb_pa));
        given [ReferenceTemp];
        "Warm oil is thinner, so the laminar leak past the piston grows with temperature."
        "Compare leak estimates at equal oil temperature, or let the model carry the slope."
        "The same hold with cold and with warm oil."
    InternalLeakGrowth "internal_leak_growth" ["m3/(s*Pa*s)"] InternalLeak -1e-11 .. 1e-11, 1e-13;
        term |at, _, _| past_piston(at.t_s * (at.pa_pa - at.pb_pa));
        "The leak past the piston grows while the trace runs: a seal gives way, or the oil warms and no column says so."
        "Compare the leak over the next traces, record the oil's temperature, and inspect the seal if that stays."
        "The same hold at the beginning and at the end, and the meters' zeros before and after."
    InternalLeakDirection "internal_leak_direction" ["m3/(s*Pa)"] InternalLeak -1e-9 .. 1e-9, 5e-12;
        term |at, model, constants| past_piston(flow_direction(at, model, constants) * (at.pa_pa - at.pb_pa));
        given [SlipSpeed];
        shares [FlowA, FlowB];
        "The piston seal is tighter while the piston moves one way than the other (a lip that oil is dragged under): positive, the leak is larger while extending."
        "Check that the seal is mounted the right way round and its lip is whole."
        "Strokes both ways at constant speed and load: the leak differs by twice the value named."
    InternalLeakOneWay "internal_leak_one_way" ["m3/(s*Pa)"] InternalLeak -1e-9 .. 1e-9, 5e-12;
        term |at, _, _| past_piston((at.pa_pa - at.pb_pa).abs());
        "Pressure drives more oil past the piston one way than the other (a check valve in it or beside it, a lip seal that is lifted from one side): positive, more from A to B."
        "Inspect the check valves in and beside the piston, and whether its seal is mounted the right way round."
        "Holds at the same load pressure both ways: the leak differs by twice the value named."
    ViscousFriction "viscous_friction" ["N*s/m"] Force 0.0 .. 1e6, 1.5e3;
        term |at, _, _| force(at.v_mps);
        "Seals and guides resist in proportion to speed."
        "Declare it; a rise over months points to a swelling seal or cold oil."
        "Strokes at constant speed, slow to fast: viscous friction grows with speed."
    CoulombFriction "coulomb_friction" ["N"] Force 0.0 .. 1e5, 3e2;
        term |at, _, constants| force(direction(at, constants));
        constants [SlipSpeed];
        dry |_| T::one();
        "Seals and guides resist with a constant force that turns with the direction of motion."
        "Declare it; a rise over months points to a tight or dry seal, or to misalignment."
        "Strokes at constant speed, slow to fast, both ways: dry friction stays."
    StribeckFriction "stribeck_friction" ["N"] Force 0.0 .. 1e5, 1e2;
        term |at, _, constants| force(direction(at, constants) * stribeck(at, constants));
        constants [StribeckSpeed, SlipSpeed];
        dry |_| T::one();
        "Friction is higher near standstill than in motion, so the piston tends to stick and slip."
        "Check seal material and oil; keep the position loop from hunting."
        "Strokes at constant speed, from creeping to fast: Stribeck friction is there while creeping and gone when fast."
    SealFriction "seal_friction" ["m2"] Force 0.0 .. 1e-2, 5e-5;
        term |at, _, constants| force(direction(at, constants) * (at.pa_pa.abs() + at.pb_pa.abs()));
        constants [SlipSpeed];
        dry |at| at.pa_pa.abs() + at.pb_pa.abs();
        "Pressure pushes the seals on the wall, so friction grows with the sum of both pressures."
        "Declare it; a rise points to an extruded seal."
        "Strokes at constant speed at low and at high pressure in both chambers: seal friction grows with pressure."
    LoadOffset "load_offset" ["N"] Force -1e5 .. 1e5, 2e2;
        term |_, _, _| force(T::one());
        prior force.bias_std;
        "A constant force is missing from the load: weight, a preload, or the load cell's zero."
        "Zero the load cell, or declare the weight."
        "The load cell read with the rod free, and the load weighed."
    LoadStiffness "load_stiffness" ["N/m"] Force -1e6 .. 1e6, 5e3;
        term |at, _, _| force(at.x_m);
        "A force in proportion to position is missing from the load: a spring, a stiff hose, or a tilting weight."
        "Find the spring in the mechanism and declare it."
        "Holds without pressure change at several positions: the force of a spring follows the position."
    AddedMass "added_mass" ["kg"] Storage -1e4 .. 1e4, 1e1;
        term |at, _, _| force(at.a_mps2);
        adds moving_mass_kg;
        "More (or less) mass moves with the piston than declared, such as the oil of a long hose between a pressure sensor and its port."
        "Declare the moving mass as fitted."
        "Fast reversals without load: force in step with acceleration."
    ForceGain "force_gain" ["1"] Sensor -0.5 .. 0.5, 5e-2;
        reads |_, one, none| Scale(Signals { force_n: one, ..none });
        prior force.gain_std; carries Force;
        "The load cell reads a constant share too much or too little."
        "Calibrate the load cell."
        "A known weight on the load cell."
    PressureHysteresisA "pressure_hysteresis_a" ["Pa"] Sensor 0.0 .. 2e6, 5e4;
        reads |at, _, none| Shift(Signals { pa_pa: -at.pa_side, dpa_pas: -at.dpa_side_ps, ..none });
        hangs [pa_pa];
        "Pressure sensor A hangs behind, rising and falling, by the value named: play or friction in its mechanism, or hysteresis of its membrane, which look alike."
        "Exercise pressure sensor A over its range, check its mounting torque, and replace it if its hysteresis is beyond the data sheet's."
        "A reference gauge at port A, the pressure stopped on its way up and on its way down: what is read differs by twice the value named, however long one waits; behind a lag it would meet."
    PressureHysteresisB "pressure_hysteresis_b" ["Pa"] Sensor 0.0 .. 2e6, 5e4;
        reads |at, _, none| Shift(Signals { pb_pa: -at.pb_side, dpb_pas: -at.dpb_side_ps, ..none });
        hangs [pb_pa];
        "Pressure sensor B hangs behind, rising and falling, by the value named: play or friction in its mechanism, or hysteresis of its membrane, which look alike."
        "Exercise pressure sensor B over its range, check its mounting torque, and replace it if its hysteresis is beyond the data sheet's."
        "A reference gauge at port B, the pressure stopped on its way up and on its way down: what is read differs by twice the value named, however long one waits; behind a lag it would meet."
    PositionHysteresis "position_hysteresis" ["m"] Sensor 0.0 .. 5e-2, 5e-4;
        reads |at, _, none| Shift(Signals { x_m: -at.x_side, v_mps: -at.dx_side_ps, ..none });
        hangs [x_m];
        "The position sensor hangs behind, extending and retracting, by the value named: backlash in its coupling, rod eye or gear, or a slack cable."
        "Tighten the position sensor's coupling, replace worn rod eyes or the cable's spring, or declare the play."
        "The piston pushed to and fro by hand or at low pressure: how far it goes before the position sensor follows is twice the value named."
    FlowMeterDeadBandA "flow_meter_dead_band_a" ["m3/s"] Sensor 0.0 .. 1e-3, 5e-6;
        reads |at, _, none| Shift(Signals { qa_m3s: -at.qa_unread, ..none });
        deaf [qa_m3s];
        "Flow meter A shows nothing while less than the value named flows, either way: a turbine or gear wheel that does not start, or a cut-off for small flows in its electronics."
        "Take the cut-off out of flow meter A's settings, use a meter of a smaller range, or declare the dead band."
        "The piston moved slower and slower: the flow below which meter A shows nothing while the position still changes."
    FlowMeterDeadBandB "flow_meter_dead_band_b" ["m3/s"] Sensor 0.0 .. 1e-3, 5e-6;
        reads |at, _, none| Shift(Signals { qb_m3s: -at.qb_unread, ..none });
        deaf [qb_m3s];
        "Flow meter B shows nothing while less than the value named flows, either way: a turbine or gear wheel that does not start, or a cut-off for small flows in its electronics."
        "Take the cut-off out of flow meter B's settings, use a meter of a smaller range, or declare the dead band."
        "The piston moved slower and slower: the flow below which meter B shows nothing while the position still changes."
    AreaA "area_a" ["m2"] Cylinder -1e-2 .. 1.0, 6e-5;
        term |at, model, _| area_a(at, model);
        carries Speed; shares [PressureA];
        adds area_a_m2;
        "The piston's area at chamber A is not as declared: swept flow, volume and force of the pressure are all wrong in the same proportion."
        "Look the bore up in the cylinder's data sheet and declare area_a in the rig file; the sensors stay as they are."
        "A full stroke at constant speed: the oil that flow meter A counts, over the stroke, is the area; beside a load cell the force over the pressure is the same."
    AreaB "area_b" ["m2"] Cylinder -1e-2 .. 1.0, 6e-5;
        term |at, model, _| area_b(at, model);
        carries Speed; shares [PressureB];
        adds area_b_m2;
        "The ring area at chamber B is not as declared (another rod diameter): swept flow, volume and force of the pressure are all wrong in the same proportion."
        "Look bore and rod up in the cylinder's data sheet and declare area_b in the rig file; the sensors stay as they are."
        "A full stroke at constant speed: the oil that flow meter B counts, over the stroke, is the area; beside a load cell the force over the pressure is the same."
}

impl core::fmt::Display for Effect {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str(self.spec().id)
    }
}

/// Error returned when a name is no effect's id.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct UnknownEffect;

impl core::fmt::Display for UnknownEffect {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str("no effect has this id; the known ones are")?;
        Effect::ALL.iter().try_for_each(|effect| write!(f, " {effect}"))
    }
}

impl core::error::Error for UnknownEffect {}

impl core::str::FromStr for Effect {
    type Err = UnknownEffect;

    fn from_str(id: &str) -> Result<Self, UnknownEffect> {
        Self::ALL.iter().copied().find(|effect| effect.spec().id == id).ok_or(UnknownEffect)
    }
}
