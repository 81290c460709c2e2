//! Cramér–Rao bound of a trace: no unbiased estimator's spread can be below it.
//!
//! Errors in variables, all of them: every reading (x, P_A, P_B, Q_A, Q_B) of every sample carries white noise
//! of known spread, the true trajectory is unknown, and the two continuity equations tie neighbouring samples.
//! For step k the equations' error is L_k e_k + R_k e_{k+1}, so its covariance is block tridiagonal; the Fisher
//! information of θ is Gᵀ W⁻¹ G with G = ∂(equations)/∂θ at the truth (W. Fuller 1987, Measurement Error
//! Models, §3.1; S. Kay 1993, Fundamentals of Statistical Signal Processing, §3.9). It is computed by block
//! elimination and shares nothing with the estimator whose efficiency it judges.

use nalgebra::{Matrix2, Matrix2x5, Matrix6, OMatrix, U2, U6, Vector5};
use pitchleak_core::{Cylinder, Fluid, PerLeak, Sample, Sensors};

/// Smallest standard deviations that an unbiased estimator can reach on a trace.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CramerRao {
    /// Leak coefficients, m³/(s·Pa).
    pub leak_std: PerLeak<f64>,
    /// Compressibility 1/β, 1/Pa.
    pub compressibility_std: f64,
}

/// What the bound is computed for: the rig, and the truth.
#[derive(Clone, Copy, Debug)]
pub struct CramerRaoModel<'a> {
    /// Geometry.
    pub cylinder: &'a Cylinder<f64>,
    /// True bulk modulus, and the spread of its prior.
    pub fluid: &'a Fluid<f64>,
    /// Noise and, as priors of the meters' offsets, biases of the sensors.
    pub sensors: &'a Sensors<f64>,
    /// True leak coefficients, m³/(s·Pa).
    pub leaks: &'a PerLeak<f64>,
}

type Columns = OMatrix<f64, U2, U6>;

/// One step's equations: how they respond to the noise at both ends and to the parameters
/// (1/β, C_ip, C_epA, C_epB, offset A, offset B).
struct StepModel {
    left: Matrix2x5<f64>,
    right: Matrix2x5<f64>,
    columns: Columns,
}

impl CramerRaoModel<'_> {
    /// The bound for noise-free `samples`, `dt_s` apart; `None` where a flow is missing or nothing at all
    /// can be learnt.
    pub fn bound(&self, dt_s: f64, samples: &[Sample<f64>]) -> Option<CramerRao> {
        let noise = self.noise_variance();
        let mut information = self.prior_information();
        let mut before: Option<(Matrix2<f64>, StepModel, Columns)> = None;
        for pair in samples.windows(2) {
            let [first, second] = pair else { continue };
            let step = self.step(dt_s, first, second)?;
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
        }
        let scale = self.units();
        let covariance = (scale * information * scale).try_inverse()?;
        let std = |i: usize| scale[(i, i)] * covariance[(i, i)].sqrt();
        Some(CramerRao {
            compressibility_std: std(0),
            leak_std: PerLeak { internal: std(1), external_a: std(2), external_b: std(3) },
        })
    }

    /// Variances of x, P_A, P_B, Q_A, Q_B.
    fn noise_variance(&self) -> Vector5<f64> {
        let s = self.sensors;
        let std = [s.position, s.pressure, s.pressure, s.flow_a, s.flow_b].map(|s| s.noise_std);
        Vector5::from(std).map(|std| std * std)
    }

    fn prior_information(&self) -> Matrix6<f64> {
        let relative = self.fluid.bulk_modulus_std_pa / self.fluid.bulk_modulus_pa;
        let of = |std: f64| std.max(1e-30).powi(-2);
        let flow_floor = 1e-9 * self.cylinder.area_a_m2 * self.cylinder.stroke_m;
        Matrix6::from_diagonal(&nalgebra::Vector6::new(
            of(relative / self.fluid.bulk_modulus_pa),
            0.0,
            0.0,
            0.0,
            of(self.sensors.flow_a.bias_std.max(flow_floor)),
            of(self.sensors.flow_b.bias_std.max(flow_floor)),
        ))
    }

    /// Sizes of the parameters, to invert a matrix of order one.
    fn units(&self) -> Matrix6<f64> {
        let leak = 1e-11;
        let flow = 1e-6;
        Matrix6::from_diagonal(&nalgebra::Vector6::new(
            0.1 / self.fluid.bulk_modulus_pa,
            leak,
            leak,
            leak,
            flow,
            flow,
        ))
    }

    /// Equations Q_A − A_A ẋ − κ V_A Ṗ_A − leaks = 0 and Q_B + A_B ẋ − … = 0, integrated over one step.
    fn step(&self, dt_s: f64, first: &Sample<f64>, second: &Sample<f64>) -> Option<StepModel> {
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
            Matrix2x5::new(
                -end * aa - 0.5 * kappa * aa * rise_a,
                -end * kappa * va - half * own_a,
                half * leaks.internal,
                half,
                0.0,
                end * ab + 0.5 * kappa * ab * rise_b,
                half * leaks.internal,
                -end * kappa * vb - half * own_b,
                0.0,
                half,
            )
        };
        let pressure_a = half * (first.pa_pa + second.pa_pa);
        let pressure_b = half * (first.pb_pa + second.pb_pa);
        let load = pressure_a - pressure_b;
        first.qa_m3s.and(first.qb_m3s).and(second.qa_m3s).and(second.qb_m3s)?;
        let columns = Columns::from_row_slice(&[
            va * rise_a,
            load,
            pressure_a,
            0.0,
            dt_s,
            0.0, //
            vb * rise_b,
            -load,
            0.0,
            pressure_b,
            0.0,
            dt_s,
        ]);
        Some(StepModel { left: noise_at(-1.0), right: noise_at(1.0), columns })
    }
}

type Matrix5 = nalgebra::Matrix5<f64>;
