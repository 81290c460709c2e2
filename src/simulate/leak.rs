//! Leaks of a simulated rig: how large, and how that changes through the trace.

use super::span::{Span, SpanError, split_span};
use crate::units::{self, Dimension, UnitError};
use pitchleak_core::PerLeak;
use serde::Serialize;

/// How large a simulated laminar leak is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LeakSize {
    /// Its mean flow over the run's first minute, m³/s. The coefficient follows from the run's own mean |P_L|, P_A
    /// or P_B.
    MeanFlow(f64),
    /// Its coefficient, m³/(s·Pa).
    Coefficient(f64),
}

impl Default for LeakSize {
    fn default() -> Self {
        Self::Coefficient(0.0)
    }
}

/// Why a text is no leak's size.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum LeakSizeError {
    /// The quantity cannot be read.
    #[error("{0}; add `/bar` (or `/Pa`, `/MPa`) for a coefficient, e.g. \"0.02 L/min/bar\"")]
    Unit(#[from] UnitError),
    /// A leak does not flow backwards.
    #[error("a leak must not be negative")]
    Negative,
}

impl std::str::FromStr for LeakSize {
    type Err = LeakSizeError;

    /// A flow, as `0.5 L/min`, or a coefficient, as `0.02 L/min/bar`; a bare number is m³/s.
    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let per = |suffix: &str, pa: f64| Some((text.trim_end().strip_suffix(suffix)?, pa));
        let size = match per("/bar", 1e5).or(per("/MPa", 1e6)).or(per("/Pa", 1.0)) {
            Some((flow, pa)) => Self::Coefficient(units::parse(flow, Dimension::Flow)? / pa),
            None => Self::MeanFlow(units::parse(text, Dimension::Flow)?),
        };
        let (Self::MeanFlow(value) | Self::Coefficient(value)) = size;
        if value < 0.0 { Err(LeakSizeError::Negative) } else { Ok(size) }
    }
}

impl LeakSize {
    /// The coefficient at the mean driving pressure of a run, m³/(s·Pa); `None` where there is no
    /// pressure to drive the flow.
    fn coefficient(self, mean_pressure_pa: f64) -> Option<f64> {
        match self {
            Self::Coefficient(value) => Some(value),
            Self::MeanFlow(flow) => (mean_pressure_pa > 0.0).then(|| flow / mean_pressure_pa),
        }
    }
}

/// The coefficients of all leaks at mean |P_L|, P_A, P_B, m³/(s·Pa); `None` where one has no
/// pressure.
pub(super) fn coefficients(
    sizes: &PerLeak<LeakSize>,
    mean_pressures_pa: &PerLeak<f64>,
) -> Option<PerLeak<f64>> {
    sizes.zip(*mean_pressures_pa).map(|(size, pressure)| size.coefficient(pressure)).complete()
}

/// The next coefficients to try, from the last two pairs (tried, found at its pressures): each leak by
/// Wegstein's secant (1958, "Accelerating convergence of iterative processes"), on logarithms. A leak
/// takes pressure away but never more than in proportion, so the slope lies between 0 and 1; other
/// leaks that change at the same time may make it look otherwise.
pub(super) fn next_guess(
    last: Option<(PerLeak<f64>, PerLeak<f64>)>,
    (tried, found): (PerLeak<f64>, PerLeak<f64>),
) -> PerLeak<f64> {
    let Some((tried_last, found_last)) = last else { return found };
    tried.zip(found).zip(tried_last.zip(found_last)).map(|((c, g), (c_last, g_last))| {
        let slope = libm::log(g / g_last) / libm::log(c / c_last);
        if slope.is_finite() { c * libm::pow(g / c, 1.0 / (1.0 - slope.clamp(0.0, 0.8))) } else { g }
    })
}

/// Whether a leak is given by its flow, so that its coefficient has to be found.
pub(super) fn any_by_flow(sizes: &PerLeak<LeakSize>) -> bool {
    sizes.iter().any(|(_, size)| matches!(size, LeakSize::MeanFlow(flow) if *flow > 0.0))
}

/// Greatest relative difference between two sets of coefficients.
pub(super) fn differ(one: &PerLeak<f64>, other: &PerLeak<f64>) -> f64 {
    let relative = |(a, b): (f64, f64)| (a - b).abs() / a.abs().max(b.abs()).max(f64::MIN_POSITIVE);
    one.zip(*other).into_iter().map(|(_, pair)| relative(pair)).fold(0.0, f64::max)
}

/// A laminar leak, and how it changes through the trace.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct LeakCourse {
    /// Its largest size, at 40 °C where the oil's temperature is given.
    pub size: LeakSize,
    /// How much of that is there at a time.
    pub opening: Opening,
}

/// How much of a leak's largest size is there at a time, as a share.
#[derive(Clone, Copy, Debug, PartialEq, Default, Serialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum Opening {
    /// All of it, always.
    #[default]
    Steady,
    /// All of it during a span: a leak that opens, is mended, or both.
    During(Span),
    /// From one share to the other in a straight line.
    Ramp {
        /// Before the span.
        from_share: f64,
        /// After the span.
        to_share: f64,
        /// While it changes.
        #[serde(flatten)]
        during: Span,
    },
    /// It comes and goes.
    Pulsed {
        /// From one opening to the next, s.
        period_s: f64,
        /// Time open of each period, from its beginning, s.
        open_s: f64,
        /// While it does so.
        #[serde(flatten)]
        during: Span,
    },
}

/// Why a text is no leak.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum LeakCourseError {
    /// The size.
    #[error(transparent)]
    Size(#[from] LeakSizeError),
    /// The time.
    #[error(transparent)]
    Span(#[from] SpanError),
    /// Period or time open.
    #[error(transparent)]
    Unit(#[from] UnitError),
    /// A flow becomes a coefficient.
    #[error("a leak that grows is a flow, or a coefficient, at its beginning and at its end")]
    MixedSizes,
    /// It comes and goes in no time.
    #[error(
        "a leak that comes and goes does so as `0.5 L/min every 60 s for 10 s`, and is open for less than the period"
    )]
    Pulses,
    /// An onset for a leak that has times of its own.
    #[error("a leak with times of its own takes no onset")]
    Onset,
}

impl From<LeakSize> for LeakCourse {
    fn from(size: LeakSize) -> Self {
        Self { size, opening: Opening::Steady }
    }
}

impl std::str::FromStr for LeakCourse {
    type Err = LeakCourseError;

    /// A [`LeakSize`] alone; with ` @ 10 s..300 s` while it is there; `0.1 L/min -> 0.5 L/min @ 10 s..300 s`
    /// where it changes; `0.5 L/min every 60 s for 10 s` where it comes and goes.
    fn from_str(text: &str) -> Result<Self, LeakCourseError> {
        let (size, span) = split_span(text)?;
        let during = span.unwrap_or(Span::ALWAYS);
        if let Some((first, last)) = size.split_once("->").or_else(|| size.split_once('→')) {
            return Self::ramp(first.parse()?, last.parse()?, during);
        }
        if let Some((size, pulses)) = size.split_once(" every ") {
            return Self::pulsed(size.parse()?, pulses, during);
        }
        let opening = span.map_or(Opening::Steady, Opening::During);
        Ok(Self { size: size.parse()?, opening })
    }
}

impl LeakCourse {
    fn ramp(first: LeakSize, last: LeakSize, during: Span) -> Result<Self, LeakCourseError> {
        let (from, to, size): (f64, f64, fn(f64) -> LeakSize) = match (first, last) {
            (LeakSize::MeanFlow(from), LeakSize::MeanFlow(to)) => (from, to, LeakSize::MeanFlow),
            (LeakSize::Coefficient(from), LeakSize::Coefficient(to)) => (from, to, LeakSize::Coefficient),
            _ => return Err(LeakCourseError::MixedSizes),
        };
        let largest = from.max(to);
        let share = |value: f64| if largest > 0.0 { value / largest } else { 0.0 };
        let opening = Opening::Ramp { from_share: share(from), to_share: share(to), during };
        Ok(Self { size: size(largest), opening })
    }

    fn pulsed(size: LeakSize, pulses: &str, during: Span) -> Result<Self, LeakCourseError> {
        let (period, open) = pulses.split_once(" for ").ok_or(LeakCourseError::Pulses)?;
        let (period_s, open_s) =
            (units::parse(period, Dimension::Time)?, units::parse(open, Dimension::Time)?);
        if open_s > 0.0 && open_s < period_s {
            Ok(Self { size, opening: Opening::Pulsed { period_s, open_s, during } })
        } else {
            Err(LeakCourseError::Pulses)
        }
    }

    /// A leak of this size that opens `onset_s` into the trace.
    pub fn from_onset(size: LeakSize, onset_s: f64) -> Self {
        Self { size, opening: Opening::During(Span { from_s: onset_s, ..Span::ALWAYS }) }
    }

    /// This course, opening `onset_s` into the trace; zero or less: before it begins.
    ///
    /// # Errors
    /// [`LeakCourseError::Onset`] where it has times of its own.
    pub(crate) fn opening_at(self, onset_s: f64) -> Result<Self, LeakCourseError> {
        match self.opening {
            _ if onset_s <= 0.0 => Ok(self),
            Opening::Steady => Ok(Self::from_onset(self.size, onset_s)),
            _ => Err(LeakCourseError::Onset),
        }
    }

    /// This course, changing within a trace of this length where nothing says when.
    #[must_use]
    pub fn within_trace(self, duration_s: f64) -> Self {
        let opening = match self.opening {
            Opening::Ramp { from_share, to_share, during } => {
                Opening::Ramp { from_share, to_share, during: during.within_trace(duration_s) }
            }
            other => other,
        };
        Self { opening, ..self }
    }
}

impl Opening {
    /// Share of the largest size at a time.
    pub fn share(&self, t_s: f64) -> f64 {
        match self {
            Self::Steady => 1.0,
            Self::During(span) => f64::from(u8::from(span.contains(t_s))),
            Self::Ramp { from_share, to_share, during } => {
                from_share + (to_share - from_share) * during.passed(t_s)
            }
            Self::Pulsed { period_s, open_s, during } => {
                let begin_s = if during.from_s.is_finite() { during.from_s } else { 0.0 };
                let period = ((t_s - begin_s) / period_s + 1e-9).floor() * period_s;
                let open = Span { from_s: begin_s + period, to_s: begin_s + period + open_s };
                f64::from(u8::from(during.contains(t_s) && open.contains(t_s)))
            }
        }
    }

    /// Time into the trace at which there is first anything, s; zero: from its beginning.
    pub fn onset_s(&self) -> f64 {
        match self {
            Self::Ramp { from_share, .. } if *from_share > 0.0 => 0.0,
            Self::Steady => 0.0,
            Self::During(span) | Self::Ramp { during: span, .. } | Self::Pulsed { during: span, .. } => {
                span.from_s.max(0.0)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_leak_is_a_flow_or_a_coefficient() {
        let size = |text: &str| text.parse::<LeakSize>();
        assert_eq!(size("6 L/min"), Ok(LeakSize::MeanFlow(1e-4)));
        assert_eq!(size("0.5e-5"), Ok(LeakSize::MeanFlow(5e-6)));
        let Ok(LeakSize::Coefficient(c)) = size("0.6 L/min/bar") else { panic!("a coefficient") };
        assert!((c - 1e-10).abs() < 1e-24, "1 m³/(s·Pa) is 6e9 L/min/bar");
        let Ok(LeakSize::Coefficient(c)) = size("3e-12 m^3/s/Pa") else { panic!("a coefficient") };
        assert!((c - 3e-12).abs() < 1e-26);
        assert_eq!(size("-1 L/min"), Err(LeakSizeError::Negative));
        assert!(size("1 L").is_err() && size("much").is_err());
    }

    use proptest::prelude::*;

    fn course(text: &str) -> LeakCourse {
        text.parse().unwrap_or_else(|error| panic!("{text}: {error}"))
    }

    #[test]
    fn a_leak_says_when_it_is_there() {
        let open = |text: &str, t_s: f64| course(text).opening.share(t_s);
        let near = |found: f64, share: f64| assert!((found - share).abs() < 1e-12, "{found}, not {share}");
        for (text, t_s, share) in [
            ("0.5 L/min", -5.0, 1.0),
            ("0.5 L/min @ 10 s..", 9.99, 0.0),
            ("0.5 L/min @ 10 s..", 10.0, 1.0),
            ("0.5 L/min @ ..20 s", 0.0, 1.0),
            ("0.5 L/min @ ..20 s", 20.0, 0.0),
            ("0.1 L/min -> 0.5 L/min @ 10 s..300 s", 0.0, 0.2),
            ("0.1 L/min → 0.5 L/min @ 10 s..300 s", 155.0, 0.6),
            ("0.1 L/min -> 0.5 L/min @ 10 s..300 s", 500.0, 1.0),
            ("0.02 L/min/bar -> 0 L/min/bar @ 0 s..10 s", 5.0, 0.5),
            ("0.5 L/min every 60 s for 10 s", 9.99, 1.0),
            ("0.5 L/min every 60 s for 10 s", 10.0, 0.0),
            ("0.5 L/min every 60 s for 10 s", 60.0, 1.0),
            ("0.5 L/min every 60 s for 10 s @ 30 s..100 s", 0.0, 0.0),
            ("0.5 L/min every 60 s for 10 s @ 30 s..100 s", 95.0, 1.0),
            ("0.5 L/min every 60 s for 10 s @ 30 s..100 s", 151.0, 0.0),
        ] {
            near(open(text, t_s), share);
        }
        assert_eq!(course("0.1 L/min -> 6 L/min").size, LeakSize::MeanFlow(1e-4));
        near(course("0 -> 0.5 L/min").within_trace(50.0).opening.share(25.0), 0.5);
    }

    #[test]
    fn a_leak_that_cannot_be_is_refused() {
        let error = |text: &str| text.parse::<LeakCourse>().expect_err(text);
        assert_eq!(error("0.1 L/min -> 0.2 L/min/bar"), LeakCourseError::MixedSizes);
        assert_eq!(error("1 L/min every 10 s for 10 s"), LeakCourseError::Pulses);
        assert_eq!(error("1 L/min every 10 s"), LeakCourseError::Pulses);
        assert!(matches!(error("1 L/min @ soon"), LeakCourseError::Span(_)));
        assert!(matches!(error("-1 L/min -> 2 L/min"), LeakCourseError::Size(LeakSizeError::Negative)));
        let opening = course("1 L/min").opening_at(5.0).map(|late| late.opening.onset_s());
        assert_eq!(opening, Ok(5.0));
        assert_eq!(course("1 L/min @ ..9 s").opening_at(5.0), Err(LeakCourseError::Onset));
    }

    proptest! {
        #[test]
        fn a_share_is_one_at_most_and_a_ramp_meets_its_ends(
            first in 0.0..10.0f64, last in 0.0..10.0f64, from in 0.0..100.0f64, length in 0.1..100.0f64,
            t in -50.0..300.0f64,
        ) {
            let to = from + length;
            let ramp = course(&format!("{first} L/min -> {last} L/min @ {from} s..{to} s"));
            let pulses = course(&format!("1 L/min every {to} s for {} s", 0.5 * to));
            for opening in [ramp.opening, pulses.opening] {
                prop_assert!((0.0..=1.0).contains(&opening.share(t)));
            }
            let LeakSize::MeanFlow(largest) = ramp.size else { panic!("a flow") };
            for (t_s, flow) in [(from, first), (to, last), (from + length / 2.0, (first + last) / 2.0)] {
                prop_assert!((60e3 * largest * ramp.opening.share(t_s) - flow).abs() < 1e-9);
            }
        }

        #[test]
        fn any_text_is_a_leak_or_an_error(text in ".{0,40}") {
            let _ = text.parse::<LeakCourse>();
        }
    }
}
