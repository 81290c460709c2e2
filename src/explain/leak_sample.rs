//! Leaks at least zero: an explanation's evidence with that, and a sample of the leaks under it.

use super::columns::{Column, Course};
use super::equations::NormalEquations;
use super::evidence::{Fit, fit};
use super::hypothesis::{Hypothesis, State};
use super::orthant::{POINTS, normal_quantile, positive_orthant, uniform};
use super::posterior::{Pass, Scored, Weighed};
use super::sizes::Found;
use super::table::USUAL_PRESSURE;
use pitchleak_core::{Estimate, Leak};

impl<'a> Pass<'a, '_> {
    /// An explanation with its leaks at least zero, its evidence and a sample of the leaks.
    pub(super) fn cut(
        &self,
        equations: &NormalEquations,
        scored: Scored<'a>,
        least: f64,
    ) -> Option<(f64, Weighed<'a>)> {
        let Scored { hypothesis, ln_posterior, .. } = scored;
        let fit = fit(equations, &hypothesis.free);
        let misfit = self.misfit(&fit);
        let mut ln = ln_posterior;
        let mut levels_m3s = [0.0; 3];
        let (leaks_m3s, weights) = if hypothesis.positive.is_empty() {
            (vec![[0.0; 3]], vec![1.0])
        } else {
            let means: Vec<f64> = hypothesis.positive.iter().map(|&i| fit.means[i]).collect();
            let covariance = fit.covariance(&hypothesis.positive);
            let most_negative =
                means.iter().enumerate().map(|(i, mean)| (mean / covariance[i][i].sqrt()).min(0.0));
            if ln - 0.5 * most_negative.fold(0.0, f64::min).powi(2) < least {
                return None;
            }
            let orthant = positive_orthant(&means, &covariance);
            ln += orthant.ln_probability;
            levels_m3s = self.levels_m3s(&hypothesis, &orthant.points, &orthant.weights);
            (self.leaks_m3s(equations, &hypothesis, &fit, &orthant.points), orthant.weights)
        };
        let found = self.found(equations, &hypothesis, &fit);
        let pressures_pa = self.products.mean_pressures_pa(hypothesis.last_change(self.segments));
        let changed = Some(hypothesis.last_change(self.segments)).filter(|border| *border > 0);
        let changed = changed.and_then(|border| self.products.segments.get(border));
        let changed_ago_s = changed.map(|segment| self.products.total_s - segment.begin_s);
        Some((
            ln,
            Weighed {
                hypothesis,
                probability: 0.0,
                misfit,
                changed_ago_s,
                pressures_pa,
                found,
                levels_m3s,
                leaks_m3s,
                weights,
            },
        ))
    }

    /// The columns that its state sets free, as far as they are steady.
    fn found(&self, equations: &NormalEquations, hypothesis: &Hypothesis<'_>, fit: &Fit) -> Vec<Found> {
        let State { zeros, departure, .. } = hypothesis.state;
        let columns = zeros.free.iter().chain(&departure.free).filter(|free| free.1 == Course::Constant);
        let size = |column: Column| {
            let place = equations.place(column, Course::Constant)?;
            let at = hypothesis.free.iter().position(|free| free.column == place)?;
            let variance = fit.covariance(&[at])[0][0];
            Some((column, Estimate { value: fit.means[at], std: variance.max(0.0).sqrt() }))
        };
        columns.filter_map(|(column, ..)| size(*column)).collect()
    }

    fn levels_m3s(&self, hypothesis: &Hypothesis<'_>, points: &[Vec<f64>], weights: &[f64]) -> [f64; 3] {
        [0, 1, 2].map(|leak| {
            let rising = hypothesis.ends[leak].iter().filter(|(_, sign)| *sign > 0.0);
            let places = rising.filter_map(|(end, _)| hypothesis.positive.iter().position(|one| one == end));
            let mean =
                |place: usize| points.iter().zip(weights).map(|(point, w)| w * point[place]).sum::<f64>();
            places.map(mean).sum::<f64>() * self.full_scale_m3s
        })
    }

    /// Noise scales over the scatter of the readings themselves: louder sensors are no doubt about the model.
    fn misfit(&self, fit: &Fit) -> f64 {
        (0..2).map(|c| fit.scales[c].sqrt() / self.scatter[c]).fold(0.0, f64::max)
    }

    /// Flow of each leak at the trace's end and the pressures as they truly are, with the spread of pressure sensors.
    fn leaks_m3s(
        &self,
        equations: &NormalEquations,
        hypothesis: &Hypothesis<'_>,
        fit: &Fit,
        points: &[Vec<f64>],
    ) -> Vec<[f64; 3]> {
        let mut out = vec![[0.0; 3]; points.len()];
        let changed = hypothesis.last_change(self.segments);
        let (all_pa, pressures_pa) =
            (self.products.mean_pressures_pa(0), self.products.mean_pressures_pa(changed));
        for (leak, ends) in hypothesis.ends.iter().enumerate().filter(|(_, ends)| !ends.is_empty()) {
            let place = |(end, sign): &(usize, f64)| {
                Some((hypothesis.positive.iter().position(|one| one == end)?, *sign))
            };
            let places: Vec<(usize, f64)> = ends.iter().filter_map(place).collect();
            let flow = |point: &Vec<f64>| {
                places.iter().map(|(place, sign)| sign * point[*place]).sum::<f64>().max(0.0)
            };
            let pressure_pa = pressures_pa[Leak::ALL[leak]].max(1.0);
            let lately = pressure_pa / all_pa[Leak::ALL[leak]].max(1.0);
            let sheet = USUAL_PRESSURE * self.rig.instruments.pressure.full_scale / pressure_pa;
            let zero = self.pressure_zero_share(equations, hypothesis, fit, leak) / pressure_pa;
            // The mean size of a pressure of changing sign follows a zero by an unknown share.
            let spread = if leak == 0 { f64::hypot(sheet, zero) } else { sheet };
            for (index, (out, point)) in out.iter_mut().zip(points).enumerate() {
                let normal = normal_quantile(uniform((index * 197) % POINTS, 8 + leak));
                let doubt = self.doubts_m3s[Leak::ALL[leak]]
                    * normal_quantile(uniform((index * 59) % POINTS, 11 + leak));
                let pressure = lately * (1.0 + zero + spread * normal);
                out[leak] = (flow(point) * pressure * self.full_scale_m3s + doubt).max(0.0);
            }
        }
        out
    }

    /// By how much the pressure across a leak is larger than read, Pa, where an explanation has a zero of a pressure sensor.
    fn pressure_zero_share(
        &self,
        equations: &NormalEquations,
        hypothesis: &Hypothesis<'_>,
        fit: &Fit,
        leak: usize,
    ) -> f64 {
        let signs = match leak {
            0 => [-1.0, 1.0],
            1 => [-1.0, 0.0],
            _ => [0.0, -1.0],
        };
        let zeros = [Column::PressureZeroA, Column::PressureZeroB];
        let full_scale = self.rig.instruments.pressure.full_scale;
        zeros
            .iter()
            .zip(signs)
            .map(|(zero, sign)| {
                let place = equations.place(*zero, Course::Constant);
                let at = hypothesis.free.iter().position(|free| Some(free.column) == place);
                at.map_or(0.0, |at| sign * fit.means[at] * full_scale)
            })
            .sum()
    }
}
