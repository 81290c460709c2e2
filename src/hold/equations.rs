//! Both continuity equations of a hold, integrated: what a chamber held when the ports were shut is still in it, or it leaked.
//!
//! With the compressibility κ = 1/β the oil of a chamber, counted without pressure, is W = V e^(κP). Without flow through
//! the ports (Wu et al. 2011, eq. 1, times e^(κP), integrated from the hold's beginning):
//!
//! ```text
//! h_A = V_A(x) e^(κP_A) + C_ip ∫e^(κP_A) (P_A − P_B) dt + C_epA ∫e^(κP_A) P_A dt − W_A0 = 0
//! h_B = V_B(x) e^(κP_B) − C_ip ∫e^(κP_B) (P_A − P_B) dt + C_epB ∫e^(κP_B) P_B dt − W_B0 = 0
//! ```
//!
//! Readings are x, P_A, P_B with white noise of known size. Integrals have next to none of it, so the noise of (h_A, h_B) is white too: at
//! each reading 2 × 2, G R Gᵀ, with the slopes G of h by (x, P_A, P_B). Position noise enters both with opposite signs. Its
//! combination without x is hundreds of times quieter: the pressures tell most. Nothing is said of the load, which may change.

use super::recorder::Reading;
use nalgebra::{Matrix2, Matrix2x3, Matrix2x4, Matrix3, Matrix4, Vector2, Vector3, Vector4};
use pitchleak_core::Cylinder;

/// Unknowns in the order κ, C_ip, C_epA, C_epB, each in a unit of its own.
pub(super) type Unknowns = Vector4<f64>;

/// What is known before.
#[derive(Clone, Copy, Debug)]
pub(super) struct Known<'a> {
    pub cylinder: &'a Cylinder<f64>,
    /// Variances of the readings x, P_A, P_B, SI.
    pub variances: Vector3<f64>,
    /// Units of the unknowns, 1/Pa and m³/(s·Pa).
    pub units: Vector4<f64>,
}

/// One reading's equations, made linear at the signals of the moment.
#[derive(Clone)]
struct Row {
    /// By x, P_A, P_B.
    slopes: Matrix2x3<f64>,
    /// By the unknowns, in their units.
    columns: Matrix2x4<f64>,
    /// h without leaks and W_0 at the readings, made linear there, m³.
    residual: Vector2<f64>,
    /// Inverse of G R Gᵀ, 1/m⁶.
    weight: Matrix2<f64>,
}

/// The equations of one hold around smoothed signals and a compressibility.
#[derive(Clone)]
pub(super) struct Equations {
    rows: Vec<Row>,
    /// Weighted means of `columns` and `residual`, with which W_0 goes.
    mean_columns: Matrix2x4<f64>,
    mean_residual: Vector2<f64>,
}

/// Normal equations Λ θ = η, and the sum of squares at θ = 0.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Normal {
    pub information: Matrix4<f64>,
    pub right: Vector4<f64>,
    pub squares: f64,
}

impl Equations {
    /// Of the readings `seen`, made linear at `signals` and `kappa_ppa`, 1/Pa.
    pub fn at(known: &Known<'_>, seen: &[Reading], signals: &[Reading], kappa_ppa: f64) -> Self {
        let mut integrals = Vector4::<f64>::zeros();
        let mut before: Option<(f64, Vector4<f64>)> = None;
        let rows: Vec<Row> = seen
            .iter()
            .zip(signals)
            .map(|(seen, at)| {
                let rates = leak_rates(at, kappa_ppa);
                if let Some((t_s, last)) = before {
                    integrals += (last + rates) * (0.5 * (at.t_s - t_s));
                }
                before = Some((at.t_s, rates));
                Row::new(known, seen, at, &integrals, kappa_ppa)
            })
            .collect();
        let weight: Matrix2<f64> = rows.iter().map(|row| row.weight).sum();
        let inverse = weight.try_inverse().unwrap_or_default();
        let mean_columns = inverse * rows.iter().map(|row| row.weight * row.columns).sum::<Matrix2x4<f64>>();
        let mean_residual = inverse * rows.iter().map(|row| row.weight * row.residual).sum::<Vector2<f64>>();
        Self { rows, mean_columns, mean_residual }
    }

    /// Columns and residual of each row, W_0 taken out.
    fn centred(&self) -> impl Iterator<Item = (&Row, Matrix2x4<f64>, Vector2<f64>)> {
        self.rows.iter().map(|row| (row, row.columns - self.mean_columns, row.residual - self.mean_residual))
    }

    /// What the equations say of the unknowns: of κ as a step from where they were made linear.
    pub fn normal(&self) -> Normal {
        let mut normal = Normal::default();
        for (row, columns, residual) in self.centred() {
            let weighted = columns.transpose() * row.weight;
            normal.information += weighted * columns;
            normal.right -= weighted * residual;
            normal.squares += residual.dot(&(row.weight * residual));
        }
        normal
    }

    /// The likeliest signals where the unknowns are these: z − R Gᵀ (G R Gᵀ)⁻¹ h.
    pub fn smoothed(&self, known: &Known<'_>, seen: &[Reading], unknowns: &Unknowns) -> Vec<Reading> {
        let rows = self.centred().zip(seen);
        rows.map(|((row, columns, residual), seen)| {
            let pull = row.slopes.transpose() * (row.weight * (residual + columns * unknowns));
            let off = known.variances.component_mul(&pull);
            Reading {
                t_s: seen.t_s,
                x_m: seen.x_m - off.x,
                pa_pa: seen.pa_pa - off.y,
                pb_pa: seen.pb_pa - off.z,
            }
        })
        .collect()
    }

    /// What is left of each reading's equations, whitened: two numbers of variance 1 where model and noise are right.
    pub fn innovations(&self, unknowns: &Unknowns) -> Vec<Vector2<f64>> {
        let whiten = |(row, columns, residual): (&Row, Matrix2x4<f64>, Vector2<f64>)| {
            let factor = row.weight.cholesky().map_or_else(Matrix2::zeros, |factor| factor.l());
            factor.transpose() * (residual + columns * unknowns)
        };
        self.centred().map(whiten).collect()
    }
}

/// What leaks per unit of coefficient: e^(κP_A) P_L, e^(κP_A) P_A, e^(κP_B) P_L, e^(κP_B) P_B.
fn leak_rates(at: &Reading, kappa_ppa: f64) -> Vector4<f64> {
    let (dense_a, dense_b) = ((kappa_ppa * at.pa_pa).exp(), (kappa_ppa * at.pb_pa).exp());
    let load_pa = at.pa_pa - at.pb_pa;
    Vector4::new(dense_a * load_pa, dense_a * at.pa_pa, dense_b * load_pa, dense_b * at.pb_pa)
}

impl Row {
    fn new(
        known: &Known<'_>,
        seen: &Reading,
        at: &Reading,
        integrals: &Vector4<f64>,
        kappa_ppa: f64,
    ) -> Self {
        let cylinder = known.cylinder;
        let (dense_a, dense_b) = ((kappa_ppa * at.pa_pa).exp(), (kappa_ppa * at.pb_pa).exp());
        let oil_a = cylinder.volume_a_m3(at.x_m) * dense_a;
        let oil_b = cylinder.volume_b_m3(at.x_m) * dense_b;
        let slopes = Matrix2x3::from([
            [cylinder.area_a_m2 * dense_a, -cylinder.area_b_m2 * dense_b],
            [kappa_ppa * oil_a, 0.0],
            [0.0, kappa_ppa * oil_b],
        ]);
        let [through_a, out_a, through_b, out_b] = (*integrals).into();
        let units = &known.units;
        let columns = Matrix2x4::from([
            [units[0] * oil_a * at.pa_pa, units[0] * oil_b * at.pb_pa],
            [units[1] * through_a, -units[1] * through_b],
            [units[2] * out_a, 0.0],
            [0.0, units[3] * out_b],
        ]);
        let off = Vector3::new(seen.x_m - at.x_m, seen.pa_pa - at.pa_pa, seen.pb_pa - at.pb_pa);
        let noise = slopes * Matrix3::from_diagonal(&known.variances) * slopes.transpose();
        Self {
            slopes,
            columns,
            residual: Vector2::new(oil_a, oil_b) + slopes * off,
            weight: noise.try_inverse().unwrap_or_default(),
        }
    }
}
