//! Gram matrices of a stretch of the trace.

// Index loops over const bounds: they read like the algebra and the bounds checks vanish.
#![allow(clippy::needless_range_loop)]

use super::block_sums::{Block, MPA_PER_PA, RAW_SUMS, RawSum};
use super::change::LeakFit;
use super::whitening::{COLUMNS, EQUATIONS, INTEGRALS, Row, RowNoise, VOLUME_POWERS};
use crate::{PerLeak, Real};

/// Entries of a packed symmetric matrix, row by row of its lower triangle.
const PACKED: usize = COLUMNS * (COLUMNS + 1) / 2;
/// Two neighbours that differ by so many standard deviations are as dear to merge as two of twice the length; chosen.
const DIFFERENCE_SIGMAS: f64 = 3.0;

/// Gram matrices of a stretch of the trace.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(bound = "T: crate::Saved"))]
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
pub(super) const AGED: [(RawSum, RawSum); 3] = [
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

    /// Takes in the rows that a block has become.
    pub(super) fn add(&mut self, rows: &[Option<Row<T>>; EQUATIONS], block: &Block<T>) {
        for (equation, row) in rows.iter().enumerate() {
            if let Some(row) = row {
                self.add_row(equation, row);
            }
        }
        self.blocks += 1;
        self.pass(block);
    }

    /// Time that passes with a block, whether its rows are taken in or not.
    pub(super) fn pass(&mut self, block: &Block<T>) {
        self.time_s += block.sums[RawSum::Time as usize];
        let [pa, pb] = [RawSum::PressureA, RawSum::PressureB].map(|raw| block.sums[raw as usize]);
        let sizes = PerLeak { internal: (pa - pb).abs(), external_a: pa.abs(), external_b: pb.abs() };
        self.pressure_time = self.pressure_time.zip(sizes).map(|(sum, size)| sum + size);
    }

    fn add_row(&mut self, equation: usize, row: &Row<T>) {
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
    pub(super) fn append(&mut self, next: &Self) {
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
    pub(super) fn cost(&self, next: &Self) -> T {
        let both =
            |equation: usize, i: usize, j: usize| self.product(equation, i, j) + next.product(equation, i, j);
        let apart = explained(|equation, i, j| self.product(equation, i, j))
            + explained(|equation, i, j| next.product(equation, i, j));
        let lost = (apart - explained(both)).at_least(T::zero());
        let length = T::lit(f64::from(self.blocks) + f64::from(next.blocks));
        length * (T::one() + lost / T::lit(DIFFERENCE_SIGMAS * DIFFERENCE_SIGMAS))
    }
}

/// Zeros and leaks that a stretch is described by, for the sake of comparison.
const DESCRIPTION: usize = 5;
const ARE_LEAKS: [bool; DESCRIPTION] = [false, false, true, true, true];

/// χ² that leaks and zeros of its own explain of a stretch.
fn explained<T: Real>(product: impl Fn(usize, usize, usize) -> T) -> T {
    use RawSum as R;
    let one = T::one();
    let at = column;
    let left_side = [(at(R::ResidualA, 0), one), (at(R::ResidualB, 1), one)];
    let columns: [&[(usize, T)]; DESCRIPTION] = [
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
    let entry = |of_one: &[(usize, T)], of_other: &[(usize, T)]| {
        let mut sum = T::zero();
        for (one, by) in of_one {
            for (other, by_other) in of_other {
                for equation in 0..EQUATIONS {
                    sum += *by * *by_other * product(equation, *one, *other);
                }
            }
        }
        sum
    };
    let mut matrix = [[T::zero(); DESCRIPTION]; DESCRIPTION];
    let mut vector = [T::zero(); DESCRIPTION];
    for i in 0..DESCRIPTION {
        for j in 0..=i {
            matrix[i][j] = entry(columns[i], columns[j]);
        }
        vector[i] = entry(columns[i], &left_side);
    }
    LeakFit::of(&matrix, &vector, &ARE_LEAKS).explained
}

#[cfg(test)]
mod tests {
    use super::*;
    use pitchleak_testkit::white_noise;
    use std::vec::Vec;

    const BLOCK_S: f64 = 0.5;

    fn block(pa: f64, pb: f64) -> Block<f64> {
        let mut block = Block::default();
        block.sums[RawSum::Time as usize] = BLOCK_S;
        block.sums[RawSum::PressureA as usize] = BLOCK_S * pa;
        block.sums[RawSum::PressureB as usize] = BLOCK_S * pb;
        block
    }

    /// Rows at random, all of both equations.
    fn rows(count: usize) -> Vec<[Option<Row<f64>>; EQUATIONS]> {
        let mut noise = white_noise(2);
        let mut next = || noise.next().expect("no end");
        let mut row = || {
            let columns = core::array::from_fn(|_| next());
            let noise = RowNoise { integral: [[next(); 3]; INTEGRALS], end: [[next(); 3]; VOLUME_POWERS] };
            Some(Row { columns, noise })
        };
        (0..count).map(|_| [row(), row()]).collect()
    }

    /// The same rows with time counted from `earlier_s` before.
    fn aged(mut rows: [Option<Row<f64>>; EQUATIONS], earlier_s: f64) -> [Option<Row<f64>>; EQUATIONS] {
        for row in rows.iter_mut().flatten() {
            for (aged, plain) in AGED {
                for chamber in 0..2 {
                    row.columns[column(aged, chamber)] += earlier_s * row.columns[column(plain, chamber)];
                }
            }
        }
        rows
    }

    fn segment(rows: impl IntoIterator<Item = [Option<Row<f64>>; EQUATIONS]>) -> Segment<f64> {
        let mut segment = Segment::default();
        rows.into_iter().for_each(|rows| segment.add(&rows, &block(5.0, 3.0)));
        segment
    }

    /// Two segments in a row are the segment of all their rows, with time from the first's begin.
    #[test]
    fn segments_append_to_that_of_all_rows() {
        let rows = rows(7);
        let (one, next) = rows.split_at(3);
        let mut both = segment(one.iter().copied());
        both.append(&segment(next.iter().copied()));
        let from_begin = next.iter().map(|rows| aged(*rows, 3.0 * BLOCK_S));
        let whole = segment(one.iter().copied().chain(from_begin));
        let is_close = |a: f64, b: f64| (a - b).abs() < 1e-9 * b.abs().max(1.0);
        for equation in 0..EQUATIONS {
            for (i, j) in (0..COLUMNS).flat_map(|i| (0..COLUMNS).map(move |j| (i, j))) {
                let (found, expected) = (both.product(equation, i, j), whole.product(equation, i, j));
                assert!(is_close(found, expected), "{equation} {i} {j}: {found} {expected}");
            }
            let flat = |s: &Segment<f64>| {
                let noise = s.integral_noise(equation).into_iter().chain(s.end_noise(equation)).flatten();
                noise.chain([s.rows(equation), s.time_s(), f64::from(s.blocks)]).collect::<Vec<_>>()
            };
            assert!(flat(&both).into_iter().zip(flat(&whole)).all(|(a, b)| is_close(a, b)));
        }
        let noise = |rows: &[Option<Row<f64>>; EQUATIONS]| rows[1].expect("a row").noise.integral[2][0];
        assert!(is_close(both.integral_noise(1)[2][0], rows.iter().map(noise).sum()));
        assert!(is_close(whole.time_s(), 3.5) && is_close(whole.rows(0), 7.0) && whole.blocks == 7);
    }

    /// By time, whichever chamber's is higher, and where no row was taken in as well.
    #[test]
    fn mean_pressures_are_means_over_time() {
        let mut segment = Segment::default();
        segment.add(&[None; EQUATIONS], &block(5.0, 3.0));
        segment.pass(&block(2.0, -6.0));
        let mut next = Segment::default();
        next.pass(&block(2.0, 3.0));
        segment.append(&next);
        let PerLeak { internal, external_a, external_b } = segment.mean_pressures_pa();
        for (found, mpa) in [(internal, 11.0 / 3.0), (external_a, 3.0), (external_b, 4.0)] {
            assert!((found / (1e6 * mpa) - 1.0f64).abs() < 1e-12, "{found} {mpa}");
        }
    }

    /// A segment in which constant flows and leaks make both equations' residuals: `flows` of both zeros,
    /// C_ip, C_epA, C_epB.
    fn told(size: f64, flows: [f64; DESCRIPTION], blocks: usize) -> Segment<f64> {
        let [zero_a, zero_b, internal, external_a, external_b] = flows;
        let mut noise = white_noise(4);
        segment((0..blocks).map(|_| {
            let [pa, pb] = [0, 1].map(|_| 4.0 + noise.next().expect("no end"));
            let residuals = [
                zero_a + internal * (pa - pb) + external_a * pa,
                zero_b - internal * (pa - pb) + external_b * pb,
            ];
            [0, 1].map(|chamber| {
                let mut columns = [0.0; COLUMNS];
                let residual = [RawSum::ResidualA, RawSum::ResidualB][chamber];
                let sums = [(residual, residuals[chamber]), (RawSum::PressureA, pa), (RawSum::PressureB, pb)];
                for (raw, value) in sums.into_iter().chain([(RawSum::Time, 1.0)]) {
                    columns[column(raw, chamber)] = size * value;
                }
                let noise = RowNoise { integral: [[0.0; 3]; INTEGRALS], end: [[0.0; 3]; VOLUME_POWERS] };
                Some(Row { columns, noise })
            })
        }))
    }

    const FLOWS: [f64; DESCRIPTION] = [0.3, -0.2, 0.1, 0.2, 0.4];

    /// Of each alone, and of all together.
    #[test]
    fn what_constant_flows_and_leaks_make_is_explained() {
        let alone = |i: usize| core::array::from_fn(|j| if i == j { FLOWS[i] } else { 0.0 });
        for flows in (0..DESCRIPTION).map(alone).chain([FLOWS]) {
            let segment = told(10.0, flows, 40);
            let residuals = [column(RawSum::ResidualA, 0), column(RawSum::ResidualB, 1)];
            let square: f64 = (0..EQUATIONS).map(|c| segment.product(c, residuals[c], residuals[c])).sum();
            let explained = explained(|equation, i, j| segment.product(equation, i, j));
            assert!((explained / square - 1.0).abs() < 0.01, "{flows:?}: {explained} of {square}");
        }
    }

    /// Alike, they cost their blocks; where any zero or leak differs, more; and the more rows tell of it.
    #[test]
    fn neighbours_that_differ_are_dear() {
        let cost = |size: f64, next: [f64; DESCRIPTION]| told(size, FLOWS, 40).cost(&told(size, next, 60));
        let alike = cost(1.0, FLOWS);
        assert!((alike / 100.0 - 1.0).abs() < 0.01, "{alike}");
        for i in 0..DESCRIPTION {
            let mut next = FLOWS;
            next[i] += 0.1;
            let [by_1, by_10] = [1.0, 10.0].map(|size| cost(size, next) / cost(size, FLOWS) - 1.0);
            assert!(by_1 > 0.01 && (by_10 / by_1 - 100.0).abs() < 5.0, "{i} {by_1} {by_10}");
        }
    }
}
