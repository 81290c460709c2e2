//! How far figures of a Monte Carlo run may lie from what they estimate, by chance.
//!
//! A claim "x, measured over n seeds" is tested at x ± `SIGMAS` standard deviations of the measurement, so that a run
//! on other seeds passes and a worse estimator fails.

/// Standard deviations allowed: 6e-5 for a normal figure, so that a test of a hundred of them fails by chance once in 150.
const SIGMAS: f64 = 4.0;

/// Figures of `n` independent normal errors.
#[derive(Clone, Copy, Debug)]
pub struct NormalScatter {
    /// Number of independent errors.
    pub n: u64,
}

impl NormalScatter {
    /// Bounds of a root mean square whose expectation is `rms`: it scatters by rms/√(2n).
    pub fn rms_bounds(self, rms: f64) -> [f64; 2] {
        let scatter = SIGMAS * rms / (2.0 * self.n as f64).sqrt();
        [rms - scatter, rms + scatter]
    }

    /// Bound of the size of a mean of errors of root mean square `rms` whose expectation is zero.
    pub fn mean_bound(self, rms: f64) -> f64 {
        SIGMAS * rms / (self.n as f64).sqrt()
    }
}

/// Bounds of the share of `n` independent intervals that hold the truth, where each does with probability `share`.
pub fn coverage_bounds(share: f64, n: u64) -> [f64; 2] {
    let scatter = SIGMAS * (share * (1.0 - share) / n as f64).sqrt();
    [share - scatter, share + scatter]
}
