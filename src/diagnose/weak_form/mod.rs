//! The equations integrated against test functions at a linearisation, and the known noise of their residuals.

mod assembly;
mod column;
mod hats;
mod linearisation;
mod noise_model;
mod rows;
mod sensitivity;
mod shared_noise;
mod signal_product;
mod terms;
mod whitening;

pub(crate) use assembly::{Columns, WeakForm, residual_rows};
pub(crate) use linearisation::Linearisation;
pub(crate) use noise_model::NoiseModel;
pub(crate) use rows::{Entry, Row, Rows};
pub(crate) use shared_noise::{NoisyColumn, SharedNoise};
pub(crate) use signal_product::SignalProduct;
pub(crate) use terms::{DECLARED, Term, all_terms};
pub(crate) use whitening::Whitening;
