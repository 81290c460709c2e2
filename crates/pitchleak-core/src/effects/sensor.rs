use super::Effect;
use crate::{Model, Real, Signals, Terms};

/// What one unit of a sensor effect does to the readings:
/// `reading = truth · (1 + value · scale) + value · shift`, signal by signal.
struct Distortion<T> {
    scale: Signals<T>,
    shift: Signals<T>,
}

/// The definition of every sensor effect; a physical effect distorts nothing. `at` supplies the
/// signals that one reading borrows from another.
fn distortion<T: Real>(effect: Effect, at: &Signals<T>) -> Distortion<T> {
    let (one, none) = (T::one(), Signals::default());
    let scale = |scale| Distortion { scale, shift: none };
    let shift = |shift| Distortion { scale: none, shift };
    // A flow that is not measured is none: the pressure stays as it was read.
    let known = |flow: T| if flow.is_finite() { flow } else { T::zero() };
    match effect {
        Effect::FlowMeterOffsetA => shift(Signals { qa_m3s: one, ..none }),
        Effect::FlowMeterOffsetB => shift(Signals { qb_m3s: one, ..none }),
        Effect::FlowMeterGainA => scale(Signals { qa_m3s: one, dqa_m3s2: one, ..none }),
        Effect::FlowMeterGainB => scale(Signals { qb_m3s: one, dqb_m3s2: one, ..none }),
        // First order in the lag; the simulation filters, see `LaggedReading`.
        Effect::FlowMeterLag => shift(Signals { qa_m3s: -at.dqa_m3s2, qb_m3s: -at.dqb_m3s2, ..none }),
        Effect::PositionGain => scale(Signals { x_m: one, v_mps: one, a_mps2: one, ..none }),
        Effect::PositionOffset => shift(Signals { x_m: one, ..none }),
        Effect::PressureOffsetA => shift(Signals { pa_pa: one, ..none }),
        Effect::PressureOffsetB => shift(Signals { pb_pa: one, ..none }),
        Effect::PressureGainA => scale(Signals { pa_pa: one, dpa_pas: one, d2pa_pas2: one, ..none }),
        Effect::PressureGainB => scale(Signals { pb_pa: one, dpb_pas: one, d2pb_pas2: one, ..none }),
        Effect::PressureLagA => shift(Signals { pa_pa: -at.dpa_pas, dpa_pas: -at.d2pa_pas2, ..none }),
        Effect::PressureLagB => shift(Signals { pb_pa: -at.dpb_pas, dpb_pas: -at.d2pb_pas2, ..none }),
        Effect::LineResistanceA => {
            shift(Signals { pa_pa: known(at.qa_m3s), dpa_pas: known(at.dqa_m3s2), ..none })
        }
        Effect::LineResistanceB => {
            shift(Signals { pb_pa: known(at.qb_m3s), dpb_pas: known(at.dqb_m3s2), ..none })
        }
        Effect::ForceGain => scale(Signals { force_n: one, ..none }),
        _ => Distortion { scale: none, shift: none },
    }
}

/// What the sensors show of the truth.
pub(super) fn read<T: Real>(effect: Effect, value: T, truth: &Signals<T>) -> Signals<T> {
    let Distortion { scale, shift } = distortion(effect, truth);
    truth.zip(scale, |signal, gain| signal * (T::one() + value * gain)).zip(shift, |s, more| s + value * more)
}

/// The truth behind a reading: [`read`] undone.
pub(super) fn correct<T: Real>(effect: Effect, value: T, reading: &Signals<T>) -> Signals<T> {
    let Distortion { scale, shift } = distortion(effect, reading);
    reading
        .zip(shift, |s, more| s - value * more)
        .zip(scale, |signal, gain| signal / (T::one() + value * gain))
}

/// What one unit of a sensor effect adds, to first order, to the declared model's residual when
/// that is computed from the readings. The residual is quadratic in the signals, so the central
/// difference is exact whatever its step.
pub(super) fn unit_term<T: Real>(effect: Effect, at: &Signals<T>, model: &Model<T>) -> Terms<T> {
    let step = T::lit(effect.spec().default_size);
    let above = model.residual(&read(effect, step, at));
    let below = model.residual(&read(effect, -step, at));
    above.zip(below, |above, below| (above - below) / (step + step))
}

/// The dynamic form of [`Effect::FlowMeterLag`] and [`Effect::PressureLagA`]: τ y' + y = u by backward Euler,
/// stable for every step; [`Effect::read`]'s `−τ du/dt` is its first-order part.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct LaggedReading<T> {
    reading: T,
}

impl<T: Real> LaggedReading<T> {
    /// A sensor that has shown `signal` for long.
    pub fn new(signal: T) -> Self {
        Self { reading: signal }
    }

    /// The reading `step_s` later; `lag_s` is τ. What is not a number is passed over.
    pub fn update(&mut self, step_s: T, lag_s: T, signal: T) -> T {
        let reading = self.reading + (signal - self.reading) * step_s / (step_s + lag_s);
        if reading.is_finite() {
            self.reading = reading;
        }
        self.reading
    }
}
