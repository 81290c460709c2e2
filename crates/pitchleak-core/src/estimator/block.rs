//! What a block tells: its balances, and the position equation that is summed over it.

// Index loops over const bounds: they read like the algebra and the bounds checks vanish.
#![allow(clippy::needless_range_loop)]

use super::information::Information;
use super::prior::{LEAKS, leak_column};
use crate::Real;
use crate::continuity::Equation;
use crate::linalg::symmetric;

/// Sums of the position filter's whitened observations over one block.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(bound = "T: crate::Saved"))]
pub(super) struct BlockSums<T, const N: usize> {
    /// Σ f fᵀ/S, lower triangle.
    #[cfg_attr(feature = "serde", serde(with = "crate::number::arrays::matrix"))]
    pub matrix: [[T; N]; N],
    /// Σ f y/S.
    #[cfg_attr(feature = "serde", serde(with = "crate::number::arrays::vector"))]
    pub vector: [T; N],
    /// Σ (age of f) f²/S for each leak: f looks back, by so much the older is the leak that it tells of.
    pub aged: [T; LEAKS],
    /// Σ y²/S.
    pub square: T,
    /// Number of terms, which whoever adds them keeps.
    pub count: T,
}

impl<T: Real, const N: usize> BlockSums<T, N> {
    pub fn new() -> Self {
        Self {
            matrix: [[T::zero(); N]; N],
            vector: [T::zero(); N],
            aged: [T::zero(); LEAKS],
            square: T::zero(),
            count: T::zero(),
        }
    }

    /// Adds one observation y = fᵀθ + noise of variance 1/`weight`; `aged` holds Σ age · f of each leak, s.
    #[inline(always)]
    pub fn add(&mut self, f: &[T; N], aged: &[T; LEAKS], y: T, weight: T) {
        for i in 0..N {
            let wf = weight * f[i];
            for j in 0..=i {
                self.matrix[i][j] += wf * f[j];
            }
            self.vector[i] += wf * y;
        }
        for i in 0..LEAKS {
            self.aged[i] += weight * aged[i] * f[leak_column(i)];
        }
        self.square += weight * y * y;
    }

    /// Mean age of what each leak's column tells of, s.
    fn ages_s(&self) -> [T; LEAKS] {
        let mut ages = [T::zero(); LEAKS];
        for i in 0..LEAKS {
            let information = self.matrix[leak_column(i)][leak_column(i)];
            if information > T::zero() {
                ages[i] = self.aged[i] / information;
            }
        }
        ages
    }
}

/// Balances of one block: between them it looks for sudden changes.
pub(super) const BALANCES: usize = 2;

/// A balance of unit variance.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(bound = "T: crate::Saved"))]
pub(super) struct Balance<T, const N: usize> {
    pub equation: Equation<T, N>,
    /// Its age at the block's end, s.
    pub age_s: T,
}

/// What one block tells: the position equation's sums and, where both flows were measured, whitened balances.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(bound = "T: crate::Saved"))]
pub(super) struct Block<T, const N: usize> {
    /// Its length, s.
    pub time_s: T,
    /// What its rows tell, slopes in prior units per s.
    pub information: Information<T, N>,
    /// Σ y².
    square: T,
    /// Number of rows.
    count: T,
}

impl<T: Real, const N: usize> Block<T, N> {
    /// Tells nothing.
    pub fn empty() -> Self {
        Self { time_s: T::zero(), information: Information::new(), square: T::zero(), count: T::zero() }
    }

    /// Of the position equation's `sums` and the `balances`; `column_noise` is what sensor noise in column 0 adds to Σ f₀² on average.
    /// In place: it is too large to be moved about.
    pub fn fill(
        &mut self,
        time_s: T,
        sums: &BlockSums<T, N>,
        balances: &[Option<Balance<T, N>>; BALANCES],
        column_noise: T,
    ) {
        self.fill_position(time_s, sums, column_noise);
        for Balance { equation, age_s } in balances.iter().flatten() {
            self.information.add_row(&equation.columns, equation.left, *age_s);
            self.square += equation.left * equation.left;
            self.count += T::one();
        }
    }

    /// All rows of a leak's column count as if as old as they are on average.
    fn fill_position(&mut self, time_s: T, sums: &BlockSums<T, N>, column_noise: T) {
        let middle_s = T::lit(0.5) * time_s;
        let age_s = sums.ages_s().map(|age| age + middle_s);
        let information = &mut self.information;
        (information.column_noise, information.levels) = (column_noise, sums.vector);
        for i in 0..N {
            for j in 0..=i {
                *information.matrix.level_mut(i, j) = sums.matrix[i][j];
            }
        }
        for i in 0..LEAKS {
            let own = leak_column(i);
            for j in 0..N {
                information.matrix.cross[i][j] = -age_s[i] * symmetric(&sums.matrix, own, j);
            }
            for j in 0..=i {
                let entry = -age_s[j] * information.matrix.cross[i][leak_column(j)];
                *information.matrix.slope_mut(i, j) = entry;
            }
            information.slopes[i] = -age_s[i] * sums.vector[own];
        }
        (self.time_s, self.square, self.count) = (time_s, sums.square, sums.count);
    }

    /// Σ (y − fᵀθ)² at `theta`, and the number of rows.
    pub fn chi_square(&self, theta: &[T; N]) -> (T, T) {
        let Information { matrix, levels, .. } = &self.information;
        let mut chi = self.square;
        for i in 0..N {
            let mut told = T::lit(2.0) * levels[i] - theta[i] * matrix.level(i, i);
            for j in 0..i {
                told -= T::lit(2.0) * theta[j] * matrix.level(i, j);
            }
            chi -= theta[i] * told;
        }
        (chi, self.count)
    }
}

/// Position whitener: a scalar Kalman filter that carries the piston by the flows and is
/// corrected by the position sensor.
///
/// Its innovation is white, so the regression on it is generalised least squares. The filtered position
/// is kept as x̂ − gᵀθ: x̂ as if θ stood at its prior mean, g the sensitivity to θ (Friedland 1969,
/// "Treatment of bias in recursive filtering", IEEE Trans. Automatic Control 14, separate-bias form).
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(bound = "T: crate::Saved"))]
pub(super) struct PositionFilter<T, const N: usize> {
    position_m: T,
    variance_m2: T,
    #[cfg_attr(feature = "serde", serde(with = "crate::number::arrays::vector"))]
    sensitivity: [T; N],
    /// What the leaks' sensitivities add up, each share times its age, s.
    aged: [T; LEAKS],
    /// Σ 1/S over the block, to compensate pressure noise in the compressibility column.
    pub weight_sum: T,
}

impl<T: Real, const N: usize> PositionFilter<T, N> {
    /// Starts from one reading of the sensor.
    pub fn anchored(x_m: T, sensor_variance_m2: T) -> Self {
        Self {
            position_m: x_m,
            variance_m2: sensor_variance_m2,
            sensitivity: [T::zero(); N],
            aged: [T::zero(); LEAKS],
            weight_sum: T::zero(),
        }
    }

    /// Carries the piston over `dt_s` by what the flows say, `travel` in m, whose error has variance `variance_m2`.
    #[inline(always)]
    pub fn carry(&mut self, dt_s: T, travel: &Equation<T, N>, variance_m2: T) {
        // What came before is a step older now, what comes is half a step old.
        let half_s = T::lit(0.5) * dt_s;
        for i in 0..LEAKS {
            let (g, c) = (self.sensitivity[leak_column(i)], travel.columns[leak_column(i)]);
            self.aged[i] += half_s * (g + g + c);
        }
        for (g, c) in self.sensitivity.iter_mut().zip(&travel.columns) {
            *g += *c;
        }
        self.position_m += travel.left;
        self.variance_m2 += variance_m2;
    }

    /// Compares with the reading `x_m`; the whitened observation goes to `sums`.
    #[inline(always)]
    pub fn compare(&mut self, x_m: T, sensor_variance_m2: T, sums: &mut BlockSums<T, N>) {
        let weight = T::one() / (self.variance_m2 + sensor_variance_m2);
        let innovation = self.position_m - x_m;
        sums.add(&self.sensitivity, &self.aged, innovation, weight);
        self.weight_sum += weight;
        let gain = self.variance_m2 * weight;
        let keep = T::one() - gain;
        self.position_m -= gain * innovation;
        self.variance_m2 *= keep;
        for g in &mut self.sensitivity {
            *g *= keep;
        }
        for aged in &mut self.aged {
            *aged *= keep;
        }
    }

    /// Forgets where the piston is (no flow was measured over this step).
    pub fn anchor(&mut self, x_m: T, sensor_variance_m2: T) {
        *self = Self { weight_sum: self.weight_sum, ..Self::anchored(x_m, sensor_variance_m2) };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    impl<T: Real, const N: usize> Block<T, N> {
        pub fn new(
            time_s: T,
            sums: &BlockSums<T, N>,
            balances: &[Option<Balance<T, N>>; BALANCES],
            column_noise: T,
        ) -> Self {
            let mut block = Self::empty();
            block.fill(time_s, sums, balances, column_noise);
            block
        }
    }

    const F: [[f64; 4]; 4] =
        [[0.3, -1.2, 2.0, 0.7], [1.0, 0.4, -0.6, 1.5], [-0.8, 2.1, 0.2, -0.3], [0.5, 0.9, 1.1, -1.7]];
    const Y: [f64; 4] = [1.4, -0.3, 2.2, 0.6];
    const WEIGHT: f64 = 2.5;
    const AGE_S: f64 = 0.1;

    /// Two weighted observations and two balances.
    fn block() -> Block<f64, 4> {
        let mut sums = BlockSums::new();
        (0..2).for_each(|k| sums.add(&F[k], &[0.0; LEAKS], Y[k], WEIGHT));
        sums.count = 2.0;
        let balance =
            |k: usize| Some(Balance { equation: Equation { left: Y[k], columns: F[k] }, age_s: AGE_S });
        Block::new(0.0, &sums, &[balance(2), balance(3)], 0.0)
    }

    /// Row by row, as its definition says.
    #[test]
    fn chi_square_is_that_of_the_rows() {
        for theta in [[0.0; 4], [0.2, -1.1, 0.4, 2.0]] {
            let left = |k: usize| Y[k] - F[k].iter().zip(theta).map(|(f, theta)| f * theta).sum::<f64>();
            let expected = WEIGHT * (left(0).powi(2) + left(1).powi(2)) + left(2).powi(2) + left(3).powi(2);
            let (chi_square, count) = block().chi_square(&theta);
            assert!((chi_square / expected - 1.0).abs() < 1e-12, "{chi_square} {expected}");
            assert!((count - 4.0).abs() < f64::EPSILON);
        }
    }

    /// A row of this age tells of slopes what the row (f, −age ∘ f) tells.
    #[test]
    fn slopes_have_the_information_of_aged_rows() {
        let Information { matrix, slopes, .. } = block().information;
        let sum = |term: &dyn Fn(usize) -> f64| AGE_S * (term(2) + term(3));
        for i in 0..LEAKS {
            let own = leak_column(i);
            for j in 0..4 {
                let expected = -sum(&|k| F[k][own] * F[k][j]);
                assert!((matrix.cross[i][j] - expected).abs() < 1e-12);
            }
            for j in 0..=i {
                let expected = AGE_S * sum(&|k| F[k][own] * F[k][leak_column(j)]);
                assert!((matrix.slope(i, j) - expected).abs() < 1e-12);
            }
            assert!((slopes[i] + sum(&|k| F[k][own] * Y[k])).abs() < 1e-12);
        }
    }

    /// A leak of one for n steps has moved the piston by n columns, of which each is as old as its middle: Σ = n² dt/2.
    #[test]
    fn what_a_leak_has_moved_is_as_old_as_it_is() {
        let mut filter = PositionFilter::<f64, 4>::anchored(0.1, 1e-6);
        let travel = Equation { left: 0.0, columns: [0.0, 2.0, 0.0, 0.0] };
        (0..30).for_each(|_| filter.carry(0.01, &travel, 0.0));
        assert!((filter.sensitivity[1] - 60.0).abs() < 1e-9);
        assert!((filter.aged[0] - 2.0 * 0.5 * 900.0 * 0.01).abs() < 1e-9, "{:?}", filter.aged);
    }
}
