use crate::signal::Signal;
use crate::trace::Record;

/// The readings that a mistake concerns.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Readings {
    /// t
    Time,
    /// x
    Position,
    /// P_A
    PressureA,
    /// P_B
    PressureB,
    /// P_A and P_B
    Pressures,
    /// Q_A
    FlowA,
    /// Q_B
    FlowB,
    /// Q_A and Q_B
    Flows,
}

impl Readings {
    /// The signals.
    pub fn signals(self) -> &'static [Signal] {
        match self {
            Self::Time => &[Signal::Time],
            Self::Position => &[Signal::Position],
            Self::PressureA => &[Signal::PressureA],
            Self::PressureB => &[Signal::PressureB],
            Self::Pressures => &[Signal::PressureA, Signal::PressureB],
            Self::FlowA => &[Signal::FlowA],
            Self::FlowB => &[Signal::FlowB],
            Self::Flows => &[Signal::FlowA, Signal::FlowB],
        }
    }

    /// As in a sentence.
    pub fn text(self) -> &'static str {
        match self {
            Self::Time => "t",
            Self::Position => "x",
            Self::PressureA => "pa",
            Self::PressureB => "pb",
            Self::Pressures => "pa and pb",
            Self::FlowA => "qa",
            Self::FlowB => "qb",
            Self::Flows => "qa and qb",
        }
    }

    fn has(self, signal: Signal) -> bool {
        self.signals().contains(&signal)
    }

    /// The record with `change` applied to these readings.
    pub(super) fn map(self, record: &Record, change: impl Fn(f64) -> f64) -> Record {
        let mut out = *record;
        let sample = &mut out.sample;
        if self.has(Signal::Time) {
            out.t_s = change(out.t_s);
            out.dt_s = change(out.dt_s);
        }
        let values = [
            (Signal::Position, Some(&mut sample.x_m)),
            (Signal::PressureA, Some(&mut sample.pa_pa)),
            (Signal::PressureB, Some(&mut sample.pb_pa)),
            (Signal::FlowA, sample.qa_m3s.as_mut()),
            (Signal::FlowB, sample.qb_m3s.as_mut()),
        ];
        for (signal, value) in values {
            if let Some(value) = value.filter(|_| self.has(signal)) {
                *value = change(*value);
            }
        }
        out
    }

    /// `record` with these readings taken from `other`, `share` of the way to `next`.
    pub(super) fn between(self, record: &Record, other: &Record, next: &Record, share: f64) -> Record {
        let (mut out, a, b) = (*record, &other.sample, &next.sample);
        let mix = |a: f64, b: f64| a + share * (b - a);
        let flow = |a: Option<f64>, b: Option<f64>| Some(mix(a?, b?));
        let sample = &mut out.sample;
        if self.has(Signal::Position) {
            sample.x_m = mix(a.x_m, b.x_m);
        }
        if self.has(Signal::PressureA) {
            sample.pa_pa = mix(a.pa_pa, b.pa_pa);
        }
        if self.has(Signal::PressureB) {
            sample.pb_pa = mix(a.pb_pa, b.pb_pa);
        }
        if self.has(Signal::FlowA) {
            sample.qa_m3s = flow(a.qa_m3s, b.qa_m3s);
        }
        if self.has(Signal::FlowB) {
            sample.qb_m3s = flow(a.qb_m3s, b.qb_m3s);
        }
        out
    }
}
