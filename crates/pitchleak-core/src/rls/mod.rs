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
//! Time and memory per sample are constant; nothing is ever differentiated.

mod balance;
mod error;
mod estimates;
mod excitation;
mod information;
mod innovation_monitor;
mod ma1_whitener;
mod noise;
mod offset_prior;
mod parameter;
mod position_filter;
mod pressure_means;
mod prior;
mod update;
mod weights;

use crate::{Cylinder, Fluid, PerLeak, Real, Sample, Sensors};
use balance::{Integrals, combine};
pub use error::RlsError;
pub use estimates::Estimates;
pub use excitation::{Excitation, ExcitationReport, ExcitationSettings};
use information::{BlockSums, Information, Solution};
use innovation_monitor::{InnovationMonitor, NoiseMeter};
use ma1_whitener::Ma1Whitener;
use noise::NoiseStd;
use offset_prior::OffsetPrior;
pub use parameter::Parameter;
use position_filter::PositionFilter;
use pressure_means::PressureMeans;
use prior::prior_spread;
pub use update::{Innovation, Update};
use weights::Weights;

/// How [`Rls`] forgets and averages.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct RlsSettings<T> {
    /// Time constant of forgetting, s; infinite to remember everything.
    pub forgetting_time_s: T,
    /// Length of the balance's blocks, s: the estimates are renewed once per block.
    pub block_time_s: T,
    /// A step longer than this, s, is a gap: nothing is integrated over it.
    pub max_step_s: T,
}

impl<T: Real> Default for RlsSettings<T> {
    fn default() -> Self {
        Self { forgetting_time_s: T::lit(60.0), block_time_s: T::lit(0.25), max_step_s: T::lit(0.5) }
    }
}

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
    sensors: Sensors<T>,
    compressibility: T,
    #[cfg_attr(feature = "serde", serde(with = "crate::number::arrays::vector"))]
    scale: [T; N],
    offsets: OffsetPrior<T>,
    last: Option<Sample<T>>,
    both: Weights<T>,
    only_a: Weights<T>,
    only_b: Weights<T>,
    position_filter: Option<PositionFilter<T, N>>,
    sums: BlockSums<T, N>,
    block: Integrals<T>,
    /// The part of the block in which both flows were measured.
    fed: Integrals<T>,
    pressure_noise_a: NoiseMeter<T>,
    pressure_noise_b: NoiseMeter<T>,
    /// The balance equation's moving-average noise filter: last whitened block.
    memory: Option<Ma1Whitener<T, N>>,
    information: Information<T, N>,
    solution: Solution<T, N>,
    innovations: InnovationMonitor<T>,
    pressures: PressureMeans<T>,
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
        let offsets = OffsetPrior::new(&cylinder, sensors, &no_leak);
        Ok(Self {
            cylinder,
            noise,
            settings,
            sensors: *sensors,
            compressibility: T::one() / fluid.bulk_modulus_pa,
            scale: prior_spread(&cylinder, &fluid, sensors),
            offsets,
            last: None,
            both: Weights::both(&cylinder, &noise, &no_leak),
            only_a: Weights::only_a(&cylinder, &noise, &no_leak),
            only_b: Weights::only_b(&cylinder, &noise, &no_leak),
            position_filter: None,
            sums: BlockSums::new(),
            block: Integrals::default(),
            fed: Integrals::default(),
            pressure_noise_a: NoiseMeter::default(),
            pressure_noise_b: NoiseMeter::default(),
            memory: None,
            information: Information::new(),
            solution: Information::new().solve(T::zero(), &offsets.information),
            innovations: InnovationMonitor::default(),
            pressures: PressureMeans::default(),
        })
    }

    /// Takes in the reading `sample`, `dt_s` after the one before.
    #[inline]
    pub fn update(&mut self, dt_s: T, sample: &Sample<T>) -> Update<T> {
        let () = Self::HAS_A_KNOWN_SIZE;
        if !self.plausible(sample) {
            return Update::Rejected;
        }
        let Some(last) = self.last.replace(*sample) else {
            return self.restart(sample);
        };
        let integrable = dt_s > T::zero() && dt_s <= self.settings.max_step_s;
        if !integrable {
            return self.restart(sample);
        }
        let step = Integrals::step(&self.cylinder, dt_s, &last, sample);
        self.pressure_noise_a.add(last.pa_pa, sample.pa_pa);
        self.pressure_noise_b.add(last.pb_pa, sample.pb_pa);
        self.block.add(&step);
        self.advance(&step, &last, sample);
        let full = self.block.time >= self.settings.block_time_s && self.block.steps >= T::lit(8.0);
        if full { self.renew() } else { Update::Accepted }
    }

    /// PositionFilter step, by whichever flows both ends of the step have.
    #[inline]
    fn advance(&mut self, step: &Integrals<T>, last: &Sample<T>, now: &Sample<T>) {
        let sensor_variance = self.noise.position_m * self.noise.position_m;
        let odometer =
            self.position_filter.get_or_insert(PositionFilter::anchored(last.x_m, sensor_variance));
        let fed_a = last.qa_m3s.is_some() && now.qa_m3s.is_some();
        let fed_b = last.qb_m3s.is_some() && now.qb_m3s.is_some();
        let weights = match (fed_a, fed_b) {
            (true, true) => {
                self.fed.add(step);
                &self.both
            }
            (true, false) => &self.only_a,
            (false, true) => &self.only_b,
            (false, false) => {
                odometer.anchor(now.x_m, sensor_variance);
                return;
            }
        };
        let mut equation =
            combine(step, weights.odometer_a, weights.odometer_b, self.compressibility, &self.scale);
        let gain = Parameter::GainPosition as usize;
        if N > gain {
            equation.columns[gain] = -equation.left * self.scale[gain];
        }
        let variance = weights.odometer_variance * step.time_square;
        odometer.advance(
            equation.left,
            &equation.columns,
            variance,
            now.x_m,
            sensor_variance,
            &mut self.sums,
        );
    }

    /// Closes the block: both whitened equations go into the information, and the estimates are renewed.
    fn renew(&mut self) -> Update<T> {
        let mut travelled = self.sums;
        self.compensate_odometer();
        let innovation = self.whitened_balance().map(|equation| self.add_balance(&equation));
        if innovation.is_none() {
            self.memory = None;
        }
        let elapsed_s = self.block.time;
        let keep = T::one() / (T::one() + self.block.time / self.settings.forgetting_time_s);
        let changed = self.innovations.take_change();
        if changed {
            self.begin_anew();
            travelled = self.sums;
        }
        self.information.forget(keep);
        self.information.add(&self.sums);
        self.pressures.add_block(&self.block, keep);
        self.innovations.forget(keep);
        let scale = self.scale[Parameter::Compressibility as usize];
        self.solution = self.information.solve(self.compressibility / scale, &self.offsets.information);
        self.innovations.odometer(travelled.chi_square(&self.solution.mean), travelled.count);
        self.reweigh();
        self.sums = BlockSums::new();
        self.block = Integrals::default();
        self.fed = Integrals::default();
        if let Some(odometer) = &mut self.position_filter {
            odometer.weight_sum = T::zero();
        }
        Update::Renewed { elapsed_s, changed, innovation }
    }

    /// The leak has changed: what was learnt before it counts for nothing, and neither the odometer
    /// nor the block just closed may carry the old leak on.
    fn begin_anew(&mut self) {
        let nothing = T::lit(1e-8);
        self.information.forget(nothing);
        self.pressures.forget(nothing);
        self.sums = BlockSums::new();
        self.memory = None;
        let variance = self.noise.position_m * self.noise.position_m;
        if let (Some(odometer), Some(last)) = (&mut self.position_filter, &self.last) {
            odometer.anchor(last.x_m, variance);
        }
    }

    /// The balance over this block, divided by its standard deviation; `None` where a chamber rested.
    fn whitened_balance(&mut self) -> Option<balance::Equation<T, N>> {
        if self.fed.steps < T::lit(2.0) {
            return None;
        }
        let (weight_a, weight_b) = (self.cylinder.area_b_m2, self.cylinder.area_a_m2);
        let mut equation = combine(&self.fed, weight_a, weight_b, self.compressibility, &self.scale);
        let stored =
            self.stored_oil_variance(weight_a, weight_b, self.noise.pressure_pa, self.noise.pressure_pa)
                * self.compressibility
                * self.compressibility;
        let mut variance = self.both.balance_variance * self.fed.time_square + stored;
        if let Some(memory) = &self.memory {
            let share = memory.share();
            equation.left += share * memory.left;
            for (now, before) in equation.columns.iter_mut().zip(&memory.columns) {
                *now += share * *before;
            }
            variance += memory.stored * (T::one() - share);
        } else {
            variance += stored;
        }
        self.memory = Some(Ma1Whitener { left: equation.left, columns: equation.columns, stored, variance });
        let scale = T::one() / variance.sqrt();
        equation.left *= scale;
        for value in &mut equation.columns {
            *value *= scale;
        }
        Some(equation)
    }

    fn add_balance(&mut self, equation: &balance::Equation<T, N>) -> Innovation<T> {
        let (value, variance) = self.solution.predict(equation.left, &equation.columns);
        self.innovations.balance(value, variance);
        self.sums.add(&equation.columns, equation.left, T::one());
        // Both ends of the block are noisy readings of the pressure.
        if let Some(memory) = self.memory {
            let (weight_a, weight_b) = (self.cylinder.area_b_m2, self.cylinder.area_a_m2);
            let noise = T::lit(2.0)
                * self.stored_oil_variance(
                    weight_a,
                    weight_b,
                    self.pressure_noise_a.std_pa(),
                    self.pressure_noise_b.std_pa(),
                );
            self.compensate(noise / memory.variance);
        }
        Innovation { value, variance }
    }

    /// Pressure noise in the odometer's compressibility column: the last reading's only, as the
    /// differences before it telescope.
    fn compensate_odometer(&mut self) {
        let Some(odometer) = &self.position_filter else { return };
        let noise = self.stored_oil_variance(
            self.both.odometer_a,
            self.both.odometer_b,
            self.pressure_noise_a.std_pa(),
            self.pressure_noise_b.std_pa(),
        );
        self.compensate(noise * odometer.weight_sum);
    }

    /// Takes note of noise of `variance` (SI, over the equation's own variance) in the compressibility's
    /// column.
    fn compensate(&mut self, variance: T) {
        let scale = self.scale[Parameter::Compressibility as usize];
        self.sums.column_noise += variance * scale * scale;
    }

    /// Variance of w_a V_A P_A + w_b V_B P_B for pressure noise of the given spread.
    fn stored_oil_variance(&self, weight_a: T, weight_b: T, std_a_pa: T, std_b_pa: T) -> T {
        let x = self.last.map_or(T::zero(), |s| s.x_m).max(T::zero()).min(self.cylinder.stroke_m);
        let a = weight_a * self.cylinder.volume_a_m3(x) * std_a_pa;
        let b = weight_b * self.cylinder.volume_b_m3(x) * std_b_pa;
        a * a + b * b
    }

    /// The leaks found decide how much pressure noise the equations carry, and how much of the pressures'
    /// bias.
    fn reweigh(&mut self) {
        let leaks = self.leak_coefficients().map(|c| c.value.max(T::zero()));
        self.both = Weights::both(&self.cylinder, &self.noise, &leaks);
        self.only_a = Weights::only_a(&self.cylinder, &self.noise, &leaks);
        self.only_b = Weights::only_b(&self.cylinder, &self.noise, &leaks);
        if N > Parameter::OffsetB as usize {
            self.offsets = OffsetPrior::new(&self.cylinder, &self.sensors, &leaks);
        }
    }

    fn restart(&mut self, sample: &Sample<T>) -> Update<T> {
        self.last = Some(*sample);
        let variance = self.noise.position_m * self.noise.position_m;
        match &mut self.position_filter {
            Some(odometer) => odometer.anchor(sample.x_m, variance),
            None => self.position_filter = Some(PositionFilter::anchored(sample.x_m, variance)),
        }
        self.memory = None;
        self.pressure_noise_a.interrupt();
        self.pressure_noise_b.interrupt();
        Update::Started
    }

    /// Finite, and within ten times what any pitch cylinder meets.
    #[inline]
    fn plausible(&self, sample: &Sample<T>) -> bool {
        let pressure_limit = T::lit(1e9);
        let flow_limit = T::lit(1e3) * self.cylinder.area_a_m2 * self.cylinder.stroke_m;
        let flow_ok = |q: Option<T>| q.is_none_or(|q| q.abs() <= flow_limit);
        sample.x_m.abs() <= T::lit(2.0) * self.cylinder.stroke_m
            && sample.pa_pa.abs() <= pressure_limit
            && sample.pb_pa.abs() <= pressure_limit
            && flow_ok(sample.qa_m3s)
            && flow_ok(sample.qb_m3s)
    }
}
