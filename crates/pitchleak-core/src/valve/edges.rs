//! What passes the four edges at an instant, and how that changes with what is not known of them.
//!
//! ```text
//! Q_A = K₁ e₁ − K₂ e₂ + l₁ (P_S − P_A) − l₂ P_A        e₁ = o(u − d₁) ρ(P_S − P_A)    e₂ = o(−u − d₂) ρ(P_A − P_T)
//! Q_B = K₃ e₃ − K₄ e₄ + l₃ (P_S − P_B) − l₄ P_B        e₃ = o(−u − d₃) ρ(P_S − P_B)   e₄ = o(u − d₄) ρ(P_B − P_T)
//! o(s) = ½ (√(s² + w²) + s) (1 − c u²)                 ρ(Δ) = Δ (Δ² + Δ_l²)^(−¼)
//! ```
//!
//! Readings of the spool scatter by σ, and o is curved: its mean over readings is ½ o″ σ² too large, o″ = ½ w² (s² + w²)^(−3/2), which is
//! taken off.
//!
//! Merritt, Hydraulic Control Systems (1967), §5-1; ρ is [`metering`](crate::metering). Flows are in the rated flow, pressures in the
//! drop at which it holds, so that the numbers of any valve are near one.

use super::calibration::{ValveCalibration, ValveNoise};
use super::unknowns::{GAINS, LAMINAR_PA, LAPS, PA_PER_BAR, ROUNDING, SATURATION, SUPPLY, TANK};
use crate::Real;

/// What is summed over time.
pub(super) const SUMS: usize = 20;
/// e₁ … e₄.
pub(super) const FLOWS: usize = 0;
/// K ∂e/∂s of each edge, by its opening.
pub(super) const SLOPES: usize = 4;
/// ∂Q_A/∂w, ∂Q_B/∂w.
pub(super) const BY_ROUNDING: usize = 8;
/// ∂Q_A/∂c, ∂Q_B/∂c.
pub(super) const BY_SATURATION: usize = 10;
/// K ∂e/∂P_S of the edges P–A, P–B.
pub(super) const BY_SUPPLY: usize = 12;
/// K ∂e/∂P_A of the edge A–T, K ∂e/∂P_B of B–T.
pub(super) const BY_TANK: usize = 14;
/// P_A, P_B, P_S.
pub(super) const PRESSURES: usize = 16;
/// What is drawn from the supply.
pub(super) const DRAWN: usize = 19;

/// A valve as its calibration has it.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Edges<T> {
    gains: [T; 4],
    laps: [T; 4],
    rounding: T,
    saturation: T,
    /// Off the readings, in the rated drop.
    supply: T,
    tank: T,
    laminar: T,
    /// ½ · ½ w² σ².
    curved: T,
}

/// A reading: position, m; pressures of A, B and the supply, in the rated drop; spool, a share of its stroke.
#[derive(Clone, Copy, Debug)]
pub(super) struct Scaled<T> {
    pub x_m: T,
    pub pa: T,
    pub pb: T,
    pub spool: T,
    pub ps: T,
}

/// One edge at one instant: e, and its slopes by opening, rounding, saturation and drop.
struct Passing<T> {
    flow: T,
    by_opening: T,
    by_rounding: T,
    by_saturation: T,
    by_drop: T,
}

impl<T: Real> Edges<T> {
    pub fn of(calibration: &ValveCalibration<T>, noise: &ValveNoise<T>) -> Self {
        let mean = &calibration.mean;
        let per_bar = T::lit(PA_PER_BAR) / calibration.rated_drop_pa;
        let four = |from: usize| [mean[from], mean[from + 1], mean[from + 2], mean[from + 3]];
        Self {
            gains: four(GAINS),
            laps: four(LAPS),
            rounding: mean[ROUNDING],
            saturation: mean[SATURATION],
            supply: mean[SUPPLY] * per_bar,
            tank: calibration.tank_pa / calibration.rated_drop_pa + mean[TANK] * per_bar,
            laminar: T::lit(LAMINAR_PA) / calibration.rated_drop_pa,
            curved: T::lit(0.25) * mean[ROUNDING] * mean[ROUNDING] * noise.spool * noise.spool,
        }
    }

    #[inline(always)]
    pub fn at(&self, reading: &Scaled<T>) -> [T; SUMS] {
        let Scaled { pa, pb, spool: u, .. } = *reading;
        let ps = reading.ps + self.supply;
        let [k1, k2, k3, k4] = self.gains;
        let [d1, d2, d3, d4] = self.laps;
        let square = u * u;
        let e1 = self.passing(u - d1, square, ps - pa);
        let e2 = self.passing(-u - d2, square, pa - self.tank);
        let e3 = self.passing(-u - d3, square, ps - pb);
        let e4 = self.passing(u - d4, square, pb - self.tank);
        let (qa, qb) = (k1 * e1.flow - k2 * e2.flow, k3 * e3.flow - k4 * e4.flow);
        [
            e1.flow,
            e2.flow,
            e3.flow,
            e4.flow,
            k1 * e1.by_opening,
            k2 * e2.by_opening,
            k3 * e3.by_opening,
            k4 * e4.by_opening,
            k1 * e1.by_rounding - k2 * e2.by_rounding,
            k3 * e3.by_rounding - k4 * e4.by_rounding,
            k1 * e1.by_saturation - k2 * e2.by_saturation,
            k3 * e3.by_saturation - k4 * e4.by_saturation,
            k1 * e1.by_drop,
            k3 * e3.by_drop,
            k2 * e2.by_drop,
            k4 * e4.by_drop,
            pa,
            pb,
            ps,
            qa.at_least(T::zero()) + qb.at_least(T::zero()),
        ]
    }

    #[inline(always)]
    fn passing(&self, s: T, spool_square: T, drop: T) -> Passing<T> {
        let half = T::lit(0.5);
        let square = s * s + self.rounding * self.rounding;
        let per_root = square.inverse_root();
        let open = half * (square * per_root + s);
        let mean_open = open - self.curved * per_root * per_root * per_root;
        let full = T::one() - self.saturation * spool_square;
        let (own, laminar) = (drop * drop, self.laminar * self.laminar);
        let per_size = (own + laminar).inverse_root();
        // (Δ² + Δ_l²)^(−¼).
        let metering = per_size * per_size.inverse_root();
        let metered = drop * metering;
        let by_s = full * metered;
        Passing {
            flow: mean_open * by_s,
            by_opening: open * per_root * by_s,
            by_rounding: half * self.rounding * per_root * by_s,
            by_saturation: -open * spool_square * metered,
            by_drop: open * full * (half * own + laminar) * per_size * per_size * metering,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const AT: Scaled<f64> = Scaled { x_m: 0.1, pa: 1.5, pb: 0.9, spool: 0.01, ps: 2.8 };

    fn edges() -> Edges<f64> {
        Edges {
            gains: [0.9, 1.1, 1.05, 0.95],
            laps: [0.002, -0.004, 0.003, 0.001],
            rounding: 0.02,
            saturation: 0.03,
            supply: 0.01,
            tank: 0.05,
            laminar: 0.003,
            curved: 0.0,
        }
    }

    /// Flows of both chambers without what passes the clearances.
    fn flows(edges: &Edges<f64>, at: &Scaled<f64>) -> [f64; 2] {
        let [e1, e2, e3, e4, ..] = edges.at(at);
        let [k1, k2, k3, k4] = edges.gains;
        [k1 * e1 - k2 * e2, k3 * e3 - k4 * e4]
    }

    /// Slopes against differences, on either side of the middle.
    #[test]
    fn slopes_are_those_of_the_flows() {
        type Change = fn(&mut Edges<f64>, f64);
        let change = |by: Change, spool: f64| {
            let [high, low] = [1e-6, -1e-6].map(|step| {
                let mut edges = edges();
                by(&mut edges, step);
                flows(&edges, &Scaled { spool, ..AT })
            });
            [0, 1].map(|chamber| (high[chamber] - low[chamber]) / 2e-6)
        };
        for spool in [-0.3, -0.01, 0.0, 0.2] {
            let found = edges().at(&Scaled { spool, ..AT });
            let check = |expected: [f64; 2], slopes: [f64; 2], what: &str| {
                for (expected, slope) in expected.into_iter().zip(slopes) {
                    assert!((expected - slope).abs() < 1e-6, "{what} at {spool}: {expected} {slope}");
                }
            };
            let [o1, o2, o3, o4] = [0, 1, 2, 3].map(|edge| found[SLOPES + edge]);
            check(change(|edges, step| edges.laps[0] += step, spool), [-o1, 0.0], "lap P–A");
            check(change(|edges, step| edges.laps[1] += step, spool), [o2, 0.0], "lap A–T");
            check(change(|edges, step| edges.laps[2] += step, spool), [0.0, -o3], "lap P–B");
            check(change(|edges, step| edges.laps[3] += step, spool), [0.0, o4], "lap B–T");
            let pair = |from: usize| [found[from], found[from + 1]];
            check(change(|edges, step| edges.rounding += step, spool), pair(BY_ROUNDING), "rounding");
            check(change(|edges, step| edges.saturation += step, spool), pair(BY_SATURATION), "full");
            check(change(|edges, step| edges.supply += step, spool), pair(BY_SUPPLY), "supply");
            check(change(|edges, step| edges.tank += step, spool), pair(BY_TANK), "tank");
        }
    }
}
