use super::{Scenario, Truth, ValveTruth};
use crate::signal::Signal;
use crate::units::LPM_PER_M3S;
use pitchleak_core::Sample;
use std::io::{self, Write};

/// One column of a simulated trace.
#[derive(Clone, Copy, Debug)]
struct Column {
    header: &'static str,
    /// Rounding stays below any sensor (10 nm, 1 Pa, 1e-6 L/min, 1 mN). Times are shares of a second: rounding to
    /// 1 ns shows them as they are.
    decimals: usize,
    /// Of what is true and what sensors and clock show; NaN where there is no reading.
    value: fn(&Truth, &Reading) -> f64,
}

const fn column(header: &'static str, decimals: usize, value: fn(&Truth, &Reading) -> f64) -> Column {
    Column { header, decimals, value }
}

fn or_nan(reading: Option<f64>, per_unit: f64) -> f64 {
    reading.map_or(f64::NAN, |value| value * per_unit)
}

const READINGS: [Column; 7] = [
    column("t_s", 9, |_, shown| shown.t_s),
    column("x_mm", 5, |_, shown| shown.sample.x_m * 1e3),
    column("pa_bar", 5, |_, shown| shown.sample.pa_pa / 1e5),
    column("pb_bar", 5, |_, shown| shown.sample.pb_pa / 1e5),
    column("qa_lpm", 6, |_, shown| or_nan(shown.sample.qa_m3s, LPM_PER_M3S)),
    column("qb_lpm", 6, |_, shown| or_nan(shown.sample.qb_m3s, LPM_PER_M3S)),
    column("force_n", 3, |_, shown| or_nan(shown.sample.force_n, 1.0)),
];
const TEMPERATURE: Column = column("temp_c", 3, |_, shown| shown.temp_k.map_or(f64::NAN, |k| k - 273.15));
const SHUT: Column =
    column("shut", 0, |truth, _| truth.is_shut.map_or(f64::NAN, |is| f64::from(u8::from(is))));
const VALVE: [Column; 3] = [
    column("spool_percent", 5, |_, shown| or_nan(shown.valve.map(|valve| valve.spool), 100.0)),
    column("valve_command_percent", 5, |_, shown| or_nan(shown.valve.map(|valve| valve.command), 100.0)),
    column("ps_bar", 5, |_, shown| or_nan(shown.valve.map(|valve| valve.supply_pa), 1e-5)),
];
const LEAKS: [Column; 3] = [
    column("q_int_lpm", 6, |truth, _| truth.leaks_m3s.internal * LPM_PER_M3S),
    column("q_ext_a_lpm", 6, |truth, _| truth.leaks_m3s.external_a * LPM_PER_M3S),
    column("q_ext_b_lpm", 6, |truth, _| truth.leaks_m3s.external_b * LPM_PER_M3S),
];

/// Up to here each number of units is a double of its own.
const MOST_UNITS: f64 = 9e15;

impl Column {
    /// The double nearest to the rounded decimal number: what a reader of its text gets.
    fn rounded(&self, truth: &Truth, shown: &Reading) -> f64 {
        self.units(truth, shown) / self.scale()
    }

    /// The value in units of its last decimal.
    fn units(&self, truth: &Truth, shown: &Reading) -> f64 {
        ((self.value)(truth, shown) * self.scale()).round()
    }

    fn scale(&self) -> f64 {
        10f64.powi(self.decimals as i32)
    }

    /// Its text, digit by digit: a third of the time that formatting a float takes, and the same.
    fn write(&self, truth: &Truth, shown: &Reading, out: &mut impl Write) -> io::Result<()> {
        let units = self.units(truth, shown);
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
        let is_flow = |column: &Column| matches!(column.header, "qa_lpm" | "qb_lpm");
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
    pub(super) fn push(&self, truth: &Truth, shown: &Reading, columns: &mut Columns) {
        for (column, (_, values)) in self.0.iter().zip(columns) {
            values.push(column.rounded(truth, shown));
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

    /// Writes the row of an instant, of which sensors and clock have shown this.
    ///
    /// # Errors
    /// Where the output cannot be written to.
    pub fn row(&mut self, truth: &Truth, shown: &Reading) -> io::Result<()> {
        for (index, column) in self.layout.0.iter().enumerate() {
            if index > 0 {
                self.out.write_all(b",")?;
                column.write(truth, shown, &mut self.out)?;
                continue;
            }
            let time_s = column.rounded(truth, shown);
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

/// One row of a recording, as the sensors and the clock have it.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct Reading {
    /// Time since the trace began, s.
    pub t_s: f64,
    /// Readings of the cylinder's sensors.
    pub sample: Sample<f64>,
    /// Oil temperature, K, where there is a thermometer.
    pub temp_k: Option<f64>,
    /// Spool, command and supply, where the rig has `[valve]`.
    pub valve: Option<ValveTruth>,
}

impl Reading {
    /// The readings `sample` at an instant.
    pub fn at(truth: &Truth, sample: Sample<f64>) -> Self {
        Self { t_s: truth.t_s, sample, temp_k: truth.temp_k, valve: truth.valve }
    }

    /// What a channel shows; none where it shows nothing or is not recorded.
    pub fn get(&self, channel: Signal) -> Option<f64> {
        let Self { t_s, sample, temp_k, .. } = self;
        match channel {
            Signal::Time => Some(*t_s),
            Signal::Position => Some(sample.x_m),
            Signal::PressureA => Some(sample.pa_pa),
            Signal::PressureB => Some(sample.pb_pa),
            Signal::FlowA => sample.qa_m3s,
            Signal::FlowB => sample.qb_m3s,
            Signal::Force => sample.force_n,
            Signal::Temperature => *temp_k,
            _ => None,
        }
    }

    /// Makes a channel show something else; a channel that every row must have becomes NaN for nothing.
    pub fn set(&mut self, channel: Signal, value: Option<f64>) {
        let Self { t_s, sample, temp_k, .. } = self;
        let needed = value.unwrap_or(f64::NAN);
        match channel {
            Signal::Time => *t_s = needed,
            Signal::Position => sample.x_m = needed,
            Signal::PressureA => sample.pa_pa = needed,
            Signal::PressureB => sample.pb_pa = needed,
            Signal::FlowA => sample.qa_m3s = value,
            Signal::FlowB => sample.qb_m3s = value,
            Signal::Force => sample.force_n = value,
            Signal::Temperature => *temp_k = value,
            _ => {}
        }
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
                let column = column("", decimals, |truth, _| truth.t_s);
                let (truth, shown) = (Truth { t_s: value, ..Truth::default() }, Reading::default());
                let mut text = Vec::new();
                column.write(&truth, &shown, &mut text).unwrap();
                let rounded = column.rounded(&truth, &shown);
                assert_eq!(String::from_utf8(text).unwrap(), format!("{rounded:.decimals$}"));
            }
        }
    }
}
