//! Normal equations of the columns of all explanations, from the statistic.

use super::columns::{Column, Course, PerChamber, Scales};
use pitchleak_core::Sensors;
use pitchleak_core::continuity::{
    COLUMNS, ContinuityStatistic, EQUATIONS, RawSum, Segment, column as place_of,
};
use std::collections::HashMap;

/// Segments that the engine keeps of a trace.
pub const SEGMENTS: usize = 12;
/// The statistic as the engine keeps it.
pub type Statistic = ContinuityStatistic<f64, SEGMENTS>;

/// A column whose power is below so many times its noise says nothing in that equation. Derived: below twice, more than
/// half of what it explains is noise.
const LEAST_POWER: f64 = 2.0;
/// Readings that a flow's value at a block's end is the mean of.
const END_READINGS: f64 = 7.0;

/// X'X of both equations, and what the columns' noise adds to it.
pub(super) struct NormalEquations {
    size: usize,
    gram: [Vec<f64>; EQUATIONS],
    noise: [Vec<f64>; EQUATIONS],
    /// Rows of each equation.
    pub rows: [f64; EQUATIONS],
    /// What noise adds to the left side's square.
    left_noise: [f64; EQUATIONS],
    places: HashMap<(Column, Course), usize>,
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
    /// Of `columns`, the first of which is the left side.
    pub fn new(statistic: &Statistic, scales: &Scales<'_>, columns: &[(Column, Course)]) -> Self {
        let size = columns.len();
        let mut own = Self {
            size,
            gram: [vec![0.0; size * size], vec![0.0; size * size]],
            noise: [vec![0.0; size * size], vec![0.0; size * size]],
            rows: [0.0; EQUATIONS],
            left_noise: [0.0; EQUATIONS],
            places: columns.iter().enumerate().map(|(place, key)| (*key, place)).collect(),
        };
        let kinds: HashMap<Column, [PerChamber; 2]> =
            columns.iter().map(|(column, _)| (*column, scales.column(*column))).collect();
        let total_s: f64 = statistic.segments().iter().map(Segment::time_s).sum();
        let noise_of = NoiseOf::new(scales);
        let mut begin_s = 0.0;
        for (index, segment) in statistic.segments().iter().enumerate() {
            let sparse: Vec<Sparse> = columns
                .iter()
                .map(|(column, course)| combine(&kinds[column], course.shares(index, begin_s, total_s)))
                .collect();
            for equation in 0..EQUATIONS {
                let gram = dense(|i, j| segment.product(equation, i, j));
                accumulate(&mut own.gram[equation], &sparse, &gram);
                accumulate(&mut own.noise[equation], &sparse, &noise_of.products(segment, equation));
                own.rows[equation] += segment.rows(equation);
            }
            begin_s += segment.time_s();
        }
        own.silence(columns);
        own
    }

    /// Where a column stands, if it was asked for.
    pub fn place(&self, column: Column, course: Course) -> Option<usize> {
        self.places.get(&(column, course)).copied()
    }

    /// Products of the columns.
    pub fn gram(&self, equation: usize) -> Square<'_> {
        Square { entries: &self.gram[equation], size: self.size }
    }

    /// What their noise adds to them, unit noise.
    pub fn noise(&self, equation: usize) -> Square<'_> {
        Square { entries: &self.noise[equation], size: self.size }
    }

    /// Measures the left side by the noise that it would have in `other` equations: else a mistake that multiplies the
    /// readings' noise by less than those explains it. One that makes it louder is measured by its own: to take off what is
    /// expected more would leave the chance by which a run's noise differs from it.
    pub fn with_noise_of(mut self, other: &Self) -> Self {
        for equation in 0..EQUATIONS {
            let more = (other.left_noise[equation] - self.left_noise[equation]).max(0.0);
            self.gram[equation][0] = (self.gram[equation][0] + more).max(0.0);
        }
        self
    }

    /// Columns that are mostly noise are zero. The left side's noise is what the residual is measured by.
    fn silence(&mut self, columns: &[(Column, Course)]) {
        for equation in 0..EQUATIONS {
            self.left_noise[equation] = std::mem::take(&mut self.noise[equation][0]);
            for (place, (column, _)) in columns.iter().enumerate().skip(1) {
                let is_leak = matches!(column, Column::LeakInternal | Column::LeakA | Column::LeakB);
                let power = self.gram(equation).row(place)[place];
                if !is_leak && power < LEAST_POWER * self.noise(equation).row(place)[place] {
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

fn combine(kind: &[PerChamber; 2], shares: [f64; 2]) -> Sparse {
    let [plain, moment] = kind.each_ref().map(|chambers| chambers.iter().flatten());
    let values = plain.zip(moment).map(|(plain, moment)| shares[0] * plain + shares[1] * moment);
    values.enumerate().filter(|(_, value)| *value != 0.0).collect()
}

fn dense(entry: impl Fn(usize, usize) -> f64) -> Vec<f64> {
    let mut matrix = vec![0.0; COLUMNS * COLUMNS];
    for i in 0..COLUMNS {
        for j in 0..=i {
            let value = entry(i, j);
            matrix[i * COLUMNS + j] = value;
            matrix[j * COLUMNS + i] = value;
        }
    }
    matrix
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

/// Sensors' noise in the raw sums.
struct NoiseOf {
    flow: [f64; 2],
    pressure_mpa: f64,
    position: f64,
    area_m2: [f64; 2],
    compressibility: f64,
}

/// A reading at a block's end in a raw sum: by how much, and times which volume (none, V_A, V_B).
type AtEnd = (RawSum, f64, usize);

impl NoiseOf {
    fn new(scales: &Scales<'_>) -> Self {
        let Sensors { flow_a, flow_b, pressure, position, .. } = scales.rig.sensors();
        let cylinder = &scales.rig.cylinder;
        Self {
            flow: [flow_a.noise_std, flow_b.noise_std],
            pressure_mpa: 1e-6 * pressure.noise_std,
            position: position.noise_std,
            area_m2: [cylinder.area_a_m2, cylinder.area_b_m2],
            compressibility: scales.compressibility(),
        }
    }

    /// What noise adds to the products of raw columns in a segment.
    fn products(&self, segment: &Segment<f64>, equation: usize) -> Vec<f64> {
        use RawSum as R;
        let mut out = vec![0.0; COLUMNS * COLUMNS];
        let [aa, ab, bb] = segment.integral_noise(equation);
        let integrals = [
            (R::ResidualA, self.flow[0]),
            (R::ResidualB, self.flow[1]),
            (R::PressureA, self.pressure_mpa),
            (R::PressureB, self.pressure_mpa),
        ];
        for (raw, std) in integrals {
            add_pair(&mut out, raw, raw, [aa, ab, bb], std * std);
        }
        let [area_a, area_b] = self.area_m2;
        let kappa = self.compressibility;
        let ends: [(f64, Vec<AtEnd>); 5] = [
            (self.position, vec![(R::Travel, 1.0, 0), (R::ResidualA, -area_a, 0), (R::ResidualB, area_b, 0)]),
            (
                self.pressure_mpa,
                vec![
                    (R::PressureChangeA, 1.0, 0),
                    (R::StorageA, 1.0, 1),
                    (R::StorageBOfA, 1.0, 2),
                    (R::ResidualA, -kappa, 1),
                ],
            ),
            (
                self.pressure_mpa,
                vec![
                    (R::PressureChangeB, 1.0, 0),
                    (R::StorageB, 1.0, 2),
                    (R::StorageAOfB, 1.0, 1),
                    (R::ResidualB, -kappa, 2),
                ],
            ),
            (self.flow[0] / END_READINGS.sqrt(), vec![(R::FlowChangeA, 1.0, 0)]),
            (self.flow[1] / END_READINGS.sqrt(), vec![(R::FlowChangeB, 1.0, 0)]),
        ];
        let noise = segment.end_noise(equation);
        for (std, sums) in &ends {
            for (one, of_one, volume) in sums {
                for (other, of_other, other_volume) in sums {
                    let power = volume_power(*volume, *other_volume);
                    add_pair(&mut out, *one, *other, noise[power], std * std * of_one * of_other);
                }
            }
        }
        out
    }
}

/// Place of a product of two volumes among 1, V_A, V_B, V_A², V_A V_B, V_B².
fn volume_power(one: usize, other: usize) -> usize {
    match (one.min(other), one.max(other)) {
        (0, power) => power,
        (1, 1) => 3,
        (1, _) => 4,
        _ => 5,
    }
}

fn add_pair(out: &mut [f64], one: RawSum, other: RawSum, [aa, ab, bb]: [f64; 3], variance: f64) {
    for (chamber, other_chamber, value) in [(0, 0, aa), (0, 1, ab), (1, 0, ab), (1, 1, bb)] {
        let (i, j) = (place_of(one, chamber), place_of(other, other_chamber));
        out[i * COLUMNS + j] += variance * value;
    }
}
