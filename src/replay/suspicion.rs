//! Does something else than leaks explain what was read?

use super::Replay;
use super::draft::Weighed;
use crate::channels::ChannelFaultKind;
use crate::report::{Status, Suspicions, Verdict};
use crate::rig::ColumnMap;
use crate::trace::Record;
use crate::wiring::{
    Excerpt, Explanation, Orifice, Recorded, Running, Wiring, ZeroCheck, changing_leaks_or_zeros,
    exchanged_by_force, exchanged_so_far, explain, orifice, sensor_error, unit_by_scatter, zero_check_lately,
};
use pitchleak_core::PerLeak;

impl Weighed {
    /// No wiring explains what such a channel reads.
    fn has_broken_channel(&self) -> bool {
        self.channels.iter().any(|fault| fault.kind != ChannelFaultKind::Coarse)
    }
}

impl Replay {
    /// What an excerpt of the whole trace, whose columns were read by `columns`, says against `verdict`.
    pub(super) fn suspicions(
        &self,
        verdict: &Verdict,
        weighed: &Weighed,
        excerpt: &Excerpt,
        columns: &ColumnMap,
    ) -> Suspicions {
        if weighed.has_broken_channel() {
            return Suspicions::default();
        }
        let named = |found: Option<Explanation>| self.named(found, columns);
        let records = excerpt.records();
        if verdict.status != Status::Doubtful {
            return Suspicions {
                wiring: named(unit_by_scatter(excerpt, &self.rig).or_else(|| self.exchanged(&records))),
                zeros: if self.may_be_zeros(verdict) { self.zeros(records) } else { None },
                ..Suspicions::default()
            };
        }
        let Some(whole) = Recorded::new(&records, &self.rig) else { return Suspicions::default() };
        let wiring = named(explain(&whole));
        if wiring.is_some() {
            return Suspicions { wiring, ..Suspicions::default() };
        }
        if let Some(orifice) = self.orifice(verdict, &whole) {
            let zeros = orifice.zeros.filter(|_| !self.declares_zeros());
            return Suspicions { zeros, orifice: Some(orifice), ..Suspicions::default() };
        }
        Suspicions { sensor: named(sensor_error(&whole)), ..Suspicions::default() }
    }

    /// What a stream's evidence so far says. To look for mistakes of wiring takes the samples themselves, and as long as
    /// those are not excluded, no other law of a leak is believed: that is for a replay of the stored trace.
    pub(super) fn suspicions_so_far(
        &self,
        verdict: &Verdict,
        weighed: &Weighed,
        evidence: &Running,
    ) -> Suspicions {
        if weighed.has_broken_channel() {
            return Suspicions::default();
        }
        let named = |found: Option<Explanation>| self.named(found, &self.rig.columns);
        let lately = evidence.stretch(&self.rig);
        if verdict.status == Status::Doubtful {
            let wiring = named(exchanged_so_far(&lately));
            let sensor = if wiring.is_some() { None } else { named(sensor_error(&lately)) };
            return Suspicions { wiring, sensor, ..Suspicions::default() };
        }
        let wiring = evidence.unit_by_scatter(&self.rig).or_else(|| exchanged_so_far(&lately));
        Suspicions {
            wiring: named(wiring),
            zeros: if self.may_be_zeros(verdict) { changing_leaks_or_zeros(&lately) } else { None },
            ..Suspicions::default()
        }
    }

    fn exchanged(&self, records: &[Record]) -> Option<Explanation> {
        exchanged_by_force(&Recorded::new(records, &self.rig)?)
    }

    fn named(&self, found: Option<Explanation>, columns: &ColumnMap) -> Option<Wiring> {
        found.map(|found| found.wiring(columns, &self.rig))
    }

    /// Whether the leaks found pass an orifice, where nothing speaks against them but that they are not as C P.
    fn orifice(&self, verdict: &Verdict, whole: &Recorded<'_>) -> Option<Orifice> {
        let only_by_law = verdict.reasons.iter().all(|reason| reason.id.may_be_orifice());
        let leaks = PerLeak::from_fn(|leak| verdict.faults.contains(&leak));
        (only_by_law && !verdict.faults.is_empty()).then(|| orifice(whole, leaks))?
    }

    /// Whether a leak is claimed that zeros of the meters may be.
    fn may_be_zeros(&self, verdict: &Verdict) -> bool {
        verdict.status == Status::Leak && !self.declares_zeros()
    }

    /// Whether the rig file says how far the meters' zeros may be off: the estimates then have them already.
    fn declares_zeros(&self) -> bool {
        let sensors = self.rig.sensors();
        sensors.flow_a.bias_std > 0.0 || sensors.flow_b.bias_std > 0.0
    }

    /// Leaks since they changed last against zeros of the meters.
    fn zeros(&self, mut records: Vec<Record>) -> Option<ZeroCheck> {
        let since_s = self.changed_at_s.unwrap_or(f64::NEG_INFINITY);
        records.retain(|record: &Record| record.t_s >= since_s);
        zero_check_lately(&records, &self.rig)
    }
}
