use crate::measure::{Estimator, Told};
use crate::rig::Rig;
use crate::semihosting::File;
use pitchleak_core::{
    AlarmSettings, LeakDetector, Sample, VALVE_COVARIANCES, VALVE_UNKNOWNS, ValveCalibration, ValveFilter,
    ValveNoise, ValveSample, ValveUpdate,
};

/// The flows of a calibrated valve, and alarms. In the file spool and supply pressure stand where meters would.
pub struct Valve {
    filter: ValveFilter<f32>,
    detector: LeakDetector<f32>,
}

impl Estimator for Valve {
    fn new(rig: &Rig, file: &File) -> Option<Self> {
        let mean = file.read::<VALVE_UNKNOWNS>()?;
        let covariance = file.read::<VALVE_COVARIANCES>()?;
        let [rated_flow_m3s, rated_drop_pa, tank_pa, hysteresis] = file.read()?;
        let [null_leak, gain_drift, lap_drift, null_leak_drift] = file.read()?;
        let [position_m, pressure_pa, spool, supply_pa] = file.read()?;
        let calibration = ValveCalibration {
            mean,
            covariance,
            rated_flow_m3s,
            rated_drop_pa,
            tank_pa,
            hysteresis,
            null_leak,
            gain_drift,
            lap_drift,
            null_leak_drift,
        };
        let noise = ValveNoise { position_m, pressure_pa, spool, supply_pa };
        let filter = ValveFilter::new(&rig.cylinder, &rig.fluid, &calibration, &noise, 0.5).ok()?;
        Some(Self { filter, detector: LeakDetector::new(AlarmSettings::default()) })
    }

    fn update(&mut self, dt_s: f32, sample: &Sample<f32>) -> Option<f32> {
        let Sample { x_m, pa_pa, pb_pa, qa_m3s: Some(spool), qb_m3s: Some(ps_pa), .. } = *sample else {
            return None;
        };
        match self.filter.update(dt_s, &ValveSample { x_m, pa_pa, pb_pa, spool, ps_pa }) {
            ValveUpdate::Renewed { elapsed_s, .. } => Some(elapsed_s),
            _ => None,
        }
    }

    fn watch(&mut self, elapsed_s: f32) {
        let found = self.filter.estimates();
        if found.is_explained {
            self.detector.update(elapsed_s, &found.mean_leaks_m3s);
        }
    }

    fn told(&self) -> Told {
        let found = self.filter.estimates();
        let (kappa, leaks) = (found.compressibility_per_pa, found.leaks_m3spa);
        let (c, a, b) = (leaks.internal, leaks.external_a, leaks.external_b);
        [kappa.value, kappa.std, c.value, c.std, a.value, a.std, b.value, b.std]
    }
}
