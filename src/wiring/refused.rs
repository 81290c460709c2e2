//! Rows that the reader refuses because no sensor of the rig reads so much: which unit, or slipped decimal point, would bring
//! them within its range. Evidence for people; nothing is read otherwise because of it.

use super::Wiring;
use crate::explain::{Mistake, Of, scatter::OverSheet};
use crate::rig::{ColumnMap, Rig};
use crate::signal::Signal;
use crate::told::{CHANNELS, ForceSums, Gatherer, Scaled};
use crate::trace::{OVERRANGE, Record};
use crate::units::{Dimension, readable};
use pitchleak_core::continuity::Scatter;
use serde::{Deserialize, Serialize};

/// Fewer rows say nothing.
const LEAST_ROWS: u64 = 100;
/// Share of the readings that must be possible on the rig.
const POSSIBLE_SHARE: f64 = 0.99;
/// Twice the log-likelihood that parts two units that can be told apart, and how many that can't be may be named.
const APART: f64 = 25.0;
/// The same of ln odds by the scatter alone: twenty to one.
const LN_APART: f64 = 3.0;
const MOST_ALIKE: usize = 4;
/// Mended readings reach this share of full scale at the least and at the most.
const SHARE_OF_FULL_SCALE: std::ops::RangeInclusive<f64> = 0.005..=1.3;
/// What is beyond so many times full scale is no sensor's reading in any unit.
const ABSURD: f64 = 1e7;
/// A longer step is a pause, s.
const LONGEST_STEP_S: f64 = 1.0;
/// So long without a refused row they are forgotten, s.
const FORGOTTEN_S: f64 = 60.0;
/// A slipped decimal point.
const TENFOLD: f64 = 10.0;

/// Rows as they were read, refused or not, since the first refused one; in constant memory.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Refused {
    /// Its columns are those that were read.
    rig: Rig,
    channels: [Channel; CHANNELS.len()],
    rows: u64,
    refused: u64,
    last_s: Option<f64>,
    last_refused_s: f64,
    gatherer: Gatherer,
    force: ForceSums,
    scatter: [Scatter<f64>; CHANNELS.len()],
}

/// One channel's readings.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct Channel {
    full_scale: f64,
    readings: u64,
    beyond: u64,
    extremes: Option<[f64; 2]>,
    /// How many times too large readings in another unit would be, and how many readings are possible then.
    factors: Vec<(f64, u64)>,
}

/// A unit that may be another one than the column says.
struct Suspect {
    mistake: Mistake,
    of: Of,
    factor: f64,
    force: Option<Scaled>,
}

impl Refused {
    /// None yet, of a trace whose columns were read by `columns`.
    pub fn new(rig: &Rig, columns: &ColumnMap) -> Self {
        let rig = Rig { columns: columns.clone(), ..rig.clone() };
        Self {
            channels: CHANNELS.map(|signal| Channel::new(signal, &rig)),
            rig,
            rows: 0,
            refused: 0,
            last_s: None,
            last_refused_s: 0.0,
            gatherer: Gatherer::default(),
            force: ForceSums::default(),
            scatter: Default::default(),
        }
    }

    /// Takes in a refused row.
    pub fn add_refused(&mut self, record: &Record) {
        (self.refused, self.last_refused_s) = (self.refused + 1, record.t_s);
        self.add(record);
    }

    /// Takes in a row.
    pub fn add(&mut self, record: &Record) {
        if !record.has_both_pressures() {
            return;
        }
        self.rows += 1;
        let readings = record.sample.readings();
        if self.channels.iter().zip(readings).any(|(channel, reading)| channel.is_absurd(reading)) {
            return;
        }
        for (channel, reading) in self.channels.iter_mut().zip(readings) {
            reading.into_iter().for_each(|reading| channel.add(reading));
        }
        let dt_s = self.last_s.replace(record.t_s).map_or(0.0, |last_s| record.t_s - last_s);
        let after_gap = !(0.0..=LONGEST_STEP_S).contains(&dt_s);
        for (scatter, reading) in self.scatter.iter_mut().zip(readings) {
            scatter.add(reading, after_gap);
        }
        let block = self.gatherer.add(&Record { dt_s, after_gap, ..*record });
        block.into_iter().for_each(|block| self.force.add(&block));
    }

    /// Whether the last one is long ago.
    pub fn is_over(&self, t_s: f64) -> bool {
        (t_s - self.last_refused_s).abs() > FORGOTTEN_S
    }

    /// Time of the last row, s.
    pub fn last_s(&self) -> Option<f64> {
        self.last_s
    }

    /// Rows refused, and all of them since the first.
    pub fn counts(&self) -> [u64; 2] {
        [self.refused, self.rows]
    }

    /// The unit, or the slipped decimal point, that brings within range what most rows were refused for, beside others that
    /// the rows do not tell from it; `None` where none does, or too many.
    pub fn wiring(&self) -> Option<Wiring> {
        if self.rows < LEAST_ROWS || 2 * self.refused <= self.rows {
            return None;
        }
        let mut found: Vec<Suspect> =
            self.candidates().into_iter().map(|(of, factor)| self.suspect(of, factor)).collect();
        self.keep_balanced(&mut found);
        self.keep_as_loud(&mut found);
        let columns = &self.rig.columns;
        let mut names: Vec<String> =
            found.iter().map(|one| one.mistake.text() + &one.mistake.unit_text(columns)).collect();
        let first = found.first().filter(|_| found.len() <= MOST_ALIKE)?;
        let mut suggestion = self.within_range(first, names.first()?)?;
        if names.len() > 1 {
            suggestion += &format!("; cannot be told apart: {}", names.join(", "));
        }
        Some(Wiring {
            suggestion,
            residual_before: None,
            residual_after: None,
            columns: first.mistake.mending(columns, &self.rig),
            cylinder: Vec::new(),
            sensors: first.mistake.sensors().to_vec(),
            alternatives: names.split_off(1),
        })
    }

    fn suspect(&self, of: Of, factor: f64) -> Suspect {
        Suspect { mistake: Mistake::Factor(of, factor), of, factor, force: self.force_with(of, factor) }
    }

    /// The evidence in words; `name` is what mends it.
    fn within_range(&self, one: &Suspect, name: &str) -> Option<String> {
        let unit = one.of.sensors().first()?.dimension().and_then(Dimension::for_people);
        let extremes = self.extremes(one.of, one.factor)?;
        let [least, most] = extremes.map(|value| unit.map_or(value, |unit| unit.from_si(value)));
        let balanced = one.force.as_ref().filter(|force| force.balances()).map(Scaled::left_n);
        let forces = balanced.map_or_else(String::new, |[before, after]| {
            format!(", and balance the load force to {after:.0} N of {before:.0} N")
        });
        Some(format!(
            "with {name} they are {} to {} {}, which the rig allows{forces}; as they stand {} of {} rows are out of range",
            readable(least, 3),
            readable(most, 3),
            unit.map_or("", |unit| unit.text),
            self.refused,
            self.rows
        ))
    }

    /// Factors on the readings that are out of range and, if need be, on their twin, that bring all within range.
    fn candidates(&self) -> Vec<(Of, f64)> {
        use Of::{FlowA, FlowB, Flows, Position, PressureA, PressureB, Pressures};
        let beyond = |at: &usize| 2 * self.channels[*at].beyond > self.channels[*at].readings;
        let groups: &[Of] = match (0..CHANNELS.len()).filter(beyond).collect::<Vec<_>>()[..] {
            [0] => &[Position],
            [1] => &[PressureA, Pressures],
            [2] => &[PressureB, Pressures],
            [1, 2] => &[Pressures],
            [3] => &[FlowA, Flows],
            [4] => &[FlowB, Flows],
            [3, 4] => &[Flows],
            _ => &[],
        };
        let mut found = Vec::new();
        for of in groups {
            let scaled = |at: usize| of.sensors().contains(&CHANNELS[at]);
            let Some(first) = (0..CHANNELS.len()).find(|at| scaled(*at)) else { continue };
            for (factor, _) in &self.channels[first].factors {
                let is_possible = |(at, channel): (usize, &Channel)| {
                    channel.is_possible(if scaled(at) { *factor } else { 1.0 })
                };
                if self.channels.iter().enumerate().all(is_possible) {
                    found.push((*of, *factor));
                }
            }
        }
        found
    }

    fn force_with(&self, of: Of, factor: f64) -> Option<Scaled> {
        let by = |signal| if of.sensors().contains(&signal) { factor } else { 1.0 };
        let factors = [Signal::PressureA, Signal::PressureB].map(by);
        let balance = self.force.balance(&self.rig).filter(|_| factors.iter().any(|factor| *factor > 1.0))?;
        Some(balance.scaled(factors))
    }

    /// Where the load force balances the pressures with some factors, the others go.
    fn keep_balanced(&self, found: &mut Vec<Suspect>) {
        let left = |one: &Suspect| one.force.as_ref().filter(|force| force.balances()).map(Scaled::deviance);
        let Some(best) = found.iter().filter_map(left).min_by(f64::total_cmp) else { return };
        found.retain(|one| left(one).is_some_and(|deviance| deviance <= best + APART));
        found.sort_by(|a, b| left(a).partial_cmp(&left(b)).unwrap_or(std::cmp::Ordering::Equal));
    }

    /// Where one unit makes the scatter far likelier than others, those go.
    fn keep_as_loud(&self, found: &mut Vec<Suspect>) {
        let over_sheet = OverSheet::of(self.scatter.map(|scatter| scatter.std()), &self.rig);
        let ln = |one: &Suspect| over_sheet.ln_odds(one.mistake);
        let best = found.iter().map(ln).fold(f64::MIN, f64::max);
        found.retain(|one| ln(one) > best - LN_APART);
    }

    /// Least and largest reading once they are divided by `factor`, SI.
    fn extremes(&self, of: Of, factor: f64) -> Option<[f64; 2]> {
        let own = CHANNELS.iter().zip(&self.channels);
        own.filter(|(signal, _)| of.sensors().contains(signal))
            .filter_map(|(_, channel)| channel.extremes)
            .reduce(|[a, b], [c, d]| [a.min(c), b.max(d)])
            .map(|extremes| extremes.map(|value| value / factor))
    }
}

impl Channel {
    fn new(signal: Signal, rig: &Rig) -> Self {
        let sheets = &rig.instruments;
        let full_scale = match signal {
            Signal::Position => rig.cylinder.stroke_m.max(sheets.position.full_scale),
            Signal::PressureA | Signal::PressureB => sheets.pressure.full_scale,
            Signal::FlowA => sheets.flow_a.full_scale,
            _ => sheets.flow_b.full_scale,
        };
        let factors = factors(signal, rig).into_iter().map(|factor| (factor, 0)).collect();
        Self { full_scale, readings: 0, beyond: 0, extremes: None, factors }
    }

    fn is_absurd(&self, reading: Option<f64>) -> bool {
        reading.is_some_and(|reading| reading.abs() > ABSURD * self.full_scale)
    }

    fn add(&mut self, reading: f64) {
        let [least, most] = self.extremes.unwrap_or([reading; 2]);
        self.extremes = Some([least.min(reading), most.max(reading)]);
        self.readings += 1;
        let share = reading.abs() / self.full_scale;
        self.beyond += u64::from(share > OVERRANGE);
        for (factor, possible) in &mut self.factors {
            *possible += u64::from(share / *factor <= *SHARE_OF_FULL_SCALE.end());
        }
    }

    /// Whether nearly all readings are possible once they are divided by `factor`, and more than nothing.
    fn is_possible(&self, factor: f64) -> bool {
        let (readings, beyond) = (self.readings as f64, self.beyond as f64);
        let Some((_, possible)) = self.factors.iter().find(|(one, _)| one.to_bits() == factor.to_bits())
        else {
            return beyond <= (1.0 - POSSIBLE_SHARE) * readings;
        };
        let [least, most] = self.extremes.unwrap_or_default();
        let largest = most.max(-least);
        // What never changes is dead.
        most > least
            && *possible as f64 >= POSSIBLE_SHARE * readings
            && largest / factor >= SHARE_OF_FULL_SCALE.start() * self.full_scale
    }
}

/// How many times too large readings are that come in a smaller unit than the column says, or with a slipped decimal point.
fn factors(signal: Signal, rig: &Rig) -> Vec<f64> {
    let Some(dimension) = signal.dimension() else { return Vec::new() };
    let usual: &[&str] = match dimension {
        Dimension::Pressure => &["Pa", "mbar", "kPa", "psi", "bar", "MPa"],
        Dimension::Length => &["mm", "cm", "in", "m"],
        _ => &["m^3/s", "L/s", "L/min", "cm^3/s", "mL/min", "m^3/h", "gal/min"],
    };
    let declared = rig.columns.get(&signal).and_then(|column| column.unit);
    let Some(declared) = declared.or_else(|| dimension.units().first().copied()) else { return Vec::new() };
    let units = dimension.units().iter().filter(|unit| usual.contains(&unit.text));
    let mut factors: Vec<f64> = units.map(|unit| declared.over(unit)).chain([TENFOLD]).collect();
    factors.retain(|factor| *factor > 1.0 + 1e-6);
    factors.sort_by(f64::total_cmp);
    factors.dedup_by(|a, b| (*a / *b - 1.0).abs() < 1e-6);
    factors
}
