use super::SCATTER_ROWS;
use super::mistake::Mistake;
use super::readings::Readings;
use super::running_median::RunningMedian;
use crate::rig::Rig;
use crate::signal::Signal;
use crate::trace::Record;
use serde::{Deserialize, Serialize};

/// One reading of a record.
type Reading = fn(&Record) -> Option<f64>;

/// Scatter within this factor of the declared noise is the declared noise.
const AGREES: f64 = 1.6;

/// Scatter that alone has to betray a mistake: within this factor of what it would be, …
const BETRAYS: f64 = 1.06;
/// … where that of the others is within this factor of the declared one.
const OTHERS_AGREE: f64 = 1.12;

/// What the sensors' scatter says of a mistake.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Verdict {
    /// The readings scatter as declared as they are: they have not been scaled.
    Against,
    /// Nothing.
    Silent,
    /// The readings scatter as declared once they are mended.
    For,
}

/// Position, pressures, flows.
const CHANNELS: usize = 5;

/// The scatter of each sensor's readings over the declared noise.
pub(super) struct ScatterRatios(Vec<(Signal, f64)>);

/// The channels.
const READINGS: [(Signal, Reading); CHANNELS] = [
    (Signal::Position, |r| Some(r.sample.x_m)),
    (Signal::PressureA, |r| Some(r.sample.pa_pa)),
    (Signal::PressureB, |r| Some(r.sample.pb_pa)),
    (Signal::FlowA, |r| r.sample.qa_m3s),
    (Signal::FlowB, |r| r.sample.qb_m3s),
];

impl ScatterRatios {
    pub fn of(records: &[Record], rig: &Rig) -> Self {
        Self::new(READINGS.map(|(_, reading)| scatter(records, reading)), rig)
    }

    /// Of the standard deviations of the channels' white noise, where they are known.
    fn new(scatter: [Option<f64>; CHANNELS], rig: &Rig) -> Self {
        let sensors = rig.sensors();
        let declared = [sensors.position, sensors.pressure, sensors.pressure, sensors.flow_a, sensors.flow_b];
        let channels = READINGS.iter().zip(scatter).zip(declared);
        let ratios = channels.filter_map(|(((signal, _), scatter), declared)| {
            Some((*signal, scatter? / declared.noise_std)).filter(|(_, ratio)| ratio.is_finite())
        });
        Self(ratios.collect())
    }

    /// The scatter of the readings that `mistake` scales, over the declared one, where it alone betrays the mistake.
    pub fn betrays(&self, mistake: Mistake) -> Option<f64> {
        let Mistake::Scaled(readings, factor) = mistake else { return None };
        let within = |ratio: f64, bound: f64| (1.0 / bound..=bound).contains(&ratio);
        let (scaled, others): (Vec<_>, Vec<_>) =
            self.0.iter().partition(|(signal, _)| readings.signals().contains(signal));
        let all = scaled.len() == readings.signals().len() && others.len() + scaled.len() == CHANNELS;
        let betrayed = all
            && scaled.iter().all(|(_, ratio)| within(ratio / factor, BETRAYS))
            && others.iter().all(|(_, ratio)| within(*ratio, OTHERS_AGREE));
        betrayed.then(|| scaled.first().map(|(_, ratio)| *ratio)).flatten()
    }

    /// What the scatter says of `mistake`. Only factors change it, and time in another unit scales no reading.
    pub fn verdict(&self, mistake: Mistake) -> Verdict {
        let Mistake::Scaled(readings, factor) = mistake else { return Verdict::Silent };
        let scaled = || self.0.iter().filter(|(signal, _)| readings.signals().contains(signal));
        let agrees = |ratio: f64| (1.0 / AGREES..=AGREES).contains(&ratio);
        if readings == Readings::Time {
            Verdict::Silent
        } else if scaled().any(|(_, ratio)| agrees(*ratio)) {
            Verdict::Against
        } else if scaled().all(|(_, ratio)| agrees(ratio / factor)) {
            Verdict::For
        } else {
            Verdict::Silent
        }
    }
}

/// What the median size of third differences is of white noise of standard deviation 1: they cancel a motion's slope and
/// curvature, their median cancels jolts; E Δ³² = 20 σ², and the median of a normal number's size is 0.6745.
const MEDIAN_SIZE: f64 = 0.6745 * 4.472_135_954_999_58;

fn third_difference([a, b, c, d]: [f64; 4]) -> f64 {
    d - 3.0 * c + 3.0 * b - a
}

/// Standard deviation of white noise.
fn scatter(records: &[Record], reading: Reading) -> Option<f64> {
    let third = |w: &[Record]| {
        let [a, b, c, d] = w else { return None };
        Some(third_difference([reading(a)?, reading(b)?, reading(c)?, reading(d)?]).abs())
    };
    let mut sizes: Vec<f64> = records.windows(4).filter_map(third).collect();
    let middle = sizes.len() / 2;
    if sizes.is_empty() {
        return None;
    }
    let (_, median, _) = sizes.select_nth_unstable_by(middle, f64::total_cmp);
    Some(*median / MEDIAN_SIZE)
}

/// Scatter of a stream, half a minute at a time, in constant memory.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(super) struct RunningScatter {
    channels: [RunningChannel; CHANNELS],
    rows: usize,
    /// Of the half minute before.
    before: Option<[Option<f64>; CHANNELS]>,
}

#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
struct RunningChannel {
    last: [Option<f64>; 3],
    third_differences: RunningMedian,
}

impl RunningScatter {
    pub fn add(&mut self, record: &Record) {
        for ((_, reading), channel) in READINGS.iter().zip(&mut self.channels) {
            channel.add(reading(record));
        }
        self.rows = self.rows.saturating_add(1);
        if self.rows >= SCATTER_ROWS {
            *self = Self { before: Some(self.scatter()), ..Self::default() };
        }
    }

    fn scatter(&self) -> [Option<f64>; CHANNELS] {
        self.channels.map(|channel| Some(channel.third_differences.value()? / MEDIAN_SIZE))
    }

    pub fn ratios(&self, rig: &Rig) -> ScatterRatios {
        ScatterRatios::new(self.before.unwrap_or_else(|| self.scatter()), rig)
    }
}

impl RunningChannel {
    fn add(&mut self, reading: Option<f64>) {
        let [a, b, c] = self.last;
        if let (Some(a), Some(b), Some(c), Some(d)) = (a, b, c, reading) {
            self.third_differences.add(third_difference([a, b, c, d]).abs());
        }
        self.last = [b, c, reading];
    }
}
