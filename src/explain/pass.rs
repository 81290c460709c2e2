//! One pass over the table: the statistic in the columns of all explanations, as far as leaks are known.

use super::columns::{Column, Course, Scales};
use super::equations::NormalEquations;
use super::evidence::LEAST_SCALE;
use super::hypothesis::{
    CRACKING_COLUMNS, Hypothesis, LEAK_COLUMNS, LeakCourse, ORIFICE_COLUMNS, STEADY_COLUMNS, Sizes, State,
    Subset,
};
use super::mistakes;
use super::odds::Prior;
use super::raw_products::{RawProducts, SegmentProducts, Statistic};
use super::readings::{Mistake, Readings};
use super::scatter::OverSheet;
use super::table::{self, Entry, USUAL};
use crate::rig::{Odds, Rig};
use crate::told::Told;
use pitchleak_core::continuity::EQUATIONS;
use pitchleak_core::{Leak, PerLeak};
use std::f64::consts::{LN_2, SQRT_2};
use std::ops::Range;

/// Recorders of pitch systems take at the most 2000 readings a second. Chosen.
const LEAST_STEP_S: f64 = 5e-4;

/// Errors of pressure sensors act through leaks as found; where those are less by half, not so. Chosen.
const LEAST_OF_FOUND: f64 = 0.5;
/// A pressure keeps its sign where so much of its mean size is its mean. Chosen.
const ONE_SIGN: f64 = 0.9;
/// How far a pressure sensor that hangs or lags is off, share of full scale, 1 σ. A guess.
const HANGS: f64 = 0.004;

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
    pub fn new(odds: &Odds) -> Self {
        let prior = Prior::new(odds);
        Self {
            zeros: prior.of(table::zeros()),
            departures: prior.of(table::departures()),
            pressures: prior.of(table::pressures()),
            wanders: table::wanders(&prior),
            mistakes: prior.of(mistakes::mistakes()),
            courses: prior.of(table::courses()),
        }
    }

    pub fn ln_course(&self, course: LeakCourse) -> f64 {
        let entry = self.courses.iter().find(|entry| entry.id == course.id());
        entry.map_or(f64::NEG_INFINITY, |entry| entry.share.ln())
    }
}

/// All that one pass over the table needs.
pub(super) struct Pass<'a, 's> {
    pub statistic: &'s Statistic,
    pub products: &'s RawProducts,
    pub rig: &'s Rig,
    pub tables: &'a Tables,
    pub found_m3s: PerLeak<f64>,
    /// What tells mistakes of wiring beside the statistic.
    pub told: Told,
    /// Spreads of the leaks beside what the trace leaves open.
    pub doubts_m3s: PerLeak<f64>,
    pub sizes: Sizes,
    pub segments: usize,
    pub full_scale_m3s: f64,
    pub over_sheet: OverSheet,
}

impl<'a, 's> Pass<'a, 's> {
    pub fn new(
        statistic: &'s Statistic,
        products: &'s RawProducts,
        rig: &'s Rig,
        tables: &'a Tables,
        found_m3s: PerLeak<f64>,
        told: &Told,
    ) -> Self {
        let flows = [rig.instruments.flow_a, rig.instruments.flow_b];
        let full_scale_m3s = flows[0].full_scale.max(flows[1].full_scale);
        Self {
            statistic,
            products,
            rig,
            tables,
            found_m3s,
            told: *told,
            doubts_m3s: PerLeak::default(),
            sizes: Sizes {
                seepage: rig.alarms.threshold_m3s.map(|fault| table::USUAL_SEEPAGE * fault / full_scale_m3s),
                since: products.coefficients_since(),
                compressibility: rig.fluid.bulk_modulus_std_pa / rig.fluid.bulk_modulus_pa,
                zero_units: flows.map(|flow| flow.full_scale / full_scale_m3s),
                zeros: flows.map(|flow| flow.bias),
                gains: flows.map(|flow| flow.gain),
                dead_volumes: [
                    rig.cylinder.dead_volume_a_m3 / (rig.cylinder.area_a_m2 * rig.cylinder.stroke_m),
                    rig.cylinder.dead_volume_b_m3 / (rig.cylinder.area_b_m2 * rig.cylinder.stroke_m),
                ],
                position_zero: told.position_zero(rig.cylinder.stroke_m),
            },
            segments: statistic.segments().len(),
            full_scale_m3s,
            over_sheet: OverSheet::of(statistic.scatter(), rig),
        }
    }

    pub fn equations(
        &self,
        products: &RawProducts,
        mistake: Option<&Entry>,
        columns: &[(Column, Course)],
    ) -> NormalEquations {
        // The sheet's noise is too much for columns in a larger unit.
        let noise_of: fn(&SegmentProducts) -> &[Vec<f64>; EQUATIONS] = match mistake {
            Some(_) => |segment| &segment.quiet,
            None => |segment| &segment.noise,
        };
        let equations = NormalEquations::new(products, &self.scales(mistake), columns, noise_of);
        if mistake.is_some() { equations } else { self.with_columns_of_their_own_noise(equations) }
    }

    /// A fit takes all noise to be as many times the sheet's. Where the flows alone are louder, or quieter, the columns' noise is not.
    fn with_columns_of_their_own_noise(&self, equations: NormalEquations) -> NormalEquations {
        let of_columns = self.over_sheet.of_columns().powi(2);
        let louder = [0, 1].map(|equation| {
            let of_rows = equations.scatter(equation).max(LEAST_SCALE);
            of_rows / of_columns.clamp(of_rows.min(1.0), of_rows.max(1.0))
        });
        equations.with_louder_flows(louder)
    }

    pub fn scales(&self, mistake: Option<&Entry>) -> Scales<'s> {
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
    pub fn departures(&self) -> Vec<&'a Entry> {
        let second = Leak::ALL.iter().any(|leak| self.found_m3s[*leak] > 0.0);
        let pressures = if second { &self.tables.pressures[..] } else { &[] };
        let known = |entry: &&Entry| !pressures.iter().any(|other| other.id == entry.id);
        self.tables.departures.iter().filter(known).chain(pressures).collect()
    }

    pub fn columns(&self) -> Vec<(Column, Course)> {
        let mut columns = vec![(Column::LeftSide, Course::Constant)];
        columns.extend(USUAL.iter().map(|(column, course, _)| (*column, *course)));
        let entries = self.tables.zeros.iter().filter(|zeros| !zeros.jumps()).chain(self.departures());
        columns.extend(
            entries.flat_map(|entry| entry.free.iter().map(|(column, course, _)| (*column, *course))),
        );
        for leak in LEAK_COLUMNS {
            columns.extend(
                [Course::Constant, Course::FromBegin, Course::ToEnd, Course::Accelerating]
                    .map(|course| (leak, course)),
            );
            columns.extend(
                (1..self.segments).flat_map(|k| [(leak, Course::Before(k)), (leak, Course::Since(k))]),
            );
            columns.extend((0..self.segments).map(|k| (leak, Course::Fading(k))));
        }
        let by_law = ORIFICE_COLUMNS.into_iter().chain(STEADY_COLUMNS).chain(CRACKING_COLUMNS);
        columns.extend(by_law.map(|law| (law, Course::Constant)));
        for zero in [Column::ZeroA, Column::ZeroB] {
            columns.extend((0..self.segments).map(|segment| (zero, Course::Within(segment))));
            columns.extend((1..self.segments).map(|border| (zero, Course::Since(border))));
        }
        let mut seen = std::collections::HashSet::new();
        columns.retain(|key| seen.insert(*key));
        columns
    }

    /// Zeros slightly off beside sensors and rig as declared: what mistakes are weighed beside.
    pub fn slightly_off(&self) -> Option<State<'a>> {
        let Tables { zeros, departures, wanders, .. } = self.tables;
        Some(State {
            zeros: zeros.get(1)?,
            departure: departures.first()?,
            wander: *wanders.first()?,
            border: 0,
        })
    }

    /// Where a leak or a zero may change at once, and ln of each one's share.
    pub fn borders(&self) -> (Range<usize>, f64) {
        let borders = 1..self.segments;
        let ln_border = -(borders.len().max(1) as f64).ln();
        (borders, ln_border)
    }

    /// Courses of leaks beside being constant, wandering and creeping, with their priors.
    pub fn courses(&self) -> Vec<(LeakCourse, f64)> {
        let (borders, ln_border) = self.borders();
        let with_prior = |course: LeakCourse| (course, self.tables.ln_course(course));
        let at_once = borders.flat_map(|border| [LeakCourse::Opening(border), LeakCourse::Sudden(border)]);
        let at_once = at_once.map(|course| {
            let (course, ln_course) = with_prior(course);
            (course, ln_course + ln_border)
        });
        let others =
            [LeakCourse::Orifice, LeakCourse::Cracking, LeakCourse::Growing, LeakCourse::Accelerating]
                .map(with_prior);
        others.into_iter().chain(at_once).collect()
    }

    /// What acts through leaks is asked beside those: the errors of pressure sensors.
    pub fn is_asked(&self, state: State<'_>, subset: Subset) -> bool {
        let lacks = |(leak, there): (Leak, bool)| !there && self.acts_through(state.departure, leak);
        (subset[0] || !state.departure.is_through_seal()) && !Leak::ALL.into_iter().zip(subset).any(lacks)
    }

    /// Whether leaks, so fitted, are about as large as those through which errors of pressure sensors act.
    pub fn leaks_as_found(&self, hypothesis: &Hypothesis<'_>, means: &[f64]) -> bool {
        let level_m3s = |leak: Leak| hypothesis.level(leak, means) * self.full_scale_m3s;
        let is_less = |leak: Leak| level_m3s(leak) < LEAST_OF_FOUND * self.found_m3s[leak];
        let departure = hypothesis.state.departure;
        !Leak::ALL.into_iter().any(|leak| self.acts_through(departure, leak) && is_less(leak))
    }

    /// Whether it acts through a leak, and that was found to be more than what seeps.
    fn acts_through(&self, departure: &Entry, leak: Leak) -> bool {
        departure.is_through_found(leak)
            && self.found_m3s[leak] > self.sizes.seepage[leak] * self.full_scale_m3s
    }

    /// Whether the pressure across a leak keeps its sign: what opens at one is then less by a constant.
    pub fn keeps_sign(&self, leak: Leak) -> bool {
        follows(leak, self.products.mean_pressures_pa(0)).abs() > ONE_SIGN
    }

    /// ln of the prior that leaks flow steadily while the pressures read change: how far those would have to be off.
    pub fn ln_unfollowed(&self, declared: &NormalEquations, subset: Subset) -> f64 {
        let pressure_pa = HANGS * self.rig.instruments.pressure.full_scale;
        let sensors_pa =
            PerLeak { internal: SQRT_2 * pressure_pa, external_a: pressure_pa, external_b: pressure_pa };
        let mean_pa = self.products.mean_pressures_pa(0);
        let strain = |leak: Leak| mean_pa[leak] * declared.spread(leak) / sensors_pa[leak];
        let leaks = Leak::ALL.into_iter().zip(subset).filter(|(_, there)| *there);
        let strain2: f64 = leaks.map(|(leak, _)| strain(leak).powi(2)).sum();
        self.tables.ln_course(LeakCourse::Unfollowed { alone: true }) - LN_2 - 0.5 * strain2
    }

    /// ln of the prior that a leak opens at once and flows steadily for all that is seen of it.
    pub fn ln_burst(&self) -> f64 {
        let [opens, is_steady] = [LeakCourse::Burst(0), LeakCourse::Unfollowed { alone: true }];
        self.tables.ln_course(opens) + self.tables.ln_course(is_steady)
    }

    /// Whether readings come as slowly as a recorder takes them, once a clock is mended: a block has one at the least.
    fn allows_clock(&self, mistake: Mistake) -> bool {
        let Mistake::Clock(factor) = mistake else { return true };
        let rows: f64 = self.statistic.segments().iter().map(|own| own.rows(0).max(own.rows(1))).sum();
        self.products.total_s / rows.max(1.0) / factor >= LEAST_STEP_S
    }

    /// Mistakes that these readings may carry, with what tells their odds beside the equations, ln.
    pub fn mistakes(&self) -> impl Iterator<Item = (&'a Entry, Mistake, f64)> {
        self.tables.mistakes.iter().filter_map(|entry| {
            let is_allowed =
                |mistake: &Mistake| self.told.allows(*mistake, self.rig) && self.allows_clock(*mistake);
            let mistake = entry.mistake.filter(is_allowed)?;
            Some((entry, mistake, self.told.ln_odds(mistake) + self.over_sheet.ln_odds(mistake)))
        })
    }
}

/// How far the mean size of the pressure across a leak follows its mean, −1 to 1: past the piston it may change its sign.
pub(super) fn follows(leak: Leak, mean_pa: PerLeak<f64>) -> f64 {
    match leak {
        Leak::Internal => {
            ((mean_pa.external_a - mean_pa.external_b) / mean_pa.internal.max(1.0)).clamp(-1.0, 1.0)
        }
        _ => 1.0,
    }
}
