//! The default estimator: recursive generalised least squares on both continuity equations.
//!
//! Per chamber eq. (1) is linear in 1/β, C_ip, C_epA and C_epB. The two equations are split ([`Weights`](crate::continuity::Weights)) into a
//! *balance*, in which the piston speed cancels and only flow meters and pressures speak, and a *position* equation, which carries the piston
//! by the flows and is compared with the position sensor. Both are whitened by the declared sensor noise, so their sum is the
//! likelihood:
//! - the balance is summed over blocks of a quarter of a second; the noise of the pressures in its columns
//!   (errors in variables) then averages out instead of biasing the leaks;
//! - the position equation's innovations are white by a scalar Kalman filter on the piston position ([`block`]), and its columns
//!   are smooth by nature.
//!
//! Both add to the normal equations of a hypothesis ([`information`]; square-root free, Bierman 1977: [`linalg`](crate::linalg)).
//! How fast the leaks change is learnt: a [`bank`] of hypotheses, from leaks that stay to leaks whose trend lasts for
//! a few seconds, is weighed by how well each foretells the data (multiple models: Magill 1965), and their mixture is told
//! ([`estimates`]). A leak that changes at once is seen by Page's test ([`innovations`]) and by a hypothesis that it jumped.
//!
//! Time and memory per sample are constant; nothing is ever differentiated.

mod bank;
mod block;
mod estimates;
mod evidence;
mod hypothesis;
mod information;
mod innovations;
mod prior;
mod rls;

pub use estimates::{Estimates, Excitation, ExcitationReport, ExcitationSettings};
pub use prior::Parameter;
pub use rls::Rls;

use crate::{Cylinder, CylinderError, Fluid, Real, SensorSpread, Sensors};

/// How [`Rls`] remembers and averages.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct RlsSettings<T> {
    /// Longest memory, s; infinite to remember everything. How much of it counts is learnt from the data.
    pub forgetting_time_s: T,
    /// Length of the balance's blocks, s: the estimates are renewed after every second block, by the sixth sample that
    /// follows it, the seventh where a jump that was suspected was none. A block has eight samples at least.
    pub block_time_s: T,
    /// A step longer than this, s, is a gap: nothing is integrated over it.
    pub max_step_s: T,
}

impl<T: Real> Default for RlsSettings<T> {
    fn default() -> Self {
        Self { forgetting_time_s: T::infinity(), block_time_s: T::lit(0.25), max_step_s: T::lit(0.5) }
    }
}

/// Error returned by [`Rls::new`]: of this an estimator would make nothing but nonsense.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum RlsError {
    /// The cylinder or its oil cannot be.
    #[error("{0}")]
    Cylinder(#[from] CylinderError),
    /// A sensor's noise, bias or gain error is negative or not a number.
    #[error("noise, bias and gain error of sensors must not be negative")]
    Sensors,
    /// A time of [`RlsSettings`] is not positive, or the block's is infinite.
    #[error("forgetting time, block time and longest step must be positive")]
    Settings,
}

/// Whether an estimator can be made of all this.
fn check<T: Real>(
    cylinder: &Cylinder<T>,
    fluid: &Fluid<T>,
    sensors: &Sensors<T>,
    settings: &RlsSettings<T>,
) -> Result<(), RlsError> {
    cylinder.check()?;
    fluid.check()?;
    let Sensors { flow_a, flow_b, pressure, position, force } = sensors;
    if ![flow_a, flow_b, pressure, position, force].into_iter().all(SensorSpread::is_physical) {
        return Err(RlsError::Sensors);
    }
    let RlsSettings { forgetting_time_s, block_time_s, max_step_s } = *settings;
    let positive = |time: T| time > T::zero();
    let all = positive(forgetting_time_s) && positive(block_time_s) && positive(max_step_s);
    if all && block_time_s.is_finite() { Ok(()) } else { Err(RlsError::Settings) }
}

/// What one [`Rls::update`] did.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Update<T> {
    /// The first sample, or the first after a gap: nothing to integrate yet.
    Started,
    /// The sample was taken in.
    Accepted,
    /// The sample completed a block of the balance. After every second one the estimates are renewed, a part with each
    /// sample that follows, so that none takes much longer than another.
    Balanced {
        /// What the flow balance of the block had that the estimates before it did not foretell; none where a
        /// chamber had no flow to balance.
        innovation: Option<Innovation<T>>,
    },
    /// The estimates are new.
    Renewed {
        /// Time that was watched since the estimates were last new, s: without gaps, for
        /// [`LeakDetector::update`](crate::LeakDetector::update).
        elapsed_s: T,
        /// The leak has changed at once: what was learnt before counts for nothing any more.
        changed: bool,
        /// That of a block which the sample completed, as in [`Balanced`](Self::Balanced): only where it shows that the
        /// leak has changed.
        innovation: Option<Innovation<T>>,
    },
    /// Not a number, or beyond what a cylinder can do: the sample was left out.
    Rejected,
}

/// One innovation of the flow balance A_B·(A) + A_A·(B), both sides divided by the standard deviation that the
/// declared sensor noise gives it: as long as model and noise hold, normal with mean zero and this variance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Innovation<T> {
    /// Measured less foretold, in standard deviations of the declared noise.
    pub value: T,
    /// Its variance: 1 of the noise, and what the uncertainty of the estimates adds.
    pub variance: T,
}
