//! The columns that explanations set free: what each does to both continuity equations, over the trace.

use super::readings::{Combination, Readings};
use crate::rig::Rig;
use pitchleak_core::PerLeak;
use pitchleak_core::continuity::{RAW_SUMS, RawSum};

/// A term of the continuity equations, linear in the raw sums.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Column {
    /// The left side: what flows in, moves the piston and is stored.
    LeftSide,
    /// Compressibility 1/β, as a share of the declared one.
    Compressibility,
    /// What the pressures only seem to press and do not, as their noise is no oil that is stored: share of it, negative.
    Unpressed,
    /// Zero of a flow meter, share of its full scale.
    ZeroA,
    /// The same of meter B.
    ZeroB,
    /// Gain of a flow meter, share of what it shows: g / (1 + g).
    GainA,
    /// The same of meter B.
    GainB,
    /// One gain of both.
    Gains,
    /// Lag of a flow meter, s.
    LagA,
    /// The same of meter B.
    LagB,
    /// One lag of both; of the position where negative.
    Lags,
    /// Dead volume, share of the chamber's swept volume.
    DeadVolumeA,
    /// The same of chamber B; also a stroke declared wrong.
    DeadVolumeB,
    /// By how much the piston area is larger than declared, share of its true size.
    AreaA,
    /// The same of chamber B.
    AreaB,
    /// Gain of the position sensor; what is too small counts as positive.
    PositionGain,
    /// The piston's travel as read, share of it: its gain by its own readings.
    Travel,
    /// Zero of the position sensor, share of the stroke.
    PositionZero,
    /// P_A past the piston: the gain of its sensor, where the internal leak is.
    ThroughSealA,
    /// P_B past the piston.
    ThroughSealB,
    /// Zero of P_A through the leaks found, share of full scale.
    PressureZeroA,
    /// The same of P_B.
    PressureZeroB,
    /// Gain of P_A, through the leaks found and the stored oil.
    PressureGainA,
    /// The same of P_B.
    PressureGainB,
    /// Leaks C P, share of the flow meters' full scale at the trace's mean pressures.
    LeakInternal,
    /// Out of chamber A.
    LeakA,
    /// Out of chamber B.
    LeakB,
    /// What leaks that open at a pressure let through less than C P, share of full scale.
    CrackingInternal,
    /// Out of chamber A.
    CrackingA,
    /// Out of chamber B.
    CrackingB,
    /// Leaks C √P, likewise.
    OrificeInternal,
    /// Out of chamber A.
    OrificeA,
    /// Out of chamber B.
    OrificeB,
    /// Leaks that are steady whatever the pressures show, share of full scale.
    SteadyInternal,
    /// Out of chamber A.
    SteadyA,
    /// Out of chamber B.
    SteadyB,
}

impl Column {
    /// Whether its noise is that of the flows alone, or for the most part.
    pub(super) fn is_of_flows(self) -> bool {
        use Column as C;
        matches!(self, C::LeftSide | C::GainA | C::GainB | C::Gains | C::LagA | C::LagB | C::Lags)
    }
}

/// How a column's share changes along the trace.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Course {
    /// Always there.
    Constant,
    /// From −1 at the begin to 1 at the end.
    Drift,
    /// From 1 at the begin to 0 at the end.
    FromBegin,
    /// From 0 at the begin to 1 at the end.
    ToEnd,
    /// From 0 at the begin to 1 at the end, by the square of time.
    Accelerating,
    /// Before this segment.
    Before(usize),
    /// From this segment on.
    Since(usize),
    /// In this segment alone.
    Within(usize),
    /// Until this segment, and in it falling to 0.
    Fading(usize),
}

/// A column by chamber: combinations of raw sums in the equation of A and of B.
pub(super) type PerChamber = [Combination; 2];

/// What turns columns into raw sums.
pub(super) struct Scales<'a> {
    pub rig: &'a Rig,
    pub readings: Readings,
    /// Mean pressures across the leaks, MPa, and their roots, √Pa.
    pub pressures_mpa: PerLeak<f64>,
    pub roots: PerLeak<f64>,
    /// Leaks found, m³/s at those pressures; none in a first pass.
    pub leaks_m3s: PerLeak<f64>,
}

const LEAST_MPA: f64 = 1e-3;

impl Scales<'_> {
    /// 1/β as declared, 1/MPa.
    pub fn compressibility(&self) -> f64 {
        1e6 / self.rig.fluid.bulk_modulus_pa
    }

    /// The larger flow meter's full scale, m³/s: the unit of leaks.
    pub fn full_scale_m3s(&self) -> f64 {
        self.rig.instruments.flow_a.full_scale.max(self.rig.instruments.flow_b.full_scale)
    }

    /// A column, and where it has one its moment in time.
    pub fn column(&self, column: Column) -> [PerChamber; 2] {
        use RawSum as R;
        let plain = |a: &[(R, f64)], b: &[(R, f64)]| [self.pair(a, b), [[0.0; RAW_SUMS]; 2]];
        let timed = |a: &[(R, f64)], b: &[(R, f64)]| {
            let aged =
                |terms: &[(R, f64)]| terms.iter().map(|(raw, by)| (aged(*raw), *by)).collect::<Vec<_>>();
            [self.pair(a, b), self.pair(&aged(a), &aged(b))]
        };
        let [area_a, area_b] = self.readings.area_m2;
        let kappa = self.compressibility();
        let instruments = &self.rig.instruments;
        let stroke = self.rig.cylinder.stroke_m;
        let [dead_a, dead_b] = [self.rig.cylinder.dead_volume_a_m3, self.rig.cylinder.dead_volume_b_m3];
        let flow = self.full_scale_m3s();
        let per_mpa = self.pressures_mpa.map(|p| flow / p.max(LEAST_MPA));
        let per_root = self.roots.map(|root| flow / root.max(1.0));
        let found = self.leaks_m3s.zip(self.pressures_mpa).map(|(leak, p)| leak / p.max(LEAST_MPA));
        let (through_a, through_b) = (found.internal + found.external_a, found.internal + found.external_b);
        let pressure_scale = 1e-6 * instruments.pressure.full_scale;
        // By the position the travel of a larger area would be noisier, and areas would be judged by another noise than gains:
        // the chamber's equation is written in the declared area instead, and all else is as much smaller.
        let flow_a = [(R::ResidualA, 1.0), (R::PressureChangeA, -kappa * dead_a)];
        let flow_b = [(R::ResidualB, 1.0), (R::PressureChangeB, -kappa * dead_b)];
        let past_piston = [(R::PressureA, -found.internal), (R::PressureB, found.internal)];
        match column {
            Column::LeftSide => plain(
                &[(R::ResidualA, 1.0), (R::Travel, -area_a), (R::StorageA, -kappa)],
                &[(R::ResidualB, 1.0), (R::Travel, area_b), (R::StorageB, -kappa)],
            ),
            Column::Compressibility | Column::Unpressed => {
                plain(&[(R::StorageA, kappa)], &[(R::StorageB, kappa)])
            }
            Column::ZeroA => timed(&[(R::Time, instruments.flow_a.full_scale)], &[]),
            Column::ZeroB => timed(&[], &[(R::Time, instruments.flow_b.full_scale)]),
            Column::GainA => plain(&[(R::ResidualA, 1.0)], &[]),
            Column::GainB => plain(&[], &[(R::ResidualB, 1.0)]),
            Column::Gains => plain(&[(R::ResidualA, 1.0)], &[(R::ResidualB, 1.0)]),
            Column::Travel => plain(&[(R::Travel, area_a)], &[(R::Travel, -area_b)]),
            Column::LagA => plain(&[(R::FlowChangeA, -1.0)], &[]),
            Column::LagB => plain(&[], &[(R::FlowChangeB, -1.0)]),
            Column::Lags => plain(&[(R::FlowChangeA, -1.0)], &[(R::FlowChangeB, -1.0)]),
            Column::DeadVolumeA => plain(&[(R::PressureChangeA, kappa * area_a * stroke)], &[]),
            Column::DeadVolumeB => plain(&[], &[(R::PressureChangeB, kappa * area_b * stroke)]),
            Column::AreaA => plain(&[flow_a, past_piston].concat(), &[]),
            Column::AreaB => plain(&[], &[flow_b, past_piston.map(|(raw, by)| (raw, -by))].concat()),
            // As of both areas; but V_B counts from the other end, which stays where it is.
            Column::PositionGain => {
                let from_end = (R::PressureChangeB, -kappa * area_b * stroke);
                plain(&flow_a, &[flow_b.as_slice(), &[from_end]].concat())
            }
            Column::PositionZero => plain(
                &[(R::PressureChangeA, kappa * area_a * stroke)],
                &[(R::PressureChangeB, -kappa * area_b * stroke)],
            ),
            Column::ThroughSealA => {
                let by = per_mpa.external_a;
                plain(&[(R::PressureA, by)], &[(R::PressureA, -by)])
            }
            Column::ThroughSealB => {
                let by = per_mpa.external_b;
                plain(&[(R::PressureB, by)], &[(R::PressureB, -by)])
            }
            Column::PressureZeroA => plain(
                &[(R::Time, -pressure_scale * through_a)],
                &[(R::Time, pressure_scale * found.internal)],
            ),
            Column::PressureZeroB => plain(
                &[(R::Time, pressure_scale * found.internal)],
                &[(R::Time, -pressure_scale * through_b)],
            ),
            Column::PressureGainA => {
                plain(&[(R::PressureA, -through_a), (R::StorageA, -kappa)], &[(R::PressureA, found.internal)])
            }
            Column::PressureGainB => {
                plain(&[(R::PressureB, found.internal)], &[(R::PressureB, -through_b), (R::StorageB, -kappa)])
            }
            Column::LeakInternal => {
                let by = per_mpa.internal;
                timed(&[(R::PressureA, by), (R::PressureB, -by)], &[(R::PressureA, -by), (R::PressureB, by)])
            }
            Column::LeakA => timed(&[(R::PressureA, per_mpa.external_a)], &[]),
            Column::LeakB => timed(&[], &[(R::PressureB, per_mpa.external_b)]),
            Column::CrackingInternal => plain(&[(R::Time, -flow)], &[(R::Time, flow)]),
            Column::CrackingA => plain(&[(R::Time, -flow)], &[]),
            Column::CrackingB => plain(&[], &[(R::Time, -flow)]),
            Column::OrificeInternal => {
                let by = per_root.internal;
                plain(&[(R::RootInternal, by)], &[(R::RootInternal, -by)])
            }
            Column::OrificeA => plain(&[(R::RootA, per_root.external_a)], &[]),
            Column::SteadyInternal => plain(&[(R::Time, flow)], &[(R::Time, -flow)]),
            Column::SteadyA => plain(&[(R::Time, flow)], &[]),
            Column::SteadyB => plain(&[], &[(R::Time, flow)]),
            Column::OrificeB => plain(&[], &[(R::RootB, per_root.external_b)]),
        }
    }

    fn pair(&self, a: &[(RawSum, f64)], b: &[(RawSum, f64)]) -> PerChamber {
        [a, b].map(|terms| {
            let mut sum = [0.0; RAW_SUMS];
            for (raw, by) in terms {
                for (place, coefficient) in sum.iter_mut().zip(self.readings.of(*raw)) {
                    *place += by * coefficient;
                }
            }
            sum
        })
    }
}

fn aged(raw: RawSum) -> RawSum {
    match raw {
        RawSum::PressureA => RawSum::AgedPressureA,
        RawSum::PressureB => RawSum::AgedPressureB,
        _ => RawSum::AgedTime,
    }
}

impl Course {
    /// Shares of the column and of its moment in time, in a segment that begins at `begin_s` and lasts `time_s`, of a trace of
    /// `total_s`.
    pub(super) fn shares(self, segment: usize, [begin_s, time_s]: [f64; 2], total_s: f64) -> [f64; 2] {
        let within = |there: bool| [if there { 1.0 } else { 0.0 }, 0.0];
        match self {
            Self::Constant => [1.0, 0.0],
            Self::Drift => [2.0 * begin_s / total_s - 1.0, 2.0 / total_s],
            Self::FromBegin => [1.0 - begin_s / total_s, -1.0 / total_s],
            Self::ToEnd => [begin_s / total_s, 1.0 / total_s],
            // Within a segment by its secant.
            Self::Accelerating => {
                [(begin_s / total_s).powi(2), (2.0 * begin_s + time_s) / (total_s * total_s)]
            }
            Self::Before(border) => within(segment < border),
            Self::Since(border) => within(segment >= border),
            Self::Within(only) => within(segment == only),
            Self::Fading(last) if segment == last => [1.0, -1.0 / time_s],
            Self::Fading(last) => within(segment < last),
        }
    }
}
