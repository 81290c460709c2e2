//! Any text as a rig file: read or refused; what was read is written and read again unchanged.
#![no_main]

use libfuzzer_sys::fuzz_target;
use pitchleak::Rig;

fuzz_target!(|text: &str| {
    if let Ok(rig) = Rig::parse(text, "fuzz") {
        let again = Rig::parse(&rig.to_toml(), "fuzz").expect("reads what it wrote");
        assert_eq!(again.cylinder, rig.cylinder);
    }
});
