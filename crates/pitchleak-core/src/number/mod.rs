//! The number type, and how arrays of it are stored.

#[cfg(feature = "serde")]
pub(crate) mod arrays;
mod real;

pub use real::Real;
