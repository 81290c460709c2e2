//! Any bytes as the file that `columns` looks at.

use super::scratch;
use pitchleak::Rig;
use pitchleak::trace::FileReading;

pub fn enter(bytes: &[u8]) {
    let Ok(reading) = FileReading::of(scratch::file("inspect", bytes), &Rig::paper()) else { return };
    let _ = reading.to_text();
    reading.to_json().expect("a reading has a JSON form");
}
