//! What the tests of several crates share. Nothing here is part of the product.
//!
//! With the feature `judges` it also holds the plants, lies and judges that `benches/` and their reduced tests call.
//!
//! What cannot be read or does not exist panics: a validation without its data has failed.

#![allow(clippy::expect_used, reason = "tests want to stop where something is missing")]

#[cfg(feature = "judges")]
pub mod blind;
#[cfg(feature = "judges")]
pub mod confidence;
#[cfg(feature = "judges")]
mod doubts;
pub mod hold;
pub mod hopsan;
#[cfg(feature = "judges")]
pub mod judge;
#[cfg(feature = "judges")]
pub mod lies;
mod motion;
mod noise;
#[cfg(feature = "judges")]
pub mod options;
pub mod rig;
mod statistics;
#[cfg(feature = "judges")]
pub mod subsets;
pub mod trace_text;
pub mod valve;
#[cfg(feature = "judges")]
pub mod windy;

pub use motion::{Motion, Multisine};
pub use noise::{noisy, seeded, sensors_of, white_noise};
pub use statistics::{NormalScatter, coverage_bounds};
