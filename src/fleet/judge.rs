//! Traces through the replay, on all cores.

use super::{FleetRow, FleetTrace, TraceIdentity};
use crate::Rig;
use crate::replay::{ReplayError, replay};
use crate::trace::{TraceError, TraceReader};
use rayon::prelude::*;
use std::sync::Once;
use std::sync::atomic::{AtomicBool, Ordering};

/// The caller has stopped listening.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Stopped;

enum Ended {
    Failed(ReplayError),
    Stopped,
}

impl From<ReplayError> for Ended {
    fn from(error: ReplayError) -> Self {
        Self::Failed(error)
    }
}

/// Judges one trace as a replay of it does. A trace that can't be read is a row too.
///
/// # Errors
/// [`Stopped`] soon after `go_on` says no; it is asked after each sample.
pub fn judge(trace: &FleetTrace, go_on: impl FnMut() -> bool) -> Result<FleetRow, Stopped> {
    let name = trace.path.display().to_string();
    match &trace.rig {
        Ok(rig) => judge_opened(&name, &trace.identity, rig, TraceReader::open(&trace.path, rig), go_on),
        Err(error) => Ok(FleetRow::failed(&trace.identity, name, error.to_string())),
    }
}

/// As [`judge`], from what opening a trace gave; `name` is the trace's.
///
/// # Errors
/// As [`judge`].
pub fn judge_opened(
    name: &str,
    identity: &TraceIdentity,
    rig: &Rig,
    opened: Result<TraceReader<'_>, TraceError>,
    mut go_on: impl FnMut() -> bool,
) -> Result<FleetRow, Stopped> {
    keep_freed_memory();
    let replayed = opened.map_err(|error| Ended::Failed(error.into())).and_then(|mut reader| {
        let report = replay(&mut reader, rig, |_, _, _| if go_on() { Ok(()) } else { Err(Ended::Stopped) })?;
        let begins = reader.clock().and_then(|clock| clock.start()).or(identity.begins);
        Ok(FleetRow::of(&TraceIdentity { begins, ..identity.clone() }, &report, rig))
    });
    match replayed {
        Ok(row) => Ok(row),
        Err(Ended::Failed(error)) => Ok(FleetRow::failed(identity, name.to_owned(), error.to_string())),
        Err(Ended::Stopped) => Err(Stopped),
    }
}

/// The allocator of glibc hands freed memory beyond twice the largest block freed so far back to the system (`mallopt(3)`,
/// M_MMAP_THRESHOLD: 32 MiB at the most), and the next trace has its pages mapped anew, for a tenth of the time. A block
/// that nobody touches costs nothing.
fn keep_freed_memory() {
    const BLOCK: usize = (32 << 20) - (64 << 10);
    static KEPT: Once = Once::new();
    KEPT.call_once(|| drop(std::hint::black_box(Vec::<u8>::with_capacity(BLOCK))));
}

/// Judges every trace, on all cores of rayon's pool; `each` sees the rows as they come. The rows are in the order of the
/// traces. Memory: a row a trace, and for each core what a replay needs.
///
/// # Errors
/// [`Stopped`] soon after `stop` is set.
pub fn judge_all(
    traces: &[FleetTrace],
    each: impl Fn(&FleetRow) + Sync,
    stop: &AtomicBool,
) -> Result<Vec<FleetRow>, Stopped> {
    // One trace after the other from a common queue: they differ in length.
    let rows = traces.par_iter().with_max_len(1).map(|trace| {
        let row = judge(trace, || !stop.load(Ordering::Relaxed))?;
        each(&row);
        Ok(row)
    });
    rows.collect()
}
