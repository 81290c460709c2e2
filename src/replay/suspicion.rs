//! Once the trace has been read: does something else than leaks explain it?

use super::Replay;
use crate::channels::ChannelFaultKind;
use crate::report::{Status, Suspicions, Verdict};
use crate::rig::ColumnMap;
use crate::trace::Record;
use crate::wiring::{
    Excerpt, Explanation, Orifice, ZeroCheck, explain, orifice, sensor_error, unit_by_scatter, zero_check,
};
use pitchleak_core::PerLeak;

impl Replay {
    /// What an excerpt of the trace, whose columns were read by `columns`, says against `verdict`.
    pub(super) fn suspicions(&self, verdict: &Verdict, excerpt: &Excerpt, columns: &ColumnMap) -> Suspicions {
        // Where a channel is broken, no wiring explains the trace.
        if self.channel_faults().iter().any(|fault| fault.kind != ChannelFaultKind::Coarse) {
            return Suspicions::default();
        }
        let zeros_count = !self.declares_zeros();
        let named = |found: Option<Explanation>| found.map(|found| found.wiring(columns, &self.rig));
        if verdict.status != Status::Doubtful {
            let may_be_zeros = zeros_count && verdict.status == Status::Leak;
            return Suspicions {
                wiring: named(unit_by_scatter(excerpt, &self.rig)),
                zeros: if may_be_zeros { self.zeros(excerpt) } else { None },
                ..Suspicions::default()
            };
        }
        let records = excerpt.records();
        let wiring = named(explain(&records, &self.rig));
        if wiring.is_some() {
            return Suspicions { wiring, ..Suspicions::default() };
        }
        if let Some(orifice) = self.orifice(verdict, &records) {
            let zeros = orifice.zeros.filter(|_| zeros_count);
            return Suspicions { zeros, orifice: Some(orifice), ..Suspicions::default() };
        }
        Suspicions { sensor: named(sensor_error(&records, &self.rig)), ..Suspicions::default() }
    }

    /// Whether the leaks found pass an orifice, where nothing speaks against them but that they are not as C P.
    fn orifice(&self, verdict: &Verdict, records: &[Record]) -> Option<Orifice> {
        let only_by_law = verdict.reasons.iter().all(|reason| reason.id.may_be_orifice());
        let leaks = PerLeak::from_fn(|leak| verdict.faults.contains(&leak));
        (only_by_law && !verdict.faults.is_empty()).then(|| orifice(records, &self.rig, leaks))?
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
