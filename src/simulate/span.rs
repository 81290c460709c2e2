use crate::units::{self, Dimension, UnitError};
use serde::Serialize;

/// Part of a trace, s from its beginning; an end that is not given is infinite.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Span {
    /// First instant.
    pub from_s: f64,
    /// First instant after it.
    pub to_s: f64,
}

/// Why a text is no span.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum SpanError {
    /// No `..`.
    #[error("`{0}` is no span of time: write e.g. `10 s..300 s`, `10 s..` or `..300 s`")]
    Form(String),
    /// An end is no time.
    #[error(transparent)]
    Unit(#[from] UnitError),
    /// It ends before it begins.
    #[error("`{0}` ends before it begins")]
    Order(String),
}

impl Span {
    /// Before, during and after the trace.
    pub const ALWAYS: Self = Self { from_s: f64::NEG_INFINITY, to_s: f64::INFINITY };
    /// Times are multiples of a step and miss a given instant by rounding only.
    const ROUNDING_S: f64 = 1e-9;

    /// Whether it holds this instant.
    pub fn contains(&self, t_s: f64) -> bool {
        t_s >= self.from_s - Self::ROUNDING_S && t_s < self.to_s - Self::ROUNDING_S
    }

    /// Ends that are not given are those of a trace of this length.
    #[must_use]
    pub fn within_trace(self, duration_s: f64) -> Self {
        Self { from_s: self.from_s.max(0.0), to_s: self.to_s.min(duration_s.max(self.from_s)) }
    }

    /// Share of it that has passed, 0 to 1.
    pub fn passed(&self, t_s: f64) -> f64 {
        ((t_s - self.from_s) / (self.to_s - self.from_s)).clamp(0.0, 1.0)
    }
}

impl std::str::FromStr for Span {
    type Err = SpanError;

    /// `10 s..300 s`, `10 s..`, `..300 s`; a bare number is in seconds.
    fn from_str(text: &str) -> Result<Self, SpanError> {
        let (from, to) = text.split_once("..").ok_or_else(|| SpanError::Form(text.trim().to_owned()))?;
        let end = |text: &str, open: f64| match text.trim() {
            "" => Ok(open),
            given => units::parse(given, Dimension::Time),
        };
        let span = Self { from_s: end(from, f64::NEG_INFINITY)?, to_s: end(to, f64::INFINITY)? };
        if span.from_s < span.to_s { Ok(span) } else { Err(SpanError::Order(text.trim().to_owned())) }
    }
}

/// What stands before an `@`, and the span behind it.
pub(super) fn split_span(text: &str) -> Result<(&str, Option<Span>), SpanError> {
    match text.split_once('@') {
        None => Ok((text, None)),
        Some((what, span)) => Ok((what, Some(span.parse()?))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_span_is_two_times_or_one() {
        let span = |text: &str| text.parse::<Span>();
        assert_eq!(span("10 s..5 min"), Ok(Span { from_s: 10.0, to_s: 300.0 }));
        assert_eq!(span("10.."), Ok(Span { from_s: 10.0, ..Span::ALWAYS }));
        assert_eq!(span(".. 300 s"), Ok(Span { to_s: 300.0, ..Span::ALWAYS }));
        assert!(matches!(span("10 s"), Err(SpanError::Form(_))));
        assert!(matches!(span("10 s..9 s"), Err(SpanError::Order(_))));
        assert!(matches!(span("10 bar.."), Err(SpanError::Unit(_))));
    }

    #[test]
    fn an_instant_that_rounding_misses_is_inside() {
        let span = Span { from_s: 0.3, to_s: 0.7 };
        assert!(span.contains(3.0 * 0.1) && span.contains(0.1 + 0.2) && !span.contains(7.0 * 0.1));
        assert!(!span.contains(0.299) && Span::ALWAYS.contains(-1e9));
    }
}
