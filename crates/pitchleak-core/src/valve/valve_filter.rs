use super::calibration::{LEAK_SIZE, ValveCalibration, ValveError, ValveNoise};
use super::edges::{Edges, PRESSURES, Scaled};
use super::filter::Filter;
use super::hats::{Block, Hat, Sampled};
use super::rows::{Equations, Whitening};
use super::unknowns::{KAPPA, LAPS, LEAK_UNIT_M3SPA, VALVE_UNKNOWNS as N};
use super::watch::Watch;
use crate::continuity::{Integrals, PressureMeans};
use crate::{Cylinder, Estimate, Fluid, PerLeak, Real};

/// Length of a block, s, and its least number of samples, which is odd: short beside what a pitch cylinder does.
const BLOCK_S: f64 = 0.25;
const LEAST_SAMPLES: u32 = 9;
/// Memory of the mean pressures at which leak flows are quoted, s.
const AVERAGING_S: f64 = 60.0;
/// Largest pressure that is a reading, Pa.
const PRESSURE_LIMIT_PA: f64 = 1e9;

/// One reading of the sensors of a cylinder without flow meters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ValveSample<T> {
    /// Piston position from the A end, m.
    pub x_m: T,
    /// Pressure of chamber A, Pa.
    pub pa_pa: T,
    /// Pressure of chamber B, Pa.
    pub pb_pa: T,
    /// Position of the spool, a share of its stroke; above zero it feeds A.
    pub spool: T,
    /// Supply pressure at the valve, Pa.
    pub ps_pa: T,
}

/// What one [`ValveFilter::update`] did.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ValveUpdate<T> {
    /// The first sample, or the first after a gap: nothing to integrate yet.
    Started,
    /// The sample was taken in.
    Accepted,
    /// The estimates are new.
    Renewed {
        /// Time that was watched since they were last new, s.
        elapsed_s: T,
        /// The leaks have changed at once: what was known of them counts for nothing any more.
        changed: bool,
    },
    /// Not a number, or beyond what a cylinder can do: the sample was left out.
    Rejected,
}

/// What the valve's flows say of the leaks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ValveEstimates<T> {
    /// Coefficients, m³/(s·Pa).
    pub leaks_m3spa: PerLeak<Estimate<T>>,
    /// Leak flows at the mean pressures of the last minute, m³/s.
    pub mean_leaks_m3s: PerLeak<Estimate<T>>,
    /// 1/β, 1/Pa.
    pub compressibility_per_pa: Estimate<T>,
    /// Mean squared innovation over its variance: 1 where the declared noise holds.
    pub normalised_innovation: T,
    /// Whether a valve as calibrated, its leaks and noise explain the last half minute and more. Else nothing here is worth an alarm.
    pub is_explained: bool,
}

/// What is due with the samples after a block, one share each.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
enum Due {
    Nothing,
    Balance,
    Chamber,
    Growth,
}

/// Leaks of a cylinder without flow meters, by the flows of its calibrated valve; in constant time and memory.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(bound = "T: crate::Saved"))]
pub struct ValveFilter<T> {
    edges: Edges<T>,
    equations: Equations<T>,
    growth_ps: [T; N],
    zero_growth_ps: T,
    kappa_ppa: T,
    kappa_mean: T,
    stroke_m: T,
    max_step_s: T,
    per_drop: T,
    last: Option<Sampled<T>>,
    block: Block<T>,
    before: Option<Block<T>>,
    white: Option<Whitening<T>>,
    due: Due,
    /// Time since the last renewal, s, and the unknown whose turn to grow it is.
    waiting_s: T,
    turn: u8,
    /// Of the hysteresis: declared half width, and where the spool stands within it, −1 to 1.
    half_width: T,
    play: T,
    spool: Option<T>,
    filter: Filter<T>,
    watch: Watch<T>,
    pressures: PressureMeans<T>,
}

impl<T: Real> ValveFilter<T> {
    /// For a cylinder, its oil, its valve's calibration and the noise of its sensors. A step longer than `max_step_s` is a gap.
    ///
    /// # Errors
    /// Where one of them cannot be.
    pub fn new(
        cylinder: &Cylinder<T>,
        fluid: &Fluid<T>,
        calibration: &ValveCalibration<T>,
        noise: &ValveNoise<T>,
        max_step_s: T,
    ) -> Result<Self, ValveError> {
        cylinder.check()?;
        fluid.check()?;
        calibration.check()?;
        noise.check()?;
        if !max_step_s.is_positive() {
            return Err(ValveError::Noise);
        }
        let growth_ps = calibration.growth_ps(fluid);
        let since = ValveCalibration::since(&growth_ps);
        Ok(Self {
            edges: Edges::of(calibration, noise),
            equations: Equations::of(cylinder, fluid, calibration, noise),
            growth_ps,
            zero_growth_ps: calibration.zero_growth_ps(),
            kappa_ppa: fluid.bulk_modulus_pa.recip(),
            kappa_mean: calibration.mean[KAPPA],
            stroke_m: cylinder.stroke_m,
            max_step_s,
            per_drop: calibration.rated_drop_pa.recip(),
            last: None,
            block: Block::new(),
            before: None,
            white: None,
            due: Due::Nothing,
            waiting_s: T::zero(),
            turn: 0,
            half_width: calibration.hysteresis,
            play: T::zero(),
            spool: None,
            filter: Filter::of(&calibration.without_leaks(), &since),
            watch: Watch::new(),
            pressures: PressureMeans::default(),
        })
    }

    /// Takes in the reading `sample`, `dt_s` after the one before.
    pub fn update(&mut self, dt_s: T, sample: &ValveSample<T>) -> ValveUpdate<T> {
        if !self.is_plausible(sample) {
            return ValveUpdate::Rejected;
        }
        let follows = dt_s > T::zero() && dt_s <= self.max_step_s;
        match &self.last {
            Some(last) if follows => self.block.add(last, dt_s),
            _ => {
                self.interrupt(dt_s);
                self.last = Some(self.sampled(sample, T::zero()));
                return ValveUpdate::Started;
            }
        }
        self.last = Some(self.sampled(sample, dt_s));
        let is_long = self.block.time_s + T::lit(0.5) * dt_s >= T::lit(BLOCK_S);
        if is_long && self.block.samples >= LEAST_SAMPLES && self.block.is_odd() {
            self.close_block();
            return ValveUpdate::Accepted;
        }
        self.work()
    }

    #[inline(always)]
    fn sampled(&self, sample: &ValveSample<T>, before_s: T) -> Sampled<T> {
        let per_drop = self.per_drop;
        let reading = Scaled {
            x_m: sample.x_m,
            pa: sample.pa_pa * per_drop,
            pb: sample.pb_pa * per_drop,
            spool: sample.spool,
            ps: sample.ps_pa * per_drop,
        };
        let read = [reading.x_m, reading.pa, reading.pb, reading.spool];
        Sampled { rates: self.edges.at(&reading), read, before_s }
    }

    fn is_plausible(&self, sample: &ValveSample<T>) -> bool {
        let ValveSample { x_m, pa_pa, pb_pa, spool, ps_pa } = *sample;
        let pressure = T::lit(PRESSURE_LIMIT_PA);
        x_m.abs() <= T::lit(2.0) * self.stroke_m
            && [pa_pa, pb_pa, ps_pa].iter().all(|own| own.abs() <= pressure)
            && spool.abs() <= T::lit(2.0)
    }

    /// Nothing goes over a gap but what is known, and that has changed meanwhile.
    #[cold]
    fn interrupt(&mut self, gap_s: T) {
        while self.due != Due::Nothing {
            self.work();
        }
        self.block = Block::new();
        (self.before, self.white, self.spool) = (None, None, None);
        if gap_s.is_positive() {
            self.filter.widen(self.zero_growth_ps * gap_s, along_zero());
            for (unknown, growth_ps) in self.growth_ps.iter().enumerate() {
                self.filter.widen(*growth_ps * gap_s, along(unknown));
            }
        }
    }

    /// The block is over: its hat with the one before becomes two rows, which the next samples take in.
    fn close_block(&mut self) {
        while self.due != Due::Nothing {
            self.work();
        }
        let block = core::mem::replace(&mut self.block, Block::new());
        let was = self.play;
        self.follow(block.spool());
        if let Some(before) = self.before.replace(block) {
            let hat = Hat::over(&before, &block);
            let play = T::lit(0.5) * (was + self.play);
            let rows = self.equations.rows(&hat, play);
            let [internal, a, b, ..] = self.filter.step.map(|leak| leak.at_least(T::zero()));
            let last = self.equations.noise(&block, [internal, a, b]);
            let first = match &self.white {
                Some(white) => white.last,
                None => self.equations.noise(&before, [internal, a, b]),
            };
            let by_means = self.equations.by_means(&hat);
            self.white = Some(Whitening::next(self.white.as_ref(), &rows, by_means, [first, last]));
            self.due = Due::Balance;
        }
        self.waiting_s += block.time_s;
        self.count_pressures(&block);
    }

    /// The spool within its hysteresis, by the means of blocks: single readings are noise.
    fn follow(&mut self, spool: T) {
        let Some(before) = self.spool.replace(spool) else { return };
        if self.half_width > T::zero() {
            let play = self.play + (spool - before) / self.half_width;
            self.play = play.at_least(-T::one()).at_most(T::one());
        }
    }

    fn count_pressures(&mut self, block: &Block<T>) {
        let [a, b] = [0, 1].map(|chamber| block.sums[PRESSURES + chamber] * self.equations.rated_drop_pa);
        let mut integrals = Integrals { time: block.time_s, ..Integrals::default() };
        (integrals.a.pressure, integrals.b.pressure) = (a, b);
        let keep = (T::one() - block.time_s / T::lit(AVERAGING_S)).at_least(T::zero());
        self.pressures.add_block(&integrals, keep);
    }

    /// A share of what is due.
    fn work(&mut self) -> ValveUpdate<T> {
        match self.due {
            Due::Nothing => {}
            Due::Balance => {
                self.take(0);
                self.due = Due::Chamber;
            }
            Due::Chamber => {
                self.take(1);
                self.due = Due::Growth;
            }
            Due::Growth => return self.grow(),
        }
        ValveUpdate::Accepted
    }

    /// Takes in a row of the last hat.
    fn take(&mut self, which: usize) {
        let row = self.white.as_ref().and_then(|white| white.rows.get(which));
        if let Some(row) = row {
            self.watch.add(row, &self.filter.update(row));
        }
    }

    /// The unknowns may have moved, one of them with each block.
    fn grow(&mut self) -> ValveUpdate<T> {
        self.due = Due::Nothing;
        let elapsed_s = core::mem::replace(&mut self.waiting_s, T::zero());
        let turn = usize::from(self.turn);
        self.turn = if turn + 1 < N { self.turn + 1 } else { 0 };
        let growth = self.growth_ps.get(turn).copied().unwrap_or_default();
        self.filter.widen(growth * elapsed_s * T::lit(N as f64), along(turn));
        self.filter.widen(self.zero_growth_ps * elapsed_s, along_zero());
        let lost_s = self.watch.pass(elapsed_s, &mut self.filter.step);
        if let Some(lost_s) = lost_s {
            // White rows carry those before them along, which had other leaks.
            self.white = None;
            self.filter.widen(self.zero_growth_ps * lost_s, along_zero());
            (0..KAPPA).for_each(|leak| self.filter.widen(T::lit(LEAK_SIZE * LEAK_SIZE), along(leak)));
        }
        ValveUpdate::Renewed { elapsed_s, changed: lost_s.is_some() }
    }

    /// What the readings so far say.
    pub fn estimates(&self) -> ValveEstimates<T> {
        let unit = T::lit(LEAK_UNIT_M3SPA);
        let wider = self.watch.widening();
        let leaks_m3spa = PerLeak::from_fn(|leak| {
            let at = leak as usize;
            let std = self.filter.variance(at).sqrt() * wider[at];
            Estimate { value: self.filter.step[at], std }.scaled(unit)
        });
        let sizes_pa = self.pressures.means().sizes_pa;
        let kappa = Estimate {
            value: self.kappa_mean + self.filter.step[KAPPA],
            std: self.filter.variance(KAPPA).sqrt(),
        };
        ValveEstimates {
            leaks_m3spa,
            mean_leaks_m3s: leaks_m3spa.zip(sizes_pa).map(|(leak, pressure_pa)| leak.scaled(pressure_pa)),
            compressibility_per_pa: kappa.scaled(self.kappa_ppa),
            normalised_innovation: self.watch.noise(),
            is_explained: self.watch.is_explained(),
        }
    }
}

/// One unknown alone.
fn along<T: Real>(unknown: usize) -> [T; N] {
    let mut direction = [T::zero(); N];
    direction.iter_mut().skip(unknown).take(1).for_each(|own| *own = T::one());
    direction
}

/// The spool's zero: what opens P–A and B–T closes A–T and P–B.
fn along_zero<T: Real>() -> [T; N] {
    let mut direction = [T::zero(); N];
    let signs = [T::one(), -T::one(), -T::one(), T::one()];
    direction.iter_mut().skip(LAPS).zip(signs).for_each(|(own, sign)| *own = sign);
    direction
}
