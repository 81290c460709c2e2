//! Mistakes of wiring, sign and unit, looked for before any effect: no effect is worth a word while channels are
//! exchanged.

use super::declared::Declared;
use super::series::Series;
use crate::wiring::{Excerpt, Mistake, Recorded, Wiring, explain};

/// A mistake that explains the traces.
pub(crate) struct Miswired {
    pub(crate) wiring: Wiring,
    /// No effect could do the same: not so for a delay or a pressure's zero, which sensors have too.
    pub(crate) is_beyond_effects: bool,
}

/// The mistake that explains all of the traces together. None is looked for beside effects that the rig file declares:
/// the plain model, by which mistakes are judged, lacks them.
pub(crate) fn miswired(traces: &[Series], declared: &Declared) -> Option<Miswired> {
    if declared.effects.iter().next().is_some() {
        return None;
    }
    let rig = declared.rig();
    let mut excerpt = Excerpt::default();
    traces.iter().flat_map(Series::records).for_each(|record| excerpt.add(&record));
    let records = excerpt.records();
    let found = explain(&Recorded::new(&records, &rig)?)?;
    let is_like_an_effect = |one: &Mistake| matches!(one, Mistake::Late(..) | Mistake::Absolute(_));
    let columns = traces.first().map(|series| series.columns.clone()).unwrap_or_default();
    Some(Miswired {
        wiring: found.wiring(&columns, &rig),
        is_beyond_effects: !found.mistakes.iter().any(is_like_an_effect),
    })
}
