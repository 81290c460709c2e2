//! Filters of one signal, and the two that the force balance needs: momentum and load.

mod butterworth;
mod fading_memory;
mod load;
mod momentum;

pub use butterworth::{Butterworth, FilterError};
pub use fading_memory::FadingMemoryFilter;
pub use load::LoadEstimator;
pub use momentum::{Momentum, force_imbalance_n, hydraulic_force_n};
