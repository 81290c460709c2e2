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
