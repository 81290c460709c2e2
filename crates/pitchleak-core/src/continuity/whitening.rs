//! Exact whitening of the blocks' noise, a moving average of two equations.
//!
//! Over a block both equations carry flow noise D of their own, and at each end the position's and the pressures'
//! noise E, which the next block carries with the opposite sign:
//!
//!   cov(e_k, e_k) = D_k + E_k + E_{k−1},   cov(e_k, e_{k−1}) = −E_{k−1}.
//!
//! The innovations w_k = e_k + K_k w_{k−1} with K_k = E_{k−1} S_{k−1}⁻¹ and variance S_k = D_k + E_k + E_{k−1} − K_k E_{k−1}
//! are white (Brockwell, Davis: Time Series: Theory and Methods, 1991, §5.2, the innovations algorithm for a moving average).
//! Both rows are in metres of travel, e_A/A_A and e_B/A_B.

use super::block_sums::{Block, RAW_SUMS};
use crate::{Cylinder, Fluid, Real, Sensors};

/// Columns: each raw sum in chamber A's equation, then each in chamber B's.
pub const COLUMNS: usize = 2 * RAW_SUMS;
/// The *balance* e_A/A_A + e_B/A_B, in which the piston's travel cancels, and chamber A's equation given it (where only
/// one chamber is fed, its own).
pub const EQUATIONS: usize = 2;
/// Sensors cannot be perfect: their resolution is at least this share of the range, as in the estimator; chosen.
const RESOLUTION: f64 = 1e-6;

type Matrix2<T> = [[T; 2]; 2];

/// A whitened row: unit variance, independent of all others.
#[derive(Clone, Copy, Debug)]
pub struct Row<T> {
    /// By raw sum and chamber.
    pub columns: [T; COLUMNS],
    /// What noise adds to products of columns.
    pub noise: RowNoise<T>,
}

/// Products of the columns' own noise in a row, for noise of unit variance: of chamber A's column with itself, A's with
/// B's, B's with itself.
#[derive(Clone, Copy, Debug)]
pub struct RowNoise<T> {
    /// Of integrals over the blocks, times Σ dt²: of Q_A, of Q_B, of the pressures.
    pub integral: [[T; 3]; INTEGRALS],
    /// Of readings at the blocks' ends, times 1, V_A, V_B, V_A², V_A V_B and V_B², m³.
    pub end: [[T; 3]; VOLUME_POWERS],
}

/// Integrals whose readings may come at rates of their own: Q_A, Q_B, and the pressures.
pub const INTEGRALS: usize = 3;

/// Products of volumes up to the second order.
pub const VOLUME_POWERS: usize = 6;

/// The recursion.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(bound = "T: crate::Saved"))]
pub struct Whitener<T> {
    area_m2: [T; 2],
    /// Variances: flows A and B, (m³/s)²; position, m²; κ₀ times a pressure, 1.
    flow_variance: [T; 2],
    position_variance: T,
    strain_variance: T,
    /// E of the last block's end.
    end: Matrix2<T>,
    /// E S⁻¹ of the last block.
    gain: Matrix2<T>,
    /// Innovations of the last block, by column.
    #[cfg_attr(feature = "serde", serde(with = "crate::number::arrays::matrix"))]
    last: [[T; COLUMNS]; 2],
    /// Covariances between the rows of two chambers' columns, for a unit source in each: of noise that is integrated, and
    /// of that at the ends of blocks before.
    integral: [[Matrix2<T>; 3]; INTEGRALS],
    ends: [Matrix2<T>; 3],
    begun: bool,
}

impl<T: Real> Whitener<T> {
    /// Whitens blocks of readings of such sensors.
    pub fn new(cylinder: &Cylinder<T>, fluid: &Fluid<T>, sensors: &Sensors<T>) -> Self {
        let resolution = T::lit(RESOLUTION);
        let flow_floor = resolution * cylinder.area_a_m2 * cylinder.stroke_m;
        let square = |value: T| value * value;
        let strain = sensors.pressure.noise_std.at_least(T::one()) / fluid.bulk_modulus_pa;
        Self {
            area_m2: [cylinder.area_a_m2, cylinder.area_b_m2],
            flow_variance: [sensors.flow_a, sensors.flow_b]
                .map(|flow| square(flow.noise_std.at_least(flow_floor))),
            position_variance: square(sensors.position.noise_std.at_least(resolution * cylinder.stroke_m)),
            strain_variance: square(strain),
            end: [[T::zero(); 2]; 2],
            gain: [[T::zero(); 2]; 2],
            last: [[T::zero(); COLUMNS]; 2],
            integral: [[[[T::zero(); 2]; 2]; 3]; INTEGRALS],
            ends: [[[T::zero(); 2]; 2]; 3],
            begun: false,
        }
    }

    /// The next block is independent of those before.
    pub fn begin_anew(&mut self) {
        self.begun = false;
    }

    /// The whitened rows of a block, by equation; none of an equation that rests.
    pub fn push(&mut self, block: &Block<T>) -> [Option<Row<T>>; EQUATIONS] {
        if let Some(volumes_m3) = block.begins_at.or(Some(block.volumes_m3).filter(|_| !self.begun)) {
            self.end = self.end_variance(volumes_m3);
            self.gain = [[T::zero(); 2]; 2];
            self.last = [[T::zero(); COLUMNS]; 2];
            self.integral = [[[[T::zero(); 2]; 2]; 3]; INTEGRALS];
            self.ends = [[[T::zero(); 2]; 2]; 3];
            self.begun = true;
        }
        self.carry_noise(block);
        let now = self.end_variance(block.volumes_m3);
        let mut variance = add(&add(&now, &self.end), &scaled(&product(&self.gain, &self.end), -T::one()));
        let flown = |side: usize| {
            let area = self.area_m2[side];
            self.flow_variance[side] * block.time_square_s2[side] / (area * area)
        };
        variance[0][0] += flown(0);
        variance[1][1] += flown(1);
        self.innovate(block);
        let rows = self.rotated(block, &variance);
        self.gain = product(&now, &inverse(&variance, block.fed));
        self.end = now;
        for side in 0..2 {
            if !block.fed[side] {
                self.last[side] = [T::zero(); COLUMNS];
            }
        }
        rows
    }

    /// E: noise of the readings at a block's end, m².
    fn end_variance(&self, volumes_m3: [T; 2]) -> Matrix2<T> {
        let x = self.position_variance;
        let own = |side: usize| {
            let stored_m = volumes_m3[side] / self.area_m2[side];
            x + stored_m * stored_m * self.strain_variance
        };
        [[own(0), -x], [-x, own(1)]]
    }

    fn innovate(&mut self, block: &Block<T>) {
        let [[aa, ab], [ba, bb]] = self.gain;
        let [last_a, last_b] = &mut self.last;
        for (a, b) in last_a.iter_mut().zip(last_b.iter_mut()) {
            (*a, *b) = (aa * *a + ab * *b, ba * *a + bb * *b);
        }
        for (raw, value) in block.sums.iter().enumerate() {
            last_a[raw] += *value / self.area_m2[0];
            last_b[RAW_SUMS + raw] += *value / self.area_m2[1];
        }
    }

    /// Covariance of the innovations' noise per unit of noise, before this block's own ends.
    fn carry_noise(&mut self, block: &Block<T>) {
        let gain = self.gain;
        let turned = |covariance: &Matrix2<T>| product(&product(&gain, covariance), &transposed(&gain));
        // A reading at the block's begin is in this block with the opposite sign of the one before.
        let back = add(&gain, &[[-T::one(), T::zero()], [T::zero(), -T::one()]]);
        let [of_a, of_b] = block.time_square_s2;
        let time_squares = [of_a, of_b, block.pressure_square_s2];
        for (pair, (of, with)) in [(0, 0), (0, 1), (1, 1)].into_iter().enumerate() {
            let mut unit = [[T::zero(); 2]; 2];
            let scale = T::one() / (self.area_m2[of] * self.area_m2[with]);
            unit[of][with] = scale;
            for (integral, time_square) in self.integral.iter_mut().zip(time_squares) {
                integral[pair] = add(&turned(&integral[pair]), &scaled(&unit, time_square));
            }
            let begin = product(&product(&back, &unit), &transposed(&back));
            self.ends[pair] = add(&turned(&self.ends[pair]), &begin);
        }
    }

    /// The balance and what chamber A's row tells besides, each of unit variance.
    fn rotated(&self, block: &Block<T>, variance: &Matrix2<T>) -> [Option<Row<T>>; EQUATIONS] {
        let one = T::one();
        match block.fed {
            [true, true] => {
                let [[aa, ab], [_, bb]] = *variance;
                let balance = aa + ab + ab + bb;
                let share = (aa + ab) / balance;
                let rest = (aa - share * (aa + ab)).at_least(T::lit(RESOLUTION) * aa);
                let (of_balance, of_rest) = (one / balance.sqrt(), one / rest.sqrt());
                let row_b = -share * of_rest;
                [
                    Some(self.row([of_balance, of_balance], block)),
                    Some(self.row([of_rest + row_b, row_b], block)),
                ]
            }
            [true, false] => [None, Some(self.row([one / variance[0][0].sqrt(), T::zero()], block))],
            [false, true] => [None, Some(self.row([T::zero(), one / variance[1][1].sqrt()], block))],
            [false, false] => [None, None],
        }
    }

    /// A row that takes so much of both chambers' innovations.
    fn row(&self, weights: [T; 2], block: &Block<T>) -> Row<T> {
        let [a, b] = weights;
        let mut columns = [T::zero(); COLUMNS];
        for (place, (of_a, of_b)) in columns.iter_mut().zip(self.last[0].iter().zip(&self.last[1])) {
            *place = a * *of_a + b * *of_b;
        }
        let seen = |c: &Matrix2<T>| a * a * c[0][0] + a * b * (c[0][1] + c[1][0]) + b * b * c[1][1];
        let [area_a, area_b] = self.area_m2;
        let own = [a * a / (area_a * area_a), a * b / (area_a * area_b), b * b / (area_b * area_b)];
        let mut end = self.ends.map(|before| seen(&before));
        for (place, own) in end.iter_mut().zip(own) {
            *place += own;
        }
        let [va, vb] = block.volumes_m3;
        let powers = [T::one(), va, vb, va * va, va * vb, vb * vb];
        let noise = RowNoise {
            integral: self.integral.map(|pairs| pairs.map(|covariance| seen(&covariance))),
            end: powers.map(|power| end.map(|value| power * value)),
        };
        Row { columns, noise }
    }
}

fn add<T: Real>(a: &Matrix2<T>, b: &Matrix2<T>) -> Matrix2<T> {
    [[a[0][0] + b[0][0], a[0][1] + b[0][1]], [a[1][0] + b[1][0], a[1][1] + b[1][1]]]
}

fn scaled<T: Real>(a: &Matrix2<T>, by: T) -> Matrix2<T> {
    a.map(|row| row.map(|value| by * value))
}

fn transposed<T: Real>(a: &Matrix2<T>) -> Matrix2<T> {
    [[a[0][0], a[1][0]], [a[0][1], a[1][1]]]
}

fn product<T: Real>(a: &Matrix2<T>, b: &Matrix2<T>) -> Matrix2<T> {
    let entry = |i: usize, j: usize| a[i][0] * b[0][j] + a[i][1] * b[1][j];
    [[entry(0, 0), entry(0, 1)], [entry(1, 0), entry(1, 1)]]
}

/// Inverse among the equations that do not rest.
fn inverse<T: Real>(a: &Matrix2<T>, fed: [bool; 2]) -> Matrix2<T> {
    let zero = T::zero();
    match fed {
        [true, true] => {
            let determinant = a[0][0] * a[1][1] - a[0][1] * a[1][0];
            let [[aa, ab], [ba, bb]] = *a;
            [[bb / determinant, -ab / determinant], [-ba / determinant, aa / determinant]]
        }
        [true, false] => [[T::one() / a[0][0], zero], [zero, zero]],
        [false, true] => [[zero, zero], [zero, T::one() / a[1][1]]],
        [false, false] => [[zero; 2]; 2],
    }
}

#[cfg(test)]
mod tests {
    use super::super::block_sums::{BlockSums, RawSum};
    use super::super::clocks;
    use super::*;
    use crate::Sample;
    use nalgebra::DMatrix;
    use std::vec::Vec;

    /// Which flows are measured in each of some blocks; no two are of the same length and volumes.
    const FED: [[bool; 2]; 9] = [
        [true, true],
        [true, true],
        [true, false],
        [true, true],
        [false, false],
        [false, true],
        [false, true],
        [true, true],
        [true, true],
    ];

    /// Block k, whose sum k alone is 1: what becomes of that is the weight of the block's error in a row.
    fn block(k: usize) -> Block<f64> {
        let size = k as f64;
        let mut block = Block {
            fed: FED[k],
            time_square_s2: [2e-3 + 1e-3 * size, 7e-3 - 5e-4 * size],
            ..Block::default()
        };
        block.sums[k] = 1.0;
        block.pressure_square_s2 = 1e-3 + 2e-4 * size;
        block.volumes_m3 = [1e-4 + 2e-5 * size, 3e-4 - 1e-5 * size];
        block.begins_at = (k == 0).then_some([3e-4, 1e-4]);
        block
    }

    fn whitener() -> Whitener<f64> {
        let mut sensors = Sensors::paper();
        sensors.flow_b.noise_std *= 2.0;
        Whitener::new(&Cylinder::paper(), &Fluid::paper(), &sensors)
    }

    fn rows() -> Vec<Row<f64>> {
        let mut whitener = whitener();
        (0..FED.len()).flat_map(|k| whitener.push(&block(k))).flatten().collect()
    }

    /// Weight of the error of a chamber's equation in block k, m³, in a row.
    fn weight(row: &Row<f64>, k: usize, chamber: usize) -> f64 {
        row.columns[chamber * RAW_SUMS + k]
    }

    /// Two rows of each block of which both flows are measured and one where one is, uncorrelated and of
    /// variance 1 by the covariance of all errors together.
    #[test]
    fn rows_are_white_by_the_covariance_of_all_blocks() {
        let whitener = whitener();
        let mut covariance = DMatrix::zeros(2 * FED.len(), 2 * FED.len());
        let mut end = whitener.end_variance([3e-4, 1e-4]);
        for k in 0..FED.len() {
            let now = whitener.end_variance(block(k).volumes_m3);
            for (i, j) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
                covariance[(2 * k + i, 2 * k + j)] = now[i][j] + end[i][j];
                if k > 0 {
                    covariance[(2 * k + i, 2 * k + j - 2)] = -end[i][j];
                    covariance[(2 * k + i - 2, 2 * k + j)] = -end[i][j];
                }
            }
            for side in 0..2 {
                let flown = whitener.flow_variance[side] * block(k).time_square_s2[side];
                covariance[(2 * k + side, 2 * k + side)] += flown / whitener.area_m2[side].powi(2);
            }
            end = now;
        }
        let rows = rows();
        assert_eq!(rows.len(), FED.into_iter().flatten().filter(|fed| *fed).count());
        let weights = DMatrix::from_fn(rows.len(), 2 * FED.len(), |row, error| {
            weight(&rows[row], error / 2, error % 2) * whitener.area_m2[error % 2]
        });
        let found = &weights * covariance * weights.transpose();
        assert!((found - DMatrix::identity(rows.len(), rows.len())).amax() < 1e-9);
    }

    /// The balance takes as much of both chambers' travel.
    #[test]
    fn the_first_row_is_free_of_the_travel() {
        let [Some(balance), _] = whitener().push(&block(0)) else { panic!("no balance") };
        let [a, b] = [0, 1].map(|chamber| weight(&balance, 0, chamber) * whitener().area_m2[chamber]);
        assert!((a / b - 1.0).abs() < 1e-12);
    }

    /// Noise of what is integrated adds with each block, that of a reading between two blocks with their
    /// difference.
    #[test]
    fn noise_of_columns_is_that_of_the_weights() {
        let blocks: Vec<_> = (0..FED.len()).map(block).collect();
        let mut whitener = whitener();
        for (now, block) in blocks.iter().enumerate() {
            let [va, vb] = block.volumes_m3;
            let powers = [1.0, va, vb, va * va, va * vb, vb * vb];
            for row in whitener.push(block).into_iter().flatten() {
                for (pair, (of, with)) in [(0, 0), (0, 1), (1, 1)].into_iter().enumerate() {
                    let product = |k: usize| weight(&row, k, of) * weight(&row, k, with);
                    for integral in 0..INTEGRALS {
                        let square = |block: &Block<f64>| {
                            let [a, b] = block.time_square_s2;
                            [a, b, block.pressure_square_s2][integral]
                        };
                        let sum: f64 = (0..=now).map(|k| product(k) * square(&blocks[k])).sum();
                        assert!((row.noise.integral[integral][pair] - sum).abs() <= 1e-9 * sum.abs());
                    }
                    let step =
                        |k: usize, chamber: usize| weight(&row, k, chamber) - weight(&row, k + 1, chamber);
                    let between: f64 = (0..now).map(|k| step(k, of) * step(k, with)).sum();
                    let ends = product(0) + between + product(now);
                    for (power, found) in powers.iter().zip(row.noise.end) {
                        assert!((found[pair] - power * ends).abs() <= 1e-9 * (power * ends).abs());
                    }
                }
            }
        }
    }

    /// What was before is forgotten: a row is that of a first block.
    #[test]
    fn anew_nothing_is_known() {
        let mut whitener = whitener();
        let first = whitener.push(&block(3));
        whitener.push(&block(1));
        whitener.begin_anew();
        let anew = whitener.push(&block(3));
        assert_eq!(std::format!("{first:?}"), std::format!("{anew:?}"));
    }

    /// Neighbouring rows of a cylinder at rest, as noisy sensors read it, know nothing of each other.
    #[test]
    fn whitened_noise_is_white() {
        let (cylinder, fluid, sensors) = (Cylinder::<f64>::paper(), Fluid::paper(), Sensors::<f64>::paper());
        let mut blocks = BlockSums::new(&cylinder, &fluid);
        let mut whitener = Whitener::new(&cylinder, &fluid, &sensors);
        let mut state = 1_u64;
        // Twelve uniform numbers less six: about a standard normal.
        let mut normal = move || {
            let uniform = |state: &mut u64| {
                *state =
                    state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                (*state >> 11) as f64 / (1_u64 << 53) as f64
            };
            (0..12).map(|_| uniform(&mut state)).sum::<f64>() - 6.0
        };
        let mut last = [None; EQUATIONS];
        let (mut products, mut rows) = ([0.0; EQUATIONS], [0.0; EQUATIONS]);
        for k in 0..60_000 {
            let sample = Sample {
                x_m: 0.07 + sensors.position.noise_std * normal(),
                pa_pa: 5e6 + sensors.pressure.noise_std * normal(),
                pb_pa: 3e6 + sensors.pressure.noise_std * normal(),
                qa_m3s: Some(sensors.flow_a.noise_std * normal()),
                qb_m3s: Some(sensors.flow_b.noise_std * normal()),
                force_n: None,
            };
            let step_s = if k == 0 { 0.0 } else { 0.01 };
            let Some(block) = blocks.push(&clocks::Row::read(step_s, &sample)) else { continue };
            for (equation, row) in whitener.push(&block).into_iter().enumerate() {
                let left = row.map(|row| {
                    row.columns[RawSum::ResidualA as usize]
                        + row.columns[RAW_SUMS + RawSum::ResidualB as usize]
                });
                if let (Some(before), Some(now)) = (last[equation], left) {
                    products[equation] += before * now;
                    rows[equation] += 1.0;
                }
                last[equation] = left;
            }
        }
        for equation in 0..EQUATIONS {
            let correlation: f64 = products[equation] / rows[equation];
            assert!(rows[equation] > 2000.0);
            assert!(correlation.abs() < 4.0 / rows[equation].sqrt(), "{equation} {correlation}");
        }
    }
}
