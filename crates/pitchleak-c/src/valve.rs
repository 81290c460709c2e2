//! Leaks without flow meters, by a calibrated valve.

use crate::PitchleakResult;
use crate::rig::{PitchleakAlarms, PitchleakCylinder, PitchleakEstimate, PitchleakFluid, detector, possible};
use crate::running::{self, Kept, Memory};
use pitchleak_core::{
    LeakDetector, VALVE_COVARIANCES, VALVE_UNKNOWNS, ValveCalibration, ValveError, ValveFilter, ValveNoise,
    ValveSample, ValveUpdate,
};

/// Numbers in `mean` of `valve.toml`.
pub const PITCHLEAK_VALVE_UNKNOWNS: usize = 23;
/// Numbers in `covariance` of `valve.toml`.
pub const PITCHLEAK_VALVE_COVARIANCES: usize = 276;
/// Size of `PitchleakValve` in 64-bit words.
pub const PITCHLEAK_VALVE_WORDS: usize = 370;
/// A state is never longer, bytes.
pub const PITCHLEAK_VALVE_STATE_BYTES: usize = 2968;

const _: () = assert!(
    PITCHLEAK_VALVE_UNKNOWNS == VALVE_UNKNOWNS && PITCHLEAK_VALVE_COVARIANCES == VALVE_COVARIANCES,
    "the numbers of a calibration"
);

/// A cylinder without flow meters, its calibrated valve and its sensors. `pitchleak calibrate` writes `mean` and
/// `covariance` into `valve.toml`; all else of the valve stands in `[valve]` of the rig file.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct PitchleakValveRig {
    /// The cylinder.
    pub cylinder: PitchleakCylinder,
    /// Its oil.
    pub fluid: PitchleakFluid,
    /// `mean` of `valve.toml`, in its order.
    pub mean: [f32; PITCHLEAK_VALVE_UNKNOWNS],
    /// `covariance` of `valve.toml`, one row after the other: 1 number, 2 numbers, … 23 numbers.
    pub covariance: [f32; PITCHLEAK_VALVE_COVARIANCES],
    /// `rated_flow`: over one fully open edge, m³/s, …
    pub rated_flow_m3s: f32,
    /// … at `rated_drop`, Pa.
    pub rated_drop_pa: f32,
    /// `tank`, Pa.
    pub tank_pa: f32,
    /// `hysteresis`, a share of the stroke; 0.003 where the rig file has none.
    pub hysteresis: f32,
    /// `null_leak`, a share of the rated flow; 0.02 where the rig file has none.
    pub null_leak: f32,
    /// `drift.gain`; 0.03 where the rig file has none.
    pub gain_drift: f32,
    /// `drift.lap`; 0.001 where the rig file has none.
    pub lap_drift: f32,
    /// `drift.null_leak`; 0.1 where the rig file has none.
    pub null_leak_drift: f32,
    /// Noise of one position, one standard deviation, m: a third of `accuracy` of full scale, as are the three that follow.
    pub position_std_m: f32,
    /// Noise of a chamber pressure, Pa.
    pub pressure_std_pa: f32,
    /// Noise of the spool's position, a share of its stroke.
    pub spool_std: f32,
    /// Noise of the supply pressure, Pa.
    pub supply_std_pa: f32,
    /// Internal leak that raises an alarm, m³/s.
    pub threshold_internal_m3s: f32,
    /// External leak of chamber A that raises an alarm, m³/s.
    pub threshold_external_a_m3s: f32,
    /// External leak of chamber B that raises an alarm, m³/s.
    pub threshold_external_b_m3s: f32,
    /// A longer step, s, is a gap: nothing is integrated over it. 0.5 is usual.
    pub max_step_s: f32,
}

/// One reading of the sensors, SI; pressures are gauge.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct PitchleakValveSample {
    /// Piston position from the A end, m.
    pub x_m: f32,
    /// Pressure of chamber A, Pa.
    pub pa_pa: f32,
    /// Pressure of chamber B, Pa.
    pub pb_pa: f32,
    /// Position of the spool, a share of its stroke; above zero it feeds A.
    pub spool: f32,
    /// Supply pressure at the valve, Pa.
    pub ps_pa: f32,
}

/// What has been found so far.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default)]
pub struct PitchleakValveFound {
    /// Internal leak past the piston at the mean pressures of the last minute, m³/s.
    pub internal_m3s: PitchleakEstimate,
    /// Leak out of chamber A at its mean pressure, m³/s; since the calibration, where that was made with `--leaks unknown`.
    pub external_a_m3s: PitchleakEstimate,
    /// Leak out of chamber B at its mean pressure, m³/s, likewise.
    pub external_b_m3s: PitchleakEstimate,
    /// Coefficient of the internal leak, m³/(s·Pa).
    pub internal_m3spa: PitchleakEstimate,
    /// Coefficient of the leak out of chamber A, m³/(s·Pa).
    pub external_a_m3spa: PitchleakEstimate,
    /// Coefficient of the leak out of chamber B, m³/(s·Pa).
    pub external_b_m3spa: PitchleakEstimate,
    /// Compressibility of the oil, 1/Pa: one over the bulk modulus.
    pub compressibility_per_pa: PitchleakEstimate,
    /// Normalised innovation squared: 1 where the declared noise explains the readings.
    pub innovation: f32,
    /// 1 where a valve as calibrated, its leaks and noise explain the readings, from half a minute on; alarms rest else.
    pub is_explained: u8,
    /// Active alarms.
    pub alarms: PitchleakAlarms,
}

/// What is kept from sample to sample.
#[derive(Clone, Copy, serde::Serialize, serde::Deserialize)]
pub(crate) struct Valve {
    filter: ValveFilter<f32>,
    detector: LeakDetector<f32>,
}

impl Kept for Valve {
    const KIND: u8 = VALVE_UNKNOWNS as u8;
    type Rig = PitchleakValveRig;
    type Sample = PitchleakValveSample;
    type Found = PitchleakValveFound;

    fn begin(rig: &PitchleakValveRig) -> Result<Self, PitchleakResult> {
        let (cylinder, fluid) = possible(&rig.cylinder, &rig.fluid, rig.max_step_s)?;
        let filter = ValveFilter::new(&cylinder, &fluid, &rig.calibration(), &rig.noise(), rig.max_step_s);
        let filter = filter.map_err(|error| match error {
            ValveError::Noise => PitchleakResult::BadSensors,
            ValveError::Cylinder(_) => PitchleakResult::BadCylinder,
            _ => PitchleakResult::BadCalibration,
        })?;
        let detector = detector([
            rig.threshold_internal_m3s,
            rig.threshold_external_a_m3s,
            rig.threshold_external_b_m3s,
        ])?;
        Ok(Self { filter, detector })
    }

    fn update(&mut self, dt_s: f32, sample: PitchleakValveSample) -> PitchleakResult {
        let PitchleakValveSample { x_m, pa_pa, pb_pa, spool, ps_pa } = sample;
        match self.filter.update(dt_s, &ValveSample { x_m, pa_pa, pb_pa, spool, ps_pa }) {
            ValveUpdate::Started => PitchleakResult::Started,
            ValveUpdate::Accepted => PitchleakResult::Ok,
            ValveUpdate::Rejected => PitchleakResult::Rejected,
            ValveUpdate::Renewed { elapsed_s, changed } => {
                let found = self.filter.estimates();
                if found.is_explained {
                    self.detector.update(elapsed_s, &found.mean_leaks_m3s);
                }
                if changed { PitchleakResult::Changed } else { PitchleakResult::Renewed }
            }
        }
    }

    fn find(&self) -> PitchleakValveFound {
        let found = self.filter.estimates();
        let (flows, leaks) = (&found.mean_leaks_m3s, &found.leaks_m3spa);
        PitchleakValveFound {
            internal_m3s: flows.internal.into(),
            external_a_m3s: flows.external_a.into(),
            external_b_m3s: flows.external_b.into(),
            internal_m3spa: leaks.internal.into(),
            external_a_m3spa: leaks.external_a.into(),
            external_b_m3spa: leaks.external_b.into(),
            compressibility_per_pa: found.compressibility_per_pa.into(),
            innovation: found.normalised_innovation,
            is_explained: u8::from(found.is_explained),
            alarms: self.detector.active().into(),
        }
    }
}

impl PitchleakValveRig {
    fn calibration(&self) -> ValveCalibration<f32> {
        ValveCalibration {
            mean: self.mean,
            covariance: self.covariance,
            rated_flow_m3s: self.rated_flow_m3s,
            rated_drop_pa: self.rated_drop_pa,
            tank_pa: self.tank_pa,
            hysteresis: self.hysteresis,
            null_leak: self.null_leak,
            gain_drift: self.gain_drift,
            lap_drift: self.lap_drift,
            null_leak_drift: self.null_leak_drift,
        }
    }

    fn noise(&self) -> ValveNoise<f32> {
        ValveNoise {
            position_m: self.position_std_m,
            pressure_pa: self.pressure_std_pa,
            spool: self.spool_std,
            supply_pa: self.supply_std_pa,
        }
    }
}

/// Memory of an estimator of leaks by a calibrated valve. Begin with `pitchleak_valve_begin`; it may be moved and
/// copied.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct PitchleakValve {
    /// Not for reading.
    pub words: [u64; PITCHLEAK_VALVE_WORDS],
}

// SAFETY: `Memory::FITS` holds.
unsafe impl Memory for PitchleakValve {
    type Kept = Valve;
}

/// Begins anew for a rig.
///
/// # Safety
/// Each pointer is null, or what it says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pitchleak_valve_begin(
    estimator: *mut PitchleakValve,
    rig: *const PitchleakValveRig,
) -> PitchleakResult {
    // SAFETY: as the caller promises.
    unsafe { running::begin(estimator, rig) }
}

/// Takes in a sample, `dt_s` after the one before.
///
/// # Safety
/// Each pointer is null, or what it says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pitchleak_valve_update(
    estimator: *mut PitchleakValve,
    dt_s: f32,
    sample: *const PitchleakValveSample,
) -> PitchleakResult {
    // SAFETY: as the caller promises.
    unsafe { running::update(estimator, dt_s, sample) }
}

/// Tells what has been found so far.
///
/// # Safety
/// Each pointer is null, or what it says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pitchleak_valve_find(
    estimator: *const PitchleakValve,
    found: *mut PitchleakValveFound,
) -> PitchleakResult {
    // SAFETY: as the caller promises.
    unsafe { running::find(estimator, found) }
}

/// Writes the state to `bytes`, of which there are `*length`; afterwards `*length` were written.
/// PITCHLEAK_VALVE_STATE_BYTES are enough.
///
/// # Safety
/// Each pointer is null, or what it says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pitchleak_valve_save(
    estimator: *const PitchleakValve,
    bytes: *mut u8,
    length: *mut usize,
) -> PitchleakResult {
    // SAFETY: as the caller promises.
    unsafe { running::save(estimator, bytes, length) }
}

/// Goes on from a state that `pitchleak_valve_save` wrote, on this machine or another; other bytes leave the
/// estimator as it was.
///
/// # Safety
/// Each pointer is null, or what it says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pitchleak_valve_restore(
    estimator: *mut PitchleakValve,
    bytes: *const u8,
    length: usize,
) -> PitchleakResult {
    // SAFETY: as the caller promises.
    unsafe { running::restore(estimator, bytes, length) }
}
