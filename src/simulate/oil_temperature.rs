use super::span::{Span, SpanError, split_span};
use crate::curve::Curve;
use crate::reference::{ReferenceError, constant_or_file};
use crate::units::{self, Dimension, UnitError};
use crate::viscosity::{GRADE_K, viscosity_mm2ps};

/// Temperature of the oil through the trace.
#[derive(Clone, Debug, PartialEq)]
pub enum OilTemperature {
    /// From one temperature (K) to another in a straight line.
    Ramp {
        /// Before the span.
        from_k: f64,
        /// After the span.
        to_k: f64,
        /// While it changes.
        during: Span,
    },
    /// As recorded, K; the time counts from the beginning of the trace.
    Recorded(Curve),
}

/// Why a text gives no temperature.
#[derive(Debug, thiserror::Error)]
pub enum OilTemperatureError {
    /// Neither a quantity nor a file that can be read.
    #[error(transparent)]
    Reference(#[from] ReferenceError),
    /// A temperature of a ramp.
    #[error(transparent)]
    Unit(#[from] UnitError),
    /// The time of a ramp.
    #[error(transparent)]
    Span(#[from] SpanError),
    /// Oil is neither ice nor on fire.
    #[error("the oil temperature must lie between -40 °C and 150 °C")]
    Range,
}

/// Coldest and hottest oil, K.
const RANGE_K: std::ops::RangeInclusive<f64> = 233.15..=423.15;

impl OilTemperature {
    /// `40 °C`, `20 °C -> 60 °C @ 0 s..600 s`, or a CSV file with `t_s` and `temp_c`.
    ///
    /// # Errors
    /// [`OilTemperatureError`].
    pub fn of(text: &str, duration_s: f64) -> Result<Self, OilTemperatureError> {
        let temperature = |text: &str| units::parse(text, Dimension::Temperature);
        let Some((first, rest)) = text.split_once("->").or_else(|| text.split_once('→')) else {
            let curve = constant_or_file(text, "temp", Dimension::Temperature)?;
            let (begin, end) = curve.span_s();
            let inside = [begin, end].iter().all(|t| RANGE_K.contains(&curve.at(*t)));
            return if inside { Ok(Self::Recorded(curve)) } else { Err(OilTemperatureError::Range) };
        };
        let (last, during) = split_span(rest)?;
        let (from_k, to_k) = (temperature(first)?, temperature(last)?);
        if ![from_k, to_k].iter().all(|end| RANGE_K.contains(end)) {
            return Err(OilTemperatureError::Range);
        }
        let during = during.unwrap_or(Span::ALWAYS).within_trace(duration_s);
        Ok(Self::Ramp { from_k, to_k, during })
    }

    /// At a time, K.
    pub fn at(&self, t_s: f64) -> f64 {
        match self {
            Self::Ramp { from_k, to_k, during } => from_k + (to_k - from_k) * during.passed(t_s),
            Self::Recorded(curve) => curve.at(t_s).clamp(*RANGE_K.start(), *RANGE_K.end()),
        }
    }

    /// How much more a laminar leak lets through at this time than at 40 °C, where its size holds: the inverse ratio of the
    /// viscosities. The oil's thermal expansion (0.07 % per kelvin) is left out.
    pub(crate) fn leak_factor(&self, t_s: f64) -> f64 {
        viscosity_mm2ps(GRADE_K) / viscosity_mm2ps(self.at(t_s))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn warm_oil_leaks_more() {
        let warming = OilTemperature::of("40 °C -> 60 °C @ 10 s..20 s", 60.0).expect("a ramp");
        assert!((warming.at(15.0) - 323.15).abs() < 1e-9 && (warming.leak_factor(5.0) - 1.0).abs() < 1e-12);
        assert!(warming.leak_factor(30.0) > 1.9 && warming.leak_factor(30.0) < 2.3);
    }

    #[test]
    fn a_temperature_that_cannot_be_is_refused() {
        for text in
            ["warm", "20 bar", "900 °C", "20 °C -> 60 bar", "20 °C -> 900 °C", "20 °C -> 60 °C @ later"]
        {
            assert!(OilTemperature::of(text, 60.0).is_err(), "{text}");
        }
    }
}
