//! Does a mistake of wiring explain what was read?

use super::Replay;
use super::draft::Weighed;
use crate::channels::ChannelFaultKind;
use crate::explain::Decision;
use crate::rig::ColumnMap;
use crate::wiring::Wiring;

impl Replay {
    /// The mistake that `decision` is sure of, of a trace whose columns were read by `columns`. No wiring explains what a
    /// broken channel reads.
    pub(super) fn wiring(
        &self,
        decision: Option<&Decision>,
        weighed: &Weighed,
        columns: &ColumnMap,
    ) -> Option<Wiring> {
        let is_broken = weighed.channels.iter().any(|fault| fault.kind != ChannelFaultKind::Coarse);
        Wiring::of(decision?, columns, &self.rig).filter(|_| !is_broken)
    }
}
