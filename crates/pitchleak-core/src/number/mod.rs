//! The number type, and how arrays of it are stored.

#[cfg(feature = "serde")]
pub(crate) mod arrays;
mod filled;
mod real;

pub(crate) use filled::Filled;
pub use real::Real;
#[cfg(feature = "serde")]
pub use real::Saved;

/// 1 m³/s in L/min, in which people think of flows.
pub const LPM_PER_M3S: f64 = 60e3;
