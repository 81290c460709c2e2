//! What a stream without end keeps to weigh its verdict by, in constant memory: the equations of its last minute or two,
//! and how its readings scatter.

use super::blocks::Gatherer;
use super::continuity::Continuity;
use super::equations::{BothSums, Driven, Equations, Noise};
use super::explanation::Explanation;
use super::fit::Fit;
use super::force::{ForceBalance, ForceSums};
use super::noise::RunningScatter;
use super::priors::Priors;
use super::unit_betrayed;
use crate::rig::Rig;
use crate::trace::Record;
use pitchleak_core::{Leak, PerLeak};
use serde::{Deserialize, Serialize};
use std::sync::OnceLock;

/// What a stream keeps.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Running {
    gatherer: Gatherer,
    last_s: Option<f64>,
    /// The stretch that goes on, and the one before it.
    now: Equations,
    before: Equations,
    scatter: RunningScatter,
}

/// Blocks of a stretch: a minute, or longer where samples come so slowly that a block does; what a file's excerpt holds at
/// 100 Hz.
const STRETCH_BLOCKS: u32 = 240;
/// After a longer pause the stretch before it is forgotten, s.
const MOST_APART_S: f64 = 600.0;

impl Running {
    /// Takes in the next record; pressure noise reaches the equations through leaks of these coefficients, m³/(s·Pa).
    pub fn add(&mut self, record: &Record, rig: &Rig, leaks: impl FnOnce() -> PerLeak<f64>) {
        if self.last_s.is_some_and(|last_s| record.t_s < last_s) {
            self.restart();
        }
        // Rows before it may have been left out.
        let dt_s = self.last_s.replace(record.t_s).map_or(record.dt_s, |last_s| record.t_s - last_s);
        self.scatter.add(record);
        if let Some(block) = self.gatherer.add(&Record { dt_s, ..*record }, &rig.cylinder) {
            if self.now.blocks() >= STRETCH_BLOCKS {
                self.before = std::mem::take(&mut self.now);
            }
            self.now.add(&block, &Noise::new(rig, leaks()));
        }
    }

    /// The leaks have changed at once, or time begins anew: what was before says nothing of what is now.
    pub fn restart(&mut self) {
        *self = Self { scatter: std::mem::take(&mut self.scatter), ..Self::default() };
    }

    /// The unit that flows come in, where they are read in another one: as [`unit_by_scatter`](super::unit_by_scatter).
    pub fn unit_by_scatter(&self, rig: &Rig) -> Option<Explanation> {
        unit_betrayed(&self.scatter.ratios(rig))
    }

    /// Its last minute or two.
    pub(crate) fn stretch<'a>(&'a self, rig: &'a Rig) -> RunningStretch<'a> {
        let follows =
            |[_, end_s]: [f64; 2], [begin_s, _]: [f64; 2]| (0.0..MOST_APART_S).contains(&(begin_s - end_s));
        let spans = self.before.span_s().zip(self.now.span_s());
        let before = spans.is_some_and(|(before, now)| follows(before, now)).then_some(&self.before);
        RunningStretch { parts: before.into_iter().chain([&self.now]).collect(), rig, sums: OnceLock::new() }
    }
}

/// The last minute or two of a stream.
pub(crate) struct RunningStretch<'a> {
    parts: Vec<&'a Equations>,
    rig: &'a Rig,
    /// Of the parts, for the first fit and all others.
    sums: OnceLock<BothSums>,
}

impl Continuity for RunningStretch<'_> {
    fn fit_of_any_length(&self, priors: &Priors) -> Option<Fit> {
        let sums = self.sums.get_or_init(|| BothSums::of(&self.parts));
        Fit::of(sums, self.rig, priors)
    }

    fn rig(&self) -> &Rig {
        self.rig
    }

    fn duration_s(&self) -> f64 {
        let spans = || self.parts.iter().filter_map(|part| part.span_s());
        let ends = spans().next().zip(spans().next_back());
        ends.map_or(0.0, |([begin_s, _], [_, end_s])| end_s - begin_s)
    }

    fn driven(&self, leak: Leak) -> Driven {
        Driven::of(&self.parts, leak)
    }

    fn force_balance(&self) -> Option<ForceBalance> {
        ForceBalance::of(&ForceSums::of(self.parts.iter().map(|part| &part.force)), self.rig)
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::super::{Recorded, changing_leaks_or_zeros};
    use super::*;
    use crate::simulate::Normal;
    use pitchleak_testkit::Motion;

    const LEAKS: PerLeak<f64> = PerLeak { internal: 1e-11, external_a: 0.0, external_b: 0.0 };

    fn rig() -> Rig {
        let mut rig = Rig::paper();
        rig.instruments = rig.instruments.with_accuracy(3e-3);
        rig
    }

    /// With the noise of the rig's sensors, and a zero of meter A that is off, m³/s.
    fn records(seconds: u32, zero_m3s: f64) -> Vec<Record> {
        let (sensors, mut normal) = (rig().sensors(), Normal::stream(1, 0));
        let noisy = |(k, mut sample): (usize, pitchleak_core::Sample<f64>)| {
            let mut noise = |std: f64| std * normal.draw();
            sample.x_m += noise(sensors.position.noise_std);
            sample.pa_pa += noise(sensors.pressure.noise_std);
            sample.pb_pa += noise(sensors.pressure.noise_std);
            sample.qa_m3s = sample.qa_m3s.map(|flow| flow + zero_m3s + noise(sensors.flow_a.noise_std));
            sample.qb_m3s = sample.qb_m3s.map(|flow| flow + noise(sensors.flow_b.noise_std));
            let dt_s = if k == 0 { 0.0 } else { 0.01 };
            Record { t_s: 0.01 * k as f64, dt_s, sample, ..Record::default() }
        };
        Motion::wind_like(LEAKS).samples(seconds).into_iter().enumerate().map(noisy).collect()
    }

    fn running(records: &[Record], rig: &Rig) -> Running {
        let mut running = Running::default();
        records.iter().for_each(|record| running.add(record, rig, || LEAKS));
        running
    }

    /// Also where it has begun its second stretch.
    #[test]
    fn a_stream_says_what_a_file_of_the_same_samples_says() {
        for seconds in [50, 100] {
            let (rig, records) = (rig(), records(seconds, 5e-6));
            let running = running(&records, &rig);
            let stretch = running.stretch(&rig);
            assert_eq!(stretch.parts.len(), if seconds > 60 { 2 } else { 1 });
            let live = changing_leaks_or_zeros(&stretch).unwrap();
            let file = changing_leaks_or_zeros(&Recorded::new(&records, &rig).unwrap()).unwrap();
            let close = |live: f64, file: f64| assert!((live / file - 1.0).abs() < 0.02, "{live} {file}");
            // In a file's fits the pressures' noise goes through the leaks that each of them finds.
            let near = |live: f64, file: f64| assert!((live / file - 1.0).abs() < 0.2, "{live} {file}");
            near(live.for_leak.internal, file.for_leak.internal);
            near(live.for_zeros, file.for_zeros);
            let (live, file) = (live.single[0].unwrap(), file.single[0].unwrap());
            close(live.offset_m3s.value, file.offset_m3s.value);
            close(live.offset_m3s.value, 5e-6);
            near(live.drop, file.drop);
        }
    }

    #[test]
    fn ten_minutes_take_no_more_than_two() {
        let rig = rig();
        let size = |seconds| {
            let mut bytes = Vec::new();
            ciborium::into_writer(&running(&records(seconds, 0.0), &rig), &mut bytes).unwrap();
            bytes.len()
        };
        assert!(size(600) < size(120) + 100);
        let long = running(&records(600, 0.0), &rig);
        assert!((60.0..121.0).contains(&long.stretch(&rig).duration_s()));
    }

    #[test]
    fn what_was_before_the_leaks_changed_counts_no_longer() {
        let rig = rig();
        let mut running = running(&records(100, 0.0), &rig);
        running.restart();
        let check = changing_leaks_or_zeros(&running.stretch(&rig)).unwrap();
        assert!(check.for_leak.iter().all(|(_, better)| better.abs() < 1e-9), "{check:?}");
        assert!(running.unit_by_scatter(&rig).is_none());
    }

    /// Litres read as gallons scatter as much less than declared.
    #[test]
    fn the_unit_of_the_flows_is_known_by_their_scatter() {
        let rig = rig();
        let mut records = records(40, 0.0);
        assert!(running(&records, &rig).unit_by_scatter(&rig).is_none());
        for record in &mut records {
            let s = &mut record.sample;
            (s.qa_m3s, s.qb_m3s) = (s.qa_m3s.map(|q| q / 3.785_411_784), s.qb_m3s.map(|q| q / 3.785_411_784));
        }
        assert!(running(&records, &rig).unit_by_scatter(&rig).is_some());
    }
}
