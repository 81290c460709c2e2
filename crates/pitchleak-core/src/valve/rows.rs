//! Both continuity equations over a hat, and the noise of that.
//!
//! In the rated flow, with κ the compressibility, c a leak's unit, Δ the rise of the means and ∫ the integral against the hat:
//!
//! ```text
//! g_A =  A_A Δx + κ V_A ΔP_A + c ∫ [C_ip (P_A − P_B) + C_epA P_A] − ∫ Q_A = 0
//! g_B = −A_B Δx + κ V_B ΔP_B + c ∫ [C_ip (P_B − P_A) + C_epB P_B] − ∫ Q_B = 0
//! ```
//!
//! (Wu et al. 2011, eq. 1.) They are combined to the balance (A_B g_A + A_A g_B)/(A_A + A_B), in which the piston's speed cancels, and
//! g_A. What moves little beside the valve's opening, lag, hysteresis and droop, acts by its own mean over the hat.
//!
//! **Noise.** A reading of variance σ² stands in a block's mean, in its rising and in its falling integral. Of N readings over T:
//!
//! ```text
//! variance of a mean σ²/N      with an integral σ²/N T/2      of an integral σ²/N T²/3      of rising and falling σ²/N T²/6
//! ```
//!
//! κ's column is noisy, as is the left side: by these errors in variables κ would come out too small. So the left side has its pressures
//! from every second reading, and the column from those between, whose noise is another. With G = ∂g/∂mean and D = ∂ḡ/∂reading, block k stands in hat k as −G_k m + D r and in hat k−1 as G_k−1 m + D f.
//!
//! Rows of hats whose noise stands in their neighbours, too, made white one after the other: S = L Lᵀ with L of two block diagonals.

use super::calibration::{ValveCalibration, ValveNoise};
use super::edges::{BY_ROUNDING, BY_SATURATION, BY_SUPPLY, BY_TANK, DRAWN, FLOWS, PRESSURES, SLOPES};
use super::filter::Row;
use super::hats::{Block, Hat};
use super::unknowns::{
    CLEARANCES, DROOP, GAINS, HYSTERESIS, KAPPA, LAG, LAPS, LEAK_UNIT_M3SPA, PA_PER_BAR, ROUNDING, S_PER_MS,
    SATURATION, SUPPLY, TANK, VALVE_UNKNOWNS as N,
};
use crate::{Cylinder, Fluid, Real};

/// x, P_A, P_B, spool, P_S.
const SIGNALS: usize = 5;
/// Of the balance and of g_A.
type Pair<T> = [T; 2];

/// A cylinder in the units of its valve.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Equations<T> {
    cylinder: Cylinder<T>,
    rated_flow_m3s: T,
    pub rated_drop_pa: T,
    /// κ of the rig, in the rated drop, over the rated flow.
    kappa: T,
    kappa_mean: T,
    /// c.
    pub leak: T,
    /// 1 bar in the rated drop.
    bar: T,
    /// g_A's and g_B's share of the balance.
    balance: Pair<T>,
    variances: [T; SIGNALS],
    /// What the calibration has of lag, hysteresis and droop.
    late: [T; 3],
    gains: [T; 4],
    clearances: [T; 4],
}

/// G of a hat.
type ByMeans<T> = [Pair<T>; SIGNALS];

/// How the noise of a block's readings stands in the equations.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct BlockNoise<T> {
    /// D.
    by_reading: [Pair<T>; SIGNALS],
    /// σ²/N, that of the means, and T.
    variances: [T; SIGNALS],
    of_means: [T; SIGNALS],
    time_s: T,
}

impl<T: Real> Equations<T> {
    pub fn of(
        cylinder: &Cylinder<T>,
        fluid: &Fluid<T>,
        calibration: &ValveCalibration<T>,
        noise: &ValveNoise<T>,
    ) -> Self {
        let (flow, drop) = (calibration.rated_flow_m3s, calibration.rated_drop_pa);
        let mean = &calibration.mean;
        let four = |from: usize| [mean[from], mean[from + 1], mean[from + 2], mean[from + 3]];
        let square = |std: T| std * std;
        let pressure = square(noise.pressure_pa / drop);
        let areas = cylinder.area_a_m2 + cylinder.area_b_m2;
        Self {
            cylinder: *cylinder,
            rated_flow_m3s: flow,
            rated_drop_pa: drop,
            kappa: drop / (fluid.bulk_modulus_pa * flow),
            kappa_mean: mean[KAPPA],
            leak: T::lit(LEAK_UNIT_M3SPA) * drop / flow,
            bar: T::lit(PA_PER_BAR) / drop,
            balance: [cylinder.area_b_m2 / areas, cylinder.area_a_m2 / areas],
            variances: [
                square(noise.position_m),
                pressure,
                pressure,
                square(noise.spool),
                square(noise.supply_pa / drop),
            ],
            late: [mean[LAG], mean[HYSTERESIS], mean[DROOP]],
            gains: four(GAINS),
            clearances: four(CLEARANCES),
        }
    }

    /// The two rows of a hat, before they are white; `play` is where the spool stands within its hysteresis.
    pub fn rows(&self, hat: &Hat<T>, play: T) -> [Row<T>; 2] {
        let [mut a, b] = self.chambers(hat, play);
        let [share_a, share_b] = self.balance;
        let mut balance = a;
        balance.iter_mut().zip(&b).for_each(|(a, b)| *a = *a * share_a + *b * share_b);
        let travel = self.cylinder.area_a_m2 / self.rated_flow_m3s * hat.rise[0];
        a[N] -= travel;
        [balance, a]
    }

    /// −∂g/∂unknown and g less what the piston sweeps, of each chamber; g stands last, its sign turned.
    fn chambers(&self, hat: &Hat<T>, play: T) -> [Row<T>; 2] {
        let sums = &hat.sums;
        let (mut a, mut b) = ([T::zero(); N + 1], [T::zero(); N + 1]);
        let [_, rise_a, rise_b, rise_u, between_a, between_b] = hat.rise;
        let [pa, pb, ps] = [PRESSURES, PRESSURES + 1, PRESSURES + 2].map(|at| self.leak * sums[at]);
        let kappa_a = self.kappa * self.cylinder.volume_a_m3(hat.x_m);
        let kappa_b = self.kappa * self.cylinder.volume_b_m3(hat.x_m);
        (a[0], b[0]) = (pa - pb, pb - pa);
        (a[1], b[2]) = (pa, pb);
        (a[KAPPA], b[KAPPA]) = (kappa_a * between_a, kappa_b * between_b);
        let [e1, e2, e3, e4] = [0, 1, 2, 3].map(|edge| sums[FLOWS + edge]);
        (a[GAINS], a[GAINS + 1], b[GAINS + 2], b[GAINS + 3]) = (-e1, e2, -e3, e4);
        let [o1, o2, o3, o4] = [0, 1, 2, 3].map(|edge| sums[SLOPES + edge]);
        (a[LAPS], a[LAPS + 1], b[LAPS + 2], b[LAPS + 3]) = (o1, -o2, o3, -o4);
        (a[ROUNDING], b[ROUNDING]) = (-sums[BY_ROUNDING], -sums[BY_ROUNDING + 1]);
        (a[SATURATION], b[SATURATION]) = (-sums[BY_SATURATION], -sums[BY_SATURATION + 1]);
        (a[TANK], b[TANK]) = (-self.bar * sums[BY_TANK], -self.bar * sums[BY_TANK + 1]);
        (a[CLEARANCES], a[CLEARANCES + 1]) = (pa - ps, pa);
        (b[CLEARANCES + 2], b[CLEARANCES + 3]) = (pb - ps, pb);
        let by_supply = |sum: T, clearance: T| self.bar * (sum + self.leak * clearance * hat.time_s);
        let supply_a = by_supply(sums[BY_SUPPLY], self.clearances[0]);
        let supply_b = by_supply(sums[BY_SUPPLY + 1], self.clearances[2]);
        (a[SUPPLY], b[SUPPLY]) = (-supply_a, -supply_b);
        let per_time = hat.time_s.recip();
        let drawn = sums[DRAWN] * per_time;
        (a[DROOP], b[DROOP]) = (supply_a * drawn, supply_b * drawn);
        let (by_u_a, by_u_b) = (o1 + o2, -(o3 + o4));
        let late = T::lit(S_PER_MS) * rise_u * per_time;
        (a[LAG], b[LAG]) = (-by_u_a * late, -by_u_b * late);
        (a[HYSTERESIS], b[HYSTERESIS]) = (by_u_a * play, by_u_b * play);
        a[N] = -self.at_calibration(&a) - self.kappa_mean * kappa_a * rise_a;
        b[N] = -self.at_calibration(&b) - self.kappa_mean * kappa_b * rise_b;
        [a, b]
    }

    /// g of the calibrated valve, without leaks, less what the piston sweeps and what the oil takes.
    fn at_calibration(&self, row: &Row<T>) -> T {
        let [lag, hysteresis, droop] = self.late;
        let mut sum = lag * row[LAG] + hysteresis * row[HYSTERESIS] + droop * row[DROOP];
        for edge in 0..4 {
            sum += self.gains[edge] * row[GAINS + edge] + self.clearances[edge] * row[CLEARANCES + edge];
        }
        sum
    }

    /// G of a hat.
    pub fn by_means(&self, hat: &Hat<T>) -> ByMeans<T> {
        let zero = T::zero();
        let kappa = self.kappa * self.kappa_mean;
        [
            [zero, self.cylinder.area_a_m2 / self.rated_flow_m3s],
            self.pair(kappa * self.cylinder.volume_a_m3(hat.x_m), zero),
            self.pair(zero, kappa * self.cylinder.volume_b_m3(hat.x_m)),
            [zero; 2],
            [zero; 2],
        ]
    }

    fn pair(&self, a: T, b: T) -> Pair<T> {
        let [share_a, share_b] = self.balance;
        [share_a * a + share_b * b, a]
    }

    /// The noise of a block, with the leaks as they are found.
    pub fn noise(&self, block: &Block<T>, leaks: [T; 3]) -> BlockNoise<T> {
        let sums = &block.sums;
        let per_time = block.time_s.recip();
        let slope = |at: usize| sums[at] * per_time;
        let [internal, a, b] = leaks.map(|leak| leak * self.leak);
        let own = |chamber: usize, leak: T| {
            let clearance = self.leak * (self.clearances[2 * chamber] + self.clearances[2 * chamber + 1]);
            slope(BY_SUPPLY + chamber) + slope(BY_TANK + chamber) + clearance + leak + internal
        };
        let supply =
            |chamber: usize| -(slope(BY_SUPPLY + chamber) + self.leak * self.clearances[2 * chamber]);
        let by_reading = [
            [T::zero(); 2],
            self.pair(own(0, a), -internal),
            self.pair(-internal, own(1, b)),
            self.pair(-slope(SLOPES) - slope(SLOPES + 1), slope(SLOPES + 2) + slope(SLOPES + 3)),
            self.pair(supply(0), supply(1)),
        ];
        let per_count = block.count.recip();
        let variances = self.variances.map(|own| own * per_count);
        let [x, pa, pb, spool, ps] = variances;
        let wider = block.count * block.seconds().square;
        let of_means = [x, pa * wider, pb * wider, spool, ps];
        BlockNoise { by_reading, variances, of_means, time_s: block.time_s }
    }
}

impl<T: Real> BlockNoise<T> {
    /// Adds to a hat's covariance [balance, both, A] what the block puts in: `sign` is −1 where the hat rises over it, 1 where it falls.
    pub fn add_own(&self, sign: T, by_means: &ByMeans<T>, covariance: &mut [T; 3]) {
        let (half, third) = (T::lit(0.5) * self.time_s * sign, self.time_s * self.time_s / T::lit(3.0));
        let signals = by_means.iter().zip(&self.by_reading).zip(self.variances.iter().zip(&self.of_means));
        for ((g, d), (variance, of_mean)) in signals {
            let term = |i: usize, j: usize| {
                let cross = half * (g[i] * d[j] + d[i] * g[j]);
                *of_mean * g[i] * g[j] + *variance * (cross + third * d[i] * d[j])
            };
            covariance[0] += term(0, 0);
            covariance[1] += term(0, 1);
            covariance[2] += term(1, 1);
        }
    }

    /// Covariance of the hat that rises over the block (rows) with the one `before`, which falls over it (columns).
    pub fn shared(&self, by_means: &ByMeans<T>, before: &ByMeans<T>) -> [Pair<T>; 2] {
        let (half, sixth) = (T::lit(0.5) * self.time_s, self.time_s * self.time_s / T::lit(6.0));
        let mut shared = [[T::zero(); 2]; 2];
        let readings = self.by_reading.iter().zip(self.variances.iter().zip(&self.of_means));
        for ((g, was), (d, (variance, of_mean))) in by_means.iter().zip(before).zip(readings) {
            for (i, row) in shared.iter_mut().enumerate() {
                for (j, entry) in row.iter_mut().enumerate() {
                    let cross = half * (d[i] * was[j] - g[i] * d[j]);
                    *entry += *variance * (cross + sixth * d[i] * d[j]) - *of_mean * g[i] * was[j];
                }
            }
        }
        shared
    }
}

/// The last hat's rows, white.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Whitening<T> {
    pub rows: [Row<T>; 2],
    /// L's own block: [balance, both, A].
    diagonal: [T; 3],
    by_means: ByMeans<T>,
    /// Of the block over which it falls.
    pub last: BlockNoise<T>,
}

/// A variance that is less than this share of what it was before the last hat's part was taken off is rounding.
const LEAST_SHARE: f64 = 1e-5;

impl<T: Real> Whitening<T> {
    /// The next hat, from the block over which it rises to the one over which it falls, after the hat `before` where there is no gap.
    pub fn next(
        before: Option<&Self>,
        rows: &[Row<T>; 2],
        by_means: ByMeans<T>,
        [first, last]: [BlockNoise<T>; 2],
    ) -> Self {
        let mut whole = [T::zero(); 3];
        first.add_own(-T::one(), &by_means, &mut whole);
        last.add_own(T::one(), &by_means, &mut whole);
        let (mut own, mut rows) = (whole, *rows);
        if let Some(before) = before {
            let shares = before.shares(first.shared(&by_means, &before.by_means));
            let [[a, b], [c, d]] = shares;
            let left = [own[0] - a * a - b * b, own[1] - c * a - d * b, own[2] - c * c - d * d];
            if is_positive(&left, &whole) {
                own = left;
                before.take_off(shares, &mut rows);
            }
        }
        let balance = own[0].sqrt();
        let both = own[1] / balance;
        let a = (own[2] - both * both).sqrt();
        let (per_balance, per_a) = (balance.recip(), a.recip());
        let [on_balance, on_a] = &mut rows;
        for (first, second) in on_balance.iter_mut().zip(on_a) {
            *first *= per_balance;
            *second = (*second - both * *first) * per_a;
        }
        Self { rows, diagonal: [balance, both, a], by_means, last }
    }

    /// S_k,k−1 L_k−1⁻ᵀ.
    fn shares(&self, shared: [Pair<T>; 2]) -> [Pair<T>; 2] {
        let [balance, both, a] = self.diagonal;
        shared.map(|[left, right]| {
            let left = left / balance;
            [left, (right - both * left) / a]
        })
    }

    fn take_off(&self, shares: [Pair<T>; 2], rows: &mut [Row<T>; 2]) {
        let [balance, a] = &self.rows;
        for (row, [by_balance, by_a]) in rows.iter_mut().zip(shares) {
            for ((entry, first), second) in row.iter_mut().zip(balance).zip(a) {
                *entry -= by_balance * *first + by_a * *second;
            }
        }
    }
}

/// Whether what is left of a covariance is one, beyond rounding.
fn is_positive<T: Real>(left: &[T; 3], whole: &[T; 3]) -> bool {
    let share = T::lit(LEAST_SHARE);
    left[0] > share * whole[0] && left[2] - left[1] * left[1] / left[0] > share * whole[2]
}

#[cfg(test)]
mod tests {
    use super::super::edges::{Edges, Scaled};
    use super::super::hats::Sampled;
    use super::super::unknowns::VALVE_COVARIANCES;
    use super::*;

    fn calibration() -> ValveCalibration<f64> {
        let mut mean = [0.0; N];
        mean[KAPPA] = 1.1;
        mean[GAINS..LAPS].copy_from_slice(&[0.9, 1.1, 1.05, 0.95]);
        mean[LAPS..ROUNDING].copy_from_slice(&[0.002, -0.004, 0.003, 0.001]);
        (mean[ROUNDING], mean[SATURATION], mean[TANK], mean[LAG]) = (0.02, 0.03, 0.5, 0.2);
        mean[CLEARANCES..HYSTERESIS].copy_from_slice(&[0.05, 0.04, 0.03, 0.06]);
        (mean[HYSTERESIS], mean[SUPPLY], mean[DROOP]) = (0.001, 0.2, 0.4);
        ValveCalibration {
            mean,
            covariance: [0.0; VALVE_COVARIANCES],
            rated_flow_m3s: 4.0 / 60e3,
            rated_drop_pa: 35e5,
            tank_pa: 2e5,
            hysteresis: 0.003,
            null_leak: 0.02,
            gain_drift: 0.03,
            lap_drift: 0.001,
            null_leak_drift: 0.1,
        }
    }

    /// Rows over a hat in which all moves.
    fn rows(calibration: &ValveCalibration<f64>) -> [Row<f64>; 2] {
        let noise = ValveNoise { position_m: 2e-4, pressure_pa: 16e3, spool: 1e-3, supply_pa: 16e3 };
        let edges = Edges::of(calibration, &noise);
        let mut blocks = [Block::new(), Block::new()];
        for k in 0..50 {
            let t = 0.01 * f64::from(k);
            let reading = Scaled {
                x_m: 0.1 + 0.02 * t,
                pa: 1.5 + 0.4 * t,
                pb: 0.9 - 0.2 * t * t,
                spool: 0.08 - 0.2 * t,
                ps: 2.8,
            };
            let read = [reading.x_m, reading.pa, reading.pb, reading.spool];
            blocks[k as usize / 25].add(&Sampled { rates: edges.at(&reading), read, before_s: 0.01 }, 0.01);
        }
        let equations = Equations::of(&Cylinder::paper(), &Fluid::paper(), calibration, &noise);
        equations.rows(&Hat::over(&blocks[0], &blocks[1]), 0.4)
    }

    /// The left side of another valve is off by its columns.
    #[test]
    fn columns_are_slopes_of_the_equations() {
        let at = rows(&calibration());
        for unknown in KAPPA..N {
            let step = 1e-4;
            let [high, low] = [step, -step].map(|step| {
                let mut other = calibration();
                other.mean[unknown] += step;
                rows(&other)
            });
            for ((at, high), low) in at.iter().zip(&high).zip(&low) {
                let (slope, column) = ((low[N] - high[N]) / (2.0 * step), at.get(unknown).copied());
                let column = column.unwrap_or_default();
                // What acts by its mean over the hat does not follow the laps.
                assert!((slope - column).abs() < 3e-2 * column.abs() + 1e-5, "{unknown}: {slope} {column}");
            }
        }
    }
}
