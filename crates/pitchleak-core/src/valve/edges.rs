//! What passes the four edges at an instant, and how that changes with what is not known of them.
//!
//! ```text
//! Q_A = K₁ e₁ − K₂ e₂ + l₁ (P_S − P_A) − l₂ P_A        e₁ = o(u − d₁) ρ(P_S − P_A)    e₂ = o(−u − d₂) ρ(P_A − P_T)
//! Q_B = K₃ e₃ − K₄ e₄ + l₃ (P_S − P_B) − l₄ P_B        e₃ = o(−u − d₃) ρ(P_S − P_B)   e₄ = o(u − d₄) ρ(P_B − P_T)
//! o(s) = ½ (√(s² + w²) + s) (1 − c u²)                 ρ(Δ) = Δ (Δ² + Δ_l²)^(−¼)
//! ```
//!
//! Merritt, Hydraulic Control Systems (1967), §5-1; ρ is [`metering`](crate::metering). Flows are in the rated flow, pressures in the
//! drop at which it holds, so that the numbers of any valve are near one.

use super::calibration::ValveCalibration;
use super::unknowns::{GAINS, LAPS, PA_PER_BAR, ROUNDING, SATURATION, SUPPLY, TANK};
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

/// Below this drop an edge turns laminar, Pa.
const LAMINAR_PA: f64 = 1e4;

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
    pub fn of(calibration: &ValveCalibration<T>) -> Self {
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
        }
    }

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
        let full = T::one() - self.saturation * spool_square;
        let (own, laminar) = (drop * drop, self.laminar * self.laminar);
        let per_size = (own + laminar).inverse_root();
        // (Δ² + Δ_l²)^(−¼).
        let metering = per_size * per_size.inverse_root();
        let metered = drop * metering;
        let by_s = full * metered;
        Passing {
            flow: open * by_s,
            by_opening: open * per_root * by_s,
            by_rounding: half * self.rounding * per_root * by_s,
            by_saturation: -open * spool_square * metered,
            by_drop: open * full * (half * own + laminar) * per_size * per_size * metering,
        }
    }
}
