use crate::report::Episode;
use crate::units::LPM_PER_M3S;
use pitchleak_core::{Leak, PerLeak};

/// Ended episodes that are kept where others are forgotten: enough to tell whether each leak comes and goes.
const KEPT: usize = 64;

/// The times in which an alarm stood, with what was estimated meanwhile.
#[derive(Clone, Debug, Default, serde::Serialize, serde::Deserialize)]
pub(super) struct Episodes {
    ended: Vec<Episode>,
    open: PerLeak<Option<Open>>,
}

/// An episode that goes on.
#[derive(Clone, Copy, Debug, serde::Serialize, serde::Deserialize)]
struct Open {
    from_s: f64,
    time_s: f64,
    leaked_lpm_s: f64,
    peak_lpm: f64,
}

impl Open {
    fn episode(&self, fault: Leak, to_s: Option<f64>) -> Episode {
        let mean_lpm = if self.time_s > 0.0 { self.leaked_lpm_s / self.time_s } else { self.peak_lpm };
        Episode { fault, from_s: self.from_s, to_s, mean_lpm, peak_lpm: self.peak_lpm }
    }
}

impl Episodes {
    /// Takes the leak flows as estimated at `t_s`, `elapsed_s` of watched time after those before, each with the one below
    /// which the leak is gone (an alarm stands until that is sure), m³/s, and which alarms stand.
    pub fn add(&mut self, t_s: f64, elapsed_s: f64, flows_m3s: PerLeak<(f64, f64)>, active: &PerLeak<bool>) {
        for (fault, (flow_m3s, gone_m3s)) in flows_m3s {
            let open = &mut self.open[fault];
            if !active[fault] {
                self.ended.extend(open.take().map(|open| open.episode(fault, Some(t_s))));
                continue;
            }
            let flow_lpm = flow_m3s * LPM_PER_M3S;
            let begun = Open { from_s: t_s, time_s: 0.0, leaked_lpm_s: 0.0, peak_lpm: flow_lpm };
            let open = open.get_or_insert(begun);
            if flow_m3s >= gone_m3s {
                open.time_s += elapsed_s;
                open.leaked_lpm_s += flow_lpm * elapsed_s;
            }
            open.peak_lpm = open.peak_lpm.max(flow_lpm);
        }
    }

    /// Takes back the one of this leak that goes on.
    pub fn withdraw(&mut self, fault: Leak) {
        self.open[fault] = None;
    }

    /// Drops all but the last.
    pub fn forget(&mut self) {
        let beyond = self.ended.len().saturating_sub(KEPT);
        self.ended.drain(..beyond);
    }

    /// Those of which an alarm was told, in the order of their beginnings; `standing` are told and go on.
    pub fn list(&self, standing: &PerLeak<bool>) -> Vec<Episode> {
        let open = self.open.iter().filter(|(fault, _)| standing[*fault]);
        let open = open.filter_map(|(fault, open)| Some(open.as_ref()?.episode(fault, None)));
        let mut all: Vec<Episode> = self.ended.iter().copied().chain(open).collect();
        all.sort_by(|a, b| a.from_s.total_cmp(&b.from_s));
        all
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_estimated_until_the_alarm_was_cleared_makes_no_leak_smaller() {
        let mut episodes = Episodes::default();
        let active = PerLeak { internal: true, ..PerLeak::default() };
        for (t_s, lpm) in [(1.0, 0.4), (2.0, 0.2), (3.0, 0.04), (4.0, -4.0)] {
            let flow = (lpm / LPM_PER_M3S, 0.05 / LPM_PER_M3S);
            episodes.add(t_s, 1.0, PerLeak { internal: flow, ..PerLeak::default() }, &active);
        }
        assert!((episodes.list(&active)[0].mean_lpm - 0.3).abs() < 1e-12);
    }

    #[test]
    fn a_leak_that_comes_and_goes_for_years_takes_no_more_memory() {
        let mut episodes = Episodes::default();
        for k in 0..10_000 {
            let active = PerLeak { internal: k % 2 == 0, ..PerLeak::default() };
            episodes.add(f64::from(k), 1.0, PerLeak::default(), &active);
            episodes.forget();
        }
        let list = episodes.list(&PerLeak::default());
        assert_eq!((list.len(), list.last().map(|last| last.from_s)), (KEPT, Some(9998.0)));
    }
}
