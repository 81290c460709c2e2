//! Plant, filters, estimators and leak detector of a hydraulic pitch cylinder.
//!
//! The core never touches the world: it reads no clock and no file, allocates nothing and
//! cannot panic. The caller passes the time step. All quantities are SI; pressures are gauge;
//! a flow Q is positive INTO its chamber; chamber A is the piston side and x the piston position
//! from the A end.
//!
//! Equations are cited by their number in X. Wu, Y. Li, F. Li, Z. Yang, W. Teng (2011),
//! "Adaptive Estimation-Based Leakage Detection for a Wind Turbine Hydraulic Pitching System",
//! IEEE/ASME Trans. Mechatronics, doi 10.1109/TMECH.2011.2142400.
#![cfg_attr(not(any(feature = "std", test)), no_std)]

#[cfg(feature = "serde")]
mod arrays;
mod balance;
mod butterworth;
mod cylinder;
mod detector;
pub mod effects;
pub mod emulator;
mod estimate;
mod excitation;
mod fading_parabola;
mod linkage;
mod load;
mod momentum;
mod paper_estimator;
mod paper_law;
pub mod plant;
mod real;
mod regressors;
mod rk4;
mod rls;
mod sample;
mod sensors;

pub use balance::{Leaks, Model, Moment, Terms};
pub use butterworth::{Butterworth, FilterError};
pub use cylinder::{Cylinder, CylinderError, Fluid};
pub use detector::{AlarmSettings, AlarmState, LeakDetector};
pub use effects::{Effect, EffectSet};
pub use emulator::{Emulator, EmulatorParams, EmulatorReading};
pub use estimate::{Estimate, LeakPressures, PerLeak};
pub use excitation::{Excitation, ExcitationReport, ExcitationSettings};
pub use fading_parabola::FadingParabola;
pub use linkage::{Linkage, LinkageError};
pub use load::LoadEstimator;
pub use momentum::{Momentum, force_imbalance_n, hydraulic_force_n};
pub use paper_estimator::PaperEstimator;
pub use paper_law::{PaperGains, PaperLaw, PaperLawRate, Theta};
pub use real::Real;
pub use regressors::regressors;
pub use rk4::rk4_step;
pub use rls::{Parameter, Rls, RlsSettings, Update};
pub use sample::Sample;
pub use sensors::{SensorSpread, Sensors};
