//! What is declared of a rig and its sensors.

use super::series::Series;
use crate::Rig;
use crate::diagnose::thresholds::{LEAST_STEP_S, RESOLUTION};
use crate::rig::Instruments;
use pitchleak_core::{Cylinder, EffectSet, Fluid, SensorSpread, Sensors};

/// What the rig file says, as the diagnosis uses it.
#[derive(Clone, Copy, Debug)]
pub struct Declared {
    /// Geometry and mass.
    pub cylinder: Cylinder<f64>,
    /// Oil.
    pub fluid: Fluid<f64>,
    /// Data sheets of the sensors.
    pub instruments: Instruments,
    /// Noise, offsets and gains of the sensors.
    pub sensors: Sensors<f64>,
    /// Effects that are known already.
    pub effects: EffectSet<f64>,
}

impl Declared {
    /// From a rig file.
    pub fn of(rig: &Rig) -> Self {
        let mut sensors = rig.sensors();
        let sheets = &rig.instruments;
        for (spread, sheet) in [
            (&mut sensors.flow_a, &sheets.flow_a),
            (&mut sensors.flow_b, &sheets.flow_b),
            (&mut sensors.pressure, &sheets.pressure),
            (&mut sensors.position, &sheets.position),
            (&mut sensors.force, &sheets.force),
        ] {
            spread.noise_std = spread.noise_std.max(RESOLUTION * sheet.full_scale);
        }
        let (cylinder, fluid, instruments, effects) =
            (rig.cylinder, rig.fluid, rig.instruments, rig.effect_set());
        Self { cylinder, fluid, instruments, sensors, effects }
    }

    /// The rig file's part in it.
    pub(super) fn rig(&self) -> Rig {
        let Self { cylinder, fluid, instruments, .. } = *self;
        Rig { cylinder, fluid, instruments, ..Rig::paper() }
    }

    /// With the noise of means over `count` samples.
    fn averaged(mut self, count: usize) -> Self {
        let root = (count as f64).sqrt();
        let Sensors { flow_a, flow_b, pressure, position, force } = &mut self.sensors;
        for spread in [flow_a, flow_b, pressure, position, force] {
            *spread = SensorSpread { noise_std: spread.noise_std / root, ..*spread };
        }
        let Instruments { flow_a, flow_b, pressure, position, force, .. } = &mut self.instruments;
        for sheet in [flow_a, flow_b, pressure, position, force] {
            sheet.accuracy /= root;
        }
        self
    }
}

/// Traces at the speed of the machine, and what is declared of their means.
pub(crate) fn thinned(traces: &[Series], declared: &Declared) -> (Vec<Series>, Declared) {
    let thin: Vec<_> = traces.iter().map(|series| series.thinned(series.samples_per(LEAST_STEP_S))).collect();
    let merged = thin.iter().filter(|series| !series.is_empty()).map(|series| series.merged);
    let count = 1 + merged.min().unwrap_or(0);
    (thin, declared.averaged(count))
}
