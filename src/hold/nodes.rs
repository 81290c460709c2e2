//! The likelihood of the leaks where the compressibility is known: normal, as the equations are linear in them.

use super::equations::{Equations, Known, Normal, Unknowns};
use super::fit::{running_means, solve};
use super::recorder::{Held, Reading};
use crate::presence::{LEAK_UNIT_M3SPA, LeakLikelihood};
use crate::rig::Rig;
use nalgebra::{Matrix2, Vector2};
use pitchleak_core::PerLeak;

/// Rounds in which the signals follow a node's κ.
const ROUNDS: usize = 2;

/// Oil that was at work, 20 K above the air, cools by this while it is held, 1 σ, K/s: its time constant is an hour. A guess.
const COOLING_KPS: f64 = 20.0 / 3600.0;
/// Thermal expansion of mineral oil, 1/K: data sheets of hydraulic oils have 6.5 to 7.5e-4.
const EXPANSION_PK: f64 = 7e-4;

/// Signals on their way to the likeliest ones.
#[derive(Clone)]
pub(super) struct Search<'a> {
    known: &'a Known<'a>,
    holds: &'a [&'a Held],
    signals: Vec<Vec<Reading>>,
    equations: Vec<Equations>,
}

impl<'a> Search<'a> {
    pub fn new(known: &'a Known<'a>, holds: &'a [&'a Held]) -> Self {
        let signals = holds.iter().map(|held| running_means(&held.readings)).collect();
        Self { known, holds, signals, equations: Vec::new() }
    }

    /// Makes the equations linear at the signals of the moment and this κ, and gives their normal equations.
    pub fn normal(&mut self, kappa_ppa: f64) -> Normal {
        let each = self.holds.iter().zip(&self.signals);
        self.equations = each
            .map(|(held, signals)| Equations::at(self.known, &held.readings, signals, kappa_ppa))
            .collect();
        let mut sum = Normal::default();
        for normal in self.equations.iter().map(Equations::normal) {
            sum.information += normal.information;
            sum.right += normal.right;
            sum.squares += normal.squares;
        }
        sum
    }

    /// Moves the signals to the likeliest ones for these unknowns.
    pub fn smooth(&mut self, unknowns: &Unknowns) {
        for ((signals, equations), held) in self.signals.iter_mut().zip(&self.equations).zip(self.holds) {
            *signals = equations.smoothed(self.known, &held.readings, unknowns);
        }
    }

    /// What is left of each hold's equations, whitened.
    pub fn innovations(&self, unknowns: &Unknowns) -> Vec<Vec<Vector2<f64>>> {
        self.equations.iter().map(|equations| equations.innovations(unknowns)).collect()
    }

    /// The likelihood of the leaks where κ is this.
    pub fn node(mut self, kappa_ppa: f64) -> Option<LeakLikelihood> {
        let mut normal = self.normal(kappa_ppa);
        for _ in 0..ROUNDS {
            let unknowns = solve(&normal, true)?;
            self.smooth(&unknowns);
            normal = self.normal(kappa_ppa);
        }
        let information = normal.information.fixed_view::<3, 3>(1, 1).into_owned();
        LeakLikelihood::new(information, &normal.right.fixed_rows::<3>(1).into_owned(), normal.squares)
    }
}

/// Oil that cools shrinks as if it leaked to the outside: as so much, 1 σ.
pub(super) struct Cooling {
    /// Inverse squares of the apparent leaks out of A and B, in [`LEAK_UNIT_M3SPA`].
    precision: Matrix2<f64>,
}

impl Cooling {
    /// What is left of a likelihood where the oil of each chamber may cool.
    pub fn explained(&self, likelihood: LeakLikelihood) -> Option<LeakLikelihood> {
        let all = likelihood.information;
        let columns = all.fixed_columns::<2>(1).into_owned();
        let inner = all.fixed_view::<2, 2>(1, 1) + self.precision;
        let information = all - columns * inner.try_inverse()? * columns.transpose();
        Some(LeakLikelihood { information, ..likelihood })
    }

    pub fn of(rig: &Rig, holds: &[&Held], pressures_pa: &PerLeak<f64>) -> Option<Self> {
        let x_m = holds.first()?.readings.first()?.x_m;
        let as_leak = |volume_m3: f64, pressure_pa: f64| {
            volume_m3 * EXPANSION_PK * COOLING_KPS / pressure_pa / LEAK_UNIT_M3SPA
        };
        let a = as_leak(rig.cylinder.volume_a_m3(x_m), pressures_pa.external_a);
        let b = as_leak(rig.cylinder.volume_b_m3(x_m), pressures_pa.external_b);
        Some(Self { precision: Matrix2::new(a.powi(-2), 0.0, 0.0, b.powi(-2)) })
    }
}
