//! Equations of readings whose wiring is mended, comparable with those of the readings as declared.
//!
//! Readings without motion are noise in every unit: what makes that quieter or louder explains nothing, so the measure
//! counts against a mistake alone. What does tell is a scatter that the sheet does not allow; one that is better than the
//! sheet is no mistake. Where the declared noise and the scatter differ, the smaller change counts.
//!
//! A unit makes the noise of its readings another one by just its factor, so its rows stay in the sheet's noise, and how
//! loud they are with and without it is taken off: only what is left beyond the readings' own scatter tells.

use super::equations::NormalEquations;
use super::evidence::ln_scale_prior;
use super::leak_sample::Weighing;
use super::readings::Mistake;
use pitchleak_core::continuity::EQUATIONS;

/// The equation without the piston's motion. How fast it moves is not known beforehand, so that of the other no density of
/// flow and position together is known: with v ~ N(0, V²) of any scale V, a unit f of both flows costs ln f by the flows'
/// density and gives it back by V, which is f times smaller.
const BALANCE: usize = 0;

/// Rows are measured by the noise that they have once mended, as the declared ones are by theirs.
pub(super) struct Mended {
    pub equations: NormalEquations,
    /// ln of what that changes of the evidence.
    pub ln_measure: f64,
    measures: [Measure; EQUATIONS],
}

/// One equation's noise in its left side: by the sheet and as the readings scatter, mended and as declared.
struct Noise {
    own: f64,
    own_scatter: f64,
    other: f64,
    scatter: f64,
}

/// How one equation is measured.
#[derive(Clone, Copy)]
struct Measure {
    /// The unit of its rows, in the noise as declared, squared; …
    unit: f64,
    /// … the same in the sheet's noise for readings without the mistake.
    unit_of_sheet: f64,
    /// How much more the readings scatter than the unit.
    scattered: f64,
    /// ln of what the noise changes of the evidence.
    ln_noise: f64,
}

impl Default for Measure {
    fn default() -> Self {
        Self { unit: 1.0, unit_of_sheet: 1.0, scattered: 1.0, ln_noise: 0.0 }
    }
}

impl Noise {
    /// None where an equation has no rows.
    fn of(mended: &NormalEquations, declared: &NormalEquations, equation: usize) -> Option<Self> {
        let ([own, own_scatter], [other, scatter]) =
            (mended.left_noise(equation), declared.left_noise(equation));
        let is_there = [own, own_scatter, other, scatter].iter().all(|noise| *noise > 0.0);
        is_there.then_some(Self { own, own_scatter, other, scatter })
    }

    /// How many times louder the rows are without the mistake, squared: the smaller change counts.
    fn louder(&self) -> f64 {
        (self.own / self.other).min(self.own_scatter / self.scatter)
    }

    /// Of so many readings in another unit.
    fn measure_unit(&self, rows: f64) -> Measure {
        let scattered = self.own_scatter / self.other;
        Measure { scattered, ln_noise: 0.5 * rows * self.louder().ln(), ..Measure::default() }
    }

    /// Of another clock: it scales no reading, but over how long its noise is summed.
    fn measure_clock(&self) -> Measure {
        let unit = self.louder();
        let scattered = self.own_scatter / (self.other * unit);
        Measure { unit, unit_of_sheet: unit * self.other / self.own, scattered, ln_noise: 0.0 }
    }

    /// Of any other mistake: it turns noise into other noise, which by chance may be smaller. Readings better than their sheet
    /// may be so once mended, too.
    fn measure(&self) -> Measure {
        let unit = self.louder();
        let as_usual = (self.own_scatter / self.other).clamp((self.scatter / self.other).min(1.0), 1.0);
        Measure {
            unit,
            unit_of_sheet: unit,
            scattered: self.own_scatter / (self.other * unit),
            ln_noise: ln_scale_prior(self.own_scatter / self.other / as_usual)
                - ln_scale_prior((self.scatter / self.other).max(1.0)),
        }
    }
}

impl Measure {
    /// Noise scale that the readings' own scatter makes, at least the sheet's.
    fn loudness(&self) -> f64 {
        (self.scattered * self.unit_of_sheet).max(1.0) / self.unit_of_sheet
    }
}

impl Mended {
    /// Of readings without this mistake, all of which scatter or not.
    pub fn new(
        mended: NormalEquations,
        declared: &NormalEquations,
        mistake: Mistake,
        scatters: bool,
    ) -> Self {
        let noises = [0, 1].map(|equation| Noise::of(&mended, declared, equation));
        let measure = |equation: usize| {
            noises[equation].as_ref().map_or_else(Measure::default, |noise| match mistake {
                Mistake::Factor(..) if scatters => noise.measure_unit(mended.rows[equation]),
                Mistake::Clock(_) => noise.measure_clock(),
                _ => noise.measure(),
            })
        };
        let measures = [0, 1].map(measure);
        let per_row = |noise: &Noise| mistake.ln_jacobian() / EQUATIONS as f64 - 0.5 * noise.louder().ln();
        let ln_density = noises[BALANCE].as_ref().map_or(0.0, |noise| mended.rows[BALANCE] * per_row(noise));
        let scattered = measures.map(|own| own.scattered.max(1.0));
        Self {
            ln_measure: ln_density.min(0.0) + measures.iter().map(|own| own.ln_noise).sum::<f64>(),
            equations: mended.measured_by(measures.map(|own| own.unit), scattered),
            measures,
        }
    }

    /// What its explanations are weighed by.
    pub fn weighing(&self) -> Weighing<'_> {
        Weighing { equations: &self.equations, loudness: self.measures.map(|own| own.loudness()) }
    }

    /// The larger residual, in the sheet's noise for readings without the mistake, of a fit of these noise scales.
    pub fn residual(&self, scales: [f64; EQUATIONS]) -> f64 {
        let each = self.measures.iter().zip(scales).map(|(own, scale)| scale * own.unit_of_sheet);
        each.fold(0.0, f64::max).sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn noise(own: f64, own_scatter: f64, other: f64, scatter: f64) -> Noise {
        Noise { own, own_scatter, other, scatter }
    }

    fn assert_is(found: f64, expected: f64) {
        assert!((found - expected).abs() < 1e-12, "{found}, not {expected}");
    }

    /// Readings that scatter as much as their sheet says, less, or more.
    #[test]
    fn what_changes_no_noise_costs_nothing_and_gains_nothing() {
        for scatter in [3.0, 1.5, 12.0] {
            let own = noise(3.0, scatter, 3.0, scatter);
            for measure in [own.measure(), own.measure_clock(), own.measure_unit(40.0)] {
                assert_is(measure.unit, 1.0);
                assert_is(measure.unit_of_sheet, 1.0);
                assert_is(measure.scattered, scatter / 3.0);
                assert_is(measure.ln_noise, 0.0);
                assert_is(measure.loudness(), (scatter / 3.0).max(1.0));
            }
        }
    }

    /// Of readings as loud as their sheet a mistake that would make them quieter or louder has to be less
    /// likely, of those that are quieter so may be the mended ones; and the smaller change counts.
    #[test]
    fn noise_that_a_mistake_changes_counts_by_the_sheet() {
        assert!(noise(2.0, 12.0, 2.0, 2.0).measure().ln_noise < -1.0);
        assert!(noise(2.0, 0.5, 2.0, 2.0).measure().ln_noise < -1.0);
        assert!(noise(2.0, 2.0, 2.0, 12.0).measure().ln_noise > 1.0);
        assert_is(noise(2.0, 1.0, 2.0, 0.5).measure().ln_noise, 0.0);
        assert_is(noise(2.0, 0.5, 2.0, 0.5).measure().ln_noise, 0.0);
        assert_is(noise(6.0, 4.0, 2.0, 2.0).louder(), 2.0);
        assert_is(noise(4.0, 6.0, 2.0, 2.0).louder(), 2.0);
        let louder = noise(6.0, 4.0, 2.0, 2.0).measure();
        assert_is(louder.unit, 2.0);
        assert_is(louder.unit_of_sheet, 2.0);
        assert_is(louder.scattered, 1.0);
    }

    /// A unit makes each row as many times louder, and no noise any other; a clock makes the rows louder
    /// whose noise it sums.
    #[test]
    fn a_unit_scales_readings_and_a_clock_their_sums() {
        let unit = noise(8.0, 8.0, 2.0, 2.0).measure_unit(30.0);
        assert_is(unit.ln_noise, 15.0 * 4.0_f64.ln());
        assert_is(unit.scattered, 4.0);
        assert_is(unit.unit, 1.0);
        let clock = noise(8.0, 6.0, 2.0, 1.0).measure_clock();
        assert_is(clock.unit, 4.0);
        assert_is(clock.unit_of_sheet, 1.0);
        assert_is(clock.scattered, 0.75);
        assert_is(clock.ln_noise, 0.0);
    }
}
