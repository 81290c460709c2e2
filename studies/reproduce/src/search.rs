//! The paper does not print λ and γ: the best ones are searched for, in the same runs.

use super::Progress;
use super::protocol::{ReproduceError, Run, WINDOWS, map_counted, rig};
use super::trial::{EstimateHistory, mean};
use pitchleak::Rig;
use pitchleak::core::Leak;
use pitchleak::rig::EstimatorKind;
use pitchleak::simulate::{Biases, Sensing};
use serde::Serialize;

/// λ tried, 1/s.
const LAMBDAS: [f64; 4] = [1.0, 10.0, 100.0, 1000.0];
/// γ/λ tried, s, with γ as the scale of [`pitchleak::core::PaperGains::scaled`]: along lines of this
/// ratio the law behaves much alike.
const RATIOS: [f64; 10] = [1e-8, 1e-7, 3e-7, 1e-6, 3e-6, 1e-5, 3e-5, 1e-4, 1e-3, 1e-2];
/// Every so many windows of a run are used …
const WINDOW_STRIDE: usize = 3;
/// … with noise of its own, so that the gains are not fitted to the noise they are judged on.
const SEED: u64 = 0x5eed_0000;

/// How the paper's law does with one pair of gains.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Candidate {
    /// λ, 1/s.
    pub lambda_per_s: f64,
    /// Scale of γ.
    pub gamma: f64,
    /// Mean over runs, windows and both leaks of the mean coefficient error over the last 10 s, %;
    /// errors above 100 % count as 100 %.
    pub coefficient_mean_error_percent: f64,
}

/// Tries every pair on all `runs`; the best first.
///
/// # Errors
/// [`ReproduceError`].
pub fn best_gains(
    runs: &[Run],
    progress: impl Fn(Progress) + Sync,
) -> Result<Vec<Candidate>, ReproduceError> {
    let pairs: Vec<(f64, f64)> = LAMBDAS.iter().flat_map(|&l| RATIOS.map(|ratio| (l, l * ratio))).collect();
    let mut candidates =
        map_counted("searching gains of the paper's law", &pairs, progress, |&(lambda, gamma)| {
            try_gains(runs, lambda, gamma)
        })?;
    candidates.sort_by(|a, b| a.coefficient_mean_error_percent.total_cmp(&b.coefficient_mean_error_percent));
    Ok(candidates)
}

fn try_gains(runs: &[Run], lambda_per_s: f64, gamma: f64) -> Result<Candidate, ReproduceError> {
    let rig = paper_rig(lambda_per_s, gamma);
    let mut errors = Vec::new();
    for (number, run) in (0..).zip(runs) {
        for window in (0..WINDOWS).step_by(WINDOW_STRIDE) {
            let seed = SEED + 1000 * number + window as u64;
            let sensing = Sensing::new(rig.sensors(), Biases::default(), seed);
            let history = EstimateHistory::run(&rig, run.window(window), sensing)?;
            let truth = run.leaks_m3spa;
            errors.push(history.late_error(truth.internal, Leak::Internal));
            errors.push(history.late_error(truth.external_a, Leak::ExternalA));
        }
    }
    let percent = 100.0 * mean(errors.into_iter().map(|error| error.min(1.0)));
    Ok(Candidate { lambda_per_s, gamma, coefficient_mean_error_percent: percent })
}

/// The protocol's rig, estimated by the paper's law with these gains.
pub fn paper_rig(lambda_per_s: f64, gamma: f64) -> Rig {
    let mut rig = rig();
    rig.estimator.kind = EstimatorKind::Paper;
    rig.estimator.lambda_per_s = Some(lambda_per_s);
    rig.estimator.gamma = Some(gamma);
    rig
}
