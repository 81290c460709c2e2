//! What a stream without end keeps to tell mistakes that the continuity equations do not: the force balance of its last
//! minute or two, and how its readings scatter.

use super::blocks::Gatherer;
use super::explanation::Explanation;
use super::force::{ForceBalance, ForceSums};
use super::noise::RunningScatter;
use super::{exchanged_so_far, unit_betrayed};
use crate::rig::Rig;
use crate::trace::Record;
use serde::{Deserialize, Serialize};

/// What a stream keeps.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Running {
    gatherer: Gatherer,
    last_s: Option<f64>,
    /// The stretch that goes on, and the one before it.
    now: ForceSums,
    before: ForceSums,
    blocks: u32,
    scatter: RunningScatter,
}

/// Blocks of a stretch: a minute, or longer where samples come so slowly that a block does.
const STRETCH_BLOCKS: u32 = 240;
/// After a longer pause what was before it is forgotten, s.
const MOST_APART_S: f64 = 600.0;

impl Running {
    /// Takes in the next record.
    pub fn add(&mut self, record: &Record, rig: &Rig) {
        if self.last_s.is_some_and(|last_s| !(0.0..MOST_APART_S).contains(&(record.t_s - last_s))) {
            *self = Self { scatter: std::mem::take(&mut self.scatter), ..Self::default() };
        }
        // Rows before it may have been left out.
        let dt_s = self.last_s.replace(record.t_s).map_or(record.dt_s, |last_s| record.t_s - last_s);
        self.scatter.add(record);
        if let Some(block) = self.gatherer.add(&Record { dt_s, ..*record }, &rig.cylinder) {
            if self.blocks >= STRETCH_BLOCKS {
                self.before = std::mem::take(&mut self.now);
                self.blocks = 0;
            }
            self.now.add(&block);
            self.blocks += 1;
        }
    }

    /// The unit that flows come in, where they are read in another one, as [`unit_by_scatter`](super::unit_by_scatter), else
    /// exchanged pressures as the load force tells them.
    pub fn explanation(&self, rig: &Rig) -> Option<Explanation> {
        let unit = unit_betrayed(&self.scatter.ratios(rig));
        unit.or_else(|| {
            exchanged_so_far(&ForceBalance::of(&ForceSums::of([&self.before, &self.now].into_iter()), rig)?)
        })
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::simulate::Normal;
    use pitchleak_core::PerLeak;
    use pitchleak_testkit::Motion;

    const LEAKS: PerLeak<f64> = PerLeak { internal: 1e-11, external_a: 0.0, external_b: 0.0 };

    fn rig() -> Rig {
        let mut rig = Rig::paper();
        rig.instruments = rig.instruments.with_accuracy(3e-3);
        rig
    }

    /// With the noise of the rig's sensors.
    fn records(seconds: u32) -> Vec<Record> {
        let (sensors, mut normal) = (rig().sensors(), Normal::stream(1, 0));
        let noisy = |(k, mut sample): (usize, pitchleak_core::Sample<f64>)| {
            let mut noise = |std: f64| std * normal.draw();
            sample.x_m += noise(sensors.position.noise_std);
            sample.pa_pa += noise(sensors.pressure.noise_std);
            sample.pb_pa += noise(sensors.pressure.noise_std);
            sample.qa_m3s = sample.qa_m3s.map(|flow| flow + noise(sensors.flow_a.noise_std));
            sample.qb_m3s = sample.qb_m3s.map(|flow| flow + noise(sensors.flow_b.noise_std));
            let dt_s = if k == 0 { 0.0 } else { 0.01 };
            Record { t_s: 0.01 * k as f64, dt_s, sample, ..Record::default() }
        };
        Motion::wind_like(LEAKS).samples(seconds).into_iter().enumerate().map(noisy).collect()
    }

    fn running(records: &[Record], rig: &Rig) -> Running {
        let mut running = Running::default();
        records.iter().for_each(|record| running.add(record, rig));
        running
    }

    #[test]
    fn ten_minutes_take_no_more_than_two() {
        let rig = rig();
        let size = |seconds| {
            let mut bytes = Vec::new();
            ciborium::into_writer(&running(&records(seconds), &rig), &mut bytes).unwrap();
            bytes.len()
        };
        assert!(size(600) < size(120) + 100);
    }

    /// Litres read as gallons scatter as much less than declared.
    #[test]
    fn the_unit_of_the_flows_is_known_by_their_scatter() {
        let rig = rig();
        let mut records = records(40);
        assert!(running(&records, &rig).explanation(&rig).is_none());
        for record in &mut records {
            let s = &mut record.sample;
            (s.qa_m3s, s.qb_m3s) = (s.qa_m3s.map(|q| q / 3.785_411_784), s.qb_m3s.map(|q| q / 3.785_411_784));
        }
        assert!(running(&records, &rig).explanation(&rig).is_some());
    }
}
