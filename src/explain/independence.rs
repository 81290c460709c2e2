//! How many of a trace's blocks are independent: what remains of the readings under an explanation scatters from segment
//! to segment as white noise makes it, or more, where noise is coloured or an effect is missing that comes and goes.
//!
//! Cochran's Q (Cochran 1954, "The combination of estimates from different experiments", Biometrics 10, 101): segment s
//! says g_s = k'r_s of a column k, with the information i_s = k'k_s; Q = Σ g_s²/(i_s s²) − (Σ g_s)²/(Σ i_s s²) is χ² of
//! S − 1 degrees of freedom where blocks are independent. Where it is f times as large, n blocks are worth n/f (the
//! likelihood is raised to 1/f; Miller, Dunson 2019, "Robust Bayesian inference via coarsening", JASA 114, 1113).

use super::columns::{Column, Course, Scales};
use super::equations::NormalEquations;
use super::evidence::Fit;
use super::hypothesis::{Hypothesis, LEAK_COLUMNS};
use super::raw_products::{RawProducts, SegmentProducts};
use pitchleak_core::continuity::{COLUMNS, EQUATIONS};

/// By how much fewer blocks each equation is worth, at least 1.
pub(super) fn inflation(
    products: &RawProducts,
    scales: &Scales<'_>,
    equations: &NormalEquations,
    columns: &[(Column, Course)],
    hypothesis: &Hypothesis<'_>,
    fit: &Fit,
) -> [f64; EQUATIONS] {
    let slow = [Column::ZeroA, Column::ZeroB].into_iter().chain(LEAK_COLUMNS);
    let slow: Vec<Vec<f64>> = slow.map(|column| combination(scales, column, [1.0, 0.0])).collect();
    [0, 1].map(|equation| {
        let residual = |index: usize, segment: &SegmentProducts| {
            let mut sum = combination(scales, Column::LeftSide, [1.0, 0.0]);
            for (free, mean) in hypothesis.free.iter().zip(&fit.means) {
                if equations.gram(equation).row(free.column)[free.column] > 0.0 {
                    let (column, course) = columns[free.column];
                    let shares = course.shares(index, segment.span_s(), products.total_s);
                    let own = combination(scales, column, shares);
                    sum.iter_mut().zip(own).for_each(|(sum, own)| *sum -= mean * own);
                }
            }
            sum
        };
        let scale = fit.scales[equation];
        let mut scores = vec![Vec::new(); slow.len()];
        for (index, segment) in products.segments.iter().enumerate() {
            let residual = residual(index, segment);
            for (own, scores) in slow.iter().zip(&mut scores) {
                let score = segment.product(equation, own, &residual, scale);
                let information = segment.product(equation, own, own, scale);
                if information > 0.0 {
                    scores.push((score, information));
                }
            }
        }
        let found: Vec<f64> = scores.iter().filter_map(|scores| excess(scores, scale)).collect();
        let mean = found.iter().sum::<f64>() / found.len().max(1) as f64;
        mean.max(1.0)
    })
}

/// Q over what chance makes of it: its mean and a standard deviation.
fn excess(scores: &[(f64, f64)], scale: f64) -> Option<f64> {
    let freedom = scores.len().checked_sub(1).filter(|freedom| *freedom > 0)? as f64;
    let (score, information) =
        scores.iter().fold((0.0, 0.0), |sum, (score, information)| (sum.0 + score, sum.1 + information));
    let squares: f64 = scores.iter().map(|(score, information)| score * score / information).sum();
    let q = (squares - score * score / information) / scale;
    Some(q / (freedom + (2.0 * freedom).sqrt()))
}

fn combination(scales: &Scales<'_>, column: Column, shares: [f64; 2]) -> Vec<f64> {
    let [plain, moment] = scales.column(column);
    let both = plain.iter().flatten().zip(moment.iter().flatten());
    both.map(|(plain, moment)| shares[0] * plain + shares[1] * moment).collect()
}

impl SegmentProducts {
    /// Product of two columns less what noise of this scale makes of it.
    fn product(&self, equation: usize, one: &[f64], other: &[f64], scale: f64) -> f64 {
        let (gram, noise) = (&self.gram[equation], &self.noise[equation]);
        let mut sum = 0.0;
        for (i, by) in one.iter().enumerate().filter(|(_, by)| **by != 0.0) {
            let row = i * COLUMNS..(i + 1) * COLUMNS;
            let cells = gram[row.clone()].iter().zip(&noise[row]).zip(other);
            sum += by * cells.map(|((gram, noise), other)| (gram - scale * noise) * other).sum::<f64>();
        }
        sum
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Scores of segments that agree have none, and white ones as much as chance makes of its mean and a
    /// standard deviation.
    #[test]
    fn excess_is_the_scatter_of_the_segments_over_that_of_chance() {
        let is = |scores: &[(f64, f64)], scale: f64, expected: f64| {
            let found = excess(scores, scale).expect("two segments");
            assert!((found - expected).abs() < 1e-12, "{found} {expected}");
        };
        is(&[(2.0, 1.0), (4.0, 2.0), (6.0, 3.0)], 1.0, 0.0);
        // Of two segments that say 1 and −1 of information 4 and 1: 4 + 1 − 3²/5, of one degree of freedom.
        is(&[(4.0, 4.0), (-1.0, 1.0)], 1.0, 3.2 / (1.0 + 2.0_f64.sqrt()));
        is(&[(4.0, 4.0), (-1.0, 1.0)], 2.0, 1.6 / (1.0 + 2.0_f64.sqrt()));
        is(&[(1.0, 1.0), (-1.0, 1.0), (0.0, 1.0)], 1.0, 2.0 / 4.0);
        assert!(excess(&[(4.0, 4.0)], 1.0).is_none() && excess(&[], 1.0).is_none());
    }
}
