//! A cylinder beside its siblings: the blades of one turbine move alike, in the same oil and weather, so that one whose leak
//! differs is told long before it reaches a threshold.

use super::standing::Answer;
use super::trend::Scattered;
use super::{FleetCylinder, FleetRow, count};
use crate::report::with_interval;
use nalgebra::SVector;
use pitchleak_core::{Estimate, Leak};
use serde::{Deserialize, Serialize};
use std::collections::HashMap;

/// How often a fleet without any difference has one told.
const FALSE_ALARM: f64 = 0.05;

/// How much more one leak of a cylinder is than those of its siblings: of the cylinders whose names are the same but for
/// the last level (`T7/B1`, `T7/B2`, `T7/B3`).
///
/// A cylinder's level m is the mean of its traces' flows since the leak is there, or since it is gone, with weights 1 / (s² + τ²): s is each flow's own standard
/// deviation, τ what the flows of one cylinder scatter beyond it, found from all siblings together. The difference
/// d = m − mean(m of the siblings) over its standard deviation is Student's t with Σ (traces − 1) degrees of freedom.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Beside {
    /// How many siblings it is compared with.
    pub siblings: usize,
    /// How much more it leaks than they do in the mean, L/min; negative where it leaks less.
    pub more_lpm: f64,
    /// Standard deviation of that, L/min; 1.96 of them are the half of the 95 % interval.
    pub std_lpm: f64,
    /// How probable so large a difference is where there is none, times the number of comparisons in the fleet
    /// (Bonferroni).
    pub p_value: f64,
    /// Whether it leaks more than its siblings by more than chance explains: `p_value` below 0.05.
    pub differs: bool,
}

impl Beside {
    /// How much more it is, and than how many siblings', for people.
    pub fn text(&self) -> String {
        let Self { siblings, more_lpm, std_lpm, .. } = *self;
        let more = with_interval(more_lpm, Some(std_lpm));
        format!("{more} L/min more than its {}", count(siblings, "sibling"))
    }

    /// Compares every cylinder with its siblings, where there are any.
    pub(super) fn compare(cylinders: &mut [FleetCylinder], rows: &[FleetRow]) {
        let mut found = Vec::new();
        for places in families(cylinders) {
            for leak in Leak::ALL {
                let flows = |at: &usize| {
                    let flows: Vec<_> = of_now(cylinders.get(*at)?, rows, leak)
                        .filter_map(|row| row.estimate(leak))
                        .collect();
                    (!flows.is_empty()).then_some((*at, flows))
                };
                let (known, flows): (Vec<_>, Vec<_>) = places.iter().filter_map(flows).unzip();
                let differences = differences(&flows);
                found.extend(
                    known.into_iter().zip(differences).map(|(at, difference)| (at, leak, difference)),
                );
            }
        }
        let comparisons = found.len() as f64;
        for (at, leak, Difference { siblings, more, std, chance }) in found {
            let p_value = (chance * comparisons).min(1.0);
            let beside =
                Self { siblings, more_lpm: more, std_lpm: std, p_value, differs: p_value < FALSE_ALARM };
            if let Some(cylinder) = cylinders.get_mut(at) {
                cylinder.leaks[leak].beside = Some(beside);
            }
        }
    }
}

/// The traces since which the leak is there, or of which none shows it any more: what was before a repair says nothing.
fn of_now<'a>(
    cylinder: &FleetCylinder,
    rows: &'a [FleetRow],
    leak: Leak,
) -> impl Iterator<Item = &'a FleetRow> {
    let own: Vec<_> = cylinder.rows.iter().filter_map(|place| rows.get(*place)).collect();
    let is_begin = |row: &&FleetRow| row.begins.is_some() && row.begins == cylinder.leaks[leak].since;
    let shows = |row: &&FleetRow| Answer::on_leak(row, leak) == Answer::Yes;
    let begin = if cylinder.leaks[leak].stands {
        own.iter().position(is_begin)
    } else {
        own.iter().rposition(shows).map(|last| last + 1)
    };
    own.into_iter().skip(begin.unwrap_or_default())
}

/// Places of the cylinders whose names are the same but for the last level.
fn families(cylinders: &[FleetCylinder]) -> Vec<Vec<usize>> {
    let mut families: HashMap<&str, Vec<usize>> = HashMap::new();
    for (at, cylinder) in cylinders.iter().enumerate() {
        if let Some(turbine) = cylinder.turbine() {
            families.entry(turbine).or_default().push(at);
        }
    }
    families
        .into_values()
        .filter(|family| (2..=FleetCylinder::MOST_OF_A_TURBINE).contains(&family.len()))
        .collect()
}

struct Difference {
    siblings: usize,
    more: f64,
    std: f64,
    /// That it is so large by chance.
    chance: f64,
}

/// Of each cylinder from the mean of the others. None where no cylinder has a second trace.
fn differences(flows: &[Vec<Estimate<f64>>]) -> Vec<Difference> {
    let mean = |own: &Vec<Estimate<f64>>| own.iter().map(|flow| (SVector::from([1.0]), *flow)).collect();
    let groups: Vec<_> = flows.iter().map(mean).collect();
    let Some(scattered) = Scattered::of(&groups).filter(|_| flows.len() > 1) else { return Vec::new() };
    let siblings = flows.len() - 1;
    let means = || scattered.fits.iter().map(|fit| (fit.unknowns[0], fit.covariance[0]));
    let (all, variances) = (means().map(|of| of.0).sum::<f64>(), means().map(|of| of.1).sum::<f64>());
    let difference = |(mean, own): (f64, f64)| {
        let more = mean - (all - mean) / siblings as f64;
        let std = ((own + (variances - own) / (siblings as f64).powi(2)) * scattered.inflation).sqrt();
        Difference { siblings, more, std: std * scattered.width(), chance: scattered.chance(more / std) }
    };
    means().map(difference).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};

    const OWN: f64 = 0.004;

    /// Traces of blades with leaks of these levels, L/min, that scatter so much beyond their own intervals.
    fn blades(
        levels: [f64; 3],
        traces: usize,
        scatter: f64,
        rng: &mut ChaCha8Rng,
    ) -> Vec<Vec<Estimate<f64>>> {
        let mut normal = || -> f64 { StandardNormal.sample(rng) };
        let mut trace =
            |level: f64| Estimate { value: level + scatter * normal() + OWN * normal(), std: OWN };
        levels.map(|level| (0..traces).map(|_| trace(level)).collect()).into()
    }

    #[test]
    fn blades_that_are_alike_differ_as_rarely_as_is_said() {
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        for (traces, scatter) in [(2, 0.0), (2, 0.02), (9, 0.0), (9, 0.02)] {
            let runs = 600;
            let mut told = 0;
            for _ in 0..runs {
                let found = differences(&blades([0.02; 3], traces, scatter, &mut rng));
                told += u32::from(found.iter().any(|one| one.chance * 3.0 < FALSE_ALARM));
            }
            // 5 % and three standard deviations of the count.
            assert!(told <= 46, "{traces} traces, scatter {scatter}: {told} of {runs}");
        }
    }

    #[test]
    fn one_that_leaks_more_is_found_at_its_difference() {
        let mut rng = ChaCha8Rng::seed_from_u64(4);
        let (mut told, mut held) = (0, 0);
        for _ in 0..200 {
            let found = differences(&blades([0.02, 0.05, 0.02], 9, 0.008, &mut rng));
            let chances: Vec<_> = found.iter().map(|one| one.chance * 3.0 < FALSE_ALARM).collect();
            told += u32::from(chances == [false, true, false]);
            let one = &found[1];
            held += u32::from((one.more - 0.03).abs() < 1.96 * one.std);
        }
        assert!(told > 190, "{told} of 200");
        assert!(held > 180, "{held} of 200");
    }

    #[test]
    fn without_a_second_trace_or_a_sibling_nothing_is_said() {
        let flow = |value| vec![Estimate { value, std: 0.001 }];
        assert!(differences(&[flow(0.0), flow(9.0)]).is_empty());
        assert!(differences(&[vec![Estimate { value: 0.1, std: 0.001 }; 5]]).is_empty());
        assert!(differences(&[]).is_empty());
    }
}
