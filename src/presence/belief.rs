//! Which leaks there are, and how large: no leak is negative, and most cylinders have none.
//!
//! Nearly the same drift comes of a leak at A and of one past the piston
//! together with one at B. So each of the eight sets of leaks is weighed by its evidence: a leak of the set is half normal, one outside
//! is zero. Shares and size are those of docs/explanations.md.

use super::{LEAK_UNIT_M3SPA, LeakLikelihood};
use crate::explain::{LEAK_SHARE, Orthant, POINTS, positive_orthant};
use crate::rig::Rig;
use nalgebra::{DMatrix, DVector, Matrix3};
use pitchleak_core::{Estimate, Leak, PerLeak};
use statrs::function::erf::erfc;
use std::f64::consts::{PI, SQRT_2};

/// A leak that a cylinder may have, half normal, is so many times what is a fault, or such a share of what its valve is rated for: the
/// larger. Guesses: 1 L/min, as docs/explanations.md has it for a meter of 20 L/min.
const OVER_FAULT: f64 = 10.0;
const OF_RATED: f64 = 0.25;

/// The coefficient of such a leak at a mean pressure, Pa, in [`LEAK_UNIT_M3SPA`].
pub(crate) fn size(rig: &Rig, leak: Leak, pressure_pa: f64) -> f64 {
    let rated_m3s = rig.valve.as_ref().map_or(0.0, |sheet| sheet.rated_flow_m3s);
    let flow_m3s = (OVER_FAULT * rig.alarms.threshold_m3s[leak]).max(OF_RATED * rated_m3s);
    flow_m3s / pressure_pa / LEAK_UNIT_M3SPA
}

/// What is believed of one leak; coefficients in m³/(s·Pa), where there is such a leak.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub(crate) struct Belief {
    /// That there is one.
    pub probability: f64,
    pub mean: f64,
    pub std: f64,
    /// Quantiles of 2.5 and 97.5 %.
    pub interval: [f64; 2],
    /// The smallest that would be found in this hold.
    pub smallest: f64,
    /// Standard deviation before any reading.
    pub prior_std: f64,
    /// The leaks that explain the readings about as well without it, likelier or not.
    pub alike: Option<PerLeak<bool>>,
}

/// What is believed of all leaks, and of the oil.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Beliefs {
    pub leaks: PerLeak<Belief>,
    /// That oil leaks by whatever way.
    pub any: f64,
    /// κ, in the rig file's.
    pub kappa: Estimate<f64>,
    /// By how much leaks of any sign would explain the readings better than leaks that are none or positive: squares of
    /// residuals in those of the noise.
    pub negative: f64,
}

/// Weighs leaks of these sizes by their likelihood at some places of κ, which are equally far apart; `sure` is the probability from
/// which a leak counts as found.
pub(crate) fn weigh(places: &[Place], sizes: [f64; 3], sure: f64) -> Beliefs {
    let sets: Vec<Vec<usize>> =
        (0..8).map(|members| (0..3).filter(|leak| members >> leak & 1 == 1).collect()).collect();
    let mut weighed: Vec<Weighed> =
        sets.iter().flat_map(|members| over_kappa(members, places, &sizes)).collect();
    let possible = weighed.iter().map(|one| one.squares).fold(f64::INFINITY, f64::min);
    let any_sign = places.iter().map(|place| place.likelihood.squares).fold(f64::INFINITY, f64::min);
    let largest = weighed.iter().map(|one| one.weight).fold(f64::NEG_INFINITY, f64::max);
    weighed.iter_mut().for_each(|one| one.weight = (one.weight - largest).exp());
    let all: f64 = weighed.iter().map(|one| one.weight).sum();
    weighed.iter_mut().for_each(|one| one.weight /= all);
    let moment = |power: i32| weighed.iter().map(|one| one.weight * one.kappa.powi(power)).sum::<f64>();
    let (mean, square) = (moment(1), moment(2));
    let kappa = Estimate { value: mean, std: (square - mean * mean).max(0.0).sqrt() };
    let told = Told { information: beside_oil(places, kappa), sizes };
    Beliefs {
        leaks: PerLeak::from_fn(|leak| {
            let own = leak as usize;
            let smallest = told.smallest(own, sure) * LEAK_UNIT_M3SPA;
            let prior_std = sizes[own] * LEAK_UNIT_M3SPA * (1.0 - 2.0 / PI).sqrt();
            Belief { smallest, prior_std, alike: alike(&weighed, own), ..spread(&weighed, own) }
        }),
        any: weighed.iter().filter(|one| !one.members.is_empty()).map(|one| one.weight).sum(),
        kappa,
        negative: possible - any_sign,
    }
}

/// Of the places so many are taken at the most.
const TAKEN: usize = 15;
/// A place counts where its weight is this far below the largest, ln.
const LEAST_LN_WEIGHT: f64 = -12.0;

/// The likelihood at a κ, in the rig file's, and ln of what was believed of it before.
pub(crate) struct Place {
    pub kappa: f64,
    pub ln_prior: f64,
    pub likelihood: LeakLikelihood,
}

/// One set of leaks that are there, at one κ.
struct Weighed {
    members: Vec<usize>,
    kappa: f64,
    /// Probability, as its logarithm until all are known.
    weight: f64,
    /// Of the residuals, where the likeliest leaks of this set are possible; else infinite.
    squares: f64,
    /// The same, and what is asked of the oil.
    asked: f64,
    orthant: Option<Orthant>,
}

/// A set of leaks, whatever their sign, at one κ.
struct Normal {
    mean: DVector<f64>,
    covariance: DMatrix<f64>,
    /// Of the residuals.
    squares: f64,
    /// ln of prior and evidence, without the orthant's probability.
    ln_weight: f64,
}

impl Normal {
    fn new(members: &[usize], place: &Place, sizes: &[f64; 3]) -> Option<Self> {
        let Place { likelihood, ln_prior, .. } = place;
        let count = members.len();
        let ln_share = count as f64 * LEAK_SHARE.ln() + (3 - count) as f64 * (1.0 - LEAK_SHARE).ln();
        let pull = likelihood.information * likelihood.leaks;
        let precision = DMatrix::from_fn(count, count, |i, j| {
            likelihood.information[(members[i], members[j])]
                + if i == j { sizes[members[i]].powi(-2) } else { 0.0 }
        });
        let right = DVector::from_fn(count, |i, _| pull[members[i]]);
        let factor = precision.cholesky()?;
        let mean = factor.solve(&right);
        // Half normal sizes of density 2/(τ √(2π)) at none, times a normal integral over the orthant.
        let ln_det = 2.0 * factor.l().diagonal().map(f64::ln).sum();
        let squares = likelihood.squares + likelihood.leaks.dot(&pull) - mean.dot(&right);
        let ln_size: f64 = members.iter().map(|member| (2.0 / sizes[*member]).ln()).sum();
        let ln_weight = ln_share + ln_prior - 0.5 * squares + ln_size - 0.5 * ln_det;
        Some(Self { mean, covariance: factor.inverse(), squares, ln_weight })
    }

    /// About what the orthant's probability makes of it, as if leaks were independent.
    fn ln_about(&self) -> f64 {
        let variances = self.covariance.diagonal();
        let tails = self.mean.iter().zip(&variances).map(|(mean, variance)| ln_tail(-mean / variance.sqrt()));
        self.ln_weight + tails.sum::<f64>()
    }
}

/// ln of the normal's probability above a point.
pub(crate) fn ln_tail(point: f64) -> f64 {
    if point < 5.0 {
        return (0.5 * erfc(point / SQRT_2)).ln();
    }
    -0.5 * point * point - (point * (2.0 * PI).sqrt()).ln()
}

/// A set of leaks at the places of κ that count for it.
fn over_kappa(members: &[usize], places: &[Place], sizes: &[f64; 3]) -> Vec<Weighed> {
    let about: Vec<f64> = places
        .iter()
        .map(|place| Normal::new(members, place, sizes).map_or(f64::NEG_INFINITY, |normal| normal.ln_about()))
        .collect();
    let largest = about.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let counts = |ln: &f64| *ln > largest + LEAST_LN_WEIGHT;
    let first = about.iter().position(counts).unwrap_or(0);
    let last = about.iter().rposition(counts).unwrap_or(0);
    let step = ((last - first) / (TAKEN - 1)).max(1);
    let taken = places[first..=last].iter().step_by(step);
    let weighed = taken.filter_map(|place| {
        let normal = Normal::new(members, place, sizes)?;
        let rows: Vec<Vec<f64>> =
            normal.covariance.row_iter().map(|row| row.iter().copied().collect()).collect();
        let orthant = (!members.is_empty()).then(|| positive_orthant(normal.mean.as_slice(), &rows, POINTS));
        let ln_orthant = orthant.as_ref().map_or(0.0, |orthant| orthant.ln_probability);
        // Each stands for the step of ln κ up to the next.
        let weight = normal.ln_weight + ln_orthant + (step as f64).ln();
        let is_possible = normal.mean.iter().all(|leak| *leak >= 0.0);
        let squares = if is_possible { normal.squares } else { f64::INFINITY };
        let asked = squares - 2.0 * place.ln_prior;
        Some(Weighed { members: members.to_vec(), kappa: place.kappa, weight, squares, asked, orthant })
    });
    weighed.collect()
}

impl Weighed {
    /// Of a leak: values and weights of the sample.
    fn points(&self, own: usize) -> impl Iterator<Item = (f64, f64)> {
        let place = self.members.iter().position(|member| *member == own);
        let sample = place.and_then(|place| Some((place, self.orthant.as_ref()?)));
        sample.into_iter().flat_map(move |(place, orthant)| {
            orthant.points.iter().zip(&orthant.weights).map(move |(p, w)| (p[place], self.weight * w))
        })
    }
}

/// Sets whose squares differ by so much look alike: two standard deviations.
const ALIKE: f64 = 4.0;

/// The leaks that do without one what the best do with it, if any do.
fn alike(sets: &[Weighed], own: usize) -> Option<PerLeak<bool>> {
    let least = |one: &&Weighed, other: &&Weighed| one.asked.total_cmp(&other.asked);
    let best = sets.iter().min_by(least)?;
    let without = sets.iter().filter(|one| !one.members.contains(&own)).min_by(least)?;
    (without.asked < best.asked + ALIKE)
        .then(|| PerLeak::from_fn(|leak| without.members.contains(&(leak as usize))))
}

/// Sets of so little weight don't count.
const LEAST_WEIGHT: f64 = 1e-6;

/// Probability, mean, spread and interval of a leak over the sets that have it.
fn spread(sets: &[Weighed], own: usize) -> Belief {
    let with: Vec<&Weighed> = sets.iter().filter(|set| set.members.contains(&own)).collect();
    let probability = with.iter().map(|set| set.weight).sum::<f64>().min(1.0);
    let heavy = with.iter().filter(|set| set.weight > LEAST_WEIGHT * probability);
    let mut points: Vec<(f64, f64)> = heavy.flat_map(|set| set.points(own)).collect();
    let all = points.iter().map(|(_, weight)| weight).sum::<f64>().max(f64::MIN_POSITIVE);
    let mean = points.iter().map(|(value, weight)| value * weight).sum::<f64>() / all;
    let variance = points.iter().map(|(value, weight)| (value - mean).powi(2) * weight).sum::<f64>() / all;
    points.sort_by(|a, b| a.0.total_cmp(&b.0));
    let quantile = |probability: f64| {
        let mut sum = 0.0;
        let above = points.iter().find(|(_, weight)| {
            sum += weight / all;
            sum >= probability
        });
        above.or(points.last()).map_or(0.0, |(value, _)| *value)
    };
    Belief {
        probability,
        mean: mean * LEAK_UNIT_M3SPA,
        std: variance.sqrt() * LEAK_UNIT_M3SPA,
        interval: [quantile(0.025), quantile(0.975)].map(|value| value * LEAK_UNIT_M3SPA),
        ..Belief::default()
    }
}

/// Information on the leaks where κ is known no better than this: C moves with it by dC/dκ.
fn beside_oil(places: &[Place], kappa: Estimate<f64>) -> Matrix3<f64> {
    let off = |at: &usize| (places[*at].kappa - kappa.value).abs();
    let Some(middle) = (0..places.len()).min_by(|a, b| off(a).total_cmp(&off(b))) else {
        return Matrix3::zeros();
    };
    let information = places[middle].likelihood.information;
    let (below, above) = (&places[middle.saturating_sub(1)], &places[(middle + 1).min(places.len() - 1)]);
    let step = above.kappa - below.kappa;
    if step <= 0.0 {
        return information;
    }
    // (I⁻¹ + v vᵀ)⁻¹ of what κ makes of C, v: Sherman and Morrison (1950).
    let moved = (above.likelihood.leaks - below.likelihood.leaks) * (kappa.std / step);
    let told = information * moved;
    information - told * told.transpose() / (1.0 + moved.dot(&told))
}

/// What a trace tells of leaks of these sizes.
struct Told {
    information: Matrix3<f64>,
    sizes: [f64; 3],
}

impl Told {
    /// The smallest single leak that would be believed with the probability `sure`: its set against each of the sets without it that
    /// take over some of what it does, and let no oil in for that.
    fn smallest(&self, own: usize, sure: f64) -> f64 {
        let others: Vec<usize> = (0..3).filter(|leak| *leak != own).collect();
        let rivals = [vec![], vec![others[0]], vec![others[1]], others];
        let single = self.ln_volume(&[own]);
        let wanted = |rival: &Vec<usize>| {
            let ln_odds = (sure / (1.0 - sure)).ln() + self.ln_volume(rival) - single;
            let left = self.left_by(own, rival)?;
            Some((2.0 * ln_odds).max(0.0) / left.max(f64::MIN_POSITIVE))
        };
        rivals.iter().filter_map(wanted).fold(0.0, f64::max).sqrt()
    }

    /// ln of the share of a set of leaks and of Occam's factor of their sizes.
    fn ln_volume(&self, set: &[usize]) -> f64 {
        let share = LEAK_SHARE / (1.0 - LEAK_SHARE);
        let ln_det = self.part(set, set).determinant().ln();
        set.iter().map(|leak| (share * 2.0 / self.sizes[*leak]).ln()).sum::<f64>() - 0.5 * ln_det
    }

    /// Information on a leak that those of a set do not take over; none where they would have to be negative.
    fn left_by(&self, own: usize, set: &[usize]) -> Option<f64> {
        let across = self.part(set, &[own]);
        let taken = self.part(set, set).cholesky()?.solve(&across);
        let is_possible = taken.iter().all(|share| *share >= 0.0);
        is_possible.then(|| self.information[(own, own)] - across.dot(&taken))
    }

    /// Rows and columns of the information, with what is believed before of each size.
    fn part(&self, rows: &[usize], columns: &[usize]) -> DMatrix<f64> {
        DMatrix::from_fn(rows.len(), columns.len(), |i, j| {
            let (i, j) = (rows[i], columns[j]);
            self.information[(i, j)] + if i == j { self.sizes[i].powi(-2) } else { 0.0 }
        })
    }
}
