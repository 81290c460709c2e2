//! How the noise of each sensor enters a row, through the whole residual as it stands: also through what a sensor
//! effect undoes on the readings, and through the storage, leaks and friction that have been named.

use super::linearisation::Linearisation;
use super::rows::Row;
use crate::diagnose::data::Channel;
use crate::diagnose::equation::{Equation, PerEquation};
use pitchleak_core::{Sensors, Signals};

/// How one row of an equation takes up noise.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sensitivity {
    /// By how much it grows with each channel's signal, rate and curvature.
    pub(crate) gains: [[f64; 3]; Channel::ALL.len()],
    /// The noise of each channel in that of its sensor: more where the trace moves faster than its samples tell.
    pub(crate) noise_factor: [f64; Channel::ALL.len()],
}

/// The share of a gain that is no more than `most`.
pub(super) fn held(gain: f64, most: f64) -> f64 {
    if gain > most { most / gain } else { 1.0 }
}

impl Default for Sensitivity {
    fn default() -> Self {
        Self { gains: [[0.0; 3]; Channel::ALL.len()], noise_factor: [1.0; Channel::ALL.len()] }
    }
}

impl Sensitivity {
    /// These sensitivities where position, pressures, flows and force have so many times their noise.
    #[must_use]
    pub(super) fn with_noise_factors(self, [x, pa, pb, qa, qb, force]: [f64; 6]) -> Self {
        Self { noise_factor: [x, pa, pb, qa, qb, force, qa.max(qb)], ..self }
    }

    /// By how much an equation grows with the reading that it has by itself; one where that has no noise to tell it.
    pub(super) fn left_gain(&self, equation: Equation) -> f64 {
        let own = match equation {
            Equation::ChamberA => Channel::FlowA,
            Equation::ChamberB => Channel::FlowB,
            Equation::Force => Channel::Force,
        };
        let gain = self.gains[own as usize][0].abs();
        if gain > 0.0 { gain } else { 1.0 }
    }

    /// Whether samples don't see all of the speed that forces feel.
    pub(super) fn is_speed_unresolved(&self) -> bool {
        self.noise_factor[Channel::FeltSpeed as usize] > 1.0
    }

    /// Whether samples don't see all that moves here.
    pub(crate) fn is_unresolved(&self) -> bool {
        self.noise_factor.iter().any(|times| *times > 1.0)
    }

    /// These sensitivities where each channel has so many times the noise of its sensor; unchanged where samples miss
    /// motion.
    #[must_use]
    pub(super) fn at_noise(mut self, times: &[f64; Channel::ALL.len()]) -> Self {
        if !self.is_unresolved() {
            let channels = self.gains.iter_mut().zip(times);
            channels.for_each(|(gains, times)| *gains = gains.map(|gain| gain * times));
        }
        self
    }

    /// These sensitivities where leaks let no more of the pressures' noise in than one of this size.
    #[must_use]
    pub(super) fn with_leaks_of_at_most(mut self, leak_m3spa: f64) -> Self {
        let share = held(self.leak_m3spa(), leak_m3spa);
        for place in [Channel::PressureA, Channel::PressureB] {
            self.gains[place as usize][0] *= share;
        }
        self
    }

    /// What a chamber's equation takes in of the pressures, as a leak, m³/(s·Pa).
    pub(super) fn leak_m3spa(&self) -> f64 {
        let [a, b] = [Channel::PressureA, Channel::PressureB].map(|place| self.gains[place as usize][0]);
        a.hypot(b)
    }

    /// Of all three equations at a row.
    pub(crate) fn of(at: &Linearisation, sensors: &Sensors<f64>, row: &Row) -> PerEquation<Self> {
        let mut all = PerEquation::<Self>::default();
        for (place, channel) in Channel::ALL.into_iter().enumerate() {
            let std = channel.noise_std(sensors, &at.model.cylinder);
            for order in 0..3 {
                let residual = |signals: &Signals<f64>| match channel {
                    Channel::FeltSpeed => at.both_residuals(&row.mean, signals),
                    _ => at.both_residuals(signals, &row.mean),
                };
                let slope = channel.slope(order, &row.mean, (std, row.block_s), residual);
                for equation in Equation::ALL {
                    all[equation].gains[place][order] = slope[equation];
                }
            }
        }
        all
    }
}
