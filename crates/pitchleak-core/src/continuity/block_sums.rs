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
    /// |Δx|, m: what a meter sees otherwise on the way out than on the way in goes with it.
    Way,
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

impl<T: Real> Sums<T> {
    fn fed() -> Self {
        Self { fed: [true; 2], ..Self::default() }
    }
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
            self.closed = Some(core::mem::replace(&mut self.open, Sums::fed()));
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
        self.open = Sums::fed();
        self.countdown = READINGS_AFTER;
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
            } else {
                // What a meter reads that was silent within a block does not cover the block.
                open.fed[side] = false;
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
        sums[RawSum::Way as usize] = travel.abs();
        let stored = |raw: RawSum| self.compressibility * sums[raw as usize];
        let residual_a = flow_m3[0] - self.area_m2[0] * travel - stored(RawSum::StorageA);
        let residual_b = flow_m3[1] + self.area_m2[1] * travel - stored(RawSum::StorageB);
        sums[RawSum::ResidualA as usize] = if fed[0] { residual_a } else { T::zero() };
        sums[RawSum::ResidualB as usize] = if fed[1] { residual_b } else { T::zero() };
        let begins_at = self.begins_at.take();
        Some(Block { sums, fed, time_square_s2, pressure_square_s2, volumes_m3, begins_at })
    }
}

#[cfg(test)]
mod tests {
    use super::super::clocks::PerChannel;
    use super::*;
    use std::vec::Vec;

    const STEP_S: f64 = 0.01;

    fn cylinder() -> Cylinder<f64> {
        Cylinder { dead_volume_a_m3: 5e-5, dead_volume_b_m3: 3e-5, ..Cylinder::paper() }
    }

    /// Everything is read, and changes at constant rates.
    fn steadily(k: u32) -> Row<f64> {
        let t_s = STEP_S * f64::from(k);
        let sample = Sample {
            x_m: 0.1 - 0.004 * t_s,
            pa_pa: 2e6 + 3e6 * t_s,
            pb_pa: 5e6 - 2e6 * t_s,
            qa_m3s: Some(1e-5 + 4e-5 * t_s),
            qb_m3s: Some(7e-5 - 3e-5 * t_s),
            force_n: None,
        };
        Row::read(if k == 0 { 0.0 } else { STEP_S }, &sample)
    }

    fn blocks(rows: impl Iterator<Item = Row<f64>>) -> Vec<Block<f64>> {
        let mut sums = BlockSums::new(&cylinder(), &Fluid::paper());
        rows.filter_map(|row| sums.push(&row)).collect()
    }

    fn assert_close(found: f64, expected: f64, what: &str) {
        assert!((found / expected - 1.0).abs() < 1e-3, "{what}: {found}, not {expected}");
    }

    /// The second block, 0.25 to 0.5 s, in closed form.
    #[test]
    fn sums_are_the_integrals_of_what_was_read() {
        const T: f64 = 0.25;
        let block = blocks((0..60).map(steadily))[1];
        let (cylinder, kappa) = (cylinder(), 1.0 / Fluid::<f64>::paper().bulk_modulus_pa);
        let (a, b) = (cylinder.area_a_m2, cylinder.area_b_m2);
        let volumes = |t_s: f64| {
            let x_m = 0.1 - 0.004 * t_s;
            [5e-5 + a * x_m, 3e-5 + b * (cylinder.stroke_m - x_m)]
        };
        let ([va, vb], travel) = (volumes(1.5 * T), -0.004 * T);
        let flown = [(1e-5 + 4e-5 * 1.5 * T) * T, (7e-5 - 3e-5 * 1.5 * T) * T];
        // In MPa and MPa/s; the load pressure is that of A less that of B, and below zero.
        let pressure = |at_0: f64, rate: f64| (at_0 + rate * T, rate);
        let [p_a, p_b, p_l] = [pressure(2.0, 3.0), pressure(5.0, -2.0), pressure(3.0, -5.0)];
        let integral = |(p, rate): (f64, f64)| p * T + rate * T * T / 2.0;
        let aged = |(p, rate): (f64, f64)| p * T * T / 2.0 + rate * T.powi(3) / 3.0;
        let root = |(p, rate): (f64, f64)| 1e3 * ((p + rate * T).powf(1.5) - p.powf(1.5)) / (1.5 * rate);
        let cases = [
            (RawSum::ResidualA, flown[0] - a * travel - kappa * va * 3e6 * T),
            (RawSum::ResidualB, flown[1] + b * travel + kappa * vb * 2e6 * T),
            (RawSum::Travel, travel),
            (RawSum::Way, -travel),
            (RawSum::StorageA, va * 3.0 * T),
            (RawSum::StorageB, -vb * 2.0 * T),
            (RawSum::PressureA, integral(p_a)),
            (RawSum::PressureB, integral(p_b)),
            (RawSum::Time, T),
            (RawSum::FlowChangeA, 4e-5 * T),
            (RawSum::FlowChangeB, -3e-5 * T),
            (RawSum::PressureChangeA, 3.0 * T),
            (RawSum::PressureChangeB, -2.0 * T),
            (RawSum::RootInternal, -root(p_l)),
            (RawSum::RootA, root(p_a)),
            (RawSum::RootB, root(p_b)),
            (RawSum::StorageAOfB, -va * 2.0 * T),
            (RawSum::StorageBOfA, vb * 3.0 * T),
            (RawSum::AgedPressureA, aged(p_a)),
            (RawSum::AgedPressureB, aged(p_b)),
            (RawSum::AgedTime, T * T / 2.0),
        ];
        assert_eq!(cases.len(), RAW_SUMS);
        for (raw, expected) in cases {
            assert_close(block.sums[raw as usize], expected, &std::format!("{raw:?}"));
        }
        for (found, expected) in block.volumes_m3.into_iter().zip(volumes(2.0 * T)) {
            assert_close(found, expected, "volume at the end");
        }
        for square_s2 in block.time_square_s2.into_iter().chain([block.pressure_square_s2]) {
            assert_close(square_s2, STEP_S * T, "Σ dt²");
        }
        assert!(block.begins_at.is_none());
    }

    /// Outside its stroke the piston sweeps nothing. The begin is known of the first block after a pause, and
    /// of no other.
    #[test]
    fn a_pause_begins_anew_with_its_own_volumes() {
        let rows = (0..100).map(|k| {
            let mut row = steadily(k);
            row.sample.x_m = if k < 50 { -1.0 } else { 9.0 };
            if k == 50 {
                row.dt_s = 0.0;
            }
            row
        });
        let cylinder = cylinder();
        let [whole_a, whole_b] =
            [cylinder.area_a_m2, cylinder.area_b_m2].map(|area| area * cylinder.stroke_m);
        let begins: Vec<_> = blocks(rows).iter().map(|block| block.begins_at).collect();
        assert_eq!(begins, [Some([5e-5, 3e-5 + whole_b]), Some([5e-5 + whole_a, 3e-5])]);
    }

    /// What a meter read before it fell silent, or after it came back, does not cover the block.
    #[test]
    fn a_flow_that_is_missing_for_a_part_of_a_block_is_not_fed() {
        for silent in [30..40, 40..55] {
            let without_a = blocks((0..100).map(|k| {
                let mut row = steadily(k);
                row.sample.qa_m3s = row.sample.qa_m3s.filter(|_| !silent.contains(&k));
                row
            }));
            let fed: Vec<_> = without_a.iter().map(|block| block.fed).collect();
            let after = if silent.end > 50 { [false, true] } else { [true; 2] };
            assert_eq!(fed, [[true; 2], [false, true], after], "{silent:?}");
            let residual = |raw: RawSum| without_a[1].sums[raw as usize];
            assert!(residual(RawSum::ResidualA) == 0.0 && residual(RawSum::ResidualB) != 0.0);
        }
    }

    /// Its noise is that of one reading over the time between two.
    #[test]
    fn a_meter_of_its_own_clock_has_the_noise_of_its_own_readings() {
        let rows = (0..60).map(|k| Row {
            own_step_s: PerChannel { qb: 5.0 * STEP_S, ..steadily(k).own_step_s },
            read: PerChannel { qb: k % 5 == 0, ..steadily(k).read },
            ..steadily(k)
        });
        let block = blocks(rows)[1];
        assert_close(block.time_square_s2[0], STEP_S * 0.25, "A");
        assert_close(block.time_square_s2[1], 5.0 * STEP_S * 0.25, "B");
    }

    /// Slow readings make a block of eight steps, quick ones of a quarter of a second.
    #[test]
    fn a_block_is_an_average() {
        for (step_s, steps) in [(0.1, 8.0), (0.001, 250.0)] {
            let block =
                blocks((0..600).map(|k| Row { dt_s: if k == 0 { 0.0 } else { step_s }, ..steadily(k) }))[1];
            assert_close(block.sums[RawSum::Time as usize], steps * step_s, "time");
        }
    }
}
