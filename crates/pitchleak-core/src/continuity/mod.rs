//! What a block of samples says of a cylinder: both continuity equations integrated, the noise of that, and the rows
//! that follow. Everything that fits leaks starts from here.
//!
//! Eq. (1) of Wu et al. (2011), with κ = 1/β and Q the flow into a chamber:
//!
//! ```text
//! ∫Q_A dt = +A_A Δx + κ ∫V_A dP_A + C_ip ∫(P_A − P_B) dt + C_epA ∫P_A dt
//! ∫Q_B dt = −A_B Δx + κ ∫V_B dP_B − C_ip ∫(P_A − P_B) dt + C_epB ∫P_B dt
//! ```
//!
//! - [`Step`] and [`Integrals`]: these integrals over a step from one sample to the next, and their sums over a block, by the
//!   trapezoidal rule. Nothing is ever differentiated.
//! - [`NoiseStd`]: the white noise of the sensors, as declared; [`PressureNoise`]: that of the pressures, as found.
//! - [`Weights`]: how the two equations combine to two whose errors are independent, the *balance* and the *position*.
//! - [`Equation`] and [`combine`]: the row that such a combination is, with a column for each [`Parameter`](crate::Parameter).
//! - [`MovingAverage`]: what the pressures' noise at the ends of blocks does, inverted, so that rows are independent.
//! - [`PressureMeans`]: the pressures at which leak flows are quoted.
//! - [`ContinuityStatistic`]: all that any explanation of the readings asks, in constant memory: whitened rows with a column
//!   for every [`RawSum`] of a [`Block`], as Gram matrices of segments of the trace.
//!
//! ```
//! use pitchleak_core::continuity::{Integrals, Measured, Step};
//! use pitchleak_core::{Cylinder, Sample};
//!
//! let cylinder = Cylinder::<f64>::paper();
//! // The piston moves at 20 mm/s at constant pressures: each chamber takes in what its area sweeps.
//! let sample = |k: u8| Sample {
//!     x_m: 0.1 + 0.02 * 0.01 * f64::from(k),
//!     pa_pa: 5e6,
//!     pb_pa: 4e6,
//!     qa_m3s: Some(cylinder.area_a_m2 * 0.02),
//!     qb_m3s: Some(-cylinder.area_b_m2 * 0.02),
//!     force_n: None,
//! };
//! let mut block = Integrals::default();
//! for k in 1..=25 {
//!     let step = Step::between(&cylinder, 0.01, &sample(k - 1), &sample(k));
//!     assert_eq!(step.measured, Measured::Both);
//!     block.add(&step.integrals);
//! }
//! let travel_m = sample(25).x_m - sample(0).x_m;
//! assert!((block.a.flow - cylinder.area_a_m2 * travel_m).abs() < 1e-12);
//! assert!((block.a.pressure - 5e6 * 0.25).abs() < 1e-6 && block.a.compression == 0.0);
//! ```

mod block_sums;
mod change;
mod clocks;
mod equation;
mod gram;
mod integrals;
mod noise;
mod statistic;
mod whitening;

pub use block_sums::{Block, BlockSums, RAW_SUMS, RawSum};
pub use clocks::{Clocks, Next, PerChannel, Readings, Row};
pub use equation::{Equation, MovingAverage, Weights, combine};
pub use gram::{Segment, column};
pub use integrals::{ChamberIntegrals, Integrals, Measured, PressureMeans, Step};
pub use noise::{NoiseStd, PressureNoise, Scatter};
pub use statistic::{CHANNELS, ContinuityStatistic};
pub use whitening::{COLUMNS, EQUATIONS, VOLUME_POWERS};
