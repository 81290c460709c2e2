//! Where in its meter's dead band a flow lies while the meter shows nothing. The reading says when it enters and leaves the band, and by which
//! edge; how it goes on in between another sensor shows, or nothing does.

use super::play::{ANYWHERE, Sides};
use crate::diagnose::thresholds::SIGNIFICANT_SIGMA;
use std::ops::Range;

/// A flow that goes as the one in question does, but for leaks and storage, which are small or slow.
pub(super) struct Beside {
    pub(super) flow_m3s: Vec<f64>,
    /// Standard deviation of its noise.
    pub(super) std_m3s: f64,
}

/// Where a flow lies between the edges of its band, −1 to 1: by the straight way from the edge by which it entered to the one by which it
/// left, and what another flow `beside` departs from its own straight way meanwhile. Zero while the reading shows something. Flows are without
/// single outliers.
pub(super) fn within_band(t_s: &[f64], flow_m3s: &[f64], noise_std: f64, beside: &[Beside]) -> Sides {
    let is_silent = |flow: f64, std: f64| flow.abs() < SIGNIFICANT_SIGMA * std;
    let rests = rests(flow_m3s, |flow| is_silent(flow, noise_std));
    let anywhere = |flow: &f64| if is_silent(*flow, noise_std) { ANYWHERE } else { 0.0 };
    let mut own =
        Sides { side: vec![0.0; flow_m3s.len()], side_std: flow_m3s.iter().map(anywhere).collect() };
    let Some(band_m3s) = least_shown(flow_m3s, &rests) else { return own };
    for rest in rests {
        // One that is silent itself shows nothing.
        let shows = |other: &&Beside| {
            let silent = rest.clone().filter(|at| is_silent(other.flow_m3s[*at], other.std_m3s)).count();
            2 * silent <= rest.len() && rest.clone().all(|at| other.flow_m3s[at].is_finite())
        };
        let other = beside.iter().find(shows).filter(|other| other.std_m3s < ANYWHERE * band_m3s);
        let (first, last) = (rest.start - 1, rest.end);
        let edges = (flow_m3s[first].signum(), flow_m3s[last].signum());
        let std = other.map_or(ANYWHERE, |other| other.std_m3s / band_m3s);
        let shape = other.map(|other| (other.flow_m3s.as_slice(), band_m3s));
        for at in rest {
            own.side[at] = bridge(at, (first, last), edges, t_s, shape);
            own.side_std[at] = std;
        }
    }
    own
}

/// Where what goes from one place to another between two samples is at one of them: the straight way in time, and what `other` departs from
/// its own straight way meanwhile, in so many units of that to one of this; −1 to 1.
fn bridge(
    at: usize,
    (first, last): (usize, usize),
    (from, to): (f64, f64),
    t_s: &[f64],
    other: Option<(&[f64], f64)>,
) -> f64 {
    let share = (t_s[at] - t_s[first]) / (t_s[last] - t_s[first]);
    let straight = |from: f64, to: f64| from + (to - from) * share;
    let bent =
        other.map_or(0.0, |(values, unit)| (values[at] - straight(values[first], values[last])) / unit);
    (straight(from, to) + bent).clamp(-1.0, 1.0)
}

/// Ranges in which a reading is silent, between samples that show something.
fn rests(flow_m3s: &[f64], is_silent: impl Fn(f64) -> bool) -> Vec<Range<usize>> {
    let (mut found, mut shown) = (vec![], None);
    for (at, flow) in flow_m3s.iter().enumerate() {
        if is_silent(*flow) {
            continue;
        }
        if let Some(before) = shown.filter(|before| before + 1 < at && flow.is_finite()) {
            found.push(before + 1..at);
        }
        shown = flow.is_finite().then_some(at);
    }
    found
}

/// Without single outliers, and with edges where they are.
pub(super) fn median_of_three(values: &[f64]) -> Vec<f64> {
    let of = |at: usize| {
        let (before, own) = (values[at.saturating_sub(1)], values[at]);
        let after = values[(at + 1).min(values.len() - 1)];
        if before.is_finite() && after.is_finite() {
            own.max(before.min(after)).min(before.max(after))
        } else {
            own
        }
    };
    (0..values.len()).map(of).collect()
}

/// What a meter shows when it begins and ceases to show something: the median over all rests.
fn least_shown(flow_m3s: &[f64], rests: &[Range<usize>]) -> Option<f64> {
    let ends = rests.iter().flat_map(|rest| [flow_m3s[rest.start - 1], flow_m3s[rest.end]]);
    let mut shown: Vec<f64> = ends.map(f64::abs).filter(|flow| flow.is_finite()).collect();
    let middle = shown.len() / 2;
    (!shown.is_empty()).then(|| *shown.select_nth_unstable_by(middle, f64::total_cmp).1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use pitchleak_testkit::white_noise;

    const BAND_M3S: f64 = 5e-6;
    const NOISE_M3S: f64 = 1e-7;

    /// A minute at 100 Hz: times, the true flow, and what a meter with a dead band shows of it.
    fn shown() -> (Vec<f64>, Vec<f64>, Vec<f64>) {
        let times = (0..6000_u32).map(|k| 0.01 * f64::from(k));
        let each = times.zip(white_noise(5)).map(|(t, noise)| {
            let flow = 6e-6 * ((0.7 * t).sin() + 0.6 * (2.3 * t).sin());
            let read = if flow.abs() < BAND_M3S { 0.0 } else { flow };
            (t, (flow, read + NOISE_M3S * noise))
        });
        let (t, (flow, read)): (Vec<_>, (Vec<_>, Vec<_>)) = each.unzip();
        (t, flow, median_of_three(&read))
    }

    /// Root mean square of what the places in the band are off by, within it.
    fn error(own: &Sides, flow: &[f64]) -> f64 {
        let within = flow.iter().zip(&own.side).filter(|(flow, _)| flow.abs() < BAND_M3S);
        let squares: Vec<f64> = within.map(|(flow, side)| (side - flow / BAND_M3S).powi(2)).collect();
        (squares.iter().sum::<f64>() / squares.len() as f64).sqrt()
    }

    #[test]
    fn another_flow_shows_how_the_silent_one_goes_on_and_its_own_offset_does_not_matter() {
        let (t, flow, read) = shown();
        let like = |std_m3s: f64| Beside { flow_m3s: flow.iter().map(|q| q + 3e-6).collect(), std_m3s };
        let seen = within_band(&t, &read, NOISE_M3S, &[like(NOISE_M3S)]);
        let unseen = within_band(&t, &read, NOISE_M3S, &[]);
        assert!(error(&seen, &flow) < 0.1, "{}", error(&seen, &flow));
        assert!(error(&unseen, &flow) < ANYWHERE, "{}", error(&unseen, &flow));
        // One noisier than the band is wide, or silent itself, is not asked.
        let silent = Beside { flow_m3s: vec![0.0; t.len()], std_m3s: NOISE_M3S };
        for useless in [like(BAND_M3S), silent] {
            assert_eq!(within_band(&t, &read, NOISE_M3S, &[useless]).side, unseen.side);
        }
    }

    #[test]
    fn what_is_shown_is_known_and_what_is_not_is_as_uncertain_as_the_other_flow() {
        let (t, flow, mut read) = shown();
        read[1000] = f64::NAN;
        let beside = Beside { flow_m3s: flow.clone(), std_m3s: NOISE_M3S };
        let own = within_band(&t, &read, NOISE_M3S, &[beside]);
        let least = SIGNIFICANT_SIGMA * NOISE_M3S;
        for (read, (side, std)) in read.iter().zip(own.side.iter().zip(&own.side_std)) {
            let is_known = read.is_nan() || read.abs() >= least;
            assert_eq!(is_known, *std == 0.0, "{read} {std}");
            assert!(side.abs() <= 1.0 && (!is_known || *side == 0.0), "{read} {side}");
        }
    }
}
