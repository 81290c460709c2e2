use super::{Truth, ValveTruth};
use crate::signal::Signal;
use pitchleak_core::Sample;

/// One row of a recording, as the sensors and the clock have it.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct Reading {
    /// Time since the trace began, s.
    pub t_s: f64,
    /// Readings of the cylinder's sensors.
    pub sample: Sample<f64>,
    /// Oil temperature, K, where there is a thermometer.
    pub temp_k: Option<f64>,
    /// Spool, command and supply, where the rig has `[valve]`.
    pub valve: Option<ValveTruth>,
}

impl Reading {
    /// The readings `sample` at an instant.
    pub fn at(truth: &Truth, sample: Sample<f64>) -> Self {
        Self { t_s: truth.t_s, sample, temp_k: truth.temp_k, valve: truth.valve }
    }

    /// What a channel shows; none where it shows nothing or is not recorded.
    pub fn get(&self, channel: Signal) -> Option<f64> {
        let Self { t_s, sample, temp_k, .. } = self;
        match channel {
            Signal::Time => Some(*t_s),
            Signal::Position => Some(sample.x_m),
            Signal::PressureA => Some(sample.pa_pa),
            Signal::PressureB => Some(sample.pb_pa),
            Signal::FlowA => sample.qa_m3s,
            Signal::FlowB => sample.qb_m3s,
            Signal::Force => sample.force_n,
            Signal::Temperature => *temp_k,
            _ => None,
        }
    }

    /// Makes a channel show something else; a channel that every row must have becomes NaN for nothing.
    pub fn set(&mut self, channel: Signal, value: Option<f64>) {
        let Self { t_s, sample, temp_k, .. } = self;
        let needed = value.unwrap_or(f64::NAN);
        match channel {
            Signal::Time => *t_s = needed,
            Signal::Position => sample.x_m = needed,
            Signal::PressureA => sample.pa_pa = needed,
            Signal::PressureB => sample.pb_pa = needed,
            Signal::FlowA => sample.qa_m3s = value,
            Signal::FlowB => sample.qb_m3s = value,
            Signal::Force => sample.force_n = value,
            Signal::Temperature => *temp_k = value,
            _ => {}
        }
    }
}
