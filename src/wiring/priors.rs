//! What a fit may find: its parameters, and how far each may be off.

use crate::rig::Rig;
use nalgebra::SVector;
use pitchleak_core::{Leak, Parameter};

/// The estimator's nine in their order (1/β less its prior mean; the three leaks; the meters' offsets; the gains of meters
/// and position sensor); the drifts of the meters' zeros; the slopes of the three leaks; their coefficients by an orifice's law, C √P.
pub(super) const PARAMETERS: usize = 17;
pub(super) type Vector = SVector<f64, PARAMETERS>;

/// Prior standard deviations of the parameters, SI.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Priors(pub(super) Vector);

/// A sensor that nobody declared wrong may be off by so much, 1 σ: of full scale, of the reading.
const UNDECLARED_SHARE: f64 = 0.05;
/// A meter's zero that nobody declared wrong may be off by this share of full scale, 1 σ, and drift as far through a trace.
pub(super) const UNDECLARED_ZERO_SHARE: f64 = 0.01;
/// A gain that is off by far, 1 σ, and a zero, share of full scale.
const WILD_GAIN: f64 = 0.2;
const WILD_ZERO_SHARE: f64 = 0.1;
/// Where these parameters stand: of leaks in their order, of meters A and B.
pub(super) const LEAKS: usize = 1;
pub(super) const OFFSETS: usize = 4;
const DRIFTS: usize = 9;
const SLOPES: usize = 11;
/// Each mean over time, and its slope.
pub(super) const SLOPE_OF: [(usize, usize); 5] = [
    (OFFSETS, DRIFTS),
    (OFFSETS + 1, DRIFTS + 1),
    (LEAKS, SLOPES),
    (LEAKS + 1, SLOPES + 1),
    (LEAKS + 2, SLOPES + 2),
];
pub(super) const ORIFICES: usize = 14;
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
            0.0,
            0.0,
            0.0,
            0.0,
            0.0,
        ]))
    }

    /// This rig with meters whose zeros are off and drift, as undeclared ones are now and then.
    pub fn with_zeros_off(mut self, rig: &Rig, duration_s: f64) -> Self {
        let Self(spread) = &mut self;
        let full_scales = [rig.instruments.flow_a.full_scale, rig.instruments.flow_b.full_scale];
        for (meter, full_scale) in full_scales.into_iter().enumerate() {
            let usual = UNDECLARED_ZERO_SHARE * full_scale;
            spread[OFFSETS + meter] = spread[OFFSETS + meter].max(usual);
            spread[DRIFTS + meter] = usual / duration_s.max(1.0);
        }
        self
    }

    /// This rig with one meter whose zero is off and steady, as an undeclared one is now and then.
    pub fn with_zero_off(mut self, zero: Parameter, rig: &Rig) -> Self {
        let meter =
            if zero == Parameter::OffsetA { &rig.instruments.flow_a } else { &rig.instruments.flow_b };
        let spread = &mut self.0[zero as usize];
        *spread = spread.max(UNDECLARED_ZERO_SHARE * meter.full_scale);
        self
    }

    /// This rig with leaks that change by anything from end to end.
    pub fn with_changing_leaks(mut self, duration_s: f64) -> Self {
        for leak in 0..3 {
            self.0[SLOPES + leak] = self.0[LEAKS + leak] / duration_s.max(1.0);
        }
        self
    }

    /// This rig with leaks part of which may pass an orifice: Q = C √|P|, of P's sign (Merritt 1967, section 3.3).
    pub fn with_orifices(mut self, leaks: impl IntoIterator<Item = Leak>, rig: &Rig) -> Self {
        let full_scale_pa = rig.instruments.pressure.full_scale;
        for leak in leaks {
            self.0[ORIFICES + leak as usize] = self.0[LEAKS + leak as usize] * full_scale_pa.sqrt();
        }
        self
    }

    /// This rig without this leak.
    pub fn without(mut self, leak: Leak) -> Self {
        self.0[LEAKS + leak as usize] = 0.0;
        self.0[SLOPES + leak as usize] = 0.0;
        self.0[ORIFICES + leak as usize] = 0.0;
        self
    }

    /// This rig with one sensor whose gain or zero may be off by far.
    pub fn with_error(mut self, error: Parameter, rig: &Rig) -> Self {
        self.0[error as usize] = match error {
            Parameter::OffsetA => WILD_ZERO_SHARE * rig.instruments.flow_a.full_scale,
            Parameter::OffsetB => WILD_ZERO_SHARE * rig.instruments.flow_b.full_scale,
            _ => WILD_GAIN,
        };
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
