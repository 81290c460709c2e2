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

mod detector;
pub mod effects;
pub mod emulator;
mod filter;
mod model;
mod number;
mod paper;
pub mod plant;
mod rls;

pub use detector::{AlarmSettings, AlarmState, LeakDetector};
pub use effects::{Effect, EffectSet};
pub use emulator::{Emulator, EmulatorParams, EmulatorReading};
pub use filter::{
    Butterworth, FadingMemoryFilter, FilterError, LoadEstimator, Momentum, force_imbalance_n,
    hydraulic_force_n,
};
pub use model::{
    ATMOSPHERE_PA, Cylinder, CylinderError, Estimate, Fluid, LEAST_ABSOLUTE_PA, Leak, LeakPressures, Linkage,
    LinkageError, Model, PerLeak, Sample, SensorSpread, Sensors, Signals, Terms, metering, signed_root,
};
pub use number::Real;
pub use paper::{PaperEstimator, PaperGains, PaperLaw, PaperLawRate, Theta, regressors};
pub use plant::rk4_step;
pub use rls::{Excitation, ExcitationReport, ExcitationSettings, Parameter, Rls, RlsSettings, Update};
