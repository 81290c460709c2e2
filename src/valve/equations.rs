//! Both continuity equations of one step between two readings, with the valve's flows in the place of meters.
//!
//! With κ = 1/β, midpoints of the volumes, and trapezoids of leaks and flows over the step h (Wu et al. 2011, eq. 1):
//!
//! ```text
//! g_A =  A_A Δx + κ V_A ΔP_A + h [C_ip (P_A − P_B) + C_epA P_A − Q_A] = 0
//! g_B = −A_B Δx + κ V_B ΔP_B + h [C_ip (P_B − P_A) + C_epB P_B − Q_B] = 0
//! ```
//!
//! Every reading stands in two steps, and the spool's noise in both chambers with opposite signs: their covariance G R Gᵀ is block
//! tridiagonal, of 2 × 2 blocks.

use super::edges::{PA, PB, Signals, Spool, X, flows};
use super::unknowns::{KAPPA, LEAK_UNIT_M3SPA, LEAKS, UNKNOWNS, Unknowns};
use crate::rig::{Rig, ValveSheet};
use nalgebra::{Matrix2x5, SMatrix, Vector2};
use pitchleak_core::Cylinder;

pub(super) type Slopes = SMatrix<f64, 2, UNKNOWNS>;

/// What is known before.
#[derive(Clone, Debug)]
pub(super) struct Known {
    pub cylinder: Cylinder<f64>,
    /// κ as the rig file has it, 1/Pa.
    pub kappa_ppa: f64,
    /// k_v, m³/(s·√Pa).
    pub gain: f64,
    /// What passes a full opening, m³/s.
    pub rated_m3s: f64,
    /// Variances of the readings.
    pub variances: Signals,
    /// So many numbers a step tells beside the signals.
    pub told: f64,
}

/// A sensor without noise has this of its full scale: rounding.
const LEAST_SHARE: f64 = 1e-6;

impl Known {
    pub fn of(rig: &Rig, sheet: &ValveSheet) -> Self {
        let variance = |sheet: &crate::rig::Instrument| {
            sheet.spread().noise_std.max(LEAST_SHARE * sheet.full_scale).powi(2)
        };
        let sheets = &rig.instruments;
        let pressure = variance(&sheets.pressure);
        let supply =
            if sheet.supply_pa.is_some() { LEAST_SHARE * pressure } else { variance(&sheets.supply) };
        Self {
            cylinder: rig.cylinder,
            kappa_ppa: 1.0 / rig.fluid.bulk_modulus_pa,
            rated_m3s: sheet.rated_flow_m3s,
            gain: sheet.rated_flow_m3s / sheet.rated_drop_pa.sqrt(),
            variances: Signals::from([
                variance(&sheets.position),
                pressure,
                pressure,
                variance(&sheets.spool),
                supply,
            ]),
            told: 2.0,
        }
    }
}

/// A node of the trace: signals on their way to the likeliest, and what goes with them.
#[derive(Clone, Copy, Debug, serde::Serialize, serde::Deserialize)]
pub(super) struct Node {
    pub t_s: f64,
    pub signals: Signals,
    pub spool: Spool,
}

impl Node {
    /// Half way to another one.
    pub fn half_way(&self, to: &Self) -> Self {
        let mean = |from: f64, to: f64| 0.5 * (from + to);
        Self {
            t_s: mean(self.t_s, to.t_s),
            signals: (self.signals + to.signals) * 0.5,
            spool: Spool {
                rate_ps: mean(self.spool.rate_ps, to.spool.rate_ps),
                play: mean(self.spool.play, to.spool.play),
                tank_pa: mean(self.spool.tank_pa, to.spool.tank_pa),
            },
        }
    }
}

/// A node's leaks less its flows, and their slopes.
pub(super) struct Rates {
    net_m3s: Vector2<f64>,
    by_signals: Matrix2x5<f64>,
    by_unknowns: Slopes,
}

impl Rates {
    pub fn at(node: &Node, unknowns: &Unknowns, known: &Known) -> Self {
        let [a, b] = flows(&node.signals, &node.spool, unknowns, known.gain, known.rated_m3s);
        let (pa, pb) = (node.signals[PA], node.signals[PB]);
        let leaks = unknowns.fixed_rows::<3>(LEAKS) * LEAK_UNIT_M3SPA;
        let through = leaks[0] * (pa - pb);
        let mut rates = Self {
            net_m3s: Vector2::new(through + leaks[1] * pa - a.m3s, -through + leaks[2] * pb - b.m3s),
            by_signals: Matrix2x5::zeros(),
            by_unknowns: Slopes::zeros(),
        };
        for (row, flow) in [a, b].iter().enumerate() {
            rates.by_signals.set_row(row, &-flow.by_signals.transpose());
            rates.by_unknowns.set_row(row, &-flow.by_unknowns.transpose());
        }
        rates.by_signals[(0, PA)] += leaks[0] + leaks[1];
        rates.by_signals[(0, PB)] -= leaks[0];
        rates.by_signals[(1, PA)] -= leaks[0];
        rates.by_signals[(1, PB)] += leaks[0] + leaks[2];
        rates.by_unknowns[(0, LEAKS)] = LEAK_UNIT_M3SPA * (pa - pb);
        rates.by_unknowns[(1, LEAKS)] = -LEAK_UNIT_M3SPA * (pa - pb);
        rates.by_unknowns[(0, LEAKS + 1)] = LEAK_UNIT_M3SPA * pa;
        rates.by_unknowns[(1, LEAKS + 2)] = LEAK_UNIT_M3SPA * pb;
        rates
    }
}

/// One step's equations, made linear at its two nodes.
pub(super) struct Step {
    pub residual_m3: Vector2<f64>,
    /// By the signals at its begin and its end.
    pub by_first: Matrix2x5<f64>,
    pub by_last: Matrix2x5<f64>,
    pub by_unknowns: Slopes,
}

impl Step {
    pub fn between(
        [first, last]: [&Node; 2],
        [from, middle, to]: [&Rates; 3],
        unknowns: &Unknowns,
        known: &Known,
    ) -> Self {
        let cylinder = &known.cylinder;
        // Simpson's rule: where an edge opens, flows bend between two readings.
        let sixth_s = (last.t_s - first.t_s) / 6.0;
        let kappa = unknowns[KAPPA] * known.kappa_ppa;
        let rise = last.signals - first.signals;
        let middle_m = 0.5 * (first.signals[X] + last.signals[X]);
        let (area_a, area_b) = (cylinder.area_a_m2, cylinder.area_b_m2);
        let (volume_a, volume_b) = (cylinder.volume_a_m3(middle_m), cylinder.volume_b_m3(middle_m));
        let mut step = Self {
            residual_m3: (from.net_m3s + 4.0 * middle.net_m3s + to.net_m3s) * sixth_s
                + Vector2::new(
                    area_a * rise[X] + kappa * volume_a * rise[PA],
                    -area_b * rise[X] + kappa * volume_b * rise[PB],
                ),
            by_first: (from.by_signals + 2.0 * middle.by_signals) * sixth_s,
            by_last: (2.0 * middle.by_signals + to.by_signals) * sixth_s,
            by_unknowns: (from.by_unknowns + 4.0 * middle.by_unknowns + to.by_unknowns) * sixth_s,
        };
        for (slopes, sign) in [(&mut step.by_first, -1.0), (&mut step.by_last, 1.0)] {
            slopes[(0, X)] += sign * area_a + 0.5 * kappa * area_a * rise[PA];
            slopes[(1, X)] += -sign * area_b - 0.5 * kappa * area_b * rise[PB];
            slopes[(0, PA)] += sign * kappa * volume_a;
            slopes[(1, PB)] += sign * kappa * volume_b;
        }
        step.by_unknowns[(0, KAPPA)] += known.kappa_ppa * volume_a * rise[PA];
        step.by_unknowns[(1, KAPPA)] += known.kappa_ppa * volume_b * rise[PB];
        step
    }
}
