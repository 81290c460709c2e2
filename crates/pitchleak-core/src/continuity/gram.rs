//! The sufficient statistic of the continuity equations: Gram matrices of their whitened rows, by segments of the trace.
//!
//! Whatever is linear in the raw sums can be asked of them afterwards: a zero, gain, lag or area set free, an exchange of
//! columns. Memory is constant: where all segments are full, those two neighbours become one that differ least.

// Index loops over const bounds: they read like the algebra and the bounds checks vanish.
#![allow(clippy::needless_range_loop)]

use super::block_sums::{Block, BlockSums, MPA_PER_PA, RAW_SUMS, RawSum};
use super::change::{SEGMENT_BLOCKS, Waiting};
use super::clocks::{self, Clocks, Next, Readings};
use super::scatter::Scatter;
use super::whitening::{COLUMNS, EQUATIONS, INTEGRALS, Row, RowNoise, VOLUME_POWERS, Whitener};
use crate::{Cylinder, Fluid, PerLeak, Real, Sample, Sensors, signed_root};

/// Entries of a packed symmetric matrix, row by row of its lower triangle.
const PACKED: usize = COLUMNS * (COLUMNS + 1) / 2;
/// Two neighbours that differ by so many standard deviations are as dear to merge as two of twice the length; chosen.
const DIFFERENCE_SIGMAS: f64 = 3.0;
/// Keeps pressures that do not change solvable; numerical.
const DESCRIPTION_RIDGE: f64 = 1e-4;

/// The statistic, in at most `S` segments.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(
    feature = "serde",
    serde(bound(
        serialize = "T: serde::Serialize + Copy",
        deserialize = "T: Real + serde::Deserialize<'de>"
    ))
)]
pub struct ContinuityStatistic<T, const S: usize> {
    clocks: Clocks<T>,
    /// The last row, and its step, s.
    last: Option<Sample<T>>,
    step_s: T,
    blocks: BlockSums<T>,
    waiting: Waiting<T>,
    whitener: Whitener<T>,
    #[cfg_attr(feature = "serde", serde(with = "crate::number::arrays::vector"))]
    segments: [Segment<T>; S],
    used: usize,
    /// What is longer ago than this may be forgotten, s.
    horizon_s: T,
    scatter: [Scatter<T>; CHANNELS],
    time_s: T,
    roots: PerLeak<T>,
}

/// A flow without a reading for so long rests, until its own step is known; as long as two blocks. Chosen.
const LONGEST_SILENCE_S: f64 = 0.5;

/// Channels whose scatter is watched: position, P_A, P_B, Q_A, Q_B.
pub const CHANNELS: usize = 5;

/// Gram matrices of a stretch of the trace.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(
    feature = "serde",
    serde(bound(
        serialize = "T: serde::Serialize + Copy",
        deserialize = "T: Real + serde::Deserialize<'de>"
    ))
)]
pub struct Segment<T> {
    #[cfg_attr(feature = "serde", serde(with = "crate::number::arrays::matrix"))]
    gram: [[T; PACKED]; EQUATIONS],
    integral_noise: [[[T; 3]; INTEGRALS]; EQUATIONS],
    end_noise: [[[T; 3]; VOLUME_POWERS]; EQUATIONS],
    rows: [T; EQUATIONS],
    blocks: u32,
    time_s: T,
    pressure_time: PerLeak<T>,
}

impl<T: Real> Default for Segment<T> {
    fn default() -> Self {
        Self {
            gram: [[T::zero(); PACKED]; EQUATIONS],
            integral_noise: [[[T::zero(); 3]; INTEGRALS]; EQUATIONS],
            end_noise: [[[T::zero(); 3]; VOLUME_POWERS]; EQUATIONS],
            rows: [T::zero(); EQUATIONS],
            blocks: 0,
            time_s: T::zero(),
            pressure_time: PerLeak::default(),
        }
    }
}

/// Place of an entry of a packed symmetric matrix.
const fn packed(i: usize, j: usize) -> usize {
    if i >= j { i * (i + 1) / 2 + j } else { j * (j + 1) / 2 + i }
}

/// Column of a raw sum in the equation of chamber A (0) or B (1).
pub const fn column(raw: RawSum, chamber: usize) -> usize {
    chamber * RAW_SUMS + raw as usize
}

fn add_each<T: Real, const N: usize>(sums: &mut [[T; 3]; N], values: &[[T; 3]; N]) {
    for (sum, value) in sums.iter_mut().flatten().zip(values.iter().flatten()) {
        *sum += *value;
    }
}

/// Sums over time, by what they are sums of.
const AGED: [(RawSum, RawSum); 3] = [
    (RawSum::AgedPressureA, RawSum::PressureA),
    (RawSum::AgedPressureB, RawSum::PressureB),
    (RawSum::AgedTime, RawSum::Time),
];

impl<T: Real> Segment<T> {
    /// Product of two columns, summed over the rows of an equation; unit noise.
    pub fn product(&self, equation: usize, i: usize, j: usize) -> T {
        self.gram[equation][packed(i, j)]
    }

    /// Rows of an equation.
    pub fn rows(&self, equation: usize) -> T {
        self.rows[equation]
    }

    /// How long it is, s.
    pub fn time_s(&self) -> T {
        self.time_s
    }

    /// Mean size of the pressure across each leak, Pa.
    pub fn mean_pressures_pa(&self) -> PerLeak<T> {
        self.pressure_time.map(|sum| sum / (self.time_s * T::lit(MPA_PER_PA)))
    }

    /// What integrated noise of unit variance per s² adds to a product of chambers' columns, A A, A B, B B: noise of Q_A, of Q_B
    /// and of the pressures.
    pub fn integral_noise(&self, equation: usize) -> [[T; 3]; INTEGRALS] {
        self.integral_noise[equation]
    }

    /// What noise of unit variance at the blocks' ends adds to products of chambers' columns, times products of volumes:
    /// 1, V_A, V_B, V_A², V_A V_B, V_B².
    pub fn end_noise(&self, equation: usize) -> [[T; 3]; VOLUME_POWERS] {
        self.end_noise[equation]
    }

    fn add(&mut self, equation: usize, row: &Row<T>) {
        let gram = &mut self.gram[equation];
        let mut place = gram.iter_mut();
        for (i, one) in row.columns.iter().enumerate() {
            for (other, entry) in row.columns[..=i].iter().zip(place.by_ref()) {
                *entry += *one * *other;
            }
        }
        let RowNoise { integral, end } = row.noise;
        add_each(&mut self.integral_noise[equation], &integral);
        add_each(&mut self.end_noise[equation], &end);
        self.rows[equation] += T::one();
    }

    /// Its time counts from `earlier_s` before its begin.
    fn shift_time(&mut self, earlier_s: T) {
        for gram in &mut self.gram {
            for chamber in 0..2 {
                for (aged, plain) in AGED {
                    let (aged, plain) = (column(aged, chamber), column(plain, chamber));
                    let square = gram[packed(aged, aged)]
                        + earlier_s
                            * (T::lit(2.0) * gram[packed(aged, plain)]
                                + earlier_s * gram[packed(plain, plain)]);
                    for other in (0..COLUMNS).filter(|other| *other != aged) {
                        gram[packed(aged, other)] += earlier_s * gram[packed(plain, other)];
                    }
                    gram[packed(aged, aged)] = square;
                }
            }
        }
    }

    /// Puts the segment that follows to it.
    fn append(&mut self, next: &Self) {
        let mut next = *next;
        next.shift_time(self.time_s);
        for equation in 0..EQUATIONS {
            for (sum, value) in self.gram[equation].iter_mut().zip(next.gram[equation]) {
                *sum += value;
            }
            add_each(&mut self.integral_noise[equation], &next.integral_noise[equation]);
            add_each(&mut self.end_noise[equation], &next.end_noise[equation]);
            self.rows[equation] += next.rows[equation];
        }
        self.blocks += next.blocks;
        self.time_s += next.time_s;
        self.pressure_time = self.pressure_time.zip(next.pressure_time).map(|(own, next)| own + next);
    }

    /// What it costs to make one of two neighbours: their length, and what is lost where leaks and zeros of both are the same.
    fn cost(&self, next: &Self) -> T {
        let both =
            |equation: usize, i: usize, j: usize| self.product(equation, i, j) + next.product(equation, i, j);
        let apart = explained(|equation, i, j| self.product(equation, i, j))
            + explained(|equation, i, j| next.product(equation, i, j));
        let lost = (apart - explained(both)).at_least(T::zero());
        let length = T::lit(f64::from(self.blocks) + f64::from(next.blocks));
        length * (T::one() + lost / T::lit(DIFFERENCE_SIGMAS * DIFFERENCE_SIGMAS))
    }
}

/// Leaks and zeros that a stretch is described by, for the sake of comparison; the left side first.
const DESCRIPTION: usize = 6;

/// χ² that leaks and zeros of its own explain of a stretch.
fn explained<T: Real>(product: impl Fn(usize, usize, usize) -> T) -> T {
    use RawSum as R;
    let one = T::one();
    let at = column;
    let columns: [&[(usize, T)]; DESCRIPTION] = [
        &[(at(R::ResidualA, 0), one), (at(R::ResidualB, 1), one)],
        &[(at(R::Time, 0), one)],
        &[(at(R::Time, 1), one)],
        &[
            (at(R::PressureA, 0), one),
            (at(R::PressureB, 0), -one),
            (at(R::PressureA, 1), -one),
            (at(R::PressureB, 1), one),
        ],
        &[(at(R::PressureA, 0), one)],
        &[(at(R::PressureB, 1), one)],
    ];
    let entry = |i: usize, j: usize| {
        let mut sum = T::zero();
        for (one, of_one) in columns[i] {
            for (other, of_other) in columns[j] {
                for equation in 0..EQUATIONS {
                    sum += *of_one * *of_other * product(equation, *one, *other);
                }
            }
        }
        sum
    };
    let mut factor = [[T::zero(); DESCRIPTION]; DESCRIPTION];
    let mut half = [T::zero(); DESCRIPTION];
    let mut sum = T::zero();
    for i in 1..DESCRIPTION {
        for j in 1..=i {
            let mut value = entry(i, j);
            if i == j {
                value += T::lit(DESCRIPTION_RIDGE) * value;
            }
            for k in 1..j {
                value -= factor[i][k] * factor[j][k];
            }
            factor[i][j] = if i == j { value.at_least(T::zero()).sqrt() } else { value / factor[j][j] };
        }
        let mut value = entry(i, 0);
        for k in 1..i {
            value -= factor[i][k] * half[k];
        }
        if factor[i][i] > T::zero() {
            half[i] = value / factor[i][i];
        } else {
            // A column that is not there.
            factor[i][i] = T::one();
        }
        sum += half[i] * half[i];
    }
    sum
}

impl<T: Real, const S: usize> ContinuityStatistic<T, S> {
    /// No reading yet.
    pub fn new(cylinder: &Cylinder<T>, fluid: &Fluid<T>, sensors: &Sensors<T>) -> Self {
        Self {
            clocks: Clocks::new(T::lit(LONGEST_SILENCE_S)),
            last: None,
            step_s: T::zero(),
            blocks: BlockSums::new(cylinder, fluid),
            waiting: Waiting::new(cylinder, sensors),
            whitener: Whitener::new(cylinder, fluid, sensors),
            segments: [Segment::default(); S],
            used: 0,
            horizon_s: T::max_value(),
            scatter: [Scatter::default(); CHANNELS],
            time_s: T::zero(),
            roots: PerLeak::default(),
        }
    }

    /// Of a stream: forgets what is longer ago than `horizon_s`, as soon as its place is needed.
    #[must_use]
    pub fn forgetting(self, horizon_s: T) -> Self {
        Self { horizon_s, ..self }
    }

    /// Length of all segments but the first.
    fn later_s(&self) -> T {
        self.segments().iter().skip(1).fold(T::zero(), |sum, segment| sum + segment.time_s)
    }

    /// Takes in a reading that comes `dt_s` after the one before, or after a pause where that is not positive.
    pub fn push(&mut self, dt_s: T, sample: &Sample<T>) {
        let after_gap = dt_s <= T::zero();
        for (scatter, reading) in self.scatter.iter_mut().zip(sample.readings()) {
            scatter.add(reading, after_gap);
        }
        if !after_gap {
            let pressures = PerLeak {
                internal: sample.load_pressure_pa(),
                external_a: sample.pa_pa,
                external_b: sample.pb_pa,
            };
            self.time_s += dt_s;
            self.roots = self.roots.zip(pressures).map(|(sum, p)| sum + dt_s * signed_root(p).abs());
        }
        self.place(dt_s, sample);
    }

    /// Brings flows that are not read with every sample to the samples' times.
    fn place(&mut self, dt_s: T, sample: &Sample<T>) {
        if dt_s <= T::zero() {
            self.clocks.begin_anew();
            self.step_s = T::zero();
        } else if !self.clocks.is_empty() || self.waits_for(sample) {
            if let Some(last) = self.last.filter(|_| self.clocks.is_empty()) {
                self.clocks.go_on_after(&last, Some(self.step_s).filter(|step_s| *step_s > T::zero()));
            }
            self.step_s = T::zero();
            self.clocks.push(dt_s, &Readings::from(sample));
            return self.take_waiting();
        } else {
            // A flow that was not read before has another step than the rows.
            self.step_s = if self.follows(sample) { dt_s } else { T::zero() };
        }
        self.take_row(&clocks::Row::read(dt_s, sample));
    }

    /// Whether a flow has no reading after one that had.
    fn waits_for(&self, now: &Sample<T>) -> bool {
        let is_missing = |last: Option<T>, now: Option<T>| last.is_some() && now.is_none();
        self.last
            .is_some_and(|last| is_missing(last.qa_m3s, now.qa_m3s) || is_missing(last.qb_m3s, now.qb_m3s))
    }

    /// Whether each flow that is read was read with the row before, too.
    fn follows(&self, now: &Sample<T>) -> bool {
        let follows = |last: Option<T>, now: Option<T>| last.is_some() || now.is_none();
        self.last.is_some_and(|last| follows(last.qa_m3s, now.qa_m3s) && follows(last.qb_m3s, now.qb_m3s))
    }

    #[cold]
    fn take_waiting(&mut self) {
        loop {
            match self.clocks.pop() {
                Next::Waits => return,
                Next::Gap => self.last = None,
                Next::Row(row) => self.take_row(&row),
            }
        }
    }

    fn take_row(&mut self, row: &clocks::Row<T>) {
        self.last = Some(row.sample);
        if let Some(block) = self.blocks.push(row) {
            self.take(&block);
        }
    }

    /// Takes the blocks that still wait for their segment into one, for a verdict: of a statistic that goes on, close a copy.
    pub fn close(&mut self) {
        if let Some(at) = self.waiting.change() {
            self.end_segment(at, 1);
        }
        self.end_segment(self.waiting.blocks().len(), 0);
    }

    /// The segments so far, oldest first.
    pub fn segments(&self) -> &[Segment<T>] {
        self.segments.get(..self.used).unwrap_or(&self.segments)
    }

    /// Mean root of that size, √Pa.
    pub fn mean_roots(&self) -> PerLeak<T> {
        self.roots.map(|sum| sum / self.time_s)
    }

    /// Standard deviation of each channel's readings as their third differences tell it; the motion's share in those is
    /// small but for slow sampling.
    pub fn scatter(&self) -> [Option<T>; CHANNELS] {
        self.scatter.map(|scatter| scatter.std())
    }

    fn take(&mut self, block: &Block<T>) {
        if block.begins_at.is_some() {
            self.close();
        }
        self.waiting.add(block);
        if self.waiting.is_full() {
            match self.waiting.change() {
                // The block in which a flow changed is of neither level.
                Some(at) => self.end_segment(at, 1),
                None => self.end_segment(SEGMENT_BLOCKS, 0),
            }
        }
    }

    /// Makes a segment of the oldest waiting blocks, and leaves out some that follow.
    fn end_segment(&mut self, blocks: usize, left_out: usize) {
        if blocks == 0 {
            return;
        }
        self.begin_segment();
        for place in 0..blocks {
            if let Some(block) = self.waiting.blocks().get(place).copied() {
                self.add(&block);
            }
        }
        self.waiting.release(blocks + left_out);
    }

    fn add(&mut self, block: &Block<T>) {
        let mut block = *block;
        let begins_s = self.segments[..self.used].last().map_or(T::zero(), |last| last.time_s);
        for (aged, plain) in AGED {
            block.sums[aged as usize] += begins_s * block.sums[plain as usize];
        }
        let rows = self.whitener.push(&block);
        let Some(segment) = self.used.checked_sub(1).and_then(|last| self.segments.get_mut(last)) else {
            return;
        };
        for (equation, row) in rows.into_iter().enumerate() {
            let Some(row) = row else { continue };
            segment.add(equation, &row);
        }
        segment.blocks += 1;
        segment.time_s += block.sums[RawSum::Time as usize];
        let [pa, pb] = [RawSum::PressureA, RawSum::PressureB].map(|raw| block.sums[raw as usize]);
        let sizes = PerLeak { internal: (pa - pb).abs(), external_a: pa.abs(), external_b: pb.abs() };
        segment.pressure_time = segment.pressure_time.zip(sizes).map(|(sum, size)| sum + size);
    }

    /// Makes room where there is none; a segment's noise is independent of that of those before.
    fn begin_segment(&mut self) {
        if self.used == S && self.later_s() >= self.horizon_s {
            self.segments.copy_within(1.., 0);
            self.used -= 1;
        }
        if self.used == S {
            let cheapest = (1..S)
                .map(|next| (next, self.segments[next - 1].cost(&self.segments[next])))
                .fold((1, T::infinity()), |best, one| if one.1 < best.1 { one } else { best })
                .0;
            let next = self.segments[cheapest];
            self.segments[cheapest - 1].append(&next);
            self.segments.copy_within(cheapest + 1.., cheapest);
            self.used -= 1;
        }
        self.segments[self.used] = Segment::default();
        self.used += 1;
        self.whitener.begin_anew();
    }
}
