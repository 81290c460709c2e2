//! The door that the variable DOOR names.
#![no_main]

use libfuzzer_sys::fuzz_target;
use pitchleak_fuzz::{DOORS, Door};
use std::sync::LazyLock;

static CHOSEN: LazyLock<Door> = LazyLock::new(|| {
    let name = std::env::var("DOOR").unwrap_or_default();
    let named = DOORS.iter().find(|(known, _)| *known == name);
    named.unwrap_or_else(|| panic!("DOOR is none of: {}", DOORS.map(|(name, _)| name).join(" "))).1
});

fuzz_target!(|bytes: &[u8]| CHOSEN(bytes));
