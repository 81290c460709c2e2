//! Plant, filters, estimators and leak detector of a hydraulic pitch cylinder.
//!
//! The core never touches the world: it reads no clock and no file, allocates nothing and
//! cannot panic. The caller passes the time step. All quantities are SI; pressures are gauge;
//! a flow Q is positive INTO its chamber; chamber A is the piston side and x the piston position
//! from the A end.
//!
//! Readings go in one by one, leak flows with their uncertainty and alarms come out:
//!
//! ```
//! use pitchleak_core::{
//!     AlarmSettings, AlarmState, Cylinder, Fluid, LeakDetector, Rls, RlsError, RlsSettings, Sample, Sensors, Update,
//! };
//!
//! # /// A cylinder whose piston seal lets 0.3 L/min through at 15 bar.
//! # fn read_sensors(t_s: f32) -> Sample<f32> {
//! #     let (pa, pb) = (5.5e6 + 1e6 * (1.3 * t_s).sin(), 4e6 + 8e5 * (0.7 * t_s).sin());
//! #     let (travel, speed) = (0.03 * (0.9 * t_s).sin(), 0.027 * (0.9 * t_s).cos());
//! #     let leak = 3.3e-12 * (pa - pb);
//! #     let store_a = (1.26e-3 * (0.1 + travel)) / 0.8e9 * 1.3e6 * (1.3 * t_s).cos();
//! #     let store_b = (0.94e-3 * (0.1 - travel)) / 0.8e9 * 5.6e5 * (0.7 * t_s).cos();
//! #     let (qa, qb) = (1.26e-3 * speed + store_a + leak, -0.94e-3 * speed + store_b - leak);
//! #     Sample { x_m: 0.1 + travel, pa_pa: pa, pb_pa: pb, qa_m3s: Some(qa), qb_m3s: Some(qb), force_n: None }
//! # }
//! # fn main() -> Result<(), RlsError> {
//! let settings = RlsSettings::default();
//! let mut rls = Rls::<f32, 4>::new(Cylinder::paper(), Fluid::paper(), &Sensors::paper(), settings)?;
//! let mut detector = LeakDetector::new(AlarmSettings::default());
//! for k in 0..3000_u16 {
//!     let sample = read_sensors(f32::from(k) * 0.01);
//!     if let Update::Renewed { elapsed_s, .. } = rls.update(0.01, &sample) {
//!         let flows = rls.estimates().mean_leaks_m3s;
//!         for (leak, change) in detector.update(elapsed_s, &flows) {
//!             if change == Some(AlarmState::Raised) {
//!                 let lpm = flows[leak].scaled(60e3);
//!                 println!("{} leak of {:.2} ± {:.2} L/min", leak.label(), lpm.value, lpm.half_width95());
//!             }
//!         }
//!     }
//! }
//! assert!(detector.active().internal && !detector.active().external_a);
//! # Ok(())
//! # }
//! ```
//!
//! # Layers
//!
//! Each needs only those above it.
//!
//! - **Model**: [`Cylinder`], [`Fluid`], [`Sensors`], a [`Sample`] of readings, and [`Model`], the continuity equations and the force
//!   balance term by term; [`Linkage`], the pitch mechanism. [`Real`] is `f32` or `f64`.
//! - **Filters**: [`Butterworth`], [`Momentum`], [`LoadEstimator`]: what the paper's law needs of raw signals.
//! - **[Effects](effects)**: what the plain model lacks, from dead volume to friction, each a term that [`EffectSet`] adds.
//! - **[Plant](plant) and [emulator]**: a cylinder to simulate, and one whose readings come as from a logger.
//! - **[Continuity](continuity)**: what a block of samples says of both chambers: integrals, their noise, rows; and channels that
//!   each have a clock of their own. Whoever fits leaks starts here.
//! - **Estimators**: [`Rls`], the default, and [`PaperLaw`] with its chain [`PaperEstimator`]. One sample in, at times an
//!   [`Update`] out, [`Estimates`] with standard deviations whenever they are asked for. [`ValveFilter`] needs no flow meters,
//!   but a calibrated valve.
//! - **Detector**: [`LeakDetector`], alarms by a sequential test of those estimates.
//!
//! Between samples an estimator can be copied, and with the feature `serde` saved. Channels need not come together:
//!
//! ```
//! use pitchleak_core::continuity::Readings;
//! use pitchleak_core::{Cylinder, Fluid, Rls, RlsError, RlsSettings, Sensors, Update};
//!
//! # fn main() -> Result<(), RlsError> {
//! // Flows come ten times as rarely as the rest: a row says what was read, and no more.
//! let mut rls = Rls::<f64, 4>::new(Cylinder::paper(), Fluid::paper(), &Sensors::paper(), RlsSettings::default())?;
//! let mut renewals = 0;
//! for k in 0..1000_u16 {
//!     let flow = (k % 10 == 0).then_some(0.0);
//!     let row = Readings { x: Some(0.1), pa: Some(5e6), pb: Some(4e6), qa: flow, qb: flow };
//!     renewals += u32::from(matches!(rls.update_readings(0.01, &row), Update::Renewed { .. }));
//! }
//! // A cylinder at rest under pressure into which nothing flows has no leak, give or take.
//! let leak = rls.estimates().mean_leaks_m3s.external_a.scaled(60e3);
//! assert!(renewals > 10 && leak.value.abs() < 2.0 * leak.std, "{leak:?} L/min");
//! # Ok(())
//! # }
//! ```
//!
//! Equations are cited by their number in X. Wu, Y. Li, F. Li, Z. Yang, W. Teng (2011),
//! "Adaptive Estimation-Based Leakage Detection for a Wind Turbine Hydraulic Pitching System",
//! IEEE/ASME Trans. Mechatronics, doi 10.1109/TMECH.2011.2142400.
#![cfg_attr(not(any(feature = "std", test)), no_std)]

pub mod continuity;
mod detector;
pub mod effects;
pub mod emulator;
mod estimator;
mod filter;
mod linalg;
mod model;
mod number;
mod paper;
pub mod plant;
mod valve;

pub use detector::{AlarmSettings, AlarmState, LeakDetector};
pub use effects::{Effect, EffectSet};
pub use emulator::{Emulator, EmulatorParams, EmulatorReading};
pub use estimator::{
    Estimates, Excitation, ExcitationReport, ExcitationSettings, Innovation, Parameter, Rls, RlsError,
    RlsSettings, Update,
};
pub use filter::{Butterworth, FadingMemoryFilter, FilterError, LoadEstimator, Momentum, force_imbalance_n};
pub use model::{
    ATMOSPHERE_PA, Cylinder, CylinderError, Estimate, Fluid, Leak, LeakPressures, Linkage, LinkageError,
    Model, PerLeak, Sample, SensorSpread, Sensors, Signals, Terms, metering, metering_with_slope,
    signed_root,
};
#[cfg(feature = "serde")]
pub(crate) use number::Saved;
pub use number::{LPM_PER_M3S, Real};
pub use paper::{PaperEstimator, PaperGains, PaperLaw, PaperLawRate, Theta, regressors};
pub use plant::rk4_step;
pub use valve::unknowns as valve_unknowns;
pub use valve::{
    VALVE_COVARIANCES, VALVE_UNKNOWNS, ValveCalibration, ValveError, ValveEstimates, ValveFilter, ValveNoise,
    ValveSample, ValveUpdate,
};
