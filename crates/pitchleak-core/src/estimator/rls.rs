use super::bank::{Bank, Heard, Outlook};
use super::block::{BALANCES, Balance, BlockSums, PositionFilter};
use super::information::{Prior, Solution};
use super::innovations::{ChangeDetector, Innovations};
use super::prior::{LEAKS, OffsetPrior, Parameter, Zeros, offset_units, prior_spread};
use super::{Innovation, RlsError, RlsSettings, Update};
use crate::continuity::{
    Clocks, Equation, Integrals, Measured, MovingAverage, Next, NoiseStd, PerChannel, PressureMeans,
    PressureNoise, Readings, Row, Step, Weights, combine,
};
use crate::{Cylinder, Fluid, PerLeak, Real, Sample, Sensors};

/// Memory of the mean pressures at which leak flows are quoted, and of the innovations' size, s.
const AVERAGING_S: f64 = 60.0;

/// Least number of steps of a block, however slowly samples come.
const LEAST_STEPS: f64 = 8.0;

/// Share of its length by which a block is whole: steps add up to it but for rounding, in `f32` as in `f64`.
const WHOLE: f64 = 1.0 - 1e-4;

/// Share of its usual length that a block has after a sudden change: what it tells is then known as soon as the usual block
/// would end, at the usual 25 samples a block.
const FIRST_SHARE: f64 = 0.75;

/// Rows that are taken in with one sample where little else is due: more than come, so that those that waited are caught up with.
/// Beside a renewal's share it is one, and none where a block or a renewal ends.
const ROWS_AT_ONCE: usize = 2;

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
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(bound = "T: crate::Saved"))]
pub struct Rls<T, const N: usize> {
    cylinder: Cylinder<T>,
    noise: NoiseStd<T>,
    settings: RlsSettings<T>,
    pub(super) compressibility: T,
    #[cfg_attr(feature = "serde", serde(with = "crate::number::arrays::vector"))]
    pub(super) scale: [T; N],
    pub(super) offsets: OffsetPrior<T>,
    pub(super) zeros: Zeros<T>,
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
    block: Integrals<T>,
    /// From when on it is whole, s.
    block_time_s: T,
    /// The part of the block in which not both flows were measured.
    unfed: Integrals<T>,
    pressure_noise: PressureNoise<T>,
    /// The balance equation's moving-average noise filter: last whitened block.
    memory: Option<MovingAverage<T, N>>,
    /// Variance of the sensor noise in the compressibility's column, over the rows' own, summed over the block.
    column_noise: T,
    bank: Bank<T, N>,
    pub(super) solution: Solution<T, N>,
    /// Slopes of the leaks, mean and variance, prior units per s.
    pub(super) slopes_ps: [(T, T); LEAKS],
    change: ChangeDetector<T, N>,
    pub(super) innovations: Innovations<T>,
    pub(super) pressures: PressureMeans<T>,
    clocks: Clocks<T>,
    /// Step by which the last sample was taken in without a wait, s; zero where it waited.
    step_s: T,
    /// The longest step to a sample that does not wait, s; zero while rows wait.
    longest_s: T,
    /// Largest flow that is a reading, m³/s.
    flow_limit_m3s: T,
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
        super::check(&cylinder, &fluid, sensors, &settings)?;
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
            block: Integrals::default(),
            block_time_s: T::lit(WHOLE) * settings.block_time_s,
            unfed: Integrals::default(),
            pressure_noise: PressureNoise::default(),
            memory: None,
            column_noise: T::zero(),
            bank: Bank::new(settings.forgetting_time_s),
            change: ChangeDetector::new(&solution),
            solution,
            slopes_ps: [(T::zero(), T::zero()); LEAKS],
            innovations: Innovations::default(),
            pressures: PressureMeans::default(),
            clocks: Clocks::new(settings.max_step_s),
            step_s: T::zero(),
            longest_s: settings.max_step_s,
            flow_limit_m3s: T::lit(1e3) * cylinder.area_a_m2 * cylinder.stroke_m,
        })
    }

    /// Takes in the reading `sample`, `dt_s` after the one before. A flow without a reading rests over the steps to either side;
    /// where it may come later, with a clock of its own, [`update_waiting`](Self::update_waiting) waits for it.
    #[inline]
    pub fn update(&mut self, dt_s: T, sample: &Sample<T>) -> Update<T> {
        let () = Self::HAS_A_KNOWN_SIZE;
        if !self.plausible(&Readings::from(sample)) {
            return Update::Rejected;
        }
        let follows = dt_s > T::zero() && dt_s <= self.longest_s;
        let Some(last) = self.last.filter(|_| follows) else {
            self.begin_at(&Sample { force_n: None, ..*sample });
            return Update::Started;
        };
        self.last = Some(Sample { force_n: None, ..*sample });
        self.pressure_noise.add([last.pa_pa, last.pb_pa], [sample.pa_pa, sample.pb_pa]);
        let Step { integrals: step, measured } = Step::between(&self.cylinder, dt_s, &last, sample);
        let weights = if measured == Measured::Both {
            self.step_s = dt_s;
            self.both
        } else {
            self.rest(step, measured, sample.x_m)
        };
        if measured != Measured::Neither {
            self.advance(&step, &weights, Some(sample.x_m));
        }
        self.block.add(&step);
        self.work()
    }

    /// Not both flows were measured over `step`: the position goes on by the one that was, or anew.
    #[cold]
    #[cfg_attr(target_os = "none", inline(never))]
    fn rest(&mut self, step: Integrals<T>, measured: Measured, x_m: T) -> Weights<T> {
        self.unfed.add(&step);
        if measured == Measured::Neither {
            self.anchor(x_m);
            self.sums.count -= T::one();
            return self.both;
        }
        self.weights_of(measured, &self.noise)
    }

    /// Nothing goes over from what came before.
    #[cold]
    fn begin_at(&mut self, sample: &Sample<T>) {
        self.clocks.forget_rows();
        self.longest_s = self.settings.max_step_s;
        self.restart(sample);
    }

    /// What is due with each sample, if anything: a renewal's next share, or the block's end, which comes no sooner than the renewal
    /// by those before it.
    #[inline(always)]
    fn work(&mut self) -> Update<T> {
        if self.bank.is_renewing() {
            self.go_on()
        } else if self.is_full() {
            self.close_block()
        } else {
            Update::Accepted
        }
    }

    #[inline(always)]
    fn is_full(&self) -> bool {
        self.block.time >= self.block_time_s && self.block.steps >= T::lit(LEAST_STEPS)
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
    fn restart(&mut self, sample: &Sample<T>) {
        self.last = Some(*sample);
        self.anchor(sample.x_m);
        self.memory = None;
        self.pressure_noise.interrupt();
    }

    #[inline]
    fn is_integrable(&self, dt_s: T) -> bool {
        dt_s > T::zero() && dt_s <= self.settings.max_step_s
    }

    /// Finite, and within ten times what any pitch cylinder meets.
    #[inline]
    fn plausible(&self, &PerChannel { x, pa, pb, qa, qb }: &Readings<T>) -> bool {
        let (x_limit, pressure_limit) = (T::lit(2.0) * self.cylinder.stroke_m, T::lit(1e9));
        let ok = |reading: Option<T>, limit: T| reading.is_none_or(|value| value.abs() <= limit);
        ok(x, x_limit)
            && ok(pa, pressure_limit)
            && ok(pb, pressure_limit)
            && ok(qa, self.flow_limit_m3s)
            && ok(qb, self.flow_limit_m3s)
    }

    /// Takes in what was read `dt_s` after the readings before, of channels that need not all come at once: between two of its
    /// own readings a channel is the straight line, and its noise is that of its own readings ([`Clocks`](crate::continuity::Clocks)).
    /// A channel without a reading is waited for, for a few steps of its own; then its chamber rests. Where the position or a pressure
    /// is missing for longer, nothing is integrated. Where all come at once it is [`update`](Self::update).
    #[cfg_attr(target_os = "none", inline(never))]
    pub fn update_readings(&mut self, dt_s: T, readings: &Readings<T>) -> Update<T> {
        match *readings {
            Readings { x: Some(x_m), pa: Some(pa_pa), pb: Some(pb_pa), qa: qa_m3s, qb: qb_m3s } => {
                self.update_waiting(dt_s, &Sample { x_m, pa_pa, pb_pa, qa_m3s, qb_m3s, force_n: None })
            }
            _ => self.update_on_clocks(dt_s, readings),
        }
    }

    /// As [`update`](Self::update), but a flow without a reading is waited for, as by [`update_readings`](Self::update_readings).
    #[inline]
    pub fn update_waiting(&mut self, dt_s: T, sample: &Sample<T>) -> Update<T> {
        if !self.clocks.is_empty() || self.waits_for(dt_s, sample.qa_m3s, sample.qb_m3s) {
            return self.update_on_clocks(dt_s, &Readings::from(sample));
        }
        self.update(dt_s, sample)
    }

    /// Whether a flow has no reading after one that had.
    #[inline]
    fn waits_for(&self, dt_s: T, qa_m3s: Option<T>, qb_m3s: Option<T>) -> bool {
        let missing = |last: Option<T>, now: Option<T>| now.is_none() && last.is_some();
        let waits = |last: &Sample<T>| missing(last.qa_m3s, qa_m3s) || missing(last.qb_m3s, qb_m3s);
        (qa_m3s.is_none() || qb_m3s.is_none())
            && self.is_integrable(dt_s)
            && self.last.as_ref().is_some_and(waits)
    }

    #[cold]
    #[cfg_attr(target_os = "none", inline(never))]
    fn update_on_clocks(&mut self, dt_s: T, readings: &Readings<T>) -> Update<T> {
        if !self.plausible(readings) {
            return Update::Rejected;
        }
        let renewing = self.bank.is_renewing();
        let mut update = self.work();
        if !self.is_integrable(dt_s) {
            self.last = None;
            self.clocks.begin_anew();
        } else if let Some(last) = self.last.filter(|_| self.clocks.is_empty()) {
            let step_s = Some(self.step_s).filter(|step_s| *step_s > T::zero());
            self.clocks.go_on_after(&last, step_s);
        }
        self.step_s = T::zero();
        let dropped = self.clocks.push(dt_s, readings);
        let rows = match update {
            Update::Accepted if renewing || dropped => 1,
            Update::Accepted => ROWS_AT_ONCE,
            _ => 0,
        };
        for _ in 0..rows {
            match self.clocks.pop() {
                Next::Waits => break,
                Next::Gap => self.last = None,
                Next::Row(row) => {
                    if self.take_row(&row) {
                        update = Update::Started;
                    }
                }
            }
        }
        self.longest_s = if self.clocks.is_empty() { self.settings.max_step_s } else { T::zero() };
        update
    }

    /// Says whether nothing goes over from what came before.
    fn take_row(&mut self, row: &Row<T>) -> bool {
        let Some(last) = self.last.replace(row.sample) else {
            self.restart(&row.sample);
            return true;
        };
        let Step { integrals: mut step, measured } =
            Step::between(&self.cylinder, row.dt_s, &last, &row.sample);
        if row.read.pa && row.read.pb && !row.thinned {
            self.pressure_noise.add([last.pa_pa, last.pb_pa], [row.sample.pa_pa, row.sample.pb_pa]);
        } else {
            self.pressure_noise.interrupt();
        }
        if measured == Measured::Neither || !row.read.x {
            self.sums.count -= T::one();
        }
        if measured == Measured::Neither {
            self.anchor(row.sample.x_m);
        } else {
            let weights = self.weights_of(measured, &diluted(&self.noise, row));
            self.advance(&step, &weights, row.read.x.then_some(row.sample.x_m));
            if measured == Measured::Both {
                // The balance counts its noise as if every channel had been read with every sample.
                step.time_square *= weights.balance_variance / self.both.balance_variance;
            }
        }
        if measured != Measured::Both {
            self.unfed.add(&step);
        }
        self.block.add(&step);
        false
    }

    /// Closes a block of the balance; after every second one the renewal of the estimates begins.
    #[cfg_attr(target_os = "none", inline(never))]
    fn close_block(&mut self) -> Update<T> {
        self.compensate_position();
        let balance = self.whitened_balance();
        if balance.is_none() {
            self.memory = None;
        }
        let innovation = balance.as_ref().map(|equation| self.watch_balance(equation));
        let time_s = self.block.time;
        // As many rows of the position as steps, but for those with which it was not compared.
        self.sums.count += self.block.steps;
        let keep = T::one() / (T::one() + time_s / T::lit(AVERAGING_S));
        self.pressures.add_block(&self.block, keep);
        self.innovations.forget(keep);
        let inflation = self.innovations.inflation();
        let watched = balance.as_ref().zip(innovation);
        let changed =
            watched.is_some_and(|(equation, by_known)| self.has_changed(equation, by_known, inflation));
        self.block = Integrals::default();
        self.block_time_s = T::lit(WHOLE) * self.settings.block_time_s;
        if self.unfed.steps > T::zero() {
            self.unfed = Integrals::default();
        }
        if changed {
            let elapsed_s = self.unlearnt_s + time_s;
            self.begin_anew();
            return Update::Renewed { elapsed_s, changed, innovation };
        }
        self.take_balance(balance, time_s);
        if self.unlearnt >= BALANCES {
            self.learn(inflation);
        }
        Update::Balanced { innovation }
    }

    fn has_changed(&mut self, balance: &Equation<T, N>, by_known: Innovation<T>, inflation: T) -> bool {
        let slopes_ps = self.slopes_ps.map(|(mean, _)| mean);
        self.change.update(balance, self.block.time, &self.solution, by_known, &slopes_ps, inflation)
    }

    /// Puts a balance to those that will be learnt from together.
    fn take_balance(&mut self, balance: Option<Equation<T, N>>, time_s: T) {
        for earlier in self.balances.iter_mut().flatten() {
            earlier.age_s += time_s;
        }
        if let Some(place) = self.balances.get_mut(self.unlearnt) {
            *place = balance.map(|equation| Balance { equation, age_s: T::lit(0.5) * time_s });
        }
        self.unlearnt += 1;
        self.unlearnt_s += time_s;
    }

    /// Begins to learn what the blocks since the last time tell of the parameters.
    fn learn(&mut self, inflation: T) {
        let drifted = self.drifted();
        let prior = prior(self.compressibility, &self.scale, &self.offsets);
        let evidence = &mut self.bank.evidence;
        evidence.block.fill(self.unlearnt_s, &self.sums, &self.balances, self.column_noise);
        evidence.refer(prior.mean_0, &self.solution.mean);
        self.bank.begin(drifted, inflation, &prior, &self.solution);
        self.empty_sums();
    }

    /// Goes on to learn, a sample's share of it.
    #[cfg_attr(target_os = "none", inline(never))]
    fn go_on(&mut self) -> Update<T> {
        let prior = prior(self.compressibility, &self.scale, &self.offsets);
        let elapsed_s = self.bank.evidence.block.time_s;
        let changed = match self.bank.go_on(&prior, &mut self.solution) {
            Heard::Part => return Update::Accepted,
            Heard::Jumped => {
                self.begin_anew();
                true
            }
            Heard::All(outlook) => {
                self.take(outlook);
                false
            }
        };
        Update::Renewed { elapsed_s, changed, innovation: None }
    }

    /// The estimates are new.
    fn take(&mut self, outlook: Outlook<T>) {
        self.slopes_ps = outlook.slopes_ps;
        let (mut chi_square, mut count) = outlook.chi_square;
        for Balance { equation, .. } in self.balances.iter().flatten() {
            let left = equation.residual(&self.solution.mean);
            chi_square -= left * left;
            count -= T::one();
        }
        self.innovations.position(chi_square.at_least(T::zero()), count);
        self.balances = [None; BALANCES];
        self.reweigh();
    }

    /// By how much zeros may have drifted since the estimates were renewed, variances in prior units.
    fn drifted(&mut self) -> [T; 2] {
        if N <= Parameter::OffsetB as usize {
            return [T::zero(); 2];
        }
        let leaks = self.possible_leaks_m3spa();
        self.zeros.advance(self.unlearnt_s, &self.cylinder, &leaks)
    }

    /// Of the position equation and the blocks' time nothing is to be learnt from.
    fn empty_sums(&mut self) {
        self.sums = BlockSums::new();
        self.column_noise = T::zero();
        self.unlearnt_s = T::zero();
        self.unlearnt = 0;
        if let Some(position) = &mut self.position_filter {
            position.weight_sum = T::zero();
        }
    }

    /// The leak has changed at once: what was learnt before it counts for nothing, and neither the piston's position
    /// nor the block just closed may carry the old leak on. The next block is learnt from at once.
    #[cfg_attr(target_os = "none", inline(never))]
    fn begin_anew(&mut self) {
        self.bank.forget_all();
        self.solution = Solution::of_prior(&self.offsets.information);
        self.slopes_ps = [(T::zero(), T::zero()); LEAKS];
        self.change = ChangeDetector::new(&self.solution);
        self.innovations = Innovations::default();
        self.pressures.forget(T::lit(1e-8));
        self.memory = None;
        if let Some(last) = self.last {
            self.anchor(last.x_m);
        }
        self.empty_sums();
        self.balances = [None; BALANCES];
        self.unlearnt = BALANCES - 1;
        self.block_time_s = T::lit(WHOLE * FIRST_SHARE) * self.settings.block_time_s;
    }

    /// The balance over this block, divided by its standard deviation; `None` where a chamber rested.
    fn whitened_balance(&mut self) -> Option<Equation<T, N>> {
        let without_unfed;
        let fed = if self.unfed.steps > T::zero() {
            without_unfed = self.block.without(&self.unfed);
            &without_unfed
        } else {
            &self.block
        };
        if fed.steps < T::lit(2.0) {
            return None;
        }
        let (weight_a, weight_b) = (self.cylinder.area_b_m2, self.cylinder.area_a_m2);
        let equation = combine(fed, weight_a, weight_b, self.compressibility, &self.scale);
        let stored = self.stored_oil_variance(
            weight_a,
            weight_b,
            [self.noise.pressure_pa * self.noise.pressure_pa; 2],
        ) * self.compressibility
            * self.compressibility;
        let flows = self.both.balance_variance * fed.time_square;
        let now = MovingAverage::after(self.memory.as_ref(), equation, flows, stored);
        self.memory = Some(now);
        Some(now.whitened())
    }

    fn watch_balance(&mut self, equation: &Equation<T, N>) -> Innovation<T> {
        let innovation = self.solution.predict(equation);
        self.innovations.balance(&innovation);
        // Both ends of the block are noisy readings of the pressure.
        if let Some(memory) = self.memory {
            let (weight_a, weight_b) = (self.cylinder.area_b_m2, self.cylinder.area_a_m2);
            let noise = T::lit(2.0)
                * self.stored_oil_variance(weight_a, weight_b, self.pressure_noise.variance_pa2());
            self.compensate(noise / memory.variance());
        }
        innovation
    }

    /// Pressure noise in the position equation's compressibility column: the last reading's only, as the
    /// differences before it telescope.
    fn compensate_position(&mut self) {
        let Some(position) = &self.position_filter else { return };
        let noise = self.stored_oil_variance(
            self.both.position_a,
            self.both.position_b,
            self.pressure_noise.variance_pa2(),
        );
        self.compensate(noise * position.weight_sum);
    }

    /// Takes note of noise of `variance` (SI, over the equation's own variance) in the compressibility's
    /// column.
    fn compensate(&mut self, variance: T) {
        let scale = self.scale[Parameter::Compressibility as usize];
        self.column_noise += variance * scale * scale;
    }

    /// Variance of w_a V_A P_A + w_b V_B P_B for pressure noise of the given variances.
    #[cfg_attr(target_os = "none", inline(never))] // once in the flash, not for each caller
    fn stored_oil_variance(&self, weight_a: T, weight_b: T, [a_pa2, b_pa2]: [T; 2]) -> T {
        let x = self.last.map_or(T::zero(), |s| s.x_m).at_least(T::zero()).at_most(self.cylinder.stroke_m);
        let a = weight_a * self.cylinder.volume_a_m3(x);
        let b = weight_b * self.cylinder.volume_b_m3(x);
        a * a * a_pa2 + b * b * b_pa2
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

#[cfg(test)]
mod tests {
    use super::*;

    /// Over the steps between two readings of a channel the integral's variance adds up to that of the readings: σ² own².
    #[test]
    fn noise_is_that_of_own_readings() {
        let noise = NoiseStd { flow_a_m3s: 1e-6, flow_b_m3s: 2e-6, pressure_pa: 5e4, position_m: 1e-3 };
        let sample =
            Sample { x_m: 0.1, pa_pa: 5e6, pb_pa: 4e6, qa_m3s: Some(0.0), qb_m3s: Some(0.0), force_n: None };
        let mut row = Row::read(0.01, &sample);
        row.own_step_s = PerChannel { x: 0.05, pa: 0.02, pb: 0.04, qa: 0.1, qb: 0.2 };
        let found = diluted(&noise, &row);
        let channels: [(f64, f64, f64); 3] =
            [(found.flow_a_m3s, 1e-6, 0.1), (found.flow_b_m3s, 2e-6, 0.2), (found.pressure_pa, 5e4, 0.04)];
        for (std, declared, own_s) in channels {
            let steps: f64 = own_s / 0.01;
            let variance = steps * (std * 0.01).powi(2);
            assert!((variance / (declared * own_s).powi(2) - 1.0).abs() < 1e-9, "{std} over {own_s} s");
        }
    }
}
