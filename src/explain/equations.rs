//! Normal equations of the columns of all explanations, from the statistic.

use super::columns::{Column, Course, PerChamber, Scales};
use super::hypothesis::{LEAK_COLUMNS, STEADY_COLUMNS};
use super::raw_products::{RawProducts, SegmentProducts};
use pitchleak_core::Leak;
use pitchleak_core::continuity::{COLUMNS, EQUATIONS};
use std::collections::HashMap;

/// A column whose power is below so many times its noise says nothing in that equation. Derived: below twice, more than
/// half of what it explains is noise.
pub(super) const LEAST_POWER: f64 = 2.0;

/// X'X of both equations, and what the columns' noise adds to it.
pub(super) struct NormalEquations {
    size: usize,
    gram: [Vec<f64>; EQUATIONS],
    noise: [Vec<f64>; EQUATIONS],
    /// Rows of each equation.
    pub rows: [f64; EQUATIONS],
    /// What noise adds to the left side's square: as declared, and as the readings scatter.
    left_noise: [[f64; 2]; EQUATIONS],
    /// Noise scales that the readings' own scatter makes, at least 1: what is louder is no noise of the columns.
    pub loudest: [f64; EQUATIONS],
    /// Noise scales from which on those of a fit are sought.
    pub sought_from: [f64; EQUATIONS],
    columns: Vec<(Column, Course)>,
    /// Where each stands, by column and course.
    places: Vec<Option<u16>>,
}

/// A symmetric matrix.
#[derive(Clone, Copy)]
pub(super) struct Square<'a> {
    entries: &'a [f64],
    size: usize,
}

impl<'a> Square<'a> {
    /// A row, or column.
    pub fn row(self, i: usize) -> &'a [f64] {
        &self.entries[i * self.size..(i + 1) * self.size]
    }
}

/// A column's combination of raw sums in one segment, without those that it has not.
type Sparse = Vec<(usize, f64)>;

impl NormalEquations {
    /// Of `columns`, the first of which is the left side; `noise_of` is what their noise is taken to be in a segment.
    pub fn new(
        products: &RawProducts,
        scales: &Scales<'_>,
        columns: &[(Column, Course)],
        noise_of: fn(&SegmentProducts) -> &[Vec<f64>; EQUATIONS],
    ) -> Self {
        let size = columns.len();
        let mut own = Self {
            size,
            gram: [vec![0.0; size * size], vec![0.0; size * size]],
            noise: [vec![0.0; size * size], vec![0.0; size * size]],
            rows: [0.0; EQUATIONS],
            left_noise: [[0.0; 2]; EQUATIONS],
            loudest: [1.0; EQUATIONS],
            sought_from: [1.0; EQUATIONS],
            columns: columns.to_vec(),
            places: places(columns),
        };
        let kinds: HashMap<Column, [PerChamber; 2]> =
            columns.iter().map(|(column, _)| (*column, scales.column(*column))).collect();
        for (index, segment) in products.segments.iter().enumerate() {
            let shares = |course: &Course| course.shares(index, segment.span_s(), products.total_s);
            let sparse: Vec<Sparse> =
                columns.iter().map(|(column, course)| combine(&kinds[column], shares(course))).collect();
            for equation in 0..EQUATIONS {
                accumulate(&mut own.gram[equation], &sparse, &segment.gram[equation]);
                accumulate(&mut own.noise[equation], &sparse, &noise_of(segment)[equation]);
                own.left_noise[equation][0] += square(&sparse[0], &segment.noise[equation]);
                own.left_noise[equation][1] += square(&sparse[0], &segment.scattered[equation]);
                own.rows[equation] += segment.rows[equation];
            }
        }
        own.loudest = [0, 1].map(|equation| own.scatter(equation).max(1.0));
        own.sought_from = own.loudest;
        own.silence();
        own
    }

    /// Where a column stands, if it was asked for.
    pub fn place(&self, column: Column, course: Course) -> Option<usize> {
        self.places.get(key(column, course)).copied().flatten().map(usize::from)
    }

    /// Standard deviation of the pressure across a leak beside its noise, over its mean size.
    pub fn spread(&self, leak: Leak) -> f64 {
        let place = |columns: [Column; 3]| self.place(columns[leak as usize], Course::Constant);
        let Some((own, steady)) = place(LEAK_COLUMNS).zip(place(STEADY_COLUMNS)) else {
            return f64::INFINITY;
        };
        let product = |i: usize, j: usize| {
            (0..EQUATIONS).map(|c| self.gram(c).row(i)[j] - self.noise(c).row(i)[j]).sum::<f64>()
        };
        let mean = product(own, steady) / product(steady, steady);
        (product(own, own) / product(steady, steady) - mean * mean).max(0.0).sqrt()
    }

    /// Products of the columns.
    pub fn gram(&self, equation: usize) -> Square<'_> {
        Square { entries: &self.gram[equation], size: self.size }
    }

    /// What their noise adds to them, unit noise.
    pub fn noise(&self, equation: usize) -> Square<'_> {
        Square { entries: &self.noise[equation], size: self.size }
    }

    /// What noise adds to the left side's square: as declared, and as the readings scatter.
    pub fn left_noise(&self, equation: usize) -> [f64; 2] {
        self.left_noise[equation]
    }

    /// The second over the first; 1 where no noise is declared.
    pub fn scatter(&self, equation: usize) -> f64 {
        let [sheet, scattered] = self.left_noise[equation];
        if sheet > 0.0 { scattered / sheet } else { 1.0 }
    }

    /// With rows whose unit is `unit` times the noise, and readings that scatter so many times as much as that allows, all
    /// squared: the columns' noise is of the readings' own scale already, so a fit's scales are sought from 1 on.
    pub fn measured_by(mut self, unit: [f64; EQUATIONS], scatter: [f64; EQUATIONS]) -> Self {
        for equation in 0..EQUATIONS {
            self.gram[equation].iter_mut().for_each(|product| *product /= unit[equation]);
            self.noise[equation]
                .iter_mut()
                .for_each(|product| *product /= unit[equation] * scatter[equation]);
        }
        Self { loudest: scatter, sought_from: [1.0; EQUATIONS], ..self }
    }

    /// With readings other than the flows so many times quieter than the rows' noise scale says, squared.
    pub fn with_louder_flows(mut self, louder: [f64; EQUATIONS]) -> Self {
        let of_flows: Vec<bool> = self.columns.iter().map(|(column, _)| column.is_of_flows()).collect();
        for (noise, louder) in self.noise.iter_mut().zip(louder) {
            for (place, entry) in noise.iter_mut().enumerate() {
                if !(of_flows[place / self.size] && of_flows[place % self.size]) {
                    *entry /= louder;
                }
            }
        }
        self
    }

    /// Columns that are mostly noise, as loud as the readings scatter, are zero. The left side's noise is what the residual is
    /// measured by.
    fn silence(&mut self) {
        for equation in 0..EQUATIONS {
            self.noise[equation][0] = 0.0;
            for place in 1..self.size {
                let column = self.columns[place].0;
                let is_leak = matches!(column, Column::LeakInternal | Column::LeakA | Column::LeakB);
                let power = self.gram(equation).row(place)[place];
                // What tells such noise is not.
                let louder = if column == Column::Unpressed { 1.0 } else { self.loudest[equation] };
                let noise = louder * self.noise(equation).row(place)[place];
                if !is_leak && power < LEAST_POWER * noise {
                    for other in 0..self.size {
                        for (i, j) in [(place, other), (other, place)] {
                            self.gram[equation][i * self.size + j] = 0.0;
                            self.noise[equation][i * self.size + j] = 0.0;
                        }
                    }
                }
            }
        }
    }
}

/// A number of its own for each column and course.
fn key(column: Column, course: Course) -> usize {
    column as usize * Course::COUNT + course.index()
}

fn places(columns: &[(Column, Course)]) -> Vec<Option<u16>> {
    let keys = columns.iter().map(|(column, course)| key(*column, *course));
    let mut places = vec![None; keys.clone().max().map_or(0, |last| last + 1)];
    for (place, key) in (0..).zip(keys) {
        places[key] = Some(place);
    }
    places
}

fn combine(kind: &[PerChamber; 2], shares: [f64; 2]) -> Sparse {
    let [plain, moment] = kind.each_ref().map(|chambers| chambers.iter().flatten());
    let values = plain.zip(moment).map(|(plain, moment)| shares[0] * plain + shares[1] * moment);
    values.enumerate().filter(|(_, value)| *value != 0.0).collect()
}

/// A combination's square under these products.
fn square(one: &Sparse, products: &[f64]) -> f64 {
    one.iter()
        .flat_map(|(i, by)| one.iter().map(move |(j, also)| by * also * products[i * COLUMNS + j]))
        .sum()
}

fn accumulate(sum: &mut [f64], columns: &[Sparse], products: &[f64]) {
    let size = columns.len();
    let mut turned = [0.0; COLUMNS];
    for (i, one) in columns.iter().enumerate() {
        if one.is_empty() {
            continue;
        }
        turned.fill(0.0);
        for (raw, by) in one {
            let row = &products[raw * COLUMNS..(raw + 1) * COLUMNS];
            for (place, value) in turned.iter_mut().zip(row) {
                *place += by * value;
            }
        }
        for (j, other) in columns.iter().enumerate().take(i + 1) {
            let value: f64 = other.iter().map(|(raw, by)| by * turned[*raw]).sum();
            sum[i * size + j] += value;
            if i != j {
                sum[j * size + i] += value;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use pitchleak_core::continuity::RAW_SUMS;

    /// Products of combinations are those of the sums that they combine: the columns C of G to C'GC.
    #[test]
    fn products_are_those_of_the_combined_sums() {
        let wave = |i: usize, rate: f64| (rate * i as f64).sin();
        let mut kinds = [[[[0.0; RAW_SUMS]; 2]; 2]; 3];
        for (i, entry) in kinds.iter_mut().flatten().flatten().flatten().enumerate() {
            *entry = wave(i, 1.3);
        }
        // The last has neither kind.
        kinds[2] = [[[0.0; RAW_SUMS]; 2]; 2];
        let shares = [[0.7, -0.4], [1.0, 0.0], [1.0, 2.0]];
        let symmetric =
            |i: usize| wave(i / COLUMNS, 0.7) * wave(i % COLUMNS, 0.7) + wave(i / COLUMNS + i % COLUMNS, 0.3);
        let products: Vec<f64> = (0..COLUMNS * COLUMNS).map(symmetric).collect();
        let whole = |column: usize, raw: usize| {
            let [plain, moment] = kinds[column].map(|kind| kind[raw / RAW_SUMS][raw % RAW_SUMS]);
            shares[column][0] * plain + shares[column][1] * moment
        };
        let columns: Vec<Sparse> =
            kinds.iter().zip(shares).map(|(kind, shares)| combine(kind, shares)).collect();
        assert!(columns[2].is_empty());
        let mut sum = vec![1.0; 9];
        accumulate(&mut sum, &columns, &products);
        for (i, j) in (0..9).map(|place| (place / 3, place % 3)) {
            let both = (0..COLUMNS * COLUMNS).map(|at| (at / COLUMNS, at % COLUMNS));
            let expected: f64 =
                both.map(|(k, l)| whole(i, k) * whole(j, l) * products[k * COLUMNS + l]).sum();
            assert!((sum[3 * i + j] - 1.0 - expected).abs() < 1e-9, "{i} {j}");
            if i == j {
                assert!((square(&columns[i], &products) - expected).abs() < 1e-9);
            }
        }
    }
}
