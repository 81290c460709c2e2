//! What the tests of several crates share. Nothing here is part of the product.
//!
//! What cannot be read or does not exist panics: a validation without its data has failed.

#![allow(clippy::expect_used, reason = "tests want to stop where something is missing")]

pub mod hopsan;
mod motion;
mod noise;
pub mod rig;
mod statistics;
pub mod trace_text;

pub use motion::{Motion, Multisine};
pub use noise::{noisy, seeded, sensors_of, white_noise};
pub use statistics::{NormalScatter, coverage_bounds};
