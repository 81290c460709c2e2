//! What the mixture of explanations says of one leak.

use super::decision::Belief;
use super::hypothesis::LeakCourse;
use super::leak_sample::Weighed;
use super::pass::Tables;
use super::table::LEAK_SHARE;
use crate::units::LPM_PER_M3S;
use pitchleak_core::Leak;

/// The mixture's distribution of one leak: flows, rising, with weights, and whether they are a leak's; past a sound seal
/// seeps a little.
pub(super) struct Marginal {
    flows: Vec<Flow>,
}

struct Flow {
    m3s: f64,
    weight: f64,
    /// Its weights where before the trace this leak had been as probable as none: this one alone, each, and on its course as on any.
    even_weights: [f64; 3],
    is_leak: bool,
}

impl Marginal {
    pub fn of(weighed: &[Weighed<'_>], tables: &Tables, leak: Leak) -> Self {
        let steady = tables.ln_course(LeakCourse::Constant).exp();
        let of_one = |one: &Weighed<'_>| {
            let leaks = &one.hypothesis.leaks;
            let even = |there: &Option<_>| if there.is_some() { 1.0 - LEAK_SHARE } else { LEAK_SHARE };
            let own = even(&leaks[leak as usize]);
            let of_course =
                leaks[leak as usize].map_or(1.0, |course| steady / tables.ln_course(course).exp());
            let even_odds = [own, leaks.iter().map(even).product(), own * of_course];
            let flow = |(flows, weight): (&[f64; 3], &f64)| Flow {
                m3s: flows[leak as usize],
                weight: weight * one.probability,
                even_weights: even_odds.map(|odds| weight * one.probability * odds),
                is_leak: leaks[leak as usize].is_some(),
            };
            one.leaks_m3s.iter().zip(&one.weights).map(flow).collect::<Vec<_>>()
        };
        let mut flows: Vec<Flow> = weighed.iter().flat_map(of_one).collect();
        flows.sort_by(|a, b| a.m3s.total_cmp(&b.m3s));
        Self { flows }
    }

    fn sum(&self, of: impl Fn(&Flow) -> f64) -> f64 {
        self.flows.iter().map(of).sum()
    }

    pub fn above(&self, threshold_m3s: f64) -> f64 {
        self.sum(|flow| if flow.m3s > threshold_m3s { flow.weight } else { 0.0 }).min(1.0)
    }

    /// The same where before the trace this leak, alone, with the others, or on its course as on any, had been as probable as none,
    /// the largest: that leaks are rare, two of them rarer, and some courses rarest, is no finding of this trace.
    pub fn above_at_even_odds(&self, threshold_m3s: f64) -> f64 {
        let above = |which: usize| {
            let weight = |flow: &Flow| flow.even_weights[which];
            self.sum(|flow| if flow.m3s > threshold_m3s { weight(flow) } else { 0.0 }) / self.sum(weight)
        };
        above(0).max(above(1)).max(above(2))
    }

    fn quantile(&self, probability: f64) -> f64 {
        quantile(self.flows.iter(), probability)
    }

    fn quantile_if_there(&self, probability: f64) -> f64 {
        quantile(self.flows.iter().filter(|flow| flow.is_leak), probability)
    }

    pub fn belief(&self) -> Belief {
        let moment = |power: i32| self.sum(|flow| flow.weight * flow.m3s.powi(power));
        let mean = moment(1);
        let std = (moment(2) - mean * mean).max(0.0).sqrt();
        Belief {
            mean_lpm: LPM_PER_M3S * mean,
            std_lpm: LPM_PER_M3S * std,
            quantiles_lpm: [0.025, 0.5, 0.975].map(|q| LPM_PER_M3S * self.quantile(q)),
            below_lpm: LPM_PER_M3S * self.quantile_if_there(0.975),
        }
    }
}

fn quantile<'a>(flows: impl Iterator<Item = &'a Flow> + Clone, probability: f64) -> f64 {
    let wanted = probability * flows.clone().map(|flow| flow.weight).sum::<f64>();
    let mut below = 0.0;
    let mut last_m3s = 0.0;
    for flow in flows {
        below += flow.weight;
        last_m3s = flow.m3s;
        if below >= wanted {
            break;
        }
    }
    last_m3s
}

#[cfg(test)]
mod tests {
    use super::*;

    fn marginal() -> Marginal {
        let flow = |lpm: f64, weight: f64, even_weights: [f64; 3], is_leak: bool| Flow {
            m3s: lpm / LPM_PER_M3S,
            weight,
            even_weights,
            is_leak,
        };
        let none = [0.1, 0.2, 0.1];
        let flows = vec![
            flow(0.0, 0.5, none, false),
            flow(1.0, 0.25, [0.1, 0.1, 0.1], true),
            flow(3.0, 0.25, [0.1, 0.1, 0.2], true),
        ];
        Marginal { flows }
    }

    #[test]
    fn a_leak_is_believed_by_the_weights_of_its_flows() {
        let marginal = marginal();
        let belief = marginal.belief();
        let is_close =
            |found: f64, expected: f64| assert!((found - expected).abs() < 1e-12, "{found} {expected}");
        is_close(belief.mean_lpm, 1.0);
        is_close(belief.std_lpm, 1.5_f64.sqrt());
        [0.0, 0.0, 3.0]
            .iter()
            .zip(belief.quantiles_lpm)
            .for_each(|(expected, found)| is_close(found, *expected));
        is_close(belief.below_lpm, 3.0);
        is_close(marginal.above(0.5 / LPM_PER_M3S), 0.5);
        is_close(marginal.above(2.0 / LPM_PER_M3S), 0.25);
        is_close(marginal.quantile_if_there(0.4) * LPM_PER_M3S, 1.0);
    }

    #[test]
    fn at_even_odds_the_largest_of_three_counts() {
        is_half(marginal().above_at_even_odds(2.0 / LPM_PER_M3S));
        let mut other = marginal();
        other.flows[2].even_weights = [0.2, 0.1, 0.1];
        is_half(other.above_at_even_odds(2.0 / LPM_PER_M3S));
        other.flows[2].even_weights = [0.1, 0.3, 0.1];
        is_half(other.above_at_even_odds(2.0 / LPM_PER_M3S));
    }

    fn is_half(share: f64) {
        assert!((share - 0.5).abs() < 1e-12, "{share}");
    }
}
