//! Mistakes of wiring, sign, unit and geometry: the part of the table that no small error is.

use super::readings::{Mistake, Of};
use super::scales;
use super::table::{AREA, Entry, Kind};
use crate::units::{Dimension, Unit};

/// Prior share of each exchange of wires or turned sign: once in a thousand recordings. A guess.
const EXCHANGED: f64 = 0.001;
/// Prior share of all other mistakes of wiring, unit and geometry together. A guess.
const OTHERS: f64 = 0.005;

/// An entry's id, what it is, and how it is told.
type Row = (&'static str, Mistake, &'static str);

const EXCHANGES: [Row; 9] = [
    ("exchanged_flows", Mistake::FlowsExchanged, "qa and qb are exchanged"),
    ("exchanged_pressures", Mistake::PressuresExchanged, "pa and pb are exchanged"),
    ("exchanged_chambers", Mistake::ChambersExchanged, "the chambers A and B are exchanged"),
    ("sign_qa", Mistake::Sign(Of::FlowA), "qa counts the other way"),
    ("sign_qb", Mistake::Sign(Of::FlowB), "qb counts the other way"),
    ("sign_flows", Mistake::Sign(Of::Flows), "qa and qb count the other way"),
    ("lost_sign_qa", Mistake::LostSign(Of::FlowA), "qa lost its sign"),
    ("lost_sign_qb", Mistake::LostSign(Of::FlowB), "qb lost its sign"),
    ("lost_sign_flows", Mistake::LostSign(Of::Flows), "qa and qb lost their signs"),
];

const ODD: [Row; 6] = [
    (
        "exchanged_turned_flows",
        Mistake::FlowsExchangedAndTurned,
        "qa and qb are exchanged, and count the other way",
    ),
    ("other_end", Mistake::OtherEnd, "x counts from the B end"),
    ("absolute_pressures", Mistake::Absolute(Of::Pressures), "the pressures are absolute"),
    ("absolute_pa", Mistake::Absolute(Of::PressureA), "pa is absolute"),
    ("absolute_pb", Mistake::Absolute(Of::PressureB), "pb is absolute"),
    ("areas_exchanged", Mistake::AreasExchanged, "the areas A and B are exchanged"),
];

/// A unit's entry: its id, the readings, how it is told, and the units that people log them in.
type InUnit = (&'static str, Of, &'static str, Dimension, &'static [&'static str]);

const FLOW_UNITS: &[&str] = &["L/min", "L/s", "m^3/h", "gal/min"];
const PRESSURE_UNITS: &[&str] = &["bar", "psi", "MPa", "kPa"];
const LENGTH_UNITS: &[&str] = &["mm", "cm", "in"];

const UNITS: [InUnit; 7] = [
    ("unit_flows", Of::Flows, "qa and qb are in another unit", Dimension::Flow, FLOW_UNITS),
    ("unit_qa", Of::FlowA, "qa is in another unit", Dimension::Flow, FLOW_UNITS),
    ("unit_qb", Of::FlowB, "qb is in another unit", Dimension::Flow, FLOW_UNITS),
    ("unit_pressures", Of::Pressures, "pa and pb are in another unit", Dimension::Pressure, PRESSURE_UNITS),
    ("unit_pa", Of::PressureA, "pa is in another unit", Dimension::Pressure, PRESSURE_UNITS),
    ("unit_pb", Of::PressureB, "pb is in another unit", Dimension::Pressure, PRESSURE_UNITS),
    ("unit_x", Of::Position, "x is in another unit", Dimension::Length, LENGTH_UNITS),
];

/// Milliseconds for seconds, and the other way.
const CLOCKS: [f64; 2] = [1e3, 1e-3];
/// A slipped decimal point, and a diameter for a radius.
const SLIPS: [f64; 4] = [10.0, 0.1, 4.0, 0.25];

/// All of them; exchanges are commoner than the others, which are of equal shares.
pub(super) fn mistakes() -> Vec<Entry> {
    let units = UNITS.iter().flat_map(|(id, of, text, dimension, units)| {
        factors(*dimension, units).into_iter().map(|factor| (*id, Mistake::Factor(*of, factor), *text))
    });
    let clocks = CLOCKS.iter().map(|by| ("unit_t", Mistake::Clock(*by), "t is in another unit"));
    let areas = SLIPS.iter().flat_map(|by| {
        [
            ("unit_area_a", Mistake::Area(0, *by), "area A is in another unit"),
            ("unit_area_b", Mistake::Area(1, *by), "area B is in another unit"),
        ]
    });
    let others: Vec<Row> = ODD.into_iter().chain(units).chain(clocks).chain(areas).collect();
    let share = OTHERS / others.len() as f64;
    let exchanges = EXCHANGES.into_iter().map(|row| (row, EXCHANGED));
    let exact = exchanges.chain(others.into_iter().map(|row| (row, share))).map(entry);
    exact.chain(scales::entries(share)).collect()
}

fn entry(((id, mistake, text), share): (Row, f64)) -> Entry {
    let remedy = if mistake.is_of_rig() { AREA } else { "Look at the wiring and the columns' names." };
    Entry { mistake: Some(mistake), ..Entry::new(id, Kind::Wiring, share, text) }.remedy(remedy, None)
}

/// Factors between any two of these units, and a slipped decimal point.
fn factors(dimension: Dimension, units: &[&str]) -> Vec<f64> {
    let known: Vec<&Unit> = dimension.units().iter().filter(|unit| units.contains(&unit.text)).collect();
    let pairs = known.iter().flat_map(|one| known.iter().map(move |other| one.over(other)));
    let mut factors: Vec<f64> = pairs.chain([10.0, 0.1]).collect();
    factors.sort_by(f64::total_cmp);
    factors.dedup_by(|a, b| (*a / *b - 1.0).abs() < 1e-6);
    factors.retain(|factor| (factor - 1.0).abs() > 1e-6);
    factors
}

/// ln prior probability of as declared wiring.
pub(super) fn ln_wired(mistakes: &[Entry]) -> f64 {
    (1.0 - mistakes.iter().map(|mistake| mistake.share).sum::<f64>()).ln()
}
