//! A diagnosis for people, programs and the rig file.

mod figures;
pub(crate) mod in_a_row;
mod json;
pub(crate) mod labels;
mod residual_text;
mod rig;
mod text;
