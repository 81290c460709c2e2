//! How the noise of each sensor enters a row, through the whole residual as it stands: also through what a sensor
//! effect undoes on the readings, and through the storage, leaks and friction that have been named.

use super::linearisation::Linearisation;
use super::rows::Row;
use crate::diagnose::equation::{Equation, PerEquation};
use pitchleak_core::{Sensors, Signals};

/// A reading that carries noise of its own.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Channel {
    Position,
    PressureA,
    PressureB,
    FlowA,
    FlowB,
    Force,
    /// The speed that forces feel: from the flows, or from the position where there are none.
    FeltSpeed,
}

impl Channel {
    pub(crate) const ALL: [Self; 7] = [
        Self::Position,
        Self::PressureA,
        Self::PressureB,
        Self::FlowA,
        Self::FlowB,
        Self::Force,
        Self::FeltSpeed,
    ];

    /// Standard deviation of one sample.
    pub(crate) fn noise_std(self, sensors: &Sensors<f64>, at: &Linearisation) -> f64 {
        match self {
            Self::Position => sensors.position.noise_std,
            Self::PressureA | Self::PressureB => sensors.pressure.noise_std,
            Self::FlowA => sensors.flow_a.noise_std,
            Self::FlowB => sensors.flow_b.noise_std,
            Self::Force => sensors.force.noise_std,
            // The mean of what both meters say (data/motion.rs).
            Self::FeltSpeed => {
                let cylinder = &at.model.cylinder;
                let of = |flow_std: f64, area_m2: f64| flow_std / area_m2 / 2.0;
                of(sensors.flow_a.noise_std, cylinder.area_a_m2)
                    .hypot(of(sensors.flow_b.noise_std, cylinder.area_b_m2))
            }
        }
    }

    /// The signal that the noise is added to (0), its rate (1) or its curvature (2); none where no equation has it.
    pub(crate) fn signal(self, order: usize, at: &mut Signals<f64>) -> Option<&mut f64> {
        Some(match (self, order) {
            (Self::Position, 0) => &mut at.x_m,
            (Self::Position, 1) | (Self::FeltSpeed, 0) => &mut at.v_mps,
            (Self::FeltSpeed, 1) => &mut at.a_mps2,
            (Self::PressureA, 0) => &mut at.pa_pa,
            (Self::PressureA, 1) => &mut at.dpa_pas,
            (Self::PressureA, 2) => &mut at.d2pa_pas2,
            (Self::PressureB, 0) => &mut at.pb_pa,
            (Self::PressureB, 1) => &mut at.dpb_pas,
            (Self::PressureB, 2) => &mut at.d2pb_pas2,
            (Self::FlowA, 0) => &mut at.qa_m3s,
            (Self::FlowA, 1) => &mut at.dqa_m3s2,
            (Self::FlowB, 0) => &mut at.qb_m3s,
            (Self::FlowB, 1) => &mut at.dqb_m3s2,
            (Self::Force, 0) => &mut at.force_n,
            _ => return None,
        })
    }

    /// Central difference of `f` by this signal; `std` is the noise of a sample, the natural step.
    pub(crate) fn slope(
        self,
        order: usize,
        at: &Signals<f64>,
        (std, block_s): (f64, f64),
        f: impl Fn(&Signals<f64>) -> PerEquation<f64>,
    ) -> PerEquation<f64> {
        let step = std / block_s.powi(order as i32);
        let moved = |by: f64| {
            let mut moved = *at;
            *self.signal(order, &mut moved)? += by;
            Some(f(&moved))
        };
        match (step > 0.0).then(|| moved(step).zip(moved(-step))).flatten() {
            Some((above, below)) => above.zip(below, |above, below| {
                let slope = (above - below) / (2.0 * step);
                if slope.is_finite() { slope } else { 0.0 }
            }),
            None => PerEquation::default(),
        }
    }
}

/// How one row of an equation takes up noise.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sensitivity {
    /// By how much it grows with each channel's signal, rate and curvature.
    pub(crate) gains: [[f64; 3]; Channel::ALL.len()],
    /// The noise of each channel in that of its sensor: more where the trace moves faster than its samples tell.
    pub(crate) noise_times: [f64; Channel::ALL.len()],
}

impl Default for Sensitivity {
    fn default() -> Self {
        Self { gains: [[0.0; 3]; Channel::ALL.len()], noise_times: [1.0; Channel::ALL.len()] }
    }
}

impl Sensitivity {
    /// These sensitivities where position, pressures, flows and force have so many times their noise.
    #[must_use]
    pub(super) fn at_noise_times(self, [x, pa, pb, qa, qb, force]: [f64; 6]) -> Self {
        Self { noise_times: [x, pa, pb, qa, qb, force, qa.max(qb)], ..self }
    }

    /// Whether samples don't see all of the speed that forces feel.
    pub(super) fn is_speed_unresolved(&self) -> bool {
        self.noise_times[Channel::FeltSpeed as usize] > 1.0
    }

    /// Whether samples don't see all that moves here.
    pub(crate) fn is_unresolved(&self) -> bool {
        self.noise_times.iter().any(|times| *times > 1.0)
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

    /// Of all three equations at a row.
    pub(crate) fn of(at: &Linearisation, sensors: &Sensors<f64>, row: &Row) -> PerEquation<Self> {
        let mut all = PerEquation::<Self>::default();
        for (place, channel) in Channel::ALL.into_iter().enumerate() {
            let std = channel.noise_std(sensors, at);
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
