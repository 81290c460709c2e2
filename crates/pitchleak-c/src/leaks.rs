//! The default estimator, by flow meters, and its alarms.

use crate::reading::{PitchleakFound, PitchleakSample};
use crate::result::PitchleakResult;
use crate::rig::PitchleakRig;
use crate::running::Kept;
use pitchleak_core::{LeakDetector, Rls, Update};

/// Of N parameters.
#[derive(Clone, Copy, serde::Serialize, serde::Deserialize)]
pub(crate) struct Leaks<const N: usize> {
    rls: Rls<f32, N>,
    detector: LeakDetector<f32>,
}

impl<const N: usize> Kept for Leaks<N> {
    const KIND: u8 = N as u8;
    type Rig = PitchleakRig;
    type Sample = PitchleakSample;
    type Found = PitchleakFound;

    fn begin(rig: &PitchleakRig) -> Result<Self, PitchleakResult> {
        Ok(Self { rls: rig.estimator()?, detector: rig.detector()? })
    }

    fn update(&mut self, dt_s: f32, sample: PitchleakSample) -> PitchleakResult {
        // A flow may have a clock of its own.
        match self.rls.update_waiting(dt_s, &sample.into()) {
            Update::Started => PitchleakResult::Started,
            Update::Rejected => PitchleakResult::Rejected,
            Update::Renewed { elapsed_s, changed, .. } => {
                self.detector.update(elapsed_s, &self.rls.mean_leaks_m3s());
                if changed { PitchleakResult::Changed } else { PitchleakResult::Renewed }
            }
            Update::Accepted | Update::Balanced { .. } => PitchleakResult::Ok,
        }
    }

    fn find(&self) -> PitchleakFound {
        PitchleakFound::new(&self.rls.estimates(), self.detector.active())
    }
}
