//! The one table of effects: a row each, from which the enum, the ids and [`Effect::spec`] follow.

/// Which part of the rig an effect belongs to; says how the plant uses it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EffectKind {
    /// A flow past the piston, counted as internal leak.
    InternalLeak,
    /// A flow out of chamber A, counted as external leak.
    ExternalLeakA,
    /// A flow out of chamber B, counted as external leak.
    ExternalLeakB,
    /// Takes up oil or momentum in proportion to Ṗ or ẍ.
    Storage,
    /// A force on the piston.
    Force,
    /// A sensor that does not read the truth; the plant itself is unchanged.
    Sensor,
}

impl EffectKind {
    /// Whether oil leaves a chamber for good.
    pub fn is_leak(self) -> bool {
        matches!(self, Self::InternalLeak | Self::ExternalLeakA | Self::ExternalLeakB)
    }
}

/// One row of the table of effects.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EffectSpec {
    /// Name in reports, rig files and on the command line.
    pub id: &'static str,
    /// SI unit of the value; `1` for a share.
    pub unit: &'static str,
    /// Where it acts.
    pub kind: EffectKind,
    /// Smallest value that physics allows.
    pub lower: f64,
    /// Largest value worth believing.
    pub upper: f64,
    /// A size that a simulation shows clearly.
    pub default_size: f64,
    /// When it is the cause.
    pub cause: &'static str,
    /// What to do about it.
    pub remedy: &'static str,
    /// The measurement that shows it apart from what looks alike.
    pub measurement: &'static str,
}

macro_rules! effects {
    ($($variant:ident $id:literal [$unit:literal] $kind:ident $lower:literal .. $upper:literal, $size:literal; $cause:literal $remedy:literal $measurement:literal)*) => {
        /// A physical or sensor effect that the plain model lacks.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
        #[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
        #[cfg_attr(feature = "serde", serde(rename_all = "snake_case"))]
        pub enum Effect { $(#[doc = $cause] $variant,)* }

        impl Effect {
            /// Every effect, in the order of the table.
            pub const ALL: &'static [Self] = &[$(Self::$variant),*];

            /// The effect's row.
            pub const fn spec(self) -> &'static EffectSpec {
                match self {
                    $(Self::$variant => &EffectSpec {
                        id: $id, unit: $unit, kind: EffectKind::$kind,
                        lower: $lower, upper: $upper, default_size: $size, cause: $cause, remedy: $remedy,
                        measurement: $measurement,
                    },)*
                }
            }
        }
    };
}

effects! {
    DeadVolumeA "dead_volume_a" ["m3"] Storage 0.0 .. 2e-2, 1e-4;
        "Hose, port or manifold volume at chamber A, or a hose that swells, takes oil in step with the pressure slope."
        "Measure hose length and bore and declare dead_volume_a in the rig file."
        "Pressure steps on side A with the piston at the A end, at low and at high pressure: a volume takes the same oil at both."
    DeadVolumeB "dead_volume_b" ["m3"] Storage 0.0 .. 2e-2, 1e-4;
        "Hose, port or manifold volume at chamber B, or a hose that swells, takes oil in step with the pressure slope."
        "Measure hose length and bore and declare dead_volume_b in the rig file."
        "Pressure steps on side B with the piston at the B end, at low and at high pressure: a volume takes the same oil at both."
    InternalLeakTurbulent "internal_leak_turbulent" ["m3/(s*sqrt(Pa))"] InternalLeak 0.0 .. 1e-6, 6e-9;
        "Oil passes the piston through a short, wide path (a torn seal, an open bypass), so flow grows with the root of the pressure difference."
        "Inspect the piston seal for a cut and the bypass valve for a seat that does not close."
        "Holds at a quarter and at the whole of the load pressure: a laminar leak falls to a quarter, a turbulent one to a half, an offset not at all."
    ExternalLeakATurbulent "external_leak_a_turbulent" ["m3/(s*sqrt(Pa))"] ExternalLeakA 0.0 .. 1e-6, 6e-9;
        "Oil leaves chamber A through an orifice-like opening (a cracked fitting, a valve off its seat)."
        "Inspect fittings, drain and relief valves on side A."
        "Holds at a quarter and at the whole of the pressure A: a laminar leak falls to a quarter, a turbulent one to a half, an offset not at all."
    ExternalLeakBTurbulent "external_leak_b_turbulent" ["m3/(s*sqrt(Pa))"] ExternalLeakB 0.0 .. 1e-6, 6e-9;
        "Oil leaves chamber B through an orifice-like opening (a cracked fitting, a valve off its seat)."
        "Inspect fittings, drain and relief valves on side B."
        "Holds at a quarter and at the whole of the pressure B: a laminar leak falls to a quarter, a turbulent one to a half, an offset not at all."
    ExternalLeakB "external_leak_b" ["m3/(s*Pa)"] ExternalLeakB 0.0 .. 1e-9, 3e-12;
        "Oil leaves chamber B through a narrow gap, usually past the rod seal, where the model declares no such leak."
        "Look for oil at the rod gland and replace the rod seal."
        "A hold with pressure on side B alone, valves shut: the pressure falls while no oil passes the piston."
    EntrainedAir "entrained_air" ["1"] Storage 0.0 .. 0.2, 1e-2;
        "Free air in the oil makes both chambers soft, most of all at low pressure."
        "Bleed the cylinder, check suction line and tank level; a share above 1 % calls for service."
        "Pressure steps from below 5 bar and from above 50 bar at mid stroke: free air is soft at the lower ones, in both chambers."
    AccumulatorA "accumulator_a" ["m3"] Storage 0.0 .. 1e-2, 2e-5;
        "Gas at port A (an accumulator or a trapped bubble) takes oil, less and less as the pressure rises."
        "Bleed port A, or declare the accumulator's volume and precharge."
        "Pressure steps on side A from below 5 bar and from above 50 bar: gas is soft at the lower ones."
    AccumulatorB "accumulator_b" ["m3"] Storage 0.0 .. 1e-2, 2e-5;
        "Gas at port B (an accumulator or a trapped bubble) takes oil, less and less as the pressure rises."
        "Bleed port B, or declare the accumulator's volume and precharge."
        "Pressure steps on side B from below 5 bar and from above 50 bar: gas is soft at the lower ones."
    FlowMeterOffsetA "flow_meter_offset_a" ["m3/s"] Sensor -1e-3 .. 1e-3, 3.3e-6;
        "Flow meter A does not read zero at rest; it passes for a leak that does not depend on pressure."
        "Zero flow meter A with the valves shut."
        "A minute with the valves shut and line A vented: what flow meter A still reads is its offset."
    FlowMeterOffsetB "flow_meter_offset_b" ["m3/s"] Sensor -1e-3 .. 1e-3, 3.3e-6;
        "Flow meter B does not read zero at rest; it passes for a leak that does not depend on pressure."
        "Zero flow meter B with the valves shut."
        "A minute with the valves shut and line B vented: what flow meter B still reads is its offset."
    FlowMeterGainA "flow_meter_gain_a" ["1"] Sensor -0.5 .. 0.5, 2e-2;
        "Flow meter A reads a constant share too much or too little (wrong viscosity, worn turbine, wrong scale)."
        "Calibrate flow meter A against the swept volume of one full stroke."
        "A full stroke at constant speed: flow meter A against the swept volume of side A."
    FlowMeterGainB "flow_meter_gain_b" ["1"] Sensor -0.5 .. 0.5, 2e-2;
        "Flow meter B reads a constant share too much or too little (wrong viscosity, worn turbine, wrong scale)."
        "Calibrate flow meter B against the swept volume of one full stroke."
        "A full stroke at constant speed: flow meter B against the swept volume of side B."
    FlowMeterLag "flow_meter_lag" ["s"] Sensor 0.0 .. 1.0, 2e-2;
        "Both flow meters answer late (inertia of the turbine, averaging, transport delay of the bus)."
        "Shorten the meters' averaging or shift the flow channels by the lag."
        "A step of the valve: how long the meters answer after the piston."
    PositionGain "position_gain" ["1"] Sensor -0.5 .. 0.5, 2e-2;
        "The position sensor reads a constant share too much or too little, so the swept flow is wrong in both chambers."
        "Calibrate the position sensor at both end stops."
        "A full stroke between the end stops: the position sensor against the stroke of the data sheet."
    PositionOffset "position_offset" ["m"] Sensor -0.1 .. 0.1, 2e-3;
        "The position sensor's zero is not at the A end; chamber volumes are wrong by a constant."
        "Set the position sensor's zero with the piston at the A end."
        "The piston at the A end stop: the position sensor's zero."
    PressureOffsetA "pressure_offset_a" ["Pa"] Sensor -2e6 .. 2e6, 1e5;
        "Pressure sensor A does not read zero without pressure."
        "Zero pressure sensor A with the line vented."
        "Line A vented: what pressure sensor A still reads."
    PressureOffsetB "pressure_offset_b" ["Pa"] Sensor -2e6 .. 2e6, 1e5;
        "Pressure sensor B does not read zero without pressure."
        "Zero pressure sensor B with the line vented."
        "Line B vented: what pressure sensor B still reads."
    PressureGainA "pressure_gain_a" ["1"] Sensor -0.5 .. 0.5, 2e-2;
        "Pressure sensor A reads a constant share too much or too little; the force balance shows it."
        "Calibrate pressure sensor A against a reference gauge."
        "A reference gauge at port A at high pressure."
    PressureGainB "pressure_gain_b" ["1"] Sensor -0.5 .. 0.5, 2e-2;
        "Pressure sensor B reads a constant share too much or too little; the force balance shows it."
        "Calibrate pressure sensor B against a reference gauge."
        "A reference gauge at port B at high pressure."
    PressureLagA "pressure_lag_a" ["s"] Sensor 0.0 .. 1.0, 2e-2;
        "Pressure sensor A answers late: a thin or air-filled gauge line, a snubber, or a filter in its electronics."
        "Bleed or shorten the gauge line, take the snubber out, or declare the lag."
        "A step of the valve: how long pressure sensor A answers after the piston and the flow."
    PressureLagB "pressure_lag_b" ["s"] Sensor 0.0 .. 1.0, 2e-2;
        "Pressure sensor B answers late: a thin or air-filled gauge line, a snubber, or a filter in its electronics."
        "Bleed or shorten the gauge line, take the snubber out, or declare the lag."
        "A step of the valve: how long pressure sensor B answers after the piston and the flow."
    LineResistanceA "line_resistance_a" ["Pa*s/m3"] Sensor 0.0 .. 1e12, 1e9;
        "Pressure sensor A sits at the valve, a line away from the cylinder, and reads the line's loss on top while oil flows."
        "Move the sensor to the cylinder port, or declare the line's resistance."
        "A second pressure sensor at the cylinder's port A while oil flows."
    LineResistanceB "line_resistance_b" ["Pa*s/m3"] Sensor 0.0 .. 1e12, 1e9;
        "Pressure sensor B sits at the valve, a line away from the cylinder, and reads the line's loss on top while oil flows."
        "Move the sensor to the cylinder port, or declare the line's resistance."
        "A second pressure sensor at the cylinder's port B while oil flows."
    DragLeak "drag_leak" ["1"] InternalLeak -0.1 .. 0.1, 1e-2;
        "The moving seal carries a share of the swept oil past the piston (positive: from A to B while extending)."
        "Check seal type and fit; at low speed it vanishes, so hold tests do not see it."
        "Strokes at full and at a tenth of the speed under the same load: the share of the flow that passes with the seal stays."
    PositionDependentLeak "position_dependent_leak" ["m3/(s*Pa)"] InternalLeak 0.0 .. 1e-9, 1e-11;
        "A worn spot in the bore lets oil past the piston only while the piston stands there."
        "Inspect the bore at the position named; honing or a new barrel, not a new seal, cures it."
        "Holds under load at several positions: only at the worn spot the leak is larger."
    InternalLeakTemperature "internal_leak_temperature" ["m3/(s*Pa*K)"] InternalLeak -1e-11 .. 1e-11, 3e-13;
        "Warm oil is thinner, so the laminar leak past the piston grows with temperature."
        "Compare leak estimates at equal oil temperature, or let the model carry the slope."
        "The same hold with cold and with warm oil."
    ViscousFriction "viscous_friction" ["N*s/m"] Force 0.0 .. 1e6, 1.5e3;
        "Seals and guides resist in proportion to speed."
        "Declare it; a rise over months points to a swelling seal or cold oil."
        "Strokes at constant speed, slow to fast: viscous friction grows with speed."
    CoulombFriction "coulomb_friction" ["N"] Force 0.0 .. 1e5, 3e2;
        "Seals and guides resist with a constant force that turns with the direction of motion."
        "Declare it; a rise over months points to a tight or dry seal, or to misalignment."
        "Strokes at constant speed, slow to fast, both ways: dry friction stays."
    StribeckFriction "stribeck_friction" ["N"] Force 0.0 .. 1e5, 1e2;
        "Friction is higher near standstill than in motion, so the piston tends to stick and slip."
        "Check seal material and oil; keep the position loop from hunting."
        "Strokes at constant speed, from creeping to fast: Stribeck friction is there while creeping and gone when fast."
    SealFriction "seal_friction" ["m2"] Force 0.0 .. 1e-2, 5e-5;
        "Pressure pushes the seals on the wall, so friction grows with the sum of both pressures."
        "Declare it; a rise points to an extruded seal."
        "Strokes at constant speed at low and at high pressure in both chambers: seal friction grows with pressure."
    LoadOffset "load_offset" ["N"] Force -1e5 .. 1e5, 2e2;
        "A constant force is missing from the load: weight, a preload, or the load cell's zero."
        "Zero the load cell, or declare the weight."
        "The load cell read with the rod free, and the load weighed."
    LoadStiffness "load_stiffness" ["N/m"] Force -1e6 .. 1e6, 5e3;
        "A force in proportion to position is missing from the load: a spring, a stiff hose, or a tilting weight."
        "Find the spring in the mechanism and declare it."
        "Holds without pressure change at several positions: the force of a spring follows the position."
    AddedMass "added_mass" ["kg"] Storage -1e4 .. 1e4, 1e1;
        "More (or less) mass moves with the piston than declared, such as oil in long lines."
        "Declare the moving mass as fitted."
        "Fast reversals without load: force in step with acceleration."
    ForceGain "force_gain" ["1"] Sensor -0.5 .. 0.5, 5e-2;
        "The load cell reads a constant share too much or too little."
        "Calibrate the load cell."
        "A known weight on the load cell."
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
