//! Scales that no unit has: a transmitter's range, per cent for millimetres, time at half its pace. The factor is the trace's
//! own, by least squares beside all leaks.
//!
//! ln f is as likely anywhere within a factor of [`MOST`], but near 1, where a gain is a sensor's error and no mistake. Gains
//! that are always free cover [`USUAL_GAIN`] of it, so the one factor that fits has that share of the range: Occam's factor of
//! a uniform prior (MacKay 2003, Information Theory, Inference, and Learning Algorithms, §28.1).

use super::candidates::{ln_sign, steady_columns, together};
use super::columns::{Column, Course};
use super::equations::NormalEquations;
use super::evidence::{Free, fit};
use super::hypothesis::{Hypothesis, LeakCourse, subsets};
use super::mended::Mended;
use super::pass::Pass;
use super::readings::{Mistake, Of};
use super::table::{Entry, Kind, USUAL_GAIN};
use crate::units::rounded;
use std::f64::consts::TAU;

/// Standard deviation of a share that may be any.
const ANY: f64 = 100.0;
/// Readings that are further off are units, or slipped decimal points. Chosen.
const MOST: f64 = 10.0;
/// Nearer to 1, ln, it is a gain, of which the table's largest is half as large. Chosen.
const LEAST_LN: f64 = 0.1;
/// How often it is looked for again in readings mended by it, where its own noise does no harm; numerical.
const REFINED: usize = 2;
/// Half a unit of the last of so many digits is less than a gain that is always free.
const DIGITS: usize = 3;

/// An entry, whose scale it is, and how it is told.
const SCALES: [(&str, Scaled, &str); 5] = [
    ("scale_qa", Scaled::Reading(Of::FlowA), "qa has another scale"),
    ("scale_qb", Scaled::Reading(Of::FlowB), "qb has another scale"),
    ("scale_flows", Scaled::Reading(Of::Flows), "qa and qb have another scale"),
    ("scale_x", Scaled::Reading(Of::Position), "x has another scale"),
    ("scale_t", Scaled::Time, "t has another scale"),
];

#[derive(Clone, Copy)]
enum Scaled {
    Reading(Of),
    Time,
}

impl Scaled {
    /// What takes up its scale beside the readings as declared.
    fn column(self) -> Column {
        match self {
            Self::Reading(Of::FlowA) => Column::GainA,
            Self::Reading(Of::FlowB) => Column::GainB,
            Self::Reading(Of::Position) => Column::Travel,
            // Flows are integrated over time.
            Self::Reading(_) | Self::Time => Column::Gains,
        }
    }

    /// How many times too large the readings are of which this share of what they show is none.
    fn factor(self, share: f64) -> f64 {
        match self {
            Self::Reading(Of::Position) => 1.0 / (1.0 + share),
            Self::Reading(_) | Self::Time => 1.0 / (1.0 - share),
        }
    }

    /// The same by the equations of readings that are as declared, or nearly mended.
    fn factor_by(self, pass: &Pass<'_, '_>, equations: &NormalEquations) -> Option<f64> {
        share(pass, equations, self.column()).map(|share| self.factor(share))
    }

    fn mistake(self, factor: f64) -> Mistake {
        match self {
            Self::Reading(of) => Mistake::Factor(of, factor),
            Self::Time => Mistake::Clock(factor),
        }
    }

    /// What no trace tells it from.
    fn alike(self) -> &'static [&'static str] {
        match self {
            Self::Reading(Of::FlowA) => &["area_a"],
            Self::Reading(Of::FlowB) => &["area_b"],
            _ => &["areas"],
        }
    }
}

/// Their entries in the table, each as frequent as a unit; the factor is none before it is found.
pub(super) fn entries(share: f64) -> impl Iterator<Item = Entry> {
    SCALES.into_iter().map(move |(id, scaled, text)| {
        Entry::new(id, Kind::Wiring, share, text)
            .remedy("Look at the range of the transmitter and the columns' units.", None)
            .alike(scaled.alike())
    })
}

/// These mistakes, with the scales that the readings would have.
pub(super) fn with_scales(pass: &Pass<'_, '_>) -> Vec<Entry> {
    let whole = pass.products.whole();
    let both = [Column::Gains, Column::Travel].map(|column| (column, Course::Constant));
    let columns = [steady_columns(), both.to_vec()].concat();
    let declared = pass.equations(&whole, None, &columns);
    let scatters = pass.over_sheet.all_scatter();
    let occam = USUAL_GAIN * TAU.sqrt() / (2.0 * MOST.ln());
    let mut mistakes = pass.tables.mistakes.clone();
    for entry in &mut mistakes {
        let Some((_, scaled, _)) = SCALES.into_iter().find(|(id, ..)| *id == entry.id) else { continue };
        let mistake = |factor: f64| is_scale(factor).then(|| scaled.mistake(rounded(factor, DIGITS)));
        entry.share *= occam;
        let mut factor = scaled.factor_by(pass, &declared);
        entry.mistake = factor.and_then(mistake);
        for _ in 0..REFINED {
            let Some(found) = entry.mistake else { break };
            let equations = pass.equations(&whole, Some(entry), &columns);
            let mended = Mended::new(equations, &declared, found, scatters);
            let left = scaled.factor_by(pass, &mended.equations);
            factor = factor.zip(left).map(|(factor, left)| factor * left);
            entry.mistake = factor.and_then(mistake);
        }
    }
    mistakes
}

fn is_scale(factor: f64) -> bool {
    factor.is_finite() && (LEAST_LN..MOST.ln()).contains(&factor.ln().abs())
}

/// The share of a column that fits best beside zeros slightly off and any steady leaks, of readings that it is part of.
fn share(pass: &Pass<'_, '_>, equations: &NormalEquations, column: Column) -> Option<f64> {
    let place = equations.place(column, Course::Constant)?;
    let state = pass.slightly_off()?;
    let fits = subsets().map(|subset| {
        let leaks = together(subset, LeakCourse::Constant);
        let mut own = Hypothesis::new(equations, &pass.sizes, pass.segments, state, leaks, 0.0);
        let at = set_free(&mut own.free, place);
        let fit = fit(equations, &own.free);
        (fit.ln_evidence + own.ln_prior + ln_sign(&fit, &own.positive), fit.means[at])
    });
    fits.max_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, share)| share)
}

/// Lets a column be any share of itself, in its own place where it was free before; gives that.
fn set_free(free: &mut Vec<Free>, column: usize) -> usize {
    let at = free.iter().position(|known| known.column == column).unwrap_or_else(|| {
        free.push(Free { column, std: ANY });
        free.len() - 1
    });
    free[at].std = ANY;
    at
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of readings four times too large three quarters are none, of a position that is read four times too
    /// large as much of what it shows is too much.
    #[test]
    fn a_share_of_the_readings_tells_their_scale() {
        for of in [Scaled::Reading(Of::FlowA), Scaled::Reading(Of::Flows), Scaled::Time] {
            assert!((of.factor(0.75) - 4.0).abs() < 1e-12);
        }
        assert!((Scaled::Reading(Of::Position).factor(-0.75) - 4.0).abs() < 1e-12);
    }

    /// What is near 1 is a gain, what is beyond a decimal point a unit.
    #[test]
    fn a_scale_is_neither_a_gain_nor_a_unit() {
        let scales = [0.09, 0.11, 0.85, 0.95, 1.0, 1.05, 1.15, 9.9, 10.1, f64::NAN, -2.0].map(is_scale);
        assert_eq!(scales, [false, true, true, false, false, false, true, true, false, false, false]);
    }
}
