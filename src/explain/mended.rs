//! Equations of readings whose wiring is mended, comparable with those of the readings as declared.
//!
//! Readings without motion are noise in every unit: what makes that quieter or louder explains nothing, so the measure
//! counts against a mistake alone. What does tell is a scatter that the sheet does not allow; one that is better than the
//! sheet is no mistake. Where the declared noise and the scatter differ, the smaller change counts.
//!
//! A unit makes the noise of its readings another one by just its factor, so its rows stay in the sheet's noise, and how
//! loud they are with and without it is taken off: only what is left beyond the readings' own scatter tells. A fit as
//! declared that falls far below that scatter has explained noise, which is held against no unit.

use super::equations::NormalEquations;
use super::evidence::ln_scale_prior;
use super::leak_sample::Weighing;
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
    /// The noise's unit, in that of the sheet for readings without the mistake, squared.
    pub unit: [f64; EQUATIONS],
    /// Noise scales that the readings' own scatter makes, at least 1 in the sheet's noise.
    loudness: [f64; EQUATIONS],
    /// Noise scales below which a fit has explained noise by chance; 0 where nothing is known of it.
    left: [f64; EQUATIONS],
    /// ln of what the best explanation as declared gained by that.
    ln_declared: f64,
}

impl Mended {
    /// Of readings without this mistake, all of which scatter or not; the best explanation as declared has the noise `scales`.
    pub fn new(
        mended: NormalEquations,
        declared: &NormalEquations,
        mistake: Mistake,
        scales: [f64; EQUATIONS],
        scatters: bool,
    ) -> Self {
        let ln_jacobian = mistake.ln_jacobian();
        let (mut louder, mut scattered, mut left) = ([1.0; EQUATIONS], [1.0; EQUATIONS], [0.0; EQUATIONS]);
        let (mut ln_measure, mut ln_noise) = (0.0, 0.0);
        let (mut unit, mut loudness, mut ln_declared) = ([1.0; EQUATIONS], [1.0; EQUATIONS], 0.0);
        let is_unit = scatters && matches!(mistake, Mistake::Factor(..));
        let mut rows = [1.0; EQUATIONS];
        for equation in 0..EQUATIONS {
            let ([own, own_scatter], [other, scatter]) =
                (mended.left_noise(equation), declared.left_noise(equation));
            if [own, own_scatter, other, scatter].iter().any(|noise| *noise <= 0.0) {
                continue;
            }
            louder[equation] = (own / other).min(own_scatter / scatter);
            if !is_unit {
                rows[equation] = louder[equation];
            }
            scattered[equation] = own_scatter / (other * rows[equation]);
            let by_chance = CHANCE_SIGMAS * (2.0 / declared.rows[equation].max(1.0)).sqrt();
            left[equation] = scattered[equation];
            if is_unit {
                if scales[equation] < (1.0 - by_chance) * scatter / other {
                    ln_declared += ln_below(declared.rows[equation], scales[equation], scatter / other);
                }
            } else {
                left[equation] *= (scales[equation] * other / scatter).min(1.0 + by_chance);
            }
            if equation == BALANCE {
                ln_measure +=
                    mended.rows[equation] * (ln_jacobian / EQUATIONS as f64 - 0.5 * louder[equation].ln());
            }
            // A clock scales no reading.
            let sheet = if matches!(mistake, Mistake::Clock(_)) { own } else { other };
            unit[equation] = rows[equation] * other / sheet;
            loudness[equation] = (own_scatter / sheet).max(1.0) / unit[equation];
            ln_noise += if is_unit {
                0.5 * mended.rows[equation] * louder[equation].ln()
            } else {
                ln_scale_prior(own_scatter / sheet) - ln_scale_prior((scatter / other).max(1.0))
            };
        }
        Self {
            equations: mended.measured_by(rows, scattered.map(|scale| scale.max(1.0))),
            ln_measure: ln_measure.min(0.0) + ln_noise,
            unit,
            loudness,
            left,
            ln_declared,
        }
    }

    /// What its explanations are weighed by.
    pub fn weighing(&self) -> Weighing<'_> {
        Weighing { equations: &self.equations, loudness: self.loudness }
    }

    /// ln of what is taken back from a fit whose noise scales are below what the readings' own scatter leaves as declared: a
    /// mistake turns noise into other noise, which by chance may be smaller. Where units are weighed it is taken back from
    /// what is held against them, too.
    pub fn ln_chance(&self, scales: [f64; EQUATIONS]) -> f64 {
        let one = |c: usize| ln_below(self.equations.rows[c], scales[c], self.left[c]);
        self.ln_declared - (0..EQUATIONS).map(one).sum::<f64>()
    }
}

/// ln of what a noise scale below `left` gains.
fn ln_below(rows: f64, scale: f64, left: f64) -> f64 {
    if left > scale { 0.5 * rows * (left / scale).ln() } else { 0.0 }
}
