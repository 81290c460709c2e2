use crate::measure::{Estimator, Told};
use crate::rig::Rig;
use crate::semihosting::File;
use pitchleak_core::{AlarmSettings, LeakDetector, Rls, RlsSettings, Sample, Update};

/// The default estimator and its alarms, for channels that are all read at once.
pub type Default<const N: usize> = Leaks<N, false>;
/// The same for channels that each have a clock of their own.
pub type OnClocks<const N: usize> = Leaks<N, true>;

pub struct Leaks<const N: usize, const CLOCKS: bool> {
    rls: Rls<f32, N>,
    detector: LeakDetector<f32>,
}

impl<const N: usize, const CLOCKS: bool> Estimator for Leaks<N, CLOCKS> {
    fn new(rig: &Rig, _: &File) -> Option<Self> {
        let rls = Rls::new(rig.cylinder, rig.fluid, &rig.sensors, RlsSettings::default()).ok()?;
        Some(Self { rls, detector: LeakDetector::new(AlarmSettings::default()) })
    }

    fn update(&mut self, dt_s: f32, sample: &Sample<f32>) -> Option<f32> {
        let update =
            if CLOCKS { self.rls.update_waiting(dt_s, sample) } else { self.rls.update(dt_s, sample) };
        match update {
            Update::Renewed { elapsed_s, .. } => Some(elapsed_s),
            _ => None,
        }
    }

    fn watch(&mut self, elapsed_s: f32) {
        self.detector.update(elapsed_s, &self.rls.mean_leaks_m3s());
    }

    fn told(&self) -> Told {
        let found = self.rls.estimates();
        let (kappa, leaks) = (found.compressibility_per_pa, found.leaks_m3spa);
        let (c, a, b) = (leaks.internal, leaks.external_a, leaks.external_b);
        [kappa.value, kappa.std, c.value, c.std, a.value, a.std, b.value, b.std]
    }
}
