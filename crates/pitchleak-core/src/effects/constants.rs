use crate::{Real, Signals};

/// The constants in which some effects are not linear. Every effect is linear in its value.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct EffectConstants<T> {
    /// Gas: gauge pressure at which the accumulator's volume is counted, and below which it takes
    /// no oil, Pa. Zero for a trapped bubble.
    pub precharge_pa: T,
    /// Gas: polytropic exponent, 1 (slow) to 1.4 (fast).
    pub polytropic_exponent: T,
    /// Friction, and leaks with a direction: speed within which it turns, m/s.
    pub slip_speed_mps: T,
    /// Stribeck friction: speed at which it has fallen to 1/e, m/s.
    pub stribeck_speed_mps: T,
    /// Worn spot: where, m from the A end.
    pub spot_position_m: T,
    /// Worn spot: distance at which the leak has fallen to 1/e, m.
    pub spot_width_m: T,
    /// Temperature at which the declared leak holds, K.
    pub reference_temp_k: T,
    /// Relief valve or seal that opens under pressure: gauge pressure from which it leaks, Pa.
    pub cracking_pa: T,
}

/// One constant of a [`EffectConstants`], by name: what a fit may vary.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(rename_all = "snake_case"))]
pub enum EffectConstant {
    /// [`EffectConstants::precharge_pa`]
    Precharge,
    /// [`EffectConstants::polytropic_exponent`]
    PolytropicExponent,
    /// [`EffectConstants::slip_speed_mps`]
    SlipSpeed,
    /// [`EffectConstants::stribeck_speed_mps`]
    StribeckSpeed,
    /// [`EffectConstants::spot_position_m`]
    SpotPosition,
    /// [`EffectConstants::spot_width_m`]
    SpotWidth,
    /// [`EffectConstants::reference_temp_k`]
    ReferenceTemp,
    /// [`EffectConstants::cracking_pa`]
    CrackingPressure,
}

/// Name, unit and physical bounds of a [`EffectConstant`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EffectConstantSpec {
    /// Name in rig files and reports.
    pub id: &'static str,
    /// SI unit.
    pub unit: &'static str,
    /// Smallest value that physics allows.
    pub lower: f64,
    /// Largest value worth believing.
    pub upper: f64,
}

impl EffectConstant {
    /// Every constant.
    pub const ALL: [Self; 8] = [
        Self::Precharge,
        Self::PolytropicExponent,
        Self::SlipSpeed,
        Self::StribeckSpeed,
        Self::SpotPosition,
        Self::SpotWidth,
        Self::ReferenceTemp,
        Self::CrackingPressure,
    ];

    /// Name, unit and bounds.
    pub const fn spec(self) -> EffectConstantSpec {
        let (id, unit, lower, upper) = match self {
            Self::Precharge => ("precharge", "Pa", 0.0, 3e7),
            Self::PolytropicExponent => ("polytropic_exponent", "1", 1.0, 1.8),
            Self::SlipSpeed => ("slip_speed", "m/s", 1e-5, 1e-1),
            Self::StribeckSpeed => ("stribeck_speed", "m/s", 1e-4, 1.0),
            Self::SpotPosition => ("spot_position", "m", 0.0, 10.0),
            Self::SpotWidth => ("spot_width", "m", 1e-4, 10.0),
            Self::ReferenceTemp => ("reference_temp", "K", 200.0, 500.0),
            Self::CrackingPressure => ("cracking_pressure", "Pa", 0.0, 1e8),
        };
        EffectConstantSpec { id, unit, lower, upper }
    }

    /// The values that a trace can tell apart: `span` gives the least and the largest value of a quantity in it, `finest` is the
    /// smallest value of this constant that it resolves. None where it tells nothing. The shares are chosen: a bell, a bend or a
    /// threshold shows only well within what the trace covers, a Stribeck speed up to half beyond it, as its bend begins at rest.
    pub fn range(
        self,
        finest: f64,
        span: impl Fn(fn(&Signals<f64>) -> f64) -> (f64, f64),
    ) -> Option<(f64, f64)> {
        let fastest_mps = || span(|at| at.v_mps.abs()).1;
        let (low, high) = match self {
            Self::SpotPosition => span(|at| at.x_m),
            Self::SpotWidth => {
                let (low, high) = span(|at| at.x_m);
                (0.05 * (high - low), 0.7 * (high - low))
            }
            Self::StribeckSpeed => (0.02 * fastest_mps(), 1.5 * fastest_mps()),
            Self::SlipSpeed => (finest, 0.3 * fastest_mps()),
            Self::Precharge => (0.0, span(|at| at.pa_pa.max(at.pb_pa)).1),
            Self::CrackingPressure => {
                let (low, high) = span(|at| (at.pa_pa - at.pb_pa).abs());
                // What always or never opens can't be told from other leaks, or at all.
                (low + 0.05 * (high - low), high - 0.05 * (high - low))
            }
            // Slow to fast.
            Self::PolytropicExponent => (1.0, 1.4),
            Self::ReferenceTemp => return None,
        };
        let spec = self.spec();
        let (low, high) = (low.max(spec.lower), high.min(spec.upper));
        (high > low).then_some((low, high))
    }
}

impl<T: Real> Default for EffectConstants<T> {
    fn default() -> Self {
        Self {
            precharge_pa: T::zero(),
            polytropic_exponent: T::lit(1.2),
            slip_speed_mps: T::lit(1e-3),
            stribeck_speed_mps: T::lit(0.02),
            spot_position_m: T::lit(0.1),
            spot_width_m: T::lit(0.02),
            reference_temp_k: T::lit(313.15),
            cracking_pa: T::lit(5e6),
        }
    }
}

impl<T: Real> EffectConstants<T> {
    /// The value of one constant.
    pub fn get(&self, parameter: EffectConstant) -> T {
        let mut copy = *self;
        *copy.slot(parameter)
    }

    /// The same constants with one constant changed.
    #[must_use]
    pub fn with(mut self, parameter: EffectConstant, value: T) -> Self {
        *self.slot(parameter) = value;
        self
    }

    /// Whether every constant lies within its bounds.
    pub fn is_physical(&self) -> bool {
        EffectConstant::ALL.iter().all(|parameter| {
            let (value, spec) = (self.get(*parameter), parameter.spec());
            value >= T::lit(spec.lower) && value <= T::lit(spec.upper)
        })
    }

    fn slot(&mut self, parameter: EffectConstant) -> &mut T {
        match parameter {
            EffectConstant::Precharge => &mut self.precharge_pa,
            EffectConstant::PolytropicExponent => &mut self.polytropic_exponent,
            EffectConstant::SlipSpeed => &mut self.slip_speed_mps,
            EffectConstant::StribeckSpeed => &mut self.stribeck_speed_mps,
            EffectConstant::SpotPosition => &mut self.spot_position_m,
            EffectConstant::SpotWidth => &mut self.spot_width_m,
            EffectConstant::ReferenceTemp => &mut self.reference_temp_k,
            EffectConstant::CrackingPressure => &mut self.cracking_pa,
        }
    }
}
