//! Maximum likelihood of compressibility and leaks over all holds of a trace.
//!
//! Readings stand on both sides of the equations, so plain least squares would take the noise of the pressures for
//! compression and find κ too small, down to none in a sound hold. So signals and unknowns are found in turn: the equations are
//! made linear at the likeliest signals, which begin as running means, and κ stays at the rig file's for the first rounds
//! (errors in variables by Gauss and Helmert's method; Deming 1943, "Statistical Adjustment of Data", ch. IV).

use super::equations::{Known, Normal, Unknowns};
use super::profile::{Cooling, Profile, Search};
use super::recorder::{Held, LEAST_READINGS, Reading};
use crate::presence::{
    Found, LEAK_UNIT_M3SPA, LEAST_INFORMATION, LeakLikelihood, Place, Pressures, RESOLUTION,
};
use crate::rig::Rig;
use nalgebra::{Vector2, Vector3, Vector4};
use pitchleak_core::Estimate;

/// Rounds in all, and those of them in which κ is held.
const ROUNDS: usize = 16;
const ROUNDS_HELD: usize = 4;
/// κ stays within these multiples of the rig file's on its way.
const KAPPA_RANGE: [f64; 2] = [0.2, 5.0];
/// A rig file that knows its oil for certain knows it to this share, and a sensor without noise has this of its full scale.
const LEAST_SHARE: f64 = 1e-6;
/// Places of κ at which the leaks are weighed.
const PLACES: usize = 2000;
/// A hold's residuals are averaged over so many parts, where noise has gone and errors of the model haven't.
const PARTS: usize = 10;

/// What the holds say.
#[derive(Clone, Debug)]
pub(super) struct Fit {
    pub found: Found,
    pub misfit: Misfit,
    pub usable_s: f64,
}

/// Squares of the residuals over those that noise has, about 1 each where the model is right.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Misfit {
    /// Of all readings.
    pub readings: f64,
    /// Of means over a tenth of a hold.
    pub course: f64,
    /// Largest of the two in units of what chance makes of it, 1 σ.
    pub sigmas: f64,
    /// What they would be by the noise that adds up in the volume of a large leak: the equations leave it out.
    pub of_leak: f64,
}

/// The holds that have readings enough.
pub(super) fn usable(holds: &[Held]) -> Vec<&Held> {
    holds.iter().filter(|held| held.readings.len() >= LEAST_READINGS && held.usable_s() > 0.0).collect()
}

/// Fits all holds of a rig together; none where no hold is usable, or no finite number comes out.
pub(super) fn fit(rig: &Rig, holds: &[&Held]) -> Option<Fit> {
    let declared_ppa = 1.0 / rig.fluid.bulk_modulus_pa;
    let spread = (rig.fluid.bulk_modulus_std_pa / rig.fluid.bulk_modulus_pa).max(LEAST_SHARE);
    let known = known(rig, declared_ppa);
    let mut search = Search::new(&known, holds);
    let mut kappa = Estimate { value: 1.0, std: spread };
    for round in 0..ROUNDS {
        let mut normal = search.normal(kappa.value * declared_ppa);
        normal.information[(0, 0)] += spread.powi(-2);
        normal.right[0] += (1.0 - kappa.value) * spread.powi(-2);
        let unknowns = solve(&normal, round < ROUNDS_HELD)?;
        search.smooth(&unknowns);
        let std = normal.information.try_inverse()?[(0, 0)].sqrt();
        kappa = Estimate { value: (kappa.value + unknowns[0]).clamp(KAPPA_RANGE[0], KAPPA_RANGE[1]), std };
    }
    let normal = search.normal(kappa.value * declared_ppa);
    let misfit = misfit(&search.innovations(&solve(&normal, true)?));
    let pressures = pressures(holds);
    let cooling = Cooling::of(rig, holds, &pressures.sizes_pa())?;
    let worse = misfit.readings.max(misfit.course).max(1.0);
    let share = kappa.std / kappa.value;
    let profile = Profile::new(kappa.value.ln(), share.min(spread), |ln_kappa| {
        let node = search.clone().node(ln_kappa.exp() * declared_ppa)?;
        Some(cooling.explained(node)?.widened(worse))
    })?;
    let leaks = profile.at(kappa.value.ln()).leaks;
    let misfit = Misfit { of_leak: of_leak(rig, holds, kappa.value * declared_ppa, &leaks), ..misfit };
    let fit = Fit {
        found: Found::new(&grid(&profile, spread), &pressures, rig),
        misfit,
        usable_s: holds.iter().map(|held| held.usable_s()).sum(),
    };
    fit.misfit.readings.is_finite().then_some(fit)
}

/// Places of κ, equally far apart by their logarithms; `relative` is how far the rig file leaves it open.
fn grid(profile: &Profile, relative: f64) -> Vec<Place> {
    let [from, to] = profile.range();
    let least = profile.at(0.5 * (from + to)).squares;
    let places = (0..=PLACES).map(|k| from + (to - from) * k as f64 / PLACES as f64);
    places
        .map(|ln_kappa| {
            let at = profile.at(ln_kappa);
            let likelihood = LeakLikelihood { squares: at.squares - least, ..at };
            Place { kappa: ln_kappa.exp(), ln_prior: -0.5 * (ln_kappa / relative).powi(2), likelihood }
        })
        .collect()
}

fn known(rig: &Rig, declared_ppa: f64) -> Known<'_> {
    let (sensors, sheets) = (rig.sensors(), &rig.instruments);
    let variance = |std: f64, full_scale: f64| std.max(LEAST_SHARE * full_scale).powi(2);
    let pressure = variance(sensors.pressure.noise_std, sheets.pressure.full_scale);
    let position = variance(sensors.position.noise_std, sheets.position.full_scale);
    Known {
        cylinder: &rig.cylinder,
        variances: Vector3::new(position, pressure, pressure),
        units: Vector4::new(declared_ppa, LEAK_UNIT_M3SPA, LEAK_UNIT_M3SPA, LEAK_UNIT_M3SPA),
    }
}

/// The unknowns; κ stays where it is while it is held.
pub(super) fn solve(normal: &Normal, is_held: bool) -> Option<Unknowns> {
    let Normal { mut information, mut right, .. } = *normal;
    if is_held {
        information.row_mut(0).fill(0.0);
        information.column_mut(0).fill(0.0);
        (information[(0, 0)], right[0]) = (1.0, 0.0);
    }
    // A leak that nothing tells of has next to no information, but never less than none.
    let least = LEAST_INFORMATION + RESOLUTION * information.trace();
    (1..4).for_each(|leak| information[(leak, leak)] += least);
    Some(information.cholesky()?.solve(&right))
}

/// A leak's volume has the noise of the pressures summed over the hold, C σ √(T h), beside κ V σ of a reading: squares of both.
fn of_leak(rig: &Rig, holds: &[&Held], kappa_ppa: f64, leaks: &Vector3<f64>) -> f64 {
    let square = |held: &&&Held| {
        let step_s = held.usable_s() / held.readings.len() as f64;
        let x_m = held.readings.first().map_or(0.0, |reading| reading.x_m);
        let volume_m3 = rig.cylinder.volume_a_m3(x_m).min(rig.cylinder.volume_b_m3(x_m));
        let [through, a, b] = leaks.map(|leak| leak.max(0.0) * LEAK_UNIT_M3SPA).into();
        // P_L has the noise of both pressures.
        let coefficient = (2.0 * through * through + a.max(b).powi(2)).sqrt();
        (coefficient / (kappa_ppa * volume_m3)).powi(2) * held.usable_s() * step_s
    };
    1.0 + holds.iter().map(|held| square(&held)).fold(0.0, f64::max)
}

/// Running means over a tenth of the hold, turned about its end points where it ends.
pub(super) fn running_means(readings: &[Reading]) -> Vec<Reading> {
    let reach = (readings.len() / 20).max(1).min(readings.len() - 1) as isize;
    let vector = |k: isize| {
        let r = &readings[k as usize];
        Vector3::new(r.x_m, r.pa_pa, r.pb_pa)
    };
    let at = |index: isize| -> Vector3<f64> {
        let within = index.clamp(0, readings.len() as isize - 1);
        2.0 * vector(within) - vector(2 * within - index)
    };
    let count = (2 * reach + 1) as f64;
    let mut sum: Vector3<f64> = (-reach..=reach).map(&at).sum();
    let mut means = Vec::with_capacity(readings.len());
    for (index, reading) in readings.iter().enumerate() {
        let mean = sum / count;
        means.push(Reading { t_s: reading.t_s, x_m: mean.x, pa_pa: mean.y, pb_pa: mean.z });
        let index = index as isize;
        if index + 1 < readings.len() as isize {
            sum += at(index + 1 + reach) - at(index - reach);
        }
    }
    means
}

fn pressures(holds: &[&Held]) -> Pressures {
    let mut sums = Pressures::default();
    for pair in holds.iter().flat_map(|held| held.readings.windows(2)) {
        let [from, to] = pair else { continue };
        sums.add(to.t_s - from.t_s, [from.pa_pa, to.pa_pa], [from.pb_pa, to.pb_pa]);
    }
    sums
}

fn misfit(innovations: &[Vec<Vector2<f64>>]) -> Misfit {
    // Two means of each hold and four unknowns are fitted.
    let fitted = 2.0 * innovations.len() as f64 + 4.0;
    let count = 2.0 * innovations.iter().map(Vec::len).sum::<usize>() as f64;
    let squares: f64 = innovations.iter().flatten().map(Vector2::norm_squared).sum();
    let readings = squares / (count - fitted).max(1.0);
    let (mut course, mut parts) = (0.0, 0.0);
    for of_hold in innovations {
        let length = of_hold.len().div_ceil(PARTS).max(1);
        for part in of_hold.chunks(length) {
            course += part.iter().sum::<Vector2<f64>>().norm_squared() / part.len() as f64;
            parts += 2.0;
        }
    }
    let free = f64::max(parts - fitted, 1.0);
    let course = course / free;
    let beyond = |ratio: f64, count: f64| (ratio - 1.0) / (2.0 / f64::max(count, 1.0)).sqrt();
    Misfit {
        readings,
        course,
        sigmas: beyond(readings, count - fitted).max(beyond(course, free)),
        of_leak: 1.0,
    }
}
