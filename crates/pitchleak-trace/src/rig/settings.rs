//! The optional sections of a rig file: `[estimator]`, `[alarms]`, `[columns]`.

use super::bound;
use super::document::{Fault, RigError, Section};
use super::instruments::Instruments;
use super::keys::{Done, Keys, for_people, inline, toml_text};
use super::prior::Odds;
use crate::header::{self, HeaderUnit};
use crate::signal::Signal;
use crate::times::{TimeFormat, TimeKind, Zone};
use crate::units::{self, Dimension, Unit};
use pitchleak_core::{AlarmSettings, Leak};
use std::collections::BTreeMap;

/// Which estimator a replay runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum EstimatorKind {
    /// Recursive least squares on both chamber equations.
    #[default]
    Rls,
    /// The adaptive law of Wu et al. (2011), eq. (8)–(13).
    Paper,
}

impl EstimatorKind {
    /// The names accepted.
    pub const NAMES: [&'static str; 2] = ["rls", "paper"];

    /// As written in rig files and on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Rls => "rls",
            Self::Paper => "paper",
        }
    }

    /// The estimator of this name.
    pub fn by_name(name: &str) -> Option<Self> {
        [Self::Rls, Self::Paper].into_iter().find(|kind| kind.name() == name)
    }
}

/// `[estimator]`: what the file leaves out is up to the estimator.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct EstimatorSettings {
    /// Which estimator.
    pub kind: EstimatorKind,
    /// Time constant of forgetting, s.
    pub forgetting_time_s: Option<f64>,
    /// Cut-off of the input filter, Hz.
    pub filter_cutoff_hz: Option<f64>,
    /// Length of the blocks that samples are gathered into, s.
    pub block_time_s: Option<f64>,
    /// λ of the paper's law, eq. (8), 1/s.
    pub lambda_per_s: Option<f64>,
    /// Scale γ of the paper's adaptation gains, eq. (9).
    pub gamma: Option<f64>,
}

/// A foreign column: its name in the header and its unit (none for a timestamp).
#[derive(Clone, Debug, PartialEq)]
pub struct ForeignColumn {
    /// As in the header row.
    pub name: String,
    /// The unit its numbers are in.
    pub unit: Option<Unit>,
    /// Factor on what it reads, …
    pub scale: f64,
    /// … and what is then added, SI.
    pub offset: f64,
    /// How a timestamp is written; none where its cells are to say it.
    pub format: Option<TimeKind>,
    /// The zone of a timestamp's clock.
    pub zone: Option<Zone>,
}

impl ForeignColumn {
    /// A column whose numbers are read as they are.
    pub fn new(name: impl Into<String>, unit: Option<Unit>) -> Self {
        Self { name: name.into(), unit, scale: 1.0, offset: 0.0, format: None, zone: None }
    }

    /// `Head pressure [bar]`, with the unit that it ends with.
    fn by_header(header: &str, dimension: Dimension) -> Option<Self> {
        header::split(header, dimension).map(|(_, unit)| Self::with_unit(header, unit))
    }

    /// A column whose header says its unit.
    pub(crate) fn with_unit(header: &str, found: HeaderUnit) -> Self {
        Self { offset: found.offset_si, ..Self::new(header, Some(found.unit)) }
    }

    /// The unit of its numbers, scale and offset included.
    pub fn reading(&self) -> Option<Unit> {
        self.unit.map(|unit| unit.scaled(self.scale, self.offset))
    }
}

/// `[columns]`: the foreign name of each mapped signal.
pub type ColumnMap = BTreeMap<Signal, ForeignColumn>;

impl EstimatorSettings {
    pub(super) fn keys(keys: &mut Keys<'_>, own: &mut Self) -> Done {
        let (mut kind, allowed) = (Some(own.kind), EstimatorKind::NAMES.join(" or "));
        keys.word("kind", EstimatorKind::by_name, |kind| kind.name().to_owned(), &allowed, &mut kind)?;
        own.kind = kind.unwrap_or_default();
        keys.optional("forgetting_time", bound::MEMORY, &mut own.forgetting_time_s)?;
        keys.optional("filter_cutoff", bound::CUTOFF, &mut own.filter_cutoff_hz)?;
        keys.optional("block_time", bound::MEMORY, &mut own.block_time_s)?;
        keys.table("gains", own, |keys, own| {
            keys.optional("lambda", bound::GAIN, &mut own.lambda_per_s)?;
            keys.optional("gamma", bound::GAIN, &mut own.gamma)
        })
    }
}

/// `[alarms]`: a threshold per leak, `hysteresis` as the share of it that a leak must fall below it to clear the alarm, and how
/// long the evidence must last.
pub(super) fn alarm_keys(
    keys: &mut Keys<'_>,
    alarms: &mut AlarmSettings<f64>,
    instruments: &Instruments,
) -> Done {
    let usual = AlarmSettings::default();
    let within = bound::threshold(bound::FLOW_SCALE.nearest(instruments.largest_flow_m3s()));
    for (key, leak) in
        [("internal", Leak::Internal), ("external_a", Leak::ExternalA), ("external_b", Leak::ExternalB)]
    {
        let default = within.nearest(usual.threshold_m3s[leak]);
        keys.number(key, within, &mut alarms.threshold_m3s[leak], default)?;
    }
    let mut hysteresis = 1.0 - alarms.clear_share;
    keys.share("hysteresis", &mut hysteresis, 1.0 - usual.clear_share)?;
    alarms.clear_share = 1.0 - hysteresis;
    keys.number("hold_time", bound::HOLD_TIME, &mut alarms.hold_time_s, usual.hold_time_s)
}

/// `[decision]`: when a verdict is sure.
#[derive(Clone, Debug, PartialEq)]
pub struct DecisionSettings {
    /// α: a verdict is sure where at most this probability speaks against it.
    pub alpha: f64,
    /// How often explanations are true before any data.
    pub odds: Odds,
}

impl Default for DecisionSettings {
    /// 5 %, as of intervals; chosen.
    fn default() -> Self {
        Self { alpha: 0.05, odds: Odds::default() }
    }
}

impl DecisionSettings {
    pub(super) fn keys(keys: &mut Keys<'_>, own: &mut Self) -> Done {
        keys.number("alpha", bound::ALPHA, &mut own.alpha, Self::default().alpha)?;
        keys.entry(
            "odds",
            &mut own.odds,
            |section| Odds::read(&section.section("odds")?),
            |odds| {
                let shares = odds.iter().map(|(id, share)| (id, format!("{share:?}")));
                (!odds.is_empty()).then(|| inline(shares))
            },
        )
    }
}

/// `[csv]`: what a text file of numbers leaves open; the file says what this doesn't.
#[derive(Clone, Debug, PartialEq, Default)]
pub struct CsvSettings {
    /// What stands between two cells.
    pub delimiter: Option<Delimiter>,
    /// What stands before the decimals.
    pub decimal: Option<Decimal>,
    /// How times are written.
    pub time: Option<TimeFormat>,
    /// The file is a part of a recording, with the time and some of its channels; one that is called `value` is called so. Never
    /// of a rig file.
    pub part: Option<String>,
}

/// What stands between two cells.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Delimiter {
    /// `,`
    Comma = b',',
    /// `;`
    Semicolon = b';',
    /// A tab.
    Tab = b'\t',
    /// `|`
    Bar = b'|',
}

impl Delimiter {
    /// All, by their names.
    pub const NAMES: [(&'static str, Self); 4] =
        [("comma", Self::Comma), ("semicolon", Self::Semicolon), ("tab", Self::Tab), ("bar", Self::Bar)];

    /// The byte itself.
    pub fn byte(self) -> u8 {
        self as u8
    }

    /// As it is called.
    pub fn name(self) -> &'static str {
        Self::NAMES.iter().find(|(_, delimiter)| *delimiter == self).map_or("", |(name, _)| name)
    }

    /// By its name, or as it is.
    pub fn by_name(name: &str) -> Option<Self> {
        let known =
            |(known, delimiter): &(&str, Self)| *known == name || name.as_bytes() == [delimiter.byte()];
        Self::NAMES.into_iter().find(known).map(|(_, delimiter)| delimiter)
    }
}

/// What stands before the decimals.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Decimal {
    /// 0.5
    #[default]
    Point,
    /// 0,5
    Comma,
}

impl Decimal {
    /// As it is called.
    pub fn name(self) -> &'static str {
        match self {
            Self::Point => "point",
            Self::Comma => "comma",
        }
    }

    /// By its name, or as it is.
    pub fn by_name(name: &str) -> Option<Self> {
        match name {
            "point" | "." => Some(Self::Point),
            "comma" | "," => Some(Self::Comma),
            _ => None,
        }
    }
}

/// The zones that are taken, for messages.
const ZONES: &str = "a zone such as Europe/Berlin, CET or +01:00";

impl CsvSettings {
    pub(super) fn keys(keys: &mut Keys<'_>, own: &mut Self) -> Done {
        let delimiters = Delimiter::NAMES.map(|(name, _)| name).join(" or ");
        let (delimiter, decimal) = (&mut own.delimiter, &mut own.decimal);
        keys.word("delimiter", Delimiter::by_name, |one| one.name().to_owned(), &delimiters, delimiter)?;
        keys.word("decimal", Decimal::by_name, |one| one.name().to_owned(), "point or comma", decimal)?;
        let time = own.time.take();
        let (mut kind, mut zone) = time.map_or((None, None), |time| (Some(time.kind), time.zone));
        keys.word("time_format", TimeKind::by_name, TimeKind::to_string, TimeKind::ALLOWED, &mut kind)?;
        keys.word("zone", Zone::by_name, Zone::to_string, ZONES, &mut zone)?;
        let is_given = kind.is_some() || zone.is_some();
        own.time = is_given.then(|| TimeFormat { kind: kind.unwrap_or_default(), zone });
        Ok(())
    }
}

/// Reads `[columns]`, e.g. `pa = { name = "Head pressure", unit = "bar", scale = -1.0, offset = "2 bar" }`: minus
/// what the column says, plus 2 bar. A header that ends with its unit will do: `pa = "Head pressure [bar]"`.
pub(super) fn read_columns(section: &Section<'_>) -> Result<ColumnMap, RigError> {
    section.allow(&Signal::ALL.map(Signal::name))?;
    let mut columns = ColumnMap::new();
    for signal in section.keys().filter_map(Signal::by_name) {
        let column = match section.is_table(signal.name()) {
            true => {
                section.section(signal.name())?.read(ForeignColumn::new("", None), column_keys(signal))?
            }
            false => read_header(section, signal)?,
        };
        columns.insert(signal, column);
    }
    each_its_own(section, &columns)?;
    Ok(columns)
}

/// Scale and offset are written where they do anything; only a timestamp has a format and a zone.
pub(super) fn column_keys(signal: Signal) -> impl Fn(&mut Keys<'_>, &mut ForeignColumn) -> Done {
    move |keys, own| {
        let name = |section: &Section<'_>| {
            let name = section.text("name")?.map(str::to_owned);
            name.ok_or_else(|| section.missing("name", "the column's name in the header"))
        };
        keys.entry("name", &mut own.name, name, |name| Some(toml_text(name)))?;
        if signal == Signal::Shut {
            return Ok(());
        }
        let unit = |unit: &mut Option<Unit>| unit.map(|unit| toml_text(unit.text));
        keys.entry("unit", &mut own.unit, |section| read_unit(section, signal), unit)?;
        keys.entry("scale", &mut own.scale, read_scale, |scale| {
            let scale = bound::SCALE.nearest(scale.abs()).copysign(*scale);
            ((scale - 1.0).abs() > 0.0).then(|| format!("{scale:?}"))
        })?;
        let within = signal.dimension().map(bound::offset);
        let offset = |section: &Section<'_>| {
            let offset = within.map(|within| section.quantity("offset", within)).transpose()?;
            Ok(offset.flatten().unwrap_or(0.0))
        };
        keys.entry("offset", &mut own.offset, offset, |offset| {
            within.filter(|_| offset.abs() > 0.0).map(|within| for_people(*offset, within))
        })?;
        if signal != Signal::Timestamp {
            return Ok(());
        }
        keys.word("format", TimeKind::by_name, TimeKind::to_string, TimeKind::ALLOWED, &mut own.format)?;
        keys.word("zone", Zone::by_name, Zone::to_string, ZONES, &mut own.zone)
    }
}

fn read_scale(section: &Section<'_>) -> Result<f64, RigError> {
    let scale = section.quantity("scale", bound::offset(Dimension::Share))?.unwrap_or(1.0);
    if bound::SCALE.holds(scale.abs()) {
        return Ok(scale);
    }
    let allowed = "a number that keeps the readings apart, from 1e-12 on";
    Err(section.impossible("scale", &scale.to_string(), allowed))
}

/// Two signals of one kind are two columns; but the command of a valve may stand for its spool.
fn each_its_own(section: &Section<'_>, columns: &ColumnMap) -> Result<(), RigError> {
    let may_share = |signal: &Signal| matches!(signal, Signal::Spool | Signal::Command);
    let own: Vec<_> = columns.iter().filter(|(signal, _)| !may_share(signal)).collect();
    for (at, (signal, column)) in own.iter().enumerate() {
        let same = |(other, its): &&(&Signal, &ForeignColumn)| {
            other.dimension() == signal.dimension() && its == column
        };
        if let Some((other, _)) = own[..at].iter().find(same) {
            let allowed = format!("another column than that of `{}`", other.name());
            return Err(section.impossible(signal.name(), &column.name, &allowed));
        }
    }
    Ok(())
}

/// `pa = "Head pressure [bar]"`.
fn read_header(section: &Section<'_>, signal: Signal) -> Result<ForeignColumn, RigError> {
    let key = signal.name();
    let Some(header) = section.text(key)? else {
        return Err(section.missing(key, "the column's header, or { name = …, unit = … }"));
    };
    match signal.dimension() {
        None => Ok(ForeignColumn::new(header, None)),
        Some(dimension) => ForeignColumn::by_header(header, dimension).ok_or_else(|| {
            let allowed = format!("a header that ends with its unit, e.g. \"{header} [{}]\", or {{ name = …, unit = … }} with a unit of {}", dimension.si(), dimension.suffixes());
            section.impossible(key, header, &allowed)
        }),
    }
}

fn read_unit(entry: &Section<'_>, signal: Signal) -> Result<Option<Unit>, RigError> {
    match (signal.dimension(), entry.text("unit")?) {
        (None, None) => Ok(None),
        (None, Some(unit)) => Err(entry.impossible("unit", unit, "left out: a timestamp has no unit")),
        (Some(dimension), None) => Err(entry.missing("unit", &format!("one of {}", dimension.suffixes()))),
        (Some(dimension), Some(name)) => units::unit(name, dimension)
            .map(Some)
            .map_err(|source| entry.fail("unit", Fault::Quantity { key: entry.path("unit"), source })),
    }
}
