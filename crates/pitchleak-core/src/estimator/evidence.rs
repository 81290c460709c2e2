// Index loops over const bounds: they read like the algebra and the bounds checks vanish.
#![allow(clippy::needless_range_loop)]

use super::block::Block;
use super::hypothesis::Hypothesis;
use super::information::{Posterior, Prior};
use super::prior::LEAKS;
use crate::Real;

/// Measures how well a hypothesis foretold a block: ln of the block's probability, less what is the same for
/// all hypotheses.
///
/// With the block's rows H, readings y and what a hypothesis foretold, θ⁻ of covariance P⁻, that is
///
/// ```text
/// −½ |y − H θ⁻|² + ½ bᵀ P⁺ b − ½ ln det(1 + P⁻ HᵀH)        b = Hᵀ(y − H θ⁻)
/// ```
///
/// (Kalman's likelihood by the matrix inversion lemma; Bar-Shalom, Li, Kirubarajan 2001, §5.2 and §11.6). The square is
/// taken relative to a reference θ common to all, so that nothing cancels in f32.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(bound = "T: crate::Saved"))]
pub(super) struct Evidence<T, const N: usize> {
    pub block: Block<T, N>,
    /// Hᵀ(y − H θ) at the reference, of levels …
    #[cfg_attr(feature = "serde", serde(with = "crate::number::arrays::vector"))]
    score: [T; N],
    /// … and slopes.
    slope_score: [T; LEAKS],
}

impl<T: Real, const N: usize> Evidence<T, N> {
    /// Of no block.
    pub fn none() -> Self {
        Self { block: Block::empty(), score: [T::zero(); N], slope_score: [T::zero(); LEAKS] }
    }

    /// The block is there: it is held against the `reference`.
    pub fn refer(&mut self, mean_0: T, reference: &[T; N]) {
        let known = &self.block.information;
        (self.score, self.slope_score) = (known.levels, known.slopes);
        self.score[0] += known.column_noise * mean_0;
        known.take_explained(&mut self.score, &mut self.slope_score, reference, &[T::zero(); LEAKS]);
    }

    /// The hypothesis takes the block in; `posterior` becomes what it knows then. ln of the block's probability by it, from what it
    /// foretold before, and ln of how much the determinant of its information has grown.
    #[cfg_attr(target_os = "none", inline(never))] // once in the flash, not for each caller
    pub fn teach(
        &self,
        hypothesis: &mut Hypothesis<T, N>,
        prior: &Prior<'_, T>,
        reference: &[T; N],
        posterior: &mut Posterior<T, N>,
    ) -> (T, T) {
        hypothesis.solve(prior, posterior);
        let slopes_ps = posterior.slopes_ps();
        let mut apart = posterior.mean;
        for i in 0..N {
            apart[i] -= reference[i];
        }
        let (mut levels, mut slopes) = (self.score, self.slope_score);
        self.block.information.take_explained(&mut levels, &mut slopes, &apart, &slopes_ps);
        // |y − H θ|² at the reference, less that at θ⁻.
        let mut square = T::zero();
        for i in 0..N {
            square += apart[i] * (self.score[i] + levels[i]);
        }
        for i in 0..LEAKS {
            square += slopes_ps[i] * (self.slope_score[i] + slopes[i]);
        }
        let pivots = posterior.pivots();
        hypothesis.learn(&self.block);
        hypothesis.solve(prior, posterior);
        let learnt = posterior.variance(&levels, &slopes);
        // Noise in column 0 makes its entry of b larger by chance.
        let by_noise = self.block.information.column_noise * posterior.variance_0();
        let growth = posterior.growth_since(&pivots);
        (T::lit(0.5) * (square + learnt - by_noise - growth), growth)
    }

    /// As [`teach`](Self::teach): ln of the block's probability alone.
    #[cfg_attr(target_os = "none", inline(never))] // its stack is none of what follows
    pub fn gain(&self, hypothesis: &mut Hypothesis<T, N>, prior: &Prior<'_, T>, reference: &[T; N]) -> T {
        self.teach(hypothesis, prior, reference, &mut Posterior::room()).0
    }
}

#[cfg(test)]
mod tests {
    use super::super::block::{Balance, BlockSums};
    use super::*;
    use crate::continuity::Equation;
    use nalgebra::{DMatrix, DVector};
    use std::vec::Vec;

    const OFFSETS: [[f64; 2]; 2] = [[1.0, 0.0], [0.0, 1.0]];
    const PRIOR: Prior<'static, f64> = Prior { mean_0: 0.0, offsets: &OFFSETS };
    const MEMORY_S: f64 = 0.02;
    /// Age of the position equation within a block of 0.5 s, s.
    const AGE_S: f64 = 0.3;

    struct Row {
        f: [f64; 4],
        y: f64,
        age_s: f64,
    }

    /// Seven rows of the position, then two balances: regressors that turn, readings at random.
    fn rows(block: u32) -> Vec<Row> {
        (0..9)
            .map(|k| {
                let t = f64::from(block * 9 + k);
                let f = [t.sin(), (0.7 * t).cos(), (1.9 * t + 1.0).sin(), (0.3 * t).sin()].map(|f| 2.0 * f);
                Row {
                    f,
                    y: 3.0 * (17.0 * t).sin(),
                    age_s: [AGE_S + 0.25, 0.375, 0.125][k.saturating_sub(6) as usize],
                }
            })
            .collect()
    }

    fn block(rows: &[Row]) -> Block<f64, 4> {
        let (position, balances) = rows.split_at(7);
        let mut sums = BlockSums::new();
        for row in position {
            sums.add(&row.f, &[1, 2, 3].map(|i| AGE_S * row.f[i]), row.y, 1.0);
        }
        let balance = |row: &Row| {
            Some(Balance { equation: Equation { left: row.y, columns: row.f }, age_s: row.age_s })
        };
        Block::new(0.5, &sums, &[balance(&balances[0]), balance(&balances[1])], 0.0)
    }

    fn evidence(block: Block<f64, 4>, reference: &[f64; 4]) -> Evidence<f64, 4> {
        let mut evidence = Evidence { block, ..Evidence::none() };
        evidence.refer(0.0, reference);
        evidence
    }

    /// ln N(y; H m, 1 + H P Hᵀ) without the constant, and the posterior, by dense matrices.
    fn dense(
        rows: &[Row],
        rate_ps: f64,
        mean: &DVector<f64>,
        cov: &DMatrix<f64>,
    ) -> (f64, DVector<f64>, DMatrix<f64>) {
        let h = DMatrix::from_fn(rows.len(), 7, |r, c| {
            if c < 4 { rows[r].f[c] } else { -rate_ps * rows[r].age_s * rows[r].f[c - 3] }
        });
        let error = DVector::from_iterator(rows.len(), rows.iter().map(|row| row.y)) - &h * mean;
        let spread = DMatrix::identity(rows.len(), rows.len()) + &h * cov * h.transpose();
        let inverse = spread.clone().try_inverse().unwrap();
        let log = -0.5 * (error.dot(&(&inverse * &error)) + spread.determinant().ln());
        let gain = cov * h.transpose() * inverse;
        (log, mean + &gain * error, cov - &gain * h * cov)
    }

    fn shift(mean: &DVector<f64>, cov: &DMatrix<f64>, moved: f64, keep: f64) -> (DVector<f64>, DMatrix<f64>) {
        let mut turn = DMatrix::identity(7, 7);
        (0..3).for_each(|i| turn[(1 + i, 4 + i)] = moved);
        let information = cov.clone().try_inverse().unwrap() - DMatrix::identity(7, 7);
        let back = turn.clone().try_inverse().unwrap();
        // The prior stands, what the data told fades and moves on.
        let vector = cov.clone().try_inverse().unwrap() * mean;
        let faded = back.transpose() * information * &back * keep + DMatrix::identity(7, 7);
        let cov = faded.try_inverse().unwrap();
        let mean = &cov * (back.transpose() * vector * keep);
        (mean, cov)
    }

    #[test]
    fn is_the_probability_of_the_block_by_dense_algebra() {
        let mut constant = Hypothesis::<f64, 4>::steady(f64::INFINITY);
        let mut trend = Hypothesis::<f64, 4>::trend(MEMORY_S);
        let rate_ps = trend.rate_ps();
        let (mut steady, mut moving) =
            ((DVector::zeros(7), DMatrix::identity(7, 7)), (DVector::zeros(7), DMatrix::identity(7, 7)));
        // Without slopes: their prior has no width.
        (4..7).for_each(|i| steady.1[(i, i)] = 0.0);
        for index in 0..5 {
            let rows = rows(index);
            let block = block(&rows);
            let reference = [0.1, -0.2, 0.3, 0.05];
            let evidence = evidence(block, &reference);
            let mut after = Posterior::room();
            let (stays, _) = evidence.teach(&mut constant, &PRIOR, &reference, &mut after);
            trend.advance(block.time_s);
            let (changes, _) = evidence.teach(&mut trend, &PRIOR, &reference, &mut after);

            let (log_steady, mean, cov) = dense(&rows, 0.0, &steady.0, &steady.1);
            steady = (mean, cov);
            let keep = 1.0 / (1.0 + block.time_s / MEMORY_S);
            moving = shift(&moving.0, &moving.1, rate_ps * block.time_s, keep);
            let (log_moving, mean, cov) = dense(&rows, rate_ps, &moving.0, &moving.1);
            moving = (mean, cov);

            let difference = log_moving - log_steady;
            assert!((changes - stays - difference).abs() < 1e-9 * difference.abs().max(1.0), "block {index}");
            for i in 0..4 {
                assert!((after.mean[i] - moving.0[i]).abs() < 1e-9);
                let mut one = [0.0; 4];
                one[i] = 1.0;
                assert!((after.variance(&one, &[0.0; 3]) - moving.1[(i, i)]).abs() < 1e-9);
            }
            for (i, (slope_ps, variance)) in after.slopes().into_iter().enumerate() {
                assert!((slope_ps / rate_ps - moving.0[4 + i]).abs() < 1e-9);
                assert!((variance / rate_ps.powi(2) - moving.1[(4 + i, 4 + i)]).abs() < 1e-9);
            }
        }
    }

    /// A column of nothing but noise, known in its variance, speaks for no hypothesis and against none: on average a block is as
    /// probable as without it.
    #[test]
    fn noise_in_a_column_is_no_evidence() {
        const NOISE: f64 = 0.3;
        const ROWS: usize = 50;
        const BLOCKS: usize = 4000;
        let mut noise = pitchleak_testkit::white_noise(5);
        let mut next = || noise.next().unwrap();
        let mut differences = Vec::new();
        for _ in 0..BLOCKS {
            let rows: Vec<(f64, f64)> = (0..ROWS).map(|_| (NOISE * next(), next())).collect();
            let told = |size: f64| {
                let mut sums = BlockSums::new();
                rows.iter().for_each(|(n, y)| sums.add(&[size * n, 1.0, 0.0, 0.0], &[0.0; LEAKS], *y, 1.0));
                let column_noise = ROWS as f64 * (size * NOISE).powi(2);
                let block = Block::new(0.5, &sums, &[None; 2], column_noise);
                let mut hypothesis = Hypothesis::<f64, 4>::steady(f64::INFINITY);
                let reference = [0.0; 4];
                evidence(block, &reference)
                    .teach(&mut hypothesis, &PRIOR, &reference, &mut Posterior::room())
                    .0
            };
            differences.push(told(1.0) - told(0.0));
        }
        let mean = differences.iter().sum::<f64>() / BLOCKS as f64;
        let variance = differences.iter().map(|d| (d - mean).powi(2)).sum::<f64>() / BLOCKS as f64;
        let std = (variance / BLOCKS as f64).sqrt();
        // Of the expected square of 4.5 nats, half would stay; what the pivot's own scatter leaves is a few hundredths.
        assert!(mean.abs() < 0.1 + 3.0 * std, "{mean} ± {std} nats");
    }

    /// Noise in column 0 is in the left side too, times the prior mean that was taken off: together they tell
    /// nothing.
    #[test]
    fn noise_at_the_prior_mean_tells_nothing() {
        const MEAN_0: f64 = 0.7;
        let mut sums = BlockSums::new();
        for noise in [0.2, -0.1, -0.3, 0.2] {
            sums.add(&[noise, 0.0, 0.0, 0.0], &[0.0; LEAKS], -MEAN_0 * noise, 1.0);
        }
        let mut evidence = Evidence { block: Block::new(0.5, &sums, &[None; 2], 0.18), ..Evidence::none() };
        evidence.refer(MEAN_0, &[0.0; 4]);
        assert!(evidence.score[0].abs() < 1e-12, "{}", evidence.score[0]);
    }
}
