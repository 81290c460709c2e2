//! The declared model and its effects, fitted to all traces together.

mod emptied;
mod gauss_newton;
mod leak_levels;
mod linear;
mod predict;
mod problem;
mod regression;
mod score;
mod structure;
mod widening;

pub(crate) use emptied::Emptied;
pub use gauss_newton::Progress;
pub(crate) use gauss_newton::{Beyond, Fit};
pub(crate) use leak_levels::LeakProducts;
pub(crate) use predict::MeanFlow;
pub(crate) use problem::Problem;
pub(crate) use regression::Solution;
pub(crate) use score::{PartialColumn, Score};
pub(crate) use widening::UnknownConstant;
