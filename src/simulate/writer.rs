use super::{Scenario, Truth, ValveTruth};
use crate::signal::Signal;
use crate::units::LPM_PER_M3S;
use pitchleak_core::Sample;
use std::io::{self, Write};

/// One column of a simulated trace.
#[derive(Clone, Copy, Debug)]
struct Column {
    signal: Signal,
    header: &'static str,
    /// Rounding stays below any sensor (10 nm, 1 Pa, 1e-6 L/min, 1 mN). Times are shares of a second: rounding to
    /// 1 ns shows them as they are.
    decimals: usize,
    /// From SI to the header's unit.
    in_unit: fn(f64) -> f64,
}

const fn column(signal: Signal, header: &'static str, decimals: usize, in_unit: fn(f64) -> f64) -> Column {
    Column { signal, header, decimals, in_unit }
}

const READINGS: [Column; 7] = [
    column(Signal::Time, "t_s", 9, |s| s),
    column(Signal::Position, "x_mm", 5, |m| m * 1e3),
    column(Signal::PressureA, "pa_bar", 5, |pa| pa / 1e5),
    column(Signal::PressureB, "pb_bar", 5, |pa| pa / 1e5),
    column(Signal::FlowA, "qa_lpm", 6, lpm),
    column(Signal::FlowB, "qb_lpm", 6, lpm),
    column(Signal::Force, "force_n", 3, |n| n),
];
const TEMPERATURE: Column = column(Signal::Temperature, "temp_c", 3, |k| k - 273.15);
const SHUT: Column = column(Signal::Shut, "shut", 0, |is| is);
const VALVE: [Column; 3] = [
    column(Signal::Spool, "spool_percent", 5, |share| share * 100.0),
    column(Signal::Command, "valve_command_percent", 5, |share| share * 100.0),
    column(Signal::Supply, "ps_bar", 5, |pa| pa * 1e-5),
];
const LEAKS: [Column; 3] = [
    column(Signal::LeakInternal, "q_int_lpm", 6, lpm),
    column(Signal::LeakExternalA, "q_ext_a_lpm", 6, lpm),
    column(Signal::LeakExternalB, "q_ext_b_lpm", 6, lpm),
];

fn lpm(m3s: f64) -> f64 {
    m3s * LPM_PER_M3S
}

/// Up to here each number of units is a double of its own.
const MOST_UNITS: f64 = 9e15;

impl Column {
    /// The double nearest to the rounded decimal number: what a reader of its text gets.
    fn rounded(&self, row: &Reading) -> f64 {
        self.units(row) / self.scale()
    }

    /// The value in units of its last decimal; NaN where there is none.
    fn units(&self, row: &Reading) -> f64 {
        (row.get(self.signal).map_or(f64::NAN, self.in_unit) * self.scale()).round()
    }

    fn scale(&self) -> f64 {
        10f64.powi(self.decimals as i32)
    }

    /// Its text, digit by digit: a third of the time that formatting a float takes, and the same.
    fn write(&self, row: &Reading, out: &mut impl Write) -> io::Result<()> {
        let units = self.units(row);
        if units.is_nan() {
            return Ok(());
        }
        if units.abs() > MOST_UNITS {
            return write!(out, "{:.*}", self.decimals, units / self.scale());
        }
        let (mut text, mut at, mut rest) = ([0; 24], 24, units.abs() as u64);
        let mut digits = 0;
        while rest > 0 || digits <= self.decimals {
            if digits == self.decimals && digits > 0 {
                at -= 1;
                text[at] = b'.';
            }
            at -= 1;
            text[at] = b'0' + (rest % 10) as u8;
            (rest, digits) = (rest / 10, digits + 1);
        }
        if units.is_sign_negative() {
            at -= 1;
            text[at] = b'-';
        }
        out.write_all(&text[at..])
    }
}

/// The columns of a simulated trace.
#[derive(Clone, Debug)]
pub struct TraceLayout(Vec<Column>);

impl Default for TraceLayout {
    /// Without the oil's temperature.
    fn default() -> Self {
        Self(READINGS.into_iter().chain(LEAKS).collect())
    }
}

impl TraceLayout {
    /// The columns that a scenario's trace has; the oil's temperature and `shut` only where the scenario says them. A rig with
    /// `[valve]` has no flow meters.
    pub fn of(scenario: &Scenario) -> Self {
        let has_valve = scenario.rig.valve.is_some();
        let is_flow = |column: &Column| matches!(column.signal, Signal::FlowA | Signal::FlowB);
        let readings = READINGS.into_iter().filter(|column| !(has_valve && is_flow(column)));
        let valve = VALVE.into_iter().filter(|_| has_valve);
        let temperature = scenario.oil_temperature.as_ref().map(|_| TEMPERATURE);
        let shut = scenario.shut.map(|_| SHUT);
        Self(readings.chain(valve).chain(temperature).chain(shut).chain(LEAKS).collect())
    }

    /// The columns without a row.
    pub(super) fn columns(&self) -> Columns {
        self.0.iter().map(|column| (column.header, Vec::new())).collect()
    }

    /// Adds a row to columns of this layout.
    pub(super) fn push(&self, row: &Reading, columns: &mut Columns) {
        for (column, (_, values)) in self.0.iter().zip(columns) {
            values.push(column.rounded(row));
        }
    }
}

/// A simulated trace in memory: header and values of each column, as a reader of its file has them.
pub type Columns = Vec<(&'static str, Vec<f64>)>;

/// Writes a trace as CSV with the reference leak columns.
pub struct TraceWriter<W> {
    out: W,
    layout: TraceLayout,
}

impl<W: Write> TraceWriter<W> {
    /// Writes the header.
    ///
    /// # Errors
    /// Where `out` cannot be written to.
    pub fn new(mut out: W, layout: TraceLayout) -> io::Result<Self> {
        let headers: Vec<_> = layout.0.iter().map(|column| column.header).collect();
        writeln!(out, "{}", headers.join(","))?;
        Ok(Self { out, layout })
    }

    /// Writes one row.
    ///
    /// # Errors
    /// Where the output cannot be written to.
    pub fn row(&mut self, row: &Reading) -> io::Result<()> {
        for (index, column) in self.layout.0.iter().enumerate() {
            if index > 0 {
                self.out.write_all(b",")?;
                column.write(row, &mut self.out)?;
                continue;
            }
            let time_s = column.rounded(row);
            if !time_s.is_nan() {
                write!(self.out, "{time_s}")?;
            }
        }
        self.out.write_all(b"\n")
    }

    /// The output, to be finished by the caller.
    pub fn into_inner(self) -> W {
        self.out
    }
}

/// One row of a recording by its signals, SI: what sensors and clock show, and what is true of ports and leaks.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct Reading([Option<f64>; Signal::ALL.len()]);

impl Reading {
    /// An instant of which the sensors show `sample`, and those of the valve `valve`, where the rig has one.
    pub fn at(truth: &Truth, sample: &Sample<f64>, valve: Option<ValveTruth>) -> Self {
        let mut row = Self::default();
        let [x_m, pa_pa, pb_pa, qa_m3s, qb_m3s] = sample.readings();
        for (signal, value) in [
            (Signal::Time, Some(truth.t_s)),
            (Signal::Position, x_m),
            (Signal::PressureA, pa_pa),
            (Signal::PressureB, pb_pa),
            (Signal::FlowA, qa_m3s),
            (Signal::FlowB, qb_m3s),
            (Signal::Force, sample.force_n),
            (Signal::Temperature, truth.temp_k),
            (Signal::Spool, valve.map(|valve| valve.spool)),
            (Signal::Command, valve.map(|valve| valve.command)),
            (Signal::Supply, valve.map(|valve| valve.supply_pa)),
            (Signal::Shut, truth.is_shut.map(|is| f64::from(u8::from(is)))),
            (Signal::LeakInternal, Some(truth.leaks_m3s.internal)),
            (Signal::LeakExternalA, Some(truth.leaks_m3s.external_a)),
            (Signal::LeakExternalB, Some(truth.leaks_m3s.external_b)),
        ] {
            row.set(signal, value);
        }
        row
    }

    /// What a channel shows; none where it shows nothing or is not recorded.
    pub fn get(&self, channel: Signal) -> Option<f64> {
        self.0[channel as usize]
    }

    /// Makes a channel show something else, or nothing.
    pub fn set(&mut self, channel: Signal, value: Option<f64>) {
        self.0[channel as usize] = value;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Signs of nothing, carries, no decimals, more digits than a double has.
    #[test]
    fn digits_are_those_of_the_formatter() {
        let values = [0.0, -0.0, -1e-9, 9.999_999_7, -0.05, 123_456.789, 4e9, -7e14, 3e300, 0.1 + 0.2];
        for decimals in [0, 3, 5, 6, 9] {
            for value in values {
                let column = column(Signal::Time, "", decimals, |s| s);
                let (mut row, mut text) = (Reading::default(), Vec::new());
                row.set(Signal::Time, Some(value));
                column.write(&row, &mut text).unwrap();
                let rounded = column.rounded(&row);
                assert_eq!(String::from_utf8(text).unwrap(), format!("{rounded:.decimals$}"));
            }
        }
    }
}
