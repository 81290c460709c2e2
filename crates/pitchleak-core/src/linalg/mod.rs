//! Normal equations of N levels and a slope of each leak, in fixed memory.
//!
//! - [`Joint`]: their symmetric matrix, packed.
//! - [`Factors`]: its factorisation U D Uᵀ (Bierman 1977, Factorization Methods for Discrete Sequential Estimation,
//!   §III.4), last parameter first: the slopes, then the levels down to level 0.

mod factors;
mod joint;

pub(crate) use factors::{Factors, Pivots};
pub(crate) use joint::{Joint, symmetric};
