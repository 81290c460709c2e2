//! The likelihood of the leaks over the compressibility: at one it is normal, as the equations are linear in them.
//!
//! Oil that leaks and oil that is compressed are one product: a leak found by falling pressures is known no better than κ. Which leaks there are
//! says in turn how well κ is known. So the likelihood is needed at every κ: it is smooth, and a polynomial through a few
//! Chebyshev points gives it (Berrut and Trefethen 2004, "Barycentric Lagrange interpolation", SIAM Review 46, eq. 5.4).

use super::equations::{Equations, Known, Normal, Unknowns};
use super::fit::{running_means, solve};
use super::recorder::{Held, Reading};
use crate::presence::{LEAK_UNIT_M3SPA, LeakLikelihood};
use crate::rig::Rig;
use nalgebra::{Matrix2, Vector2};
use pitchleak_core::PerLeak;
use std::f64::consts::PI;

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

/// The profile reaches this far to either side of the likeliest κ, in its standard deviations.
const REACH: f64 = 4.0;
const POINTS: usize = 13;

/// Nodes over ln κ, κ in the rig file's.
#[derive(Clone, Debug)]
pub(super) struct Profile {
    middle: f64,
    half_width: f64,
    nodes: Vec<LeakLikelihood>,
}

/// Chebyshev points of the second kind on −1..1.
fn place(index: usize) -> f64 {
    (PI * index as f64 / (POINTS - 1) as f64).cos()
}

impl Profile {
    /// Around the likeliest ln κ and its standard deviation; `node` has the likelihood at a ln κ.
    pub fn new(middle: f64, std: f64, node: impl Fn(f64) -> Option<LeakLikelihood>) -> Option<Self> {
        let half_width = REACH * std;
        let nodes: Option<Vec<_>> =
            (0..POINTS).map(|index| node(middle + half_width * place(index))).collect();
        let nodes = nodes?;
        let is_finite = |node: &LeakLikelihood| {
            node.squares.is_finite()
                && node.information.iter().chain(&node.leaks).all(|number| number.is_finite())
        };
        nodes.iter().all(is_finite).then_some(Self { middle, half_width, nodes })
    }

    /// Least and greatest ln κ.
    pub fn range(&self) -> [f64; 2] {
        [self.middle - self.half_width, self.middle + self.half_width]
    }

    /// The likelihood at a ln κ within the range.
    pub fn at(&self, ln_kappa: f64) -> LeakLikelihood {
        let at = (ln_kappa - self.middle) / self.half_width;
        let (mut sum, mut all) = (LeakLikelihood::default(), 0.0);
        for (index, node) in self.nodes.iter().enumerate() {
            let off = at - place(index);
            if off.abs() < 1e-12 {
                return *node;
            }
            let end = if index == 0 || index + 1 == POINTS { 0.5 } else { 1.0 };
            let sign = if index % 2 == 0 { 1.0 } else { -1.0 };
            let weight = sign * end / off;
            sum = sum.plus(node, weight);
            all += weight;
        }
        LeakLikelihood::default().plus(&sum, 1.0 / all)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn between_its_points_the_profile_is_the_function() {
        let node =
            |x: f64| Some(LeakLikelihood { squares: 3.0 + (2.0 * x).exp(), ..LeakLikelihood::default() });
        let profile = Profile::new(0.1, 0.25, node).expect("finite");
        let [from, to] = profile.range();
        assert!((from + 0.9).abs() < 1e-12 && (to - 1.1).abs() < 1e-12);
        for k in 0..=50 {
            let x = from + (to - from) * f64::from(k) / 50.0;
            let error = profile.at(x).squares - 3.0 - (2.0 * x).exp();
            assert!(error.abs() < 1e-8, "{x} {error}");
        }
    }
}
