use crate::trace::Record;
use pitchleak_core::{Cylinder, Leak, PerLeak, Sample};
use serde::{Deserialize, Serialize};

/// Shortest block, s, and its fewest steps: as in the estimator.
const BLOCK_S: f64 = 0.25;
const BLOCK_STEPS: u32 = 8;

/// Which flows were measured all through a block.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Fed {
    Both,
    OnlyA,
    OnlyB,
}

/// Both continuity equations, eq. (1), integrated over a block: ∫Q dt = ±A Δx + κ ∫V dP + leaks.
#[derive(Clone, Copy, Debug)]
pub(super) struct Block {
    /// The block follows the one before without a pause.
    pub follows: bool,
    pub fed: Fed,
    pub a: Chamber,
    pub b: Chamber,
    /// ∫√P dt of the pressure across each leak, of its sign, √Pa·s.
    pub roots: PerLeak<f64>,
    /// ∫F dt, N·s, where the load force was measured all through.
    pub force: Option<f64>,
    /// Δx, m.
    pub travel_m: f64,
    /// ∫dt, s, and Σ dt², s².
    pub time_s: f64,
    pub time_square_s2: f64,
}

impl Block {
    /// ∫P dt of the pressure across a leak, Pa·s.
    pub fn across(&self, leak: Leak) -> f64 {
        match leak {
            Leak::Internal => self.a.pressure - self.b.pressure,
            Leak::ExternalA => self.a.pressure,
            Leak::ExternalB => self.b.pressure,
        }
    }
}

/// One chamber's integrals.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub(super) struct Chamber {
    /// ∫Q dt, m³.
    pub flow_m3: f64,
    /// ∫V dP, m³·Pa.
    pub compression: f64,
    /// ∫P dt, Pa·s.
    pub pressure: f64,
    /// V at the block's end, m³: a pressure reading's noise acts through it.
    pub volume_m3: f64,
}

#[derive(Clone, Debug, Default, Serialize, Deserialize)]
struct Sum {
    a: Chamber,
    b: Chamber,
    roots: PerLeak<f64>,
    force: f64,
    forces: u32,
    travel_m: f64,
    time_s: f64,
    time_square_s2: f64,
    steps: u32,
    fed_a: u32,
    fed_b: u32,
}

/// Gathers records to blocks; a rest that a gap cuts off is lost, as is a block without any flow all through.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(super) struct Gatherer {
    last: Option<Sample<f64>>,
    sum: Sum,
    follows: bool,
}

impl Gatherer {
    /// Takes in the next record; gives the block that it ends.
    pub fn add(&mut self, now: &Record, cylinder: &Cylinder<f64>) -> Option<Block> {
        let last = self.last.replace(now.sample)?;
        if now.step_s() <= 0.0 {
            (self.sum, self.follows) = (Sum::default(), false);
            return None;
        }
        self.sum.add(&last, now, cylinder);
        if self.sum.time_s < BLOCK_S || self.sum.steps < BLOCK_STEPS {
            return None;
        }
        let block = std::mem::take(&mut self.sum).block(self.follows);
        self.follows = block.is_some();
        block
    }
}

/// The records' blocks.
pub(super) fn blocks(records: &[Record], cylinder: &Cylinder<f64>) -> Vec<Block> {
    let mut gatherer = Gatherer::default();
    records.iter().filter_map(|record| gatherer.add(record, cylinder)).collect()
}

impl Sum {
    fn add(&mut self, l: &Sample<f64>, now: &Record, cylinder: &Cylinder<f64>) {
        let (dt, n) = (now.step_s(), &now.sample);
        let x = (0.5 * (l.x_m + n.x_m)).clamp(0.0, cylinder.stroke_m);
        let add = |chamber: &mut Chamber, volume: f64, [p0, p1]: [f64; 2], flows: Option<f64>| {
            chamber.flow_m3 += 0.5 * dt * flows.unwrap_or(0.0);
            chamber.compression += volume * (p1 - p0);
            chamber.pressure += 0.5 * dt * (p0 + p1);
            chamber.volume_m3 = volume;
        };
        let sum = |a: Option<f64>, b: Option<f64>| Some(a? + b?);
        let (qa, qb) = (sum(l.qa_m3s, n.qa_m3s), sum(l.qb_m3s, n.qb_m3s));
        add(&mut self.a, cylinder.volume_a_m3(x), [l.pa_pa, n.pa_pa], qa);
        add(&mut self.b, cylinder.volume_b_m3(x), [l.pb_pa, n.pb_pa], qb);
        let mean = |p: fn(&Sample<f64>) -> f64| 0.5 * (p(l) + p(n));
        let across = PerLeak {
            internal: mean(|s| s.pa_pa - s.pb_pa),
            external_a: mean(|s| s.pa_pa),
            external_b: mean(|s| s.pb_pa),
        };
        let roots = across.map(|p| dt * p.abs().sqrt().copysign(p));
        self.roots = self.roots.zip(roots).map(|(sum, root)| sum + root);
        if let Some(force) = sum(l.force_n, n.force_n) {
            self.force += 0.5 * dt * force;
            self.forces += 1;
        }
        self.travel_m += n.x_m - l.x_m;
        self.time_s += dt;
        self.time_square_s2 += dt * dt;
        self.steps += 1;
        self.fed_a += u32::from(qa.is_some());
        self.fed_b += u32::from(qb.is_some());
    }

    fn block(self, follows: bool) -> Option<Block> {
        let fed = match (self.fed_a == self.steps, self.fed_b == self.steps) {
            (true, true) => Fed::Both,
            (true, false) => Fed::OnlyA,
            (false, true) => Fed::OnlyB,
            (false, false) => return None,
        };
        let Self { a, b, roots, travel_m, time_s, time_square_s2, .. } = self;
        let force = (self.forces == self.steps).then_some(self.force);
        Some(Block { follows, fed, a, b, roots, force, travel_m, time_s, time_square_s2 })
    }
}
