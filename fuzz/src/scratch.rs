//! Bytes as a file, for what reads files alone.

use std::path::PathBuf;

/// The file of a door, with `bytes` in it.
pub fn file(door: &str, bytes: &[u8]) -> PathBuf {
    let path = folder(door).join("input");
    std::fs::write(&path, bytes).expect("a file");
    path
}

/// A folder of the door alone.
pub fn folder(door: &str) -> PathBuf {
    let path = std::env::temp_dir().join(format!("pitchleak-door-{}-{door}", std::process::id()));
    std::fs::create_dir_all(&path).expect("a folder");
    path
}
