//! A real broker, a gateway, a sender and a listener, all on loopback and gone with the test.

mod client;
mod expected;
mod gateway;
mod mosquitto;

pub use client::{Listener, Sender};
pub use expected::{States, copies, ids, names, sent_by_disk, state, undisturbed};
pub use gateway::{Gateway, write_secret};
pub use mosquitto::{Mosquitto, free_port};

use flate2::read::GzDecoder;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

pub const TRACE: &str = "traces/both.csv.gz";

pub fn data() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../data")
}

pub fn certificates() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/certificates")
}

/// A trace's samples as JSON arrays of so many each.
pub fn batches(trace: &str, samples: usize) -> Vec<String> {
    let mut text = String::new();
    GzDecoder::new(std::fs::File::open(data().join(trace)).unwrap()).read_to_string(&mut text).unwrap();
    let mut lines = text.lines();
    let names: Vec<_> = lines.next().unwrap().split(',').collect();
    let object = |line: &str| {
        let cells = names.iter().zip(line.split(',')).filter(|(_, cell)| !cell.is_empty());
        let members: Vec<_> = cells.map(|(name, cell)| format!("\"{name}\":{cell}")).collect();
        format!("{{{}}}", members.join(","))
    };
    let objects: Vec<_> = lines.map(object).collect();
    objects.chunks(samples).map(|chunk| format!("[{}]", chunk.join(","))).collect()
}

/// Waits until it holds; a test that waits in vain fails here.
pub fn wait_until(what: &str, mut holds: impl FnMut() -> bool) {
    let end = Instant::now() + Duration::from_secs(60);
    while !holds() {
        assert!(Instant::now() < end, "waited in vain: {what}");
        std::thread::sleep(Duration::from_millis(20));
    }
}

/// Whole numbers that look random, the same in every run.
pub struct Dice(pub u64);

impl Dice {
    /// Below `sides`.
    pub fn throw(&mut self, sides: u64) -> u64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) % sides
    }
}
