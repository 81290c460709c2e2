use super::block::BlockSums;
use super::prior::{LEAKS, leak_column};
use crate::Real;
use crate::continuity::Equation;

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
