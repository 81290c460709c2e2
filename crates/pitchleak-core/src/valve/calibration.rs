//! What is known of a valve, its cylinder and its sensors.

use super::unknowns::{
    CLEARANCES, DRIFT_S, GAINS, HYSTERESIS, KAPPA, LAPS, LEAK_UNIT_M3SPA, LEAKS, NULL_DRIFT_S, ROUNDING,
    TANK, TANK_STD_BAR, VALVE_COVARIANCES, VALVE_UNKNOWNS as N,
};
use crate::{CylinderError, Fluid, Real};

/// A valve as `pitchleak calibrate` found it, its data sheet, and by how much it changes since.
///
/// `mean` and `covariance` are the numbers of `valve.toml`, in its order and its units: the three leaks, κ over the rig's, gains of the
/// edges P–A, A–T, P–B, B–T over the data sheet's, their overlaps (shares of the stroke), rounding, saturation, tank (bar), lag (ms),
/// clearances (L/min at 50 bar), hysteresis (share of the stroke), supply and droop (bar). The leaks' own are not read.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ValveCalibration<T> {
    /// `mean` of `valve.toml`.
    pub mean: [T; N],
    /// `covariance` of `valve.toml`, row after row of its lower triangle.
    pub covariance: [T; VALVE_COVARIANCES],
    /// Flow over one fully open edge …, m³/s.
    pub rated_flow_m3s: T,
    /// … at this drop over it, Pa.
    pub rated_drop_pa: T,
    /// Tank pressure, Pa.
    pub tank_pa: T,
    /// Declared half width of the spool's hysteresis, a share of its stroke; zero for none.
    pub hysteresis: T,
    /// What the whole valve leaks at its middle, a share of the rated flow: `null_leak` of the rig file.
    pub null_leak: T,
    /// Change of an edge's gain in a day, 1 σ, a share of it: `drift` of the rig file, as are the two that follow.
    pub gain_drift: T,
    /// Change of each overlap in a day, and of the spool's zero in ten minutes, 1 σ, a share of its stroke.
    pub lap_drift: T,
    /// Change of an edge's clearance in a day, 1 σ, a share of `null_leak`, of which half passes each edge.
    pub null_leak_drift: T,
}

/// White noise of one reading, 1 σ.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ValveNoise<T> {
    /// Piston position, m.
    pub position_m: T,
    /// Both chamber pressures, Pa.
    pub pressure_pa: T,
    /// Spool position, a share of its stroke.
    pub spool: T,
    /// Supply pressure, Pa.
    pub supply_pa: T,
}

/// Why there is no [`ValveFilter`](super::ValveFilter).
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ValveError {
    /// The cylinder or its oil cannot be.
    #[error("{0}")]
    Cylinder(#[from] CylinderError),
    /// A number of the calibration cannot be.
    #[error("the valve's calibration is none that `pitchleak calibrate` wrote")]
    Calibration,
    /// A sensor's noise or the longest step is not positive.
    #[error("noise of the sensors and the longest step must be positive")]
    Noise,
}

/// A leak grows by so much in an hour, 1 σ, L/min at 50 bar: no valve tells less (docs/valve.md).
const LEAK_GROWTH: f64 = 0.005;
const HOUR_S: f64 = 3600.0;
/// A leak before any reading, 1 σ, L/min at 50 bar: larger ones empty the tank.
pub(super) const LEAK_SIZE: f64 = 10.0;

impl<T: Real> ValveCalibration<T> {
    pub(super) fn check(&self) -> Result<(), ValveError> {
        let sizes = [self.rated_flow_m3s, self.rated_drop_pa, self.mean[KAPPA], self.mean[ROUNDING]];
        let spreads =
            [self.hysteresis, self.null_leak, self.gain_drift, self.lap_drift, self.null_leak_drift];
        let numbers = self.mean.iter().chain(&self.covariance).chain([&self.tank_pa]);
        let is_possible = sizes.into_iter().all(T::is_positive)
            && spreads.into_iter().all(T::is_not_negative)
            && numbers.copied().all(T::is_finite);
        if is_possible { Ok(()) } else { Err(ValveError::Calibration) }
    }

    /// The same, the leaks unknown.
    pub(super) fn without_leaks(&self) -> Self {
        let mut other = *self;
        other.mean.iter_mut().take(KAPPA).for_each(|leak| *leak = T::zero());
        let mut entries = other.covariance.iter_mut();
        for row in 0..N {
            for (column, entry) in entries.by_ref().take(row + 1).enumerate() {
                if column < KAPPA {
                    *entry = T::zero();
                }
            }
        }
        other
    }

    /// What each unknown's variance grows by, 1/s, in its own unit.
    pub(super) fn growth_ps(&self, fluid: &Fluid<T>) -> [T; N] {
        let mut growth = [T::zero(); N];
        let day_s = T::lit(DRIFT_S);
        let oil = fluid.bulk_modulus_std_pa / fluid.bulk_modulus_pa;
        let half_m3spa = T::lit(0.5) * self.null_leak * self.rated_flow_m3s / self.rated_drop_pa;
        let clearance = self.null_leak_drift * half_m3spa / T::lit(LEAK_UNIT_M3SPA);
        let leak = T::lit(LEAK_GROWTH * LEAK_GROWTH / HOUR_S);
        for (unknown, (place, mean)) in growth.iter_mut().zip(&self.mean).enumerate() {
            let own = *mean * self.gain_drift;
            *place = match unknown {
                LEAKS..KAPPA => leak,
                KAPPA => oil * oil / day_s,
                GAINS..LAPS => own * own / day_s,
                LAPS..ROUNDING => self.lap_drift * self.lap_drift / day_s,
                TANK => T::lit(TANK_STD_BAR * TANK_STD_BAR) / day_s,
                CLEARANCES..HYSTERESIS => clearance * clearance / day_s,
                HYSTERESIS => self.hysteresis * self.hysteresis / day_s,
                _ => T::zero(),
            };
        }
        growth
    }

    /// What is not known any more since the calibration: a day's change, and the leaks.
    pub(super) fn since(growth_ps: &[T; N]) -> [T; N] {
        let mut since = growth_ps.map(|growth| growth * T::lit(DRIFT_S));
        for (unknown, variance) in since.iter_mut().enumerate() {
            if unknown < KAPPA {
                *variance = T::lit(LEAK_SIZE * LEAK_SIZE);
            }
        }
        since
    }

    /// What the variance of the spool's zero grows by, 1/s.
    pub(super) fn zero_growth_ps(&self) -> T {
        self.lap_drift * self.lap_drift / T::lit(NULL_DRIFT_S)
    }
}

impl<T: Real> ValveNoise<T> {
    pub(super) fn check(&self) -> Result<(), ValveError> {
        let Self { position_m, pressure_pa, spool, supply_pa } = *self;
        let all = [position_m, pressure_pa, spool, supply_pa].into_iter().all(T::is_positive);
        if all { Ok(()) } else { Err(ValveError::Noise) }
    }
}
