//! The paper's own estimator: regressors, eq. (4)–(7), adaptive law, eq. (8)–(13), and the chain around them.

mod estimator;
mod law;
mod regressors;

pub use estimator::PaperEstimator;
pub use law::{PaperGains, PaperLaw, PaperLawRate, Theta};
pub use regressors::regressors;
