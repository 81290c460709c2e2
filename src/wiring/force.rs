//! The force balance, eq. (2): P_A A_A − P_B A_B = F + m ẍ + friction. Where the load force is recorded it tells which pressure
//! is which, also at rest, where the flows do not.
//!
//! Mass, friction and the sensors' zeros are fitted, so neither the rig file's nor anybody's guess enters; the residual is the
//! noise, whatever its size. Where P_A + P_B is steady, exchanged pressures look like a load force of the wrong sign but for
//! the mean: (P_A + P_B)(A_A − A_B), which no sensor's zero is.

use super::blocks::Block;
use super::priors::UNDECLARED_ZERO_SHARE;
use super::{CONTRAST, LEAST_DROP};
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

/// Sums over blocks, in constant memory.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub(super) struct ForceSums {
    /// Of the products of any two terms.
    products: [[f64; TERMS]; TERMS],
    blocks: u32,
    last_speed_mps: f64,
}

impl ForceSums {
    /// Takes in the next block; one without a load force says nothing.
    pub fn add(&mut self, block: &Block) {
        let mean = |integral: f64| integral / block.time_s;
        let speed_mps = mean(block.travel_m);
        let last_mps = std::mem::replace(&mut self.last_speed_mps, speed_mps);
        let Some(force) = block.force else { return };
        let acceleration = if block.follows { mean(speed_mps - last_mps) } else { 0.0 };
        let [pa, pb] = [&block.a, &block.b].map(|chamber| mean(chamber.pressure));
        let terms = [1.0, speed_mps, speed_mps.signum(), acceleration, mean(force), pa, pb];
        for (row, term) in self.products.iter_mut().zip(terms) {
            for (sum, other) in row.iter_mut().zip(terms) {
                *sum += term * other;
            }
        }
        self.blocks = self.blocks.saturating_add(1);
    }

    /// Of all these stretches.
    pub fn of<'a>(parts: impl Iterator<Item = &'a Self>) -> Self {
        parts.fold(Self::default(), |mut all, part| {
            for (row, other) in all.products.iter_mut().zip(&part.products) {
                row.iter_mut().zip(other).for_each(|(sum, other)| *sum += other);
            }
            all.blocks = all.blocks.saturating_add(part.blocks);
            all
        })
    }

    /// The balance with P_A and P_B divided by `factors`; `None` of too few blocks, or without a load force that changes.
    pub fn scaled(&self, rig: &Rig, [by_a, by_b]: [f64; 2]) -> Option<Scaled> {
        let Cylinder { area_a_m2, area_b_m2, .. } = rig.cylinder;
        let ([[load, of_a, of_b], ..], weights) = (self.left(), [area_a_m2 / by_a, -area_b_m2 / by_b]);
        let Left { as_read, without, zeros: [zero, _], .. } = Left::of(self, weights, zero_std_n(rig));
        let slope = (weights[0] * of_a + weights[1] * of_b) / load;
        (self.blocks >= LEAST_BLOCKS && load > 0.0).then(|| Scaled {
            as_read,
            without,
            slope,
            zero,
            blocks: f64::from(self.blocks),
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
pub(super) struct Scaled {
    as_read: f64,
    without: f64,
    /// By how much the load force would have to be larger.
    slope: f64,
    /// How far the sensors' zeros are off, standard deviations.
    zero: f64,
    blocks: f64,
}

/// Gains of pressure and force sensors that are off, and noise of the force, leave the slope within this of 1.
const SLOPE: std::ops::RangeInclusive<f64> = 0.85..=1.18;

impl Scaled {
    /// Whether the load force, as it is read, explains these pressures.
    pub fn balances(&self) -> bool {
        let ratio = self.without / self.as_read.max(f64::MIN_POSITIVE);
        ratio >= CONTRAST && self.deviance_of(ratio) >= LEAST_DROP && SLOPE.contains(&self.slope)
    }

    /// Less twice the log-likelihood, where the noise is the residual.
    pub fn deviance(&self) -> f64 {
        self.deviance_of(self.as_read.max(f64::MIN_POSITIVE)) + self.zero * self.zero
    }

    fn deviance_of(&self, square: f64) -> f64 {
        self.blocks * square.ln()
    }

    /// Root mean square without the force and with it, N.
    pub fn left_n(&self) -> [f64; 2] {
        [self.without, self.as_read].map(|square| (square / self.blocks).sqrt())
    }
}

/// The residual of one force balance.
struct Left {
    /// Sum of squares with the load force as it is read, N², …
    as_read: f64,
    /// … times any factor, …
    with_any_factor: f64,
    /// … and without it.
    without: f64,
    /// How far its zero is off as the load force is read, and times that factor, standard deviations.
    zeros: [f64; 2],
}

impl Left {
    /// With these weights of P_A and P_B, m²; `zero_std` is by how far the sensors' zeros may be off together, N.
    fn of(sums: &ForceSums, [a, b]: [f64; 2], zero_std: f64) -> Self {
        let ([[ff, fa, fb], [_, aa, ab], [_, _, bb]], [f, pa, pb]) = (sums.left(), sums.means());
        let (square, product) = (a * a * aa + 2.0 * a * b * ab + b * b * bb, a * fa + b * fb);
        Self {
            as_read: (square - 2.0 * product + ff).max(0.0),
            with_any_factor: (square - product * product / ff).max(0.0),
            without: square,
            zeros: [1.0, product / ff].map(|factor| (a * pa + b * pb - factor * f) / zero_std),
        }
    }

    /// Whether the load force, as it is read, explains these pressures, and the `other` ones not by any factor, as its sign or
    /// unit may be wrong, too, unless with a zero that no sensor has. The noise is the residual: twice the
    /// log-likelihood ratio is n ln of the sums' ratio.
    fn explains_better_than(&self, other: &Self, blocks: u32) -> bool {
        let exceeds = |square: f64| {
            let ratio = square / self.as_read.max(f64::MIN_POSITIVE);
            ratio >= CONTRAST && f64::from(blocks) * ratio.ln() >= LEAST_DROP
        };
        let ([own, _], [_, others]) = (self.zeros, other.zeros);
        exceeds(self.without)
            && exceeds(other.as_read)
            && (exceeds(other.with_any_factor) || others * others - own * own >= LEAST_DROP)
    }
}

/// By how far the sensors' zeros may be off together, 1 σ, N.
fn zero_std_n(rig: &Rig) -> f64 {
    let Cylinder { area_a_m2, area_b_m2, .. } = rig.cylinder;
    let pressures_n = rig.instruments.pressure.full_scale * area_a_m2.hypot(area_b_m2);
    UNDECLARED_ZERO_SHARE * pressures_n.hypot(rig.instruments.force.full_scale)
}

/// What the force balance says of the pressures.
pub(crate) struct ForceBalance {
    declared: Left,
    exchanged: Left,
    blocks: u32,
}

impl ForceBalance {
    /// By these sums; `None` of too few, or without a load force that changes.
    pub(super) fn of(sums: &ForceSums, rig: &Rig) -> Option<Self> {
        let ([[load, ..], ..], blocks) = (sums.left(), sums.blocks);
        let Cylinder { area_a_m2, area_b_m2, .. } = rig.cylinder;
        let of = |weights| Left::of(sums, weights, zero_std_n(rig));
        (blocks >= LEAST_BLOCKS && load > 0.0).then(|| Self {
            declared: of([area_a_m2, -area_b_m2]),
            exchanged: of([-area_b_m2, area_a_m2]),
            blocks,
        })
    }

    /// Whether it holds with the pressures as they are read alone.
    pub fn holds(&self) -> bool {
        self.declared.explains_better_than(&self.exchanged, self.blocks)
    }

    /// Whether it holds with the pressures exchanged alone: the root mean square of the residual as they are read and
    /// exchanged, N.
    pub fn holds_exchanged(&self) -> Option<[f64; 2]> {
        let rms = |square: f64| (square / f64::from(self.blocks)).sqrt();
        self.exchanged
            .explains_better_than(&self.declared, self.blocks)
            .then(|| [rms(self.declared.as_read), rms(self.exchanged.as_read)])
    }
}
