//! A chamber pressure that is not measured: the equations of its own chamber tell it, and what noise leaves of it makes the leaks wider.
//!
//! Its readings have a spread so wide that they say nothing, and lie where the valve as it was known brings the pressure, one implicit
//! step after the other (Hairer, Wanner 1996, "Solving Ordinary Differential Equations II", ch. IV.3): near enough to make the
//! equations linear there.

use super::edges::{PA, PB, PS, Signals, X, flows};
use super::equations::{Known, Node};
use super::unknowns::{KAPPA, Unknowns};

/// Spread of a pressure that is not measured, Pa. A tenth of it at each reading would claim to know the mean of thousands.
const UNREAD_STD_PA: f64 = 1e9;
/// A chamber's pressure is below this multiple of the supply's (chosen).
const MOST_OF_SUPPLY: f64 = 1.5;
/// So often is that range halved: to 1 kPa.
const HALVINGS: usize = 14;

/// The chamber whose pressure is not among these signals.
pub(super) fn chamber(signals: &Signals) -> Option<usize> {
    [PA, PB].into_iter().find(|chamber| signals[*chamber].is_nan())
}

impl Known {
    /// The same where the pressure of `chamber` is not measured.
    pub fn without(mut self, chamber: usize) -> Self {
        self.variances[chamber] = UNREAD_STD_PA * UNREAD_STD_PA;
        Self { told: 1.0, ..self }
    }
}

/// Keeps a pressure that is not measured where pressures are: the equations are made linear there.
pub(super) fn bound(chamber: usize, signals: &mut Signals) {
    signals[chamber] = signals[chamber].clamp(0.0, MOST_OF_SUPPLY * signals[PS].max(0.0));
}

/// Where the pressure of `chamber` goes by the other signals.
pub(super) fn course(chamber: usize, nodes: &mut [Node], unknowns: &Unknowns, known: &Known) {
    let Some(first) = nodes.first_mut() else { return };
    first.signals[chamber] = 0.5 * first.signals[PS];
    for index in 1..nodes.len() {
        let (from, mut to) = (nodes[index - 1].signals, nodes[index]);
        let step_s = to.t_s - nodes[index - 1].t_s;
        let (swept_m3, volume_m3) = swept(chamber, [from[X], to.signals[X]], known);
        let elastic = unknowns[KAPPA] * known.kappa_ppa * volume_m3;
        let mut missing = |pressure_pa: f64| {
            to.signals[chamber] = pressure_pa;
            let flow = flows(&to.signals, &to.spool, unknowns, known.gain, known.rated_m3s)[chamber - PA];
            swept_m3 + elastic * (pressure_pa - from[chamber]) - step_s * flow.m3s
        };
        let (mut least, mut most) = (0.0, MOST_OF_SUPPLY * from[PS]);
        for _ in 0..HALVINGS {
            let middle = 0.5 * (least + most);
            if missing(middle) > 0.0 { most = middle } else { least = middle }
        }
        nodes[index].signals[chamber] = 0.5 * (least + most);
    }
}

/// What the piston sweeps of a chamber between two places, and the chamber's volume, m³.
fn swept(chamber: usize, [from_m, to_m]: [f64; 2], known: &Known) -> (f64, f64) {
    let cylinder = &known.cylinder;
    match chamber {
        PA => (cylinder.area_a_m2 * (to_m - from_m), cylinder.volume_a_m3(to_m)),
        _ => (-cylinder.area_b_m2 * (to_m - from_m), cylinder.volume_b_m3(to_m)),
    }
}
