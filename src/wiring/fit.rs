//! How well the plain model explains a piece of a trace: generalised least squares on both continuity equations over
//! the whole piece, with the declared noise. Nothing restarts, so nothing is forgiven.

use super::blocks::{Block, Chamber, Fed, blocks};
use crate::rig::Rig;
use crate::trace::Record;
use nalgebra::{SMatrix, SVector};
use pitchleak_core::{Cylinder, Estimate, Leak, Parameter, PerLeak, Sensors};

/// The estimator's nine in their order (1/β less its prior mean; the three leaks; the meters' offsets; the gains of meters
/// and position sensor); the drifts of the meters' zeros; the slopes of the three leaks.
const PARAMETERS: usize = 14;
type Vector = SVector<f64, PARAMETERS>;

/// Prior standard deviations of the parameters, SI.
#[derive(Clone, Copy, Debug)]
pub(super) struct Priors(Vector);

/// A sensor that nobody declared wrong may be off by so much, 1 σ: of full scale, of the reading.
const UNDECLARED_SHARE: f64 = 0.05;
/// A meter's zero that nobody declared wrong may be off by this share of full scale, 1 σ, and drift as far through a trace.
const UNDECLARED_ZERO_SHARE: f64 = 0.01;
/// A gain that is off by far, 1 σ, and a zero, share of full scale.
const WILD_GAIN: f64 = 0.2;
const WILD_ZERO_SHARE: f64 = 0.1;
/// Where these parameters stand: of leaks in their order, of meters A and B.
const LEAKS: usize = 1;
const OFFSETS: usize = 4;
const DRIFTS: usize = 9;
const SLOPES: usize = 11;
/// A leak of the meter's whole range at this share of the pressure sensor's is the widest looked for, 1 σ.
const LEAK_AT_SHARE: f64 = 0.1;

impl Priors {
    /// What the rig file declares.
    pub fn declared(rig: &Rig) -> Self {
        let (fluid, sensors) = (&rig.fluid, rig.sensors());
        let flow = rig.instruments.flow_a.full_scale.max(rig.instruments.flow_b.full_scale);
        let leak = flow / (LEAK_AT_SHARE * rig.instruments.pressure.full_scale);
        let compressibility = fluid.bulk_modulus_std_pa / (fluid.bulk_modulus_pa * fluid.bulk_modulus_pa);
        Self(Vector::from([
            compressibility,
            leak,
            leak,
            leak,
            sensors.flow_a.bias_std,
            sensors.flow_b.bias_std,
            sensors.flow_a.gain_std,
            sensors.flow_b.gain_std,
            sensors.position.gain_std,
            0.0,
            0.0,
            0.0,
            0.0,
            0.0,
        ]))
    }

    /// The same rig with meters whose zeros are off and drift, as undeclared ones are now and then.
    pub fn with_zeros_off(mut self, rig: &Rig, duration_s: f64) -> Self {
        let Self(spread) = &mut self;
        let full_scales = [rig.instruments.flow_a.full_scale, rig.instruments.flow_b.full_scale];
        for (meter, full_scale) in full_scales.into_iter().enumerate() {
            let usual = UNDECLARED_ZERO_SHARE * full_scale;
            spread[OFFSETS + meter] = spread[OFFSETS + meter].max(usual);
            spread[DRIFTS + meter] = usual / duration_s.max(1.0);
        }
        self
    }

    /// The same rig with leaks that change by anything from end to end.
    pub fn with_changing_leaks(mut self, duration_s: f64) -> Self {
        for leak in 0..3 {
            self.0[SLOPES + leak] = self.0[LEAKS + leak] / duration_s.max(1.0);
        }
        self
    }

    /// The same rig without this leak.
    pub fn without(mut self, leak: Leak) -> Self {
        self.0[LEAKS + leak as usize] = 0.0;
        self.0[SLOPES + leak as usize] = 0.0;
        self
    }

    /// The same rig with one sensor whose gain or zero may be off by far.
    pub fn with_error(mut self, error: Parameter, rig: &Rig) -> Self {
        self.0[error as usize] = match error {
            Parameter::OffsetA => WILD_ZERO_SHARE * rig.instruments.flow_a.full_scale,
            Parameter::OffsetB => WILD_ZERO_SHARE * rig.instruments.flow_b.full_scale,
            _ => WILD_GAIN,
        };
        self
    }

    /// The same rig with sensors that may be off as undeclared ones are now and then.
    pub fn with_sensor_errors(rig: &Rig) -> Self {
        let Self(mut spread) = Self::declared(rig);
        let sheets = &rig.instruments;
        let usual = [
            UNDECLARED_SHARE * sheets.flow_a.full_scale,
            UNDECLARED_SHARE * sheets.flow_b.full_scale,
            UNDECLARED_SHARE,
            UNDECLARED_SHARE,
            UNDECLARED_SHARE,
        ];
        for (spread, usual) in spread.iter_mut().skip(OFFSETS).zip(usual) {
            *spread = spread.max(usual);
        }
        Self(spread)
    }
}

/// What a fit leaves.
#[derive(Clone, Copy, Debug)]
pub(super) struct Fit {
    /// Mean square of the normalised residual of the flow balance, and of position against flows; none without rows.
    pub ratios: [Option<f64>; 2],
    /// Rows of each.
    pub rows: [usize; 2],
    /// χ² of the parameters against their priors.
    penalty: f64,
    /// In prior standard deviations.
    parameters: Vector,
    std: Vector,
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

    /// A parameter in SI; its spread grows with the misfit.
    fn estimate(&self, at: usize) -> Estimate<f64> {
        let inflation = self.worst().max(1.0).sqrt();
        Estimate { value: self.parameters[at], std: inflation * self.std[at] }.scaled(self.units[at])
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
        let below = [1, 2, 3].map(|at: usize| -self.parameters[at] / (self.std[at] * inflation));
        below.into_iter().fold(0.0, f64::max)
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
        let variances = cholesky.inverse().diagonal();
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
            std: variances.map(f64::sqrt),
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
        let internal = (of.a - of.b) * (a.pressure - b.pressure);
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
