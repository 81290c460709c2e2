use crate::PitchleakResult;
use pitchleak_core::{
    AlarmSettings, Cylinder, Fluid, LeakDetector, PerLeak, Rls, RlsError, RlsSettings, SensorSpread, Sensors,
};

/// The cylinder; A is the piston side.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct PitchleakCylinder {
    /// Piston area of chamber A, m².
    pub area_a_m2: f32,
    /// Piston area of chamber B, less the rod, m².
    pub area_b_m2: f32,
    /// Stroke, m.
    pub stroke_m: f32,
    /// Piston, rod and what moves with them, kg.
    pub moving_mass_kg: f32,
    /// Oil in port and hose of chamber A at x = 0, m³.
    pub dead_volume_a_m3: f32,
    /// Oil in port and hose of chamber B at full stroke, m³.
    pub dead_volume_b_m3: f32,
}

/// The oil.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct PitchleakFluid {
    /// Bulk modulus, Pa.
    pub bulk_modulus_pa: f32,
    /// How well it is known, one standard deviation, Pa.
    pub bulk_modulus_std_pa: f32,
}

/// How far a sensor's reading may be off, one standard deviation each, in the sensor's SI unit.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct PitchleakSensor {
    /// White noise of one reading.
    pub noise_std: f32,
    /// Constant offset; estimated by `Pitchleak6` and `Pitchleak9`.
    pub bias_std: f32,
    /// Scale error, as a share of the reading; estimated by `Pitchleak9`.
    pub gain_std: f32,
    /// How far the offset may drift in an hour; followed by `Pitchleak6` and `Pitchleak9`.
    pub drift_std_ph: f32,
}

/// All that is declared.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct PitchleakRig {
    /// The cylinder.
    pub cylinder: PitchleakCylinder,
    /// Its oil.
    pub fluid: PitchleakFluid,
    /// Flow meter of chamber A, m³/s.
    pub flow_a: PitchleakSensor,
    /// Flow meter of chamber B, m³/s.
    pub flow_b: PitchleakSensor,
    /// Both pressure sensors, Pa.
    pub pressure: PitchleakSensor,
    /// Position sensor, m.
    pub position: PitchleakSensor,
    /// Internal leak that raises an alarm, m³/s.
    pub threshold_internal_m3s: f32,
    /// External leak of chamber A that raises an alarm, m³/s.
    pub threshold_external_a_m3s: f32,
    /// External leak of chamber B that raises an alarm, m³/s.
    pub threshold_external_b_m3s: f32,
    /// A longer step, s, is a gap: nothing is integrated over it. 0.5 is usual.
    pub max_step_s: f32,
}

/// What a rig may be, SI: as wide as a rig file's bounds, so that any machine lies within and nothing overflows in `float`.
mod bounds {
    use core::ops::RangeInclusive;

    /// m²: of a piston of 1 mm to one of 3.5 m.
    pub(super) const AREA: RangeInclusive<f32> = 1e-6..=10.0;
    /// m.
    pub(super) const STROKE: RangeInclusive<f32> = 1e-3..=100.0;
    /// kg; none in a cylinder whose force is not looked at.
    pub(super) const MOVING_MASS: RangeInclusive<f32> = 0.0..=1e7;
    /// m³.
    pub(super) const DEAD_VOLUME: RangeInclusive<f32> = 0.0..=10.0;
    /// Pa: from froth to steel.
    pub(super) const BULK_MODULUS: RangeInclusive<f32> = 1e6..=1e11;
    /// Pa.
    pub(super) const BULK_MODULUS_STD: RangeInclusive<f32> = 0.0..=1e11;
    /// Noise, offset and drift of a flow meter, m³/s.
    pub(super) const FLOW: RangeInclusive<f32> = 0.0..=10.0;
    /// Of a pressure sensor, Pa.
    pub(super) const PRESSURE: RangeInclusive<f32> = 0.0..=1e9;
    /// Of a position sensor, m.
    pub(super) const POSITION: RangeInclusive<f32> = 0.0..=1e3;
    /// Share of a reading.
    pub(super) const GAIN: RangeInclusive<f32> = 0.0..=1.0;
    /// m³/s.
    pub(super) const THRESHOLD: RangeInclusive<f32> = 1e-15..=10.0;
    /// s.
    pub(super) const MAX_STEP: RangeInclusive<f32> = 1e-6..=1e7;
}

impl PitchleakSensor {
    fn is_within(&self, unit: &core::ops::RangeInclusive<f32>) -> bool {
        let Self { noise_std, bias_std, gain_std, drift_std_ph } = self;
        [noise_std, bias_std, drift_std_ph].into_iter().all(|value| unit.contains(value))
            && bounds::GAIN.contains(gain_std)
    }
}

/// A cylinder, its oil and the longest step that are possible; no number that is none is.
pub(crate) fn possible(
    cylinder: &PitchleakCylinder,
    fluid: &PitchleakFluid,
    max_step_s: f32,
) -> Result<(Cylinder<f32>, Fluid<f32>), PitchleakResult> {
    let PitchleakCylinder {
        area_a_m2,
        area_b_m2,
        stroke_m,
        moving_mass_kg,
        dead_volume_a_m3,
        dead_volume_b_m3,
    } = *cylinder;
    let PitchleakFluid { bulk_modulus_pa, bulk_modulus_std_pa } = *fluid;
    let is_possible = bounds::AREA.contains(&area_a_m2)
        && bounds::AREA.contains(&area_b_m2)
        && bounds::STROKE.contains(&stroke_m)
        && bounds::MOVING_MASS.contains(&moving_mass_kg)
        && bounds::DEAD_VOLUME.contains(&dead_volume_a_m3)
        && bounds::DEAD_VOLUME.contains(&dead_volume_b_m3)
        && bounds::BULK_MODULUS.contains(&bulk_modulus_pa)
        && bounds::BULK_MODULUS_STD.contains(&bulk_modulus_std_pa)
        && bounds::MAX_STEP.contains(&max_step_s);
    if !is_possible {
        return Err(PitchleakResult::BadCylinder);
    }
    let cylinder =
        Cylinder { area_a_m2, area_b_m2, stroke_m, moving_mass_kg, dead_volume_a_m3, dead_volume_b_m3 };
    Ok((cylinder, Fluid { bulk_modulus_pa, bulk_modulus_std_pa }))
}

/// Alarms at these leaks, m³/s: internal, external A, external B.
pub(crate) fn detector(
    [internal, external_a, external_b]: [f32; 3],
) -> Result<LeakDetector<f32>, PitchleakResult> {
    let threshold_m3s = PerLeak { internal, external_a, external_b };
    if !threshold_m3s.iter().all(|(_, threshold)| bounds::THRESHOLD.contains(threshold)) {
        return Err(PitchleakResult::BadThreshold);
    }
    Ok(LeakDetector::new(AlarmSettings { threshold_m3s, ..AlarmSettings::default() }))
}

impl PitchleakRig {
    pub(crate) fn estimator<const N: usize>(&self) -> Result<Rls<f32, N>, PitchleakResult> {
        let (cylinder, fluid) = possible(&self.cylinder, &self.fluid, self.max_step_s)?;
        let sensors = [
            self.flow_a.is_within(&bounds::FLOW),
            self.flow_b.is_within(&bounds::FLOW),
            self.pressure.is_within(&bounds::PRESSURE),
            self.position.is_within(&bounds::POSITION),
        ];
        if sensors.contains(&false) {
            return Err(PitchleakResult::BadSensors);
        }
        let spread = |sensor: PitchleakSensor| SensorSpread {
            noise_std: sensor.noise_std,
            bias_std: sensor.bias_std,
            gain_std: sensor.gain_std,
            drift_std_ph: sensor.drift_std_ph,
        };
        let sensors = Sensors {
            flow_a: spread(self.flow_a),
            flow_b: spread(self.flow_b),
            pressure: spread(self.pressure),
            position: spread(self.position),
            // The estimator does without it.
            force: SensorSpread::default(),
        };
        let settings = RlsSettings { max_step_s: self.max_step_s, ..RlsSettings::default() };
        Rls::new(cylinder, fluid, &sensors, settings).map_err(|error| match error {
            RlsError::Sensors => PitchleakResult::BadSensors,
            _ => PitchleakResult::BadCylinder,
        })
    }

    pub(crate) fn detector(&self) -> Result<LeakDetector<f32>, PitchleakResult> {
        detector([self.threshold_internal_m3s, self.threshold_external_a_m3s, self.threshold_external_b_m3s])
    }
}
