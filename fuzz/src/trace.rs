//! Any bytes as a trace: replayed to a report or refused, and the report holds numbers only.

use pitchleak::Rig;

pub fn enter(bytes: &[u8]) {
    super::replay_bytes(bytes, &Rig::paper());
}
