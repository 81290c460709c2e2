//! The equations integrated against hats at a linearisation, and the known noise of what they leave over.

mod at_linearisation;
mod column;
mod hats;
mod linearisation;
mod nameless;
mod noise_model;
mod rows;
mod sensitivity;
mod shared_noise;
mod terms;
mod whitening;

pub(crate) use at_linearisation::{WeakForm, residual_rows};
pub(crate) use linearisation::Linearisation;
pub(crate) use nameless::Nameless;
pub(crate) use noise_model::NoiseModel;
pub(crate) use rows::{Entry, RESIDUAL_TESTS, Row, Rows, VARIABLES};
pub(crate) use shared_noise::{NoisyColumn, SharedNoise};
pub(crate) use terms::{Columns, DECLARED, Term, all_terms};
pub(crate) use whitening::Whitening;
