//! Mistakes of sensors as people write them.

use super::{Amount, Distortion, Mistake, SensorFault};
use crate::signal::Signal;
use crate::simulate::span::{Span, SpanError, split_span};
use crate::units::{self, Dimension, UnitError};

/// The channels that can lie.
const CHANNELS: [Signal; 8] = [
    Signal::Time,
    Signal::Position,
    Signal::PressureA,
    Signal::PressureB,
    Signal::FlowA,
    Signal::FlowB,
    Signal::Force,
    Signal::Temperature,
];

/// Ways without a quantity.
const BARE: [(&str, Distortion); 6] = [
    ("dead", Distortion::Dead),
    ("stuck", Distortion::Held(f64::INFINITY)),
    ("missing", Distortion::Missing),
    ("reversed", Distortion::Reversed),
    ("absolute", Distortion::Absolute),
    ("other_end", Distortion::OtherEnd),
];

/// How, for the message.
const WAYS: &str = "dead, stuck, missing, reversed, absolute, other_end, offset Q, drift Q/h, gain 20 %, times 10, \
                    in UNIT, clipped Q, held 200 ms, late 100 ms, spikes 0.1 %";

/// Why a text is no mistake that sensors make.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum SensorFaultError {
    /// Not one of the forms.
    #[error(
        "`{0}` is not of the form `CHANNEL WAY`, `swap CHANNEL CHANNEL` or `rows lost 2 %`, each with ` @ 20 s..40 s` where it is not for ever"
    )]
    Form(String),
    /// No such channel.
    #[error("`{0}` is not one of the channels t, x, pa, pb, qa, qb, force, temp")]
    Channel(String),
    /// No such way to lie.
    #[error("`{0}` is not one of the ways to lie: {WAYS}")]
    Way(String),
    /// A channel that cannot do that.
    #[error("`{channel}` cannot be {way}")]
    Unfit {
        /// The channel.
        channel: &'static str,
        /// The fault that this channel cannot have.
        way: String,
    },
    /// Channels of different kind exchanged.
    #[error("{0} and {1} measure different things: only channels of one kind can be taken for each other")]
    Swap(&'static str, &'static str),
    /// A quantity.
    #[error(transparent)]
    Unit(#[from] UnitError),
    /// A time or a share that must be positive.
    #[error("`{0}` must be more than zero")]
    NotPositive(String),
    /// When.
    #[error(transparent)]
    Span(#[from] SpanError),
}

impl std::str::FromStr for SensorFault {
    type Err = SensorFaultError;

    /// `qa dead`, `qa stuck @ 20 s..40 s`, `pa offset 10 bar`, `qb offset 1 %` (of full scale), `qa drift 0.2 L/min/h`,
    /// `qa gain 20 %`, `pa times 10`, `pa in psi`, `x in cm`, `t in ms`, `qa clipped 5 L/min`, `qa held 200 ms`,
    /// `pa late 100 ms`, `qb reversed`, `qb absolute`, `x other_end`, `qa missing`, `pa spikes 0.1 %`, `swap qa qb`,
    /// `rows lost 2 %`.
    fn from_str(text: &str) -> Result<Self, SensorFaultError> {
        let (what, span) = split_span(text)?;
        let mut words = what.split_whitespace();
        let form = || SensorFaultError::Form(text.trim().to_owned());
        let (first, second) = (words.next().ok_or_else(form)?, words.next().ok_or_else(form)?);
        let rest = words.collect::<Vec<_>>().join(" ");
        // `qa stuck 20 s..40 s`: the span of a way without a quantity needs no sign before it.
        let (rest, during) = match span {
            None if rest.contains("..") => (String::new(), rest.parse()?),
            span => (rest, span.unwrap_or(Span::ALWAYS)),
        };
        let mistake = match first {
            "swap" => swap(channel(second)?, channel(&rest)?)?,
            "rows" if second == "lost" => Mistake::RowsLost(match rest.as_str() {
                "" if during != Span::ALWAYS => 1.0,
                share => positive(share, Dimension::Share)?,
            }),
            "rows" => return Err(form()),
            _ => {
                let channel = channel(first)?;
                Mistake::Channel(channel, distortion(channel, second, &rest)?)
            }
        };
        Ok(Self { text: text.trim().to_owned(), mistake, during })
    }
}

fn channel(name: &str) -> Result<Signal, SensorFaultError> {
    let found = Signal::by_name(name).filter(|signal| CHANNELS.contains(signal));
    found.ok_or_else(|| SensorFaultError::Channel(name.to_owned()))
}

fn swap(one: Signal, other: Signal) -> Result<Mistake, SensorFaultError> {
    if one != other && one.dimension() == other.dimension() {
        Ok(Mistake::Swap(one, other))
    } else {
        Err(SensorFaultError::Swap(one.name(), other.name()))
    }
}

/// The way `way` with its quantity `text`, for one channel.
fn distortion(channel: Signal, way: &str, text: &str) -> Result<Distortion, SensorFaultError> {
    let measures = channel.dimension().unwrap_or(Dimension::Time);
    let bare = BARE.into_iter().find(|(bare, _)| *bare == way);
    let distortion = match way {
        _ if bare.is_some() && !text.is_empty() => {
            return Err(SensorFaultError::Way(format!("{way} {text}")));
        }
        "offset" => Distortion::Offset(amount(text, measures)?),
        "drift" => Distortion::Drift(amount(per_hour(text)?, measures)?),
        "gain" => Distortion::Times(1.0 + units::parse(text, Dimension::Share)?),
        "times" => Distortion::Times(units::parse(text, Dimension::Share)?),
        "in" => Distortion::Times(header_unit(channel) / size_of(text, measures)?),
        "clipped" => Distortion::Clipped(amount(text, measures)?),
        "held" => Distortion::Held(positive(text, Dimension::Time)?),
        "late" => Distortion::Late(positive(text, Dimension::Time)?),
        "spikes" => Distortion::Spikes(positive(text, Dimension::Share)?),
        _ => bare.map(|(_, distortion)| distortion).ok_or_else(|| SensorFaultError::Way(way.to_owned()))?,
    };
    let fits = match (channel, distortion) {
        (Signal::Time, distortion) => matches!(distortion, Distortion::Times(_) | Distortion::Offset(_)),
        (Signal::Position, Distortion::OtherEnd) => true,
        (_, Distortion::OtherEnd) => false,
        (Signal::FlowA | Signal::FlowB | Signal::Force | Signal::Temperature, _) => true,
        (_, distortion) => distortion != Distortion::Missing,
    };
    let unfit = || SensorFaultError::Unfit { channel: channel.name(), way: way.to_owned() };
    if fits { Ok(distortion) } else { Err(unfit()) }
}

fn amount(text: &str, measures: Dimension) -> Result<Amount, UnitError> {
    if text.trim_end().ends_with('%') {
        units::parse(text, Dimension::Share).map(Amount::OfFullScale)
    } else {
        units::parse(text, measures).map(Amount::Si)
    }
}

fn per_hour(text: &str) -> Result<&str, SensorFaultError> {
    let way = || SensorFaultError::Way(format!("drift {text}"));
    text.trim_end().strip_suffix("/h").ok_or_else(way)
}

fn positive(text: &str, measures: Dimension) -> Result<f64, SensorFaultError> {
    let value = units::parse(text, measures)?;
    if value > 0.0 { Ok(value) } else { Err(SensorFaultError::NotPositive(text.to_owned())) }
}

/// Size in SI of the unit in which simulated traces show a channel.
fn header_unit(channel: Signal) -> f64 {
    match channel {
        Signal::Position => 1e-3,
        Signal::PressureA | Signal::PressureB => 1e5,
        Signal::FlowA | Signal::FlowB => 1.0 / units::LPM_PER_M3S,
        _ => 1.0,
    }
}

/// Size in SI of a unit.
fn size_of(unit: &str, measures: Dimension) -> Result<f64, UnitError> {
    let unit = units::unit(unit, measures)?;
    Ok(unit.to_si(1.0) - unit.to_si(0.0))
}
