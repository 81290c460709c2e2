//! The noise of the weak form's rows, known from the sensors' own noise, and its inverse square root.
//!
//! A row weighs a sensor's samples by its test function where its signal enters the residual, by a difference of two block means where
//! its rate does, by the test function's curvature where that does. How much of each, `sensitivity.rs` says. Rows that share a block are
//! correlated, others are not: the covariance is a narrow band, and whitening by its Cholesky factor takes linear time. It is the Kalman
//! filter's innovation form of the same regression.

use super::integrals::{QUINTIC, QUINTIC_UNIT};
use super::linearisation::Linearisation;
use super::rows::{Entry, Row, Rows};
use super::sensitivity::{Sensitivity, held};
use crate::diagnose::data::Channel;
use crate::diagnose::equation::{Equation, PerEquation};
use crate::diagnose::thresholds::{NEGLIGIBLE_SHARE, ROUNDING};
use pitchleak_core::Sensors;

/// Sums of products of the weights of samples in two rows: by test functions (0), differences (1) and curvatures (2).
pub(super) type Products = [[f64; 3]; 3];

/// How samples of white noise weigh in rows, with steps of one.
#[derive(Clone, Copy, Default)]
pub(crate) struct TestFunctionWeights {
    /// Within a row.
    pub(crate) own: Products,
    /// With the next row.
    pub(crate) next: Products,
}

/// The weights of a test function over two blocks of `samples`, as `integrals.rs` takes mean, rate and curvature over a step.
pub(crate) fn test_function_weights(samples: usize) -> TestFunctionWeights {
    let m = samples as isize;
    let step = |j: isize| {
        if (0..2 * m - 1).contains(&j) { (m - (j - (m - 1)).abs()) as f64 / m as f64 } else { 0.0 }
    };
    let [first, second, third] = QUINTIC;
    let patterns = [
        [third, second, first, first, second, third].map(|share| share / QUINTIC_UNIT),
        [0.0, 0.0, -1.0, 1.0, 0.0, 0.0],
        [0.0, 0.5, -0.5, -0.5, 0.5, 0.0],
    ];
    // Sample i is the first to the last of the steps i + 2 … i − 3.
    let weight = |pattern: &[f64; 6], i: isize| {
        pattern.iter().zip(0_isize..).map(|(share, place)| share * step(i + 2 - place)).sum::<f64>()
    };
    let weights = patterns.map(|pattern| (-3..3 * m + 3).map(|i| weight(&pattern, i)).collect::<Vec<f64>>());
    let products = |shift: usize| {
        let product = |a: &[f64], b: &[f64]| a.iter().skip(shift).zip(b).map(|(a, b)| a * b).sum::<f64>();
        std::array::from_fn(|one| std::array::from_fn(|other| product(&weights[one], &weights[other])))
    };
    TestFunctionWeights { own: products(0), next: products(samples) }
}

/// What the covariance needs of the rows.
pub(crate) struct NoiseModel<'a> {
    pub(crate) at: &'a Linearisation,
    pub(crate) sensors: &'a Sensors<f64>,
    /// Variance of the error of each equation, as if white in its flow or force.
    pub(crate) equation_error: PerEquation<f64>,
    pub(crate) rows: &'a Rows,
    /// Of each of them.
    pub(crate) sensitivities: &'a [PerEquation<Sensitivity>],
}

impl NoiseModel<'_> {
    /// How the sensors enter an equation of a row. While an equation is incomplete, what is missing may drive leaks and storage to absurd
    /// sizes: their noise must not hide it. That of the leaks is held to the flow meter's, that of storage to the cylinder's own.
    fn sensitivity(&self, row: usize, equation: Equation) -> Sensitivity {
        let mut own = self.sensitivities[row][equation];
        if self.equation_error[equation] <= 0.0 {
            return own;
        }
        let (cylinder, x_m) = (&self.at.model.cylinder, self.rows.rows[row].mean.x_m);
        let (flow_std, volume_m3) = match equation {
            Equation::ChamberA => (self.sensors.flow_a.noise_std, cylinder.volume_a_m3(x_m)),
            Equation::ChamberB => (self.sensors.flow_b.noise_std, cylinder.volume_b_m3(x_m)),
            Equation::Force => return own,
        };
        let leak_gain = flow_std / self.sensors.pressure.noise_std;
        let stored = volume_m3.abs() / self.at.model.fluid.bulk_modulus_pa;
        let [a, b] = [Channel::PressureA as usize, Channel::PressureB as usize];
        let storage = held(own.gains[a][1].hypot(own.gains[b][1]), stored);
        for place in [a, b] {
            own.gains[place][1] *= storage;
            own.gains[place][2] *= storage;
        }
        own.with_leaks_of_at_most(leak_gain)
    }

    /// Variance of one row of an equation, as if all of it were white in the flow or force.
    pub(crate) fn white_variance(&self, row: usize, equation: Equation) -> f64 {
        self.as_white(&self.rows.rows[row], self.own_variance(row, equation))
    }

    /// The white flow or force whose variance makes this variance of a row.
    pub(crate) fn as_white(&self, row: &Row, variance: f64) -> f64 {
        let step_s = row.block_s / row.samples as f64;
        variance / (test_function_weights(row.samples).own[0][0] * step_s * step_s)
    }

    /// Standard deviation of a chamber's row as a mean flow, m³/s.
    pub(crate) fn mean_flow_std(&self, row: usize, equation: Equation) -> f64 {
        self.own_variance(row, equation).sqrt() / self.rows.rows[row].block_s
    }

    fn own_variance(&self, row: usize, equation: Equation) -> f64 {
        let own = &self.rows.rows[row];
        let weights = test_function_weights(own.samples).own;
        let sensitivity = self.sensitivity(row, equation);
        let step_s = own.block_s / own.samples as f64;
        self.sensors_covariance((&sensitivity, &sensitivity), &weights, step_s)
            + weights[0][0] * step_s * step_s * self.equation_error[equation]
    }

    /// What the sensors bring to the covariance of two entries that weigh samples so.
    fn sensors_covariance(
        &self,
        (first, second): (&Sensitivity, &Sensitivity),
        weights: &Products,
        step_s: f64,
    ) -> f64 {
        let steps = [step_s, 1.0, 1.0 / step_s];
        let mut sum = 0.0;
        for (place, channel) in Channel::ALL.into_iter().enumerate() {
            let (one, other) = (first.gains[place], second.gains[place]);
            let mut of_channel = 0.0;
            for (k, one) in one.into_iter().enumerate().filter(|(_, one)| *one != 0.0) {
                for (l, other) in other.into_iter().enumerate() {
                    of_channel += one * other * weights[k][l] * steps[k] * steps[l];
                }
            }
            if of_channel != 0.0 {
                let noise_factor = first.noise_factor[place] * second.noise_factor[place];
                let std = channel.noise_std(self.sensors, &self.at.model.cylinder);
                sum += of_channel * noise_factor * std.powi(2);
            }
        }
        sum
    }
}

/// How many rows an entry is after another one whose noise it shares: none or one.
pub(super) fn rows_apart(rows: &Rows, own: &Entry, other: &Entry) -> Option<usize> {
    let apart = own.row - other.row;
    let is_force = |entry: &Entry| entry.equation == Equation::Force;
    let is_near = apart <= 1 && rows.rows[other.row].stretch == rows.rows[own.row].stretch;
    (is_near && is_force(own) == is_force(other)).then_some(apart)
}

/// Entries to the left of the diagonal that can be correlated: three of the row before, two of the own.
const BAND: usize = 5;

/// Covariances of an entry with itself and with those before it, by their distance.
#[derive(Clone, Copy)]
struct Line {
    sensors: [f64; BAND + 1],
    /// By an error of its equation of variance one.
    error: [f64; BAND + 1],
    equation: Equation,
    counts: bool,
}

impl Line {
    fn covariance(&self, distance: usize, equation_error: &PerEquation<f64>) -> f64 {
        let value = self.sensors[distance] + self.error[distance] * equation_error[self.equation];
        if distance == 0 && !self.counts { value / ROUNDING } else { value }
    }
}

/// Covariances of all entries, for any error of the equations that the sensitivities were held for.
#[derive(Clone)]
pub(crate) struct Covariances(Vec<Line>);

impl Covariances {
    /// The same where only some of the entries count.
    #[must_use]
    pub(crate) fn counting(&self, counts: &[bool]) -> Self {
        let lines = self.0.iter().zip(counts);
        Self(lines.map(|(line, counts)| Line { counts: *counts, ..*line }).collect())
    }

    pub(crate) fn of(noise: &NoiseModel<'_>) -> Self {
        let rows = noise.rows;
        let held = |row: usize| PerEquation::from_fn(|equation| noise.sensitivity(row, equation));
        let mut known = (0, TestFunctionWeights::default());
        let mut last: Option<(usize, [PerEquation<Sensitivity>; 2])> = None;
        let of_entry = |(i, own): (usize, &Entry)| {
            let row = &rows.rows[own.row];
            if known.0 != row.samples {
                known = (row.samples, test_function_weights(row.samples));
            }
            // Of the row before, and the own.
            let (_, sensitivities) = match last.take() {
                Some(same) if same.0 == own.row => last.insert(same),
                Some((_, [_, before])) => last.insert((own.row, [before, held(own.row)])),
                None => last.insert((own.row, [PerEquation::default(), held(own.row)])),
            };
            let step_s = row.block_s / row.samples as f64;
            let mut line = Line {
                sensors: [0.0; BAND + 1],
                error: [0.0; BAND + 1],
                equation: own.equation,
                counts: rows.counts(own),
            };
            for (distance, other) in rows.entries[..=i].iter().rev().take(BAND + 1).enumerate() {
                let Some(rows_apart) = rows_apart(rows, own, other) else { continue };
                let weights = if rows_apart == 0 { &known.1.own } else { &known.1.next };
                let pair = (&sensitivities[1 - rows_apart][other.equation], &sensitivities[1][own.equation]);
                line.sensors[distance] = noise.sensors_covariance(pair, weights, step_s);
                if own.equation == other.equation {
                    line.error[distance] = weights[0][0] * step_s * step_s;
                }
            }
            line
        };
        Self(rows.entries.iter().enumerate().map(of_entry).collect())
    }
}

/// Σ = L Lᵀ, banded; `factor[i][d]` is L_{i,i−d}.
pub(crate) struct Whitening {
    factor: Vec<[f64; BAND + 1]>,
}

impl Whitening {
    pub(crate) fn new(noise: &NoiseModel<'_>) -> Self {
        Self::of(&Covariances::of(noise), &noise.equation_error)
    }

    /// Where the equations have this error.
    pub(crate) fn of(Covariances(lines): &Covariances, equation_error: &PerEquation<f64>) -> Self {
        let mut factor: Vec<[f64; BAND + 1]> = Vec::with_capacity(lines.len());
        for (i, own) in lines.iter().enumerate() {
            let mut line = [0.0; BAND + 1];
            for d in (0..=BAND.min(i)).rev() {
                let covariance = own.covariance(d, equation_error);
                // L_{i,j} = (Σ_{i,j} − Σ_{l<j} L_{i,l} L_{j,l}) / L_{j,j}
                let done: f64 = (1..=BAND - d)
                    .filter(|e| i >= d + e)
                    .map(|e| line[d + e] * if d == 0 { line[e] } else { factor[i - d][e] })
                    .sum();
                let rest = covariance - done;
                line[d] = match d {
                    0 => rest.max(NEGLIGIBLE_SHARE * covariance).sqrt(),
                    _ => rest / factor[i - d][0],
                };
            }
            factor.push(line);
        }
        Self { factor }
    }

    /// The diagonal of L: how wide the noise of each entry is beside those before it.
    pub(crate) fn widths(&self) -> impl Iterator<Item = f64> {
        self.factor.iter().map(|line| line[0])
    }

    /// Σ⁻¹ where Σ has a band, by the distance from the diagonal: Z_{i,i−d} (Takahashi, Fagan and Chin 1973, "Formation of a sparse bus
    /// impedance matrix").
    pub(super) fn inverse(&self) -> Vec<[f64; BAND + 1]> {
        let n = self.factor.len();
        let mut inverse = vec![[0.0; BAND + 1]; n];
        for i in (0..n).rev() {
            let below = BAND.min(n - 1 - i);
            let pivot = self.factor[i][0];
            for m in (0..=below).rev() {
                // Σ_k L_{i+k,i} Z_{i+k,i+m}
                let done: f64 =
                    (1..=below).map(|k| self.factor[i + k][k] * inverse[i + k.max(m)][k.abs_diff(m)]).sum();
                let own = if m == 0 { 1.0 / pivot } else { 0.0 };
                inverse[i + m][m] = (own - done) / pivot;
            }
        }
        inverse
    }

    /// L⁻¹ v.
    pub(crate) fn whiten(&self, v: &[f64]) -> Vec<f64> {
        let mut out: Vec<f64> = Vec::with_capacity(v.len());
        for (i, (line, value)) in self.factor.iter().zip(v).enumerate() {
            let before: f64 = (1..=BAND.min(i)).map(|d| line[d] * out[i - d]).sum();
            out.push((value - before) / line[0]);
        }
        out
    }
}

#[cfg(test)]
mod covariance_tests {
    use super::*;

    #[test]
    fn hat_weights_tend_to_two_thirds_and_one_sixth() {
        let TestFunctionWeights { own, next } = test_function_weights(200);
        assert!(
            (own[0][0] / 200.0 - 2.0 / 3.0).abs() < 1e-3 && (next[0][0] / 200.0 - 1.0 / 6.0).abs() < 1e-3
        );
        assert!((own[1][1] * 200.0 - 2.0).abs() < 1e-9 && (next[1][1] * 200.0 + 1.0).abs() < 1e-9);
        assert!(own[0][1].abs() < 1e-9 && own[0][2] < 0.0);
    }
}

#[cfg(test)]
mod whitening_tests {
    use super::*;
    use crate::diagnose::equation::PerEquation;
    use crate::diagnose::testing::{declared, sound};
    use crate::diagnose::weak_form::{Linearisation, WeakForm, residual_rows};
    use nalgebra::{DMatrix, DVector};
    use pitchleak_testkit::white_noise;

    #[test]
    fn whitening_and_the_band_of_the_inverse_are_those_of_dense_algebra() {
        let declared = declared();
        let at = Linearisation::declared(&declared);
        let rows = residual_rows(&[sound(5), sound(3)], &declared.sensors, &at, 0.1);
        let equation_error = PerEquation { chamber_a: 1e-14, chamber_b: 0.0, force: 0.0 };
        let sensitivities = WeakForm::sensitivities(&rows, &declared.sensors, &at);
        let (sensors, sensitivities) = (&declared.sensors, sensitivities.as_slice());
        let noise = NoiseModel { at: &at, sensors, equation_error, rows: &rows, sensitivities };
        let n = rows.entries.len();
        let Covariances(lines) = Covariances::of(&noise);
        let between = |i: usize, j: usize| {
            if i - j <= BAND { lines[i].covariance(i - j, &equation_error) } else { 0.0 }
        };
        let dense = DMatrix::from_fn(n, n, |i, j| between(i.max(j), i.min(j)));
        let inverse = dense.clone().try_inverse().expect("regular");
        let factor = dense.cholesky().expect("a covariance");
        let v: Vec<f64> = white_noise(1).take(n).collect();
        let expected = factor.l().solve_lower_triangular(&DVector::from_vec(v.clone())).expect("regular");
        let whitening = Whitening::new(&noise);
        let white = whitening.whiten(&v);
        let worst = white.iter().zip(&expected).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(n > 100 && worst < 1e-9 * expected.amax(), "{worst} of {}", expected.amax());
        for (i, line) in whitening.inverse().into_iter().enumerate() {
            for (d, own) in line.into_iter().enumerate().take(i + 1) {
                let size = (inverse[(i, i)] * inverse[(i - d, i - d)]).sqrt();
                assert!((own - inverse[(i, i - d)]).abs() < 1e-6 * size, "{i} {d}: {own}");
            }
        }
    }
}
