use crate::measure::{Estimator, Told};
use crate::rig::Rig;
use crate::semihosting::File;
use pitchleak_core::{PaperEstimator, PaperGains, Sample, Update};

/// The paper's law with its filters, set up as the host does (λ, γ, cut-off); it knows no spread.
pub struct Paper(PaperEstimator<f32>);

impl Estimator for Paper {
    fn new(rig: &Rig, _: &File) -> Option<Self> {
        let gains = PaperGains::scaled(&rig.cylinder, &rig.fluid, 10.0, 3e-5);
        PaperEstimator::new(rig.cylinder, rig.fluid, gains, 5.0, 100.0).ok().map(Self)
    }

    fn update(&mut self, dt_s: f32, sample: &Sample<f32>) -> Option<f32> {
        match self.0.update(dt_s, sample) {
            Update::Renewed { elapsed_s, .. } => Some(elapsed_s),
            _ => None,
        }
    }

    fn watch(&mut self, _elapsed_s: f32) {}

    fn told(&self) -> Told {
        let leaks = self.0.leak_coefficients();
        [
            1.0 / self.0.bulk_modulus_pa(),
            0.0,
            leaks.internal,
            0.0,
            leaks.external_a,
            0.0,
            leaks.external_b,
            0.0,
        ]
    }
}
