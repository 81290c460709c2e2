use crate::semihosting::File;
use pitchleak_core::{Cylinder, Fluid, SensorSpread, Sensors};

/// What is declared of cylinder, oil and sensors.
#[derive(Clone, Copy)]
pub struct Rig {
    pub cylinder: Cylinder<f32>,
    pub fluid: Fluid<f32>,
    pub sensors: Sensors<f32>,
}

impl Rig {
    pub fn read(file: &File) -> Option<Self> {
        let [area_a_m2, area_b_m2, stroke_m, moving_mass_kg, dead_volume_a_m3, dead_volume_b_m3] =
            file.read()?;
        let [bulk_modulus_pa, bulk_modulus_std_pa] = file.read()?;
        let spread = || {
            let [noise_std, bias_std, gain_std] = file.read()?;
            Some(SensorSpread { noise_std, bias_std, gain_std, ..SensorSpread::default() })
        };
        Some(Self {
            cylinder: Cylinder {
                area_a_m2,
                area_b_m2,
                stroke_m,
                moving_mass_kg,
                dead_volume_a_m3,
                dead_volume_b_m3,
            },
            fluid: Fluid { bulk_modulus_pa, bulk_modulus_std_pa },
            sensors: Sensors {
                flow_a: spread()?,
                flow_b: spread()?,
                pressure: spread()?,
                position: spread()?,
                force: spread()?,
            },
        })
    }
}
