//! Once the trace has been read: does something else than leaks explain it?

use super::Replay;
use crate::channels::ChannelFaultKind;
use crate::report::{Status, Suspicions, Verdict};
use crate::rig::ColumnMap;
use crate::trace::Record;
use crate::wiring::{Excerpt, ZeroCheck, explain, sensor_error, unit_by_scatter, zero_check};

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
        let zeros = if verdict.status == Status::Leak { self.zeros(excerpt) } else { None };
        let [wiring, sensor] =
            [wiring, sensor].map(|found| found.map(|found| found.wiring(columns, &self.rig)));
        Suspicions { wiring, sensor, zeros }
    }

    /// Leaks since they changed last against zeros of the meters, unless the rig file declares how far those may be off: the
    /// estimates then have them already.
    fn zeros(&self, excerpt: &Excerpt) -> Option<ZeroCheck> {
        let sensors = self.rig.sensors();
        if sensors.flow_a.bias_std > 0.0 || sensors.flow_b.bias_std > 0.0 {
            return None;
        }
        let mut records = excerpt.records();
        let since_s = self.changed_at_s.unwrap_or(f64::NEG_INFINITY);
        records.retain(|record: &Record| record.t_s >= since_s);
        zero_check(&records, &self.rig)
    }
}
