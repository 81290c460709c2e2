use super::read_leak_pressures_pa;
use crate::score::{Kept, LeakScore, Scorer};
use crate::trace::Record;
use pitchleak_core::{Butterworth, Estimate, Leak, PerLeak};

/// The paper's filter of measured leakage, Section IV.
const CUTOFF_HZ: f64 = 5.0;

/// Scores the estimates against the reference leak flows that a trace has, after the paper's filter on
/// reference and pressures.
#[derive(Clone, Copy, Debug, Default, serde::Serialize, serde::Deserialize)]
pub(super) struct Scoring {
    coefficients: PerLeak<f64>,
    pressure_biases_pa: [f64; 2],
    channels: Option<PerLeak<Channel>>,
}

#[derive(Clone, Copy, Debug, serde::Serialize, serde::Deserialize)]
struct Channel {
    scorer: Scorer,
    reference: Butterworth<f64>,
    pressure: Butterworth<f64>,
    by_effects: Butterworth<f64>,
}

impl Scoring {
    /// The coefficients and biases of the pressure sensors that stand from now on.
    pub fn renew(&mut self, coefficients: PerLeak<Estimate<f64>>, pressure_biases_pa: [f64; 2]) {
        self.pressure_biases_pa = pressure_biases_pa;
        self.coefficients = coefficients.map(|coefficient| coefficient.value);
    }

    /// Takes a record, after the estimates were renewed by it, and what the rig file's effects let leak, m³/s.
    #[inline]
    pub fn add(&mut self, record: &Record, by_effects_m3s: PerLeak<f64>) {
        let reference = &record.leak_m3s;
        if reference.internal.or(reference.external_a).or(reference.external_b).is_none() {
            return;
        }
        if self.channels.is_none() && record.dt_s > 0.0 {
            self.channels = Channel::at_rate(1.0 / record.dt_s, record);
        }
        let Some(channels) = &mut self.channels else { return };
        let pressures = read_leak_pressures_pa(record, self.pressure_biases_pa);
        let mut kept = Kept::default();
        for leak in Leak::ALL {
            let estimate = (self.coefficients[leak], by_effects_m3s[leak]);
            channels[leak].add(record.t_s, estimate, reference[leak], pressures[leak], &mut kept);
        }
    }

    /// The scores, where there is a reference.
    pub fn scores(&self) -> Option<PerLeak<Option<LeakScore>>> {
        self.channels.map(|channels| channels.map(|channel| channel.scorer.score()))
    }
}

impl Channel {
    fn at_rate(rate_hz: f64, record: &Record) -> Option<PerLeak<Self>> {
        let filter = Butterworth::new(CUTOFF_HZ.min(0.4 * rate_hz), rate_hz).ok()?;
        Some(read_leak_pressures_pa(record, [0.0; 2]).zip(record.leak_m3s).map(|(start_pa, start_m3s)| {
            let (mut reference, mut pressure, by_effects) = (filter, filter, filter);
            reference.reset(start_m3s.unwrap_or(0.0));
            pressure.reset(start_pa);
            Self { scorer: Scorer::default(), reference, pressure, by_effects }
        }))
    }

    #[inline]
    fn add(
        &mut self,
        t_s: f64,
        (coefficient, by_effects_m3s): (f64, f64),
        reference_m3s: Option<f64>,
        pressure_pa: f64,
        kept: &mut Kept,
    ) {
        let pressure = self.pressure.update(pressure_pa);
        let by_effects = self.by_effects.update(by_effects_m3s);
        if let Some(reference) = reference_m3s {
            let reference = self.reference.update(reference);
            let flows_m3s = [coefficient * pressure, by_effects];
            self.scorer.update_beside(t_s, flows_m3s, coefficient, reference, pressure, kept);
        }
    }
}
