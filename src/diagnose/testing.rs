//! What the unit tests of the diagnosis fit: wind-like motion of the paper's cylinder, seen by sensors of 0.1 %.

use super::data::{Declared, Series};
use crate::rig::Instruments;
use pitchleak_core::{Cylinder, Effect, EffectSet, Fluid, PerLeak, Sample};
use pitchleak_testkit::{Motion, noisy, seeded, sensors_of};
use std::cell::Cell;

/// What the cylinder leaks, m³/(s·Pa).
pub(crate) const LEAKS: PerLeak<f64> = PerLeak { internal: 1e-11, external_a: 3e-12, external_b: 2e-12 };
/// The unknown effect of [`torn_seal`], in its unit.
pub(crate) const TURBULENT: (Effect, f64) = (Effect::InternalLeakTurbulent, 6e-9);

pub(crate) fn declared() -> Declared {
    Declared {
        cylinder: Cylinder::paper(),
        fluid: Fluid::paper(),
        instruments: Instruments::paper(&Cylinder::paper()).with_accuracy(1e-3),
        sensors: sensors_of(1e-3),
        effects: EffectSet::default(),
    }
}

/// Some seconds of a sound cylinder.
pub(crate) fn sound(seconds: u32) -> Series {
    seen(seconds, |_| ())
}

/// Some seconds of one with a turbulent leak past the piston.
pub(crate) fn torn_seal(seconds: u32) -> Series {
    past_the_seal(TURBULENT.1, seconds)
}

/// Some seconds of one with so much of it, m³/(s·√Pa).
pub(crate) fn past_the_seal(size: f64, seconds: u32) -> Series {
    seen(seconds, |sample| {
        let load = sample.load_pressure_pa();
        let past = size * load.signum() * load.abs().sqrt();
        sample.qa_m3s = sample.qa_m3s.map(|q| q + past);
        sample.qb_m3s = sample.qb_m3s.map(|q| q - past);
    })
}

/// Some seconds of one with gas at port A, 10 cm³ at 5 bar, and with a flow that goes to and fro into A as nothing tells.
pub(crate) fn gas_beside(strays_m3s: f64, seconds: u32) -> Series {
    let before = Cell::new((0.0_f64, None));
    seen(seconds, |sample| {
        let pa = sample.pa_pa;
        let (t, last) = before.get();
        before.set((t + 0.01, Some(pa)));
        let taken = 5.0 / pa.powi(2) * (pa - last.unwrap_or(pa)) / 0.01;
        sample.qa_m3s = sample.qa_m3s.map(|q| q + taken + strays_m3s * (3.0 * t).sin());
    })
}

/// Some seconds of one whose samples have this ailment.
pub(crate) fn seen(seconds: u32, ailment: impl Fn(&mut Sample<f64>)) -> Series {
    let (mut series, mut random) = (Series::default(), seeded(7));
    for (k, mut sample) in (0_u32..).zip(Motion::wind_like(LEAKS).samples(seconds)) {
        ailment(&mut sample);
        series.push(0.01 * f64::from(k), &noisy(&sample, &declared().sensors, &mut random), None);
    }
    series
}
