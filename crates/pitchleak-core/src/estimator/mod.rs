//! The default estimator: recursive generalised least squares on both continuity equations.
//!
//! Per chamber eq. (1) is linear in 1/β, C_ip, C_epA and C_epB. The two equations are split ([`Weights`](crate::continuity::Weights)) into a
//! *balance*, in which the piston speed cancels and only flow meters and pressures speak, and a *position* equation, which carries the piston
//! by the flows and is compared with the position sensor. Both are whitened by the declared sensor noise, so their sum is the
//! likelihood:
//! - the balance is summed over blocks of a quarter of a second; the noise of the pressures in its columns
//!   (errors in variables) then averages out instead of biasing the leaks;
//! - the position equation's innovations are white by a scalar Kalman filter on the piston position ([`position`]), and its columns
//!   are smooth by nature.
//!
//! Both add to the normal equations of a hypothesis ([`information`]; square-root free, Bierman 1977: [`linalg`](crate::linalg)).
//! How fast the leaks change is learnt: a [`bank`] of hypotheses, from leaks that stay to leaks whose trend lasts for
//! a few seconds, is weighed by how well each foretells the data (multiple models: Magill 1965), and their [`mixture`] is told
//! ([`estimates`]). A leak that changes at once is seen by Page's test ([`change`]) and by a hypothesis that it jumped.
//!
//! Time and memory per sample are constant; nothing is ever differentiated.

mod bank;
mod block;
mod change;
mod estimates;
mod evidence;
mod hypothesis;
mod information;
mod innovations;
mod mixture;
mod position;
mod prior;
mod rls;
mod settings;
mod update;

pub use estimates::{Estimates, Excitation, ExcitationReport, ExcitationSettings};
pub use prior::Parameter;
pub use rls::Rls;
pub use settings::{RlsError, RlsSettings};
pub use update::{Innovation, Update};
