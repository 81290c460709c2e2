//! The flows over a valve's four edges, and how they change with readings and unknowns.
//!
//! ```text
//! Q_A = k_v [K₁ o(u − d₁) √(P_S − P_A) − K₂ o(−u − d₂) √(P_A − P_T)] + l₁ (P_S − P_A) − l₂ P_A
//! Q_B = k_v [K₃ o(−u − d₃) √(P_S − P_B) − K₄ o(u − d₄) √(P_B − P_T)] + l₃ (P_S − P_B) − l₄ P_B
//! o(s) = ½ (√(s² + w²) + s) (1 − c u²)
//! ```
//!
//! Spool u as a share of its stroke, positive: supply to A (Merritt, Hydraulic Control Systems, 1967, §5-1). o(s) rounds each edge off
//! by w, c is what full openings lack, d > 0 is an overlap, l what passes the clearance. P_S drops on its way to the valve with
//! what is drawn.

use super::unknowns::{
    CLEARANCES, DROOP, GAINS, HYSTERESIS, LAG, LAMINAR_PA, LAPS, LEAK_UNIT_M3SPA, PA_PER_BAR, ROUNDING,
    S_PER_MS, SATURATION, SUPPLY, TANK, Unknowns,
};
use nalgebra::SVector;
use pitchleak_core::metering_with_slope;

/// Readings at one instant: x in m, P_A, P_B in Pa, spool as a share of its stroke, P_S in Pa.
pub(super) type Signals = SVector<f64, 5>;
pub(super) const X: usize = 0;
pub(super) const PA: usize = 1;
pub(super) const PB: usize = 2;
pub(super) const SPOOL: usize = 3;
pub(super) const PS: usize = 4;

/// What is known of an instant beside its readings.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub(super) struct Spool {
    /// Of the spool, 1/s.
    #[serde(skip)]
    pub rate_ps: f64,
    /// Where the spool stands within its hysteresis: −1 after it went down, 1 after it went up.
    #[serde(skip)]
    pub play: f64,
    /// Tank pressure as recorded or declared, Pa.
    pub tank_pa: f64,
}

/// A flow into a chamber, and its slopes.
#[derive(Clone, Copy, Debug)]
pub(super) struct Flow {
    pub m3s: f64,
    pub by_signals: Signals,
    pub by_unknowns: Unknowns,
}

/// One edge: a chamber or the supply before it, a chamber or the tank behind it.
struct Edge {
    index: usize,
    /// Into the chamber, or out of it.
    sign: f64,
    /// It opens with this sign of the spool.
    opens: f64,
    chamber: usize,
}

const EDGES: [Edge; 4] = [
    Edge { index: 0, sign: 1.0, opens: 1.0, chamber: PA },
    Edge { index: 1, sign: -1.0, opens: -1.0, chamber: PA },
    Edge { index: 2, sign: 1.0, opens: -1.0, chamber: PB },
    Edge { index: 3, sign: -1.0, opens: 1.0, chamber: PB },
];

impl Edge {
    const fn is_into(&self) -> bool {
        self.sign > 0.0
    }

    fn opening(&self, u: f64, unknowns: &Unknowns) -> Opening {
        let (w, c) = (unknowns[ROUNDING], unknowns[SATURATION]);
        let s = self.opens * u - unknowns[LAPS + self.index];
        let root = (s * s + w * w).sqrt();
        let (open, by_s) = (0.5 * (root + s), 0.5 * (s / root + 1.0));
        let full = 1.0 - c * u * u;
        Opening {
            o: open * full,
            by_u: self.opens * by_s * full - 2.0 * open * c * u,
            by_lap: -by_s * full,
            by_rounding: 0.5 * w / root * full,
            by_saturation: -open * u * u,
        }
    }
}

/// o of an edge, and its slopes by u, d, w and c.
#[derive(Clone, Copy)]
struct Opening {
    o: f64,
    by_u: f64,
    by_lap: f64,
    by_rounding: f64,
    by_saturation: f64,
}

/// The pressure drop over an edge, its root and that one's slope, and what drives the flow over the clearance.
#[derive(Clone, Copy)]
struct PressureDrop {
    root: f64,
    root_slope: f64,
    clearance_pa: f64,
}

/// Flows into A and B; `gain` is k_v, m³/(s·√Pa), and `rated_m3s` what passes a full opening.
pub(super) fn flows(
    at: &Signals,
    spool: &Spool,
    unknowns: &Unknowns,
    gain: f64,
    rated_m3s: f64,
) -> [Flow; 2] {
    let u = at[SPOOL] + unknowns[LAG] * S_PER_MS * spool.rate_ps - unknowns[HYSTERESIS] * spool.play;
    let supply_pa = at[PS] + unknowns[SUPPLY] * PA_PER_BAR;
    let valve = Valve { unknowns, gain, openings: EDGES.each_ref().map(|edge| edge.opening(u, unknowns)) };
    let tank_pa = spool.tank_pa + unknowns[TANK] * PA_PER_BAR;
    let drop_over = |edge: &Edge, supply_pa: f64| {
        let chamber_pa = at[edge.chamber];
        let drop_pa = if edge.is_into() { supply_pa - chamber_pa } else { chamber_pa - tank_pa };
        let (root, root_slope) = metering_with_slope(drop_pa, LAMINAR_PA);
        // To the tank as to the outside: where its pressure is found anew at each look, the two would seem to differ.
        PressureDrop { root, root_slope, clearance_pa: if edge.is_into() { drop_pa } else { chamber_pa } }
    };
    let mut drops = EDGES.each_ref().map(|edge| drop_over(edge, supply_pa));
    // What is drawn is hardly less for its own droop.
    let taken_m3s = |chamber: usize| {
        let own = EDGES.iter().zip(&drops).filter(|(edge, _)| edge.chamber == chamber);
        own.map(|(edge, drop)| valve.flow_m3s(edge, drop)).sum::<f64>().max(0.0)
    };
    let drawn = (taken_m3s(PA) + taken_m3s(PB)) / rated_m3s;
    let drooped_pa = supply_pa - unknowns[DROOP] * drawn * PA_PER_BAR;
    let mut flows = [Flow { m3s: 0.0, by_signals: Signals::zeros(), by_unknowns: Unknowns::zeros() }; 2];
    for (edge, drop) in EDGES.iter().zip(&mut drops) {
        if edge.is_into() {
            *drop = drop_over(edge, drooped_pa);
        }
        valve.add(edge, drop, spool, drawn, &mut flows[edge.chamber - PA]);
    }
    flows
}

/// The valve as its spool stands.
struct Valve<'a> {
    unknowns: &'a Unknowns,
    gain: f64,
    openings: [Opening; 4],
}

impl Valve<'_> {
    fn edge_gain(&self, edge: &Edge) -> f64 {
        edge.sign * self.gain * self.unknowns[GAINS + edge.index]
    }

    fn clearance(&self, edge: &Edge) -> f64 {
        edge.sign * self.unknowns[CLEARANCES + edge.index] * LEAK_UNIT_M3SPA
    }

    /// Into the edge's chamber.
    fn flow_m3s(&self, edge: &Edge, drop: &PressureDrop) -> f64 {
        let opening = &self.openings[edge.index];
        self.edge_gain(edge) * opening.o * drop.root + self.clearance(edge) * drop.clearance_pa
    }

    fn add(&self, edge: &Edge, drop: &PressureDrop, spool: &Spool, drawn: f64, flow: &mut Flow) {
        let (opening, edge_gain) = (&self.openings[edge.index], self.edge_gain(edge));
        flow.m3s += self.flow_m3s(edge, drop);
        let by_drop = edge_gain * opening.o * drop.root_slope;
        let by_spool = edge_gain * opening.by_u * drop.root;
        flow.by_signals[SPOOL] += by_spool;
        flow.by_unknowns[LAG] += by_spool * spool.rate_ps * S_PER_MS;
        flow.by_unknowns[HYSTERESIS] -= by_spool * spool.play;
        if edge.is_into() {
            let by_supply = by_drop + self.clearance(edge);
            flow.by_signals[PS] += by_supply;
            flow.by_signals[edge.chamber] -= by_supply;
            flow.by_unknowns[SUPPLY] += by_supply * PA_PER_BAR;
            flow.by_unknowns[DROOP] -= by_supply * drawn * PA_PER_BAR;
        } else {
            flow.by_signals[edge.chamber] += by_drop + self.clearance(edge);
            flow.by_unknowns[TANK] -= by_drop * PA_PER_BAR;
        }
        flow.by_unknowns[GAINS + edge.index] += edge.sign * self.gain * opening.o * drop.root;
        flow.by_unknowns[LAPS + edge.index] += edge_gain * opening.by_lap * drop.root;
        flow.by_unknowns[ROUNDING] += edge_gain * opening.by_rounding * drop.root;
        flow.by_unknowns[SATURATION] += edge_gain * opening.by_saturation * drop.root;
        flow.by_unknowns[CLEARANCES + edge.index] += edge.sign * LEAK_UNIT_M3SPA * drop.clearance_pa;
    }
}

#[cfg(test)]
mod tests {
    use super::super::unknowns::UNKNOWNS;
    use super::*;

    /// Slopes against differences, at openings of either side and near the middle.
    #[test]
    fn slopes_are_those_of_the_flows() {
        let rated = 4.0 / 60e3;
        let gain = rated / 35e5_f64.sqrt();
        let mut unknowns = Unknowns::from_fn(|at, _| 0.01 * (1.0 + at as f64));
        unknowns.fixed_rows_mut::<4>(GAINS).fill(1.1);
        // Its own second order is left out.
        unknowns[DROOP] = 0.0;
        for u in [-0.6, -0.02, 0.0, 0.015, 0.4] {
            let at = Signals::from([0.1, 52e5, 31e5, u, 98e5]);
            let spool = Spool { rate_ps: 0.7, play: 0.3, tank_pa: 2e5 };
            let flows_at = flows(&at, &spool, &unknowns, gain, rated);
            let check = |slope: f64, [low, high]: [f64; 2], step: f64, what: usize| {
                let difference = (high - low) / (2.0 * step);
                assert!(
                    (slope - difference).abs() <= 1e-5 * difference.abs().max(1e-12),
                    "{what} at {u}: {slope} {difference}"
                );
            };
            for (chamber, flow) in flows_at.iter().enumerate() {
                for (signal, step) in [1e-4, 10.0, 10.0, 1e-6, 10.0].into_iter().enumerate() {
                    let moved = [-step, step].map(|step| {
                        let mut moved = at;
                        moved[signal] += step;
                        flows(&moved, &spool, &unknowns, gain, rated)[chamber].m3s
                    });
                    check(flow.by_signals[signal], moved, step, signal);
                }
                for unknown in GAINS..UNKNOWNS {
                    let moved = [-1e-6, 1e-6].map(|step| {
                        let mut moved = unknowns;
                        moved[unknown] += step;
                        flows(&at, &spool, &moved, gain, rated)[chamber].m3s
                    });
                    check(flow.by_unknowns[unknown], moved, 1e-6, 100 + unknown);
                }
            }
        }
    }
}
