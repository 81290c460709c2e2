use super::Effect;
use crate::Real;

/// The constants in which some effects are not linear. Every effect is linear in its value.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Shape<T> {
    /// Gas: gauge pressure at which the accumulator's volume is counted, and below which it takes
    /// no oil, Pa. Zero for a trapped bubble.
    pub precharge_pa: T,
    /// Gas: polytropic exponent, 1 (slow) to 1.4 (fast).
    pub polytropic_exponent: T,
    /// Friction: speed within which its direction turns, m/s.
    pub slip_speed_mps: T,
    /// Stribeck friction: speed at which it has fallen to 1/e, m/s.
    pub stribeck_speed_mps: T,
    /// Worn spot: where, m from the A end.
    pub spot_position_m: T,
    /// Worn spot: distance at which the leak has fallen to 1/e, m.
    pub spot_width_m: T,
    /// Temperature at which the declared leak holds, K.
    pub reference_temp_k: T,
}

/// One constant of a [`Shape`], by name: what a fit may vary.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "snake_case"))]
pub enum ShapeParameter {
    /// [`Shape::precharge_pa`]
    Precharge,
    /// [`Shape::polytropic_exponent`]
    PolytropicExponent,
    /// [`Shape::slip_speed_mps`]
    SlipSpeed,
    /// [`Shape::stribeck_speed_mps`]
    StribeckSpeed,
    /// [`Shape::spot_position_m`]
    SpotPosition,
    /// [`Shape::spot_width_m`]
    SpotWidth,
    /// [`Shape::reference_temp_k`]
    ReferenceTemp,
}

/// Name, unit and physical bounds of a [`ShapeParameter`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ShapeParameterSpec {
    /// Name in rig files and reports.
    pub id: &'static str,
    /// SI unit.
    pub unit: &'static str,
    /// Smallest value that physics allows.
    pub lower: f64,
    /// Largest value worth believing.
    pub upper: f64,
}

impl ShapeParameter {
    /// Every constant.
    pub const ALL: [Self; 7] = [
        Self::Precharge,
        Self::PolytropicExponent,
        Self::SlipSpeed,
        Self::StribeckSpeed,
        Self::SpotPosition,
        Self::SpotWidth,
        Self::ReferenceTemp,
    ];

    /// Name, unit and bounds.
    pub const fn spec(self) -> ShapeParameterSpec {
        let (id, unit, lower, upper) = match self {
            Self::Precharge => ("precharge", "Pa", 0.0, 3e7),
            Self::PolytropicExponent => ("polytropic_exponent", "1", 1.0, 1.8),
            Self::SlipSpeed => ("slip_speed", "m/s", 1e-5, 1e-1),
            Self::StribeckSpeed => ("stribeck_speed", "m/s", 1e-4, 1.0),
            Self::SpotPosition => ("spot_position", "m", 0.0, 10.0),
            Self::SpotWidth => ("spot_width", "m", 1e-4, 10.0),
            Self::ReferenceTemp => ("reference_temp", "K", 200.0, 500.0),
        };
        ShapeParameterSpec { id, unit, lower, upper }
    }
}

impl Effect {
    /// The shape constants on which this effect's term depends; empty for most.
    pub const fn shape_parameters(self) -> &'static [ShapeParameter] {
        use ShapeParameter as P;
        match self {
            Self::EntrainedAir => &[P::PolytropicExponent],
            Self::AccumulatorA | Self::AccumulatorB => &[P::Precharge, P::PolytropicExponent],
            Self::PositionDependentLeak => &[P::SpotPosition, P::SpotWidth],
            Self::InternalLeakTemperature => &[P::ReferenceTemp],
            Self::CoulombFriction | Self::SealFriction => &[P::SlipSpeed],
            Self::StribeckFriction => &[P::StribeckSpeed, P::SlipSpeed],
            _ => &[],
        }
    }
}

impl<T: Real> Default for Shape<T> {
    fn default() -> Self {
        Self {
            precharge_pa: T::zero(),
            polytropic_exponent: T::lit(1.2),
            slip_speed_mps: T::lit(1e-3),
            stribeck_speed_mps: T::lit(0.02),
            spot_position_m: T::lit(0.1),
            spot_width_m: T::lit(0.02),
            reference_temp_k: T::lit(313.15),
        }
    }
}

impl<T: Real> Shape<T> {
    /// The value of one constant.
    pub fn get(&self, parameter: ShapeParameter) -> T {
        let mut copy = *self;
        *copy.slot(parameter)
    }

    /// The same shape with one constant changed.
    #[must_use]
    pub fn with(mut self, parameter: ShapeParameter, value: T) -> Self {
        *self.slot(parameter) = value;
        self
    }

    /// Whether every constant lies within its bounds.
    pub fn is_physical(&self) -> bool {
        ShapeParameter::ALL.iter().all(|parameter| {
            let (value, spec) = (self.get(*parameter), parameter.spec());
            value >= T::lit(spec.lower) && value <= T::lit(spec.upper)
        })
    }

    fn slot(&mut self, parameter: ShapeParameter) -> &mut T {
        match parameter {
            ShapeParameter::Precharge => &mut self.precharge_pa,
            ShapeParameter::PolytropicExponent => &mut self.polytropic_exponent,
            ShapeParameter::SlipSpeed => &mut self.slip_speed_mps,
            ShapeParameter::StribeckSpeed => &mut self.stribeck_speed_mps,
            ShapeParameter::SpotPosition => &mut self.spot_position_m,
            ShapeParameter::SpotWidth => &mut self.spot_width_m,
            ShapeParameter::ReferenceTemp => &mut self.reference_temp_k,
        }
    }
}
