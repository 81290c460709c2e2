//! Once the trace has been read: does something else than leaks explain it?

use super::Replay;
use crate::channels::ChannelFaultKind;
use crate::report::{Status, Suspicions, Verdict};
use crate::rig::ColumnMap;
use crate::trace::Record;
use crate::wiring::{
    Excerpt, Orifice, ZeroCheck, explain, orifice, sensor_error, unit_by_scatter, zero_check,
};
use pitchleak_core::PerLeak;

impl Replay {
    /// What an excerpt of the trace, whose columns were read by `columns`, says against `verdict`.
    pub(super) fn suspicions(&self, verdict: &Verdict, excerpt: &Excerpt, columns: &ColumnMap) -> Suspicions {
        // Where a channel is broken, no wiring explains the trace.
        if self.channel_faults().iter().any(|fault| fault.kind != ChannelFaultKind::Coarse) {
            return Suspicions::default();
        }
        let doubtful = verdict.status == Status::Doubtful;
        let [wiring, sensor] = if doubtful {
            let records = excerpt.records();
            let wiring = explain(&records, &self.rig);
            let sensor = if wiring.is_none() { sensor_error(&records, &self.rig) } else { None };
            [wiring, sensor]
        } else {
            [unit_by_scatter(excerpt, &self.rig), None]
        };
        let orifice = if wiring.is_none() { self.orifice(verdict, excerpt) } else { None };
        let zeros = match orifice {
            _ if self.declares_zeros() => None,
            Some(orifice) => orifice.zeros,
            None if verdict.status == Status::Leak => self.zeros(excerpt),
            None => None,
        };
        let sensor = sensor.filter(|_| orifice.is_none());
        let [wiring, sensor] =
            [wiring, sensor].map(|found| found.map(|found| found.wiring(columns, &self.rig)));
        Suspicions { wiring, sensor, zeros, orifice }
    }

    /// Whether the leaks found pass an orifice, where nothing speaks against them but that they are not as C P.
    fn orifice(&self, verdict: &Verdict, excerpt: &Excerpt) -> Option<Orifice> {
        let only_by_law = verdict.reasons.iter().all(|reason| reason.id.may_be_orifice());
        let doubtful = verdict.status == Status::Doubtful && only_by_law && !verdict.faults.is_empty();
        let leaks = PerLeak::from_fn(|leak| verdict.faults.contains(&leak));
        doubtful.then(|| orifice(&excerpt.records(), &self.rig, leaks))?
    }

    /// Whether the rig file says how far the meters' zeros may be off: the estimates then have them already.
    fn declares_zeros(&self) -> bool {
        let sensors = self.rig.sensors();
        sensors.flow_a.bias_std > 0.0 || sensors.flow_b.bias_std > 0.0
    }

    /// Leaks since they changed last against zeros of the meters.
    fn zeros(&self, excerpt: &Excerpt) -> Option<ZeroCheck> {
        let mut records = excerpt.records();
        let since_s = self.changed_at_s.unwrap_or(f64::NEG_INFINITY);
        records.retain(|record: &Record| record.t_s >= since_s);
        zero_check(&records, &self.rig)
    }
}
