use super::noise::NoiseStd;
use crate::{Cylinder, PerLeak, Real};

/// How the two continuity equations of one instant are combined.
///
/// Chamber A reads A_A ẋ = Q_A − …, chamber B −A_B ẋ = Q_B − …. Generalised least squares splits the pair
/// into two equations whose errors are independent:
/// - the *balance* A_B·(A) + A_A·(B), in which the piston speed cancels;
/// - the *odometer* ẋ = w_A·(A) + w_B·(B), the best speed that the flows can tell.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Weights<T> {
    /// w_A, 1/m².
    pub odometer_a: T,
    /// w_B, 1/m².
    pub odometer_b: T,
    /// Variance of the odometer's error, (m/s)² per sample.
    pub odometer_variance: T,
    /// Variance of the balance's error, (m²·m³/s)² per sample; infinite where a chamber rests.
    pub balance_variance: T,
}

impl<T: Real> Weights<T> {
    /// Weights where both flows are measured. The error of chamber A is n_QA − (C_ip + C_epA) n_PA
    /// + C_ip n_PB, that of B likewise, so the leaks themselves decide how much pressure noise counts.
    pub fn both(cylinder: &Cylinder<T>, noise: &NoiseStd<T>, leaks: &PerLeak<T>) -> Self {
        let pressure = noise.pressure_pa * noise.pressure_pa;
        let (c, a, b) = (leaks.internal, leaks.external_a, leaks.external_b);
        let own_a = c + a;
        let own_b = c + b;
        let var_a = noise.flow_a_m3s * noise.flow_a_m3s + pressure * (own_a * own_a + c * c);
        let var_b = noise.flow_b_m3s * noise.flow_b_m3s + pressure * (own_b * own_b + c * c);
        let cov = -pressure * c * (own_a + own_b);
        let (aa, ab) = (cylinder.area_a_m2, cylinder.area_b_m2);
        // Balance variance gᵀΣg with g = (A_B, A_A); the odometer's follows from det Σ.
        let two = T::lit(2.0);
        let balance = ab * ab * var_a + two * aa * ab * cov + aa * aa * var_b;
        let pull_a = aa * var_b + ab * cov;
        let pull_b = -(ab * var_a + aa * cov);
        Self {
            odometer_a: pull_a / balance,
            odometer_b: pull_b / balance,
            odometer_variance: (var_a * var_b - cov * cov) / balance,
            balance_variance: balance,
        }
    }

    /// Weights where only chamber A's flow is measured.
    pub fn only_a(cylinder: &Cylinder<T>, noise: &NoiseStd<T>, leaks: &PerLeak<T>) -> Self {
        let own = leaks.internal + leaks.external_a;
        let area = cylinder.area_a_m2;
        let variance = noise.chamber_variance(noise.flow_a_m3s, own, leaks.internal);
        Self {
            odometer_a: T::one() / area,
            odometer_b: T::zero(),
            odometer_variance: variance / (area * area),
            balance_variance: T::infinity(),
        }
    }

    /// Weights where only chamber B's flow is measured.
    pub fn only_b(cylinder: &Cylinder<T>, noise: &NoiseStd<T>, leaks: &PerLeak<T>) -> Self {
        let own = leaks.internal + leaks.external_b;
        let area = cylinder.area_b_m2;
        let variance = noise.chamber_variance(noise.flow_b_m3s, own, leaks.internal);
        Self {
            odometer_a: T::zero(),
            odometer_b: -T::one() / area,
            odometer_variance: variance / (area * area),
            balance_variance: T::infinity(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Chamber A reads A_A ẋ, chamber B −A_B ẋ: whichever meters there are, the odometer counts ẋ once.
    #[test]
    fn an_odometer_counts_the_speed_once() {
        let cylinder = Cylinder::<f64>::paper();
        let noise = NoiseStd { flow_a_m3s: 1e-6, flow_b_m3s: 2e-6, pressure_pa: 5e4, position_m: 1e-3 };
        let leaks = PerLeak { internal: 1e-11, external_a: 3e-12, external_b: 2e-12 };
        for weights in [Weights::both, Weights::only_a, Weights::only_b] {
            let Weights { odometer_a, odometer_b, .. } = weights(&cylinder, &noise, &leaks);
            let counted = odometer_a * cylinder.area_a_m2 - odometer_b * cylinder.area_b_m2;
            assert!((counted - 1.0).abs() < 1e-12, "{counted}");
        }
    }
}
