use super::mistake::Mistake;
use super::readings::Readings;
use crate::rig::Rig;
use crate::signal::Signal;
use crate::trace::Record;

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

impl ScatterRatios {
    pub fn of(records: &[Record], rig: &Rig) -> Self {
        let sensors = rig.sensors();
        let channels: [(Signal, f64, Reading); CHANNELS] = [
            (Signal::Position, sensors.position.noise_std, |r| Some(r.sample.x_m)),
            (Signal::PressureA, sensors.pressure.noise_std, |r| Some(r.sample.pa_pa)),
            (Signal::PressureB, sensors.pressure.noise_std, |r| Some(r.sample.pb_pa)),
            (Signal::FlowA, sensors.flow_a.noise_std, |r| r.sample.qa_m3s),
            (Signal::FlowB, sensors.flow_b.noise_std, |r| r.sample.qb_m3s),
        ];
        let ratios = channels.into_iter().filter_map(|(signal, declared, reading)| {
            Some((signal, scatter(records, reading)? / declared)).filter(|(_, ratio)| ratio.is_finite())
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

/// Standard deviation of white noise: third differences cancel a motion's slope and curvature, their median cancels
/// jolts; E Δ³² = 20 σ², and the median of a normal number's size is 0.6745.
fn scatter(records: &[Record], reading: Reading) -> Option<f64> {
    let third = |w: &[Record]| {
        let [a, b, c, d] = w else { return None };
        Some((reading(d)? - 3.0 * reading(c)? + 3.0 * reading(b)? - reading(a)?).abs())
    };
    let mut sizes: Vec<f64> = records.windows(4).filter_map(third).collect();
    let middle = sizes.len() / 2;
    if sizes.is_empty() {
        return None;
    }
    let (_, median, _) = sizes.select_nth_unstable_by(middle, f64::total_cmp);
    Some(*median / (0.6745 * 20f64.sqrt()))
}
