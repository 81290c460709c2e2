//! A diagnosis as a rig file.

use crate::Rig;
use crate::diagnose::outcome::Diagnosis;
use crate::rig::EffectValue;
use pitchleak_core::effects::EffectConstants;
use pitchleak_core::{Effect, Fluid};

impl Diagnosis {
    /// The rig file with the effects in it, so that replay and simulation use them. The bulk modulus is that of
    /// the fit too: volumes and hoses are measured only as V/β.
    pub fn rig(&self, rig: &Rig) -> Rig {
        let mut with = rig.clone();
        if !self.effects.is_empty() {
            let bulk = &self.after.leaks.bulk_modulus;
            let relative = rig.fluid.bulk_modulus_std_pa / rig.fluid.bulk_modulus_pa;
            let std = bulk.std.min(relative * bulk.value);
            with.fluid = Fluid { bulk_modulus_pa: bulk.value, bulk_modulus_std_pa: std };
        }
        let sizes = self.calibration.iter().map(|c| (c.id, c.value, c.std, None));
        let sizes = sizes.chain(self.effects.iter().map(|e| (e.id, e.value, e.std, Some(&e.constants))));
        for (id, value, std, found) in sizes {
            let Ok(effect) = id.parse::<Effect>() else { continue };
            let mut constants = EffectConstants::default();
            for own in effect.constants() {
                let value = found.and_then(|found| found.get(own.spec().id));
                constants = value.map_or(constants, |value| constants.with(*own, *value));
            }
            with.effects.insert(effect, EffectValue { value, std: Some(std), constants });
        }
        with
    }
}
