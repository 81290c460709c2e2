//! The mistakes that are looked for.

use super::mistake::{Exchange, Mistake};
use super::readings::Readings;
use crate::units::{Dimension, Unit};

/// Factors between any two units that people log a quantity in, and a slipped decimal point.
fn factors(dimension: Dimension, units: &[&str]) -> Vec<f64> {
    let known: Vec<&Unit> = dimension.units().iter().filter(|unit| units.contains(&unit.text)).collect();
    let pairs = known.iter().flat_map(|one| known.iter().map(move |other| one.over(other)));
    let mut factors: Vec<f64> = pairs.chain([10.0, 0.1]).collect();
    factors.sort_by(f64::total_cmp);
    factors.dedup_by(|a, b| (*a / *b - 1.0).abs() < 1e-6);
    factors.retain(|factor| (factor - 1.0).abs() > 1e-6);
    factors
}

/// Delays looked for, s.
fn delays() -> impl Iterator<Item = f64> {
    (4..=22).map(|hundredths| f64::from(hundredths) * 0.01)
}

/// Flows in another unit, one or both; powers of ten are no evidence, since data sheets are off by such.
pub(super) fn flow_units() -> Vec<Mistake> {
    let units = factors(Dimension::Flow, &["L/min", "m^3/h", "gal/min"]);
    let units = units.into_iter().filter(|factor| (factor.log10() - factor.log10().round()).abs() > 1e-6);
    let each =
        |factor| [Readings::Flows, Readings::FlowA, Readings::FlowB].map(|r| Mistake::Scaled(r, factor));
    units.flat_map(each).collect()
}

/// All of them.
pub(super) fn candidates() -> Vec<Mistake> {
    use Readings::{FlowA, FlowB, Flows, Position, PressureA, PressureB, Pressures, Time};
    let mut all = vec![
        Mistake::Exchanged(Exchange::Pressures),
        Mistake::Exchanged(Exchange::Flows),
        Mistake::Exchanged(Exchange::Chambers),
        Mistake::OtherEnd,
    ];
    all.extend([FlowA, FlowB, Flows].map(Mistake::Sign));
    all.extend([FlowA, FlowB, Flows].map(Mistake::Size));
    all.extend([PressureA, PressureB, Pressures].map(Mistake::Absolute));
    let mut scaled = |readings: &[Readings], factors: Vec<f64>| {
        all.extend(readings.iter().flat_map(|r| factors.iter().map(|factor| Mistake::Scaled(*r, *factor))));
    };
    scaled(&[FlowA, FlowB, Flows], factors(Dimension::Flow, &["m^3/s", "L/s", "L/min", "m^3/h", "gal/min"]));
    scaled(
        &[PressureA, PressureB, Pressures],
        factors(Dimension::Pressure, &["Pa", "kPa", "MPa", "bar", "psi"]),
    );
    scaled(&[Position], factors(Dimension::Length, &["m", "cm", "mm", "in"]));
    scaled(&[Time], vec![1e3, 1e-3]);
    for readings in [FlowA, FlowB, Flows, Position, PressureA, PressureB, Pressures] {
        all.extend(delays().map(|by_s| Mistake::Late(readings, by_s)));
    }
    all
}
