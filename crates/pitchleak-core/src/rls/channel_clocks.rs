//! Samples in which some channels have no reading: they wait until every channel is known.

use super::{Rls, Update};
use crate::continuity::{Integrals, Measured, Next, NoiseStd, PerChannel, Readings, Row, Step, Weights};
use crate::{Real, Sample};

/// Rows that are taken in with one sample: more than come, so that those that waited are caught up with.
///
/// At most one of them ends a block or a renewal, as these are further apart.
const ROWS_AT_ONCE: usize = 2;

impl<T: Real, const N: usize> Rls<T, N> {
    /// Takes in what was read `dt_s` after the readings before, of channels that need not all come at once: between two of its
    /// own readings a channel is the straight line, and its noise is that of its own readings ([`Clocks`](crate::continuity::Clocks)).
    /// A channel without a reading is waited for, for a few steps of its own; then its chamber rests. Where the position or a pressure
    /// is missing for longer, nothing is integrated.
    ///
    /// [`update`](Self::update) does so, too, where a flow has no reading.
    #[cfg_attr(target_os = "none", inline(never))]
    pub fn update_readings(&mut self, dt_s: T, readings: &Readings<T>) -> Update<T> {
        if let Readings { x: Some(x_m), pa: Some(pa_pa), pb: Some(pb_pa), qa: qa_m3s, qb: qb_m3s } = *readings
        {
            return self.update(dt_s, &Sample { x_m, pa_pa, pb_pa, qa_m3s, qb_m3s, force_n: None });
        }
        let (x_limit, pressure_limit, flow_limit) = self.limits();
        let ok = |reading: Option<T>, limit: T| reading.is_none_or(|value| value.abs() <= limit);
        let PerChannel { x, pa, pb, qa, qb } = *readings;
        let plausible = ok(x, x_limit)
            && ok(pa, pressure_limit)
            && ok(pb, pressure_limit)
            && ok(qa, flow_limit)
            && ok(qb, flow_limit);
        if plausible { self.update_on_clocks(dt_s, readings) } else { Update::Rejected }
    }

    /// A flow has no reading at one end of the step to `sample`: it rests, or is waited for if it was read before.
    #[cold]
    pub(super) fn update_without_a_flow(&mut self, dt_s: T, sample: &Sample<T>) -> Update<T> {
        let missing = |last: Option<T>, now: Option<T>| last.is_some() && now.is_none();
        let waits =
            |last: Sample<T>| missing(last.qa_m3s, sample.qa_m3s) || missing(last.qb_m3s, sample.qb_m3s);
        if self.last.is_some_and(waits) {
            self.update_on_clocks(dt_s, &Readings::from(sample))
        } else {
            self.take_row(&Row::read(dt_s, sample))
        }
    }

    #[cold]
    #[cfg_attr(target_os = "none", inline(never))]
    pub(super) fn update_on_clocks(&mut self, dt_s: T, readings: &Readings<T>) -> Update<T> {
        if !self.is_integrable(dt_s) {
            self.last = None;
            self.clocks = self.clocks.anew();
        } else if let Some(last) = self.last.filter(|_| self.clocks.is_empty()) {
            let step_s = Some(self.step_s).filter(|step_s| *step_s > T::zero());
            self.clocks.go_on_after(&last, step_s);
        }
        self.step_s = T::zero();
        self.clocks.push(dt_s, readings);
        let mut update = Update::Accepted;
        for _ in 0..ROWS_AT_ONCE {
            update = match self.clocks.pop() {
                Next::Waits => break,
                Next::Gap => {
                    self.last = None;
                    continue;
                }
                Next::Row(row) => match self.take_row(&row) {
                    Update::Accepted => update,
                    news => news,
                },
            };
        }
        update
    }

    fn take_row(&mut self, row: &Row<T>) -> Update<T> {
        let Some(last) = self.last.replace(row.sample) else { return self.restart(&row.sample) };
        let Step { integrals: step, measured } = Step::between(&self.cylinder, row.dt_s, &last, &row.sample);
        if row.read.pa && row.read.pb && !row.thinned {
            self.pressure_noise.add([last.pa_pa, last.pb_pa], [row.sample.pa_pa, row.sample.pb_pa]);
        } else {
            self.pressure_noise.interrupt();
        }
        if measured == Measured::Neither {
            self.anchor(row.sample.x_m);
        } else {
            let weights = self.weights_of(measured, &diluted(&self.noise, row));
            if measured == Measured::Both {
                self.feed(&step, &weights);
            }
            self.advance(&step, &weights, row.read.x.then_some(row.sample.x_m));
        }
        self.finish(&step)
    }

    /// Adds a step to the balance's, which counts its noise as if every channel had been read with every sample.
    fn feed(&mut self, step: &Integrals<T>, weights: &Weights<T>) {
        let mut step = *step;
        step.time_square *= weights.balance_variance / self.both.balance_variance;
        self.fed.add(&step);
    }
}

/// Noise whose integral over the step at a row's end is that of the channels' own readings.
fn diluted<T: Real>(noise: &NoiseStd<T>, row: &Row<T>) -> NoiseStd<T> {
    let PerChannel { pa, pb, qa, qb, .. } = row.dilution();
    NoiseStd {
        flow_a_m3s: noise.flow_a_m3s * qa.sqrt(),
        flow_b_m3s: noise.flow_b_m3s * qb.sqrt(),
        pressure_pa: noise.pressure_pa * pa.at_least(pb).sqrt(),
        ..*noise
    }
}
