//! Cramér–Rao bound of a trace: no unbiased estimator's spread can be below it.
//!
//! Errors in variables, all of them: every reading (x, P_A, P_B, Q_A, Q_B) of every sample carries white noise
//! of known spread, the true trajectory is unknown, and the two continuity equations tie neighbouring samples.
//! For step k the equations' error is L_k e_k + R_k e_{k+1}, so its covariance is block tridiagonal; the Fisher
//! information of θ is Gᵀ W⁻¹ G with G = ∂(equations)/∂θ at the truth (W. Fuller 1987, Measurement Error
//! Models, §3.1; S. Kay 1993, Fundamentals of Statistical Signal Processing, §3.9). It is computed by block
//! elimination and shares nothing with the estimator whose efficiency it judges.
//!
//! The best that any estimator can do: an efficient one, its errors drawn from the Cramér–Rao bound.
//!
//! An efficient estimator's error at one time is its error at any later time plus a part that is independent
//! of it (S. Kay 1993, Fundamentals of Statistical Signal Processing, §3.4 and §12.6: the sequential estimator's
//! corrections are white). So its history over a window is drawn backwards: from the bound at the end,
//! each step adds the difference of two bounds. Scored like a real estimator, it tells what the figures of
//! the table can be at best, start and definition of steady state included.

use super::protocol::SAMPLE_RATE_HZ;
use super::table::EstimateHistory;
use nalgebra::{Matrix2, Matrix2x5, SMatrix, SVector, SymmetricEigen, Vector5};
use pitchleak::core::{Cylinder, Estimate, FilterError, Fluid, PerLeak, Sample, Sensors};
use pitchleak::simulate::{Normal, Sensing, Truth};

/// Parameters of the bound: 1/β, C_ip, C_epA, C_epB, biases of flow meters A and B, of pressure sensors A and
/// B, and of the position sensor.
pub const PARAMETERS: usize = 9;

/// Smallest covariance that an unbiased estimator can reach on a trace.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CramerRao {
    /// Leak coefficients, m³/(s·Pa).
    pub leak_std: PerLeak<f64>,
    /// Compressibility 1/β, 1/Pa.
    pub compressibility_std: f64,
    /// Of all parameters, each in its [`units`](CramerRaoModel::units).
    pub covariance: SMatrix<f64, PARAMETERS, PARAMETERS>,
}

/// What the bound is computed for: the rig, and the truth.
#[derive(Clone, Copy, Debug)]
pub struct CramerRaoModel<'a> {
    /// Geometry.
    pub cylinder: &'a Cylinder<f64>,
    /// True bulk modulus, and the spread of its prior.
    pub fluid: &'a Fluid<f64>,
    /// Noise and, as priors of their offsets, biases of the sensors.
    pub sensors: &'a Sensors<f64>,
    /// True leak coefficients, m³/(s·Pa).
    pub leaks: &'a PerLeak<f64>,
}

type Columns = SMatrix<f64, 2, PARAMETERS>;
type Information = SMatrix<f64, PARAMETERS, PARAMETERS>;
type Units = SVector<f64, PARAMETERS>;

/// One step's equations: how they respond to the noise at both ends and to the parameters, each in its unit.
struct StepModel {
    left: Matrix2x5<f64>,
    right: Matrix2x5<f64>,
    columns: Columns,
}

impl CramerRaoModel<'_> {
    /// The bound for noise-free `samples`, `dt_s` apart; `None` where a flow is missing or nothing at all
    /// can be learnt.
    pub fn bound(&self, dt_s: f64, samples: &[Sample<f64>]) -> Option<CramerRao> {
        self.history(dt_s, samples, samples.len().saturating_sub(1).max(1))?.pop()
    }

    /// The bound after every `stride` samples of noise-free `samples`, `dt_s` apart; `None` as in
    /// [`bound`](Self::bound).
    pub fn history(&self, dt_s: f64, samples: &[Sample<f64>], stride: usize) -> Option<Vec<CramerRao>> {
        let units = self.units();
        let noise = self.noise_variance();
        let mut information = self.prior_information(&units);
        let mut before: Option<(Matrix2<f64>, StepModel, Columns)> = None;
        let mut history = Vec::new();
        for (index, pair) in samples.windows(2).enumerate() {
            let [first, second] = pair else { continue };
            let step = self.step(dt_s, first, second, &units)?;
            let spread =
                |m: &Matrix2x5<f64>, n: &Matrix2x5<f64>| m * Matrix5::from_diagonal(&noise) * n.transpose();
            let mut own = spread(&step.left, &step.left) + spread(&step.right, &step.right);
            let mut columns = step.columns;
            if let Some((inverse, last, last_columns)) = &before {
                let shared = spread(&last.right, &step.left);
                own -= shared.transpose() * inverse * shared;
                columns -= shared.transpose() * inverse * last_columns;
            }
            let inverse = own.try_inverse()?;
            information += columns.transpose() * inverse * columns;
            before = Some((inverse, step, columns));
            if (index + 1) % stride == 0 {
                history.push(CramerRao::of(&information, &units)?);
            }
        }
        Some(history)
    }

    /// Variances of x, P_A, P_B, Q_A, Q_B.
    fn noise_variance(&self) -> Vector5<f64> {
        let s = self.sensors;
        let std = [s.position, s.pressure, s.pressure, s.flow_a, s.flow_b].map(|s| s.noise_std);
        Vector5::from(std).map(|std| std * std)
    }

    /// Of the leaks next to nothing is known beforehand.
    fn prior_information(&self, units: &Units) -> Information {
        let relative = self.fluid.bulk_modulus_std_pa / self.fluid.bulk_modulus_pa;
        let sensors = self.sensors;
        let flow_floor = 1e-9 * self.cylinder.area_a_m2 * self.cylinder.stroke_m;
        let leak = 1e3 * LEAK_UNIT_M3SPA;
        let spread = Units::from([
            relative / self.fluid.bulk_modulus_pa,
            leak,
            leak,
            leak,
            sensors.flow_a.bias_std.max(flow_floor),
            sensors.flow_b.bias_std.max(flow_floor),
            sensors.pressure.bias_std.max(1.0),
            sensors.pressure.bias_std.max(1.0),
            sensors.position.bias_std.max(1e-9 * self.cylinder.stroke_m),
        ]);
        Information::from_diagonal(&units.component_div(&spread).map(|share| share * share))
    }

    /// Units of the parameters in [`CramerRao::covariance`], SI: near their sizes, so that matrices are well
    /// scaled.
    pub fn units(&self) -> SVector<f64, PARAMETERS> {
        let (leak, flow, pressure) = (LEAK_UNIT_M3SPA, 1e-6, 1e4);
        let compressibility = 0.1 / self.fluid.bulk_modulus_pa;
        let position = 0.01 * self.cylinder.stroke_m;
        Units::from([compressibility, leak, leak, leak, flow, flow, pressure, pressure, position])
    }

    /// Equations Q_A − A_A ẋ − κ V_A Ṗ_A − leaks = 0 and Q_B + A_B ẋ − … = 0, integrated over one step.
    fn step(&self, dt_s: f64, first: &Sample<f64>, second: &Sample<f64>, units: &Units) -> Option<StepModel> {
        let kappa = 1.0 / self.fluid.bulk_modulus_pa;
        let half = 0.5 * dt_s;
        let x = 0.5 * (first.x_m + second.x_m);
        let (va, vb) = (self.cylinder.volume_a_m3(x), self.cylinder.volume_b_m3(x));
        let (rise_a, rise_b) = (second.pa_pa - first.pa_pa, second.pb_pa - first.pb_pa);
        let (aa, ab) = (self.cylinder.area_a_m2, self.cylinder.area_b_m2);
        let leaks = self.leaks;
        let (own_a, own_b) = (leaks.internal + leaks.external_a, leaks.internal + leaks.external_b);
        // `end` is −1 at the start of the step and +1 at its end.
        let noise_at = |end: f64| {
            Matrix2x5::from([
                [-end * aa - 0.5 * kappa * aa * rise_a, end * ab + 0.5 * kappa * ab * rise_b],
                [-end * kappa * va - half * own_a, half * leaks.internal],
                [half * leaks.internal, -end * kappa * vb - half * own_b],
                [half, 0.0],
                [0.0, half],
            ])
        };
        let pressure_a = half * (first.pa_pa + second.pa_pa);
        let pressure_b = half * (first.pb_pa + second.pb_pa);
        let load = pressure_a - pressure_b;
        first.qa_m3s.and(first.qb_m3s).and(second.qa_m3s).and(second.qb_m3s)?;
        // Readings that are b too high: the true pressures are lower, and so are the leaks they drive.
        let (own_a, own_b, cross) = (-own_a * dt_s, -own_b * dt_s, leaks.internal * dt_s);
        let (stroke_a, stroke_b) = (-kappa * aa * rise_a, kappa * ab * rise_b);
        let columns = Columns::from([
            [va * rise_a, vb * rise_b],
            [load, -load],
            [pressure_a, 0.0],
            [0.0, pressure_b],
            [dt_s, 0.0],
            [0.0, dt_s],
            [own_a, cross],
            [cross, own_b],
            [stroke_a, stroke_b],
        ]) * Information::from_diagonal(units);
        Some(StepModel { left: noise_at(-1.0), right: noise_at(1.0), columns })
    }
}

impl CramerRao {
    fn of(information: &Information, units: &Units) -> Option<Self> {
        let covariance = information.try_inverse()?;
        let std = |i: usize| units[i] * covariance[(i, i)].sqrt();
        Some(Self {
            compressibility_std: std(0),
            leak_std: PerLeak { internal: std(1), external_a: std(2), external_b: std(3) },
            covariance,
        })
    }
}

/// Size of a leak coefficient, m³/(s·Pa).
const LEAK_UNIT_M3SPA: f64 = 1e-11;

type Matrix5 = nalgebra::Matrix5<f64>;

/// Samples between two renewals of the efficient estimator.
const STRIDE: usize = 5;

type Errors = SVector<f64, PARAMETERS>;
type Matrix = SMatrix<f64, PARAMETERS, PARAMETERS>;

/// An efficient estimator of one window.
pub struct Efficient {
    /// Roots of the differences of the bounds, in time; the last is the root of the bound at the end.
    steps: Vec<Matrix>,
    stds: Vec<PerLeak<f64>>,
    units: Errors,
    coefficients: PerLeak<f64>,
}

impl Efficient {
    /// The efficient estimator of the noise-free `samples`; `None` where nothing can be learnt.
    pub fn new(model: &CramerRaoModel<'_>, samples: &[Sample<f64>]) -> Option<Self> {
        let bounds = model.history(1.0 / SAMPLE_RATE_HZ, samples, STRIDE)?;
        let differences = bounds.windows(2).map(|pair| match pair {
            [now, next] => root(now.covariance - next.covariance),
            _ => Matrix::zeros(),
        });
        let steps = differences.chain(bounds.last().map(|last| root(last.covariance))).collect();
        let stds = bounds.iter().map(|bound| bound.leak_std).collect();
        Some(Self { steps, stds, units: model.units(), coefficients: *model.leaks })
    }

    /// Standard deviations of the leak coefficients after `samples` samples, m³/(s·Pa).
    pub fn leak_std(&self, samples: usize) -> PerLeak<f64> {
        let nothing = PerLeak::default().map(|_: f64| f64::INFINITY);
        self.place(samples).and_then(|place| self.stds.get(place)).copied().unwrap_or(nothing)
    }

    /// The renewal that stands after `samples` samples; the first one before it has been made.
    fn place(&self, samples: usize) -> Option<usize> {
        let newest = (samples.saturating_sub(1) / STRIDE).saturating_sub(1);
        self.steps.len().checked_sub(1).map(|last| newest.min(last))
    }

    /// Errors of all parameters at every renewal, one draw.
    fn draw(&self, normal: &mut Normal) -> Vec<Errors> {
        let mut error = Errors::zeros();
        let mut errors: Vec<Errors> = Vec::with_capacity(self.steps.len());
        for step in self.steps.iter().rev() {
            error += step * Errors::from_fn(|_, _| normal.draw());
            errors.push(error.component_mul(&self.units));
        }
        errors.reverse();
        errors
    }

    /// What it would have found in a window that `sensing` reads; `normal` draws its errors.
    ///
    /// # Errors
    /// Where the filter does not exist at the protocol's rate.
    pub fn history(
        &self,
        window: &[Truth],
        sensing: Sensing,
        normal: &mut Normal,
    ) -> Result<EstimateHistory, FilterError> {
        let errors = self.draw(normal);
        EstimateHistory::of(window, sensing, |index, _| {
            let place = self.place(index + 1).unwrap_or(0);
            let error = errors.get(place).copied().unwrap_or_default();
            let [_, internal, external_a, external_b, _, _, bias_a, bias_b, _] = error.into();
            let off = PerLeak { internal, external_a, external_b };
            let coefficients =
                self.coefficients.zip(off).map(|(c, off)| c + off).zip(self.leak_std(index + 1));
            (coefficients.map(|(value, std)| Estimate { value, std }), [bias_a, bias_b])
        })
    }
}

/// A root of a covariance, whose small negative eigenvalues are rounding.
fn root(covariance: Matrix) -> Matrix {
    let eigen = SymmetricEigen::new(0.5 * (covariance + covariance.transpose()));
    let roots = eigen.eigenvalues.map(|value| value.max(0.0).sqrt());
    eigen.eigenvectors * Matrix::from_diagonal(&roots)
}
