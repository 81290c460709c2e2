//! What happens at a block's end: it is held against what was foretold, and learnt from.

use super::block::{BALANCES, Balance, Block, BlockSums};
use super::change_detector::ChangeDetector;
use super::evidence::Evidence;
use super::information::Solution;
use super::innovation_monitor::InnovationMonitor;
use super::parameter::{LEAKS, Parameter};
use super::update::{Innovation, Update};
use super::{AVERAGING_S, Rls, prior};
use crate::Real;
use crate::continuity::{BlockPressures, Equation, Integrals, MovingAverage, combine};

/// Share of its usual length that a block has after a sudden change: what it tells is then known as soon as the usual block
/// would end, at the usual 25 samples a block.
const FIRST_SHARE: f64 = 0.75;

impl<T: Real, const N: usize> Rls<T, N> {
    /// Closes a block of the balance; after every second one the renewal of the estimates begins.
    #[cfg_attr(target_os = "none", inline(never))]
    pub(super) fn close_block(&mut self) -> Update<T> {
        self.compensate_odometer();
        let balance = self.whitened_balance();
        if balance.is_none() {
            self.memory = None;
        }
        let innovation = balance.as_ref().map(|equation| self.watch_balance(equation));
        let time_s = self.block.time_s;
        let keep = T::one() / (T::one() + time_s / T::lit(AVERAGING_S));
        self.pressures.add_block(&self.block, keep);
        self.innovations.forget(keep);
        let inflation = self.innovations.inflation();
        let watched = balance.as_ref().zip(innovation);
        let changed =
            watched.is_some_and(|(equation, by_known)| self.has_changed(equation, by_known, inflation));
        self.block = BlockPressures::default();
        self.block_time_s = self.settings.block_time_s;
        self.fed = Integrals::default();
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
        self.change.update(balance, self.block.time_s, &self.solution, by_known, &slopes_ps, inflation)
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
        let block = Block::new(self.unlearnt_s, &self.sums, &self.balances, self.column_noise);
        let drifted = self.drifted();
        let prior = prior(self.compressibility, &self.scale, &self.offsets);
        let evidence = Evidence::new(block, prior.mean_0, &self.solution.mean);
        self.bank.begin(evidence, drifted, inflation, &prior, &self.solution);
        self.empty_sums();
    }

    /// Goes on to learn, a sample's share of it.
    #[cfg_attr(target_os = "none", inline(never))]
    pub(super) fn go_on(&mut self) -> Update<T> {
        let prior = prior(self.compressibility, &self.scale, &self.offsets);
        let Some(outlook) = self.bank.go_on(&prior, &mut self.solution) else { return Update::Accepted };
        self.slopes_ps = outlook.slopes_ps;
        let (mut chi_square, mut count) = outlook.chi_square;
        for Balance { equation, .. } in self.balances.iter().flatten() {
            let left = equation.residual(&self.solution.mean);
            chi_square -= left * left;
            count -= T::one();
        }
        self.innovations.odometer(chi_square.at_least(T::zero()), count);
        self.balances = [None; BALANCES];
        self.reweigh();
        if outlook.jumped {
            self.begin_anew();
        }
        Update::Renewed { elapsed_s: outlook.time_s, changed: outlook.jumped, innovation: None }
    }

    /// By how much zeros may have drifted since the estimates were renewed, variances in prior units.
    fn drifted(&mut self) -> [T; 2] {
        if N <= Parameter::OffsetB as usize {
            return [T::zero(); 2];
        }
        let leaks = self.possible_leaks_m3spa();
        self.zeros.advance(self.unlearnt_s, &self.cylinder, &leaks)
    }

    /// Of the odometer and the blocks' time nothing is to be learnt from.
    fn empty_sums(&mut self) {
        self.sums = BlockSums::new();
        self.column_noise = T::zero();
        self.unlearnt_s = T::zero();
        self.unlearnt = 0;
        if let Some(odometer) = &mut self.position_filter {
            odometer.weight_sum = T::zero();
        }
    }

    /// The leak has changed at once: what was learnt before it counts for nothing, and neither the odometer
    /// nor the block just closed may carry the old leak on. The next block is learnt from at once.
    #[cfg_attr(target_os = "none", inline(never))]
    fn begin_anew(&mut self) {
        self.bank.forget_all();
        self.solution = Solution::of_prior(&self.offsets.information);
        self.slopes_ps = [(T::zero(), T::zero()); LEAKS];
        self.change = ChangeDetector::new(&self.solution);
        self.innovations = InnovationMonitor::default();
        self.pressures.forget(T::lit(1e-8));
        self.memory = None;
        if let Some(last) = self.last {
            self.anchor(last.x_m);
        }
        self.empty_sums();
        self.balances = [None; BALANCES];
        self.unlearnt = BALANCES - 1;
        self.block_time_s = T::lit(FIRST_SHARE) * self.settings.block_time_s;
    }

    /// The balance over this block, divided by its standard deviation; `None` where a chamber rested.
    fn whitened_balance(&mut self) -> Option<Equation<T, N>> {
        if self.fed.steps < T::lit(2.0) {
            return None;
        }
        let (weight_a, weight_b) = (self.cylinder.area_b_m2, self.cylinder.area_a_m2);
        let equation = combine(&self.fed, weight_a, weight_b, self.compressibility, &self.scale);
        let stored = self.stored_oil_variance(
            weight_a,
            weight_b,
            [self.noise.pressure_pa * self.noise.pressure_pa; 2],
        ) * self.compressibility
            * self.compressibility;
        let flows = self.both.balance_variance * self.fed.time_square;
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

    /// Pressure noise in the odometer's compressibility column: the last reading's only, as the
    /// differences before it telescope.
    fn compensate_odometer(&mut self) {
        let Some(odometer) = &self.position_filter else { return };
        let noise = self.stored_oil_variance(
            self.both.position_a,
            self.both.position_b,
            self.pressure_noise.variance_pa2(),
        );
        self.compensate(noise * odometer.weight_sum);
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
