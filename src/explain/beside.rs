//! What is [told](crate::told) beside the statistic, of the table's mistakes.

use super::readings::{Mistake, Of};
use crate::rig::Rig;
use crate::signal::Signal;
use crate::told::{CHANNELS, Told};
use pitchleak_core::ATMOSPHERE_PA;

/// Readings reach at the most so many times full scale. Chosen.
const MOST_OF_FULL_SCALE: f64 = 1.5;
/// Where a position may be, shares of the stroke: a little beyond its ends. Chosen.
const WITHIN_CYLINDER: [f64; 2] = [-0.05, 1.05];

/// A flow that changes by fewer standard deviations of its meter's noise says nothing. Chosen.
const LEAST_RANGE: f64 = 2.0;

/// Means of a constant differ by less.
const ROUNDING: f64 = 1e-12;

impl Told {
    /// ln by which the odds of a mistake change.
    pub(super) fn ln_odds(&self, mistake: Mistake) -> f64 {
        let ratio = |by: [f64; 2], exchanged| self.force.map_or(0.0, |force| force.ln_ratio(by, exchanged));
        match mistake {
            Mistake::PressuresExchanged | Mistake::ChambersExchanged => ratio([1.0; 2], true),
            Mistake::Factor(Of::PressureA, factor) => ratio([1.0 / factor, 1.0], false),
            Mistake::Factor(Of::PressureB, factor) => ratio([1.0, 1.0 / factor], false),
            Mistake::Factor(Of::Pressures, factor) => ratio([1.0 / factor; 2], false),
            _ => 0.0,
        }
    }

    /// Whether the readings could be so on this rig: mended, they lie within its sensors' ranges. What never changes tells of
    /// no mistake: it may as well be stuck. Nor does a flow that once mended is no more than its meter's noise: it may as well be anything
    /// that the other readings know nothing of.
    pub(super) fn allows(&self, mistake: Mistake, rig: &Rig) -> bool {
        if mistake.sensors().iter().any(|sensor| self.is_constant(*sensor)) {
            return false;
        }
        match mistake {
            Mistake::Factor(of, factor) => of.channels().all(|channel| {
                let mended = self.extremes[channel].map(|extremes| extremes.map(|value| value / factor));
                mended.is_none_or(|mended| {
                    allows(channel, mended, rig) && !(factor > 1.0 && is_noise(channel, mended, rig))
                })
            }),
            Mistake::LostSign(_) => false,
            _ => true,
        }
    }

    /// By how much of the stroke the position's zero may be off, at the least and the most, for the piston to be within it.
    pub(super) fn position_zero(&self, stroke_m: f64) -> [f64; 2] {
        let [least, most] = self.extremes[0].unwrap_or_default().map(|x_m| x_m / stroke_m);
        [WITHIN_CYLINDER[0] - least, WITHIN_CYLINDER[1] - most]
    }

    fn is_constant(&self, sensor: Signal) -> bool {
        let extremes = channel(sensor).and_then(|channel| self.extremes[channel]);
        extremes.is_some_and(|[least, most]| most - least <= ROUNDING * least.abs().max(most.abs()))
    }

    /// The flows that lost their signs, and the ln likelihood ratio of that: a flow that is never negative while the piston moves
    /// both ways has lost it, too, where the other one has.
    pub(super) fn lost_sign(&self) -> Option<(Of, f64)> {
        let (of, ln_ratio) = match self.signs.map(|sign| sign.ln_lost) {
            [Some(a), Some(b)] => (Of::Flows, a.max(b)),
            [Some(a), None] => (Of::FlowA, a),
            [None, Some(b)] => (Of::FlowB, b),
            [None, None] => return None,
        };
        (ln_ratio > 0.0).then_some((of, ln_ratio))
    }

    /// Whether these flows were never negative: of such one that seems to count the other way may have lost its sign.
    pub(super) fn is_unsigned(&self, of: Of) -> bool {
        let [a, b] = self.signs.map(|sign| sign.is_unsigned);
        match of {
            Of::FlowA => a,
            Of::FlowB => b,
            Of::Flows => a && b,
            _ => false,
        }
    }
}

fn allows(channel: usize, [least, most]: [f64; 2], rig: &Rig) -> bool {
    let sheets = &rig.instruments;
    let flow = |full_scale: f64| [-MOST_OF_FULL_SCALE * full_scale, MOST_OF_FULL_SCALE * full_scale];
    let stroke_m = rig.cylinder.stroke_m;
    let range = match channel {
        0 => WITHIN_CYLINDER.map(|share| share * stroke_m),
        1 | 2 => [-ATMOSPHERE_PA, MOST_OF_FULL_SCALE * sheets.pressure.full_scale],
        3 => flow(sheets.flow_a.full_scale),
        _ => flow(sheets.flow_b.full_scale),
    };
    range[0] <= least && most <= range[1]
}

/// Whether a flow changes by no more than its meter's noise.
fn is_noise(channel: usize, [least, most]: [f64; 2], rig: &Rig) -> bool {
    let sensors = rig.sensors();
    let noise_std = match channel {
        3 => sensors.flow_a.noise_std,
        4 => sensors.flow_b.noise_std,
        _ => return false,
    };
    most - least < LEAST_RANGE * noise_std
}

impl Of {
    /// Their places among x, P_A, P_B, Q_A and Q_B.
    pub(super) fn channels(self) -> impl Iterator<Item = usize> {
        self.sensors().iter().filter_map(|sensor| channel(*sensor))
    }
}

fn channel(sensor: Signal) -> Option<usize> {
    CHANNELS.iter().position(|own| *own == sensor)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn told(channel: usize, extremes: [f64; 2]) -> Told {
        let mut told = Told::default();
        told.extremes[channel] = Some(extremes);
        told
    }

    /// Neither one that is mended by a factor nor one that counts the other way.
    #[test]
    fn what_never_changes_tells_of_no_mistake() {
        let rig = Rig::paper();
        for value in [3e-5, -3e-5] {
            let allows = |most: f64, mistake: Mistake| {
                let [a, b] = [value, value * most];
                told(3, [a.min(b), a.max(b)]).allows(mistake, &rig)
            };
            for mistake in
                [Mistake::Sign(Of::FlowA), Mistake::FlowsExchanged, Mistake::Factor(Of::FlowA, 0.9)]
            {
                assert!(!allows(1.0, mistake) && !allows(1.0 + 1e-14, mistake));
                assert!(allows(1.5, mistake));
            }
            assert!(allows(1.0, Mistake::Sign(Of::FlowB)));
        }
    }

    /// Once mended a reading lies in its sensor's range, and a flow that was read too large is more than its
    /// noise.
    #[test]
    fn mended_readings_lie_within_their_sensors() {
        let rig = Rig::paper();
        let stroke_m = rig.cylinder.stroke_m;
        let (full_pa, full_m3s) = (rig.instruments.pressure.full_scale, rig.instruments.flow_b.full_scale);
        let noise_m3s = rig.sensors().flow_b.noise_std;
        let allows = |channel: usize, extremes: [f64; 2], of: Of, factor: f64| {
            told(channel, extremes).allows(Mistake::Factor(of, factor), &rig)
        };
        assert!(allows(0, [0.0, 4.0 * stroke_m], Of::Position, 4.0));
        assert!(!allows(0, [0.0, 4.4 * stroke_m], Of::Position, 4.0));
        assert!(!allows(0, [-0.4 * stroke_m, stroke_m], Of::Position, 4.0));
        assert!(allows(1, [0.0, 0.7 * full_pa], Of::PressureA, 0.5));
        assert!(!allows(2, [0.0, 0.8 * full_pa], Of::Pressures, 0.5));
        assert!(!allows(1, [-2.0 * ATMOSPHERE_PA, full_pa], Of::PressureA, 1.5));
        assert!(allows(4, [-0.7 * full_m3s, 0.7 * full_m3s], Of::FlowB, 0.5));
        assert!(!allows(4, [-0.8 * full_m3s, 0.7 * full_m3s], Of::FlowB, 0.5));
        assert!(!allows(4, [-3.0 * noise_m3s, 3.0 * noise_m3s], Of::FlowB, 10.0));
        assert!(allows(4, [-30.0 * noise_m3s, 30.0 * noise_m3s], Of::FlowB, 10.0));
        assert!(allows(4, [0.0, noise_m3s], Of::FlowB, 0.1));
    }

    #[test]
    fn the_zero_of_a_position_keeps_the_piston_within_its_cylinder() {
        let [least, most] = told(0, [0.1, 0.3]).position_zero(0.2);
        assert!((least - -0.55).abs() < 1e-12 && (most - -0.45).abs() < 1e-12, "{least} {most}");
    }
}
