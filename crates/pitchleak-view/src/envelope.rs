//! What a screen can show of a trace of any length, in bounded memory: for each stretch of time the least, the
//! greatest and the median reading.

/// Stretches at most, unless fewer are asked for. Where they are used up, they are joined in pairs.
const MOST_STRETCHES: usize = 1200;
/// Length of the first stretches, s: short enough for a row each in any trace.
const SHORTEST_S: f64 = 1e-6;
/// Readings, evenly spaced, of which a stretch's median is taken.
const MOST_KEPT: usize = 32;

/// A quantity at one time: a reading, or an estimate with its bounds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spot {
    /// Lower bound; of a reading itself.
    pub low: f64,
    /// Best value.
    pub value: f64,
    /// Upper bound; of a reading itself.
    pub high: f64,
}

impl Spot {
    /// A reading.
    pub fn at(value: f64) -> Self {
        Self { low: value, value, high: value }
    }

    fn is_finite(&self) -> bool {
        self.low.is_finite() && self.value.is_finite() && self.high.is_finite()
    }
}

/// The least and the greatest; of none, infinities the other way round.
pub(crate) fn extremes(values: impl IntoIterator<Item = f64>) -> [f64; 2] {
    let none = [f64::INFINITY, f64::NEG_INFINITY];
    values.into_iter().fold(none, |[low, high], value| [low.min(value), high.max(value)])
}

/// `N` quantities over time.
#[derive(Clone, Debug)]
pub struct Envelopes<const N: usize> {
    time: RisingTime,
    paused: bool,
    start_s: f64,
    stretch_s: f64,
    most: usize,
    stretches: Vec<Stretch<N>>,
}

/// What happened in a stretch of time.
#[derive(Clone, Debug)]
struct Stretch<const N: usize> {
    /// Times of the first and the last row in it, s; none without a row.
    times_s: Option<[f64; 2]>,
    /// The trace pauses before its first row.
    after_gap: bool,
    spreads: [Spread; N],
}

/// What one quantity did in it.
#[derive(Clone, Debug)]
struct Spread {
    low: f32,
    high: f32,
    /// Every `stride`th value.
    kept: Vec<f32>,
    stride: u32,
    /// Values until the next one that is kept.
    wait: u32,
}

/// Times that never go back, however often the clock is set.
#[derive(Clone, Copy, Debug, Default)]
struct RisingTime {
    last_s: Option<f64>,
    shift_s: f64,
}

impl RisingTime {
    /// `t_s`, counted on where it is before the last one.
    fn after_last(&mut self, t_s: f64) -> f64 {
        if let Some(last_s) = self.last_s.filter(|last_s| t_s < *last_s) {
            self.shift_s += last_s - t_s;
        }
        self.last_s = Some(t_s);
        t_s + self.shift_s
    }
}

/// Least, median and greatest value of a quantity in one stretch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Range {
    /// Least lower bound.
    pub low: f64,
    /// Median value, of 32 evenly spaced ones where there are more.
    pub median: f64,
    /// Greatest upper bound.
    pub high: f64,
}

/// All quantities of one stretch; one without any, between two stretches, where the trace pauses.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Row<const N: usize> {
    /// Middle of its rows, s.
    pub t_s: f64,
    /// None where the quantity was not there.
    pub ranges: [Option<Range>; N],
}

impl<const N: usize> Default for Envelopes<N> {
    fn default() -> Self {
        Self::of_at_most(MOST_STRETCHES)
    }
}

impl<const N: usize> Envelopes<N> {
    /// Of so many stretches, at least half of them where the trace has as many rows.
    pub fn of_at_most(most: usize) -> Self {
        let time = RisingTime::default();
        Self { time, paused: false, start_s: 0.0, stretch_s: SHORTEST_S, most, stretches: Vec::new() }
    }

    /// The trace pauses before what comes next.
    pub fn pause(&mut self) {
        self.paused = true;
    }

    /// Takes in what there is at `t_s`; a time before the last one is counted on from that.
    pub fn add(&mut self, t_s: f64, spots: &[Option<Spot>; N]) {
        let t_s = self.time.after_last(t_s);
        if self.stretches.is_empty() {
            self.start_s = t_s;
        }
        let mut index = self.index(t_s);
        while index >= self.most {
            self.join_pairs();
            index = self.index(t_s);
        }
        while self.stretches.len() <= index {
            self.stretches.push(Stretch::default());
        }
        if let Some(stretch) = self.stretches.get_mut(index) {
            stretch.add(t_s, std::mem::take(&mut self.paused), spots);
        }
    }

    fn index(&self, t_s: f64) -> usize {
        ((t_s - self.start_s) / self.stretch_s) as usize
    }

    fn join_pairs(&mut self) {
        let joined = self.stretches.chunks_mut(2).map(|pair| match pair {
            [first, second] => std::mem::take(first).followed_by(std::mem::take(second)),
            rest => rest.first_mut().map(std::mem::take).unwrap_or_default(),
        });
        self.stretches = joined.collect();
        self.stretch_s *= 2.0;
    }

    /// The stretches with rows in the order of time, one without values at every pause.
    pub fn rows(&self) -> Vec<Row<N>> {
        let mut rows = Vec::with_capacity(self.stretches.len());
        let mut before_s = None;
        for stretch in &self.stretches {
            let Some([first_s, last_s]) = stretch.times_s else { continue };
            if let Some(before_s) = before_s.filter(|_| stretch.after_gap) {
                rows.push(Row { t_s: f64::midpoint(before_s, first_s), ranges: [None; N] });
            }
            let ranges = std::array::from_fn(|n| stretch.spreads.get(n).and_then(Spread::range));
            rows.push(Row { t_s: f64::midpoint(first_s, last_s), ranges });
            before_s = Some(last_s);
        }
        rows
    }

    /// Each quantity's median in at most `columns` stretches of the same length; none where it was not there.
    pub fn courses(&self, columns: usize) -> [Vec<Option<f64>>; N] {
        let rows = self.rows();
        let columns = columns.min(rows.len());
        let (first, last) = rows.first().zip(rows.last()).map_or((0.0, 0.0), |(a, b)| (a.t_s, b.t_s));
        let column = |t_s: f64| {
            let share = (t_s - first) / (last - first).max(f64::MIN_POSITIVE);
            ((share * columns as f64) as usize).min(columns.saturating_sub(1))
        };
        std::array::from_fn(|n| {
            let mut sums = vec![(0.0, 0_u32); columns];
            for row in &rows {
                let range = row.ranges.get(n).copied().flatten();
                if let (Some((sum, count)), Some(range)) = (sums.get_mut(column(row.t_s)), range) {
                    *sum += range.median;
                    *count += 1;
                }
            }
            sums.into_iter().map(|(sum, count)| (count > 0).then(|| sum / f64::from(count))).collect()
        })
    }
}

impl<const N: usize> Default for Stretch<N> {
    fn default() -> Self {
        Self { times_s: None, after_gap: false, spreads: std::array::from_fn(|_| Spread::default()) }
    }
}

impl<const N: usize> Stretch<N> {
    fn add(&mut self, t_s: f64, after_gap: bool, spots: &[Option<Spot>; N]) {
        let [first_s, _] = self.times_s.unwrap_or([t_s, t_s]);
        self.after_gap |= after_gap && self.times_s.is_none();
        self.times_s = Some([first_s, t_s]);
        for (spread, spot) in self.spreads.iter_mut().zip(spots) {
            if let Some(spot) = spot.filter(Spot::is_finite) {
                spread.add(spot);
            }
        }
    }

    fn followed_by(mut self, later: Self) -> Self {
        let Some([first_s, last_s]) = later.times_s else { return self };
        let Some([start_s, _]) = self.times_s else { return later };
        self.times_s = Some([start_s.min(first_s), last_s]);
        for (spread, later) in self.spreads.iter_mut().zip(later.spreads) {
            spread.join(later);
        }
        self
    }
}

impl Default for Spread {
    fn default() -> Self {
        Self { low: f32::INFINITY, high: f32::NEG_INFINITY, kept: Vec::new(), stride: 1, wait: 0 }
    }
}

impl Spread {
    fn add(&mut self, spot: Spot) {
        self.low = self.low.min(spot.low as f32);
        self.high = self.high.max(spot.high as f32);
        if self.wait > 0 {
            self.wait -= 1;
            return;
        }
        self.kept.push(spot.value as f32);
        self.wait = self.stride - 1;
        if self.kept.len() > MOST_KEPT {
            self.thin();
        }
    }

    /// Keeps every second value.
    fn thin(&mut self) {
        let mut number = 0;
        self.kept.retain(|_| {
            number += 1;
            number % 2 == 1
        });
        self.stride = self.stride.saturating_mul(2);
        self.wait = self.stride - 1;
    }

    fn join(&mut self, mut later: Self) {
        self.low = self.low.min(later.low);
        self.high = self.high.max(later.high);
        while self.stride < later.stride && !self.kept.is_empty() {
            self.thin();
        }
        while later.stride < self.stride && !later.kept.is_empty() {
            later.thin();
        }
        (self.stride, self.wait) = (self.stride.max(later.stride), later.wait);
        self.kept.append(&mut later.kept);
        if self.kept.len() > MOST_KEPT {
            let wait = self.wait;
            self.thin();
            self.wait = wait;
        }
    }

    fn range(&self) -> Option<Range> {
        let mut sorted = self.kept.clone();
        sorted.sort_by(f32::total_cmp);
        let upper = *sorted.get(sorted.len() / 2)?;
        let lower = *sorted.get((sorted.len() - 1) / 2)?;
        let median = f64::midpoint(f64::from(lower), f64::from(upper));
        Some(Range { low: f64::from(self.low), median, high: f64::from(self.high) })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn readings(count: u32, value: impl Fn(f64) -> f64) -> Vec<Row<1>> {
        let mut envelopes = Envelopes::default();
        for k in 0..count {
            let t_s = f64::from(k) * 0.01;
            envelopes.add(t_s, &[Some(Spot::at(value(t_s)))]);
        }
        envelopes.rows()
    }

    fn range(row: &Row<1>) -> Range {
        row.ranges[0].expect("has a reading")
    }

    #[test]
    fn a_short_trace_is_shown_as_it_is() {
        let rows = readings(500, f64::sin);
        assert_eq!(rows.len(), 500);
        for row in rows {
            let Range { low, median, high } = range(&row);
            assert!((median - row.t_s.sin()).abs() < 1e-6 && low.total_cmp(&high).is_eq());
        }
    }

    #[test]
    fn no_spike_is_lost_and_no_stretch_is_more_than_asked_for() {
        let rows =
            readings(300_000, |t_s| if (t_s - 1234.56).abs() < 1e-6 { 9.0 } else { (0.01 * t_s).sin() });
        assert!((MOST_STRETCHES / 2..=MOST_STRETCHES).contains(&rows.len()), "{}", rows.len());
        let highest = rows.iter().max_by(|a, b| range(a).high.total_cmp(&range(b).high)).expect("rows");
        assert!((range(highest).high - 9.0).abs() < 1e-6 && (highest.t_s - 1234.56).abs() < 5.0);
        for row in &rows {
            let Range { low, median, high } = range(row);
            assert!((median - (0.01 * row.t_s).sin()).abs() < 0.02, "at {}: {median}", row.t_s);
            assert!(low <= median && median <= high);
        }
    }

    #[test]
    fn the_median_stands_among_outliers() {
        let rows =
            readings(
                100_000,
                |t_s| if ((t_s * 100.0).round() as u32).is_multiple_of(3) { 50.0 } else { 1.0 },
            );
        assert!(rows.iter().all(|row| (range(row).median - 1.0).abs() < 1e-6));
    }

    #[test]
    fn a_pause_breaks_the_line_however_long_the_trace() {
        let mut envelopes = Envelopes::<1>::default();
        for k in 0..200_000_u32 {
            let late = k >= 100_000;
            let t_s = 0.01 * f64::from(k) + if late { 300.0 } else { 0.0 };
            if k == 100_000 {
                envelopes.pause();
            }
            envelopes.add(t_s, &[Some(Spot::at(1.0))]);
        }
        let rows = envelopes.rows();
        let breaks: Vec<_> = rows.iter().filter(|row| row.ranges[0].is_none()).collect();
        assert!(matches!(breaks.as_slice(), [one] if (1000.0..1300.0).contains(&one.t_s)), "{breaks:?}");
        assert!(rows.windows(2).all(|pair| pair[0].t_s < pair[1].t_s));
    }

    #[test]
    fn what_is_missing_or_no_number_leaves_no_mark() {
        let mut envelopes = Envelopes::<2>::default();
        envelopes.add(5.0, &[None, Some(Spot::at(f64::NAN))]);
        envelopes.add(1e12, &[Some(Spot { low: 1.0, value: 2.0, high: f64::INFINITY }), None]);
        assert!(envelopes.rows().iter().all(|row| row.ranges == [None; 2]));
        assert_eq!(envelopes.rows().len(), 2);
    }
}
