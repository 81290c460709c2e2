//! Any text as a rig file: read or refused; what was read is written and read again unchanged, and a trace is replayed
//! with it to numbers.
#![no_main]

use libfuzzer_sys::fuzz_target;
use pitchleak::Rig;
use std::sync::LazyLock;

static TRACE: LazyLock<String> = LazyLock::new(|| pitchleak_fuzz::trace_text(0, 120));

fuzz_target!(|text: &str| {
    if let Ok(rig) = Rig::parse(text, "fuzz") {
        let again = Rig::parse(&rig.to_toml(), "fuzz").expect("reads what it wrote");
        assert_eq!(again.cylinder, rig.cylinder);
        pitchleak_fuzz::replay_bytes(TRACE.as_bytes(), &rig);
    }
});
