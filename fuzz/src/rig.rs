//! Any text as a rig file: read or refused; what was read is written and read again unchanged, and a trace is replayed
//! with it to numbers.

use pitchleak::Rig;
use std::sync::LazyLock;

static TRACE: LazyLock<String> = LazyLock::new(|| super::trace_text(0, 120));

pub fn enter(bytes: &[u8]) {
    let Ok(text) = std::str::from_utf8(bytes) else { return };
    if let Ok(rig) = Rig::parse(text, "fuzz") {
        let again = Rig::parse(&rig.to_toml(), "fuzz").expect("reads what it wrote");
        assert_eq!(again.cylinder, rig.cylinder);
        super::replay_bytes(TRACE.as_bytes(), &rig);
    }
}
