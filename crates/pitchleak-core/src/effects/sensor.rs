use super::Effect;
use crate::{Model, Moment, Real, Terms};

/// What one unit of a sensor effect does to the readings:
/// `reading = truth · (1 + value · scale) + value · shift`, signal by signal.
struct Distortion<T> {
    scale: Moment<T>,
    shift: Moment<T>,
}

/// The definition of every sensor effect; a physical effect distorts nothing. `at` supplies the
/// signals that one reading borrows from another.
fn distortion<T: Real>(effect: Effect, at: &Moment<T>) -> Distortion<T> {
    let (one, none) = (T::one(), Moment::default());
    let scale = |scale| Distortion { scale, shift: none };
    let shift = |shift| Distortion { scale: none, shift };
    match effect {
        Effect::FlowMeterOffsetA => shift(Moment { qa_m3s: one, ..none }),
        Effect::FlowMeterOffsetB => shift(Moment { qb_m3s: one, ..none }),
        Effect::FlowMeterGainA => scale(Moment { qa_m3s: one, dqa_m3s2: one, ..none }),
        Effect::FlowMeterGainB => scale(Moment { qb_m3s: one, dqb_m3s2: one, ..none }),
        // First order in the lag; the simulation filters, see `LaggedFlow`.
        Effect::FlowMeterLag => shift(Moment { qa_m3s: -at.dqa_m3s2, qb_m3s: -at.dqb_m3s2, ..none }),
        Effect::PositionGain => scale(Moment { x_m: one, v_mps: one, a_mps2: one, ..none }),
        Effect::PositionOffset => shift(Moment { x_m: one, ..none }),
        Effect::PressureOffsetA => shift(Moment { pa_pa: one, ..none }),
        Effect::PressureOffsetB => shift(Moment { pb_pa: one, ..none }),
        Effect::PressureGainA => scale(Moment { pa_pa: one, dpa_pas: one, ..none }),
        Effect::PressureGainB => scale(Moment { pb_pa: one, dpb_pas: one, ..none }),
        Effect::LineResistanceA => shift(Moment { pa_pa: at.qa_m3s, dpa_pas: at.dqa_m3s2, ..none }),
        Effect::LineResistanceB => shift(Moment { pb_pa: at.qb_m3s, dpb_pas: at.dqb_m3s2, ..none }),
        Effect::ForceGain => scale(Moment { force_n: one, ..none }),
        _ => Distortion { scale: none, shift: none },
    }
}

/// What the sensors show of the truth.
pub(super) fn read<T: Real>(effect: Effect, value: T, truth: &Moment<T>) -> Moment<T> {
    let Distortion { scale, shift } = distortion(effect, truth);
    truth.zip(scale, |signal, gain| signal * (T::one() + value * gain)).zip(shift, |s, more| s + value * more)
}

/// The truth behind a reading: [`read`] undone.
pub(super) fn correct<T: Real>(effect: Effect, value: T, reading: &Moment<T>) -> Moment<T> {
    let Distortion { scale, shift } = distortion(effect, reading);
    reading
        .zip(shift, |s, more| s - value * more)
        .zip(scale, |signal, gain| signal / (T::one() + value * gain))
}

/// What one unit of a sensor effect adds, to first order, to the declared model's residual when
/// that is computed from the readings. The residual is quadratic in the signals, so the central
/// difference is exact whatever its step.
pub(super) fn unit_term<T: Real>(effect: Effect, at: &Moment<T>, model: &Model<T>) -> Terms<T> {
    let step = T::lit(effect.spec().default_size);
    let above = model.residual(&read(effect, step, at));
    let below = model.residual(&read(effect, -step, at));
    above.zip(below, |above, below| (above - below) / (step + step))
}

/// The dynamic form of [`Effect::FlowMeterLag`]: τ y' + y = u by backward Euler, stable for every
/// step; [`Effect::read`]'s `−τ dQ/dt` is its first-order part.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct LaggedFlow<T> {
    reading_m3s: T,
}

impl<T: Real> LaggedFlow<T> {
    /// A meter that has shown `flow_m3s` for long.
    pub fn new(flow_m3s: T) -> Self {
        Self { reading_m3s: flow_m3s }
    }

    /// The reading `step_s` later; `lag_s` is τ. What is not a number is passed over.
    pub fn update(&mut self, step_s: T, lag_s: T, flow_m3s: T) -> T {
        let reading = self.reading_m3s + (flow_m3s - self.reading_m3s) * step_s / (step_s + lag_s);
        if reading.is_finite() {
            self.reading_m3s = reading;
        }
        self.reading_m3s
    }
}
