//! Products of signals without a name, which only serve to say "something else is there", or "that would do as well".

use pitchleak_core::{Model, Signals, Terms};

/// Products of signals: stand-ins for effects that the table lacks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum SignalProduct {
    /// Leak past the piston in proportion to |ẋ| P_L.
    SpeedLeak,
    /// Leak past the piston in proportion to ẋ P_L.
    DirectionLeak,
    /// Leak past the piston in proportion to P_L √|P_L|.
    SteepLeak,
    /// Leak past the piston in proportion to P_L |P_L|.
    SquareLeak,
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
    /// Force in proportion to ẋ |ẋ|.
    SquareFriction,
    /// Storage in proportion to the pressure: V P Ṗ.
    StiffeningOil,
}

impl SignalProduct {
    pub(crate) const ALL: [Self; 11] = [
        Self::SpeedLeak,
        Self::DirectionLeak,
        Self::SteepLeak,
        Self::SquareLeak,
        Self::SpoolLeak,
        Self::BentMeterA,
        Self::BentMeterB,
        Self::BentPressureA,
        Self::BentPressureB,
        Self::SquareFriction,
        Self::StiffeningOil,
    ];

    /// A bend of a pressure's scale that shows clearly, per Pa: 1 % at 10 bar.
    pub(super) const USUAL_BEND: f64 = 1e-8;

    /// For people.
    pub(crate) fn words(self) -> &'static str {
        match self {
            Self::SpeedLeak => "a leak past the piston that grows with speed times load pressure",
            Self::DirectionLeak => "a leak past the piston that turns with speed times load pressure",
            Self::SteepLeak => "a leak past the piston that grows with the power 1.5 of the load pressure",
            Self::SquareLeak => "a leak past the piston that grows with the square of the load pressure",
            Self::SpoolLeak => "a leak past the piston that follows the valve's opening",
            Self::BentMeterA => "a meter A whose scale differs between both ways",
            Self::BentMeterB => "a meter B whose scale differs between both ways",
            Self::BentPressureA => "a pressure sensor A whose scale bends",
            Self::BentPressureB => "a pressure sensor B whose scale bends",
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
            Self::SpoolLeak => past(at.v_mps.abs() * load / (at.pa_pa.abs() + at.pb_pa.abs() + 1e5).sqrt()),
            Self::BentMeterA => Terms { chamber_a_m3s: at.qa_m3s.abs(), ..Terms::default() },
            Self::BentMeterB => Terms { chamber_b_m3s: at.qb_m3s.abs(), ..Terms::default() },
            Self::BentPressureA | Self::BentPressureB => {
                model.misread(Self::USUAL_BEND, |value| self.read(value, at).unwrap_or(*at))
            }
            Self::SquareFriction => Terms { force_n: at.v_mps * at.v_mps.abs(), ..Terms::default() },
            Self::StiffeningOil => Terms {
                chamber_a_m3s: model.cylinder.volume_a_m3(at.x_m) * at.pa_pa * at.dpa_pas,
                chamber_b_m3s: model.cylinder.volume_b_m3(at.x_m) * at.pb_pa * at.dpb_pas,
                force_n: 0.0,
            },
        }
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
        match self {
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
        matches!(self, Self::SquareFriction | Self::BentPressureA | Self::BentPressureB)
    }
}
