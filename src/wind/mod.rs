//! From turbulent wind to what a pitch cylinder has to do: the paper's Section IV, Fig. 5 and 6.
//!
//! A [`History`] is what a turbine simulation says about one blade: pitch angle and pitch moment
//! over time. [`Emulation`] turns it into the position and load the rig follows, by eq. (17) and
//! (18) and the two scale factors of the rig.

mod history;

pub use history::{History, HistoryError, HistoryFault};

use crate::curve::{Curve, CurveError};
use crate::reference::{AfterEnd, Reference};
use pitchleak_core::{Linkage, LinkageError};
use std::path::PathBuf;

/// Where a wind history comes from.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Wind {
    /// One of the paper's four, built in.
    BuiltIn(WindCase),
    /// A file: OpenFAST output, text or binary, or CSV with the columns of `data/wind`.
    File(PathBuf),
}

/// The paper's wind cases by their mean speed (Section IV); `data/wind/README.md` says how they
/// were simulated.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum WindCase {
    /// 5 m/s, 20 % turbulence: below rated power, the pitch stands still.
    Mps5 = 5,
    /// 13 m/s, 20 % turbulence.
    Mps13 = 13,
    /// 21 m/s, 20 % turbulence.
    Mps21 = 21,
    /// 30 m/s, 20 % turbulence: the extreme case, above cut-out.
    Mps30 = 30,
}

impl WindCase {
    /// All four, in the paper's order.
    pub const ALL: [Self; 4] = [Self::Mps5, Self::Mps13, Self::Mps21, Self::Mps30];

    /// Mean wind speed, m/s.
    pub fn mean_mps(self) -> u32 {
        self as u32
    }
}

impl std::str::FromStr for Wind {
    type Err = std::convert::Infallible;

    /// A mean speed of [`WindCase::ALL`], as `13` or `13mps`; anything else is a file's path.
    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let speed = text.strip_suffix("mps").unwrap_or(text).trim();
        let case = WindCase::ALL.into_iter().find(|case| speed == case.mean_mps().to_string());
        Ok(case.map_or_else(|| Self::File(text.into()), Self::BuiltIn))
    }
}

impl std::fmt::Display for Wind {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::BuiltIn(case) => write!(f, "{} m/s", case.mean_mps()),
            Self::File(path) => write!(f, "{}", path.display()),
        }
    }
}

/// How the blade of a turbine is brought onto the rig: eq. (17), (18) and two scale factors.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Emulation {
    /// The pitch mechanism.
    pub linkage: Linkage<f64>,
    /// Inertia J of the blade about its pitch axis, kg m².
    pub blade_inertia_kgm2: f64,
    /// Piston positions of the turbine are divided by this.
    pub position_scale: f64,
    /// Cylinder forces of the turbine are divided by this.
    pub load_scale: f64,
    /// The reference keeps this far from both end stops of the rig, m.
    pub guard_m: f64,
}

/// Why a history cannot be brought onto a rig.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum EmulationError {
    /// The mechanism has no lever arm on the way.
    #[error(transparent)]
    Linkage(#[from] LinkageError),
    /// The mechanism does not reach the rig's positions.
    #[error(
        "a stroke of {} mm times the position scale of {} is more than the pitch mechanism of the turbine reaches: take a \
         smaller position scale",
        1e3 * stroke_m,
        position_scale
    )]
    Stroke {
        /// The rig's stroke, m.
        stroke_m: f64,
        /// By which positions of the turbine are divided.
        position_scale: f64,
    },
    /// A scale factor, the inertia or the guard is out of range.
    #[error("{0} must be positive and finite")]
    Setting(&'static str),
    /// The history's samples make no curve.
    #[error(transparent)]
    Curve(#[from] CurveError),
}

impl Emulation {
    /// The paper's mechanism and its factor of 2 on positions.
    ///
    /// The paper divides loads by 1000, which with this turbine model leaves 45 N at most: less than
    /// 0.1 MPa, under the noise of a 16 MPa sensor. The default here is 5: the largest load of the
    /// four winds (45 kN at 30 m/s) then takes 90 % of the 10 kN load cell, and loads of some
    /// kilonewtons make load pressures of some MPa. The paper prints no J; 1500 kg m² is the
    /// published 28.6 t m² of the NREL 5 MW blade times (35/63)^5, and matters little: it makes 3 %
    /// of the force's standard deviation at most.
    pub fn paper() -> Self {
        Self {
            linkage: Linkage::paper(),
            blade_inertia_kgm2: 1500.0,
            position_scale: 2.0,
            load_scale: 5.0,
            guard_m: 1e-3,
        }
    }

    /// Position and load for a rig of stroke `stroke_m`, over the history's own time and, mirrored, after it.
    ///
    /// Where the pitch would take the piston within `guard_m` of an end stop it is held there; the
    /// share of such samples stands in [`Reference::clipped_share`].
    ///
    /// # Errors
    /// [`EmulationError`].
    pub fn reference(&self, history: &History, stroke_m: f64) -> Result<Reference, EmulationError> {
        self.check()?;
        let lowest = self.linkage.pitch_rad(self.guard_m * self.position_scale)?;
        let position_scale = self.position_scale;
        let highest = (self.linkage.pitch_rad((stroke_m - self.guard_m) * position_scale))
            .map_err(|_| EmulationError::Stroke { stroke_m, position_scale })?;
        let reach = lowest..=highest;
        let acceleration = second_derivative(&history.pitch_rad, history.step_s());
        let mut position_m = Vec::with_capacity(history.t_s.len());
        let mut load_n = Vec::with_capacity(history.t_s.len());
        for ((&pitch, &moment), acceleration) in
            history.pitch_rad.iter().zip(&history.moment_nm).zip(acceleration)
        {
            let pitch = pitch.clamp(lowest, highest);
            let torque_nm = self.blade_inertia_kgm2 * acceleration + moment;
            position_m.push(self.linkage.position_m(pitch)? / self.position_scale);
            load_n.push(self.linkage.force_n(pitch, torque_nm)? / self.load_scale);
        }
        let clipped = history.pitch_rad.iter().filter(|pitch| !reach.contains(pitch)).count();
        let curve = |values: &[f64]| Curve::through(&history.t_s, values);
        Ok(Reference {
            position_m: curve(&position_m)?,
            load_n: curve(&load_n)?,
            wind_mps: history.wind_mps.as_deref().map(curve).transpose()?,
            clipped_share: clipped as f64 / history.t_s.len().max(1) as f64,
            after_end: AfterEnd::Mirrored,
        })
    }

    fn check(&self) -> Result<(), EmulationError> {
        let is_set = [
            ("the position scale", self.position_scale > 0.0 && self.position_scale.is_finite()),
            ("the load scale", self.load_scale > 0.0 && self.load_scale.is_finite()),
            ("the blade inertia", self.blade_inertia_kgm2 >= 0.0 && self.blade_inertia_kgm2.is_finite()),
            ("the guard distance", self.guard_m > 0.0 && self.guard_m.is_finite()),
        ];
        match is_set.into_iter().find(|(_, is_set)| !is_set) {
            Some((setting, _)) => Err(EmulationError::Setting(setting)),
            None => Ok(self.linkage.check()?),
        }
    }
}

/// Half the window of the second derivative, s.
const HALF_WINDOW_S: f64 = 0.1;

/// Second derivative of evenly spaced values: that of the parabola fitted to each 0.2 s of them
/// (Savitzky and Golay 1964), which averages out the rounding of a 16-bit file. Near the ends,
/// where the window does not fit, it is that of the nearest whole window.
fn second_derivative(values: &[f64], step: f64) -> Vec<f64> {
    let half = ((HALF_WINDOW_S / step).round() as usize).clamp(1, (values.len().max(3) - 1) / 2);
    let count = (2 * half + 1) as f64;
    let offset = |k: usize| k as f64 - half as f64;
    let mean_square = half as f64 * (half as f64 + 1.0) / 3.0;
    let weight = |k: usize| offset(k) * offset(k) - mean_square;
    let norm: f64 = (0..=2 * half).map(|k| weight(k) * weight(k)).sum();
    let inner: Vec<f64> = values
        .windows(count as usize)
        .map(|window| {
            let curvature: f64 = window.iter().enumerate().map(|(k, value)| weight(k) * value).sum();
            2.0 * curvature / (norm * step * step)
        })
        .collect();
    let last = inner.len().saturating_sub(1);
    (0..values.len()).map(|k| inner.get(k.saturating_sub(half).min(last)).copied().unwrap_or(0.0)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn second_derivative_of_a_parabola_is_exact_and_of_a_sine_close() {
        let step = 0.04;
        let t: Vec<f64> = (0..100).map(|k| step * f64::from(k)).collect();
        let parabola: Vec<f64> = t.iter().map(|t| 3.0 * t * t - t + 2.0).collect();
        assert!(second_derivative(&parabola, step).iter().all(|a| (a - 6.0).abs() < 1e-9));
        let sine: Vec<f64> = t.iter().map(|t| (2.0 * t).sin()).collect();
        let found = second_derivative(&sine, step);
        for (t, a) in t.iter().zip(found).skip(3).take(94) {
            assert!((a + 4.0 * (2.0 * t).sin()).abs() < 0.05, "{a} at {t}");
        }
    }
}
