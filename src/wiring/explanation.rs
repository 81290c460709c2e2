//! What a mistake is called, and the lines of `[columns]` that mend it.

use super::mistake::{Exchange, Mistake};
use super::readings::Readings;
use crate::rig::{ColumnMap, ForeignColumn, Rig};
use crate::signal::Signal;
use crate::units::{Dimension, FEW_DIGITS, LPM_PER_M3S, Unit, readable, rounded};
use pitchleak_core::ATMOSPHERE_PA;
use serde::Serialize;

/// The mistake that explains a trace.
#[derive(Clone, Debug, PartialEq)]
pub struct Explanation {
    /// The most likely one, and those that cannot be told from it.
    pub mistakes: Vec<Mistake>,
    /// What speaks for it.
    pub evidence: Evidence,
}

/// What speaks for a mistake.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Evidence {
    /// Size of the residual in standard deviations of the declared noise.
    Residual {
        /// As the wiring is declared …
        before: f64,
        /// … and with the mistake mended.
        after: f64,
    },
    /// Residual of the force balance, root mean square, N.
    Force {
        /// With the pressures as they are read …
        before: f64,
        /// … and exchanged.
        after: f64,
    },
    /// What the reader refused as out of range.
    Range {
        /// Rows refused, …
        refused: u64,
        /// … of so many.
        rows: u64,
        /// Least and largest reading once the mistake is mended, SI.
        extremes: [f64; 2],
        /// The forces without the load force and with it, root mean square, N, where they tell.
        force: Option<[f64; 2]>,
    },
    /// How large the scatter of the readings is as they stand, in that declared; the other channels scatter as declared.
    Scatter(f64),
    /// So many readings are positive and as large as the negative flow that the piston's motion gives.
    Motion(usize),
}

/// An [`Explanation`] in words, for a trace whose columns are known.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Wiring {
    /// The mistake and its evidence, in one sentence.
    pub suggestion: String,
    /// Size of the residual in standard deviations of the declared noise, as the wiring is declared; none where
    /// something else speaks.
    pub residual_before: Option<f64>,
    /// Size of the residual with the mistake mended, in standard deviations of the declared noise.
    pub residual_after: Option<f64>,
    /// Lines for `[columns]` of the rig file that mend the first; none where the recording has to be mended.
    pub columns: Vec<String>,
    /// Sensors whose readings carry the first.
    pub sensors: Vec<Signal>,
    /// Mistakes that explain the trace as well.
    pub alternatives: Vec<String>,
}

impl Wiring {
    /// What to do about it.
    pub fn remedy(&self, check: &str) -> String {
        if self.columns.is_empty() {
            return format!("check {check}, and record anew");
        }
        format!(
            "check {check}; where that is so, mend it in the rig file: [columns] {}",
            self.columns.join("; ")
        )
    }

    /// It in one sentence, without a full stop.
    pub fn sentence(&self) -> String {
        format!("{}; {}", self.suggestion, self.remedy(HOW_WIRED))
    }
}

/// What to check of a mistake of wiring.
pub const HOW_WIRED: &str = "how the columns are wired and recorded";

impl Explanation {
    /// In words; `columns` are those that the trace was read by.
    pub fn wiring(&self, columns: &ColumnMap, rig: &Rig) -> Wiring {
        let name = |mistake: &Mistake| match self.evidence {
            Evidence::Range { .. } => mistake.text() + &mistake.unit_text(columns),
            _ => mistake.text(),
        };
        let names: Vec<String> = self.mistakes.iter().map(name).collect();
        let first = names.first().cloned().unwrap_or_default();
        let alternatives = names.get(1..).unwrap_or_default().to_vec();
        let (mut suggestion, residuals) = match self.evidence {
            Evidence::Residual { before, after } => {
                let text = if before > 1.5 * after {
                    let (before, after) = (figure(before), figure(after));
                    format!("with {first} the residual falls from {before} to {after} times the noise")
                } else {
                    format!("with {first} no leak is negative, which it is as the columns are declared")
                };
                (text, Some((before, after)))
            }
            Evidence::Force { before, after } => {
                (format!("with {first} the forces balance to {after:.0} N and not to {before:.0} N"), None)
            }
            Evidence::Range { refused, rows, extremes, force } => {
                (self.within_range(&first, refused, rows, extremes, force), None)
            }
            Evidence::Scatter(ratio) => (
                format!("with {first} they scatter as declared, and {ratio:.2} times that as they stand"),
                None,
            ),
            Evidence::Motion(readings) => (
                format!(
                    "with {first} {readings} readings follow the piston's motion; they are never negative as they stand"
                ),
                None,
            ),
        };
        if !alternatives.is_empty() {
            suggestion += &format!("; cannot be told apart: {}", names.join(", "));
        }
        Wiring {
            suggestion,
            residual_before: residuals.map(|(before, _)| before),
            residual_after: residuals.map(|(_, after)| after),
            columns: self.mistakes.first().map_or_else(Vec::new, |mistake| mistake.mending(columns, rig)),
            sensors: self.mistakes.first().map_or_else(Vec::new, |mistake| mistake.sensors()),
            alternatives,
        }
    }

    /// `first` is what mends it.
    fn within_range(
        &self,
        first: &str,
        refused: u64,
        rows: u64,
        extremes: [f64; 2],
        force: Option<[f64; 2]>,
    ) -> String {
        let Some(Mistake::Scaled(readings, _)) = self.mistakes.first() else { return String::new() };
        let unit =
            readings.signals().first().and_then(|signal| signal.dimension()).and_then(Dimension::for_people);
        let [least, most] = extremes.map(|value| unit.map_or(value, |unit| unit.from_si(value)));
        let forces = force.map_or_else(String::new, |[before, after]| {
            format!(", and balance the load force to {after:.0} N of {before:.0} N")
        });
        format!(
            "with {first} they are {} to {} {}, which the rig allows{forces}; as they stand {refused} of {rows} rows are out of range",
            readable(least, 3),
            readable(most, 3),
            unit.map_or("", |unit| unit.text)
        )
    }
}

fn figure(residual: f64) -> String {
    if residual < 9.95 { format!("{residual:.1}") } else { format!("{residual:.0}") }
}

impl Mistake {
    /// What mends it, as in "with … the residual falls".
    pub fn text(self) -> String {
        match self {
            Self::Exchanged(Exchange::Pressures) => "pa and pb exchanged".to_owned(),
            Self::Exchanged(Exchange::Flows) => "qa and qb exchanged".to_owned(),
            Self::Exchanged(Exchange::Chambers) => "pa and pb, qa and qb exchanged (A and B)".to_owned(),
            Self::Sign(readings) => format!("the sign of {} turned", readings.text()),
            Self::Size(readings) => format!("the sign that {} lost put back", readings.text()),
            Self::OtherEnd => "x counted from the other end (stroke − x)".to_owned(),
            Self::Scaled(readings, factor) if factor > 1.0 => {
                format!("{} divided by {}", readings.text(), number(factor))
            }
            Self::Scaled(readings, factor) => format!("{} times {}", readings.text(), number(1.0 / factor)),
            Self::Absolute(readings) => format!("{} taken as absolute pressure", readings.text()),
            Self::Zero(readings, by_m3s) if by_m3s > 0.0 => {
                format!("{} L/min taken off {}", number(by_m3s * LPM_PER_M3S), readings.text())
            }
            Self::Zero(readings, by_m3s) => {
                format!("{} L/min added to {}", number(-by_m3s * LPM_PER_M3S), readings.text())
            }
            Self::Zeros(by_m3s) => Self::zero_of_each(by_m3s).map(|zero| zero.text()).join(" and "),
            Self::Late(readings, by_s) => format!("{} moved {:.0} ms earlier", readings.text(), 1e3 * by_s),
        }
    }

    /// The unit that a scaled column then has, as ` (psi)`; empty where it is none that has a name.
    fn unit_text(self, columns: &ColumnMap) -> String {
        let Self::Scaled(readings, factor) = self else { return String::new() };
        let unit = readings.signals().first().and_then(|signal| {
            let now = columns.get(signal)?.unit?;
            let mended = in_unit(columns.get(signal)?.clone(), *signal, 1.0 / factor).unit?;
            (mended.text != now.text).then_some(mended.text)
        });
        unit.map_or_else(String::new, |unit| format!(" ({unit})"))
    }

    /// The sensors whose readings carry it.
    fn sensors(self) -> Vec<Signal> {
        match self {
            Self::Exchanged(exchange) => exchange.pairs().iter().flat_map(|(a, b)| [*a, *b]).collect(),
            Self::Sign(readings)
            | Self::Size(readings)
            | Self::Scaled(readings, _)
            | Self::Absolute(readings)
            | Self::Zero(readings, _)
            | Self::Late(readings, _) => readings.signals().to_vec(),
            Self::OtherEnd => Readings::Position.signals().to_vec(),
            Self::Zeros(_) => Readings::Flows.signals().to_vec(),
        }
    }

    /// The lines of `[columns]` that mend it; none where a column cannot say it.
    pub fn mending(self, columns: &ColumnMap, rig: &Rig) -> Vec<String> {
        let line = |signal: Signal, from: Signal, change: &dyn Fn(ForeignColumn) -> ForeignColumn| {
            let column = without_arithmetic(change(columns.get(&from)?.clone()), signal);
            Some(format!("{} = {}", signal.name(), column.to_toml(signal)))
        };
        let each = |readings: Readings, change: &dyn Fn(ForeignColumn) -> ForeignColumn| {
            readings.signals().iter().filter_map(|signal| line(*signal, *signal, change)).collect()
        };
        let as_it_is = |column| column;
        match self {
            Self::Exchanged(exchange) => exchange
                .pairs()
                .iter()
                .flat_map(|(a, b)| [line(*a, *b, &as_it_is), line(*b, *a, &as_it_is)])
                .flatten()
                .collect(),
            Self::Sign(readings) => each(readings, &|column| linear(column, -1.0, 0.0)),
            Self::OtherEnd => each(Readings::Position, &|column| linear(column, -1.0, rig.cylinder.stroke_m)),
            Self::Scaled(Readings::Time, _) if !columns.contains_key(&Signal::Time) => Vec::new(),
            Self::Scaled(readings, factor) => readings
                .signals()
                .iter()
                .filter_map(|signal| line(*signal, *signal, &|column| in_unit(column, *signal, 1.0 / factor)))
                .collect(),
            Self::Absolute(readings) => each(readings, &|column| linear(column, 1.0, -ATMOSPHERE_PA)),
            Self::Zero(readings, by_m3s) => each(readings, &|column| linear(column, 1.0, -by_m3s)),
            Self::Zeros(by_m3s) => {
                Self::zero_of_each(by_m3s).iter().flat_map(|zero| zero.mending(columns, rig)).collect()
            }
            Self::Size(_) | Self::Late(..) => Vec::new(),
        }
    }
}

impl Exchange {
    fn pairs(self) -> &'static [(Signal, Signal)] {
        const PRESSURES: (Signal, Signal) = (Signal::PressureA, Signal::PressureB);
        const FLOWS: (Signal, Signal) = (Signal::FlowA, Signal::FlowB);
        match self {
            Self::Pressures => &[PRESSURES],
            Self::Flows => &[FLOWS],
            Self::Chambers => &[PRESSURES, FLOWS],
        }
    }
}

/// The column, its readings times `scale` plus `offset`.
fn linear(column: ForeignColumn, scale: f64, offset: f64) -> ForeignColumn {
    ForeignColumn { scale: column.scale * scale + 0.0, offset: column.offset * scale + offset, ..column }
}

/// The column in the unit that makes its readings `factor` times as large, else with a scale.
fn in_unit(column: ForeignColumn, signal: Signal, factor: f64) -> ForeignColumn {
    let Some(now) = column.unit else { return column };
    let fits = |unit: &&Unit| (unit.over(&now) / factor - 1.0).abs() < 1e-6;
    let unit = signal.dimension().and_then(|dimension| dimension.units().iter().find(fits).copied());
    match unit {
        Some(unit) => ForeignColumn { unit: Some(unit), ..column },
        None => linear(column, rounded(factor, GAIN_DIGITS), 0.0),
    }
}

/// A gain is known to a thousandth.
const GAIN_DIGITS: usize = 4;

/// The column without the digits that arithmetic leaves in its numbers.
fn without_arithmetic(column: ForeignColumn, signal: Signal) -> ForeignColumn {
    let offset = signal.dimension().map_or(column.offset, |of| of.rounded_difference(column.offset));
    ForeignColumn { scale: rounded(column.scale, FEW_DIGITS), offset, ..column }
}

/// Five significant digits at the most.
fn number(value: f64) -> String {
    let digits = (4 - value.abs().log10().floor() as i32).clamp(0, 8) as usize;
    let text = format!("{value:.digits$}");
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn columns(unit: &str, scale: f64, offset: f64) -> ColumnMap {
        let unit = crate::units::unit(unit, Dimension::Flow).unwrap();
        let column = ForeignColumn { scale, offset, ..ForeignColumn::new("Q1", Some(unit)) };
        ColumnMap::from([(Signal::FlowA, column)])
    }

    /// The line, and the rig file's column that it makes.
    fn mended(mistake: Mistake, columns: &ColumnMap) -> (String, ForeignColumn) {
        let mut rig = Rig::paper();
        rig.columns = columns.clone();
        let line = mistake.mending(columns, &rig).remove(0);
        rig.columns.clear();
        let text = format!("{}[columns]\n{line}\n", rig.to_toml());
        let rig = Rig::parse(&text, "rig.toml").unwrap();
        (line, rig.columns[&Signal::FlowA].clone())
    }

    #[test]
    fn a_zero_is_written_as_it_is_known_and_in_the_unit_that_people_read() {
        let (line, _) = mended(Mistake::Zero(Readings::FlowA, -0.39 / 60e3), &columns("L/min", 1.0, 0.0));
        assert_eq!(line, "qa = { name = \"Q1\", unit = \"L/min\", offset = \"0.39 L/min\" }");
        let (line, _) = mended(Mistake::Scaled(Readings::FlowA, 1.2), &columns("L/min", 1.0, 0.0));
        assert_eq!(line, "qa = { name = \"Q1\", unit = \"L/min\", scale = 0.8333 }");
    }

    proptest! {
        /// Whatever the column's own scale and offset are.
        #[test]
        fn what_mends_a_zero_or_a_gain_has_few_digits_and_loads(
            zero_mlpm in -2000..2000i32,
            factor in 601..1666i32,
            offset_mlpm in -2000..2000i32,
            scale in 1..1000i32,
        ) {
            let (zero, offset) = (f64::from(zero_mlpm) / 60e6, f64::from(offset_mlpm) / 60e6);
            let (factor, scale) = (f64::from(factor) / 1e3, f64::from(scale) / 1e2);
            let columns = columns("L/s", scale, offset);
            let (line, column) = mended(Mistake::Zero(Readings::FlowA, zero), &columns);
            let left = offset - zero;
            prop_assert!((column.offset - left).abs() <= 1e-15, "{} {}", line, left);
            prop_assert!(line.len() <= 80, "{}", line);
            let (line, column) = mended(Mistake::Scaled(Readings::FlowA, factor), &columns);
            // Half a unit of the last of four digits.
            prop_assert!((column.scale * factor / scale - 1.0).abs() < 5.1e-4, "{}", line);
            prop_assert!(line.len() <= 88, "{}", line);
        }
    }
}
