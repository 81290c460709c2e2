//! Leaks at least zero: an explanation's evidence with that, and a sample of the leaks under it.

use super::candidates::Scored;
use super::columns::{Column, Course};
use super::equations::NormalEquations;
use super::evidence::{Fit, chance_of_mean_square, fit};
use super::given_leaks::GivenLeaks;
use super::hypothesis::{Hypothesis, LEAK_COLUMNS, State};
use super::orthant::{FEW_POINTS, MOST, NORMALS, Orthant, POINTS, positive_orthant};
use super::pass::{Pass, follows};
use super::pressures_off::{MeterZeros, PressuresOff, across};
use super::sizes::{Found, over_declared};
use super::table::USUAL_PRESSURE;
use crate::rig::Rig;
use nalgebra::Vector3;
use pitchleak_core::{Estimate, Leak, PerLeak};

/// Explanations so much less probable than the best have a sample of few points, and are left out of a first look: e⁻⁴ is two in a
/// hundred; numerical.
pub(super) const LITTLE_LN: f64 = 4.0;

/// A missing effect may be so many times as much of a leak as what is left of it: what looks like a leak is fitted away. A guess.
const HIDDEN: f64 = 2.0;

/// A weighed explanation.
#[derive(Clone, Debug)]
pub(super) struct Weighed<'a> {
    pub hypothesis: Hypothesis<'a>,
    pub probability: f64,
    /// Noise scales over what the readings scatter, of both equations.
    pub misfits: [f64; 2],
    /// How long before the end the leaks last changed: at once, or where they wander or creep by its last segment, s; none
    /// where none did.
    pub changed_ago_s: Option<f64>,
    /// Mean size of the pressures across the leaks since then, Pa.
    pub pressures_pa: PerLeak<f64>,
    /// What is not as declared, in its columns' units.
    pub found: Vec<Found>,
    /// The largest of these in the standard deviations of what sensors and rigs are off by.
    pub strain: f64,
    /// Mean of C P of each leak, m³/s.
    pub levels_m3s: [f64; 3],
    /// Flow of each leak at the trace's end, m³/s, and weights of sum 1.
    pub leaks_m3s: Vec<[f64; 3]>,
    pub weights: Vec<f64>,
}

/// What an explanation is weighed by: its equations, and the noise scales that the readings' own scatter makes in them.
#[derive(Clone, Copy)]
pub(super) struct Weighing<'e> {
    pub equations: &'e NormalEquations,
    pub loudness: [f64; 2],
}

/// An explanation, its fit, and what that finds not to be as declared where leaks are at least zero.
struct Fitted<'e, 'a> {
    pass: &'e Pass<'a, 'e>,
    weighing: Weighing<'e>,
    hypothesis: Hypothesis<'a>,
    fit: Fit,
    found: Vec<Found>,
    pressures_off: PressuresOff,
}

/// An explanation with its leaks at least zero, its evidence and a sample of the leaks, beside the best so far.
pub(super) fn cut<'a>(
    pass: &Pass<'a, '_>,
    weighing: Weighing<'_>,
    Scored { hypothesis, ln_posterior, ln_sign, .. }: Scored<'a>,
    best: f64,
) -> (f64, Weighed<'a>) {
    let fit = fit(weighing.equations, &hypothesis.free);
    let means: Vec<f64> = hypothesis.positive.iter().map(|&i| fit.means[i]).collect();
    let set_free: Vec<(Column, usize)> = set_free(&hypothesis, weighing.equations).collect();
    let places = set_free.iter().map(|(_, at)| *at);
    // Leaks first, then what is set free.
    let covariance = fit.covariance(&hypothesis.positive.iter().copied().chain(places).collect::<Vec<_>>());
    let count = if ln_posterior < best - LITTLE_LN { FEW_POINTS } else { POINTS };
    let orthant = positive_orthant(&means, &covariance, count);
    let ln = ln_posterior - ln_sign + orthant.ln_probability;
    let given = GivenLeaks::new(&means, &covariance, &orthant);
    let rows = (means.len()..).zip(covariance.iter().skip(means.len()));
    let found = set_free.iter().zip(rows).map(|((column, at), (own, row))| {
        (*column, given.size(fit.means[*at], row[own], &row[..means.len()]))
    });
    let found: Vec<Found> = found.collect();
    let coefficients = coefficients(pass, &hypothesis, &orthant);
    // A zero that the explanation has off already is in the fit.
    let is_free = |zero: Column| found.iter().any(|(column, _)| *column == zero);
    let usual_pa = [Column::PressureZeroA, Column::PressureZeroB]
        .map(|zero| if is_free(zero) { 0.0 } else { usual_off_pa(pass.rig) });
    let zeros = MeterZeros::of(&fit, &hypothesis, weighing.equations, pass.sizes.zero_units);
    let pressures_off = PressuresOff::new(&zeros, &coefficients, usual_pa.into());
    (ln, Fitted { pass, weighing, hypothesis, fit, found, pressures_off }.weighed(orthant))
}

/// The columns that an explanation's state sets free, as far as they are steady, with their places among its free parameters.
fn set_free<'h>(
    hypothesis: &'h Hypothesis<'_>,
    equations: &'h NormalEquations,
) -> impl Iterator<Item = (Column, usize)> + 'h {
    let State { zeros, departure, .. } = hypothesis.state;
    let columns = zeros.free.iter().chain(&departure.free).filter(|free| free.1 == Course::Constant);
    columns
        .filter_map(|(column, ..)| Some((*column, hypothesis.place(equations, *column, Course::Constant)?)))
}

/// Flow of a leak at the trace's end, share of full scale.
fn flow(hypothesis: &Hypothesis<'_>, leak: usize, point: &[f64; MOST]) -> f64 {
    hypothesis.ends[leak].iter().map(|(at, sign)| sign * point[*at]).sum::<f64>().max(0.0)
}

/// Mean coefficient of each leak, share of full scale per Pa.
fn coefficients(pass: &Pass<'_, '_>, hypothesis: &Hypothesis<'_>, orthant: &Orthant) -> Vector3<f64> {
    let pressures_pa = pass.products.mean_pressures_pa(0);
    Vector3::from_fn(|leak, _| {
        let weighed = orthant.points.iter().zip(&orthant.weights);
        let mean: f64 = weighed.map(|(point, weight)| weight * flow(hypothesis, leak, point)).sum();
        mean / pressures_pa[Leak::ALL[leak]].max(1.0)
    })
}

/// How far a pressure sensor's zero is off, Pa: as declared, else as usual.
fn usual_off_pa(rig: &Rig) -> f64 {
    let pressure = &rig.instruments.pressure;
    let share = if pressure.bias > 0.0 { pressure.bias } else { USUAL_PRESSURE };
    share * pressure.full_scale
}

impl<'a> Fitted<'_, 'a> {
    /// Without its probability, which others are needed for.
    fn weighed(self, orthant: Orthant) -> Weighed<'a> {
        let border = self.last_change();
        let products = self.pass.products;
        let changed = Some(border).filter(|border| *border > 0);
        let changed = changed.and_then(|border| products.segments.get(border));
        Weighed {
            probability: 0.0,
            misfits: self.misfits(),
            changed_ago_s: changed.map(|segment| products.total_s - segment.begin_s),
            pressures_pa: products.mean_pressures_pa(border),
            strain: self.strain(),
            levels_m3s: self.levels_m3s(&orthant),
            leaks_m3s: self.leaks_m3s(&orthant.points),
            weights: orthant.weights,
            found: self.found,
            hypothesis: self.hypothesis,
        }
    }

    /// The largest of what is found in the standard deviations of what sensors and rigs are off by.
    fn strain(&self) -> f64 {
        let strain = |(column, size): &Found| {
            let at = self.hypothesis.place(self.weighing.equations, *column, Course::Constant)?;
            Some(size.value.abs() / self.hypothesis.free[at].std)
        };
        self.found.iter().filter_map(strain).fold(0.0, f64::max)
    }

    fn levels_m3s(&self, orthant: &Orthant) -> [f64; 3] {
        [0, 1, 2].map(|leak| {
            let weighed = || orthant.points.iter().zip(&orthant.weights);
            let mean = |place: usize| weighed().map(|(point, w)| w * point[place]).sum::<f64>();
            self.hypothesis.rising(Leak::ALL[leak]).map(mean).sum::<f64>() * self.pass.full_scale_m3s
        })
    }

    /// Noise scales over the scatter of the readings themselves: louder sensors are no doubt about the model.
    fn misfits(&self) -> [f64; 2] {
        [0, 1].map(|c| (self.fit.scales[c] / self.weighing.loudness[c]).sqrt())
    }

    /// A leak whose rows would be as large as what the readings show beside the explanation and their own scatter, m³/s. What
    /// effect that is nobody knows, so the leaks found may be off by as much.
    fn unexplained_m3s(&self, leak: usize) -> f64 {
        let Weighing { equations, loudness } = self.weighing;
        let Some(place) = equations.place(LEAK_COLUMNS[leak], Course::Constant) else { return 0.0 };
        let (mut left, mut of_leak) = (0.0, 0.0);
        for (c, loudness) in loudness.into_iter().enumerate() {
            let rows = equations.rows[c];
            let chance = 1.0 + chance_of_mean_square(rows);
            left += rows * (self.fit.scales[c] - chance * loudness).max(0.0);
            of_leak += equations.gram(c).row(place)[place];
        }
        if of_leak > 0.0 { HIDDEN * (left / of_leak).sqrt() * self.pass.full_scale_m3s } else { 0.0 }
    }

    /// Flow of each leak at the trace's end and the pressures as they truly are.
    fn leaks_m3s(&self, points: &[[f64; MOST]]) -> Vec<[f64; 3]> {
        let products = self.pass.products;
        let all_pa = products.mean_pressures_pa(0);
        let lately_pa = products.mean_pressures_pa(self.last_change());
        let off_pa = self.pressures_off_pa(lately_pa);
        let doubts_m3s =
            Leak::ALL.map(|leak| self.pass.doubts_m3s[leak].hypot(self.unexplained_m3s(leak as usize)));
        let scales = Leak::ALL.map(|leak| self.scale(leak));
        let follows = Leak::ALL.map(|leak| follows(leak, lately_pa));
        let usual_pa = usual_off_pa(self.pass.rig);
        let at = |(point, normals): (&[f64; MOST], &[f64; MOST])| {
            let flows = Vector3::from_fn(|leak, _| flow(&self.hypothesis, leak, point));
            let coefficients = Vector3::from_fn(|leak, _| flows[leak] / all_pa[Leak::ALL[leak]].max(1.0));
            let more = self.pressures_off.more(&coefficients, follows[0], [normals[6], normals[7]]);
            std::array::from_fn(|i| {
                if self.hypothesis.ends[i].is_empty() {
                    return 0.0;
                }
                let pressure_pa = lately_pa[Leak::ALL[i]].max(1.0);
                let off = off_pa[i] / pressure_pa;
                let unknown = (1.0 - follows[i].abs()) * off.abs().hypot(usual_pa / pressure_pa);
                let spread = unknown.hypot(scales[i].std / scales[i].value);
                let lately = pressure_pa / all_pa[Leak::ALL[i]].max(1.0);
                let pressure = lately * (1.0 + follows[i] * off + spread * normals[i]);
                let truly = flows[i] * pressure + more[i];
                (truly * scales[i].value * self.pass.full_scale_m3s + doubts_m3s[i] * normals[3 + i]).max(0.0)
            })
        };
        points.iter().zip(NORMALS.iter()).map(at).collect()
    }

    /// By how much a leak is larger than in equations that an area off makes smaller ([`Column::AreaA`]).
    fn scale(&self, leak: Leak) -> Estimate<f64> {
        let area = match leak {
            Leak::Internal => None,
            Leak::ExternalA => Some(Column::AreaA),
            Leak::ExternalB => Some(Column::AreaB),
        };
        let own =
            self.found.iter().find(|(column, _)| *column == Column::PositionGain || Some(*column) == area);
        own.map_or(Estimate { value: 1.0, std: 0.0 }, |(_, share)| over_declared(*share))
    }

    /// By how much the pressure across each leak is larger than read, Pa, where an explanation has a zero or a gain of a pressure sensor.
    fn pressures_off_pa(&self, mean_pa: PerLeak<f64>) -> Vector3<f64> {
        let full_scale = self.pass.rig.instruments.pressure.full_scale;
        let share = |column: Column| {
            self.found.iter().find(|(known, _)| *known == column).map_or(0.0, |(_, size)| size.value)
        };
        let off_a =
            share(Column::PressureZeroA) * full_scale + share(Column::PressureGainA) * mean_pa.external_a;
        let off_b =
            share(Column::PressureZeroB) * full_scale + share(Column::PressureGainB) * mean_pa.external_b;
        across([-off_a, -off_b])
    }

    /// The segment from which on all leaks are as at the end.
    fn last_change(&self) -> usize {
        self.hypothesis.last_change(self.pass.segments)
    }
}
