//! The posterior over the table: which explanations of the readings are left, and how large each leak is under them.

use super::columns::{Column, Course, Scales};
use super::equations::NormalEquations;
use super::evidence::fit;
use super::hypothesis::{CRACKING_COLUMNS, Hypothesis, LEAK_COLUMNS, ORIFICE_COLUMNS, Sizes, State};
use super::independence::inflation;
use super::raw_products::{RawProducts, Statistic};
use super::readings::Readings;
use super::sizes::Found;
use super::table::{self, Entry, USUAL};
use crate::rig::Rig;
use pitchleak_core::continuity::CHANNELS;
use pitchleak_core::{Leak, PerLeak};

/// Explanations so much less probable than the best (e⁻⁹) are left out; numerical.
pub(super) const LEAST_LN: f64 = 9.0;
/// As much in the first look, which asks for the best and for means alone; numerical.
const FIRST_LOOK_LN: f64 = 3.0;
/// States of sensors and rig beside which other courses of leaks are tried; numerical.
const STATES_WITH_COURSES: usize = 5;
/// Leaks below this share of their threshold say nothing of the pressure sensors; a guess.
const LEAST_LEAK: f64 = 0.5;
/// A noise scale of so many times the readings' own scatter, squared, may be chance; above, an effect is missing, which is
/// alike in about ten blocks: a push of the pitch. Guesses.
const CHANCE_MISFIT2: f64 = 1.15;
const MISFIT_WORTH: f64 = 10.0;
/// Rows of an equation below which nothing can be said.
const LEAST_ROWS: f64 = 8.0;

/// A weighed explanation.
#[derive(Clone, Debug)]
pub(super) struct Weighed<'a> {
    pub hypothesis: Hypothesis<'a>,
    pub probability: f64,
    /// Noise scale over what the readings scatter.
    pub misfit: f64,
    /// How long before the end a leak last changed at once, s; none where none did.
    pub changed_ago_s: Option<f64>,
    /// Mean size of the pressures across the leaks since then, Pa.
    pub pressures_pa: PerLeak<f64>,
    /// What is not as declared, in its columns' units.
    pub found: Vec<Found>,
    /// Mean of C P of each leak, m³/s.
    pub levels_m3s: [f64; 3],
    /// Flow of each leak at the trace's end, m³/s, and weights of sum 1.
    pub leaks_m3s: Vec<[f64; 3]>,
    pub weights: Vec<f64>,
}

/// The table as it is weighed.
pub(super) struct Tables {
    pub zeros: Vec<Entry>,
    pub departures: Vec<Entry>,
    pub pressures: Vec<Entry>,
    pub wanders: Vec<(f64, f64)>,
    pub mistakes: Vec<Entry>,
    pub courses: Vec<Entry>,
}

impl Tables {
    pub fn new() -> Self {
        Self {
            zeros: table::zeros(),
            departures: table::departures(),
            pressures: table::pressures(),
            wanders: table::wanders(),
            mistakes: table::mistakes(),
            courses: table::courses(),
        }
    }

    pub fn ln_course(&self, id: &str) -> f64 {
        self.courses
            .iter()
            .find(|course| course.id == id)
            .map_or(f64::NEG_INFINITY, |course| course.share.ln())
    }
}

/// Weighs the whole table; `None` where there is too little to weigh.
pub(super) fn weigh<'a>(
    statistic: &Statistic,
    rig: &Rig,
    tables: &'a Tables,
    doubts_m3s: PerLeak<f64>,
) -> Option<Vec<Weighed<'a>>> {
    let rows: f64 =
        (0..2).map(|c| statistic.segments().iter().map(|s| s.rows(c)).sum::<f64>()).fold(0.0, f64::max);
    if rows < LEAST_ROWS {
        return None;
    }
    let products = RawProducts::of(statistic, rig);
    let (first, inflation) = Pass::new(statistic, &products, rig, tables, PerLeak::default()).look();
    let mean_m3s = PerLeak::from_fn(|leak| mean_level(&first, leak as usize));
    let least_m3s = rig.alarms.threshold_m3s.map(|threshold| LEAST_LEAK * threshold);
    let is_sound = mean_m3s.zip(least_m3s).iter().all(|(_, (mean, least))| mean < least);
    let found_m3s = if is_sound { PerLeak::default() } else { mean_m3s };
    let products = products.worth(inflation);
    let last = Pass { doubts_m3s, ..Pass::new(statistic, &products, rig, tables, found_m3s) };
    let weighed = last.weigh();
    (!weighed.is_empty()).then_some(weighed)
}

/// Mean of C P: of a leak that opens at a pressure more than what flows, as a sensor's zero acts through C.
fn mean_level(weighed: &[Weighed<'_>], leak: usize) -> f64 {
    weighed.iter().map(|one| one.probability * one.levels_m3s[leak]).sum()
}

/// All that one pass over the table needs.
pub(super) struct Pass<'a, 's> {
    pub statistic: &'s Statistic,
    pub products: &'s RawProducts,
    pub rig: &'s Rig,
    pub tables: &'a Tables,
    pub found_m3s: PerLeak<f64>,
    /// Spreads of the leaks beside what the trace leaves open.
    pub doubts_m3s: PerLeak<f64>,
    pub sizes: Sizes,
    pub segments: usize,
    pub full_scale_m3s: f64,
    /// Scatter of the readings over the declared noise, at least 1: of flows, and of the position.
    pub scatter: [f64; 2],
}

/// An explanation and its evidence before leaks are cut at zero.
pub(super) struct Scored<'a> {
    pub hypothesis: Hypothesis<'a>,
    pub ln_posterior: f64,
    pub ln_likelihood: f64,
    /// Among the equations of this mistake of wiring, or the declared.
    pub wiring: usize,
}

impl<'a, 's> Pass<'a, 's> {
    fn new(
        statistic: &'s Statistic,
        products: &'s RawProducts,
        rig: &'s Rig,
        tables: &'a Tables,
        found_m3s: PerLeak<f64>,
    ) -> Self {
        let flows = [rig.instruments.flow_a, rig.instruments.flow_b];
        let full_scale_m3s = flows[0].full_scale.max(flows[1].full_scale);
        Self {
            statistic,
            products,
            rig,
            tables,
            found_m3s,
            doubts_m3s: PerLeak::default(),
            sizes: Sizes {
                seepage: rig.alarms.threshold_m3s.map(|fault| table::USUAL_SEEPAGE * fault / full_scale_m3s),
                compressibility: rig.fluid.bulk_modulus_std_pa / rig.fluid.bulk_modulus_pa,
                zeros: flows.map(|flow| flow.bias),
                gains: flows.map(|flow| flow.gain),
            },
            segments: statistic.segments().len(),
            full_scale_m3s,
            scatter: scatter(statistic, rig),
        }
    }

    /// A first look, without mistakes of wiring: which leaks there are, and how many blocks are independent.
    fn look(&self) -> (Vec<Weighed<'a>>, [f64; 2]) {
        let columns = self.columns();
        let declared = self.equations(self.products, None, &columns);
        let mut all = self.constant(&declared);
        let states = best_states(&mut all);
        self.with_courses(&declared, &states, &mut all);
        all.sort_by(|a, b| b.ln_posterior.total_cmp(&a.ln_posterior));
        let weighed = self.mix(std::slice::from_ref(&declared), all, FIRST_LOOK_LN);
        let inflation = weighed.first().map_or([1.0; 2], |best| {
            let fit = fit(&declared, &best.hypothesis.free);
            let coloured =
                inflation(self.products, &self.scales(None), &declared, &columns, &best.hypothesis, &fit);
            [0, 1].map(|c| {
                let misfit2 = fit.scales[c] / self.scatter[c].powi(2);
                coloured[c].max(1.0 + MISFIT_WORTH * (misfit2 - CHANCE_MISFIT2).max(0.0))
            })
        });
        (weighed, inflation)
    }

    fn weigh(&self) -> Vec<Weighed<'a>> {
        let declared = self.equations(self.products, None, &self.columns());
        let mut all = self.constant(&declared);
        let states = best_states(&mut all);
        self.with_courses(&declared, &states, &mut all);
        let mistaken = self.with_mistakes(&declared, &mut all);
        let mut equations = vec![declared];
        equations.extend(mistaken);
        all.sort_by(|a, b| b.ln_posterior.total_cmp(&a.ln_posterior));
        self.mix(&equations, all, LEAST_LN)
    }

    pub(super) fn equations(
        &self,
        products: &RawProducts,
        mistake: Option<&Entry>,
        columns: &[(Column, Course)],
    ) -> NormalEquations {
        NormalEquations::new(products, &self.scales(mistake), columns)
    }

    pub(super) fn scales(&self, mistake: Option<&Entry>) -> Scales<'s> {
        let cylinder = &self.rig.cylinder;
        let mut readings = Readings::declared(cylinder, 1e6 / self.rig.fluid.bulk_modulus_pa);
        let mut pressures_mpa = self.products.mean_pressures_pa(0).map(|p| 1e-6 * p);
        let mut roots = self.statistic.mean_roots();
        if let Some(mistake) = mistake.and_then(|entry| entry.mistake) {
            readings = readings.mended(mistake, cylinder);
            pressures_mpa = mistake.mended_pressures(pressures_mpa);
            roots = mistake.mended_pressures(roots);
        }
        Scales { rig: self.rig, readings, pressures_mpa, roots, leaks_m3s: self.found_m3s }
    }

    /// Departures that are weighed: pressures through the leaks found, where there are any.
    pub(super) fn departures(&self) -> Vec<&'a Entry> {
        let second = Leak::ALL.iter().any(|leak| self.found_m3s[*leak] > 0.0);
        let pressures = if second { &self.tables.pressures[..] } else { &[] };
        let known = |entry: &&Entry| !pressures.iter().any(|other| other.id == entry.id);
        self.tables.departures.iter().filter(known).chain(pressures).collect()
    }

    fn columns(&self) -> Vec<(Column, Course)> {
        let mut columns = vec![(Column::LeftSide, Course::Constant)];
        columns.extend(USUAL.iter().map(|(column, course, _)| (*column, *course)));
        let entries = self.tables.zeros.iter().chain(self.departures());
        columns.extend(
            entries.flat_map(|entry| entry.free.iter().map(|(column, course, _)| (*column, *course))),
        );
        for leak in LEAK_COLUMNS {
            columns.extend([Course::Constant, Course::FromBegin, Course::ToEnd].map(|course| (leak, course)));
            columns.extend(
                (1..self.segments).flat_map(|k| [(leak, Course::Before(k)), (leak, Course::Since(k))]),
            );
            columns.extend((0..self.segments).map(|k| (leak, Course::Fading(k))));
        }
        let by_law = ORIFICE_COLUMNS.into_iter().chain(CRACKING_COLUMNS);
        columns.extend(by_law.map(|law| (law, Course::Constant)));
        for zero in [Column::ZeroA, Column::ZeroB] {
            columns.extend((0..self.segments).map(|segment| (zero, Course::Within(segment))));
        }
        let mut seen = std::collections::HashSet::new();
        columns.retain(|key| seen.insert(*key));
        columns
    }

    /// Cuts leaks at zero, best first, until what follows cannot matter.
    fn mix(&self, equations: &[NormalEquations], all: Vec<Scored<'a>>, least_ln: f64) -> Vec<Weighed<'a>> {
        let mut best = f64::NEG_INFINITY;
        let mut kept: Vec<(f64, Weighed<'a>)> = Vec::new();
        for scored in all {
            if !scored.ln_posterior.is_finite() || scored.ln_posterior < best - least_ln {
                break;
            }
            let Some(equations) = equations.get(scored.wiring) else { continue };
            let Some((ln, weighed)) = self.cut(equations, scored, best - least_ln) else { continue };
            best = best.max(ln);
            kept.push((ln, weighed));
        }
        kept.retain(|(ln, _)| *ln > best - least_ln);
        let sum: f64 = kept.iter().map(|(ln, _)| (ln - best).exp()).sum();
        kept.sort_by(|a, b| b.0.total_cmp(&a.0));
        kept.into_iter().map(|(ln, one)| Weighed { probability: (ln - best).exp() / sum, ..one }).collect()
    }
}

/// The states of best evidence, each once, and as-declared with usual and slight zeros.
fn best_states<'a>(all: &mut [Scored<'a>]) -> Vec<State<'a>> {
    all.sort_by(|a, b| b.ln_posterior.total_cmp(&a.ln_posterior));
    let mut states: Vec<State<'a>> = Vec::new();
    for scored in all.iter() {
        if states.len() < STATES_WITH_COURSES && !states.contains(&scored.hypothesis.state) {
            states.push(scored.hypothesis.state);
        }
    }
    let plain = all.iter().map(|scored| scored.hypothesis.state).filter(|state| {
        state.wander.0 <= 0.0
            && state.departure.id == "as_declared"
            && ["zeros_usual", "flow_zeros"].contains(&state.zeros.id)
    });
    for state in plain {
        if !states.contains(&state) {
            states.push(state);
        }
    }
    states
}

/// Scatter of flows and of the position over the declared noise.
fn scatter(statistic: &Statistic, rig: &Rig) -> [f64; 2] {
    let sensors = rig.sensors();
    let found: [Option<f64>; CHANNELS] = statistic.scatter();
    let over = |found: Option<f64>, declared: f64| match found {
        Some(found) if declared > 0.0 => (found / declared).max(1.0),
        _ => 1.0,
    };
    [
        over(found[3], sensors.flow_a.noise_std).max(over(found[4], sensors.flow_b.noise_std)),
        over(found[0], sensors.position.noise_std),
    ]
}
