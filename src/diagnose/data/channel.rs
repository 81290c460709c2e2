//! The readings that carry noise, and how a function of them changes with each.

use crate::diagnose::equation::PerEquation;
use pitchleak_core::{Cylinder, Sensors, Signals};

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
    pub(crate) fn noise_std(self, sensors: &Sensors<f64>, cylinder: &Cylinder<f64>) -> f64 {
        match self {
            Self::Position => sensors.position.noise_std,
            Self::PressureA | Self::PressureB => sensors.pressure.noise_std,
            Self::FlowA => sensors.flow_a.noise_std,
            Self::FlowB => sensors.flow_b.noise_std,
            Self::Force => sensors.force.noise_std,
            // The mean of what both meters say (data/motion.rs).
            Self::FeltSpeed => {
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
