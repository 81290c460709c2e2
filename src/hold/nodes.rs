//! The likelihood of the leaks where the compressibility is known: normal, as the equations are linear in them.

use super::equations::{Equations, Known, Normal, Unknowns};
use super::fit::{LEAK_UNIT_M3SPA, running_means, solve};
use super::recorder::{Held, Reading};
use crate::rig::Rig;
use nalgebra::{Matrix2, Matrix3, Vector2, Vector3};
use pitchleak_core::PerLeak;

/// Rounds in which the signals follow a node's κ.
const ROUNDS: usize = 2;
/// Of a coefficient of 1 L/min at 50 bar: a thousand of them, 1 σ.
pub(super) const LEAST_INFORMATION: f64 = 1e-6;
/// … and a share of the best known, below which differences are rounding: constant pressures give two rates for three leaks.
pub(super) const RESOLUTION: f64 = 1e-13;

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
    pub fn node(mut self, kappa_ppa: f64) -> Option<Node> {
        let mut normal = self.normal(kappa_ppa);
        for _ in 0..ROUNDS {
            let unknowns = solve(&normal, true)?;
            self.smooth(&unknowns);
            normal = self.normal(kappa_ppa);
        }
        let information = normal.information.fixed_view::<3, 3>(1, 1).into_owned();
        Node::new(information, &normal.right.fixed_rows::<3>(1).into_owned(), normal.squares)
    }
}

/// At one κ: squares of the residuals are `squares` + (C − `leaks`)ᵀ `information` (C − `leaks`), with the coefficients C in
/// [`LEAK_UNIT_M3SPA`].
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Node {
    pub information: Matrix3<f64>,
    /// Likeliest coefficients, whatever their sign.
    pub leaks: Vector3<f64>,
    pub squares: f64,
}

impl Node {
    /// From `squares` − 2 `right`ᵀ C + Cᵀ `information` C. A leak that nothing tells of, as the internal one at equal pressures, gets
    /// next to no information.
    fn new(information: Matrix3<f64>, right: &Vector3<f64>, squares: f64) -> Option<Self> {
        let least = LEAST_INFORMATION + RESOLUTION * information.trace();
        let information = information + Matrix3::identity() * least;
        let leaks = information.cholesky()?.solve(right);
        Some(Self { information, leaks, squares: squares - right.dot(&leaks) })
    }

    /// Where the oil of each chamber may cool.
    pub fn explained(self, cooling: &Cooling) -> Option<Self> {
        let columns = self.information.fixed_columns::<2>(1).into_owned();
        let inner = self.information.fixed_view::<2, 2>(1, 1) + cooling.precision;
        let information = self.information - columns * inner.try_inverse()? * columns.transpose();
        Some(Self { information, ..self })
    }

    /// Where residuals are so many times as large as noise: what isn't explained makes everything less sure.
    pub fn widened(self, worse: f64) -> Self {
        Self { information: self.information / worse, squares: self.squares / worse, ..self }
    }

    /// A sum of nodes, each by its weight.
    pub fn plus(self, other: &Self, weight: f64) -> Self {
        Self {
            information: self.information + other.information * weight,
            leaks: self.leaks + other.leaks * weight,
            squares: self.squares + other.squares * weight,
        }
    }
}

/// Oil that cools shrinks as if it leaked to the outside: as so much, 1 σ.
pub(super) struct Cooling {
    /// Inverse squares of the apparent leaks out of A and B, in [`LEAK_UNIT_M3SPA`].
    precision: Matrix2<f64>,
}

impl Cooling {
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
