//! The default estimator: recursive generalised least squares on both continuity equations.
//!
//! Per chamber eq. (1) is linear in 1/β, C_ip, C_epA and C_epB. The two equations are split into a
//! *balance*, in which the piston speed cancels and only flow meters and pressures speak, and an
//! *odometer*, which carries the piston by the flows and is compared with the position sensor
//! ([`weights`]). Both are whitened by the declared sensor noise, so their sum is the likelihood:
//! - the balance is summed over blocks of a quarter of a second; the noise of the pressures in its columns
//!   (errors in variables) then averages out instead of biasing the leaks;
//! - the odometer's innovations are white by a scalar Kalman filter on the piston position ([`position_filter`]),
//!   and its columns are smooth by nature.
//!
//! How fast the leaks change is learnt: a bank of hypotheses, from leaks that stay to leaks whose trend lasts for
//! a few seconds, is weighed by how well each foretells the data ([`model_bank`]).
//!
//! Time and memory per sample are constant; nothing is ever differentiated.

mod block;
mod block_end;
mod change_detector;
mod channel_clocks;
mod error;
mod estimates;
mod evidence;
mod excitation;
mod information;
mod innovation_monitor;
mod mixture;
mod model_bank;
mod offset_prior;
mod parameter;
mod position_filter;
mod prior;
mod settings;
mod trend;
mod update;
mod zeros;

use crate::continuity::{
    BlockPressures, Clocks, Integrals, Measured, MovingAverage, NoiseStd, PressureMeans, PressureNoise,
    Readings, Step, Weights, combine,
};
use crate::{Cylinder, Fluid, PerLeak, Real, Sample, Sensors};
use block::{BALANCES, Balance, BlockSums};
use change_detector::ChangeDetector;
pub use error::RlsError;
pub use estimates::Estimates;
pub use excitation::{Excitation, ExcitationReport, ExcitationSettings};
use information::{Prior, Solution};
use innovation_monitor::InnovationMonitor;
use model_bank::{ModelBank, STEPS};
use offset_prior::OffsetPrior;
use parameter::LEAKS;
pub use parameter::Parameter;
use position_filter::PositionFilter;
use prior::{offset_units, prior_spread};
pub use settings::RlsSettings;
pub use update::{Innovation, Update};
use zeros::Zeros;

/// Memory of the mean pressures at which leak flows are quoted, and of the innovations' size, s.
const AVERAGING_S: f64 = 60.0;

/// Least number of steps of a block, however slowly samples come: a renewal ends before the next block does.
const LEAST_STEPS: f64 = 8.0;
const _: () = assert!((STEPS as f64) < LEAST_STEPS);

/// Recursive generalised least squares on both chambers, with N parameters:
/// - N = 4: 1/β and the three leak coefficients;
/// - N = 6: also the offsets of the two flow meters;
/// - N = 9: also the gains of both flow meters and of the position sensor.
///
/// There is no estimator of any other size:
///
/// ```compile_fail
/// # use pitchleak_core::{Cylinder, Fluid, Rls, RlsSettings, Sensors};
/// Rls::<f64, 5>::new(Cylinder::paper(), Fluid::paper(), &Sensors::paper(), RlsSettings::default());
/// ```
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(
    feature = "serde",
    serde(bound(
        serialize = "T: serde::Serialize + Copy",
        deserialize = "T: Real + serde::Deserialize<'de>"
    ))
)]
pub struct Rls<T, const N: usize> {
    cylinder: Cylinder<T>,
    noise: NoiseStd<T>,
    settings: RlsSettings<T>,
    compressibility: T,
    #[cfg_attr(feature = "serde", serde(with = "crate::number::arrays::vector"))]
    scale: [T; N],
    offsets: OffsetPrior<T>,
    zeros: Zeros<T>,
    /// Without the force, which tells nothing of leaks.
    last: Option<Sample<T>>,
    both: Weights<T>,
    position_filter: Option<PositionFilter<T, N>>,
    /// What the position filter has told since the estimates were renewed.
    sums: BlockSums<T, N>,
    /// The balances since then.
    balances: [Option<Balance<T, N>>; BALANCES],
    /// Time since then, s.
    unlearnt_s: T,
    /// Blocks of the balance since then; after a sudden change the first one counts at once.
    unlearnt: usize,
    block: BlockPressures<T>,
    /// How long it will be, s.
    block_time_s: T,
    /// The part of the block in which both flows were measured.
    fed: Integrals<T>,
    pressure_noise: PressureNoise<T>,
    /// The balance equation's moving-average noise filter: last whitened block.
    memory: Option<MovingAverage<T, N>>,
    /// Variance of the sensor noise in the compressibility's column, over the rows' own, summed over the block.
    column_noise: T,
    bank: ModelBank<T, N>,
    solution: Solution<T, N>,
    /// Slopes of the leaks, mean and variance, prior units per s.
    slopes_ps: [(T, T); LEAKS],
    change: ChangeDetector<T, N>,
    innovations: InnovationMonitor<T>,
    pressures: PressureMeans<T>,
    clocks: Clocks<T>,
    /// Step by which the last sample was taken in without a wait, s; zero where it waited.
    step_s: T,
}

impl<T: Real, const N: usize> Rls<T, N> {
    const HAS_A_KNOWN_SIZE: () = assert!(matches!(N, 4 | 6 | 9), "an estimator has 4, 6 or 9 parameters");

    /// An estimator for a rig. `fluid` holds the prior of the bulk modulus; `sensors` the noise, and the
    /// priors of the offsets and gains.
    ///
    /// # Errors
    /// Where the cylinder, its oil, a sensor or a setting cannot be.
    pub fn new(
        cylinder: Cylinder<T>,
        fluid: Fluid<T>,
        sensors: &Sensors<T>,
        settings: RlsSettings<T>,
    ) -> Result<Self, RlsError> {
        let () = Self::HAS_A_KNOWN_SIZE;
        error::check(&cylinder, &fluid, sensors, &settings)?;
        let noise = NoiseStd::of(sensors, &cylinder);
        let no_leak = PerLeak::default();
        let zeros = Zeros::of(sensors);
        let offsets = OffsetPrior::new(&cylinder, &zeros, offset_units(&cylinder, &zeros), &no_leak);
        let solution = Solution::of_prior(&offsets.information);
        Ok(Self {
            cylinder,
            noise,
            settings,
            compressibility: T::one() / fluid.bulk_modulus_pa,
            scale: prior_spread(&cylinder, &fluid, sensors),
            offsets,
            zeros,
            last: None,
            both: Weights::both(&cylinder, &noise, &no_leak),
            position_filter: None,
            sums: BlockSums::new(),
            balances: [None; BALANCES],
            unlearnt_s: T::zero(),
            unlearnt: 0,
            block: BlockPressures::default(),
            block_time_s: settings.block_time_s,
            fed: Integrals::default(),
            pressure_noise: PressureNoise::default(),
            memory: None,
            column_noise: T::zero(),
            bank: ModelBank::new(settings.forgetting_time_s),
            change: ChangeDetector::new(&solution),
            solution,
            slopes_ps: [(T::zero(), T::zero()); LEAKS],
            innovations: InnovationMonitor::default(),
            pressures: PressureMeans::default(),
            clocks: Clocks::new(settings.max_step_s),
            step_s: T::zero(),
        })
    }

    /// Takes in the reading `sample`, `dt_s` after the one before.
    #[inline]
    pub fn update(&mut self, dt_s: T, sample: &Sample<T>) -> Update<T> {
        let () = Self::HAS_A_KNOWN_SIZE;
        if !self.plausible(sample) {
            return Update::Rejected;
        }
        if !self.clocks.is_empty() {
            return self.update_on_clocks(dt_s, &Readings::from(sample));
        }
        let Some(last) = self.last.as_ref().filter(|_| self.is_integrable(dt_s)) else {
            return self.restart(sample);
        };
        let Step { integrals: step, measured } = Step::between(&self.cylinder, dt_s, last, sample);
        if measured != Measured::Both {
            return self.update_without_a_flow(dt_s, sample);
        }
        self.pressure_noise.add([last.pa_pa, last.pb_pa], [sample.pa_pa, sample.pb_pa]);
        self.last = Some(Sample { force_n: None, ..*sample });
        self.step_s = dt_s;
        self.fed.add(&step);
        let weights = self.both;
        self.advance(&step, &weights, Some(sample.x_m));
        self.finish(&step)
    }

    /// The step is taken in: what is due at its end.
    #[inline(always)]
    fn finish(&mut self, step: &Integrals<T>) -> Update<T> {
        self.block.add(step);
        let full = self.block.time_s >= self.block_time_s && self.block.steps >= T::lit(LEAST_STEPS);
        if full {
            self.close_block()
        } else if self.bank.is_renewing() {
            self.go_on()
        } else {
            Update::Accepted
        }
    }

    /// The position equation's step; none is compared with where the position was not read.
    #[inline(always)]
    fn advance(&mut self, step: &Integrals<T>, weights: &Weights<T>, x_m: Option<T>) {
        let Some(position) = &mut self.position_filter else { return };
        let sensor_variance = self.noise.position_m * self.noise.position_m;
        let mut equation =
            combine(step, weights.position_a, weights.position_b, self.compressibility, &self.scale);
        let gain = Parameter::GainPosition as usize;
        if N > gain {
            // The gain acts on the piston's travel: what the flows say less what the leaks take.
            equation.columns[gain] = -equation.residual(&self.solution.mean) * self.scale[gain];
        }
        let variance = weights.position_variance * step.time_square;
        position.carry(step.time, &equation, variance);
        if let Some(x_m) = x_m {
            position.compare(x_m, sensor_variance, &mut self.sums);
        }
    }

    /// Weights where not all flows are measured, or their noise is another.
    #[cold]
    fn weights_of(&self, measured: Measured, noise: &NoiseStd<T>) -> Weights<T> {
        let weights = match measured {
            Measured::OnlyA => Weights::only_a,
            Measured::OnlyB => Weights::only_b,
            Measured::Both | Measured::Neither => Weights::both,
        };
        weights(&self.cylinder, noise, &self.possible_leaks_m3spa())
    }

    /// The leaks found decide how much pressure noise the equations carry, and how much of the pressures'
    /// bias.
    fn reweigh(&mut self) {
        let leaks = self.possible_leaks_m3spa();
        self.both = Weights::both(&self.cylinder, &self.noise, &leaks);
        if N > Parameter::OffsetB as usize {
            self.offsets = OffsetPrior::new(
                &self.cylinder,
                &self.zeros.now(),
                offset_units(&self.cylinder, &self.zeros),
                &leaks,
            );
        }
    }

    /// The piston is where the sensor reads `x_m`; whatever was known of that counts for nothing.
    #[cold]
    fn anchor(&mut self, x_m: T) {
        let variance = self.noise.position_m * self.noise.position_m;
        match &mut self.position_filter {
            Some(filter) => filter.anchor(x_m, variance),
            None => self.position_filter = Some(PositionFilter::anchored(x_m, variance)),
        }
    }

    #[cold]
    fn restart(&mut self, sample: &Sample<T>) -> Update<T> {
        self.last = Some(Sample { force_n: None, ..*sample });
        self.anchor(sample.x_m);
        self.memory = None;
        self.pressure_noise.interrupt();
        Update::Started
    }

    #[inline]
    fn is_integrable(&self, dt_s: T) -> bool {
        dt_s > T::zero() && dt_s <= self.settings.max_step_s
    }

    /// Finite, and within ten times what any pitch cylinder meets.
    #[inline]
    fn plausible(&self, sample: &Sample<T>) -> bool {
        let (x_limit, pressure_limit, flow_limit) = self.limits();
        let flow_ok = |q: Option<T>| q.is_none_or(|q| q.abs() <= flow_limit);
        sample.x_m.abs() <= x_limit
            && sample.pa_pa.abs() <= pressure_limit
            && sample.pb_pa.abs() <= pressure_limit
            && flow_ok(sample.qa_m3s)
            && flow_ok(sample.qb_m3s)
    }

    /// Largest position, m, pressure, Pa, and flow, m³/s, that are readings.
    #[inline]
    fn limits(&self) -> (T, T, T) {
        let flow = T::lit(1e3) * self.cylinder.area_a_m2 * self.cylinder.stroke_m;
        (T::lit(2.0) * self.cylinder.stroke_m, T::lit(1e9), flow)
    }
}

/// What is known beforehand of an estimator's parameters.
fn prior<'a, T: Real, const N: usize>(
    compressibility: T,
    scale: &[T; N],
    offsets: &'a OffsetPrior<T>,
) -> Prior<'a, T> {
    let mean_0 = compressibility / scale[Parameter::Compressibility as usize];
    Prior { mean_0, offsets: &offsets.information }
}
