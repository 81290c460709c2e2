//! The unknowns of the fit: the declared model's own four constants, every effect of the core's
//! table, and a few products of signals without a name that only serve to say "something else is there".

use super::sensitivity::Channel;
use super::signal_product::SignalProduct;
use pitchleak_core::effects::{EffectConstants, EffectKind, LeftSide};
use pitchleak_core::{Effect, Model, Signals, Terms};

/// One column of the regression.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Term {
    /// 1/β, per Pa.
    InverseBulk,
    /// C_ip.
    Internal,
    /// C_epA.
    ExternalA,
    /// C_epB.
    ExternalB,
    /// A candidate of the core's table.
    Effect(Effect),
    /// A product of signals that no known effect makes.
    SignalProduct(SignalProduct),
    /// The product of two effects' terms, equation by equation: one acts on the other.
    Product(Effect, Effect),
}

/// An instant at which nothing is zero: what an effect's term leaves out there, it leaves out always.
const PROBE: Signals<f64> = Signals {
    x_m: 0.1,
    v_mps: 1e-3,
    a_mps2: 0.1,
    pa_pa: 4e6,
    pb_pa: 3e6,
    dpa_pas: 1e6,
    dpb_pas: -1.1e6,
    d2pa_pas2: 1e7,
    d2pb_pas2: -1.2e7,
    pa_side: 0.9,
    pb_side: -0.8,
    dpa_side_ps: 2.0,
    dpb_side_ps: -3.0,
    x_side: 0.7,
    dx_side_ps: 1.5,
    qa_unread: 0.6,
    qb_unread: -0.5,
    qa_m3s: 1e-5,
    qb_m3s: -1.3e-5,
    dqa_m3s2: 1e-4,
    dqb_m3s2: -1.4e-4,
    force_n: 2e3,
    temp_k: 300.0,
    t_s: 10.0,
};

/// The four constants of the declared model.
pub(crate) const DECLARED: [Term; 4] = [Term::InverseBulk, Term::Internal, Term::ExternalA, Term::ExternalB];

/// Every column: the declared model's, the candidates', the products of signals.
pub(crate) fn all_terms() -> Vec<Term> {
    let known = Effect::ALL.iter().copied().map(Term::Effect);
    DECLARED.into_iter().chain(known).chain(SignalProduct::ALL.map(Term::SignalProduct)).collect()
}

impl Term {
    /// What one unit adds to the residual at an instant.
    pub(crate) fn unit_term(
        self,
        at: &Signals<f64>,
        model: &Model<f64>,
        constants: &EffectConstants<f64>,
    ) -> Terms<f64> {
        let load = at.pa_pa - at.pb_pa;
        match self {
            Self::InverseBulk => Terms {
                chamber_a_m3s: model.cylinder.volume_a_m3(at.x_m) * at.dpa_pas,
                chamber_b_m3s: model.cylinder.volume_b_m3(at.x_m) * at.dpb_pas,
                force_n: 0.0,
            },
            Self::Internal => Terms { chamber_a_m3s: load, chamber_b_m3s: -load, force_n: 0.0 },
            Self::ExternalA => Terms { chamber_a_m3s: at.pa_pa, ..Terms::default() },
            Self::ExternalB => Terms { chamber_b_m3s: at.pb_pa, ..Terms::default() },
            Self::Effect(effect) => effect.unit_term(at, model, constants),
            Self::SignalProduct(product) => product.unit_term(at, model),
            Self::Product(one, other) => {
                one.unit_term(at, model, constants).zip(other.unit_term(at, model, constants), |a, b| a * b)
            }
        }
    }

    /// What the sensors show of the truth with the term at this value; none where it is no sensor's.
    pub(super) fn read(self, value: f64, truth: &Signals<f64>) -> Option<Signals<f64>> {
        match self {
            Self::Effect(effect) if effect.spec().kind == EffectKind::Sensor => {
                Some(effect.read(value, truth))
            }
            Self::SignalProduct(product) => product.read(value, truth),
            _ => None,
        }
    }

    /// A size that shows clearly.
    pub(super) fn usual_size(self) -> f64 {
        self.effect().map_or(SignalProduct::USUAL_BEND, |effect| effect.spec().default_size)
    }

    /// Whether it is a leak.
    pub(crate) fn is_leak(self) -> bool {
        match self {
            Self::Internal | Self::ExternalA | Self::ExternalB => true,
            Self::Effect(effect) => effect.spec().kind.is_leak(),
            Self::InverseBulk | Self::SignalProduct(_) | Self::Product(..) => false,
        }
    }

    /// Whether the term shows in the balance of forces. A sensor's error in the acceleration does not: the speed that
    /// forces feel comes from the flows (`data/motion.rs`), not from the position.
    pub(crate) fn in_force(self) -> bool {
        match self {
            Self::Effect(effect) => {
                let is_sensor = effect.spec().kind == EffectKind::Sensor;
                let at = Signals { a_mps2: if is_sensor { 0.0 } else { PROBE.a_mps2 }, ..PROBE };
                effect.unit_term(&at, &Model::paper(), &EffectConstants::default()).force_n != 0.0
            }
            Self::SignalProduct(product) => product.in_force(),
            Self::Product(one, other) => Self::Effect(one).in_force() && Self::Effect(other).in_force(),
            _ => false,
        }
    }

    /// The signals whose noise the column carries beside that of the residual: the channel, and whether its value (0)
    /// or its rate (1). The others' columns are quiet against what they vary.
    pub(crate) fn noisy_in(self) -> &'static [(Channel, usize)] {
        const SPEED: &[(Channel, usize)] = &[(Channel::Position, 1)];
        const STORAGE: &[(Channel, usize)] = &[(Channel::PressureA, 1), (Channel::PressureB, 1)];
        const FLOWS: &[(Channel, usize)] = &[(Channel::FlowA, 0), (Channel::FlowB, 0)];
        const FORCE: &[(Channel, usize)] = &[(Channel::FeltSpeed, 0), (Channel::FeltSpeed, 1)];
        let effect = match self {
            Self::InverseBulk | Self::SignalProduct(SignalProduct::StiffeningOil) => return STORAGE,
            Self::SignalProduct(SignalProduct::DirectionLeak) => return SPEED,
            Self::SignalProduct(SignalProduct::BentPressureA) => {
                return &[(Channel::PressureA, 0), (Channel::PressureA, 1)];
            }
            Self::SignalProduct(SignalProduct::BentPressureB) => {
                return &[(Channel::PressureB, 0), (Channel::PressureB, 1)];
            }
            // The direction turns with what both meters read.
            Self::Effect(Effect::InternalLeakDirection) => return FLOWS,
            Self::Effect(effect) => effect,
            _ => return &[],
        };
        match (effect.spec().carries, effect.spec().kind) {
            (Some(LeftSide::Speed), _) => SPEED,
            (Some(LeftSide::FlowA), _) => &[(Channel::FlowA, 0)],
            (Some(LeftSide::FlowB), _) => &[(Channel::FlowB, 0)],
            (None, kind) if kind != EffectKind::Sensor && self.in_force() => FORCE,
            (None, EffectKind::Storage) => STORAGE,
            _ => &[],
        }
    }

    /// Whether the column is in proportion to what the equations have on their left side, Q or A ẋ.
    pub(crate) fn is_left_side(self) -> bool {
        match self {
            Self::Effect(effect) => effect.spec().carries.is_some(),
            Self::SignalProduct(product) => product == SignalProduct::DirectionLeak,
            _ => false,
        }
    }

    /// The effect, where the term is one.
    pub(crate) fn effect(self) -> Option<Effect> {
        if let Self::Effect(effect) = self { Some(effect) } else { None }
    }

    /// Values that physics allows.
    pub(crate) fn bounds(self) -> (f64, f64) {
        match self {
            Self::Effect(effect) => (effect.spec().lower, effect.spec().upper),
            _ => (f64::NEG_INFINITY, f64::INFINITY),
        }
    }
}
