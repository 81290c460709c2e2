//! Results as lines of text: verdict first, then what backs it.

mod check;
mod diagnosis;
mod fleet;
pub(crate) mod proof;
mod replay;
mod replay_terminal;
mod valve;

pub use check::CheckSketch;
pub(crate) use diagnosis::companions;
pub use diagnosis::sentence;
pub use fleet::fleet_terminal;
pub(crate) use fleet::found;
pub use replay::data_line;
pub(crate) use replay::{hold_line, misfit, missing_rig, rig_line};
pub use replay_terminal::ReplaySketch;
pub(crate) use valve::valve_line;

use crate::Palette;

/// A result that people read.
pub trait Text {
    /// In the colours of `palette`.
    fn to_text(&self, palette: &Palette) -> String;
}
