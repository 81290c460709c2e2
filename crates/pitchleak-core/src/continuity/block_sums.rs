//! Sums of a block: everything that the continuity equations integrate, by the trapezoidal rule and never
//! differentiated.
//!
//! Pressures are summed in MPa, so that squares of the sums stay within single precision's range; all else is SI.

use super::clocks::Row;
use crate::{Cylinder, Fluid, Real, Sample, signed_root};

/// Usual length of a block, s.
const BLOCK_S: f64 = 0.25;
/// Steps that a block has at the least: fewer are no average, at 10 Hz.
const LEAST_STEPS: u32 = 8;
/// Readings averaged about a block's end for the change of a flow over it.
const END_READINGS: usize = 7;
/// Those of them that come after the end.
const READINGS_AFTER: u32 = 3;

/// 1 Pa in MPa.
pub(super) const MPA_PER_PA: f64 = 1e-6;

/// One of the sums of a block.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(usize)]
pub enum RawSum {
    /// ∫Q_A − A_A Δx − κ₀ ∫V_A dP_A, m³: the left side of chamber A's equation as declared. Kept whole, as its
    /// terms cancel.
    ResidualA,
    /// ∫Q_B + A_B Δx − κ₀ ∫V_B dP_B, m³.
    ResidualB,
    /// Δx, m.
    Travel,
    /// ∫V_A dP_A, m³ MPa.
    StorageA,
    /// ∫V_B dP_B, m³ MPa.
    StorageB,
    /// ∫P_A dt, MPa s.
    PressureA,
    /// ∫P_B dt, MPa s.
    PressureB,
    /// ∫dt, s.
    Time,
    /// Change of Q_A over the block, each end a mean of readings, m³/s.
    FlowChangeA,
    /// Change of Q_B.
    FlowChangeB,
    /// ΔP_A, MPa.
    PressureChangeA,
    /// ΔP_B, MPa.
    PressureChangeB,
    /// ∫sgn(P_L) √|P_L| dt, √Pa s.
    RootInternal,
    /// ∫sgn(P_A) √|P_A| dt.
    RootA,
    /// ∫sgn(P_B) √|P_B| dt.
    RootB,
    /// ∫V_A dP_B, m³ MPa: what chamber A stores where the pressures are exchanged.
    StorageAOfB,
    /// ∫V_B dP_A.
    StorageBOfA,
    /// ∫t P_A dt, MPa s²; t counts from the block's begin, in a segment from the segment's.
    AgedPressureA,
    /// ∫t P_B dt.
    AgedPressureB,
    /// ∫t dt, s².
    AgedTime,
}

/// How many sums a block has.
pub const RAW_SUMS: usize = RawSum::AgedTime as usize + 1;

/// A block's sums, and what its noise depends on.
#[derive(Clone, Copy, Debug, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Block<T> {
    /// By [`RawSum`].
    pub sums: [T; RAW_SUMS],
    /// Which flows, A and B, were measured throughout; the equation of the other rests.
    pub fed: [bool; 2],
    /// Σ dt² between a flow meter's own readings, s².
    pub time_square_s2: [T; 2],
    /// Σ dt² between the readings of the pressures, s².
    pub pressure_square_s2: T,
    /// V_A and V_B at the block's end, m³.
    pub volumes_m3: [T; 2],
    /// No block comes right before it: its begin has noise of its own, with these volumes.
    pub begins_at: Option<[T; 2]>,
}

/// Gathers readings into blocks. A block comes out a few readings after its end, which the change of its flows
/// is averaged over.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct BlockSums<T> {
    area_m2: [T; 2],
    stroke_m: T,
    dead_volume_m3: [T; 2],
    /// κ₀ = 1/β as declared, 1/MPa.
    compressibility: T,
    last: Option<Sample<T>>,
    begins_at: Option<[T; 2]>,
    open: Sums<T>,
    closed: Option<Sums<T>>,
    /// Readings until the closed block comes out, or the first end is known.
    countdown: u32,
    meters: [Meter<T>; 2],
}

/// Sums as they grow.
#[derive(Clone, Copy, Debug, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Sums<T> {
    flow_m3: [T; 2],
    sums: [T; RAW_SUMS],
    time_square_s2: [T; 2],
    pressure_square_s2: T,
    volumes_m3: [T; 2],
    fed: [bool; 2],
    steps: u32,
}

/// A flow meter.
#[derive(Clone, Copy, Debug, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Meter<T> {
    last_m3s: Option<T>,
    readings_m3s: [T; END_READINGS],
    count: usize,
    /// Mean of the readings about the last block's end, m³/s.
    end_m3s: Option<T>,
}

impl<T: Real> Meter<T> {
    /// Takes what stands in a row, and whether it was read just then; what has flowed since the row before.
    fn take(&mut self, dt_s: T, flow_m3s: Option<T>, was_read: bool) -> Option<T> {
        let last = core::mem::replace(&mut self.last_m3s, flow_m3s);
        let now = flow_m3s?;
        if was_read {
            if let Some(place) = self.readings_m3s.get_mut(self.count % END_READINGS) {
                *place = now;
            }
            self.count += 1;
        }
        last.map(|last| T::lit(0.5) * (now + last) * dt_s)
    }

    fn rests(&self) -> bool {
        self.last_m3s.is_none()
    }

    /// Mean of the latest readings.
    fn mean_m3s(&self) -> Option<T> {
        let known = self.count.min(END_READINGS);
        let sum = self.readings_m3s.iter().take(known).fold(T::zero(), |sum, value| sum + *value);
        (known > 0 && self.last_m3s.is_some()).then(|| sum / T::lit(known as f64))
    }
}

impl<T: Real> BlockSums<T> {
    /// Blocks of this cylinder's readings.
    pub fn new(cylinder: &Cylinder<T>, fluid: &Fluid<T>) -> Self {
        Self {
            area_m2: [cylinder.area_a_m2, cylinder.area_b_m2],
            stroke_m: cylinder.stroke_m,
            dead_volume_m3: [cylinder.dead_volume_a_m3, cylinder.dead_volume_b_m3],
            compressibility: T::one() / (fluid.bulk_modulus_pa * T::lit(MPA_PER_PA)),
            last: None,
            begins_at: None,
            open: Sums::default(),
            closed: None,
            countdown: 0,
            meters: [Meter::default(); 2],
        }
    }

    /// Takes in a row, which begins after a pause where its step is not positive; gives the block that ended a few rows before.
    pub fn push(&mut self, row: &Row<T>) -> Option<Block<T>> {
        let Some(last) = self.last.filter(|_| row.dt_s > T::zero()) else {
            let block = self.release();
            self.begin(&row.sample);
            return block;
        };
        self.add(&last, row);
        self.last = Some(row.sample);
        let block = self.count_down();
        if self.is_complete() {
            let fed = self.begin_fed();
            let mut closed = core::mem::replace(&mut self.open, Sums { fed, ..Sums::default() });
            // Where a meter fell silent within the block, what it read does not cover the block.
            closed.fed = [closed.fed[0] && fed[0], closed.fed[1] && fed[1]];
            self.closed = Some(closed);
            self.countdown = READINGS_AFTER;
        }
        block
    }

    /// Begins anew at a reading before which nothing is known.
    fn begin(&mut self, sample: &Sample<T>) {
        self.meters = [Meter::default(); 2];
        for (meter, reading) in self.meters.iter_mut().zip([sample.qa_m3s, sample.qb_m3s]) {
            let _ = meter.take(T::zero(), reading, true);
        }
        self.last = Some(*sample);
        self.begins_at = Some(self.volumes_m3(sample.x_m));
        self.open = Sums { fed: self.begin_fed(), ..Sums::default() };
        self.countdown = READINGS_AFTER;
    }

    fn begin_fed(&self) -> [bool; 2] {
        let [a, b] = &self.meters;
        [!a.rests(), !b.rests()]
    }

    fn volumes_m3(&self, x_m: T) -> [T; 2] {
        let x_m = x_m.at_least(T::zero()).at_most(self.stroke_m);
        let [area_a, area_b] = self.area_m2;
        let [dead_a, dead_b] = self.dead_volume_m3;
        [area_a * x_m + dead_a, area_b * (self.stroke_m - x_m) + dead_b]
    }

    fn add(&mut self, last: &Sample<T>, row: &Row<T>) {
        use RawSum as R;
        let Row { dt_s, ref sample, .. } = *row;
        let half = T::lit(0.5);
        let mpa = T::lit(MPA_PER_PA);
        let volumes_m3 = self.volumes_m3(half * (sample.x_m + last.x_m));
        let change = [mpa * (sample.pa_pa - last.pa_pa), mpa * (sample.pb_pa - last.pb_pa)];
        let [pa, pb] = [half * mpa * (sample.pa_pa + last.pa_pa), half * mpa * (sample.pb_pa + last.pb_pa)];
        let open = &mut self.open;
        let flows = [
            (sample.qa_m3s, row.read.qa, row.own_step_s.qa),
            (sample.qb_m3s, row.read.qb, row.own_step_s.qb),
        ];
        for (side, (flow, was_read, own_step_s)) in flows.into_iter().enumerate() {
            if let Some(flown_m3) = self.meters[side].take(dt_s, flow, was_read) {
                open.flow_m3[side] += flown_m3;
                // Over all rows between two readings these are the square of the time between those.
                open.time_square_s2[side] += own_step_s * dt_s;
            }
        }
        let t_s = open.sums[R::Time as usize] + half * dt_s;
        let mut sum = |raw: R, value: T| open.sums[raw as usize] += value;
        sum(R::Travel, sample.x_m - last.x_m);
        sum(R::StorageA, volumes_m3[0] * change[0]);
        sum(R::StorageB, volumes_m3[1] * change[1]);
        sum(R::PressureA, dt_s * pa);
        sum(R::PressureB, dt_s * pb);
        sum(R::Time, dt_s);
        sum(R::PressureChangeA, change[0]);
        sum(R::PressureChangeB, change[1]);
        let root = |pressure_mpa: T| dt_s * signed_root(pressure_mpa * T::lit(1.0 / MPA_PER_PA));
        sum(R::RootInternal, root(pa - pb));
        sum(R::RootA, root(pa));
        sum(R::RootB, root(pb));
        sum(R::StorageAOfB, volumes_m3[0] * change[1]);
        sum(R::StorageBOfA, volumes_m3[1] * change[0]);
        sum(R::AgedPressureA, dt_s * t_s * pa);
        sum(R::AgedPressureB, dt_s * t_s * pb);
        sum(R::AgedTime, dt_s * t_s);
        open.pressure_square_s2 += dt_s * dt_s;
        open.volumes_m3 = volumes_m3;
        open.steps += 1;
    }

    /// A block ends where it is long enough.
    fn is_complete(&self) -> bool {
        let time_s = self.open.sums[RawSum::Time as usize];
        time_s >= T::lit(BLOCK_S - 1e-9) && self.open.steps >= LEAST_STEPS
    }

    /// Once the readings after an end are there, its means are taken and its block comes out.
    fn count_down(&mut self) -> Option<Block<T>> {
        if self.countdown == 0 {
            return None;
        }
        self.countdown -= 1;
        if self.countdown == 0 { self.release() } else { None }
    }

    fn release(&mut self) -> Option<Block<T>> {
        self.countdown = 0;
        let mut sums = self.closed.take();
        for (side, raw) in [RawSum::FlowChangeA, RawSum::FlowChangeB].into_iter().enumerate() {
            let meter = &mut self.meters[side];
            let end = meter.mean_m3s();
            if let (Some(sums), Some(end), Some(before)) = (&mut sums, end, meter.end_m3s) {
                sums.sums[raw as usize] = end - before;
            }
            meter.end_m3s = end;
        }
        let Sums { flow_m3, mut sums, time_square_s2, pressure_square_s2, volumes_m3, fed, .. } = sums?;
        let travel = sums[RawSum::Travel as usize];
        let stored = |raw: RawSum| self.compressibility * sums[raw as usize];
        let residual_a = flow_m3[0] - self.area_m2[0] * travel - stored(RawSum::StorageA);
        let residual_b = flow_m3[1] + self.area_m2[1] * travel - stored(RawSum::StorageB);
        sums[RawSum::ResidualA as usize] = if fed[0] { residual_a } else { T::zero() };
        sums[RawSum::ResidualB as usize] = if fed[1] { residual_b } else { T::zero() };
        let begins_at = self.begins_at.take();
        Some(Block { sums, fed, time_square_s2, pressure_square_s2, volumes_m3, begins_at })
    }
}
