//! Leaks and the spool's zero that go in straight lines through a window: what grows within a trace, and a null that drifts beside it.

use super::parts::{Normal, Part, Split, Summary, summed_up};
use super::unknowns::{Belief, LAPS, LEAKS, UNKNOWNS, Unknowns};
use nalgebra::{SMatrix, SVector};
use pitchleak_core::{Estimate, PerLeak};

/// Fewer parts tell no line from a step.
const LEAST_PARTS: usize = 6;
/// A spool's zero may walk by this share of the stroke along a line, 1 σ. A guess.
const NULL_WALK: f64 = 0.005;
/// The leaks, and the spool's zero, which opens two edges and closes two.
const RISES: usize = 4;
const BOTH: usize = UNKNOWNS + RISES;

type Columns = SMatrix<f64, UNKNOWNS, RISES>;

/// By how much leaks and the spool's zero rise in a window.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Line {
    rises: SVector<f64, RISES>,
    until_s: f64,
    span_s: f64,
}

/// What parts say that go in a line.
pub(super) struct InLine {
    pub line: Line,
    /// The unknowns at its end.
    pub end: Unknowns,
    pub summary: Summary,
    /// Squares that it explains.
    pub gain: f64,
}

impl Line {
    /// The same rises through these parts.
    fn through(self, parts: &[Part]) -> Option<Self> {
        let (first, last) = (parts.first()?, parts.last()?);
        let until_s = last.from_s + last.pressures.time_s;
        Some(Self { until_s, span_s: until_s - first.from_s, ..self })
    }

    /// What the rises do to the unknowns at a time, where those of the end are known.
    fn columns(&self, t_s: f64) -> Columns {
        let to_come = if self.span_s > 0.0 { (t_s - self.until_s) / self.span_s } else { 0.0 };
        let mut columns = Columns::zeros();
        (0..3).for_each(|leak| columns[(LEAKS + leak, leak)] = to_come);
        for (edge, sign) in [-1.0, 1.0, 1.0, -1.0].into_iter().enumerate() {
            columns[(LAPS + edge, 3)] = sign * to_come;
        }
        columns
    }

    /// The unknowns at a time, of those at the end.
    pub fn at(&self, end: &Unknowns, t_s: f64) -> Unknowns {
        if self.span_s > 0.0 { end + self.columns(t_s) * self.rises } else { *end }
    }

    /// Normal equations of the unknowns at the end and of what the rises are more than these.
    fn normal(
        &self,
        parts: &[Part],
        normals: &[Normal],
        before: &Belief,
        at: &Unknowns,
    ) -> (SMatrix<f64, BOTH, BOTH>, SVector<f64, BOTH>) {
        let mut information = SMatrix::<f64, BOTH, BOTH>::zeros();
        let mut right = SVector::<f64, BOTH>::zeros();
        let mut add = |normal: &Normal, columns: &Columns| {
            let mut both = SMatrix::<f64, UNKNOWNS, BOTH>::zeros();
            both.fixed_columns_mut::<UNKNOWNS>(0).fill_with_identity();
            both.fixed_columns_mut::<RISES>(UNKNOWNS).copy_from(columns);
            information += both.transpose() * normal.information * both;
            right += both.transpose() * normal.right;
        };
        add(&Normal::prior(before, at), &Columns::zeros());
        parts.iter().zip(normals).for_each(|(part, normal)| add(normal, &self.columns(part.middle_s())));
        for (place, std) in before.leak_std.into_iter().chain([NULL_WALK]).enumerate() {
            information[(UNKNOWNS + place, UNKNOWNS + place)] += std.powi(-2);
            right[UNKNOWNS + place] -= self.rises[place] * std.powi(-2);
        }
        (information, right)
    }
}

/// Parts in a line, made linear around the unknowns `at` its end and the `line` so far; none where they are too few.
pub(super) fn in_line(parts: &[Part], before: &Belief, at: &Unknowns, line: &Line) -> Option<InLine> {
    if parts.len() < LEAST_PARTS {
        return None;
    }
    let line = line.through(parts)?;
    let normals: Vec<Normal> = parts.iter().map(Part::normal).collect();
    let (information, right) = line.normal(parts, &normals, before, at);
    let factor = information.cholesky()?;
    let (step, covariance) = (factor.solve(&right), factor.inverse());
    let gain = step.dot(&right);
    let end = step.fixed_rows::<UNKNOWNS>(0).into_owned();
    let rises = step.fixed_rows::<RISES>(UNKNOWNS).into_owned();
    let own = covariance.fixed_view::<UNKNOWNS, UNKNOWNS>(0, 0).into_owned();
    let best = Split { step: end, information: own.cholesky()?.inverse(), gain };
    let moved = |place: usize| end + line.columns(parts[place].middle_s()) * rises;
    let summary = summed_up(parts, &normals, &best, &moved, before, at)?;
    let line = Line { rises: line.rises + rises, ..line };
    let growth = PerLeak::from_fn(|leak| {
        let place = UNKNOWNS + leak as usize;
        let rise = Estimate { value: line.rises[leak as usize], std: covariance[(place, place)].sqrt() };
        rise.scaled(1.0 / line.span_s)
    });
    let summary = Summary { growth: Some(growth), ..summary };
    gain.is_finite().then_some(InLine { line, end: at + end, summary, gain })
}
