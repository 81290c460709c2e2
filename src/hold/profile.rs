//! The likelihood of the leaks over the compressibility.
//!
//! Oil that leaks and oil that is compressed are one product: a leak found by falling pressures is known no better than κ. Which leaks there are
//! says in turn how well κ is known. So the likelihood is needed at every κ: it is smooth, and a polynomial through a few
//! Chebyshev points gives it (Berrut and Trefethen 2004, "Barycentric Lagrange interpolation", SIAM Review 46, eq. 5.4).

use crate::presence::LeakLikelihood;
use std::f64::consts::PI;

/// The profile reaches this far to either side of the likeliest κ, in its standard deviations.
const REACH: f64 = 4.0;
const POINTS: usize = 13;

/// Nodes over ln κ, κ in the rig file's.
#[derive(Clone, Debug)]
pub(super) struct Profile {
    middle: f64,
    half_width: f64,
    nodes: Vec<LeakLikelihood>,
}

/// Chebyshev points of the second kind on −1..1.
fn place(index: usize) -> f64 {
    (PI * index as f64 / (POINTS - 1) as f64).cos()
}

impl Profile {
    /// Around the likeliest ln κ and its standard deviation; `node` has the likelihood at a ln κ.
    pub fn new(middle: f64, std: f64, node: impl Fn(f64) -> Option<LeakLikelihood>) -> Option<Self> {
        let half_width = REACH * std;
        let nodes: Option<Vec<_>> =
            (0..POINTS).map(|index| node(middle + half_width * place(index))).collect();
        let nodes = nodes?;
        let is_finite = |node: &LeakLikelihood| {
            node.squares.is_finite()
                && node.information.iter().chain(&node.leaks).all(|number| number.is_finite())
        };
        nodes.iter().all(is_finite).then_some(Self { middle, half_width, nodes })
    }

    /// Least and greatest ln κ.
    pub fn range(&self) -> [f64; 2] {
        [self.middle - self.half_width, self.middle + self.half_width]
    }

    /// The likelihood at a ln κ within the range.
    pub fn at(&self, ln_kappa: f64) -> LeakLikelihood {
        let at = (ln_kappa - self.middle) / self.half_width;
        let (mut sum, mut all) = (LeakLikelihood::default(), 0.0);
        for (index, node) in self.nodes.iter().enumerate() {
            let off = at - place(index);
            if off.abs() < 1e-12 {
                return *node;
            }
            let end = if index == 0 || index + 1 == POINTS { 0.5 } else { 1.0 };
            let sign = if index % 2 == 0 { 1.0 } else { -1.0 };
            let weight = sign * end / off;
            sum = sum.plus(node, weight);
            all += weight;
        }
        LeakLikelihood::default().plus(&sum, 1.0 / all)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn between_its_points_the_profile_is_the_function() {
        let node =
            |x: f64| Some(LeakLikelihood { squares: 3.0 + (2.0 * x).exp(), ..LeakLikelihood::default() });
        let profile = Profile::new(0.1, 0.25, node).expect("finite");
        let [from, to] = profile.range();
        assert!((from + 0.9).abs() < 1e-12 && (to - 1.1).abs() < 1e-12);
        for k in 0..=50 {
            let x = from + (to - from) * f64::from(k) / 50.0;
            let error = profile.at(x).squares - 3.0 - (2.0 * x).exp();
            assert!(error.abs() < 1e-8, "{x} {error}");
        }
    }
}
