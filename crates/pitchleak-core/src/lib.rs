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

pub use detector::{AlarmSettings, AlarmState, LeakDetector};
pub use effects::{Effect, EffectSet};
pub use emulator::{Emulator, EmulatorParams, EmulatorReading};
pub use estimator::{
    Estimates, Excitation, ExcitationReport, ExcitationSettings, Innovation, Parameter, Rls, RlsError,
    RlsSettings, Update,
};
pub use filter::{
    Butterworth, FadingMemoryFilter, FilterError, LoadEstimator, Momentum, force_imbalance_n,
    hydraulic_force_n,
};
pub use model::{
    ATMOSPHERE_PA, Cylinder, CylinderError, Estimate, Fluid, LEAST_ABSOLUTE_PA, Leak, LeakPressures, Linkage,
    LinkageError, Model, PerLeak, Sample, SensorSpread, Sensors, Signals, Terms, metering, signed_root,
};
pub use number::{LPM_PER_M3S, Real};
pub use paper::{PaperEstimator, PaperGains, PaperLaw, PaperLawRate, Theta, regressors};
pub use plant::rk4_step;
