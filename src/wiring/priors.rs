//! What a fit may find: its parameters, and how far each may be off.

use crate::rig::Rig;
use nalgebra::SVector;
use pitchleak_core::Leak;

/// The estimator's nine in their order (1/β less its prior mean; the three leaks; the meters' offsets; the gains of meters
/// and position sensor); the leaks' coefficients by an orifice's law, C √P.
pub(super) const PARAMETERS: usize = 12;
pub(super) type Vector = SVector<f64, PARAMETERS>;

/// Prior standard deviations of the parameters, SI.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Priors(pub(super) Vector);

/// A sensor that nobody declared wrong may be off by so much, 1 σ: of full scale, of the reading.
const UNDECLARED_SHARE: f64 = 0.05;
/// A pressure's zero that nobody declared wrong may be off by this share of full scale, 1 σ.
pub(super) const UNDECLARED_ZERO_SHARE: f64 = 0.01;
/// Where these parameters stand: of leaks in their order, of meters A and B.
pub(super) const LEAKS: usize = 1;
pub(super) const OFFSETS: usize = 4;
pub(super) const ORIFICES: usize = 9;
/// A leak of the meter's whole range at this share of the pressure sensor's is the widest looked for, 1 σ.
const LEAK_AT_SHARE: f64 = 0.1;

impl Priors {
    /// What the rig file declares.
    pub fn declared(rig: &Rig) -> Self {
        let (fluid, sensors) = (&rig.fluid, rig.sensors());
        let flow = rig.instruments.flow_a.full_scale.max(rig.instruments.flow_b.full_scale);
        let leak = flow / (LEAK_AT_SHARE * rig.instruments.pressure.full_scale);
        let compressibility = fluid.bulk_modulus_std_pa / (fluid.bulk_modulus_pa * fluid.bulk_modulus_pa);
        Self(Vector::from([
            compressibility,
            leak,
            leak,
            leak,
            sensors.flow_a.bias_std,
            sensors.flow_b.bias_std,
            sensors.flow_a.gain_std,
            sensors.flow_b.gain_std,
            sensors.position.gain_std,
            0.0,
            0.0,
            0.0,
        ]))
    }

    /// This rig with leaks part of which may pass an orifice: Q = C √|P|, of P's sign (Merritt 1967, section 3.3).
    pub fn with_orifices(mut self, leaks: impl IntoIterator<Item = Leak>, rig: &Rig) -> Self {
        let full_scale_pa = rig.instruments.pressure.full_scale;
        for leak in leaks {
            self.0[ORIFICES + leak as usize] = self.0[LEAKS + leak as usize] * full_scale_pa.sqrt();
        }
        self
    }

    /// This rig with sensors that may be off as undeclared ones are now and then.
    pub fn with_sensor_errors(rig: &Rig) -> Self {
        let Self(mut spread) = Self::declared(rig);
        let sheets = &rig.instruments;
        let usual = [
            UNDECLARED_SHARE * sheets.flow_a.full_scale,
            UNDECLARED_SHARE * sheets.flow_b.full_scale,
            UNDECLARED_SHARE,
            UNDECLARED_SHARE,
            UNDECLARED_SHARE,
        ];
        for (spread, usual) in spread.iter_mut().skip(OFFSETS).zip(usual) {
            *spread = spread.max(usual);
        }
        Self(spread)
    }
}
