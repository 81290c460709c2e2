//! Maximum likelihood of the unknowns over the readings of a window.
//!
//! Readings stand on both sides of the equations. So signals and unknowns are found in turn: the equations are made linear at the
//! likeliest signals, which begin as running means (Gauss and Helmert's method; Deming 1943, "Statistical Adjustment of Data", ch. IV).
//! What is known before holds all but the leaks back at first: else the noise of the pressures is taken for compression, and a leak for
//! edges as no valve has them.

use super::course::Course;
use super::edges::{SPOOL, Signals};
use super::equations::{Known, Node, Rates, Step};
use super::parts::Part;
use super::unknowns::{Belief, GAINS, HYSTERESIS, KAPPA, ROUNDING, UNKNOWNS, Unknowns};
use super::unread;
use super::whitening::Whitening;
use nalgebra::DVector;

const MOST_ROUNDS: usize = 40;
/// The first step moves no unknown beyond what is known of it to explain the readings; so many times less holds it back from round to
/// round.
const EASED: f64 = 30.0;
/// After so many rounds steps are half as long, of unknowns and signals alike: where an edge is sharp, or a pressure and its chamber's
/// own leak are known by their product, whole ones go to and fro.
const ROUNDS_WHOLE: usize = 8;
/// Rounds after which the spool is followed with the hysteresis found, within these multiples of the declared one.
const ROUNDS_FOLLOWED: [usize; 3] = [5, 8, 11];
const PLAY_RANGE: [f64; 2] = [0.3, 5.0];
/// The search is over where no unknown moves by more than this share of its standard deviation.
const SETTLED: f64 = 0.5;
/// The gain of an edge is off by no more of its standard deviations. A search that ends further off has closed an edge that the trace
/// hardly opens, and hidden a leak in that.
const MOST_OFF: f64 = 5.0;
/// κ stays within these multiples of the rig file's on its way, and an edge is never sharper than this share of the stroke.
const KAPPA_RANGE: [f64; 2] = [0.2, 5.0];
const SHARPEST: f64 = 1e-3;
/// Signals begin as means over so many readings to either side.
const REACH: usize = 3;
/// Fewer readings without a pause tell nothing.
pub(super) const LEAST_READINGS: usize = 8;
/// A window is summed up in parts of so many seconds: leaks may change between two of them.
const PART_S: f64 = 5.0;

/// Readings without a pause.
#[derive(Clone, Debug, Default, serde::Serialize, serde::Deserialize)]
pub(super) struct Run {
    pub readings: Vec<Node>,
}

/// A run on its way to the likeliest signals.
struct Smoothed {
    known: Known,
    /// The chamber whose pressure is not measured.
    unread: Option<usize>,
    readings: Vec<Node>,
    nodes: Vec<Node>,
}

/// What a window says.
#[derive(Clone, Debug)]
pub(super) struct Fit {
    /// Around which all is linear.
    pub place: Place,
    pub parts: Vec<Part>,
    /// Whether the search came to an end where such a valve may be; else the place is the likeliest that it passed.
    pub is_settled: bool,
}

impl Run {
    /// The readings from one time up to another, s, as a run of its own.
    pub fn between(&self, from_s: f64, to_s: f64) -> Option<Self> {
        let readings: Vec<Node> =
            self.readings.iter().filter(|node| node.t_s >= from_s && node.t_s < to_s).copied().collect();
        (readings.len() >= LEAST_READINGS).then_some(Self { readings })
    }

    /// Time that it spans, s.
    pub fn seconds(&self) -> f64 {
        match self.readings.as_slice() {
            [first, .., last] => last.t_s - first.t_s,
            _ => 0.0,
        }
    }
}

impl Smoothed {
    /// Signals begin as running means, a pressure that is not measured where the valve brings it.
    fn begin(run: &Run, half_width: f64, unknowns: &Unknowns, known: &Known) -> Self {
        let mut readings = run.readings.clone();
        let mut nodes = follow_spool(&mut readings, half_width);
        let unread = readings.first().and_then(|first| unread::chamber(&first.signals));
        let Some(chamber) = unread else {
            return Self { known: known.clone(), unread, readings, nodes };
        };
        unread::course(chamber, &mut nodes, unknowns, known);
        for (reading, node) in readings.iter_mut().zip(&nodes) {
            reading.signals[chamber] = node.signals[chamber];
        }
        Self { known: known.clone().without(chamber), unread, readings, nodes }
    }

    /// Where the spool stands within a hysteresis of this half width.
    fn follow(&mut self, half_width: f64) {
        follow_spool(&mut self.readings, half_width);
        for (node, reading) in self.nodes.iter_mut().zip(&self.readings) {
            node.spool = reading.spool;
        }
    }

    fn whitened(&self, place: &Place) -> Option<Whitening> {
        let known = &self.known;
        let mut white = Whitening::new(known.variances, self.nodes.len());
        let mut last: Option<(&Node, &Node, Rates)> = None;
        for (reading, node) in self.readings.iter().zip(&self.nodes) {
            let unknowns = &place.unknowns_at(node.t_s);
            let rates = Rates::at(node, unknowns, known);
            if let Some((first_reading, first, from)) = &last {
                let middle = Rates::at(&first.half_way(node), unknowns, known);
                let mut step = Step::between([first, node], [from, &middle, &rates], unknowns, known);
                // At the readings themselves, made linear at the signals.
                step.residual_m3 += step.by_first * (first_reading.signals - first.signals)
                    + step.by_last * (reading.signals - node.signals);
                white.push(&step)?;
            }
            last = Some((reading, node, rates));
        }
        Some(white)
    }

    /// Moves the signals by this share of the way to the likeliest where the unknowns at a time go by `step`.
    fn smooth(&mut self, white: &Whitening, step: impl Fn(f64) -> Unknowns, share: f64) -> Option<()> {
        let nodes = &self.nodes;
        let corrections =
            white.corrections(|place, one| one.residual + one.by_unknowns * step(nodes[place].t_s))?;
        for ((node, reading), correction) in self.nodes.iter_mut().zip(&self.readings).zip(corrections) {
            node.signals += (reading.signals - correction - node.signals) * share;
            self.unread.iter().for_each(|chamber| unread::bound(*chamber, &mut node.signals));
        }
        Some(())
    }

    fn parts(&self, white: &Whitening) -> Vec<Part> {
        let mut parts: Vec<Part> = Vec::new();
        for (step, pair) in white.steps().iter().zip(self.nodes.windows(2)) {
            let [from, to] = pair else { continue };
            if parts.last().is_none_or(|part| from.t_s >= part.from_s + PART_S) {
                parts.push(Part::from(from.t_s));
            }
            if let Some(part) = parts.last_mut() {
                part.add(step, [from, to], self.known.told);
            }
        }
        parts.into_iter().map(Part::whole).collect()
    }
}

/// Fits all runs together after what was believed before, beginning at a place. None where no finite number comes out.
pub(super) fn fit(
    runs: &[Run],
    before: &Belief,
    mut place: Place,
    half_width: f64,
    known: &Known,
) -> Option<Fit> {
    let [least, most] = PLAY_RANGE.map(|share| share * half_width);
    let found = |place: &Place| place.unknowns[HYSTERESIS].abs().clamp(least, most);
    let begin = if place.unknowns[HYSTERESIS] == 0.0 { half_width } else { found(&place) };
    let mut runs: Vec<Smoothed> =
        runs.iter().map(|run| Smoothed::begin(run, begin, &place.unknowns, known)).collect();
    let begin_s = runs.first()?.nodes.first()?.t_s;
    let told: f64 = runs.iter().map(|run| run.known.told * run.nodes.len() as f64).sum();
    let mut damping = None;
    let mut likeliest: Option<Passed> = None;
    for round in 0..MOST_ROUNDS {
        if half_width > 0.0 && ROUNDS_FOLLOWED.contains(&round) {
            runs.iter_mut().for_each(|run| run.follow(found(&place)));
        }
        let whites = whitened(&runs, &place)?;
        let parts = in_parts(&runs, &whites);
        let normal = place.course.normal(&parts, before, &place.unknowns);
        let moved = |damping: f64| Some(place.bounded(normal.solve(&before.information, damping)?));
        if normal.square(&moved(0.0)?) < SETTLED * SETTLED {
            let is_settled = has_its_edges(&place.unknowns, before)?;
            return Some(Fit { place, parts, is_settled });
        }
        let square = squares(&whites) + before.square(&place.unknowns_at(begin_s));
        if likeliest.as_ref().is_none_or(|passed| square < passed.square) {
            likeliest = Some(Passed::of(&runs, &place, square));
        }
        let held = damping.unwrap_or((square - told).max(0.0));
        damping = Some(held / EASED);
        let share = if round < ROUNDS_WHOLE { 1.0 } else { 0.5 };
        let step = moved(held)?;
        let next = place.moved(&step, 1.0);
        for (run, white) in runs.iter_mut().zip(&whites) {
            run.smooth(white, |t_s| next.unknowns_at(t_s) - place.unknowns_at(t_s), share)?;
        }
        place = place.moved(&step, share);
    }
    let place = likeliest?.go_back(&mut runs);
    let parts = in_parts(&runs, &whitened(&runs, &place)?);
    Some(Fit { place, parts, is_settled: false })
}

/// Whether each edge has about the gain that is believed of it.
fn has_its_edges(unknowns: &Unknowns, before: &Belief) -> Option<bool> {
    let variances = before.covariance()?.diagonal();
    let off = |at: usize| (unknowns[at] - before.mean[at]).abs() / variances[at].sqrt();
    Some((GAINS..GAINS + 4).all(|at| off(at) <= MOST_OFF))
}

/// Unknowns, those at the end of a course.
#[derive(Clone, Debug)]
pub(super) struct Place {
    pub unknowns: Unknowns,
    pub course: Course,
}

impl Place {
    fn unknowns_at(&self, t_s: f64) -> Unknowns {
        self.unknowns + self.course.before_end(t_s)
    }

    /// As much of a step as brings κ and the rounding no further than they may go.
    fn bounded(&self, mut step: DVector<f64>) -> DVector<f64> {
        let own = bounded(self.unknowns + step.fixed_rows::<UNKNOWNS>(0)) - self.unknowns;
        step.fixed_rows_mut::<UNKNOWNS>(0).copy_from(&own);
        step
    }

    fn moved(&self, step: &DVector<f64>, share: f64) -> Self {
        Self {
            unknowns: self.unknowns + step.fixed_rows::<UNKNOWNS>(0) * share,
            course: self.course.moved(step, share),
        }
    }
}

/// Where the search passed.
struct Passed {
    place: Place,
    nodes: Vec<Vec<Node>>,
    /// Of the residuals and of what was believed before.
    square: f64,
}

impl Passed {
    fn of(runs: &[Smoothed], place: &Place, square: f64) -> Self {
        Self { place: place.clone(), nodes: runs.iter().map(|run| run.nodes.clone()).collect(), square }
    }

    fn go_back(self, runs: &mut [Smoothed]) -> Place {
        runs.iter_mut().zip(self.nodes).for_each(|(run, nodes)| run.nodes = nodes);
        self.place
    }
}

fn whitened(runs: &[Smoothed], place: &Place) -> Option<Vec<Whitening>> {
    runs.iter().map(|run| run.whitened(place)).collect()
}

fn in_parts(runs: &[Smoothed], whites: &[Whitening]) -> Vec<Part> {
    runs.iter().zip(whites).flat_map(|(run, white)| run.parts(white)).collect()
}

/// Of the residuals, in those of the noise.
fn squares(whites: &[Whitening]) -> f64 {
    whites.iter().flat_map(Whitening::steps).map(|step| step.residual.norm_squared()).sum()
}

fn bounded(mut unknowns: Unknowns) -> Unknowns {
    unknowns[KAPPA] = unknowns[KAPPA].clamp(KAPPA_RANGE[0], KAPPA_RANGE[1]);
    unknowns[ROUNDING] = unknowns[ROUNDING].abs().max(SHARPEST);
    unknowns
}

/// Running means, over less where the run ends.
fn running_means(readings: &[Node]) -> Vec<Node> {
    let last = readings.len().saturating_sub(1);
    let mean = |index: usize| {
        let reach = REACH.min(index).min(last - index);
        let part = &readings[index - reach..=index + reach];
        part.iter().map(|node| node.signals).sum::<Signals>() / part.len() as f64
    };
    (0..readings.len()).map(|index| Node { signals: mean(index), ..readings[index] }).collect()
}

/// Running means with the spool's speed and where it stands within a hysteresis of half this width, which the readings get as well.
fn follow_spool(readings: &mut [Node], half_width: f64) -> Vec<Node> {
    let mut means = running_means(readings);
    let last = readings.len().saturating_sub(1);
    let mut play = 0.0;
    for index in 0..readings.len() {
        let (from, to) = (&means[index.saturating_sub(1)], &means[(index + 1).min(last)]);
        let span_s = to.t_s - from.t_s;
        let rise = to.signals[SPOOL] - from.signals[SPOOL];
        if half_width > 0.0 && index > 0 {
            let moved = means[index].signals[SPOOL] - means[index - 1].signals[SPOOL];
            play = f64::clamp(play + moved / half_width, -1.0, 1.0);
        }
        let rate_ps = if span_s > 0.0 { rise / span_s } else { 0.0 };
        for node in [&mut readings[index], &mut means[index]] {
            (node.spool.rate_ps, node.spool.play) = (rate_ps, play);
        }
    }
    means
}
