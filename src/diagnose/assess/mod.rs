//! The residual once a model is fitted, and what it says about the model.

mod adequacy;
mod confidence;
mod effects;
mod excitation;
mod held_out;
mod holds;
mod leaks;
mod model_fit;
mod residual;
mod verdict;

pub(crate) use adequacy::failures;
pub(crate) use effects::{calibration, found};
pub(crate) use excitation::{detection_limits, is_excited};
pub(crate) use held_out::HeldOut;
pub(crate) use holds::check as check_holds;
pub(crate) use model_fit::model_fit;
pub(crate) use verdict::{judge, notes};
