//! One window as the paper's law sees it: everything that does not depend on the gains, once.

use pitchleak::core::{
    Butterworth, Momentum, PaperGains, PaperLaw, PerLeak, Sample, force_imbalance_n, regressors,
};
use pitchleak::simulate::{Biases, Sensing};
use pitchleak_reproduce::{Run, SAMPLE_RATE_HZ, rig};

const CUTOFF_HZ: f64 = 5.0;
const STEP_S: f64 = 1.0 / SAMPLE_RATE_HZ;
/// An estimate counts as converged once it stays as close as the paper's own peak error afterwards, 13.3 %.
const BAND: f64 = 0.133;

/// Load pressure, regressors and the pressures that drive both leaks, behind the paper's filter.
struct Step {
    load_pa: f64,
    f: [f64; 5],
    read_pa: [f64; 2],
    leaks_m3s: [f64; 2],
}

pub struct Window {
    start_pa: f64,
    steps: Vec<Step>,
    truth: [f64; 2],
}

/// Where θ̂ starts and what of it is held.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Oil {
    /// β and m are known and not estimated.
    Known,
    /// β starts a quarter too small, m a quarter too large, and both are estimated too.
    Unknown,
}

/// One leak in one window.
#[derive(Clone, Copy, Debug, Default)]
pub struct Score {
    /// Mean of |Ĉ/C − 1| over the second half.
    pub coefficient: f64,
    /// Mean of |Q̂ − Q| over the second half, over the mean of |Q|.
    pub leakage: f64,
    /// Time from which |Ĉ/C − 1| stays below 13.3 %, s; infinite if it does not.
    pub converged_s: f64,
}

impl Window {
    /// All whole windows of `seconds` of a run, through sensors of `accuracy` (3 σ, share of full scale).
    pub fn all(run: &Run, seconds: usize, accuracy: f64, seed: u64) -> Vec<Self> {
        let mut instruments = rig().instruments;
        instruments = instruments.with_accuracy(accuracy);
        let length = seconds * SAMPLE_RATE_HZ as usize;
        let windows = run.truths.chunks_exact(length).enumerate();
        windows
            .map(|(index, truths)| {
                let mut sensing =
                    Sensing::new(instruments.spread(), Biases::default(), 1000 * seed + index as u64);
                let read = truths.iter().map(|truth| {
                    (sensing.read(&truth.sample), [truth.leaks_m3s.internal, truth.leaks_m3s.external_a])
                });
                Self::of(read.collect(), run.leaks_m3spa)
            })
            .collect()
    }

    fn of(read: Vec<(Sample<f64>, [f64; 2])>, truth: PerLeak<f64>) -> Self {
        let cylinder = rig().cylinder;
        let mut momentum = Momentum::new(cylinder.moving_mass_kg, 0.25 * std::f64::consts::TAU * CUTOFF_HZ);
        let channels = |(sample, leaks): &(Sample<f64>, [f64; 2])| {
            let flow = |q: Option<f64>| q.expect("the rig measures all");
            [
                sample.x_m,
                sample.pa_pa,
                sample.pb_pa,
                flow(sample.qa_m3s),
                flow(sample.qb_m3s),
                flow(sample.force_n),
                leaks[0],
                leaks[1],
            ]
        };
        let mut filters = [Butterworth::new(CUTOFF_HZ, SAMPLE_RATE_HZ).expect("exists"); 8];
        for (filter, value) in filters.iter_mut().zip(channels(&read[0])) {
            filter.reset(value);
        }
        momentum.restart(read[0].0.x_m);
        let steps = read[1..].iter().map(|row| {
            let mut smooth = channels(row);
            for (filter, value) in filters.iter_mut().zip(&mut smooth) {
                *value = filter.update(*value);
            }
            let [x_m, pa_pa, pb_pa, qa, qb, force, internal, external] = smooth;
            let sample =
                Sample { x_m, pa_pa, pb_pa, qa_m3s: Some(qa), qb_m3s: Some(qb), force_n: Some(force) };
            let imbalance = force_imbalance_n(&cylinder, &sample, force);
            let momentum = momentum.update(STEP_S, imbalance, x_m);
            Step {
                load_pa: sample.load_pressure_pa(),
                f: regressors(&cylinder, &sample, momentum).expect("both flows are measured"),
                read_pa: [pa_pa - pb_pa, pa_pa],
                leaks_m3s: [internal, external],
            }
        });
        Self {
            start_pa: read[0].0.load_pressure_pa(),
            steps: steps.collect(),
            truth: [truth.internal, truth.external_a],
        }
    }

    /// The law with these gains on the window.
    pub fn score(&self, gains: &PaperGains<f64>, oil: Oil) -> [Score; 2] {
        let rig = rig();
        let mut law = PaperLaw::new(&rig.cylinder, &rig.fluid, self.start_pa);
        if oil == Oil::Unknown {
            law.theta[0] *= 0.75;
            law.theta[4] *= 0.75 / 1.25;
        }
        let late = self.steps.len() / 2;
        let mut found = [Score::default(); 2];
        let mut sizes = [0.0; 2];
        let mut outside = [self.steps.len(); 2];
        for (k, step) in self.steps.iter().enumerate() {
            law.step(gains, STEP_S, step.load_pa, &step.f);
            let leaks = law.leak_coefficients();
            for (leak, value) in [leaks.internal, leaks.external_a].into_iter().enumerate() {
                let error = (value / self.truth[leak] - 1.0).abs();
                if error.is_nan() || error >= BAND {
                    outside[leak] = k + 1;
                } else if k == 0 {
                    outside[leak] = 0;
                }
                sizes[leak] += step.leaks_m3s[leak].abs();
                if k >= late {
                    found[leak].coefficient += error;
                    found[leak].leakage += (value * step.read_pa[leak] - step.leaks_m3s[leak]).abs();
                }
            }
        }
        let count = (self.steps.len() - late) as f64;
        for leak in 0..2 {
            let mean_size = sizes[leak] / self.steps.len() as f64;
            found[leak].coefficient /= count;
            found[leak].leakage /= count * mean_size;
            let settles = outside[leak] < self.steps.len();
            found[leak].converged_s = if settles { outside[leak] as f64 * STEP_S } else { f64::INFINITY };
        }
        found
    }
}
