//! What the caller gives and gets: a rig, samples, estimates and alarms.

use crate::PitchleakResult;
use pitchleak_core::{
    AlarmSettings, Cylinder, Estimate, Estimates, Fluid, LeakDetector, PerLeak, Rls, RlsError, RlsSettings,
    Sample, SensorSpread, Sensors,
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

/// One reading of the sensors, SI; pressures are gauge, a flow is positive into its chamber.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct PitchleakSample {
    /// Piston position from the A end, m.
    pub x_m: f32,
    /// Pressure of chamber A, Pa.
    pub pa_pa: f32,
    /// Pressure of chamber B, Pa.
    pub pb_pa: f32,
    /// Flow into chamber A, m³/s; NaN where it is not measured.
    pub qa_m3s: f32,
    /// Flow into chamber B, m³/s; NaN where it is not measured.
    pub qb_m3s: f32,
}

impl From<PitchleakSample> for Sample<f32> {
    fn from(sample: PitchleakSample) -> Self {
        let measured = |flow: f32| (!flow.is_nan()).then_some(flow);
        let PitchleakSample { x_m, pa_pa, pb_pa, qa_m3s, qb_m3s } = sample;
        Self { x_m, pa_pa, pb_pa, qa_m3s: measured(qa_m3s), qb_m3s: measured(qb_m3s), force_n: None }
    }
}

/// A value and its standard deviation.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default)]
pub struct PitchleakEstimate {
    /// Best value.
    pub value: f32,
    /// Standard deviation; infinite where nothing is known.
    pub std: f32,
}

impl From<Estimate<f32>> for PitchleakEstimate {
    fn from(estimate: Estimate<f32>) -> Self {
        let known = estimate.value.is_finite() && !estimate.std.is_nan();
        if known {
            Self { value: estimate.value, std: estimate.std }
        } else {
            Self { value: 0.0, std: f32::INFINITY }
        }
    }
}

/// Which alarms are active, 1 or 0.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default)]
pub struct PitchleakAlarms {
    /// Internal leak.
    pub internal: u8,
    /// External leak of chamber A.
    pub external_a: u8,
    /// External leak of chamber B.
    pub external_b: u8,
}

impl From<PerLeak<bool>> for PitchleakAlarms {
    fn from(active: PerLeak<bool>) -> Self {
        let PerLeak { internal, external_a, external_b } = active.map(u8::from);
        Self { internal, external_a, external_b }
    }
}

/// What has been found so far.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default)]
pub struct PitchleakFound {
    /// Internal leak past the piston at the mean pressures, m³/s.
    pub internal_m3s: PitchleakEstimate,
    /// Leak out of chamber A at its mean pressure, m³/s.
    pub external_a_m3s: PitchleakEstimate,
    /// Leak out of chamber B at its mean pressure, m³/s.
    pub external_b_m3s: PitchleakEstimate,
    /// Coefficient of the internal leak, m³/(s·Pa).
    pub internal_m3spa: PitchleakEstimate,
    /// Coefficient of the leak out of chamber A, m³/(s·Pa).
    pub external_a_m3spa: PitchleakEstimate,
    /// Coefficient of the leak out of chamber B, m³/(s·Pa).
    pub external_b_m3spa: PitchleakEstimate,
    /// Compressibility of the oil, 1/Pa: one over the bulk modulus.
    pub compressibility_per_pa: PitchleakEstimate,
    /// Normalised innovation squared of the balance: 1 where the model and the declared noise explain the readings.
    pub innovation_balance: f32,
    /// Normalised innovation squared of the position equation.
    pub innovation_position: f32,
    /// Active alarms.
    pub alarms: PitchleakAlarms,
}

impl PitchleakFound {
    pub(crate) fn new(found: &Estimates<f32>, active: PerLeak<bool>) -> Self {
        let (flows, leaks) = (&found.mean_leaks_m3s, &found.leaks_m3spa);
        let [innovation_balance, innovation_position] = found.normalised_innovation;
        Self {
            internal_m3s: flows.internal.into(),
            external_a_m3s: flows.external_a.into(),
            external_b_m3s: flows.external_b.into(),
            internal_m3spa: leaks.internal.into(),
            external_a_m3spa: leaks.external_a.into(),
            external_b_m3spa: leaks.external_b.into(),
            compressibility_per_pa: found.compressibility_per_pa.into(),
            innovation_balance,
            innovation_position,
            alarms: active.into(),
        }
    }
}
