// Index loops over const bounds: they read like the algebra and the bounds checks vanish.
#![allow(clippy::needless_range_loop)]

use crate::{Real, Sample};

/// Rows that wait at most; a row more, and the one that is missed least is dropped as if it had never been read. A channel
/// that comes ten times as rarely as the others, of which every tenth reading is lost, stays within that (chosen).
const ROWS: usize = 12;
/// Steps of its own that a channel may be without a reading: a longer hole is a rest (chosen: three readings in a row that get
/// lost are one in a thousand where a tenth does, and a fourth of a period in which a flow turns is not drawn as a line).
const HOLE_STEPS: f64 = 4.0;
/// By how much the step of a channel grows at most from one reading to the next, so that a hole is no step (chosen).
const STEP_GROWTH: f64 = 2.0;

/// Rows closer to each other than this share of a channel's step are no rows of a recording: a number that keeps infinities out
/// (chosen).
const LARGEST_DILUTION: f64 = 1e6;

const CHANNELS: usize = 5;
/// Without these no equation can be integrated; a chamber without flow only rests.
const NEEDED: usize = 3;

/// Something of each channel.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct PerChannel<T> {
    /// Of the piston position.
    pub x: T,
    /// Of the pressure in chamber A.
    pub pa: T,
    /// Of the pressure in chamber B.
    pub pb: T,
    /// Of the flow into chamber A.
    pub qa: T,
    /// Of the flow into chamber B.
    pub qb: T,
}

impl<T> PerChannel<T> {
    fn array(self) -> [T; CHANNELS] {
        [self.x, self.pa, self.pb, self.qa, self.qb]
    }

    fn of([x, pa, pb, qa, qb]: [T; CHANNELS]) -> Self {
        Self { x, pa, pb, qa, qb }
    }
}

/// What was read at one time, SI as in [`Sample`]; none where a channel has no reading then.
pub type Readings<T> = PerChannel<Option<T>>;

impl<T: Copy> From<&Sample<T>> for Readings<T> {
    fn from(sample: &Sample<T>) -> Self {
        Self {
            x: Some(sample.x_m),
            pa: Some(sample.pa_pa),
            pb: Some(sample.pb_pa),
            qa: sample.qa_m3s,
            qb: sample.qb_m3s,
        }
    }
}

/// Brings channels that each have a clock of their own to the rows' times.
///
/// Between two of its readings a channel is the straight line from one to the other, so that the trapezoidal rule over all
/// rows is that between the channel's own readings. A row waits until every channel is known at its time. A channel
/// rests from its last reading to the next where the hole is longer than four steps of its own.
///
/// ```
/// use pitchleak_core::continuity::{Clocks, Next, Readings};
///
/// let mut clocks = Clocks::new(0.5);
/// let mut flows = Vec::new();
/// for k in 0..30_u8 {
///     let t_s = 0.01 * f64::from(k);
///     let qa = (k % 10 == 0).then_some(1e-4 * t_s);
///     clocks.push(0.01, &Readings { x: Some(0.1), pa: Some(5e6), pb: Some(4e6), qa, qb: None });
///     while let Next::Row(row) = clocks.pop() {
///         flows.push(row.sample.qa_m3s.unwrap());
///     }
/// }
/// // Readings of the flow came at 0, 0.1 and 0.2 s.
/// assert_eq!(flows.len(), 21);
/// assert!((flows[13] - 1e-4 * 0.13).abs() < 1e-12);
/// ```
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Clocks<T> {
    channels: [Channel<T>; CHANNELS],
    /// From `first` on, around.
    rows: [Waiting<T>; ROWS],
    first: u8,
    count: u8,
}

/// A channel as far as the rows were told.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Channel<T> {
    /// Its last reading; none where it rests.
    last: Option<T>,
    /// Age of its last reading, s, also where it rests; infinite before the first.
    age_s: T,
    /// Its own step, s.
    step_s: T,
}

/// A row that waits; a microcontroller keeps it in fewer bytes than options take.
#[derive(Clone, Copy, Debug, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Waiting<T> {
    /// Time since the row before, s.
    dt_s: T,
    readings: [T; CHANNELS],
    /// A bit for each channel that has a reading.
    read: u8,
    /// The row before was dropped.
    thinned: bool,
}

impl<T: Real> Waiting<T> {
    fn new(dt_s: T, readings: &Readings<T>) -> Self {
        let mut row = Self { dt_s, readings: [T::zero(); CHANNELS], read: 0, thinned: false };
        for (c, reading) in readings.array().into_iter().enumerate() {
            if let Some(value) = reading {
                row.readings[c] = value;
                row.read |= 1 << c;
            }
        }
        row
    }

    #[inline]
    fn reading(&self, channel: usize) -> Option<T> {
        let value = self.readings.get(channel).copied();
        value.filter(|_| self.read & (1 << channel) != 0)
    }
}

/// What comes next.
#[derive(Clone, Copy, Debug)]
pub enum Next<T> {
    /// Nothing before more is read.
    Waits,
    /// A row at whose time the position or a pressure is not known: nothing can be integrated over it.
    Gap,
    /// A row at whose time every channel is known or rests.
    Row(Row<T>),
}

/// A row at whose time every channel is known or rests.
#[derive(Clone, Copy, Debug)]
pub struct Row<T> {
    /// Time since the row before, s.
    pub dt_s: T,
    /// Readings, or what stands between two of them; a chamber that rests has no flow.
    pub sample: Sample<T>,
    /// Whether the channel was read at this time.
    pub read: PerChannel<bool>,
    /// Time between the channel's readings before and after, s: the noise of ∫ Q dt over the step that ends here is that of one
    /// reading over this time, its share of it. The step's own time where the channel rests.
    pub own_step_s: PerChannel<T>,
    /// A row before it was dropped, as too many waited: the step is longer than what was read.
    pub thinned: bool,
}

impl<T: Real> Row<T> {
    /// All of `sample` was read, `dt_s` after the row before in which it was, too.
    pub fn read(dt_s: T, sample: &Sample<T>) -> Self {
        let (read, own_step_s) = (PerChannel::of([true; CHANNELS]), PerChannel::of([dt_s; CHANNELS]));
        Self { dt_s, sample: Sample { force_n: None, ..*sample }, read, own_step_s, thinned: false }
    }

    /// Factor on the variance of what is integrated over the step, for each channel, beside readings at every row.
    pub fn dilution(&self) -> PerChannel<T> {
        let share = |own_s: T| (own_s / self.dt_s).at_most(T::lit(LARGEST_DILUTION));
        PerChannel::of(self.own_step_s.array().map(share))
    }
}

/// What is known of a channel at the time of the first row that waits.
enum Known<T> {
    NotYet,
    Rests,
    /// Its value, whether it was read just then, and the time between the readings about the step, s.
    Value {
        value: T,
        read: bool,
        own_step_s: T,
    },
}

impl<T: Real> Channel<T> {
    /// At the time of the first row that waits, `dt_s` after the row before; `next` is its reading in the rows that wait, whether in
    /// the first of them, and `after_s` the time from the row before to it, or to the last row.
    fn known(&self, dt_s: T, next: Option<(T, bool)>, after_s: T) -> Known<T> {
        let own_step_s = self.age_s + after_s;
        let last = self.last.filter(|_| own_step_s <= T::lit(HOLE_STEPS) * self.step_s);
        match (last, next) {
            (Some(_), None) => Known::NotYet,
            (Some(_), Some((value, true))) => Known::Value { value, read: true, own_step_s },
            (Some(last), Some((next, false))) => {
                let share = (self.age_s + dt_s) / own_step_s;
                Known::Value { value: last + share * (next - last), read: false, own_step_s }
            }
            // After a rest, or a hole: the reading itself is known, the time before it is not.
            (None, Some((value, true))) => Known::Value { value, read: true, own_step_s: dt_s },
            (None, _) => Known::Rests,
        }
    }

    /// The first row that waits is told, with this reading, `dt_s` after the row before.
    #[cfg_attr(target_os = "none", inline(never))] // once in the flash, not for each channel
    fn leave(&mut self, dt_s: T, reading: Option<T>, rests: bool) {
        self.age_s += dt_s;
        if rests {
            self.last = None;
        }
        if reading.is_some() {
            self.last = reading;
            if self.age_s.is_finite() {
                self.step_s = self.age_s.at_most(T::lit(STEP_GROWTH) * self.step_s);
            }
            self.age_s = T::zero();
        }
    }
}

impl<T: Real> Clocks<T> {
    /// Before any reading; of a channel that was read once nobody knows how soon it comes again: `longest_s` it may take.
    pub fn new(longest_s: T) -> Self {
        let step_s = longest_s / T::lit(HOLE_STEPS);
        Self {
            channels: [Channel { last: None, age_s: T::infinity(), step_s }; CHANNELS],
            rows: [Waiting::new(T::zero(), &Readings::default()); ROWS],
            first: 0,
            count: 0,
        }
    }

    /// Whether no row waits.
    #[inline]
    pub fn is_empty(&self) -> bool {
        self.count == 0
    }

    /// Goes on after `sample`, in which every channel was read that does not rest, as all were at steps of `step_s` before
    /// (none: their steps are as they were). Rows that wait are forgotten.
    pub fn go_on_after(&mut self, sample: &Sample<T>, step_s: Option<T>) {
        self.count = 0;
        for (channel, last) in self.channels.iter_mut().zip(Readings::from(sample).array()) {
            channel.last = last;
            channel.age_s = T::zero();
            if let (Some(step_s), Some(_)) = (step_s, last) {
                channel.step_s = step_s;
            }
        }
    }

    /// Rows that wait are forgotten.
    pub fn forget_rows(&mut self) {
        self.count = 0;
    }

    /// Goes on as before any reading, with the steps that the channels had.
    pub fn begin_anew(&mut self) {
        self.count = 0;
        for channel in &mut self.channels {
            channel.last = None;
            channel.age_s = T::infinity();
        }
    }

    /// Takes in what was read `dt_s` after the row before; says whether a row that waited had to be dropped.
    pub fn push(&mut self, dt_s: T, readings: &Readings<T>) -> bool {
        let dropped = usize::from(self.count) >= ROWS;
        if dropped {
            self.thin();
        }
        let place = self.place(usize::from(self.count));
        if let Some(row) = self.rows.get_mut(place) {
            *row = Waiting::new(dt_s, readings);
            self.count += 1;
        }
        dropped
    }

    /// The first row that waits, once every channel is known at its time.
    pub fn pop(&mut self) -> Next<T> {
        let Some(front) = self.waiting(0).copied() else { return Next::Waits };
        let mut values = [None; CHANNELS];
        let mut read = [false; CHANNELS];
        let mut own_step_s = [front.dt_s; CHANNELS];
        for c in 0..CHANNELS {
            match self.known(c, front.dt_s) {
                Known::NotYet => return Next::Waits,
                Known::Rests => {}
                Known::Value { value, read: just, own_step_s: own_s } => {
                    values[c] = Some(value);
                    read[c] = just;
                    own_step_s[c] = own_s;
                }
            }
        }
        for (c, channel) in self.channels.iter_mut().enumerate() {
            channel.leave(front.dt_s, front.reading(c), values[c].is_none());
        }
        self.first = self.place(1) as u8;
        self.count -= 1;
        let [Some(x_m), Some(pa_pa), Some(pb_pa), qa_m3s, qb_m3s] = values else { return Next::Gap };
        const { assert!(NEEDED == 3) };
        let sample = Sample { x_m, pa_pa, pb_pa, qa_m3s, qb_m3s, force_n: None };
        let (read, own_step_s) = (PerChannel::of(read), PerChannel::of(own_step_s));
        Next::Row(Row { dt_s: front.dt_s, sample, read, own_step_s, thinned: front.thinned })
    }

    /// Where the row stands before which `before` others wait.
    #[inline]
    fn place(&self, before: usize) -> usize {
        let place = usize::from(self.first) + before;
        if place < ROWS { place } else { place - ROWS }
    }

    /// The row before which `before` others wait.
    #[inline]
    fn waiting(&self, before: usize) -> Option<&Waiting<T>> {
        if before < usize::from(self.count) { self.rows.get(self.place(before)) } else { None }
    }

    /// A channel at the time of the first row that waits, `dt_s` after the row before.
    #[cfg_attr(target_os = "none", inline(never))] // once in the flash, not for each channel
    fn known(&self, channel: usize, dt_s: T) -> Known<T> {
        let Some(own) = self.channels.get(channel) else { return Known::Rests };
        let mut after_s = T::zero();
        let mut before = 0;
        while let Some(row) = self.waiting(before) {
            after_s += row.dt_s;
            if let Some(next) = row.reading(channel) {
                return own.known(dt_s, Some((next, before == 0)), after_s);
            }
            before += 1;
        }
        own.known(dt_s, None, after_s)
    }

    /// Drops the row with the fewest readings, of several the one that leaves the shortest step; never the newest.
    fn thin(&mut self) {
        let mut least = (u32::MAX, T::infinity());
        let mut dropped = 0;
        let mut before = 0;
        while let (Some(row), Some(next)) = (self.waiting(before), self.waiting(before + 1)) {
            let readings = row.read.count_ones();
            let step_s = row.dt_s + next.dt_s;
            if readings < least.0 || (readings == least.0 && step_s < least.1) {
                least = (readings, step_s);
                dropped = before;
            }
            before += 1;
        }
        let next = self.place(dropped + 1);
        if let Some(next) = self.rows.get_mut(next) {
            next.dt_s = least.1;
            next.thinned = true;
        }
        for before in (0..dropped).rev() {
            self.move_up(before);
        }
        self.first = self.place(1) as u8;
        self.count -= 1;
    }

    /// A row changes its place with the next.
    #[cfg_attr(target_os = "none", inline(never))] // once in the flash, not for each row
    fn move_up(&mut self, before: usize) {
        let (from, to) = (self.place(before), self.place(before + 1));
        if from < ROWS && to < ROWS {
            self.rows.swap(from, to);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::vec::Vec;

    const DT_S: f64 = 0.01;

    fn readings(qa: Option<f64>) -> Readings<f64> {
        Readings { x: Some(0.1), pa: Some(5e6), pb: Some(4e6), qa, qb: Some(1.0) }
    }

    /// All rows that come of these flows of chamber A, and how many gaps.
    fn rows(flows: impl IntoIterator<Item = Option<f64>>) -> Vec<Row<f64>> {
        let mut clocks = Clocks::new(0.5);
        let mut rows = Vec::new();
        for flow in flows {
            clocks.push(DT_S, &readings(flow));
            while let Next::Row(row) = clocks.pop() {
                rows.push(row);
            }
        }
        rows
    }

    /// ∫ Q dt by the rows up to the last, and the variance of that for readings of unit variance.
    fn integral(rows: &[Row<f64>]) -> (f64, f64) {
        let steps = rows.iter().zip(rows.iter().skip(1));
        steps.fold((0.0, 0.0), |(sum, variance), (last, now)| {
            let flows = last.sample.qa_m3s.unwrap() + now.sample.qa_m3s.unwrap();
            (sum + 0.5 * now.dt_s * flows, variance + now.dt_s * now.dt_s * now.dilution().qa)
        })
    }

    proptest! {
        /// The trapezoidal rule over the rows is that between the channel's own readings, and so is its noise.
        #[test]
        fn the_integral_is_that_between_own_readings(
            gaps in prop::collection::vec(1..4_usize, 2..30), seed in any::<u32>(),
        ) {
            let value = |k: usize| (f64::from(seed % 97) + 1.3 * k as f64).sin();
            let mut flows = Vec::from([Some(value(0))]);
            // The first gap is as long as any, so that no other is a hole.
            let gaps: Vec<usize> = core::iter::once(3).chain(gaps).collect();
            for (k, gap) in gaps.iter().enumerate() {
                flows.extend(core::iter::repeat_n(None, gap - 1));
                flows.push(Some(value(k + 1)));
            }
            let (found, variance) = integral(&rows(flows));
            let own = gaps.iter().map(|gap| *gap as f64 * DT_S);
            let expected: f64 = own.clone().enumerate().map(|(k, own_s)| 0.5 * own_s * (value(k) + value(k + 1))).sum();
            prop_assert!((found - expected).abs() < 1e-12, "{found} {expected}");
            let expected: f64 = own.map(|own_s| own_s * own_s).sum();
            prop_assert!((variance / expected - 1.0).abs() < 1e-9, "{variance} {expected}");
        }
    }

    /// Whatever comes, every row is told once and in order, or dropped where too many wait; and all but the last few are told.
    #[test]
    fn a_slow_channel_holds_back_a_few_rows_only() {
        let told = rows((0..1000_u32).map(|k| (k % 10 == 0).then_some(1.0)));
        assert_eq!(told.len(), 991);
        // Fifty rows to a reading are more than can wait: what is told is as long as what was read.
        let mut clocks = Clocks::new(1.0);
        let mut time_s = 0.0;
        for k in 0..1001_u32 {
            clocks.push(DT_S, &readings((k % 50 == 0).then_some(f64::from(k))));
            while let Next::Row(row) = clocks.pop() {
                time_s += row.dt_s;
                assert!(row.dt_s < 0.1, "rows are dropped evenly: {row:?}");
                assert!((row.sample.qa_m3s.unwrap() - (time_s / DT_S - 1.0)).abs() < 1e-6, "{row:?}");
            }
        }
        assert!((time_s - 1001.0 * DT_S).abs() < 1e-9, "{time_s}");
    }

    /// A hole of more than four steps is a rest from the last reading on, a shorter one is none; and nobody waits for a channel
    /// that has rested.
    #[test]
    fn a_long_hole_is_a_rest() {
        let hole = |missing: usize| {
            let flows =
                [Some(1.0); 20].into_iter().chain(core::iter::repeat_n(None, missing)).chain([Some(1.0); 20]);
            rows(flows).iter().filter(|row| row.sample.qa_m3s.is_none()).count()
        };
        assert_eq!([hole(1), hole(3), hole(4), hole(5), hole(40)], [0, 0, 4, 5, 40]);
        // Nobody waits longer for one that has stopped than a hole may be long.
        let stopped = |missing: usize| {
            rows([Some(1.0); 20].into_iter().chain(core::iter::repeat_n(None, missing))).len()
        };
        assert_eq!([stopped(3), stopped(6)], [20, 26]);
        // A hole is no step: after it the next one is as long as any.
        let twice = [Some(1.0); 20]
            .into_iter()
            .chain([None; 40])
            .chain([Some(1.0)])
            .chain([None; 10])
            .chain([Some(1.0); 3]);
        assert_eq!(rows(twice).iter().filter(|row| row.sample.qa_m3s.is_none()).count(), 50);
        let never = rows(core::iter::repeat_n(None, 50));
        assert!(never.len() == 50 && never.iter().all(|row| row.sample.qa_m3s.is_none()));
    }

    /// Position and pressures on clocks that never meet are known between their readings; without a pressure there is a gap.
    #[test]
    fn clocks_need_not_meet() {
        let mut clocks = Clocks::<f64>::new(0.5);
        let (mut told, mut gaps) = (0, 0);
        for k in 0..400_u32 {
            let at = |turn: u32, value: f64| (k % 3 == turn).then_some(value * (1.0 + f64::from(k)));
            let pb = at(2, 4e6).filter(|_| k < 300);
            clocks
                .push(DT_S, &Readings { x: at(0, 1e-4), pa: at(1, 5e6), pb, qa: at(0, 1.0), qb: at(1, 1.0) });
            loop {
                match clocks.pop() {
                    Next::Waits => break,
                    Next::Gap => gaps += 1,
                    Next::Row(row) => {
                        told += 1;
                        // All lines have one slope.
                        let Sample { x_m, pa_pa, pb_pa, qa_m3s, .. } = row.sample;
                        let k = x_m / 1e-4;
                        assert!((pa_pa / 5e6 / k - 1.0).abs() < 1e-9 && (pb_pa / 4e6 / k - 1.0).abs() < 1e-9);
                        assert!((qa_m3s.unwrap() / k - 1.0).abs() < 1e-9);
                    }
                }
            }
        }
        // From the first reading of P_B, the third row, to its last, the 300th; the two before are gaps.
        assert!((told, gaps > 80) == (298, true), "{told} {gaps}");
    }
}
