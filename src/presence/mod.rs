//! Which leaks there are, where no flow meter tells: by the likelihood of their coefficients, of a hold or of a valve's flows.

mod belief;
mod found;
mod likelihood;
mod pressures;

pub(crate) use belief::Place;
pub(crate) use belief::SIZE as LEAK_SIZE;
pub use found::FoundLeak;
pub(crate) use found::{Found, Wording, report, told};
pub(crate) use likelihood::{LEAK_UNIT_M3SPA, LEAST_INFORMATION, LeakLikelihood, RESOLUTION};
pub(crate) use pressures::Pressures;
