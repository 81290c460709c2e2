//! Any bytes as a Parquet file: on a disk, where they are read from anywhere, and as a stream.

use super::{assert_numbers, replay_bytes, scratch};
use pitchleak::Rig;
use pitchleak::replay::{ReplayError, replay};
use pitchleak::trace::TraceReader;

pub fn enter(bytes: &[u8]) {
    let rig = Rig::paper();
    let mut whole = b"PAR1".to_vec();
    whole.extend(bytes.strip_prefix(b"PAR1").unwrap_or(bytes));
    replay_bytes(&whole, &rig);
    let Ok(mut reader) = TraceReader::open(scratch::file("parquet", &whole), &rig) else { return };
    if let Ok(report) = replay(&mut reader, &rig, |_, _, _| Ok::<(), ReplayError>(())) {
        assert_numbers(&report);
    }
}
