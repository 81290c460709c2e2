//! How well leaks could be known from a trace at best: the Cramér–Rao bound of its flows.
//!
//! The readings of flow are linear in what is unknown (theory: Kay 1993, *Fundamentals of Statistical Signal Processing I*, §3.8):
//!
//! ```text
//! Q_A − A_A ẋ = V_A κ Ṗ_A + C_int P_L + C_A P_A + z_A + d_A t + g_A Q_A + noise
//! Q_B + A_B ẋ = V_B κ Ṗ_B − C_int P_L + C_B P_B + z_B + d_B t + g_B Q_B + noise
//! ```
//!
//! with leaks of their own before and after the onset, one compressibility κ, and zeros z, their drift d and gains g of the
//! meters, each as uncertain as the verdict takes it. Position and pressures count as exact, so that no method reaches below it.

use crate::explain::{USUAL_DRIFT, USUAL_GAIN, USUAL_ZERO};
use crate::rig::Rig;
use crate::trace::Record;
use nalgebra::SMatrix;
use pitchleak_core::{Leak, PerLeak};

/// Three leaks before the onset, three after, κ, and of each meter zero, drift and gain.
const UNKNOWN: usize = 13;
const COMPRESSIBILITY: usize = 6;
const ZEROS: usize = 7;
const DRIFTS: usize = 9;
const GAINS: usize = 11;
/// No leak has a larger coefficient, m³/(s·Pa): 60 L/min at a bar.
const LARGEST_COEFFICIENT: f64 = 1e-8;
/// Known to less than this share of the largest, or not at all.
const TOLD: f64 = 0.1;

type Information = SMatrix<f64, UNKNOWN, UNKNOWN>;

/// What the records so far say.
pub(super) struct Bound<'r> {
    information: Information,
    onset_s: f64,
    duration_s: f64,
    last: Option<Record>,
    flow_std: [f64; 2],
    rig: &'r Rig,
}

impl<'r> Bound<'r> {
    /// Of leaks that begin at `onset_s` in a trace of `duration_s`.
    pub fn new(rig: &'r Rig, onset_s: f64, duration_s: f64) -> Self {
        let sheets = [rig.instruments.flow_a, rig.instruments.flow_b];
        let noises = [rig.sensors().flow_a.noise_std, rig.sensors().flow_b.noise_std];
        let mut information = Information::zeros();
        for place in 0..COMPRESSIBILITY {
            information[(place, place)] = LARGEST_COEFFICIENT.powi(-2);
        }
        let mut know = |place: usize, std: f64| information[(place, place)] = std.powi(-2);
        know(COMPRESSIBILITY, rig.fluid.bulk_modulus_std_pa / rig.fluid.bulk_modulus_pa);
        let declared = |own: f64, usual: f64| if own > 0.0 { own } else { usual };
        for (side, (sheet, noise)) in sheets.iter().zip(noises).enumerate() {
            know(ZEROS + side, declared(sheet.bias, USUAL_ZERO) * sheet.full_scale / noise);
            know(DRIFTS + side, USUAL_DRIFT * sheet.full_scale / noise);
            know(GAINS + side, declared(sheet.gain, USUAL_GAIN));
        }
        Self { information, onset_s, duration_s, last: None, flow_std: noises, rig }
    }

    pub fn add(&mut self, record: &Record) {
        let last = self.last.replace(*record).filter(|_| record.step_s() > 0.0);
        let (sample, cylinder) = (&record.sample, &self.rig.cylinder);
        let Some(before) = last.map(|last| last.sample) else { return };
        let volumes = [cylinder.volume_a_m3(sample.x_m), cylinder.volume_b_m3(sample.x_m)];
        let rises = [sample.pa_pa - before.pa_pa, sample.pb_pa - before.pb_pa];
        let (pa, pb) = (sample.pa_pa, sample.pb_pa);
        let pressures = [[pa - pb, pa, 0.0], [pb - pa, 0.0, pb]];
        let from = if record.t_s < self.onset_s { 0 } else { Leak::ALL.len() };
        for (side, flow) in [sample.qa_m3s, sample.qb_m3s].into_iter().enumerate() {
            let Some(flow_m3s) = flow else { continue };
            let std = self.flow_std[side];
            let mut row = [0.0; UNKNOWN];
            for (place, pressure) in pressures[side].into_iter().enumerate() {
                row[from + place] = pressure / std;
            }
            let rate = rises[side] / record.dt_s / self.rig.fluid.bulk_modulus_pa;
            row[COMPRESSIBILITY] = volumes[side] * rate / std;
            row[ZEROS + side] = 1.0;
            row[DRIFTS + side] = (record.t_s - self.onset_s) / self.duration_s;
            row[GAINS + side] = flow_m3s / std;
            let row = SMatrix::<f64, UNKNOWN, 1>::from(row);
            self.information.ger(1.0, &row, &row, 1.0);
        }
    }

    /// Standard deviations of what the leak coefficients gain at the onset, m³/(s·Pa); none of what the flows do not tell.
    pub fn stds(&self) -> PerLeak<Option<f64>> {
        // Parameters of one size, or the inverse loses its digits.
        let scale = self.information.diagonal().map(|own| own.sqrt().recip());
        let scaled = Information::from_fn(|i, j| self.information[(i, j)] * scale[i] * scale[j]);
        let inverse = scaled.cholesky().map(|cholesky| cholesky.inverse());
        PerLeak::from_fn(|leak| {
            let inverse = inverse.as_ref()?;
            let (before, after) = (leak as usize, Leak::ALL.len() + leak as usize);
            let covariance = |i: usize, j: usize| inverse[(i, j)] * scale[i] * scale[j];
            let variance =
                covariance(after, after) + covariance(before, before) - 2.0 * covariance(before, after);
            let std = variance.max(0.0).sqrt();
            (std < TOLD * LARGEST_COEFFICIENT).then_some(std)
        })
    }
}
