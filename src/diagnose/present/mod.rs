//! A diagnosis for people, programs and the rig file.

mod figures;
mod json;
pub(crate) mod labels;
mod residual_text;
mod rig;
mod text;
