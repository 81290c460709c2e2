//! The optional sections of a rig file: `[estimator]`, `[alarms]`, `[columns]`.

use super::bound;
use super::document::{Fault, RigError, Section};
use super::instruments::Instruments;
use super::odds::Odds;
use crate::header;
use crate::signal::Signal;
use crate::times::{TimeFormat, TimeKind, Zone};
use crate::units::{self, Dimension, Unit};
use pitchleak_core::{AlarmSettings, PerLeak};
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
        let (_, found) = header::split(header, dimension)?;
        Some(Self { offset: found.offset_si, ..Self::new(header, Some(found.unit)) })
    }

    /// The unit of its numbers, scale and offset included.
    pub fn reading(&self) -> Option<Unit> {
        self.unit.map(|unit| unit.scaled(self.scale, self.offset))
    }
}

/// `[columns]`: the foreign name of each mapped signal.
pub type ColumnMap = BTreeMap<Signal, ForeignColumn>;

impl EstimatorSettings {
    pub(super) fn read(section: &Section<'_>) -> Result<Self, RigError> {
        section.allow(&["kind", "forgetting_time", "filter_cutoff", "block_time", "gains"])?;
        let kind = section.named("kind", EstimatorKind::by_name, &EstimatorKind::NAMES.join(" or "))?;
        let gains = section.section("gains")?;
        gains.allow(&["lambda", "gamma"])?;
        Ok(Self {
            kind: kind.unwrap_or_default(),
            forgetting_time_s: section.quantity("forgetting_time", Dimension::Time, bound::MEMORY)?,
            filter_cutoff_hz: section.quantity("filter_cutoff", Dimension::Frequency, bound::CUTOFF)?,
            block_time_s: section.quantity("block_time", Dimension::Time, bound::MEMORY)?,
            lambda_per_s: gains.quantity("lambda", Dimension::Share, bound::GAIN)?,
            gamma: gains.quantity("gamma", Dimension::Share, bound::GAIN)?,
        })
    }
}

/// Reads `[alarms]`: a threshold per leak, `hysteresis` as the share of it that a leak must fall below
/// it to clear the alarm, and how long the evidence must last.
pub(super) fn read_alarms(
    section: &Section<'_>,
    instruments: &Instruments,
) -> Result<AlarmSettings<f64>, RigError> {
    section.allow(&["internal", "external_a", "external_b", "hysteresis", "hold_time"])?;
    let default = AlarmSettings::default();
    let within = bound::threshold(instruments.largest_flow_m3s());
    let flow = |key, usual: f64| {
        section.quantity(key, Dimension::Flow, within).map(|given| given.unwrap_or(within.nearest(usual)))
    };
    let hysteresis = section.quantity("hysteresis", Dimension::Share, bound::SHARE)?;
    let hold_time = section.quantity("hold_time", Dimension::Time, bound::HOLD_TIME)?;
    let usual = default.threshold_m3s;
    Ok(AlarmSettings {
        threshold_m3s: PerLeak {
            internal: flow("internal", usual.internal)?,
            external_a: flow("external_a", usual.external_a)?,
            external_b: flow("external_b", usual.external_b)?,
        },
        clear_share: hysteresis.map_or(default.clear_share, |share| 1.0 - share),
        hold_time_s: hold_time.unwrap_or(default.hold_time_s),
        ..default
    })
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
    pub(super) fn read(section: &Section<'_>) -> Result<Self, RigError> {
        section.allow(&["alpha", "odds"])?;
        let alpha = section.quantity("alpha", Dimension::Share, bound::ALPHA)?;
        let odds = Odds::read(&section.section("odds")?)?;
        Ok(Self { alpha: alpha.unwrap_or(Self::default().alpha), odds })
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
pub enum Delimiter {
    /// `,`
    Comma,
    /// `;`
    Semicolon,
    /// A tab.
    Tab,
    /// `|`
    Bar,
}

impl Delimiter {
    /// All, by their names.
    pub const NAMES: [(&'static str, Self); 4] =
        [("comma", Self::Comma), ("semicolon", Self::Semicolon), ("tab", Self::Tab), ("bar", Self::Bar)];

    /// The byte itself.
    pub fn byte(self) -> u8 {
        match self {
            Self::Comma => b',',
            Self::Semicolon => b';',
            Self::Tab => b'\t',
            Self::Bar => b'|',
        }
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

impl CsvSettings {
    pub(super) fn read(section: &Section<'_>) -> Result<Self, RigError> {
        section.allow(&["delimiter", "decimal", "time_format", "zone"])?;
        let delimiters = Delimiter::NAMES.map(|(name, _)| name).join(" or ");
        let delimiter = section.named("delimiter", Delimiter::by_name, &delimiters)?;
        let decimal = section.named("decimal", Decimal::by_name, "point or comma")?;
        let kind = read_time_kind(section, "time_format")?;
        let zone = read_zone(section)?;
        let time =
            (kind.is_some() || zone.is_some()).then(|| TimeFormat { kind: kind.unwrap_or_default(), zone });
        Ok(Self { delimiter, decimal, time, part: None })
    }
}

fn read_time_kind(section: &Section<'_>, key: &str) -> Result<Option<TimeKind>, RigError> {
    section.named(key, TimeKind::by_name, TimeKind::ALLOWED)
}

fn read_zone(section: &Section<'_>) -> Result<Option<Zone>, RigError> {
    section.named("zone", Zone::by_name, "a zone such as Europe/Berlin, CET or +01:00")
}

/// Reads `[columns]`, e.g. `pa = { name = "Head pressure", unit = "bar", scale = -1.0, offset = "2 bar" }`: minus
/// what the column says, plus 2 bar. A header that ends with its unit will do: `pa = "Head pressure [bar]"`.
pub(super) fn read_columns(section: &Section<'_>) -> Result<ColumnMap, RigError> {
    section.allow(&Signal::ALL.map(Signal::name))?;
    let mut columns = ColumnMap::new();
    for signal in section.keys().filter_map(Signal::by_name) {
        if !section.is_table(signal.name()) {
            columns.insert(signal, read_header(section, signal)?);
            continue;
        }
        let entry = section.section(signal.name())?;
        match signal.dimension() {
            Some(_) => entry.allow(&["name", "unit", "scale", "offset"])?,
            None if signal == Signal::Shut => entry.allow(&["name"])?,
            None => entry.allow(&["name", "unit", "scale", "offset", "format", "zone"])?,
        }
        let name =
            entry.text("name")?.ok_or_else(|| entry.missing("name", "the column's name in the header"))?;
        let unit = read_unit(&entry, signal)?;
        let scale = entry.quantity("scale", Dimension::Share, bound::OFFSET)?.unwrap_or(1.0);
        if !bound::SCALE.holds(scale.abs()) {
            let value = scale.to_string();
            return Err(entry.impossible(
                "scale",
                &value,
                "a number that keeps the readings apart, from 1e-12 on",
            ));
        }
        let offset = match signal.dimension() {
            Some(dimension) => entry.quantity("offset", dimension, bound::OFFSET)?,
            None => None,
        };
        let offset = offset.unwrap_or(0.0);
        let (format, zone) = (read_time_kind(&entry, "format")?, read_zone(&entry)?);
        let name = name.to_owned();
        columns.insert(signal, ForeignColumn { name, unit, scale, offset, format, zone });
    }
    each_its_own(section, &columns)?;
    Ok(columns)
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
