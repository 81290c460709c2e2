//! Flows whose size alone was recorded: never negative although the piston moves both ways.

use super::Unsigned;
use super::block::Block;
use crate::rig::{Instrument, Rig};
use pitchleak_core::Cylinder;
use serde::{Deserialize, Serialize};

/// A piston moves where its speed is so many standard deviations of it. Chosen.
const SIGMAS: f64 = 3.0;
/// Blocks of motion each way below which nothing is said. Chosen.
const LEAST_MOVING: u32 = 2;
/// Leaks into or out of a chamber that are tried on either side of none, up to this share of the meter's full scale.
const LEAK_STEPS: usize = 5;
const LEAK_SHARE: f64 = 0.04;
/// Load pressure at which the internal one of them flows, share of the sensors' full scale.
const USUAL_LOAD: f64 = 0.2;
const LEAKS: usize = 2 * LEAK_STEPS + 1;
/// Blocks that follow each other are worth so much less than independent ones. Chosen.
const INDEPENDENT: f64 = 0.25;

/// What both flows leave of the piston's motion, as they are read and as sizes.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub(super) struct SignSums([Side; 2]);

#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
struct Side {
    is_read: bool,
    negative: bool,
    /// Blocks in which the piston moves out and in; the sums below are of these.
    moving: [u32; 2],
    /// Expected square of the noise.
    noise: f64,
    /// Σe and Σe² by leak, past the piston or out of the chamber, of the flow and of its size.
    left: [[[[f64; 2]; LEAKS]; 2]; 2],
}

impl SignSums {
    /// Takes in the next block.
    pub fn add(&mut self, block: &Block, rig: &Rig) {
        let Cylinder { area_a_m2, area_b_m2, .. } = rig.cylinder;
        let sheets = [rig.instruments.flow_a, rig.instruments.flow_b];
        let [_, Some(pa), Some(pb), qa, qb, _] = block.means else { return };
        let load = (pa - pb) / (USUAL_LOAD * rig.instruments.pressure.full_scale);
        let declared = rig.sensors().position.noise_std * block.speed_std_per_m;
        let speed_std = declared.max(block.speed_std_mps);
        for (at, (flow, area)) in [qa, qb].into_iter().zip([area_a_m2, -area_b_m2]).enumerate() {
            let Some(flow) = flow else { continue };
            let own = Own { flow_m3s: area * block.speed_mps, std: area.abs() * speed_std };
            let noise = sheets[at].spread().noise_std.powi(2) / f64::from(block.readings);
            self.0[at].add(flow, block.unsigned[at], own, [1.0, load], noise, &sheets[at]);
        }
    }

    /// Of both stretches.
    pub fn with(&self, other: &Self) -> Self {
        let mut both = *self;
        for (one, other) in both.0.iter_mut().zip(&other.0) {
            one.is_read |= other.is_read;
            one.negative |= other.negative;
            one.noise += other.noise;
            one.moving.iter_mut().zip(other.moving).for_each(|(sum, more)| *sum += more);
            let sums = one.left.as_flattened_mut().as_flattened_mut().as_flattened_mut();
            sums.iter_mut()
                .zip(other.left.as_flattened().as_flattened().as_flattened())
                .for_each(|(sum, more)| *sum += more);
        }
        both
    }

    /// Of each flow.
    pub fn found(&self) -> [Unsigned; 2] {
        self.0
            .each_ref()
            .map(|side| Unsigned { is_unsigned: side.is_read && !side.negative, ln_lost: side.ln_lost() })
    }
}

/// The piston's own flow.
#[derive(Clone, Copy)]
struct Own {
    flow_m3s: f64,
    std: f64,
}

impl Side {
    fn add(&mut self, flow: f64, unsigned: bool, own: Own, shapes: [f64; 2], noise: f64, sheet: &Instrument) {
        self.is_read = true;
        self.negative |= !unsigned;
        // At rest a size is as the flow: what leads to one there is the position's noise, which sizes halve.
        if own.flow_m3s.abs() <= SIGMAS * own.std {
            return;
        }
        self.moving[usize::from(own.flow_m3s < 0.0)] += 1;
        self.noise += noise + own.std * own.std;
        let [of_flow, of_size] = &mut self.left;
        for ((of_flow, of_size), shape) in of_flow.iter_mut().zip(of_size).zip(shapes) {
            each_leak(of_flow, sheet, |leak| flow - (own.flow_m3s + leak * shape));
            each_leak(of_size, sheet, |leak| flow - (own.flow_m3s + leak * shape).abs());
        }
    }

    fn ln_lost(&self) -> Option<f64> {
        if self.negative || self.moving.iter().any(|blocks| *blocks < LEAST_MOVING) {
            return None;
        }
        let blocks = f64::from(self.moving[0] + self.moving[1]);
        let least = |by_shape: &[[[f64; 2]; LEAKS]; 2]| {
            let variance = |[sum, square]: &[f64; 2]| square - sum * sum / blocks;
            by_shape.iter().flatten().map(variance).fold(f64::MAX, f64::min).max(self.noise)
        };
        let [signed, size] = self.left.each_ref().map(least);
        Some(0.5 * INDEPENDENT * blocks * (signed / size).ln())
    }
}

fn each_leak(sums: &mut [[f64; 2]; LEAKS], sheet: &Instrument, left: impl Fn(f64) -> f64) {
    for (step, [sum, square]) in sums.iter_mut().enumerate() {
        let share = step as f64 / LEAK_STEPS as f64 - 1.0;
        let left = left(share * LEAK_SHARE * sheet.full_scale);
        *sum += left;
        *square += left * left;
    }
}
