//! What mends a mistake: in words, and as lines of the rig file.

use crate::explain::{Mistake, Of};
use crate::rig::{ColumnMap, ForeignColumn, Rig};
use crate::signal::Signal;
use crate::units::{FEW_DIGITS, Unit, rounded};
use pitchleak_core::ATMOSPHERE_PA;

impl Mistake {
    /// What mends it, as in "with … the residual falls".
    pub(super) fn text(self) -> String {
        match self {
            Self::FlowsExchanged => "qa and qb exchanged".to_owned(),
            Self::PressuresExchanged => "pa and pb exchanged".to_owned(),
            Self::ChambersExchanged => "pa and pb, qa and qb exchanged (A and B)".to_owned(),
            Self::FlowsExchangedAndTurned => "qa and qb exchanged and their signs turned".to_owned(),
            Self::Sign(of) => format!("the sign of {} turned", of.text()),
            Self::LostSign(of) => format!("the sign that {} lost put back", of.text()),
            Self::OtherEnd => "x counted from the other end (stroke − x)".to_owned(),
            Self::Factor(of, factor) => scaled(of.text(), factor),
            Self::Clock(factor) => scaled("t", factor),
            Self::Absolute(of) => format!("{} taken as absolute pressure", of.text()),
            Self::AreasExchanged => "area_a and area_b exchanged".to_owned(),
            Self::Area(side, factor) => scaled(if side == 0 { "area_a" } else { "area_b" }, factor),
        }
    }

    /// The unit that a scaled column then has, as ` (psi)`; empty where it is none that has a name.
    pub(super) fn unit_text(self, columns: &ColumnMap) -> String {
        let Self::Factor(of, factor) = self else { return String::new() };
        let signal = of.sensors().first().copied();
        let column = signal.and_then(|signal| Some((signal, columns.get(&signal)?.unit?)));
        let unit = column.and_then(|(signal, now)| named_unit(signal, now, 1.0 / factor));
        unit.map_or_else(String::new, |unit| format!(" ({})", unit.text))
    }

    /// The lines of its table of the rig file that mend it; none where none can say it.
    pub(super) fn mending(self, columns: &ColumnMap, rig: &Rig) -> Vec<String> {
        let line = |signal: Signal, from: Signal, change: &dyn Fn(ForeignColumn) -> ForeignColumn| {
            let column = without_arithmetic(change(columns.get(&from)?.clone()), signal);
            Some(format!("{} = {}", signal.name(), column.to_toml(signal)))
        };
        let each = |signals: &[Signal], change: &dyn Fn(ForeignColumn) -> ForeignColumn| {
            signals.iter().filter_map(|signal| line(*signal, *signal, change)).collect::<Vec<_>>()
        };
        let exchanged = |pairs: &[(Signal, Signal)], scale: f64| {
            let change = |column| linear(column, scale, 0.0);
            let both = pairs.iter().flat_map(|(a, b)| [line(*a, *b, &change), line(*b, *a, &change)]);
            both.flatten().collect::<Vec<_>>()
        };
        let areas_m2 = [rig.cylinder.area_a_m2, rig.cylinder.area_b_m2];
        match self {
            Self::PressuresExchanged => exchanged(&[PRESSURES], 1.0),
            Self::FlowsExchanged => exchanged(&[FLOWS], 1.0),
            Self::FlowsExchangedAndTurned => exchanged(&[FLOWS], -1.0),
            Self::ChambersExchanged => exchanged(&[PRESSURES, FLOWS], 1.0),
            Self::Sign(of) => each(of.sensors(), &|column| linear(column, -1.0, 0.0)),
            Self::OtherEnd => {
                each(&[Signal::Position], &|column| linear(column, -1.0, rig.cylinder.stroke_m))
            }
            Self::Factor(of, factor) => in_unit_each(of.sensors(), factor, &line),
            Self::Clock(factor) => in_unit_each(&[Signal::Time], factor, &line),
            Self::Absolute(of) => each(of.sensors(), &|column| linear(column, 1.0, -ATMOSPHERE_PA)),
            Self::LostSign(_) => Vec::new(),
            Self::AreasExchanged => vec![area(0, areas_m2[1]), area(1, areas_m2[0])],
            Self::Area(side, factor) => vec![area(side, areas_m2[side] / factor)],
        }
    }

    /// The table of the rig file in which they stand.
    pub(crate) fn table(self) -> &'static str {
        if self.is_of_rig() { "cylinder" } else { "columns" }
    }
}

/// A line for a signal, from another's column that is changed.
type Line<'a> = &'a dyn Fn(Signal, Signal, &dyn Fn(ForeignColumn) -> ForeignColumn) -> Option<String>;

fn in_unit_each(signals: &[Signal], factor: f64, line: Line<'_>) -> Vec<String> {
    let one = |signal: &Signal| line(*signal, *signal, &|column| in_unit(column, *signal, 1.0 / factor));
    signals.iter().filter_map(one).collect()
}

const PRESSURES: (Signal, Signal) = (Signal::PressureA, Signal::PressureB);
const FLOWS: (Signal, Signal) = (Signal::FlowA, Signal::FlowB);

impl Of {
    fn text(self) -> &'static str {
        match self {
            Self::Position => "x",
            Self::PressureA => "pa",
            Self::PressureB => "pb",
            Self::Pressures => "pa and pb",
            Self::FlowA => "qa",
            Self::FlowB => "qb",
            Self::Flows => "qa and qb",
        }
    }
}

/// The line of an area.
fn area(side: usize, area_m2: f64) -> String {
    format!("{} = \"{} cm^2\"", ["area_a", "area_b"][side], number(1e4 * area_m2))
}

fn scaled(what: &str, factor: f64) -> String {
    if factor > 1.0 {
        format!("{what} divided by {}", number(factor))
    } else {
        format!("{what} times {}", number(1.0 / factor))
    }
}

/// The unit of readings that are `factor` times as large as in `now`.
fn named_unit(signal: Signal, now: Unit, factor: f64) -> Option<Unit> {
    let fits = |unit: &&Unit| (unit.over(&now) / factor - 1.0).abs() < 1e-6;
    signal.dimension()?.units().iter().find(fits).copied()
}

/// The column, its readings times `scale` plus `offset`.
fn linear(column: ForeignColumn, scale: f64, offset: f64) -> ForeignColumn {
    ForeignColumn { scale: column.scale * scale + 0.0, offset: column.offset * scale + offset, ..column }
}

/// The column in the unit that makes its readings `factor` times as large, else with a scale.
fn in_unit(column: ForeignColumn, signal: Signal, factor: f64) -> ForeignColumn {
    let Some(now) = column.unit else { return column };
    match named_unit(signal, now, factor) {
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
    use crate::units::Dimension;
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
    fn a_unit_that_has_a_name_is_named_and_another_is_a_scale() {
        let (line, _) = mended(Mistake::Factor(Of::FlowA, 60.0), &columns("L/s", 1.0, 0.0));
        assert_eq!(line, "qa = { name = \"Q1\", unit = \"L/min\" }");
        let (line, _) = mended(Mistake::Factor(Of::FlowA, 10.0), &columns("L/min", 1.0, 0.0));
        assert_eq!(line, "qa = { name = \"Q1\", unit = \"L/min\", scale = 0.1 }");
    }

    /// Oil knows no names: a rig file with both areas exchanged, or one of them in another unit, is mended where it is wrong.
    #[test]
    fn areas_are_mended_in_the_cylinder() {
        let rig = Rig::paper();
        let [a, b] = [rig.cylinder.area_a_m2, rig.cylinder.area_b_m2];
        let cases = [(Mistake::AreasExchanged, [b, a]), (Mistake::Area(1, 10.0), [a, b / 10.0])];
        for (mistake, expected) in cases {
            let mut mended = rig.to_toml();
            for line in mistake.mending(&ColumnMap::new(), &rig) {
                let key = line.split(' ').next().unwrap();
                let old = mended.lines().find(|old| old.starts_with(key)).unwrap().to_owned();
                mended = mended.replace(&old, &line);
            }
            let cylinder = Rig::parse(&mended, "rig.toml").unwrap().cylinder;
            for (found, expected) in [cylinder.area_a_m2, cylinder.area_b_m2].into_iter().zip(expected) {
                assert!((found / expected - 1.0).abs() < 1e-4, "{mistake:?}: {mended}");
            }
            assert_eq!(mistake.table(), "cylinder");
        }
    }

    proptest! {
        /// Whatever the column's own scale and offset are.
        #[test]
        fn what_mends_a_sign_or_a_factor_has_few_digits_and_loads(
            factor in 601..1666i32,
            offset_mlpm in -2000..2000i32,
            scale in 1..1000i32,
        ) {
            let offset = f64::from(offset_mlpm) / 60e6;
            let (factor, scale) = (f64::from(factor) / 1e3, f64::from(scale) / 1e2);
            let columns = columns("L/s", scale, offset);
            let (line, column) = mended(Mistake::Sign(Of::FlowA), &columns);
            prop_assert!((column.offset + offset).abs() <= 1e-15, "{}", line);
            prop_assert!(line.len() <= 80, "{}", line);
            let (line, column) = mended(Mistake::Factor(Of::FlowA, factor), &columns);
            // Half a unit of the last of four digits.
            prop_assert!((column.scale * factor / scale - 1.0).abs() < 5.1e-4, "{}", line);
            prop_assert!(line.len() <= 88, "{}", line);
        }
    }
}
