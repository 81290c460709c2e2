//! The unknowns of the fit: the declared model's own four constants, every effect of the core's table, and a few products of signals
//! that the table does not list, which only serve to say "something else is there", or "that would do as well".

use super::leak_change::LeakChange;
use crate::diagnose::data::Channel;
use crate::diagnose::equation::Equation;
use crate::diagnose::thresholds::NEGLIGIBLE_SHARE;
use pitchleak_core::effects::{EffectConstant, EffectConstants, EffectKind, EffectSpec, LeftSide};
use pitchleak_core::{Effect, Leak, Model, Signals, Terms};

/// One column of the regression.
#[derive(Clone, Copy, Debug, PartialEq)]
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
    Unlisted(Unlisted),
    /// The product of two effects' terms, equation by equation: one acts on the other.
    Product(Effect, Effect),
    /// By how much a leak is larger from some row on; its column is made of the leak's.
    LeakChange(LeakChange),
    /// A constant of an effect's law that is fitted beside its size.
    Constant(Effect, EffectConstant),
}

/// Which columns are built.
#[derive(Clone, Copy)]
pub(crate) struct Columns<'a> {
    pub(crate) terms: &'a [Term],
    /// Of each term.
    pub(crate) constants: &'a [EffectConstants<f64>],
    /// Places of the terms that get a column; those of the others stay empty.
    pub(crate) places: &'a [usize],
}

/// Which balances are meant: the chambers' oil, the piston's forces.
#[derive(Clone, Copy)]
pub(super) struct Balances {
    pub(super) chambers: bool,
    pub(super) force: bool,
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

/// Forces feel speed and acceleration.
const FELT: [(Channel, usize); 2] = [(Channel::FeltSpeed, 0), (Channel::FeltSpeed, 1)];

/// The signals that measure a left side of the equations.
fn left_side(side: LeftSide) -> &'static [(Channel, usize)] {
    match side {
        LeftSide::Speed => &[(Channel::Position, 1)],
        LeftSide::FlowA => &[(Channel::FlowA, 0)],
        LeftSide::FlowB => &[(Channel::FlowB, 0)],
        LeftSide::PressureA => &[(Channel::PressureA, 0), (Channel::PressureA, 1), (Channel::PressureA, 2)],
        LeftSide::PressureB => &[(Channel::PressureB, 0), (Channel::PressureB, 1), (Channel::PressureB, 2)],
        LeftSide::Force => &[(Channel::Force, 0)],
    }
}

/// The four constants of the declared model.
pub(crate) const DECLARED: [Term; 4] = [Term::InverseBulk, Term::Internal, Term::ExternalA, Term::ExternalB];

/// Every column: the declared model's, the candidates', the unlisted ones, those of the candidates' constants.
pub(crate) fn all_terms() -> Vec<Term> {
    let known = Effect::ALL.iter().copied().map(Term::Effect);
    let constants_of = |effect: Effect| effect.fitted_constants().map(move |own| Term::Constant(effect, own));
    let constants = Effect::ALL.iter().copied().flat_map(constants_of);
    DECLARED.into_iter().chain(known).chain(Unlisted::ALL.map(Term::Unlisted)).chain(constants).collect()
}

impl Term {
    /// The declared model's term of a leak.
    pub(crate) fn of_leak(leak: Leak) -> Self {
        match leak {
            Leak::Internal => Self::Internal,
            Leak::ExternalA => Self::ExternalA,
            Leak::ExternalB => Self::ExternalB,
        }
    }

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
            Self::Unlisted(product) => product.unit_term(at, model),
            Self::Product(one, other) => {
                one.unit_term(at, model, constants).zip(other.unit_term(at, model, constants), |a, b| a * b)
            }
            // Of a leak's column, or of where the model stands.
            Self::LeakChange(_) | Self::Constant(..) => Terms::default(),
        }
    }

    /// What the sensors show of the truth with the term at this value; none where it is no sensor's.
    pub(super) fn read(self, value: f64, truth: &Signals<f64>) -> Option<Signals<f64>> {
        match self {
            Self::Effect(effect) if effect.spec().kind == EffectKind::Sensor => {
                Some(effect.read(value, truth))
            }
            Self::Unlisted(product) => product.read(value, truth),
            _ => None,
        }
    }

    /// A leak that shows clearly: 0.3 L/min at 50 bar, m³/s/Pa.
    const USUAL_LEAK_M3SPA: f64 = 1e-12;

    /// A size that shows clearly.
    pub(super) fn usual_size(self) -> f64 {
        match self {
            Self::Effect(effect) => effect.spec().default_size,
            Self::Internal | Self::ExternalA | Self::ExternalB => Self::USUAL_LEAK_M3SPA,
            Self::Unlisted(Unlisted::HiddenPlayA | Unlisted::HiddenPlayB) => Unlisted::USUAL_PLAY_PA,
            _ => Unlisted::USUAL_BEND,
        }
    }

    /// Whether it is a leak.
    pub(crate) fn is_leak(self) -> bool {
        match self {
            Self::Internal | Self::ExternalA | Self::ExternalB | Self::LeakChange(_) => true,
            Self::Effect(effect) => effect.spec().kind.is_leak(),
            Self::InverseBulk | Self::Unlisted(_) | Self::Product(..) | Self::Constant(..) => false,
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
            Self::Unlisted(product) => product.in_force(),
            Self::Product(one, other) => Self::Effect(one).in_force() && Self::Effect(other).in_force(),
            Self::Constant(effect, _) => Self::Effect(effect).in_force(),
            _ => false,
        }
    }

    /// The balances that it shows in.
    pub(super) fn balances(self) -> Balances {
        Balances { chambers: !self.is_force(), force: self.in_force() }
    }

    /// Whether it is a force alone.
    fn is_force(self) -> bool {
        match self {
            Self::Effect(effect) => effect.spec().kind == EffectKind::Force,
            Self::Product(one, other) => Self::Effect(one).is_force() || Self::Effect(other).is_force(),
            Self::Constant(effect, _) => Self::Effect(effect).is_force(),
            _ => false,
        }
    }

    /// The signals whose noise the column shares with the residual: the channel, and whether its value (0) or
    /// its rate (1). The others' columns are quiet against what they vary.
    pub(crate) fn noisy_in(self) -> Vec<(Channel, usize)> {
        match self {
            Self::InverseBulk | Self::Unlisted(Unlisted::StiffeningOil) => self.rates(),
            Self::Unlisted(Unlisted::DirectionLeak) => left_side(LeftSide::Speed).to_vec(),
            Self::Unlisted(Unlisted::BentMeterA) => left_side(LeftSide::FlowA).to_vec(),
            Self::Unlisted(Unlisted::BentMeterB) => left_side(LeftSide::FlowB).to_vec(),
            Self::Unlisted(Unlisted::BentPressureA) => left_side(LeftSide::PressureA).to_vec(),
            Self::Unlisted(Unlisted::BentPressureB) => left_side(LeftSide::PressureB).to_vec(),
            Self::Unlisted(Unlisted::SquareFriction) => FELT.to_vec(),
            Self::Effect(effect) => {
                let EffectSpec { carries, shares_noise_of, kind, .. } = effect.spec();
                match *kind {
                    _ if carries.is_some() || !shares_noise_of.is_empty() => {
                        carries.iter().chain(*shares_noise_of).copied().flat_map(left_side).copied().collect()
                    }
                    EffectKind::Sensor => self.rates(),
                    _ if self.in_force() => FELT.to_vec(),
                    _ => self.rates(),
                }
            }
            _ => vec![],
        }
    }

    /// The rates that it is made of, of readings whose noise makes them rough: of what a lag delays, of what drives stored oil. What undoes a
    /// lag brings curvature into a rate.
    fn rates(self) -> Vec<(Channel, usize)> {
        let rough = [Channel::PressureA, Channel::PressureB, Channel::FlowA, Channel::FlowB];
        let of = |at: &Signals<f64>| {
            let Terms { chamber_a_m3s, chamber_b_m3s, force_n } =
                self.unit_term(at, &Model::paper(), &EffectConstants::default());
            [chamber_a_m3s, chamber_b_m3s, force_n]
        };
        let shows = |channel: &Channel| {
            let mut without = PROBE;
            channel.signal(1, &mut without).into_iter().for_each(|rate| *rate = 0.0);
            let pairs = of(&PROBE).into_iter().zip(of(&without));
            pairs.into_iter().any(|(full, without)| (full - without).abs() > NEGLIGIBLE_SHARE * full.abs())
        };
        rough.into_iter().filter(shows).flat_map(|channel| [(channel, 1), (channel, 2)]).collect()
    }

    /// Whether it is a force that never changes.
    pub(crate) fn is_constant_force(self) -> bool {
        let Self::Effect(effect) = self else { return false };
        let at = |signals| effect.unit_term(&signals, &Model::paper(), &EffectConstants::default()).force_n;
        let (probe, zero) = (at(PROBE), at(Signals::default()));
        effect.spec().kind == EffectKind::Force && probe.to_bits() == zero.to_bits()
    }

    /// Whether it is a friction that can hold a piston which stands.
    pub(crate) fn is_dry_friction(self) -> bool {
        self.effect().is_some_and(|effect| effect.stiction(&PROBE).is_some())
    }

    /// Whether the column is in proportion to what the equations have on their left side.
    pub(crate) fn is_left_side(self) -> bool {
        match self {
            Self::Effect(effect) => effect.spec().carries.is_some(),
            Self::Unlisted(product) => product == Unlisted::DirectionLeak,
            _ => false,
        }
    }

    /// By how much its column grows with the reading on the left side of an equation, where it scales that.
    pub(super) fn by_reading(self, at: &Signals<f64>) -> Option<(Equation, f64)> {
        match self {
            Self::Effect(effect) => match effect.spec().carries? {
                LeftSide::FlowA => Some((Equation::ChamberA, -1.0)),
                LeftSide::FlowB => Some((Equation::ChamberB, -1.0)),
                LeftSide::Force => Some((Equation::Force, -1.0)),
                LeftSide::Speed | LeftSide::PressureA | LeftSide::PressureB => None,
            },
            Self::Unlisted(Unlisted::BentMeterA) => Some((Equation::ChamberA, at.qa_m3s.signum())),
            Self::Unlisted(Unlisted::BentMeterB) => Some((Equation::ChamberB, at.qb_m3s.signum())),
            _ => None,
        }
    }

    /// The effect, where the term is one.
    pub(crate) fn effect(self) -> Option<Effect> {
        if let Self::Effect(effect) = self { Some(effect) } else { None }
    }

    /// The product of signals that the table does not list, where the term is one.
    pub(crate) fn unlisted(self) -> Option<Unlisted> {
        if let Self::Unlisted(product) = self { Some(product) } else { None }
    }

    /// Values that physics allows.
    pub(crate) fn bounds(self) -> (f64, f64) {
        match self {
            Self::Effect(effect) => (effect.spec().lower, effect.spec().upper),
            Self::Constant(_, constant) => (constant.spec().lower, constant.spec().upper),
            // The other way it is a leak that grows by less than the pressure, which the table has.
            Self::Unlisted(Unlisted::CubicLeakA | Unlisted::CubicLeakB)
            | Self::Unlisted(Unlisted::HiddenPlayA | Unlisted::HiddenPlayB) => (0.0, f64::INFINITY),
            _ => (f64::NEG_INFINITY, f64::INFINITY),
        }
    }
}

/// Products of signals: stand-ins for effects that the table lacks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Unlisted {
    /// Leak past the piston in proportion to |ẋ| P_L.
    SpeedLeak,
    /// Leak past the piston in proportion to ẋ P_L.
    DirectionLeak,
    /// Leak past the piston in proportion to P_L √|P_L|.
    SteepLeak,
    /// Leak past the piston in proportion to P_L |P_L|.
    SquareLeak,
    /// Leak out of chamber A in proportion to P_A³: a gap that the pressure widens; beside C P it does for whatever grows by more than P.
    CubicLeakA,
    /// Leak out of chamber B in proportion to P_B³.
    CubicLeakB,
    /// Leak past the piston in proportion to the spool's opening |ẋ|/√P times P_L.
    SpoolLeak,
    /// Flow of meter A in proportion to |Q_A|.
    BentMeterA,
    /// Flow of meter B in proportion to |Q_B|.
    BentMeterB,
    /// Reading of pressure sensor A in proportion to P_A².
    BentPressureA,
    /// Reading of pressure sensor B in proportion to P_B².
    BentPressureB,
    /// Play of pressure sensor A while its own reading does not show on which side it lies.
    HiddenPlayA,
    /// Play of pressure sensor B likewise.
    HiddenPlayB,
    /// Force in proportion to ẋ |ẋ|.
    SquareFriction,
    /// Storage in proportion to the pressure: V P Ṗ.
    StiffeningOil,
}

impl Unlisted {
    pub(crate) const ALL: [Self; 15] = [
        Self::SpeedLeak,
        Self::DirectionLeak,
        Self::SteepLeak,
        Self::SquareLeak,
        Self::CubicLeakA,
        Self::CubicLeakB,
        Self::SpoolLeak,
        Self::BentMeterA,
        Self::BentMeterB,
        Self::BentPressureA,
        Self::BentPressureB,
        Self::HiddenPlayA,
        Self::HiddenPlayB,
        Self::SquareFriction,
        Self::StiffeningOil,
    ];

    /// A bend of a pressure's scale that shows clearly, per Pa: 1 % at 10 bar.
    pub(super) const USUAL_BEND: f64 = 1e-8;

    /// A play of a pressure sensor that shows clearly.
    const USUAL_PLAY_PA: f64 = 5e4;

    /// For people.
    pub(crate) fn words(self) -> &'static str {
        match self {
            Self::SpeedLeak => "a leak past the piston that grows with speed times load pressure",
            Self::DirectionLeak => "a leak past the piston that turns with speed times load pressure",
            Self::SteepLeak => "a leak past the piston that grows with the power 1.5 of the load pressure",
            Self::SquareLeak => "a leak past the piston that grows with the square of the load pressure",
            Self::CubicLeakA => "a leak out of chamber A that grows with the cube of its pressure",
            Self::CubicLeakB => "a leak out of chamber B that grows with the cube of its pressure",
            Self::SpoolLeak => "a leak past the piston that follows the valve's opening",
            Self::BentMeterA => "a meter A whose scale differs between both ways",
            Self::BentMeterB => "a meter B whose scale differs between both ways",
            Self::BentPressureA => "a pressure sensor A whose scale bends",
            Self::BentPressureB => "a pressure sensor B whose scale bends",
            Self::HiddenPlayA => "a play of pressure sensor A that its own reading does not show",
            Self::HiddenPlayB => "a play of pressure sensor B that its own reading does not show",
            Self::SquareFriction => "a friction that grows with the square of the speed",
            Self::StiffeningOil => "an oil that stiffens as the pressure rises",
        }
    }

    pub(super) fn unit_term(self, at: &Signals<f64>, model: &Model<f64>) -> Terms<f64> {
        let load = at.pa_pa - at.pb_pa;
        let past = |flow: f64| Terms { chamber_a_m3s: flow, chamber_b_m3s: -flow, force_n: 0.0 };
        match self {
            Self::SpeedLeak => past(at.v_mps.abs() * load),
            Self::DirectionLeak => past(at.v_mps * load),
            Self::SteepLeak => past(load * load.abs().sqrt()),
            Self::SquareLeak => past(load * load.abs()),
            Self::CubicLeakA => Terms { chamber_a_m3s: at.pa_pa.powi(3), ..Terms::default() },
            Self::CubicLeakB => Terms { chamber_b_m3s: at.pb_pa.powi(3), ..Terms::default() },
            Self::SpoolLeak => past(at.v_mps.abs() * load / (at.pa_pa.abs() + at.pb_pa.abs() + 1e5).sqrt()),
            Self::BentMeterA => Terms { chamber_a_m3s: at.qa_m3s.abs(), ..Terms::default() },
            Self::BentMeterB => Terms { chamber_b_m3s: at.qb_m3s.abs(), ..Terms::default() },
            Self::BentPressureA | Self::BentPressureB | Self::HiddenPlayA | Self::HiddenPlayB => {
                let size = Term::Unlisted(self).usual_size();
                model.misread(size, |value| self.read(value, at).unwrap_or(*at))
            }
            Self::SquareFriction => Terms { force_n: at.v_mps * at.v_mps.abs(), ..Terms::default() },
            Self::StiffeningOil => Terms {
                chamber_a_m3s: model.cylinder.volume_a_m3(at.x_m) * at.pa_pa * at.dpa_pas,
                chamber_b_m3s: model.cylinder.volume_b_m3(at.x_m) * at.pb_pa * at.dpb_pas,
                force_n: 0.0,
            },
        }
    }

    /// Whether it is another sight of this listed effect.
    pub(crate) fn is_sight_of(self, effect: Effect) -> bool {
        let mut plays =
            Signals { pa_pa: Some(Self::HiddenPlayA), pb_pa: Some(Self::HiddenPlayB), ..Signals::default() };
        effect.hanging(&mut plays).is_some_and(|own| *own == Some(self))
    }

    /// What the sensors show of the truth; none where no sensor is at fault.
    pub(super) fn read(self, value: f64, truth: &Signals<f64>) -> Option<Signals<f64>> {
        let Signals { pa_pa, dpa_pas, d2pa_pas2, pb_pa, dpb_pas, d2pb_pas2, .. } = *truth;
        // P + c P² and its derivatives.
        let bent = |p: f64, dp: f64, d2p: f64| {
            (
                p + value * p * p,
                dp * (1.0 + 2.0 * value * p),
                d2p * (1.0 + 2.0 * value * p) + 2.0 * value * dp * dp,
            )
        };
        let hangs = |p: f64, dp: f64, (side, rate): (f64, f64)| (p - value * side, dp - value * rate);
        let (a_side, b_side) = ((truth.pa_side, truth.dpa_side_ps), (truth.pb_side, truth.dpb_side_ps));
        match self {
            Self::HiddenPlayA => {
                let (pa_pa, dpa_pas) = hangs(pa_pa, dpa_pas, hidden(a_side, b_side));
                Some(Signals { pa_pa, dpa_pas, ..*truth })
            }
            Self::HiddenPlayB => {
                let (pb_pa, dpb_pas) = hangs(pb_pa, dpb_pas, hidden(b_side, a_side));
                Some(Signals { pb_pa, dpb_pas, ..*truth })
            }
            Self::BentPressureA => {
                let (pa_pa, dpa_pas, d2pa_pas2) = bent(pa_pa, dpa_pas, d2pa_pas2);
                Some(Signals { pa_pa, dpa_pas, d2pa_pas2, ..*truth })
            }
            Self::BentPressureB => {
                let (pb_pa, dpb_pas, d2pb_pas2) = bent(pb_pa, dpb_pas, d2pb_pas2);
                Some(Signals { pb_pa, dpb_pas, d2pb_pas2, ..*truth })
            }
            _ => None,
        }
    }

    /// Whether it shows in the balance of forces.
    pub(super) fn in_force(self) -> bool {
        // The sensors at fault here are those of pressures, which push.
        self == Self::SquareFriction || self.read(0.0, &PROBE).is_some()
    }
}

/// Side of one pressure's play and its rate, per s, from its `own` reading and that of the `other` chamber: as far as the own one does not
/// show it. A load that changes pushes one pressure up as the other falls.
fn hidden(own: (f64, f64), other: (f64, f64)) -> (f64, f64) {
    let unknown = 1.0 - own.0.abs();
    let unknown_rate = -own.0.signum() * own.1;
    (own.0 - unknown * other.0, own.1 - unknown_rate * other.0 - unknown * other.1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_play_that_its_own_reading_hides_lies_as_the_other_pressure_says() {
        let force = |term: Term, pa_side: f64, pb_side: f64| {
            let at = Signals { pa_side, pb_side, ..PROBE };
            term.unit_term(&at, &Model::paper(), &EffectConstants::default()).force_n
        };
        let listed = Term::Effect(Effect::PressureHysteresisB);
        let hidden = Term::Unlisted(Unlisted::HiddenPlayB);
        for (pb_side, lies_at) in [(0.0, -1.0), (1.0, 1.0), (-1.0, -1.0)] {
            let (own, expected) = (force(hidden, 1.0, pb_side), force(listed, 1.0, lies_at));
            assert!((own - expected).abs() < 1e-6 * expected.abs(), "{own} {expected}");
        }
        assert!(Unlisted::HiddenPlayB.is_sight_of(Effect::PressureHysteresisB));
        assert!(!Unlisted::HiddenPlayB.is_sight_of(Effect::PressureHysteresisA));
    }
}
