//! What an entry of the table of effects says, the macro that makes the enum and its functions of it, and the constants in which
//! effects are not linear.

use crate::{Real, Signals};

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
    /// A number of the cylinder that is not as declared: the plant is built with it.
    Cylinder,
    /// A sensor that does not read the truth; the plant itself is unchanged.
    Sensor,
}

impl EffectKind {
    /// Whether oil leaves a chamber for good.
    pub fn is_leak(self) -> bool {
        matches!(self, Self::InternalLeak | Self::ExternalLeakA | Self::ExternalLeakB)
    }
}

/// A measured quantity on the left side of an equation: Q = A ẋ + … of the chambers, A_A P_A − A_B P_B − F = … of the forces.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LeftSide {
    /// ẋ, from the position sensor.
    Speed,
    /// Q_A.
    FlowA,
    /// Q_B.
    FlowB,
    /// P_A and its rate.
    PressureA,
    /// P_B and its rate.
    PressureB,
    /// F, from the load cell.
    Force,
}

/// What is fixed about an effect.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
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
    /// The constants on which its term depends.
    pub constants: &'static [EffectConstant],
    /// Those among them that are taken as they are, never fitted: they fix a reference, or hardly matter.
    pub given: &'static [EffectConstant],
    /// The measured quantity to which its term is in proportion, so that the regressor carries the very noise of
    /// what the model leaves over; none where it does not. Even terms (|ẋ|, |Q|) carry none on average.
    pub carries: Option<LeftSide>,
    /// The measured quantities whose noise its term shares with the residual though it is not in proportion to them.
    pub shares_noise_of: &'static [LeftSide],
    /// When it is the cause.
    pub cause: &'static str,
    /// What to do about it.
    pub remedy: &'static str,
    /// The measurement that shows it apart from what looks alike.
    pub measurement: &'static str,
}

/// The first of two where it is there, else the second.
macro_rules! given_or {
    ([$value:expr] $default:expr) => {
        $value
    };
    ([] $default:expr) => {
        $default
    };
}

/// The enum of effects and what each of them is, from the entries of `table.rs`.
macro_rules! effects {
    ($(
        $variant:ident $id:literal [$unit:literal] $kind:ident $lower:literal .. $upper:literal, $size:literal;
        $(term $term:expr;)?
        $(reads $reads:expr;)?
        $(late [$($late:ident),*];)?
        $(hangs [$hangs:ident];)?
        $(deaf [$deaf:ident];)?
        $(constants [$($constant:ident),*];)?
        $(given [$($given:ident),*];)?
        $(prior $sensor:ident.$spread:ident;)?
        $(carries $left_side:ident;)?
        $(shares [$($shared:ident),*];)?
        $(dry $dry:expr;)?
        $(adds $declared:ident;)?
        $cause:literal $remedy:literal $measurement:literal
    )*) => {
        use $crate::effects::entry::given_or;
        use $crate::effects::terms::Distortion;
        use $crate::effects::{EffectConstant, EffectConstants, EffectKind, EffectSpec, LeftSide};
        use $crate::{Cylinder, Model, Real, Sensors, Signals, Terms};

        /// A physical or sensor effect that the plain model lacks.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
        #[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(rename_all = "snake_case"))]
        #[non_exhaustive]
        pub enum Effect { $(#[doc = $cause] $variant,)* }

        impl Effect {
            /// Every effect, in the order of the table.
            pub const ALL: &'static [Self] = &[$(Self::$variant),*];

            /// What is fixed about the effect.
            #[inline]
            pub const fn spec(self) -> &'static EffectSpec {
                match self {
                    $(Self::$variant => &EffectSpec {
                        id: $id, unit: $unit, kind: EffectKind::$kind,
                        lower: $lower, upper: $upper, default_size: $size,
                        constants: &[$($(EffectConstant::$constant,)*)? $($(EffectConstant::$given,)*)?],
                        given: &[$($(EffectConstant::$given,)*)?],
                        carries: given_or!([$(Some(LeftSide::$left_side))?] None),
                        shares_noise_of: &[$($(LeftSide::$shared,)*)?],
                        cause: $cause, remedy: $remedy, measurement: $measurement,
                    },)*
                }
            }

            /// The declared standard deviation of the sensor error that this effect is, in the effect's unit: what is
            /// known of its size beforehand. None for what no data sheet speaks of, or where it says zero.
            pub fn prior_std<T: Real>(self, sensors: &Sensors<T>) -> Option<T> {
                let std = match self {
                    $(Self::$variant => given_or!([$(sensors.$sensor.$spread)?] T::zero()),)*
                };
                (std > T::zero()).then_some(std)
            }

            /// The signals that a sensor answering late delays; its value is the lag. None for all other effects.
            pub fn late<T>(self, signals: &mut Signals<T>) -> [Option<&mut T>; 2] {
                let mut late = [None, None];
                match self {
                    $($(Self::$variant => {
                        for (slot, signal) in late.iter_mut().zip([$(&mut signals.$late),*]) {
                            *slot = Some(signal);
                        }
                    })?)*
                    _ => {}
                }
                late
            }

            /// The signal that a sensor with play hangs behind; its value is the play on either side. None for all other effects.
            pub fn hanging<T>(self, signals: &mut Signals<T>) -> Option<&mut T> {
                match self {
                    $($(Self::$variant => Some(&mut signals.$hangs),)?)*
                    _ => None,
                }
            }

            /// The signal that a meter with a dead band shows as zero while it is smaller than the effect's value. None for all other
            /// effects.
            pub fn deaf<T>(self, signals: &mut Signals<T>) -> Option<&mut T> {
                match self {
                    $($(Self::$variant => Some(&mut signals.$deaf),)?)*
                    _ => None,
                }
            }

            /// The force, N, with which one unit of a dry friction can hold a piston that stands: there it is whatever balances the
            /// other forces, up to that. None for all other effects.
            pub fn stiction<T: Real>(self, at: &Signals<T>) -> Option<T> {
                fn of<T>(dry: impl Fn(&Signals<T>) -> T) -> impl Fn(&Signals<T>) -> T {
                    dry
                }
                match self {
                    $($(Self::$variant => Some(of::<T>($dry)(at)),)?)*
                    _ => None,
                }
            }

            /// The declared number of the cylinder to which the effect's value adds, in the effect's unit. None for what the rig
            /// file has no number for.
            pub fn adds_to<T>(self, cylinder: &mut Cylinder<T>) -> Option<&mut T> {
                match self {
                    $($(Self::$variant => Some(&mut cylinder.$declared),)?)*
                    _ => None,
                }
            }

            /// The term of one unit of a physical effect on the right of eq. (1)–(2). Sensor effects have none: the
            /// plant does not feel them.
            #[inline]
            pub(super) fn physical_term<T: Real>(
                self,
                at: &Signals<T>,
                model: &Model<T>,
                constants: &EffectConstants<T>,
            ) -> Terms<T> {
                fn of<T>(
                    term: impl Fn(&Signals<T>, &Model<T>, &EffectConstants<T>) -> Terms<T>,
                ) -> impl Fn(&Signals<T>, &Model<T>, &EffectConstants<T>) -> Terms<T> {
                    term
                }
                match self {
                    $(Self::$variant => given_or!([$(of::<T>($term)(at, model, constants))?] Terms::default()),)*
                }
            }

            /// What one unit does to the readings; a physical effect distorts nothing. `at` supplies the signals
            /// that one reading borrows from another.
            pub(super) fn distortion<T: Real>(self, at: &Signals<T>) -> Distortion<T> {
                fn of<T>(
                    reads: impl Fn(&Signals<T>, T, Signals<T>) -> Distortion<T>,
                ) -> impl Fn(&Signals<T>, T, Signals<T>) -> Distortion<T> {
                    reads
                }
                match self {
                    $(Self::$variant => {
                        given_or!([$(of::<T>($reads)(at, T::one(), Signals::default()))?] Distortion::None)
                    })*
                }
            }
        }
    };
}

pub(super) use {effects, given_or};

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

    /// Whether it is a place among those that a trace passes: at an end of them, what lies beyond may be so as well.
    pub fn is_place(self) -> bool {
        matches!(self, Self::SpotPosition | Self::CrackingPressure)
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
