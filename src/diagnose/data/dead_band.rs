//! Where in its meter's dead band a flow lies while the meter shows nothing. The reading says when it enters and leaves the band, and by which
//! edge; how it goes on in between another sensor shows, or nothing does.

use super::play::{ANYWHERE, Sides};
use crate::diagnose::thresholds::{SAMPLES_PER_BLOCK, SIGNIFICANT_SIGMA};
use std::ops::Range;

/// What another sensor says of the flow in question, by the model.
pub(super) struct Beside<'f> {
    /// At a sample, m³/s, but for what changes slowly or little.
    pub(super) flow_m3s: &'f dyn Fn(usize) -> f64,
    /// Whether that sensor shows nothing at a sample.
    pub(super) is_silent: &'f dyn Fn(usize) -> bool,
    /// Standard deviation of its noise.
    pub(super) std_m3s: &'f dyn Fn() -> f64,
}

/// What a meter shows along a trace.
pub(super) struct Shown<'t> {
    pub(super) t_s: &'t [f64],
    pub(super) flow_m3s: &'t [f64],
    /// The same without single outliers: it tells what is silent. At an edge it is the smaller of two, which noise makes too small.
    pub(super) calm_m3s: &'t [f64],
    pub(super) noise_std_m3s: f64,
    /// Samples of which each is the mean: some of them may have been hidden.
    pub(super) mean_of: usize,
}

/// Samples on each side of a rest that say what another sensor's flow is off by there: half a block's.
const NEAR: usize = SAMPLES_PER_BLOCK / 2;

/// Where in its meter's dead band a flow lies, in half widths of it: as `beside` foresees it, moved to what the meter showed last and shows next,
/// or the straight way between these. Zero while the reading shows something.
pub(super) fn within_band(meter: &Shown, beside: &[Beside]) -> Sides {
    let anywhere = |at| if meter.is_silent(at) { ANYWHERE } else { 0.0 };
    let count = meter.flow_m3s.len();
    let mut own = Sides { side: vec![0.0; count], side_std: (0..count).map(anywhere).collect() };
    let rests = meter.rests();
    let Some(band_m3s) = meter.least_shown(&rests) else { return own };
    let beside = beside.iter().map(|other| (other, (other.std_m3s)()));
    let beside: Vec<_> = beside.filter(|(_, std_m3s)| *std_m3s < ANYWHERE * band_m3s).collect();
    for rest in rests {
        let shows = |(other, _): &&(&Beside, f64)| {
            let silent = rest.clone().filter(|at| (other.is_silent)(*at)).count();
            2 * silent <= rest.len() && rest.clone().all(|at| (other.flow_m3s)(at).is_finite())
        };
        let other = beside.iter().find(shows);
        let foreseen = |at: usize| other.map_or(0.0, |(other, _)| (other.flow_m3s)(at));
        let near = if other.is_some() { NEAR } else { 1 };
        let off = |shown: &mut dyn Iterator<Item = usize>| {
            let (sum, count) = shown
                .take(near)
                .take_while(|at| meter.shows(*at))
                .fold((0.0, 0.0), |(sum, n), at| (sum + meter.flow_m3s[at] - foreseen(at), n + 1.0));
            sum / count
        };
        let (first, last) = (rest.start - 1, rest.end);
        let (before, after) = (off(&mut (0..=first).rev()), off(&mut (last..count)));
        let std = other.map_or(ANYWHERE, |(_, std_m3s)| std_m3s / band_m3s);
        for at in rest {
            let share = (meter.t_s[at] - meter.t_s[first]) / (meter.t_s[last] - meter.t_s[first]);
            let flow = foreseen(at) + before + (after - before) * share;
            let shown = if meter.is_silent(at) { 0.0 } else { meter.flow_m3s[at] };
            own.side[at] = ((flow - shown) / band_m3s).clamp(-1.0, 1.0);
            own.side_std[at] = std;
        }
    }
    own
}

impl Shown<'_> {
    fn is_silent(&self, at: usize) -> bool {
        is_silent(self.calm_m3s[at], self.noise_std_m3s)
    }

    /// Whether some of what flows at a sample may be hidden.
    fn hides(&self, at: usize) -> bool {
        let near = |other: usize| other < self.flow_m3s.len() && self.is_silent(other);
        let is_edge = || self.mean_of > 1 && (near(at.wrapping_sub(1)) || near(at + 1));
        self.is_silent(at) || (self.flow_m3s[at].is_finite() && is_edge())
    }

    fn shows(&self, at: usize) -> bool {
        self.flow_m3s[at].is_finite() && !self.hides(at)
    }

    /// Ranges in which some of the flow may be hidden, between samples that show all of it.
    fn rests(&self) -> Vec<Range<usize>> {
        let (mut found, mut shown) = (vec![], None);
        for at in (0..self.flow_m3s.len()).filter(|at| !self.hides(*at)) {
            let is_there = self.shows(at);
            if let Some(before) = shown.filter(|before| before + 1 < at && is_there) {
                found.push(before + 1..at);
            }
            shown = is_there.then_some(at);
        }
        found
    }

    /// What flows where the meter begins and ceases to show it: the median over all rests. Between samples that is half a sample before the
    /// first that is shown; where each is a mean, the first that hides nothing is one that follows a sample that hides a part, or may do so.
    fn least_shown(&self, rests: &[Range<usize>]) -> Option<f64> {
        let samples = if self.mean_of > 1 { 1.0 + 0.5 / self.mean_of as f64 } else { 0.5 };
        let edge = |at: usize, beyond: Option<usize>| {
            let own = self.flow_m3s[at].abs();
            let next = beyond.and_then(|beyond| self.flow_m3s.get(beyond)).map_or(own, |next| next.abs());
            own - samples * (next - own)
        };
        let ends = rests.iter().flat_map(|rest| {
            let (first, last) = (rest.start - 1, rest.end);
            [edge(first, first.checked_sub(1)), edge(last, Some(last + 1))]
        });
        let mut shown: Vec<f64> = ends.filter(|flow| flow.is_finite()).collect();
        let middle = shown.len() / 2;
        let median = (!shown.is_empty()).then(|| *shown.select_nth_unstable_by(middle, f64::total_cmp).1);
        median.filter(|flow| *flow > 0.0)
    }
}

/// Whether a flow is no more than noise of this standard deviation.
pub(super) fn is_silent(flow: f64, std: f64) -> bool {
    flow.abs() < SIGNIFICANT_SIGMA * std
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

    fn shown_by<'t>(t_s: &'t [f64], flow_m3s: &'t [f64]) -> Shown<'t> {
        Shown { t_s, flow_m3s, calm_m3s: flow_m3s, noise_std_m3s: NOISE_M3S, mean_of: 1 }
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
        let shifted = |at: usize| flow[at] + 3e-6;
        let like = |std_m3s| Beside { flow_m3s: &shifted, is_silent: &|_| false, std_m3s };
        let seen = within_band(&shown_by(&t, &read), &[like(&|| NOISE_M3S)]);
        let unseen = within_band(&shown_by(&t, &read), &[]);
        assert!(error(&seen, &flow) < 0.1, "{}", error(&seen, &flow));
        assert!(error(&unseen, &flow) < ANYWHERE, "{}", error(&unseen, &flow));
        // One noisier than the band is wide, or silent itself, is not asked.
        let silent = Beside { flow_m3s: &|_| 0.0, is_silent: &|_| true, std_m3s: &|| NOISE_M3S };
        for useless in [like(&|| BAND_M3S), silent] {
            assert_eq!(within_band(&shown_by(&t, &read), &[useless]).side, unseen.side);
        }
    }

    #[test]
    fn what_is_shown_is_known_and_what_is_not_is_as_uncertain_as_the_other_flow() {
        let (t, flow, mut read) = shown();
        read[1000] = f64::NAN;
        let beside = Beside { flow_m3s: &|at| flow[at], is_silent: &|_| false, std_m3s: &|| NOISE_M3S };
        let own = within_band(&shown_by(&t, &read), &[beside]);
        let least = SIGNIFICANT_SIGMA * NOISE_M3S;
        for (read, (side, std)) in read.iter().zip(own.side.iter().zip(&own.side_std)) {
            let is_known = read.is_nan() || read.abs() >= least;
            assert_eq!(is_known, *std == 0.0, "{read} {std}");
            assert!(side.abs() <= 1.0 && (!is_known || *side == 0.0), "{read} {side}");
        }
    }
}
