use crate::{Cylinder, Real, Sample};

/// f1–f5 of the regressor form dP_L/dt = Σ θ_i f_i, eq. (6)–(7), with
/// θ = [β, β C_ip, β C_epA, β C_epB, β/m], eq. (5).
///
/// Erratum: the paper prints f1 (eq. 4, 6, 12b) with a plus between its two terms. With eq. (1)'s own sign
/// of Q_B it has to be a minus, as here; `identity_7_needs_the_minus` pins it.
///
/// The volumes hold the dead volumes, too; without them the expressions are the paper's. The last argument is
/// the integral of the force imbalance P_A A_A − P_B A_B − F, N·s, which equals m ẋ, eq. (14). A resting
/// flow gives `None`: the law needs both.
#[inline]
pub fn regressors<T: Real>(cylinder: &Cylinder<T>, sample: &Sample<T>, momentum_n_s: T) -> Option<[T; 5]> {
    let (qa, qb) = (sample.qa_m3s?, sample.qb_m3s?);
    let x = guarded_position(cylinder, sample.x_m);
    let per_a = T::one() / cylinder.volume_a_m3(x);
    let per_b = T::one() / cylinder.volume_b_m3(x);
    Some([
        qa * per_a - qb * per_b,
        -sample.load_pressure_pa() * (per_a + per_b),
        -sample.pa_pa * per_a,
        sample.pb_pa * per_b,
        -(cylinder.area_a_m2 * per_a + cylinder.area_b_m2 * per_b) * momentum_n_s,
    ])
}

/// The position, kept 0.1 % of the stroke away from both ends: there the chamber volumes in the
/// denominators vanish.
fn guarded_position<T: Real>(cylinder: &Cylinder<T>, x_m: T) -> T {
    let guard = T::lit(1e-3) * cylinder.stroke_m;
    let end = cylinder.stroke_m - guard;
    if x_m > guard && x_m < end {
        x_m
    } else if x_m >= end {
        end
    } else {
        guard
    }
}
