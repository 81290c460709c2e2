//! Any bytes as a trace: replayed to a report or refused, and the report holds numbers only.
#![no_main]

use libfuzzer_sys::fuzz_target;
use pitchleak::Rig;

fuzz_target!(|bytes: &[u8]| pitchleak_fuzz::replay_bytes(bytes, &Rig::paper()));
