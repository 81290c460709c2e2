//! What foreign columns may be, by their names and by their values: proposed to a person, never read.

use super::columns::{Content, content_of};
use super::number::{decimal, number};
use super::table_text::{TextTable, bare_unit};
use crate::header::{self, HeaderUnit, lists};
use crate::rig::{Decimal, ForeignColumn, Rig};
use crate::signal::Signal;
use crate::times;
use crate::units::{Dimension, Unit};

/// A column that may hold a signal.
pub(super) struct Proposal {
    pub(super) signal: Signal,
    /// How `[columns]` would name it.
    pub(super) column: ForeignColumn,
    /// What speaks for it, in words.
    pub(super) why: &'static str,
}

/// What speaks for a proposal: name and unit of the header, …
pub(super) const BY_NAME: &str = "by its name";
/// … the name, and the unit is one in which its values are possible on this rig, …
const BY_NAME_AND_VALUES: &str = "by its name; the unit by its values: check it";
/// … its unit alone, and its place among the columns, …
const BY_UNIT: &str = "by its unit and place: check it";
/// … or its values alone, and its place.
const BY_VALUES: &str = "by its values and place: check it";

impl Proposal {
    /// Of a column whose unit the file says.
    fn with_unit(signal: Signal, column: &Unread<'_>, unit: HeaderUnit, why: &'static str) -> Self {
        Self { signal, column: ForeignColumn::with_unit(column.header, unit), why }
    }

    /// Of one whose unit is not said, or that has none.
    fn of(signal: Signal, column: &Unread<'_>, unit: Option<Unit>, why: &'static str) -> Self {
        Self { signal, column: ForeignColumn::new(column.header, unit), why }
    }
}

/// A column that is not read yet.
pub(super) struct Unread<'a> {
    pub(super) header: &'a str,
    /// From the row of units; may be empty.
    pub(super) unit: &'a str,
    /// Its first cells, none of them empty.
    pub(super) cells: Vec<&'a str>,
}

impl Unread<'_> {
    /// The unit below or within the header, where it is one of this dimension.
    fn unit(&self, dimension: Dimension) -> Option<HeaderUnit> {
        let within = || header::parts(self.header).find_map(|(_, unit)| HeaderUnit::by_name(unit, dimension));
        HeaderUnit::by_name(self.unit, dimension).or_else(within)
    }

    /// Whether there is one, of what is not time: that shows by its rising.
    fn says_unit(&self) -> bool {
        let dimensions = Signal::ALL.into_iter().filter_map(Signal::dimension);
        dimensions.filter(|dimension| *dimension != Dimension::Time).any(|one| self.unit(one).is_some())
    }
}

/// What a word says of a quantity, and of a side; blanks between the words.
const WORDS: [(Signal, &str); 5] = [
    (Signal::PressureA, "p pressure press pres druck"),
    (Signal::FlowA, "q flow flowrate volumenstrom durchfluss"),
    (Signal::Position, "x position pos stroke weg hub kolbenweg stellweg kolbenhub displacement lvdt travel"),
    (Signal::Force, "force load kraft"),
    (Signal::Time, TIMES),
];
const TIMES: &str = "t time zeit date datum timestamp elapsed clock";
const SIDE_A: &str = "a 1 head cap bore piston kolben blind";
const SIDE_B: &str = "b 2 rod annulus ring stange";

const SUPPLY: &str = "supply system pump versorgung versorgungs";
const TANK: &str = "tank return reservoir rücklauf";
const SPOOL: &str = "spool schieber";
const VALVE: &str = "valve servovalve ventil";
const COMMAND: &str = "command cmd setpoint soll sollwert demand reference";

/// A spool's position, or what it is told.
fn of_the_valve(words: &[String]) -> Option<Signal> {
    let says = |known: &str| words.iter().any(|word| lists(known, word));
    match (says(SPOOL), says(VALVE), says(COMMAND)) {
        (true, _, true) | (_, true, true) => Some(Signal::Command),
        (true, _, false) => Some(Signal::Spool),
        _ => None,
    }
}

/// Words of a column that holds no reading of a sensor: what a reading is worth, what was wanted, what counts or scales.
const NO_READINGS: &str = "validity valid quality status state value scalefactor scale factor spool valve ventil command \
                           cmd setpoint soll sollwert target demand ref reference index id no nr";

/// Whether a column may be proposed for what a sensor reads.
fn may_be_a_reading(words: &[String]) -> bool {
    let joined = words.concat();
    !words.iter().any(|word| lists(NO_READINGS, word)) && joined != "scalefactor"
}

/// Proposals for the signals that `wanted` names, of columns that are not read.
pub(super) fn propose(
    unread: &[Unread<'_>],
    wanted: &[Signal],
    decimal: Decimal,
    rig: &Rig,
) -> Vec<Proposal> {
    let mut proposals: Vec<Proposal> = Vec::new();
    let is_open = |known: &[Proposal], signal: Signal| {
        wanted.contains(&signal) && !known.iter().any(|known| known.signal == signal)
    };
    let mut left = Vec::new();
    for column in unread {
        match by_name(column, decimal, rig).filter(|found| is_open(&proposals, found.signal)) {
            Some(proposal) => proposals.push(proposal),
            None => left.push(column),
        }
    }
    for column in left {
        let words = words(column.header);
        if !may_be_a_reading(&words) || words.iter().any(|word| lists(TIMES, word)) {
            continue;
        }
        let open = |signal: &Signal| is_open(&proposals, *signal);
        let proposal = match column.says_unit() {
            true => by_unit(column, open),
            false => by_values(column, decimal, rig, open),
        };
        proposals.extend(proposal);
    }
    proposals.sort_by_key(|proposal| proposal.signal);
    proposals
}

/// What is read of each column; where the headers do not make a trace together, what they say one by one.
pub(super) fn contents(table: &TextTable, rig: &Rig) -> Vec<Option<Content>> {
    match &table.bound {
        Ok(bound) => bound.layout.columns.iter().map(|column| column.content).collect(),
        Err(_) => table.headers.iter().map(|header| content_of(header.trim(), &rig.columns)).collect(),
    }
}

/// What the columns that are not read may be.
pub(super) fn proposals(table: &TextTable, rig: &Rig) -> Vec<Proposal> {
    let found = contents(table, rig);
    let has = |signal: Signal| found.iter().flatten().any(|content| content.signal == signal);
    let has_time = has(Signal::Time) || has(Signal::Timestamp);
    let is_given = |signal: &Signal| has(*signal) || has_time && signal.is_time();
    let wanted: Vec<Signal> = Signal::ALL.into_iter().filter(|signal| !is_given(signal)).collect();
    let unit = |index: usize| {
        let cell = table.units.as_ref().and_then(|row| row.cells.get(index));
        cell.map(|cell| bare_unit(cell)).unwrap_or_default()
    };
    let unread: Vec<Unread<'_>> = (0..)
        .zip(&table.headers)
        .zip(&found)
        .filter(|(_, content)| content.is_none())
        .map(|((index, header), _)| Unread { header, unit: unit(index), cells: table.column(index) })
        .collect();
    let cells: Vec<Vec<&str>> = unread.iter().map(|column| column.cells.clone()).collect();
    let decimal = rig.csv.decimal.or_else(|| decimal(&cells).ok()).unwrap_or_default();
    let mut proposals = propose(&unread, &wanted, decimal, rig);
    if proposals.iter().any(|proposal| proposal.signal == Signal::Time) {
        proposals.retain(|proposal| proposal.signal != Signal::Timestamp);
    }
    proposals
}

fn by_name(column: &Unread<'_>, decimal: Decimal, rig: &Rig) -> Option<Proposal> {
    let words = words(column.header);
    if let Some(signal) = of_the_valve(&words) {
        let found = column.unit(Dimension::Spool)?;
        return Some(Proposal::with_unit(signal, column, found, BY_NAME));
    }
    if !may_be_a_reading(&words) {
        return None;
    }
    let is = |word: &String, known: &str| word == known || known.len() > 3 && word.contains(known);
    let says = |known: &str| words.iter().any(|word| known.split(' ').any(|known| is(word, known)));
    let quantity = WORDS.iter().find(|(_, known)| says(known)).map(|(signal, _)| *signal)?;
    let signal = match (quantity, says(SIDE_A), says(SIDE_B)) {
        (Signal::PressureA | Signal::FlowA, true, false) => quantity,
        (Signal::PressureA, false, true) => Signal::PressureB,
        (Signal::FlowA, false, true) => Signal::FlowB,
        (Signal::PressureA, false, false) if says(SUPPLY) => Signal::Supply,
        (Signal::PressureA, false, false) if says(TANK) => Signal::Tank,
        (Signal::PressureA | Signal::FlowA, ..) => return None,
        _ => quantity,
    };
    let dimension = signal.dimension()?;
    if let Some(found) = column.unit(dimension) {
        return Some(Proposal::with_unit(signal, column, found, BY_NAME));
    }
    if signal == Signal::Time && times::guess(&column.cells).is_ok() {
        return Some(Proposal::of(Signal::Timestamp, column, None, BY_NAME));
    }
    let values = values(column, decimal);
    // What is called time may be the time of another channel, or of day: this one must at least go on.
    let unit = possible_unit(signal, &values, rig).filter(|_| signal != Signal::Time || rises(&values))?;
    Some(Proposal::of(signal, column, Some(unit), BY_NAME_AND_VALUES))
}

/// The signals that a trace needs, in their usual order.
fn by_unit(column: &Unread<'_>, open: impl Fn(&Signal) -> bool) -> Option<Proposal> {
    use Signal::{FlowA, FlowB, Force, Position, PressureA, PressureB};
    let in_order = [Position, PressureA, PressureB, FlowA, FlowB, Force];
    in_order.into_iter().filter(open).find_map(|signal| {
        let found = column.unit(signal.dimension()?)?;
        Some(Proposal::with_unit(signal, column, found, BY_UNIT))
    })
}

/// Times rise, flows go both ways, and position comes before the pressures.
fn by_values(
    column: &Unread<'_>,
    decimal: Decimal,
    rig: &Rig,
    open: impl Fn(&Signal) -> bool,
) -> Option<Proposal> {
    let values = values(column, decimal);
    if values.len() < 10 {
        return None;
    }
    let rising = rises(&values);
    let (least, _) = extremes(&values);
    let tried: &[Signal] = match (rising, least < 0.0) {
        (true, _) => &[Signal::Time],
        (false, true) => &[Signal::FlowA, Signal::FlowB],
        (false, false) => &[Signal::Position, Signal::PressureA, Signal::PressureB],
    };
    tried.iter().filter(|signal| open(signal)).find_map(|signal| {
        let unit = possible_unit(*signal, &values, rig)?;
        Some(Proposal::of(*signal, column, Some(unit), BY_VALUES))
    })
}

/// The first unit, of those that are usual, in which the values are possible on the rig.
fn possible_unit(signal: Signal, values: &[f64], rig: &Rig) -> Option<Unit> {
    let dimension = signal.dimension()?;
    let (least, most) = extremes(values);
    let size = most.max(-least);
    let sheets = &rig.instruments;
    let (full_scale, usual): (f64, &[&str]) = match dimension {
        Dimension::Pressure => (sheets.pressure.full_scale, &["bar", "MPa", "psi", "kPa", "Pa"]),
        Dimension::Length => (rig.cylinder.stroke_m, &["mm", "m"]),
        Dimension::Flow => {
            (sheets.flow_a.full_scale.max(sheets.flow_b.full_scale), &["L/min", "m^3/h", "m^3/s"])
        }
        Dimension::Force => (sheets.force.full_scale, &["N", "kN"]),
        Dimension::Time => {
            let mut steps: Vec<f64> =
                values.windows(2).filter_map(|pair| Some(pair.last()? - pair.first()?)).collect();
            steps.sort_by(f64::total_cmp);
            let step = *steps.get(steps.len() / 2)?;
            let name = if step >= 1.0 { "ms" } else { "s" };
            return (step > 0.0).then(|| dimension.by_suffix(name))?;
        }
        _ => return None,
    };
    let possible = |unit: &Unit| {
        let share = unit.to_si(size) / full_scale;
        (0.005..1.3).contains(&share)
    };
    usual.iter().filter_map(|name| dimension.by_text(name)).find(possible)
}

fn values(column: &Unread<'_>, decimal: Decimal) -> Vec<f64> {
    let values = column.cells.iter().filter_map(|cell| number(cell, decimal));
    values.filter(|value| value.is_finite()).collect()
}

fn rises(values: &[f64]) -> bool {
    values.windows(2).all(|pair| pair.first() < pair.last())
}

fn extremes(values: &[f64]) -> (f64, f64) {
    values.iter().fold((f64::MAX, f64::MIN), |(least, most), value| (least.min(*value), most.max(*value)))
}

/// `HeadPressure_P1 [bar]`: head, pressure, p, 1, bar.
fn words(header: &str) -> Vec<String> {
    let mut words: Vec<String> = vec![String::new()];
    let mut before = ' ';
    for c in header.chars() {
        let new = !c.is_alphanumeric()
            || (c.is_uppercase() && before.is_lowercase())
            || (c.is_ascii_digit() && !before.is_ascii_digit());
        if new {
            words.push(String::new());
        }
        if let Some(word) = words.last_mut().filter(|_| c.is_alphanumeric()) {
            word.extend(c.to_lowercase());
        }
        before = c;
    }
    words.retain(|word| !word.is_empty());
    words
}

#[cfg(test)]
mod tests {
    use super::*;

    fn proposed(headers: &[&str], cells: &[&[&str]]) -> Vec<String> {
        let unread: Vec<_> = headers
            .iter()
            .zip(cells)
            .map(|(header, cells)| Unread { header, unit: "", cells: cells.to_vec() })
            .collect();
        let proposals = propose(&unread, &Signal::ALL, Decimal::Point, &Rig::paper());
        proposals
            .iter()
            .map(|found| format!("{} = {}", found.signal.name(), found.column.to_toml(found.signal)))
            .collect()
    }

    #[test]
    fn names_tell_quantity_and_side() {
        let headers = [
            "Elapsed (s)",
            "CylStroke [mm]",
            "HeadPressure",
            "Rod pressure [bar]",
            "FlowHead [l/min]",
            "Q2 [l/min]",
        ];
        let cells: [&[&str]; 6] = [&["0", "1"], &["1", "2"], &["40", "50"], &["30"], &["1"], &["2"]];
        assert_eq!(
            proposed(&headers, &cells),
            [
                "t = { name = \"Elapsed (s)\", unit = \"s\" }",
                "x = { name = \"CylStroke [mm]\", unit = \"mm\" }",
                "pa = { name = \"HeadPressure\", unit = \"bar\" }",
                "pb = { name = \"Rod pressure [bar]\", unit = \"bar\" }",
                "qa = { name = \"FlowHead [l/min]\", unit = \"L/min\" }",
                "qb = { name = \"Q2 [l/min]\", unit = \"L/min\" }",
            ]
        );
        assert_eq!(proposed(&["Pressure", "Flow"], &[&["40"], &["1"]]), [""; 0], "no side");
    }

    #[test]
    fn values_tell_where_names_do_not() {
        let column =
            |f: fn(f64) -> f64| (0..20).map(|i| format!("{:.3}", f(f64::from(i)))).collect::<Vec<_>>();
        let columns = [
            column(|i| 10.0 * i),
            column(|i| 100.0 + i.sin()),
            column(|i| 50.0 + i.sin()),
            column(|i| 40.0 - i.sin()),
            column(|i| 2.0 * i.sin()),
        ];
        let cells: Vec<Vec<&str>> =
            columns.iter().map(|cells| cells.iter().map(String::as_str).collect()).collect();
        let cells: Vec<&[&str]> = cells.iter().map(Vec::as_slice).collect();
        let found = proposed(&["CH0", "CH1", "CH2", "CH3", "CH4"], &cells).join("; ");
        assert_eq!(
            found,
            "t = { name = \"CH0\", unit = \"ms\" }; x = { name = \"CH1\", unit = \"mm\" }; pa = { name = \"CH2\", unit = \"bar\" }; \
             pb = { name = \"CH3\", unit = \"bar\" }; qa = { name = \"CH4\", unit = \"L/min\" }"
        );
    }

    #[test]
    fn a_valves_columns_are_proposed_where_their_unit_says_what_they_are() {
        let headers =
            ["Spool actual [%]", "Servo valve setpoint (%)", "Pump pressure [bar]", "Tank pressure [bar]"];
        let cells: [&[&str]; 4] = [&["-3", "4"], &["-2", "5"], &["160", "161"], &["2", "2.1"]];
        assert_eq!(
            proposed(&headers, &cells),
            [
                "spool = { name = \"Spool actual [%]\", unit = \"%\" }",
                "valve_command = { name = \"Servo valve setpoint (%)\", unit = \"%\" }",
                "ps = { name = \"Pump pressure [bar]\", unit = \"bar\" }",
                "pt = { name = \"Tank pressure [bar]\", unit = \"bar\" }",
            ]
        );
    }

    /// As the layouts of loggers name what is no reading: each has once been taken for one by its values.
    #[test]
    fn what_is_no_reading_is_no_signal() {
        let cells =
            |f: fn(f64) -> f64| (0..20).map(|i| format!("{:.3}", f(f64::from(i)))).collect::<Vec<_>>();
        let (steady, both_ways) = (cells(|i| 50.0 + i.sin()), cells(|i| 2.0 * i.sin()));
        for cells in [&steady, &both_ways] {
            let cells: Vec<&str> = cells.iter().map(String::as_str).collect();
            for header in ["Validity", "Value", "time", "ScaleFactor", "X_Value", "x_setpoint", "Valve cmd"] {
                assert_eq!(proposed(&[header], &[&cells]), [""; 0], "{header}");
            }
        }
    }

    #[test]
    fn a_unit_is_as_the_file_says_it() {
        let cells = (0..20).map(|i| (i % 7).to_string()).collect::<Vec<_>>();
        let cells: Vec<&str> = cells.iter().map(String::as_str).collect();
        let of = |header: &'static str, unit: &'static str| Unread { header, unit, cells: cells.clone() };
        let unread =
            [of("AI0", "cm"), of("AI1", "MPa"), of("AI2 [psi]", ""), of("AI3", "°C"), of("AI4", "l/min")];
        let found = propose(&unread, &Signal::ALL, Decimal::Point, &Rig::paper());
        let found: Vec<_> = found
            .iter()
            .map(|one| (one.signal, one.column.name.as_str(), one.column.unit.map(|unit| unit.text), one.why))
            .collect();
        assert_eq!(
            found,
            [
                (Signal::Position, "AI0", Some("cm"), BY_UNIT),
                (Signal::PressureA, "AI1", Some("MPa"), BY_UNIT),
                (Signal::PressureB, "AI2 [psi]", Some("psi"), BY_UNIT),
                (Signal::FlowA, "AI4", Some("L/min"), BY_UNIT),
            ]
        );
    }
}
