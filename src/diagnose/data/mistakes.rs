//! Mistakes beside which no effect is worth a word: channels that are clipped, stuck or coarse, exchanged wires, signs and units.

use super::declared::Declared;
use super::series::Series;
use crate::channels::{ChannelFault, ChannelFaultKind};
use crate::explain::{Statistic, explain};
use crate::signal::Signal;
use crate::told::Beside;
use crate::wiring::Wiring;
use pitchleak_core::PerLeak;

/// The faults that the channels of these traces show, each kind once per channel.
pub(crate) fn channel_faults(traces: &[Series], declared: &Declared) -> Vec<ChannelFault> {
    let rig = declared.rig();
    let mut found: Vec<ChannelFault> = Vec::new();
    for series in traces {
        for fault in series.channels.faults(&rig) {
            let is_known = found.iter().any(|one| (one.channel, one.kind) == (fault.channel, fault.kind));
            if !is_known && !is_no_flow(series, &fault) {
                found.push(fault);
            }
        }
    }
    found
}

/// A flow that is never less than exactly nothing, or never more, piles up there whenever the piston stands: that is no end of a range.
fn is_no_flow(series: &Series, fault: &ChannelFault) -> bool {
    let flow = [(Signal::FlowA, &series.qa_m3s), (Signal::FlowB, &series.qb_m3s)];
    let own = flow.into_iter().find(|(signal, _)| *signal == fault.channel);
    own.filter(|_| fault.kind == ChannelFaultKind::Clipped).is_some_and(|(_, values)| {
        let least = values.iter().copied().fold(f64::INFINITY, f64::min);
        let most = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        least == 0.0 || most == 0.0
    })
}

/// A mistake that explains the traces.
pub(crate) struct Miswired {
    pub(crate) wiring: Wiring,
    /// No effect could do the same: not so for a pressure's zero or a meter's gain, which sensors have too.
    pub(crate) is_beyond_effects: bool,
}

impl Miswired {
    /// Told of traces that are only judged on.
    pub(crate) fn of_test(self) -> Wiring {
        let suggestion = format!("of the traces that are only judged on: {}", self.wiring.suggestion);
        Wiring { suggestion, ..self.wiring }
    }
}

/// The mistake that explains all of the traces together. None is looked for beside effects that the rig file declares:
/// the plain model, by which mistakes are judged, lacks them.
pub(crate) fn miswired(traces: &[Series], declared: &Declared) -> Option<Miswired> {
    if declared.effects.iter().next().is_some() {
        return None;
    }
    let rig = declared.rig();
    let mut statistic = Box::new(Statistic::new(&rig.cylinder, &rig.fluid, &rig.sensors()));
    let mut evidence = Beside::default();
    for record in traces.iter().flat_map(Series::records) {
        statistic.push(record.step_s(), &record.sample);
        evidence.add(&record, &rig);
    }
    let decision = explain(&statistic, &rig, PerLeak::default(), &evidence.told(&rig))?;
    let columns = traces.first().map(|series| series.columns.clone()).unwrap_or_default();
    let first = decision.explanations.iter().find(|one| one.mistake.is_some())?;
    Some(Miswired {
        wiring: Wiring::of(&decision, &columns, &rig)?,
        is_beyond_effects: !first.id.split('+').any(|part| OF_SENSORS.contains(&part)),
    })
}

/// Mistakes that are an effect of one sensor: its zero, its gain.
const OF_SENSORS: [&str; 7] =
    ["absolute_pressures", "absolute_pa", "absolute_pb", "scale_qa", "scale_qb", "scale_flows", "scale_x"];

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::testing::{declared, sound};
    use pitchleak_core::Sample;

    /// The sound rig's trace with another reading of flow A.
    fn with_flow_a(read: impl Fn(f64) -> f64) -> Vec<ChannelFault> {
        let (full, mut series) = (sound(30), Series::default());
        for at in 0..full.len() {
            let sample = Sample {
                x_m: full.x_m[at],
                pa_pa: full.pa_pa[at],
                pb_pa: full.pb_pa[at],
                qa_m3s: Some(read(full.qa_m3s[at])),
                qb_m3s: Some(full.qb_m3s[at]),
                force_n: None,
            };
            series.push(full.t_s[at], &sample, None);
        }
        channel_faults(&[series], &declared())
    }

    #[test]
    fn a_coarse_meter_fails_by_itself_and_a_sound_one_or_one_without_flow_does_not() {
        let quantum = 30.0 * declared().sensors.flow_a.noise_std;
        let coarse = with_flow_a(|q| (q / quantum).round() * quantum);
        assert!(coarse.iter().any(|fault| fault.channel == Signal::FlowA), "{coarse:?}");
        assert_eq!(with_flow_a(|q| q), []);
        assert_eq!(with_flow_a(|q| q.max(0.0)), []);
    }
}
