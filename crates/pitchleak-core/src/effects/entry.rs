//! What an entry of the table of effects says, and the macro that makes the enum and its functions of it.

use super::EffectConstant;

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
