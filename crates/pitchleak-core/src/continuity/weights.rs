use super::noise::NoiseStd;
use crate::{Cylinder, PerLeak, Real};

/// How the two continuity equations of one instant are combined.
///
/// Chamber A reads A_A ẋ = Q_A − …, chamber B −A_B ẋ = Q_B − …. Generalised least squares splits the pair
/// into two equations whose errors are independent:
/// - the *balance* A_B·(A) + A_A·(B), in which the piston speed cancels;
/// - the *position* equation ẋ = w_A·(A) + w_B·(B), the best speed that the flows can tell.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Weights<T> {
    /// w_A, 1/m².
    pub position_a: T,
    /// w_B, 1/m².
    pub position_b: T,
    /// Variance of the position equation's error, (m/s)² per sample.
    pub position_variance: T,
    /// Variance of the balance's error, (m²·m³/s)² per sample; infinite where a chamber rests.
    pub balance_variance: T,
}

impl<T: Real> Weights<T> {
    /// Weights where both flows are measured. The error of chamber A is n_QA − (C_ip + C_epA) n_PA
    /// + C_ip n_PB, that of B likewise, so the leaks themselves decide how much pressure noise counts.
    #[cfg_attr(target_os = "none", inline(never))] // once in the flash, not for each caller
    pub fn both(cylinder: &Cylinder<T>, noise: &NoiseStd<T>, leaks: &PerLeak<T>) -> Self {
        let pressure = noise.pressure_pa * noise.pressure_pa;
        let (c, a, b) = (leaks.internal, leaks.external_a, leaks.external_b);
        let own_a = c + a;
        let own_b = c + b;
        let var_a = noise.flow_a_m3s * noise.flow_a_m3s + pressure * (own_a * own_a + c * c);
        let var_b = noise.flow_b_m3s * noise.flow_b_m3s + pressure * (own_b * own_b + c * c);
        let cov = -pressure * c * (own_a + own_b);
        let (aa, ab) = (cylinder.area_a_m2, cylinder.area_b_m2);
        // Balance variance gᵀΣg with g = (A_B, A_A); that of the position follows from det Σ.
        let two = T::lit(2.0);
        let balance = ab * ab * var_a + two * aa * ab * cov + aa * aa * var_b;
        let pull_a = aa * var_b + ab * cov;
        let pull_b = -(ab * var_a + aa * cov);
        Self {
            position_a: pull_a / balance,
            position_b: pull_b / balance,
            position_variance: (var_a * var_b - cov * cov) / balance,
            balance_variance: balance,
        }
    }

    /// Weights where only chamber A's flow is measured.
    pub fn only_a(cylinder: &Cylinder<T>, noise: &NoiseStd<T>, leaks: &PerLeak<T>) -> Self {
        let own = leaks.internal + leaks.external_a;
        let area = cylinder.area_a_m2;
        let variance = noise.chamber_variance(noise.flow_a_m3s, own, leaks.internal);
        Self {
            position_a: T::one() / area,
            position_b: T::zero(),
            position_variance: variance / (area * area),
            balance_variance: T::infinity(),
        }
    }

    /// Weights where only chamber B's flow is measured.
    pub fn only_b(cylinder: &Cylinder<T>, noise: &NoiseStd<T>, leaks: &PerLeak<T>) -> Self {
        let own = leaks.internal + leaks.external_b;
        let area = cylinder.area_b_m2;
        let variance = noise.chamber_variance(noise.flow_b_m3s, own, leaks.internal);
        Self {
            position_a: T::zero(),
            position_b: -T::one() / area,
            position_variance: variance / (area * area),
            balance_variance: T::infinity(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Matrix2, Vector2};
    use proptest::prelude::*;

    const AREAS: Vector2<f64> = Vector2::new(1.3e-3, 0.9e-3);

    fn cylinder() -> Cylinder<f64> {
        Cylinder { area_a_m2: AREAS.x, area_b_m2: AREAS.y, ..Cylinder::paper() }
    }

    prop_compose! {
        /// Noise and leaks that weigh alike in the equations' errors.
        fn errors()(
            flow_a_m3s in 1e-7..1e-6, flow_b_m3s in 1e-7..1e-6, pressure_pa in 1e4..1e5_f64,
            (internal, external_a, external_b) in (0.0..1e-11, 0.0..1e-11, 0.0..1e-11),
        ) -> (NoiseStd<f64>, PerLeak<f64>) {
            (NoiseStd { flow_a_m3s, flow_b_m3s, pressure_pa, position_m: 0.0 }, PerLeak { internal, external_a, external_b })
        }
    }

    /// Covariance of both chambers' errors: flow noise, and pressure noise through the leaks.
    fn covariance(noise: &NoiseStd<f64>, leaks: &PerLeak<f64>) -> Matrix2<f64> {
        let c = leaks.internal;
        let through =
            Matrix2::new(-(c + leaks.external_a), c, c, -(c + leaks.external_b)) * noise.pressure_pa;
        let flows = Vector2::new(noise.flow_a_m3s.powi(2), noise.flow_b_m3s.powi(2));
        Matrix2::from_diagonal(&flows) + through * through.transpose()
    }

    fn near(found: f64, expected: f64) -> bool {
        (found / expected - 1.0).abs() < 1e-9
    }

    /// Chamber A reads A_A ẋ, chamber B −A_B ẋ: whichever meters there are, the position equation counts ẋ once.
    #[test]
    fn the_position_equation_counts_the_speed_once() {
        let cylinder = Cylinder::<f64>::paper();
        let noise = NoiseStd { flow_a_m3s: 1e-6, flow_b_m3s: 2e-6, pressure_pa: 5e4, position_m: 1e-3 };
        let leaks = PerLeak { internal: 1e-11, external_a: 3e-12, external_b: 2e-12 };
        for weights in [Weights::both, Weights::only_a, Weights::only_b] {
            let Weights { position_a, position_b, .. } = weights(&cylinder, &noise, &leaks);
            let counted = position_a * cylinder.area_a_m2 - position_b * cylinder.area_b_m2;
            assert!((counted - 1.0).abs() < 1e-12, "{counted}");
        }
    }

    proptest! {
        /// The position equation is the generalised least-squares estimate of ẋ from Q_A = A_A ẋ, Q_B = −A_B ẋ; the balance,
        /// in which ẋ cancels, keeps what is left of the covariance.
        #[test]
        fn both_are_generalised_least_squares((noise, leaks) in errors()) {
            let weights = Weights::both(&cylinder(), &noise, &leaks);
            let covariance = covariance(&noise, &leaks);
            let speed = Vector2::new(AREAS.x, -AREAS.y);
            let inverse = covariance.try_inverse().unwrap();
            let variance = 1.0 / (speed.transpose() * inverse * speed).x;
            let best = inverse * speed * variance;
            prop_assert!(near(weights.position_a, best.x) && near(weights.position_b, best.y), "{weights:?} {best}");
            prop_assert!(near(weights.position_variance, variance));
            let cancelling = Vector2::new(AREAS.y, AREAS.x);
            prop_assert!(near(weights.balance_variance, (cancelling.transpose() * covariance * cancelling).x));
        }

        /// One chamber alone: its speed is its flow over its area, as uncertain as its own error; nothing balances.
        #[test]
        fn one_chamber_counts_alone((noise, leaks) in errors()) {
            let covariance = covariance(&noise, &leaks);
            let a = Weights::only_a(&cylinder(), &noise, &leaks);
            prop_assert!(near(a.position_a, 1.0 / AREAS.x) && a.position_b == 0.0);
            prop_assert!(near(a.position_variance, covariance.m11 / AREAS.x.powi(2)));
            let b = Weights::only_b(&cylinder(), &noise, &leaks);
            prop_assert!(near(b.position_b, -1.0 / AREAS.y) && b.position_a == 0.0);
            prop_assert!(near(b.position_variance, covariance.m22 / AREAS.y.powi(2)));
            prop_assert!(a.balance_variance.is_infinite() && b.balance_variance.is_infinite());
        }
    }
}
