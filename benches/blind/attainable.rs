//! How often the exact likelihood itself would put the true effect first.

use pitchleak::core::Effect;
use pitchleak::core::effects::EffectConstants;
use pitchleak::diagnose::Collinearity;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

const DRAWS: u64 = 2000;
/// Added to the correlations' diagonal, which fitted constants leave nearly singular.
const WHIFF: f64 = 1e-9;

/// What could be expected of one effect of one size.
#[derive(Clone, Copy, Default, Debug)]
pub struct Attainable {
    /// Share of draws in which its score is the largest and large enough to be named.
    pub first: f64,
    /// Standard deviations between it and its nearest rival.
    pub apart_sigma: f64,
    pub rival: &'static str,
}

/// Lower Cholesky factor.
fn factor(matrix: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let n = matrix.len();
    let mut lower = vec![vec![0.0; n]; n];
    for i in 0..n {
        for j in 0..=i {
            let sum: f64 = (0..j).map(|k| lower[i][k] * lower[j][k]).sum();
            lower[i][j] = if i == j {
                (matrix[i][i] + WHIFF - sum).max(WHIFF).sqrt()
            } else {
                (matrix[i][j] - sum) / lower[j][j]
            };
        }
    }
    lower
}

/// Draws the scores of all candidates: their mean follows from the correlation with the truth's column, their
/// covariance is the correlation itself. Sizes that physics forbids do not compete, and fitted constants
/// pay for their trials as in the diagnosis.
pub fn attainable(
    collinearity: &Collinearity,
    truth: Effect,
    constants: EffectConstants<f64>,
    size: f64,
) -> Option<Attainable> {
    let candidates = &collinearity.candidates;
    let at = candidates.iter().rposition(|one| one.effect == truth && one.constants == constants);
    let at = at.or_else(|| candidates.iter().position(|one| one.effect == truth))?;
    let sigma = size / candidates[at].std;
    let toward = &collinearity.correlation[at];
    let rivals = candidates.iter().zip(toward).filter(|(one, _)| one.effect != truth);
    let (nearest, r) = rivals.max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()))?;
    let lower = factor(&collinearity.correlation);
    let mut random = ChaCha8Rng::seed_from_u64(truth as u64);
    let first = (0..DRAWS)
        .filter(|_| {
            let unit: Vec<f64> = candidates.iter().map(|_| StandardNormal.sample(&mut random)).collect();
            let scores = lower.iter().zip(toward).map(|(row, r)| {
                let noise: f64 = row.iter().zip(&unit).map(|(l, u)| l * u).sum();
                r * sigma + noise
            });
            let named = candidates
                .iter()
                .zip(scores)
                .filter(|(one, z)| one.effect.spec().lower < 0.0 || *z > 0.0)
                .map(|(one, z)| (one.effect, z * z - one.critical_sigma.powi(2)))
                .max_by(|a, b| a.1.total_cmp(&b.1));
            named.is_some_and(|(effect, beyond)| effect == truth && beyond > 0.0)
        })
        .count();
    Some(Attainable {
        first: first as f64 / DRAWS as f64,
        apart_sigma: sigma * (1.0 - r * r).max(0.0).sqrt(),
        rival: nearest.effect.spec().id,
    })
}
