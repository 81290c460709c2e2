//! Both continuity equations over blocks, whitened by the declared noise and summed up: normal equations that serve any
//! priors, in constant memory however many blocks there are.

use super::blocks::{Block, Chamber, Fed};
use super::force::ForceSums;
use super::priors::{PARAMETERS, Vector};
use crate::rig::Rig;
use nalgebra::SMatrix;
use pitchleak_core::{Cylinder, Leak, PerLeak, Sensors};

/// The weights of both chamber equations in one scalar equation, and the noise of it.
#[derive(Clone, Copy, Debug)]
struct Combination {
    a: f64,
    b: f64,
    /// Of the position: 0 where the travel cancels.
    position: f64,
    /// Variance of the combined flows' noise, (m³/s)² times the weights'.
    flow_variance: f64,
}

/// The declared sensors' noise in the equations, where pressures reach them through these leaks.
pub(super) struct Noise {
    compressibility_per_pa: f64,
    pressure_std_pa: f64,
    position_std_m: f64,
    balance: Combination,
    travel: [Combination; 3],
}

/// A perfect sensor does not exist: as in the estimator.
const RESOLUTION: f64 = 1e-6;

impl Noise {
    /// Of the rig's sensors; leak coefficients in m³/(s·Pa).
    pub fn new(rig: &Rig, leaks: PerLeak<f64>) -> Self {
        let Cylinder { area_a_m2, area_b_m2, stroke_m, .. } = rig.cylinder;
        let sensors = rig.sensors();
        let combination = |a: f64, b: f64, position: f64| Combination {
            a,
            b,
            position,
            flow_variance: flow_variance(a, b, &sensors, leaks, RESOLUTION * area_a_m2 * stroke_m),
        };
        let (va, vb) = (
            (sensors.flow_a.noise_std / area_a_m2).powi(2).max(f64::MIN_POSITIVE),
            (sensors.flow_b.noise_std / area_b_m2).powi(2).max(f64::MIN_POSITIVE),
        );
        let share_a = vb / (va + vb);
        Self {
            compressibility_per_pa: 1.0 / rig.fluid.bulk_modulus_pa,
            pressure_std_pa: sensors.pressure.noise_std.max(1.0),
            position_std_m: sensors.position.noise_std.max(RESOLUTION * stroke_m),
            balance: combination(area_b_m2, area_a_m2, 0.0),
            travel: [
                combination(share_a / area_a_m2, (share_a - 1.0) / area_b_m2, 1.0),
                combination(1.0 / area_a_m2, 0.0, 1.0),
                combination(0.0, -1.0 / area_b_m2, 1.0),
            ],
        }
    }

    /// Variance of one end's readings: position, and pressures through the oil they store.
    fn end_variance(&self, of: &Combination, block: &Block) -> f64 {
        let stored = |weight: f64, chamber: &Chamber| {
            (weight * chamber.volume_m3 * self.compressibility_per_pa * self.pressure_std_pa).powi(2)
        };
        (of.position * self.position_std_m).powi(2) + stored(of.a, &block.a) + stored(of.b, &block.b)
    }
}

/// Variance of the combined flows: the meters' noise, and the pressures' through the leaks, at most as much again: absurd
/// leaks must not excuse a misfit.
fn flow_variance(a: f64, b: f64, sensors: &Sensors<f64>, leaks: PerLeak<f64>, floor: f64) -> f64 {
    let own =
        (a * sensors.flow_a.noise_std.max(floor)).powi(2) + (b * sensors.flow_b.noise_std.max(floor)).powi(2);
    let by_a = (a - b) * leaks.internal + a * leaks.external_a;
    let by_b = b * leaks.external_b - (a - b) * leaks.internal;
    let through_leaks = sensors.pressure.noise_std.powi(2) * (by_a * by_a + by_b * by_b);
    own + through_leaks.min(own)
}

/// One row: its left side, and the parameters' columns in their order, SI.
#[derive(Clone, Copy, Debug)]
struct Row {
    left: f64,
    columns: [f64; PARAMETERS],
}

impl Row {
    fn new(of: &Combination, block: &Block, noise: &Noise) -> Self {
        let (a, b) = (&block.a, &block.b);
        let compression = of.a * a.compression + of.b * b.compression;
        let travel = of.position * block.travel_m;
        let (flow_a, flow_b) = (of.a * a.flow_m3, of.b * b.flow_m3);
        let internal = (of.a - of.b) * block.across(Leak::Internal);
        let (at_a, at_b) = (of.a * a.pressure, of.b * b.pressure);
        Self {
            left: flow_a + flow_b - travel - noise.compressibility_per_pa * compression,
            columns: [
                compression,
                internal,
                at_a,
                at_b,
                of.a * block.time_s,
                of.b * block.time_s,
                flow_a,
                flow_b,
                -travel,
                (of.a - of.b) * block.roots.internal,
                of.a * block.roots.external_a,
                of.b * block.roots.external_b,
            ],
        }
    }

    fn add(&mut self, share: f64, other: &Self) {
        self.left += share * other.left;
        for (column, other) in self.columns.iter_mut().zip(&other.columns) {
            *column += share * other;
        }
    }

    fn divide(&mut self, by: f64) {
        self.left /= by;
        self.columns.iter_mut().for_each(|column| *column /= by);
    }
}

/// The normal equations of one of the two.
#[derive(Clone, Debug, Default)]
struct Series {
    /// Lower triangle: the rest is zero.
    matrix: [[f64; PARAMETERS]; PARAMETERS],
    vector: [f64; PARAMETERS],
    /// Of the left sides.
    square: f64,
    rows: u32,
    last: Option<Whitened>,
}

/// A row free of its neighbours' noise, what it was divided by, and the variance of its last readings.
#[derive(Clone, Copy, Debug)]
struct Whitened {
    row: Row,
    pivot: f64,
    ends: f64,
}

impl Series {
    /// Takes in the row of a block; none where the flows that it needs are missing.
    ///
    /// Readings at a block's ends are in both blocks that they part, with opposite signs, so the rows' covariance is
    /// tridiagonal and its Cholesky factor has two diagonals.
    fn add(&mut self, of: Option<&Combination>, block: &Block, noise: &Noise) {
        let last = self.last.take();
        let Some(of) = of else { return };
        let ends = noise.end_variance(of, block);
        let variance = of.flow_variance * block.time_square_s2 + 2.0 * ends;
        let mut row = Row::new(of, block, noise);
        let mut pivot = variance;
        if let Some(last) = last.filter(|_| block.follows) {
            let shared = last.ends.min(ends) / last.pivot;
            pivot -= shared * shared;
            row.add(shared, &last.row);
        }
        let pivot = pivot.max(0.5 * variance.min(of.flow_variance * block.time_square_s2)).sqrt();
        row.divide(pivot);
        self.sum(&row);
        self.last = Some(Whitened { row, pivot, ends });
    }

    fn sum(&mut self, Row { left, columns }: &Row) {
        for (at, (column, sums)) in columns.iter().zip(&mut self.matrix).enumerate() {
            for (sum, other) in sums.iter_mut().zip(columns).take(at + 1) {
                *sum += column * other;
            }
        }
        for (sum, column) in self.vector.iter_mut().zip(columns) {
            *sum += column * left;
        }
        self.square += left * left;
        self.rows = self.rows.saturating_add(1);
    }
}

/// The normal equations of a stretch of blocks.
#[derive(Clone, Debug, Default)]
pub(super) struct Equations {
    /// Of the flow balance, and of the position against the flows.
    series: [Series; 2],
    pub force: ForceSums,
}

impl Equations {
    /// Of all these blocks.
    pub fn of(blocks: &[Block], noise: &Noise) -> Self {
        let mut equations = Self::default();
        blocks.iter().for_each(|block| equations.add(block, noise));
        equations
    }

    /// Takes in the next block.
    fn add(&mut self, block: &Block, noise: &Noise) {
        self.force.add(block);
        let [balance, travel] = &mut self.series;
        balance.add(Some(&noise.balance).filter(|_| block.fed == Fed::Both), block, noise);
        travel.add(noise.travel.get(block.fed as usize), block, noise);
    }
}

/// As [`Series`], with a matrix that is whole.
#[derive(Clone)]
pub(super) struct Sums {
    pub matrix: SMatrix<f64, PARAMETERS, PARAMETERS>,
    pub vector: Vector,
    pub square: f64,
    pub rows: usize,
}

impl Sums {
    fn of(series: &Series) -> Self {
        Self {
            matrix: SMatrix::from_fn(|i, j| series.matrix[i.max(j)][i.min(j)]),
            vector: Vector::from(series.vector),
            square: series.square,
            rows: series.rows as usize,
        }
    }

    /// For parameters in these units.
    fn scaled(mut self, units: &Vector) -> Self {
        self.matrix.component_mul_assign(&(units * units.transpose()));
        self.vector.component_mul_assign(units);
        self
    }

    /// Sum of squares that `parameters` leave.
    pub fn left(&self, parameters: &Vector) -> f64 {
        let explained = 2.0 * self.vector.dot(parameters) - parameters.dot(&(self.matrix * parameters));
        (self.square - explained).max(0.0)
    }
}

/// Both equations: whatever the priors.
#[derive(Clone)]
pub(super) struct BothSums([Sums; 2]);

impl BothSums {
    /// Of a stretch.
    pub fn of(equations: &Equations) -> Self {
        Self(equations.series.each_ref().map(Sums::of))
    }

    /// Flow balance and position against the flows, for parameters in these units.
    pub fn scaled(&self, units: &Vector) -> [Sums; 2] {
        self.0.clone().map(|sums| sums.scaled(units))
    }
}
