//! How soon a leak that opens raises its alarm, and how often a sound cylinder raises one.

use super::protocol::{ReproduceError, Run, SAMPLE_RATE_HZ, map_counted, reference, rig};
use super::{Law, Progress};
use pitchleak::Rig;
use pitchleak::core::{AlarmState, Leak, PerLeak, RlsError};
use pitchleak::replay::Replay;
use pitchleak::simulate::{Biases, LeakCourse, LeakSize, Scenario, Sensing, Truth};
use pitchleak::trace::Record;
use pitchleak::units::LPM_PER_M3S;
use pitchleak::wind::WindCase;
use serde::Serialize;

/// Sizes of the leaks, L/min at the run's mean pressures.
const SIZES_LPM: [f64; 4] = [0.1, 0.2, 0.5, 1.0];
/// The leak opens so long after the estimator started, s …
const ONSET_S: f64 = 60.0;
/// … and is watched for as long.
const WATCH_S: f64 = 60.0;
/// Seeds per wind, leak and size.
const SEEDS: u64 = 10;
/// Seeds of a sound cylinder whose sensors have biases.
const BIASED_RUNS: u64 = 200;

/// Delay from the onset of a leak to its alarm.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Delay {
    /// Mean wind, m/s.
    pub wind_mps: u32,
    /// Which leak opens.
    pub leak: &'static str,
    /// Its size, L/min.
    pub size_lpm: f64,
    /// Share of the seeds in which its alarm is raised within a minute, %.
    pub detected_percent: f64,
    /// Median delay, s; `null` if fewer than half are detected.
    pub median_delay_s: Option<f64>,
    /// Longest delay, s; `null` if not all are detected.
    pub longest_delay_s: Option<f64>,
    /// Share of the seeds in which another leak's alarm is raised as well, %.
    pub misnamed_percent: f64,
}

/// What the alarms do.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Detection {
    /// Delays by wind, leak and size.
    pub delays: Vec<Delay>,
    /// Hours of sound operation watched, in all four winds.
    pub sound_hours: f64,
    /// Alarms raised in them.
    pub false_alarms: u64,
    /// Runs of a sound cylinder whose sensors have constant biases of up to 1 % of full scale.
    pub biased_runs: u64,
    /// Those among them in which an alarm was raised.
    pub biased_false_alarms: u64,
    /// Share of the 95 % intervals of all leak coefficients at the end of those runs that hold zero, %.
    pub biased_coverage_percent: f64,
}

/// Watches the alarms of the default estimator: delays, and `hours` of sound operation.
///
/// # Errors
/// [`ReproduceError`].
pub fn detection(hours: f64, progress: impl Fn(Progress) + Sync) -> Result<Detection, ReproduceError> {
    let mut jobs = Vec::new();
    for wind in WindCase::ALL {
        for leak in Leak::ALL {
            jobs.extend(SIZES_LPM.map(|size| (wind, leak, size)));
        }
    }
    let delays =
        map_counted("leaks that open", &jobs, &progress, |&(wind, leak, size)| delay(wind, leak, size))?;
    let runs = map_counted("simulating sound cylinders", &WindCase::ALL, &progress, |wind| {
        Run::simulate(*wind, PerLeak::default())
    })?;
    let run_hours = runs.first().map_or(1.0, |run| run.truths.len() as f64 / SAMPLE_RATE_HZ / 3600.0);
    let count = (hours / run_hours).ceil() as u64;
    let (plain, biased) = (Law::default_estimator(), Law::with_biases());
    let sound: Vec<(&Law, u64)> =
        (0..count).map(|seed| (&plain, seed)).chain((0..BIASED_RUNS).map(|seed| (&biased, seed))).collect();
    let watched = map_counted("watching sound cylinders", &sound, &progress, |(law, seed)| {
        let run = runs.get(*seed as usize % runs.len()).ok_or(ReproduceError::Empty)?;
        let biases = Biases::drawn(&law.rig.instruments, law.bias_share, *seed);
        Ok(Watch::over(&law.rig, &run.truths, Sensing::new(law.rig.sensors(), biases, *seed))?)
    })?;
    let (plain, biased) = watched.split_at(count as usize);
    let held: usize = biased.iter().map(|watch| watch.intervals_with_zero).sum();
    Ok(Detection {
        delays,
        sound_hours: count as f64 * run_hours,
        false_alarms: plain.iter().map(|watch| watch.raised.len() as u64).sum(),
        biased_runs: BIASED_RUNS,
        biased_false_alarms: biased.iter().filter(|watch| !watch.raised.is_empty()).count() as u64,
        biased_coverage_percent: 100.0 * held as f64 / (Leak::ALL.len() * biased.len()).max(1) as f64,
    })
}

/// What happened over one run.
struct Watch {
    /// Leaks whose alarm was raised, and when, s.
    raised: Vec<(Leak, f64)>,
    /// How many of the leaks' 95 % intervals hold zero at the end.
    intervals_with_zero: usize,
}

impl Watch {
    fn over(rig: &Rig, truths: &[Truth], mut sensing: Sensing) -> Result<Self, RlsError> {
        let mut replay = Replay::new(rig)?;
        for (index, truth) in truths.iter().enumerate() {
            let dt_s = if index == 0 { 0.0 } else { 1.0 / SAMPLE_RATE_HZ };
            let sample = sensing.read(&truth.sample);
            replay.push(&Record { t_s: truth.t_s, dt_s, sample, ..Record::default() });
        }
        let raised = replay.alarms().iter().filter(|alarm| alarm.state == AlarmState::Raised);
        let raised = raised.map(|alarm| (alarm.fault, alarm.time_s)).collect();
        let coefficients = replay.estimator().leak_coefficients();
        let holds_zero = |[low, high]: [f64; 2]| low <= 0.0 && high >= 0.0;
        let intervals_with_zero = coefficients.iter().filter(|(_, c)| holds_zero(c.ci95())).count();
        Ok(Self { raised, intervals_with_zero })
    }
}

fn delay(wind: WindCase, leak: Leak, size_lpm: f64) -> Result<Delay, ReproduceError> {
    let rig = rig();
    let size = |which| {
        let size = LeakSize::MeanFlow(if which == leak { size_lpm / LPM_PER_M3S } else { 0.0 });
        LeakCourse::from_onset(size, ONSET_S)
    };
    let scenario = Scenario {
        leaks: PerLeak::from_fn(size),
        duration_s: ONSET_S + WATCH_S,
        sample_rate_hz: SAMPLE_RATE_HZ,
        ..Scenario::new(rig.clone(), reference(wind, &rig)?)
    };
    // The mean is taken where the leak is open.
    let open = Scenario { start_s: 10.0 + ONSET_S, ..scenario.clone() };
    let truths = scenario.collect(open.leak_coefficients()?)?;
    let mut delays = Vec::new();
    let mut misnamed = 0;
    for seed in 0..SEEDS {
        let watch = Watch::over(&rig, &truths, Sensing::new(rig.sensors(), Biases::default(), seed))?;
        let own = watch.raised.iter().find(|(which, t_s)| *which == leak && *t_s >= ONSET_S);
        delays.push(own.map_or(f64::INFINITY, |(_, t_s)| t_s - ONSET_S));
        misnamed += u64::from(watch.raised.iter().any(|(which, _)| *which != leak));
    }
    delays.sort_by(f64::total_cmp);
    let at = |index: usize| delays.get(index).copied().filter(|delay| delay.is_finite());
    let detected = delays.iter().filter(|delay| delay.is_finite()).count();
    Ok(Delay {
        wind_mps: wind.mean_mps(),
        leak: leak.id(),
        size_lpm,
        detected_percent: 100.0 * detected as f64 / SEEDS as f64,
        median_delay_s: at(delays.len() / 2),
        longest_delay_s: at(delays.len() - 1),
        misnamed_percent: 100.0 * misnamed as f64 / SEEDS as f64,
    })
}

impl Detection {
    pub(super) fn to_text(&self) -> String {
        let mut out = String::from(
            "\nDelay from the onset of a leak to its alarm, s: median (longest), share detected in a minute\n",
        );
        for row in &self.delays {
            let seconds = |delay: Option<f64>| delay.map_or_else(|| "-".into(), |s| format!("{s:.1}"));
            out += &format!(
                "{:>4} m/s  {:<10}  {:>4.1} L/min: {:>5} ({:>5})  {:>3.0} %{}\n",
                row.wind_mps,
                row.leak,
                row.size_lpm,
                seconds(row.median_delay_s),
                seconds(row.longest_delay_s),
                row.detected_percent,
                if row.misnamed_percent > 0.0 {
                    format!("  another leak named as well in {:.0} %", row.misnamed_percent)
                } else {
                    String::new()
                }
            );
        }
        out + &format!(
            "False alarms in {:.1} h of sound operation: {}\nWith biases: {} of {} sound runs raised an alarm; {:.1} % of the 95 % intervals hold zero\n",
            self.sound_hours,
            self.false_alarms,
            self.biased_false_alarms,
            self.biased_runs,
            self.biased_coverage_percent
        )
    }
}
