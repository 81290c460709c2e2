//! How well the plain model explains a piece of a trace: generalised least squares on both continuity equations over
//! the whole piece, with the declared noise. Nothing restarts, so nothing is forgiven.

use super::blocks::{Block, Chamber, Fed, blocks};
use super::priors::{LEAKS, OFFSETS, ORIFICES, PARAMETERS, Priors, Vector};
use crate::rig::Rig;
use crate::trace::Record;
use nalgebra::SMatrix;
use pitchleak_core::{Cylinder, Estimate, Leak, Parameter, PerLeak, Sensors};

/// What a fit leaves.
#[derive(Clone, Copy, Debug)]
pub(super) struct Fit {
    /// Mean square of the normalised residual of the flow balance, and of position against flows; none without rows.
    pub ratios: [Option<f64>; 2],
    /// Rows of each.
    pub rows: [usize; 2],
    /// χ² of the parameters against their priors.
    penalty: f64,
    /// In prior standard deviations, and their covariance.
    parameters: Vector,
    covariance: SMatrix<f64, PARAMETERS, PARAMETERS>,
    /// Units of the parameters, SI.
    units: Vector,
    compressibility_per_pa: f64,
}

/// Parameters further from their prior mean than this are none that the rig can have.
const PRIOR_SIGMAS: f64 = 4.0;
/// A leak this many standard deviations below zero is negative.
const NEGATIVE_SIGMAS: f64 = 6.0;
/// Pressure noise through the leaks, which halves a residual at the most, can't explain this one.
const HOPELESS: f64 = 20.0;

impl Fit {
    /// Fits the model with these priors; `None` where the records are too few.
    pub fn new(records: &[Record], rig: &Rig, priors: &Priors) -> Option<Self> {
        Self::of(&blocks(records, &rig.cylinder), rig, priors)
    }

    /// The same from blocks, for many priors on the same records.
    pub fn of(blocks: &[Block], rig: &Rig, priors: &Priors) -> Option<Self> {
        let mut system = System::new(rig, *priors, [0.0; 3]);
        let mut found = system.solve(blocks)?;
        if found.worst() > HOPELESS {
            return Some(found);
        }
        // Pressure noise reaches the equations through the leaks, which only a fit tells.
        system = System::new(rig, *priors, found.leaks(priors));
        found = system.solve(blocks)?;
        Some(found)
    }

    fn leaks(&self, Priors(spread): &Priors) -> [f64; 3] {
        [1, 2, 3].map(|at: usize| (self.parameters[at] * spread[at]).max(0.0))
    }

    fn std(&self, at: usize) -> f64 {
        self.covariance[(at, at)].sqrt()
    }

    /// A parameter in SI; its spread grows with the misfit.
    fn estimate(&self, at: usize) -> Estimate<f64> {
        let inflation = self.worst().max(1.0).sqrt();
        Estimate { value: self.parameters[at], std: inflation * self.std(at) }.scaled(self.units[at])
    }

    /// A parameter of the estimator's, SI; of the compressibility what it is off its prior mean.
    pub fn parameter(&self, parameter: Parameter) -> Estimate<f64> {
        self.estimate(parameter as usize)
    }

    /// Leak coefficients, m³/(s·Pa).
    pub fn leak_coefficients(&self) -> PerLeak<Estimate<f64>> {
        PerLeak::from_fn(|leak| self.estimate(LEAKS + leak as usize))
    }

    /// Zeros of meters A and B in the middle of the records, m³/s.
    pub fn offsets_m3s(&self) -> [Estimate<f64>; 2] {
        [self.estimate(OFFSETS), self.estimate(OFFSETS + 1)]
    }

    /// χ² of all rows, and of the parameters against their priors.
    pub fn chi_square(&self) -> f64 {
        let sums = self.ratios.iter().zip(self.rows).map(|(ratio, rows)| ratio.unwrap_or(0.0) * rows as f64);
        sums.sum::<f64>() + self.penalty
    }

    /// The larger of the two ratios.
    pub fn worst(&self) -> f64 {
        self.ratios.iter().flatten().copied().fold(0.0, f64::max)
    }

    /// Mean of χ² over both equations' rows, where what is smaller than the noise counts as noise: sensors may be
    /// better than declared, and a mistake that makes readings small must not win by it.
    pub fn mean_chi_square(&self) -> f64 {
        let sums = self
            .ratios
            .iter()
            .zip(self.rows)
            .map(|(ratio, rows)| ratio.unwrap_or(1.0).max(1.0) * rows as f64);
        (sums.sum::<f64>() + self.penalty) / self.row_count() as f64
    }

    pub fn row_count(&self) -> usize {
        self.rows.iter().sum()
    }

    /// How far the most negative leak lies below zero, in standard deviations that grow with the misfit.
    pub fn negative_leak_sigmas(&self) -> f64 {
        let inflation = self.worst().max(1.0).sqrt();
        let below = [1, 2, 3].map(|at: usize| -self.parameters[at] / (self.std(at) * inflation));
        below.into_iter().fold(0.0, f64::max)
    }

    /// Mean flow of a leak over the blocks, m³/s, of its size or of its sign, by both laws; its spread grows with the misfit.
    pub fn flow_m3s(&self, blocks: &[Block], leak: Leak, of: fn(f64) -> f64) -> Estimate<f64> {
        let [plain, orifice] = [LEAKS, ORIFICES].map(|at| at + leak as usize);
        let time_s = blocks.iter().map(|block| block.time_s).sum::<f64>().max(f64::MIN_POSITIVE);
        let mut weights = Vector::zeros();
        for block in blocks {
            weights[plain] += of(block.across(leak)) * self.units[plain] / time_s;
            weights[orifice] += of(block.roots[leak]) * self.units[orifice] / time_s;
        }
        let variance = self.worst().max(1.0) * weights.dot(&(self.covariance * weights));
        Estimate { value: weights.dot(&self.parameters), std: variance.max(0.0).sqrt() }
    }

    /// How far a leak's coefficient by an orifice's law lies above zero, in such standard deviations.
    pub fn orifice_sigmas(&self, leak: Leak) -> f64 {
        let Estimate { value, std } = self.estimate(ORIFICES + leak as usize);
        if std > 0.0 { value / std } else { 0.0 }
    }

    /// Whether the rig can be so: bulk modulus and sensor errors within their priors, no leak negative.
    pub fn is_possible(&self) -> bool {
        let inside = [0, 4, 5, 6, 7, 8].iter().all(|at| self.parameters[*at].abs() <= PRIOR_SIGMAS);
        inside && self.compressibility_per_pa > 0.0 && self.negative_leak_sigmas() < NEGATIVE_SIGMAS
    }
}

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

struct System {
    priors: Vector,
    compressibility_per_pa: f64,
    pressure_std_pa: f64,
    position_std_m: f64,
    balance: Combination,
    travel: [Combination; 3],
}

/// Sums of the normal equations.
struct Sums {
    matrix: SMatrix<f64, PARAMETERS, PARAMETERS>,
    vector: Vector,
}

/// One whitened row.
struct Row {
    left: f64,
    columns: Vector,
}

/// A perfect sensor does not exist: as in the estimator.
const RESOLUTION: f64 = 1e-6;
/// Fewer rows say nothing.
const LEAST_ROWS: usize = 30;

impl System {
    fn new(rig: &Rig, Priors(priors): Priors, leaks: [f64; 3]) -> Self {
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
            priors,
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

    fn solve(&self, blocks: &[Block]) -> Option<Fit> {
        let both = blocks.iter().map(|block| (block, (block.fed == Fed::Both).then_some(self.balance)));
        let balance = self.whitened(both);
        let travel = blocks.iter().map(|block| (block, Some(self.travel[block.fed as usize])));
        let travel = self.whitened(travel);
        let series = [balance, travel];
        if series.iter().map(Vec::len).sum::<usize>() < LEAST_ROWS {
            return None;
        }
        let mut sums = Sums { matrix: SMatrix::identity(), vector: Vector::zeros() };
        for row in series.iter().flatten() {
            sums.matrix.ger(1.0, &row.columns, &row.columns, 1.0);
            sums.vector.axpy(row.left, &row.columns, 1.0);
        }
        let cholesky = sums.matrix.cholesky()?;
        let parameters = cholesky.solve(&sums.vector);
        let ratio = |rows: &Vec<Row>| {
            let squares = rows.iter().map(|row| (row.left - row.columns.dot(&parameters)).powi(2));
            (!rows.is_empty()).then(|| squares.sum::<f64>() / rows.len() as f64)
        };
        Some(Fit {
            ratios: [ratio(&series[0]), ratio(&series[1])],
            rows: [series[0].len(), series[1].len()],
            penalty: parameters.norm_squared(),
            units: self.priors,
            compressibility_per_pa: self.compressibility_per_pa + parameters[0] * self.priors[0],
            parameters,
            covariance: cholesky.inverse(),
        })
    }

    /// The rows of one equation, each free of its neighbours' noise: readings at a block's ends are in both blocks
    /// that they part, with opposite signs, so the covariance is tridiagonal and its Cholesky factor has two diagonals.
    fn whitened<'a>(&self, blocks: impl Iterator<Item = (&'a Block, Option<Combination>)>) -> Vec<Row> {
        let mut rows: Vec<Row> = Vec::new();
        let mut before: Option<(f64, f64)> = None;
        for (block, combination) in blocks {
            let Some(combination) = combination else {
                before = None;
                continue;
            };
            let ends = self.end_variance(&combination, block);
            let variance = combination.flow_variance * block.time_square_s2 + 2.0 * ends;
            let mut row = self.row(&combination, block);
            let mut pivot = variance;
            if let (true, Some((last_pivot, last_ends)), Some(last)) = (block.follows, before, rows.last()) {
                let shared = last_ends.min(ends) / last_pivot;
                pivot -= shared * shared;
                row.left += shared * last.left;
                row.columns.axpy(shared, &last.columns, 1.0);
            }
            let pivot =
                pivot.max(0.5 * variance.min(combination.flow_variance * block.time_square_s2)).sqrt();
            row.left /= pivot;
            row.columns /= pivot;
            before = Some((pivot, ends));
            rows.push(row);
        }
        rows
    }

    /// Variance of one end's readings: position, and pressures through the oil they store.
    fn end_variance(&self, of: &Combination, block: &Block) -> f64 {
        let stored = |weight: f64, chamber: &Chamber| {
            (weight * chamber.volume_m3 * self.compressibility_per_pa * self.pressure_std_pa).powi(2)
        };
        (of.position * self.position_std_m).powi(2) + stored(of.a, &block.a) + stored(of.b, &block.b)
    }

    fn row(&self, of: &Combination, block: &Block) -> Row {
        let (a, b) = (&block.a, &block.b);
        let compression = of.a * a.compression + of.b * b.compression;
        let travel = of.position * block.travel_m;
        let (flow_a, flow_b) = (of.a * a.flow_m3, of.b * b.flow_m3);
        let internal = (of.a - of.b) * block.across(Leak::Internal);
        let (at_a, at_b) = (of.a * a.pressure, of.b * b.pressure);
        let columns = Vector::from([
            compression,
            internal,
            at_a,
            at_b,
            of.a * block.time_s,
            of.b * block.time_s,
            flow_a,
            flow_b,
            -travel,
            of.a * block.time_s * block.after_middle_s,
            of.b * block.time_s * block.after_middle_s,
            internal * block.after_middle_s,
            at_a * block.after_middle_s,
            at_b * block.after_middle_s,
            (of.a - of.b) * block.roots.internal,
            of.a * block.roots.external_a,
            of.b * block.roots.external_b,
        ]);
        Row {
            left: flow_a + flow_b - travel - self.compressibility_per_pa * compression,
            columns: columns.component_mul(&self.priors),
        }
    }
}

/// Variance of the combined flows: the meters' noise, and the pressures' through the leaks, at most as much again: absurd
/// leaks must not excuse a misfit.
fn flow_variance(
    a: f64,
    b: f64,
    sensors: &Sensors<f64>,
    [internal, at_a, at_b]: [f64; 3],
    floor: f64,
) -> f64 {
    let own =
        (a * sensors.flow_a.noise_std.max(floor)).powi(2) + (b * sensors.flow_b.noise_std.max(floor)).powi(2);
    let by_a = (a - b) * internal + a * at_a;
    let by_b = b * at_b - (a - b) * internal;
    let through_leaks = sensors.pressure.noise_std.powi(2) * (by_a * by_a + by_b * by_b);
    own + through_leaks.min(own)
}
