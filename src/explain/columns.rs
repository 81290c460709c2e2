//! The columns that explanations set free: what each does to both continuity equations, over the trace.

use super::raw_products::SEGMENTS;
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
    /// By how much more meter A reads of what drives the piston out than of what comes back, half of it, share of what it shows.
    DirectionA,
    /// The same of meter B.
    DirectionB,
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
            Column::DirectionA => plain(&[(R::Way, area_a)], &[]),
            Column::DirectionB => plain(&[], &[(R::Way, area_b)]),
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
    /// How many there are: a border may lie behind the last segment.
    pub(super) const COUNT: usize = 5 + 4 * Self::BORDERS;
    const BORDERS: usize = SEGMENTS + 1;

    /// A number of its own, below their count.
    pub(super) fn index(self) -> usize {
        let of = |kind: usize, border: usize| 5 + kind * Self::BORDERS + border.min(SEGMENTS);
        match self {
            Self::Constant => 0,
            Self::Drift => 1,
            Self::FromBegin => 2,
            Self::ToEnd => 3,
            Self::Accelerating => 4,
            Self::Before(border) => of(0, border),
            Self::Since(border) => of(1, border),
            Self::Within(segment) => of(2, segment),
            Self::Fading(segment) => of(3, segment),
        }
    }

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

#[cfg(test)]
mod tests {
    use super::super::testing::{dot, sums};
    use super::*;
    use pitchleak_core::{Cylinder, Sample};

    const STEP_S: f64 = 0.01;
    /// Begin of the block that is looked at.
    const BEGIN_S: f64 = 0.25;
    /// Rates of the motion, m/s and Pa/s, all constant: so the integrals are exact.
    const V: f64 = 0.02;
    const PA_RATE: f64 = 3e6;
    const PB_RATE: f64 = -2e6;
    /// Size of the errors.
    const E: f64 = 1e-5;

    fn rig() -> Rig {
        let mut rig = Rig::paper();
        rig.cylinder = Cylinder { dead_volume_a_m3: 5e-5, dead_volume_b_m3: 3e-5, ..rig.cylinder };
        rig.instruments.flow_b.full_scale *= 0.5;
        rig
    }

    fn scales(rig: &Rig, leaks_m3s: PerLeak<f64>) -> Scales<'_> {
        let readings = Readings::declared(&rig.cylinder, 1e6 / rig.fluid.bulk_modulus_pa);
        let pressures_mpa = PerLeak { internal: 2.0, external_a: 5.0, external_b: 3.0 };
        let roots = PerLeak { internal: 1e3, external_a: 2e3, external_b: 3e3 };
        Scales { rig, readings, pressures_mpa, roots, leaks_m3s }
    }

    /// What a cylinder that leaks reads, as declared.
    fn honest(scales: &Scales<'_>, t_s: f64) -> Sample<f64> {
        let Rig { cylinder, fluid, .. } = scales.rig;
        let (x_m, pa_pa, pb_pa) = (0.08 + V * t_s, 6e6 + PA_RATE * t_s, 3e6 + PB_RATE * t_s);
        let leak = scales.leaks_m3s.zip(scales.pressures_mpa).map(|(leak, mpa)| leak / (1e6 * mpa));
        let past = leak.internal * (pa_pa - pb_pa);
        let stored_a = cylinder.volume_a_m3(x_m) * PA_RATE / fluid.bulk_modulus_pa;
        let stored_b = cylinder.volume_b_m3(x_m) * PB_RATE / fluid.bulk_modulus_pa;
        let qa = cylinder.area_a_m2 * V + stored_a + past + leak.external_a * pa_pa;
        let qb = -cylinder.area_b_m2 * V + stored_b - past + leak.external_b * pb_pa;
        Sample { x_m, pa_pa, pb_pa, qa_m3s: Some(qa), qb_m3s: Some(qb), force_n: None }
    }

    fn flows(sample: Sample<f64>, a: f64, b: f64) -> Sample<f64> {
        Sample { qa_m3s: sample.qa_m3s.map(|q| q + a), qb_m3s: sample.qb_m3s.map(|q| q + b), ..sample }
    }

    /// The reading of a rig that is not as declared, or whose leaks are not those found, by so much of this.
    fn erring(column: Column, scales: &Scales<'_>, t_s: f64) -> Sample<f64> {
        use Column as C;
        let Rig { cylinder: own, fluid, instruments, .. } = scales.rig;
        let honest = |t_s: f64| honest(scales, t_s);
        let now = honest(t_s);
        let (qa, qb) = (now.qa_m3s.expect("read"), now.qb_m3s.expect("read"));
        let (kappa, flow, stroke) = (1.0 / fluid.bulk_modulus_pa, scales.full_scale_m3s(), own.stroke_m);
        let pl_pa = now.pa_pa - now.pb_pa;
        let per = scales.pressures_mpa.map(|mpa| flow / (1e6 * mpa));
        let root = |pressure_pa: f64, mean: f64| E * flow * pressure_pa.sqrt() / mean;
        let both = |a: f64, b: f64| flows(now, E * a, E * b);
        let late = |a: f64, b: f64| {
            let (a, b) = (honest(t_s - a), honest(t_s - b));
            Sample { qa_m3s: a.qa_m3s, qb_m3s: b.qb_m3s, ..now }
        };
        let (zero_pa, swept_a, swept_b) =
            (instruments.pressure.full_scale, kappa * own.area_a_m2 * stroke, kappa * own.area_b_m2 * stroke);
        match column {
            C::LeftSide => now,
            C::Compressibility | C::Unpressed => {
                both(kappa * own.volume_a_m3(now.x_m) * PA_RATE, kappa * own.volume_b_m3(now.x_m) * PB_RATE)
            }
            C::ZeroA => both(instruments.flow_a.full_scale, 0.0),
            C::ZeroB => both(0.0, instruments.flow_b.full_scale),
            C::GainA => both(qa, 0.0),
            C::GainB => both(0.0, qb),
            C::Gains => both(qa, qb),
            C::DirectionA => both(own.area_a_m2 * V.abs(), 0.0),
            C::DirectionB => both(0.0, own.area_b_m2 * V.abs()),
            C::LagA => late(E, 0.0),
            C::LagB => late(0.0, E),
            C::Lags => late(E, E),
            C::DeadVolumeA => both(swept_a * PA_RATE, 0.0),
            C::DeadVolumeB => both(0.0, swept_b * PB_RATE),
            C::AreaA => both(own.area_a_m2 * (V + kappa * now.x_m * PA_RATE), 0.0),
            C::AreaB => both(0.0, own.area_b_m2 * (-V + kappa * (stroke - now.x_m) * PB_RATE)),
            C::PositionGain | C::Travel => Sample { x_m: now.x_m / (1.0 + E), ..now },
            C::PositionZero => Sample { x_m: now.x_m - E * stroke, ..now },
            C::ThroughSealA => both(per.external_a * now.pa_pa, -per.external_a * now.pa_pa),
            C::ThroughSealB => both(per.external_b * now.pb_pa, -per.external_b * now.pb_pa),
            C::PressureZeroA => Sample { pa_pa: now.pa_pa + E * zero_pa, ..now },
            C::PressureZeroB => Sample { pb_pa: now.pb_pa + E * zero_pa, ..now },
            C::PressureGainA => Sample { pa_pa: now.pa_pa * (1.0 + E), ..now },
            C::PressureGainB => Sample { pb_pa: now.pb_pa * (1.0 + E), ..now },
            C::LeakInternal => both(per.internal * pl_pa, -per.internal * pl_pa),
            C::LeakA => both(per.external_a * now.pa_pa, 0.0),
            C::LeakB => both(0.0, per.external_b * now.pb_pa),
            C::CrackingInternal => both(-flow, flow),
            C::CrackingA => both(-flow, 0.0),
            C::CrackingB => both(0.0, -flow),
            C::OrificeInternal => {
                let past = root(pl_pa, scales.roots.internal);
                flows(now, past, -past)
            }
            C::OrificeA => flows(now, root(now.pa_pa, scales.roots.external_a), 0.0),
            C::OrificeB => flows(now, 0.0, root(now.pb_pa, scales.roots.external_b)),
            C::SteadyInternal => both(flow, -flow),
            C::SteadyA => both(flow, 0.0),
            C::SteadyB => both(0.0, flow),
        }
    }

    const LEAKS: [Column; 3] = [Column::LeakInternal, Column::LeakA, Column::LeakB];

    /// What the left sides of both chambers hold beside the leaks found.
    fn left_over(scales: &Scales<'_>, sums: &Combination) -> [f64; 2] {
        let of = |column: Column| scales.column(column)[0].map(|chamber| dot(&chamber, sums));
        let PerLeak { internal, external_a, external_b } = scales.leaks_m3s;
        let found = LEAKS.into_iter().zip([internal, external_a, external_b]);
        found.fold(of(Column::LeftSide), |[a, b], (leak, size_m3s)| {
            let [of_a, of_b] = of(leak).map(|column| size_m3s / scales.full_scale_m3s() * column);
            [a - of_a, b - of_b]
        })
    }

    fn assert_is(found: [f64; 2], expected: [f64; 2], share: f64, what: &str) {
        let size = expected[0].abs().max(expected[1].abs());
        let is_close = found
            .iter()
            .zip(expected)
            .all(|(found, expected)| (found - expected).abs() <= share * size + 1e-16);
        assert!(is_close, "{what}: {found:?}, not {expected:?}");
    }

    #[test]
    fn each_course_has_a_number_of_its_own() {
        let at = |of: fn(usize) -> Course| (0..=SEGMENTS).map(of);
        let steady =
            [Course::Constant, Course::Drift, Course::FromBegin, Course::ToEnd, Course::Accelerating];
        let all = steady.into_iter().chain(at(Course::Before)).chain(at(Course::Since));
        let all = all.chain(at(Course::Within)).chain(at(Course::Fading)).map(Course::index);
        assert!(all.eq(0..Course::COUNT));
    }

    /// An explanation's column is what its error puts into both left sides, to first order, beside leaks that
    /// were found and without any.
    #[test]
    fn a_column_is_what_its_error_leaves_of_the_left_side() {
        use Column as C;
        let rig = rig();
        let none = PerLeak { internal: 0.0, external_a: 0.0, external_b: 0.0 };
        let past_piston = PerLeak { internal: 3e-6, ..none };
        for leaks_m3s in [none, past_piston, PerLeak { external_a: 2e-6, external_b: 1e-6, ..past_piston }] {
            let scales = scales(&rig, leaks_m3s);
            let of_block =
                |column: C| sums(&rig.cylinder, STEP_S, |k| erring(column, &scales, STEP_S * f64::from(k)));
            assert_is(left_over(&scales, &of_block(C::LeftSide)), [0.0; 2], 0.0, "none");
            for column in ALL {
                let sums = of_block(column);
                let expected = scales.column(column)[0].map(|chamber| E * dot(&chamber, &sums));
                // What a leak makes of an area that is wrong is left to the leak, what the volumes make of a
                // gain to a zero.
                let share = match column {
                    C::Travel => 0.02,
                    C::PositionGain if leaks_m3s != none => continue,
                    C::AreaA | C::AreaB if leaks_m3s.external_a > 0.0 => continue,
                    _ => 1e-3,
                };
                assert_is(left_over(&scales, &sums), expected, share, &format!("{column:?}"));
            }
        }
    }

    /// Where a column has a moment, its error may grow with time.
    #[test]
    fn a_moment_is_what_grows_from_the_block_on() {
        let rig = rig();
        let scales = scales(&rig, PerLeak { internal: 3e-6, external_a: 2e-6, external_b: 1e-6 });
        for column in LEAKS.into_iter().chain([Column::ZeroA, Column::ZeroB]) {
            let sums = sums(&rig.cylinder, STEP_S, |k| {
                let t_s = STEP_S * f64::from(k);
                let (now, off) = (honest(&scales, t_s), erring(column, &scales, t_s));
                let grown = |off: Option<f64>, now: Option<f64>| {
                    (t_s - BEGIN_S) * (off.unwrap_or(0.0) - now.unwrap_or(0.0))
                };
                flows(now, grown(off.qa_m3s, now.qa_m3s), grown(off.qb_m3s, now.qb_m3s))
            });
            let expected = scales.column(column)[1].map(|chamber| E * dot(&chamber, &sums));
            assert!(expected.iter().any(|chamber| chamber.abs() > 0.0));
            assert_is(left_over(&scales, &sums), expected, 1e-3, &format!("{column:?}"));
        }
        let [_, moment] = scales.column(Column::GainA);
        assert!(moment.into_iter().flatten().all(|entry| entry == 0.0));
    }

    const ALL: [Column; 37] = [
        Column::Compressibility,
        Column::Unpressed,
        Column::ZeroA,
        Column::ZeroB,
        Column::GainA,
        Column::GainB,
        Column::Gains,
        Column::DirectionA,
        Column::DirectionB,
        Column::LagA,
        Column::LagB,
        Column::Lags,
        Column::DeadVolumeA,
        Column::DeadVolumeB,
        Column::AreaA,
        Column::AreaB,
        Column::PositionGain,
        Column::Travel,
        Column::PositionZero,
        Column::ThroughSealA,
        Column::ThroughSealB,
        Column::PressureZeroA,
        Column::PressureZeroB,
        Column::PressureGainA,
        Column::PressureGainB,
        Column::LeakInternal,
        Column::LeakA,
        Column::LeakB,
        Column::CrackingInternal,
        Column::CrackingA,
        Column::CrackingB,
        Column::OrificeInternal,
        Column::OrificeA,
        Column::OrificeB,
        Column::SteadyInternal,
        Column::SteadyA,
        Column::SteadyB,
    ];

    /// What a course is at a moment t: its share of the column, and t from the segment's begin on times that
    /// of the moment.
    #[test]
    fn courses_go_along_the_trace() {
        // Of a trace of 20 s, the third segment, from 8 to 12 s.
        let at = |course: Course, t_s: f64| {
            let [share, moment] = course.shares(2, [8.0, 4.0], 20.0);
            share + moment * (t_s - 8.0)
        };
        let cases = [
            (Course::Constant, 1.0, 1.0),
            (Course::Drift, -0.2, 0.2),
            (Course::FromBegin, 0.6, 0.4),
            (Course::ToEnd, 0.4, 0.6),
            (Course::Accelerating, 0.16, 0.36),
            (Course::Before(2), 0.0, 0.0),
            (Course::Before(3), 1.0, 1.0),
            (Course::Since(2), 1.0, 1.0),
            (Course::Since(3), 0.0, 0.0),
            (Course::Within(2), 1.0, 1.0),
            (Course::Within(1), 0.0, 0.0),
            (Course::Fading(2), 1.0, 0.0),
            (Course::Fading(1), 0.0, 0.0),
            (Course::Fading(3), 1.0, 1.0),
        ];
        for (course, begin, end) in cases {
            let found = [at(course, 8.0), at(course, 12.0)];
            assert_is(found, [begin, end], 1e-12, &format!("{course:?}"));
        }
    }
}
