//! The force balance, eq. (2): P_A A_A − P_B A_B = F + m ẍ + friction. Where the load force is recorded it tells which pressure
//! is which, also at rest, where the flows do not.
//!
//! Mass, friction and the sensors' zeros are fitted, so neither the rig file's nor anybody's guess enters; the residual is the
//! noise, whatever its size. Where P_A + P_B is steady, exchanged pressures look like a load force of the wrong sign but for
//! the mean: (P_A + P_B)(A_A − A_B), which no sensor's zero is.

use super::block::Block;
use crate::rig::Rig;
use pitchleak_core::Cylinder;
use serde::{Deserialize, Serialize};

/// What the fit is free in (1, ẋ, its sign, ẍ), and then F, P_A, P_B: means over a block, SI.
const TERMS: usize = 7;
const FREE: usize = 4;
/// A free term that the others make up to this share of its square adds nothing.
const DEGENERATE: f64 = 1e-9;
/// Fewer blocks say nothing: ten seconds.
const LEAST_BLOCKS: u32 = 40;
/// A zero of a pressure or force sensor that nobody declared wrong, share of full scale, 1 σ. A guess.
const UNDECLARED_ZERO_SHARE: f64 = 0.01;
/// Blocks that follow each other are worth so much less than independent ones: friction is no noise. Chosen.
const INDEPENDENT: f64 = 0.25;
/// How often a force column is one as declared, of another sign or unit, and none at all. Guesses.
const FORCE_SHARES: [f64; 3] = [0.9, 0.09, 0.01];

/// Sums over blocks, in constant memory.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub(crate) struct ForceSums {
    /// Of the products of any two terms.
    products: [[f64; TERMS]; TERMS],
    blocks: u32,
    last_speed_mps: f64,
}

impl ForceSums {
    /// Takes in the next block; one without a load force says nothing.
    pub fn add(&mut self, block: &Block) {
        let speed_mps = block.speed_mps;
        let last_mps = std::mem::replace(&mut self.last_speed_mps, speed_mps);
        let [_, Some(pa), Some(pb), .., Some(force)] = block.means else { return };
        let acceleration = if block.follows { (speed_mps - last_mps) / block.time_s } else { 0.0 };
        let terms = [1.0, speed_mps, speed_mps.signum(), acceleration, force, pa, pb];
        for (row, term) in self.products.iter_mut().zip(terms) {
            for (sum, other) in row.iter_mut().zip(terms) {
                *sum += term * other;
            }
        }
        self.blocks = self.blocks.saturating_add(1);
    }

    /// Of both stretches.
    pub fn with(&self, other: &Self) -> Self {
        let mut both = *self;
        for (row, other) in both.products.iter_mut().zip(&other.products) {
            row.iter_mut().zip(other).for_each(|(sum, other)| *sum += other);
        }
        both.blocks = both.blocks.saturating_add(other.blocks);
        both
    }

    /// What they say of the pressures; none of too few blocks, or without a load force that changes.
    pub fn balance(&self, rig: &Rig) -> Option<ForceBalance> {
        let left = self.left();
        (self.blocks >= LEAST_BLOCKS && left[0][0] > 0.0).then(|| ForceBalance {
            left,
            means: self.means(),
            zero_std_n: zero_std_n(rig),
            blocks: f64::from(self.blocks),
            area_m2: [rig.cylinder.area_a_m2, rig.cylinder.area_b_m2],
        })
    }

    /// Means of F, P_A and P_B.
    fn means(&self) -> [f64; TERMS - FREE] {
        let [[_, _, _, _, means @ ..], ..] = self.products;
        means.map(|sum| sum / f64::from(self.blocks))
    }

    /// The products of F, P_A and P_B that the free terms leave: Gauss's elimination.
    fn left(&self) -> [[f64; TERMS - FREE]; TERMS - FREE] {
        let mut products = self.products;
        for at in 0..FREE {
            let pivot = products[at];
            if pivot[at] <= DEGENERATE * self.products[at][at] {
                continue;
            }
            for row in products.iter_mut().skip(at + 1) {
                let share = row[at] / pivot[at];
                row.iter_mut().zip(pivot).for_each(|(value, other)| *value -= share * other);
            }
        }
        std::array::from_fn(|i| std::array::from_fn(|j| products[FREE + i][FREE + j]))
    }
}

/// The balance with pressures that are divided by factors.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Scaled {
    left: Left,
    /// By how much the load force would have to be larger.
    slope: f64,
    blocks: f64,
}

/// Gains of pressure and force sensors that are off, and noise of the force, leave the slope within this of 1.
const SLOPE: std::ops::RangeInclusive<f64> = 0.85..=1.18;

impl Scaled {
    /// Whether the load force, as it is read, explains these pressures.
    pub fn balances(&self) -> bool {
        SLOPE.contains(&self.slope)
    }

    /// Less twice the log-likelihood, where the noise is the residual.
    pub fn deviance(&self) -> f64 {
        self.deviance_of(self.left.as_read.max(f64::MIN_POSITIVE)) + self.left.zeros[0].powi(2)
    }

    fn deviance_of(&self, square: f64) -> f64 {
        self.blocks * square.ln()
    }

    /// Root mean square without the force and with it, N.
    pub fn left_n(&self) -> [f64; 2] {
        [self.left.without, self.left.as_read].map(|square| (square / self.blocks).sqrt())
    }
}

/// The residual of one force balance.
#[derive(Clone, Copy, Debug)]
struct Left {
    /// Sum of squares with the load force as it is read, N², …
    as_read: f64,
    /// … that of the force where the pressures' is any times it, …
    with_any_factor: f64,
    /// … that of the pressures, and of the force, alone.
    without: f64,
    force: f64,
    /// How far its zero is off as the load force is read, and times that factor, standard deviations.
    zeros: [f64; 2],
}

impl Left {
    /// With these weights of P_A and P_B, m²; `zero_std` is by how far the sensors' zeros may be off together, N.
    fn of(
        [[ff, fa, fb], [_, aa, ab], [_, _, bb]]: [[f64; TERMS - FREE]; TERMS - FREE],
        [f, pa, pb]: [f64; TERMS - FREE],
        [a, b]: [f64; 2],
        zero_std: f64,
    ) -> Self {
        let (square, product) = (a * a * aa + 2.0 * a * b * ab + b * b * bb, a * fa + b * fb);
        let factor = product / square.max(f64::MIN_POSITIVE);
        Self {
            as_read: (square - 2.0 * product + ff).max(0.0),
            with_any_factor: (ff - product * factor).max(0.0),
            without: square,
            force: ff,
            zeros: [1.0, factor]
                .map(|factor| (factor * (a * pa + b * pb) - f) / (zero_std * 1.0_f64.max(factor.abs()))),
        }
    }

    /// Of a force that is as declared, of another sign or unit, or none; its noise is the residual, and so many blocks
    /// are independent.
    fn ln_likelihood(&self, blocks: f64) -> f64 {
        let squares = [self.as_read, self.with_any_factor, self.force];
        let zeros = [self.zeros[0], self.zeros[1], 0.0];
        let each = [0, 1, 2].map(|at: usize| {
            let square = squares[at].max(LEAST_SHARE * self.force).max(f64::MIN_POSITIVE);
            FORCE_SHARES[at].ln() - 0.5 * (blocks * square.ln() + zeros[at] * zeros[at])
        });
        let most = each.into_iter().fold(f64::MIN, f64::max);
        most + each.into_iter().map(|ln| (ln - most).exp()).sum::<f64>().ln()
    }
}

/// What is left of a force without noise counts as this share of the forces' own square.
const LEAST_SHARE: f64 = 1e-4;

/// By how far the sensors' zeros may be off together, 1 σ, N.
fn zero_std_n(rig: &Rig) -> f64 {
    let Cylinder { area_a_m2, area_b_m2, .. } = rig.cylinder;
    let pressures_n = rig.instruments.pressure.full_scale * area_a_m2.hypot(area_b_m2);
    UNDECLARED_ZERO_SHARE * pressures_n.hypot(rig.instruments.force.full_scale)
}

/// What the load force says of the pressures.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ForceBalance {
    /// Products of F, P_A and P_B that the free terms leave, and their means.
    left: [[f64; TERMS - FREE]; TERMS - FREE],
    means: [f64; TERMS - FREE],
    /// By how far the sensors' zeros may be off together, 1 σ, N.
    zero_std_n: f64,
    blocks: f64,
    area_m2: [f64; 2],
}

impl ForceBalance {
    /// With P_A and P_B divided by these factors.
    pub(crate) fn scaled(&self, [by_a, by_b]: [f64; 2]) -> Scaled {
        let ([a, b], [[load, of_a, of_b], ..]) = (self.area_m2, self.left);
        let weights = [a / by_a, -b / by_b];
        let slope = (weights[0] * of_a + weights[1] * of_b) / load;
        Scaled { left: self.left_by(weights), slope, blocks: self.blocks }
    }

    /// ln of how much likelier the force is where P_A and P_B are `by` times those read, or exchanged, than as they are.
    pub fn ln_ratio(&self, by: [f64; 2], exchanged: bool) -> f64 {
        let [a, b] = self.area_m2;
        let weights = if exchanged { [-b, a] } else { [a * by[0], -b * by[1]] };
        self.ln_likelihood(weights) - self.ln_likelihood([a, -b])
    }

    fn ln_likelihood(&self, weights: [f64; 2]) -> f64 {
        self.left_by(weights).ln_likelihood(INDEPENDENT * self.blocks)
    }

    fn left_by(&self, weights: [f64; 2]) -> Left {
        Left::of(self.left, self.means, weights, self.zero_std_n)
    }
}
