//! What a motion can tell of a leak at best, and what the estimator makes of it.

use crate::Failure;
use pitchleak::Rig;
use pitchleak::core::{Estimate, Leak, PerLeak, Rls, RlsSettings, Sample, SensorSpread, Sensors};
use pitchleak::simulate::{Biases, LeakSize, Scenario, Sensing, SimulateError, Truth};
use pitchleak::wind::{Emulation, History, Wind, WindCase};
use pitchleak_reproduce::cramer_rao::{CramerRao, CramerRaoModel, PARAMETERS};

/// How long is recorded, in steps of [`STEP_S`].
pub const PERIODS: [(&str, u32); 3] = [("a minute", 6), ("an hour", 360), ("a day", 8640)];
/// In which zeros drift, s.
const STEP_S: f64 = 10.0;
/// Steps that are simulated; what they tell on average, all that follow tell too.
const SIMULATED: u32 = 12;
/// A leak this many standard deviations large has its 95 % interval above zero in 95 of 100 recordings: 1.96 + 1.64.
const FOUND_SIGMA: f64 = 3.6;
/// Places of the flow meters' zeros among the bound's parameters.
const ZEROS: [usize; 2] = [4, 5];
/// What the rig leaks, m³/(s·Pa).
const LEAKS: PerLeak<f64> = PerLeak { internal: 1e-11, external_a: 3e-12, external_b: 1e-12 };

type Information = nalgebra::SMatrix<f64, PARAMETERS, PARAMETERS>;

/// A cylinder in the wind, sampled without noise.
pub struct Motion {
    rig: Rig,
    rate_hz: f64,
    truths: Vec<Truth>,
}

/// The smallest leak that is found, wherever it is, m³/s.
pub struct Limits {
    /// At best, by period: from the Cramér–Rao bound.
    pub bound_m3s: [f64; PERIODS.len()],
    /// By what the estimator says of itself after a minute of noisy readings.
    pub estimated_m3s: f64,
}

impl Motion {
    pub fn of(wind: WindCase, rate_hz: f64) -> Result<Self, SimulateError> {
        let rig = Rig::paper();
        let history = History::of(&Wind::BuiltIn(wind)).expect("is built in");
        let reference = Emulation::paper().reference(&history, rig.cylinder.stroke_m).expect("fits the rig");
        let scenario = Scenario {
            leaks: LEAKS.map(|leak| LeakSize::Coefficient(leak).into()),
            duration_s: STEP_S * f64::from(SIMULATED),
            sample_rate_hz: rate_hz,
            ..Scenario::new(rig.clone(), reference)
        };
        Ok(Self { rig, rate_hz, truths: scenario.collect(LEAKS)? })
    }

    pub fn limits(&self, sensors: &Sensors<f64>) -> Result<Limits, Failure> {
        let pressures_pa = self.mean_pressures_pa();
        let largest = |std: &dyn Fn(Leak) -> f64| {
            Leak::ALL.iter().map(|leak| FOUND_SIGMA * std(*leak)).fold(0.0, f64::max)
        };
        let bounds = self.leak_std(sensors).ok_or("this motion tells nothing")?;
        let estimated = self.estimated(sensors)?;
        Ok(Limits {
            bound_m3s: bounds.map(|std| largest(&|leak| std[leak] * pressures_pa[leak])),
            estimated_m3s: largest(&|leak| estimated[leak].std),
        })
    }

    /// Standard deviations of the leak coefficients after each period, m³/(s·Pa).
    fn leak_std(&self, sensors: &Sensors<f64>) -> Option<[PerLeak<f64>; PERIODS.len()]> {
        let Rig { cylinder, fluid, .. } = &self.rig;
        let model = CramerRaoModel { cylinder, fluid, sensors, leaks: &LEAKS };
        let samples: Vec<Sample<f64>> = self.truths.iter().map(|truth| truth.sample).collect();
        let by_step = model.history(1.0 / self.rate_hz, &samples, (STEP_S * self.rate_hz) as usize - 1)?;
        let (first, last): (&CramerRao, &CramerRao) = (by_step.first()?, by_step.last()?);
        let told = |bound: &CramerRao| bound.covariance.try_inverse();
        let a_step = (told(last)? - told(first)?) / (by_step.len() - 1) as f64;
        let units = model.units();
        let drifted = |spread: &SensorSpread<f64>, zero: usize, step: u32| {
            // As in the estimator: a straight line's variance in the first hour, a walk from then on.
            let share = |step: u32| {
                let hours = STEP_S * f64::from(step) / 3600.0;
                if hours <= 1.0 { hours * hours } else { 2.0 * hours - 1.0 }
            };
            (spread.drift_std_ph / units[zero]).powi(2) * (share(step + 1) - share(step))
        };
        let (mut covariance, mut step) = (first.covariance, 1);
        let mut after = |steps: u32| -> Option<PerLeak<f64>> {
            while step < steps {
                for (zero, spread) in ZEROS.into_iter().zip([&sensors.flow_a, &sensors.flow_b]) {
                    covariance[(zero, zero)] += drifted(spread, zero, step);
                }
                let information: Information = covariance.try_inverse()? + a_step;
                covariance = information.try_inverse()?;
                step += 1;
            }
            let std = |place: usize| units[place] * covariance[(place, place)].sqrt();
            Some(PerLeak { internal: std(1), external_a: std(2), external_b: std(3) })
        };
        let [(_, a_minute), (_, an_hour), (_, a_day)] = PERIODS;
        Some([after(a_minute)?, after(an_hour)?, after(a_day)?])
    }

    /// Mean flows of the leaks as the estimator finds them in the first minute.
    fn estimated(&self, sensors: &Sensors<f64>) -> Result<PerLeak<Estimate<f64>>, Failure> {
        let zeros_known = sensors.flow_a.bias_std + sensors.flow_a.drift_std_ph <= 0.0;
        if zeros_known { self.run::<4>(sensors) } else { self.run::<6>(sensors) }
    }

    fn run<const N: usize>(&self, sensors: &Sensors<f64>) -> Result<PerLeak<Estimate<f64>>, Failure> {
        let Rig { cylinder, fluid, .. } = self.rig;
        let mut rls = Rls::<f64, N>::new(cylinder, fluid, sensors, RlsSettings::default())?;
        let mut sensing = Sensing::new(*sensors, Biases::default(), 1);
        for truth in self.truths.iter().take_while(|truth| truth.t_s < 60.0) {
            rls.update(1.0 / self.rate_hz, &sensing.read(&truth.sample));
        }
        Ok(rls.estimates().mean_leaks_m3s)
    }

    /// Means of |P_L|, P_A, P_B, Pa.
    fn mean_pressures_pa(&self) -> PerLeak<f64> {
        let count = self.truths.len() as f64;
        let mean = |of: &dyn Fn(&Sample<f64>) -> f64| {
            self.truths.iter().map(|truth| of(&truth.sample)).sum::<f64>() / count
        };
        PerLeak {
            internal: mean(&|sample| sample.load_pressure_pa().abs()),
            external_a: mean(&|sample| sample.pa_pa),
            external_b: mean(&|sample| sample.pb_pa),
        }
    }
}
