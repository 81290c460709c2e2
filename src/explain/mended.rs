//! Equations of readings whose wiring is mended, comparable with those of the readings as declared.
//!
//! Readings without motion are noise in every unit: what makes that quieter or louder explains nothing, so the measure
//! counts against a mistake alone. What does tell is a scatter that the sheet does not allow; one that is better than the
//! sheet is no mistake. Where the declared noise and the scatter differ, the smaller change counts.

use super::equations::NormalEquations;
use super::evidence::ln_scale_prior;
use super::readings::Mistake;
use pitchleak_core::continuity::EQUATIONS;

/// The equation without the piston's motion. How fast it moves is not known beforehand, so that of the other no density of
/// flow and position together is known: with v ~ N(0, V²) of any scale V, a unit f of both flows costs ln f by the flows'
/// density and gives it back by V, which is f times smaller.
const BALANCE: usize = 0;

/// Noise whose mean square is so many standard deviations above its own is chance, and no misfit that a mistake explains. Chosen.
const CHANCE_SIGMAS: f64 = 2.0;

/// Rows are measured by the noise that they have once mended, as the declared ones are by theirs.
pub(super) struct Mended {
    pub equations: NormalEquations,
    /// ln of what that changes of the evidence.
    pub ln_measure: f64,
    /// The noise's unit, in that of the readings as declared, squared.
    pub unit: [f64; EQUATIONS],
    /// Noise scales of the readings' own scatter, as far as the best explanation as declared leaves it; 0 where nothing is
    /// known of it.
    left: [f64; EQUATIONS],
}

impl Mended {
    /// Of readings without this mistake; the best explanation as declared has the noise `scales`.
    pub fn new(
        mended: NormalEquations,
        declared: &NormalEquations,
        mistake: Mistake,
        scales: [f64; EQUATIONS],
    ) -> Self {
        let ln_jacobian = mistake.ln_jacobian();
        let (mut louder, mut scattered, mut left) = ([1.0; EQUATIONS], [1.0; EQUATIONS], [0.0; EQUATIONS]);
        let (mut ln_measure, mut ln_noise) = (0.0, 0.0);
        for equation in 0..EQUATIONS {
            let ([own, own_scatter], [other, scatter]) =
                (mended.left_noise(equation), declared.left_noise(equation));
            if [own, own_scatter, other, scatter].iter().any(|noise| *noise <= 0.0) {
                continue;
            }
            louder[equation] = (own / other).min(own_scatter / scatter);
            scattered[equation] = own_scatter / (other * louder[equation]);
            let chance = 1.0 + CHANCE_SIGMAS * (2.0 / declared.rows[equation].max(1.0)).sqrt();
            left[equation] = (scales[equation] * other / scatter).min(chance) * scattered[equation];
            if equation == BALANCE {
                ln_measure +=
                    mended.rows[equation] * (ln_jacobian / EQUATIONS as f64 - 0.5 * louder[equation].ln());
            }
            // A clock scales no reading.
            let sheet = if matches!(mistake, Mistake::Clock(_)) { own } else { other };
            ln_noise += ln_scale_prior(own_scatter / sheet) - ln_scale_prior((scatter / other).max(1.0));
        }
        Self {
            equations: mended.measured_by(louder, scattered.map(|scale| scale.max(1.0))),
            ln_measure: ln_measure.min(0.0) + ln_noise,
            unit: louder,
            left,
        }
    }

    /// ln of what is taken back from a fit whose noise scales are below what the readings' own scatter leaves as declared: a
    /// mistake turns noise into other noise, which by chance may be smaller.
    pub fn ln_chance(&self, scales: [f64; EQUATIONS]) -> f64 {
        let one = |equation: usize| {
            let left = self.left[equation];
            if left > scales[equation] {
                -0.5 * self.equations.rows[equation] * (left / scales[equation]).ln()
            } else {
                0.0
            }
        };
        (0..EQUATIONS).map(one).sum()
    }
}
