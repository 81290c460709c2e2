//! What is not known of a cylinder and its valve, and what the rig file says of it.

use crate::presence::size;
use crate::rig::{Rig, ValveSheet};
use nalgebra::{Matrix3, SMatrix, SVector, Vector3};
use pitchleak_core::Leak;
pub(super) use pitchleak_core::VALVE_UNKNOWNS as UNKNOWNS;
pub(super) use pitchleak_core::valve_unknowns::{
    CLEARANCES, DROOP, GAINS, HYSTERESIS, KAPPA, LAG, LAMINAR_PA, LAPS, LEAK_UNIT_M3SPA, LEAKS, PA_PER_BAR,
    ROUNDING, S_PER_MS, SATURATION, SUPPLY, TANK,
};
use pitchleak_core::valve_unknowns::{DRIFT_S, NULL_DRIFT_S, TANK_STD_BAR};

pub(super) type Unknowns = SVector<f64, UNKNOWNS>;
pub(super) type Information = SMatrix<f64, UNKNOWNS, UNKNOWNS>;

/// A leak's size before any reading, 1 σ: any that a cylinder may have.
pub(super) const LEAK_STD: f64 = 100.0;
/// Edges are rounded off by some hundredths of the stroke, and full openings lack some: guesses.
const ROUNDING_USUAL: [f64; 2] = [0.02, 0.01];
const SATURATION_STD: f64 = 0.05;
const LAG_STD_MS: f64 = 2.0;
const DROOP_STD_BAR: f64 = 2.0;
/// Zeros of a pressure sensor that nobody declared, a share of its accuracy: 1 σ.
const ZERO_SHARE: f64 = 1.0 / 3.0;
/// Pressure of a chamber in which it is not measured, Pa: a guess.
const UNREAD_PA: f64 = 50e5;
/// By so much valves that have worn leak more at their middle than their data sheet says: 7 % of the rated flow were measured on a
/// servovalve (docs/valve.md).
const WORN: f64 = 3.6;
/// Of what is known for certain: rounding.
pub(super) const CERTAIN: f64 = 1e-6;

/// What is believed of the unknowns: normal, with this mean and inverse covariance.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub(super) struct Belief {
    pub mean: Unknowns,
    pub information: Information,
    /// Each leak's size before any reading, 1 σ.
    pub leak_std: [f64; 3],
}

impl Belief {
    /// By the data sheet alone.
    pub fn of_sheet(rig: &Rig, sheet: &ValveSheet) -> Self {
        let (mut mean, mut std) = (Unknowns::zeros(), Unknowns::zeros());
        let mut set = |place: usize, count: usize, is: f64, spread: f64| {
            for at in place..place + count {
                (mean[at], std[at]) = (is, spread.max(CERTAIN));
            }
        };
        set(LEAKS, 3, 0.0, LEAK_STD);
        set(KAPPA, 1, 1.0, rig.fluid.bulk_modulus_std_pa / rig.fluid.bulk_modulus_pa);
        set(GAINS, 4, 1.0, sheet.gain_std);
        set(LAPS, 4, sheet.lap, sheet.lap_std);
        set(ROUNDING, 1, ROUNDING_USUAL[0], ROUNDING_USUAL[1]);
        set(SATURATION, 1, 0.0, SATURATION_STD);
        set(TANK, 1, 0.0, TANK_STD_BAR);
        set(LAG, 1, sheet.spool_lag_s / S_PER_MS, LAG_STD_MS);
        set(CLEARANCES, 4, 0.0, clearance_std(sheet));
        set(HYSTERESIS, 1, 0.0, sheet.hysteresis);
        set(DROOP, 1, 0.0, DROOP_STD_BAR);
        set(SUPPLY, 1, 0.0, supply_std_pa(rig, sheet) / PA_PER_BAR);
        let information = Information::from_diagonal(&std.map(|std| std.powi(-2)));
        Self { mean, information, leak_std: [LEAK_STD; 3] }
    }

    /// Where the pressure at a leak is not measured: the two are told as their product, and a leak is no larger than leaks are.
    pub fn without_pressure_at(mut self, leak: Leak, rig: &Rig) -> Option<Self> {
        self.leak_std[leak as usize] = size(rig, leak, UNREAD_PA);
        self.with_new_leaks()
    }

    /// The same, of a fit that knew the clearances by the data sheet alone, where each may be [`WORN`] times as large: with η = Λ μ and
    /// what their precision loses taken off Λ, Λ' μ' = η, as they are expected to be none.
    pub fn with_worn_clearances(&self, sheet: &ValveSheet) -> Option<Self> {
        let lost = (1.0 - WORN.powi(-2)) * clearance_std(sheet).max(CERTAIN).powi(-2);
        let mut information = self.information;
        for edge in CLEARANCES..CLEARANCES + 4 {
            information[(edge, edge)] -= lost;
        }
        let mean = information.cholesky()?.solve(&(self.information * self.mean));
        Some(Self { mean, information, ..self.clone() })
    }

    /// Where nothing is known of the leaks; what is known of all else stays.
    pub fn with_new_leaks(&self) -> Option<Self> {
        Self::of(self.mean, self.covariance()?, self.leak_std)
    }

    /// So many seconds later: the valve may have changed as `drift` declares, 1 σ, and the oil by what the rig file leaves open.
    pub fn later(&self, rig: &Rig, sheet: &ValveSheet, seconds: f64) -> Option<Self> {
        let [share, of_null] = [DRIFT_S, NULL_DRIFT_S].map(|whole_s| (seconds / whole_s).min(1.0).sqrt());
        let mut change = Unknowns::zeros();
        for edge in 0..4 {
            change[GAINS + edge] = share * sheet.drift.gain * self.mean[GAINS + edge];
            change[LAPS + edge] = of_null * sheet.drift.lap;
            change[CLEARANCES + edge] = share * sheet.drift.null_leak * clearance_std(sheet);
        }
        change[HYSTERESIS] = share * sheet.hysteresis;
        change[TANK] = share * TANK_STD_BAR;
        change[KAPPA] = share * rig.fluid.bulk_modulus_std_pa / rig.fluid.bulk_modulus_pa;
        let spread = self.covariance()? + Information::from_diagonal(&change.map(|std| std * std));
        Some(Self { information: spread.cholesky()?.inverse(), ..self.clone() })
    }

    /// Of a mean and covariances, those of the leaks aside, of which only their sizes are known.
    pub fn of(mut mean: Unknowns, mut covariance: Information, leak_std: [f64; 3]) -> Option<Self> {
        for (leak, std) in (LEAKS..).zip(leak_std) {
            mean[leak] = 0.0;
            covariance.row_mut(leak).fill(0.0);
            covariance.column_mut(leak).fill(0.0);
            covariance[(leak, leak)] = std * std;
        }
        Some(Self { mean, information: covariance.cholesky()?.inverse(), leak_std })
    }

    /// Means and covariances of the leaks.
    pub fn leaks(&self) -> Option<(Vector3<f64>, Matrix3<f64>)> {
        let covariance = self.covariance()?.fixed_view::<3, 3>(LEAKS, LEAKS).into_owned();
        Some((self.mean.fixed_rows::<3>(LEAKS).into_owned(), covariance))
    }

    /// How far unknowns are from what is believed: squares in those of its spread.
    pub fn square(&self, unknowns: &Unknowns) -> f64 {
        let off = unknowns - self.mean;
        off.dot(&(self.information * off))
    }

    pub fn covariance(&self) -> Option<Information> {
        Some(self.information.cholesky()?.inverse())
    }
}

/// Half of what the valve leaks at its middle passes each edge, 1 σ, in [`LEAK_UNIT_M3SPA`].
pub(super) fn clearance_std(sheet: &ValveSheet) -> f64 {
    0.5 * sheet.null_leak * sheet.rated_flow_m3s / sheet.rated_drop_pa / LEAK_UNIT_M3SPA
}

/// A supply that is read is off by its sensor's zero.
fn supply_std_pa(rig: &Rig, sheet: &ValveSheet) -> f64 {
    if sheet.supply_pa.is_some() {
        return sheet.supply_std_pa;
    }
    let spread = rig.instruments.supply.spread();
    spread.bias_std.max(ZERO_SHARE * spread.noise_std)
}
