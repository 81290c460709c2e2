//! What the readings of a mistaken wiring, unit or rig truly are: linear maps of the raw sums.

use pitchleak_core::continuity::{RAW_SUMS, RawSum};
use pitchleak_core::{ATMOSPHERE_PA, Cylinder, PerLeak};

/// Which readings a mistake concerns.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Of {
    /// Q_A.
    FlowA,
    /// Q_B.
    FlowB,
    /// Q_A and Q_B.
    Flows,
    /// P_A.
    PressureA,
    /// P_B.
    PressureB,
    /// P_A and P_B.
    Pressures,
    /// x.
    Position,
}

/// A mistake of wiring, sign, unit or geometry, which no small error is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Mistake {
    /// Q_A and Q_B are exchanged.
    FlowsExchanged,
    /// P_A and P_B are exchanged.
    PressuresExchanged,
    /// Both.
    ChambersExchanged,
    /// A flow has the other sign.
    Sign(Of),
    /// Exchanged flows of the other sign: they are counted out of the other chamber.
    FlowsExchangedAndTurned,
    /// x counts from the B end.
    OtherEnd,
    /// Only the size of a flow was recorded. No linear map says so: it is [told](crate::told) beside the statistic.
    LostSign(Of),
    /// Readings are so many times too large.
    Factor(Of, f64),
    /// Times are so many times too large.
    Clock(f64),
    /// Pressures are absolute.
    Absolute(Of),
    /// The declared areas are exchanged.
    AreasExchanged,
    /// The declared area of chamber A (0) or B (1) is so many times too large.
    Area(usize, f64),
}

/// A linear combination of raw sums.
pub(super) type Combination = [f64; RAW_SUMS];

/// What each raw sum would be without the mistake, as combinations of those recorded. In the places of the residuals
/// stand the integrals of the flows.
#[derive(Clone, Debug)]
pub(super) struct Readings {
    sums: [Combination; RAW_SUMS],
    /// True areas, m².
    pub area_m2: [f64; 2],
}

const FLOW_A: [RawSum; 2] = [RawSum::ResidualA, RawSum::FlowChangeA];
const FLOW_B: [RawSum; 2] = [RawSum::ResidualB, RawSum::FlowChangeB];
const PRESSURE_A: [RawSum; 5] = [
    RawSum::PressureA,
    RawSum::AgedPressureA,
    RawSum::PressureChangeA,
    RawSum::StorageA,
    RawSum::StorageBOfA,
];
const PRESSURE_B: [RawSum; 5] = [
    RawSum::PressureB,
    RawSum::AgedPressureB,
    RawSum::PressureChangeB,
    RawSum::StorageAOfB,
    RawSum::StorageB,
];
/// Integrals over time, and over time squared.
const OVER_TIME: [RawSum; 8] = [
    RawSum::ResidualA,
    RawSum::ResidualB,
    RawSum::PressureA,
    RawSum::PressureB,
    RawSum::Time,
    RawSum::RootInternal,
    RawSum::RootA,
    RawSum::RootB,
];
const OVER_AGE: [RawSum; 3] = [RawSum::AgedPressureA, RawSum::AgedPressureB, RawSum::AgedTime];
/// Volume times change of pressure, and that change: of V_A, then of V_B.
const STORAGE: [[(RawSum, RawSum); 2]; 2] = [
    [(RawSum::StorageA, RawSum::PressureChangeA), (RawSum::StorageAOfB, RawSum::PressureChangeB)],
    [(RawSum::StorageBOfA, RawSum::PressureChangeA), (RawSum::StorageB, RawSum::PressureChangeB)],
];

impl Readings {
    /// As recorded; κ₀ in 1/MPa.
    pub fn declared(cylinder: &Cylinder<f64>, compressibility: f64) -> Self {
        let mut sums = [[0.0; RAW_SUMS]; RAW_SUMS];
        for (raw, own) in sums.iter_mut().enumerate() {
            own[raw] = 1.0;
        }
        let (a, b) = (RawSum::ResidualA as usize, RawSum::ResidualB as usize);
        sums[a][RawSum::Travel as usize] = cylinder.area_a_m2;
        sums[a][RawSum::StorageA as usize] = compressibility;
        sums[b][RawSum::Travel as usize] = -cylinder.area_b_m2;
        sums[b][RawSum::StorageB as usize] = compressibility;
        Self { sums, area_m2: [cylinder.area_a_m2, cylinder.area_b_m2] }
    }

    /// With a mistake undone.
    pub fn mended(mut self, mistake: Mistake, cylinder: &Cylinder<f64>) -> Self {
        let dead_m3 = [cylinder.dead_volume_a_m3, cylinder.dead_volume_b_m3];
        match mistake {
            Mistake::FlowsExchanged => self.exchange(&FLOW_A, &FLOW_B),
            Mistake::PressuresExchanged => self.exchange_pressures(),
            Mistake::ChambersExchanged => {
                self.exchange(&FLOW_A, &FLOW_B);
                self.exchange_pressures();
            }
            Mistake::FlowsExchangedAndTurned => {
                self.exchange(&FLOW_A, &FLOW_B);
                self.scale(Of::Flows, -1.0, cylinder);
            }
            Mistake::Sign(of) => self.scale(of, -1.0, cylinder),
            Mistake::LostSign(_) => {}
            Mistake::Factor(of, factor) => self.scale(of, 1.0 / factor, cylinder),
            Mistake::Clock(factor) => {
                self.multiply(&OVER_TIME, 1.0 / factor);
                self.multiply(&OVER_AGE, 1.0 / (factor * factor));
            }
            Mistake::Absolute(of) => self.subtract_atmosphere(of),
            Mistake::OtherEnd => self.turn_position(dead_m3),
            Mistake::AreasExchanged => {
                let [a, b] = self.area_m2;
                self.set_area(0, b, dead_m3);
                self.set_area(1, a, dead_m3);
            }
            Mistake::Area(side, factor) => self.set_area(side, self.area_m2[side] / factor, dead_m3),
        }
        self
    }

    /// A sum as it would be.
    pub fn of(&self, raw: RawSum) -> &Combination {
        &self.sums[raw as usize]
    }

    fn exchange(&mut self, one: &[RawSum], other: &[RawSum]) {
        for (a, b) in one.iter().zip(other) {
            self.sums.swap(*a as usize, *b as usize);
        }
    }

    fn exchange_pressures(&mut self) {
        // In the order of PRESSURE_A and PRESSURE_B storages of one volume stand opposite each other only where crossed.
        use RawSum as R;
        self.exchange(
            &[R::PressureA, R::AgedPressureA, R::PressureChangeA, R::RootA, R::StorageA, R::StorageBOfA],
            &[R::PressureB, R::AgedPressureB, R::PressureChangeB, R::RootB, R::StorageAOfB, R::StorageB],
        );
        self.multiply(&[R::RootInternal], -1.0);
    }

    fn multiply(&mut self, which: &[RawSum], by: f64) {
        for raw in which {
            for coefficient in &mut self.sums[*raw as usize] {
                *coefficient *= by;
            }
        }
    }

    fn scale(&mut self, of: Of, by: f64, cylinder: &Cylinder<f64>) {
        match of {
            Of::FlowA => self.multiply(&FLOW_A, by),
            Of::FlowB => self.multiply(&FLOW_B, by),
            Of::Flows => {
                self.multiply(&FLOW_A, by);
                self.multiply(&FLOW_B, by);
            }
            Of::PressureA => self.multiply(&PRESSURE_A, by),
            Of::PressureB => self.multiply(&PRESSURE_B, by),
            Of::Pressures => {
                self.multiply(&PRESSURE_A, by);
                self.multiply(&PRESSURE_B, by);
            }
            Of::Position => {
                self.multiply(&[RawSum::Travel], by);
                self.multiply(&[RawSum::Way], by.abs());
                let Cylinder { dead_volume_a_m3, dead_volume_b_m3, area_b_m2, stroke_m, .. } = *cylinder;
                self.scale_volume(0, by, dead_volume_a_m3);
                // Chamber B has what of the stroke is left.
                self.scale_volume(1, by, dead_volume_b_m3 + area_b_m2 * stroke_m);
            }
        }
    }

    /// What a volume has beside `fixed_m3` is so many times what was recorded.
    fn scale_volume(&mut self, side: usize, by: f64, fixed_m3: f64) {
        for (storage, change) in STORAGE[side] {
            let change = self.sums[change as usize];
            for (coefficient, of_change) in self.sums[storage as usize].iter_mut().zip(change) {
                *coefficient = by * (*coefficient - fixed_m3 * of_change) + fixed_m3 * of_change;
            }
        }
    }

    fn set_area(&mut self, side: usize, area_m2: f64, dead_m3: [f64; 2]) {
        self.scale_volume(side, area_m2 / self.area_m2[side], dead_m3[side]);
        self.area_m2[side] = area_m2;
    }

    /// x = L − what was recorded: the swept volumes are each other's, by the areas.
    fn turn_position(&mut self, dead_m3: [f64; 2]) {
        self.multiply(&[RawSum::Travel], -1.0);
        let [area_a, area_b] = self.area_m2;
        for ((of_a, change), (of_b, _)) in STORAGE[0].into_iter().zip(STORAGE[1]) {
            let (a, b) = (self.sums[of_a as usize], self.sums[of_b as usize]);
            let change = self.sums[change as usize];
            for raw in 0..RAW_SUMS {
                let (swept_a, swept_b) =
                    (a[raw] - dead_m3[0] * change[raw], b[raw] - dead_m3[1] * change[raw]);
                self.sums[of_a as usize][raw] = swept_b * area_a / area_b + dead_m3[0] * change[raw];
                self.sums[of_b as usize][raw] = swept_a * area_b / area_a + dead_m3[1] * change[raw];
            }
        }
    }

    fn subtract_atmosphere(&mut self, of: Of) {
        let atmosphere_mpa = ATMOSPHERE_PA * 1e-6;
        let mut subtract = |pressure: RawSum, aged: RawSum| {
            self.sums[pressure as usize][RawSum::Time as usize] -= atmosphere_mpa;
            self.sums[aged as usize][RawSum::AgedTime as usize] -= atmosphere_mpa;
        };
        if matches!(of, Of::PressureA | Of::Pressures) {
            subtract(RawSum::PressureA, RawSum::AgedPressureA);
        }
        if matches!(of, Of::PressureB | Of::Pressures) {
            subtract(RawSum::PressureB, RawSum::AgedPressureB);
        }
    }
}

impl Mistake {
    /// ln by which mending multiplies the density of both flows, given position and pressures.
    pub(super) fn ln_jacobian(self) -> f64 {
        match self {
            Self::Factor(Of::Flows, factor) | Self::Clock(factor) => -2.0 * factor.ln(),
            Self::Factor(Of::FlowA | Of::FlowB, factor) => -factor.ln(),
            _ => 0.0,
        }
    }

    /// Mean pressures across the leaks without the mistake; an internal one only where both factors are known.
    pub(super) fn mended_pressures(self, read: PerLeak<f64>) -> PerLeak<f64> {
        let PerLeak { internal, external_a, external_b } = read;
        match self {
            Self::PressuresExchanged | Self::ChambersExchanged => {
                PerLeak { internal, external_a: external_b, external_b: external_a }
            }
            Self::Factor(Of::Pressures, factor) => read.map(|pressure| pressure / factor),
            Self::Factor(Of::PressureA, factor) => PerLeak { external_a: external_a / factor, ..read },
            Self::Factor(Of::PressureB, factor) => PerLeak { external_b: external_b / factor, ..read },
            _ => read,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::{dot, sums};
    use super::*;
    use pitchleak_core::{Fluid, Sample};

    const STEP_S: f64 = 0.04;

    fn truly(k: u32) -> Sample<f64> {
        let t_s = STEP_S * f64::from(k);
        Sample {
            x_m: 0.05 + 0.01 * t_s,
            pa_pa: 4e6 + 2e6 * t_s,
            pb_pa: 7e6 - 1e6 * t_s,
            qa_m3s: Some(3e-5 + 2e-5 * t_s),
            qb_m3s: Some(1e-5 - 5e-5 * t_s),
            force_n: None,
        }
    }

    /// What is read, and the cylinder as declared, where the mistake was made.
    fn mistaken(mistake: Mistake, truth: Sample<f64>, cylinder: &mut Cylinder<f64>) -> Sample<f64> {
        let Sample { x_m, pa_pa, pb_pa, qa_m3s, qb_m3s, .. } = truth;
        let flows =
            |a: f64, b: f64| Sample { qa_m3s: qa_m3s.map(|q| a * q), qb_m3s: qb_m3s.map(|q| b * q), ..truth };
        let turned = |sample: Sample<f64>| Sample { qa_m3s: sample.qb_m3s, qb_m3s: sample.qa_m3s, ..sample };
        let more = |a: f64, b: f64| Sample {
            pa_pa: pa_pa + a * ATMOSPHERE_PA,
            pb_pa: pb_pa + b * ATMOSPHERE_PA,
            ..truth
        };
        match mistake {
            Mistake::FlowsExchanged => turned(truth),
            Mistake::PressuresExchanged => Sample { pa_pa: pb_pa, pb_pa: pa_pa, ..truth },
            Mistake::ChambersExchanged => turned(Sample { pa_pa: pb_pa, pb_pa: pa_pa, ..truth }),
            Mistake::FlowsExchangedAndTurned => turned(flows(-1.0, -1.0)),
            Mistake::Sign(Of::FlowA) | Mistake::Factor(Of::FlowA, -1.0) => flows(-1.0, 1.0),
            Mistake::Sign(Of::FlowB) => flows(1.0, -1.0),
            Mistake::Sign(_) => flows(-1.0, -1.0),
            Mistake::OtherEnd => Sample { x_m: cylinder.stroke_m - x_m, ..truth },
            Mistake::Factor(Of::FlowA, by) => flows(by, 1.0),
            Mistake::Factor(Of::FlowB, by) => flows(1.0, by),
            Mistake::Factor(Of::Flows, by) => flows(by, by),
            Mistake::Factor(Of::PressureA, by) => Sample { pa_pa: by * pa_pa, ..truth },
            Mistake::Factor(Of::PressureB, by) => Sample { pb_pa: by * pb_pa, ..truth },
            Mistake::Factor(Of::Pressures, by) => Sample { pa_pa: by * pa_pa, pb_pa: by * pb_pa, ..truth },
            Mistake::Factor(Of::Position, by) => Sample { x_m: by * x_m, ..truth },
            Mistake::Absolute(Of::PressureA) => more(1.0, 0.0),
            Mistake::Absolute(Of::PressureB) => more(0.0, 1.0),
            Mistake::Absolute(_) => more(1.0, 1.0),
            Mistake::AreasExchanged => {
                (cylinder.area_a_m2, cylinder.area_b_m2) = (cylinder.area_b_m2, cylinder.area_a_m2);
                truth
            }
            Mistake::Area(side, by) => {
                *(if side == 0 { &mut cylinder.area_a_m2 } else { &mut cylinder.area_b_m2 }) *= by;
                truth
            }
            Mistake::LostSign(_) | Mistake::Clock(_) => truth,
        }
    }

    /// Of every reading that is mistaken, mended, the sums are those of the truth; but for the roots of other
    /// pressures, of which no linear map tells.
    #[test]
    fn mended_readings_have_the_sums_of_the_true_ones() {
        use Mistake as M;
        let true_cylinder = Cylinder { dead_volume_a_m3: 5e-5, dead_volume_b_m3: 3e-5, ..Cylinder::paper() };
        let compressibility = 1e6 / Fluid::<f64>::paper().bulk_modulus_pa;
        let factors =
            [Of::FlowA, Of::FlowB, Of::Flows, Of::PressureA, Of::PressureB, Of::Pressures, Of::Position];
        let others = [
            M::FlowsExchanged,
            M::PressuresExchanged,
            M::ChambersExchanged,
            M::FlowsExchangedAndTurned,
            M::Sign(Of::FlowA),
            M::Sign(Of::FlowB),
            M::Sign(Of::Flows),
            M::OtherEnd,
            M::Clock(1.2),
            M::Absolute(Of::PressureA),
            M::Absolute(Of::PressureB),
            M::Absolute(Of::Pressures),
            M::AreasExchanged,
            M::Area(0, 1.3),
            M::Area(1, 0.6),
        ];
        for mistake in factors.map(|of| M::Factor(of, 1.5)).into_iter().chain(others) {
            let mut cylinder = true_cylinder;
            mistaken(mistake, truly(0), &mut cylinder);
            let step_s = if let M::Clock(factor) = mistake { factor * STEP_S } else { STEP_S };
            let wrong = sums(&cylinder, step_s, |k| mistaken(mistake, truly(k), &mut cylinder.clone()));
            let mended = Readings::declared(&cylinder, compressibility).mended(mistake, &cylinder);
            let right = sums(&true_cylinder, STEP_S, truly);
            let declared = Readings::declared(&true_cylinder, compressibility);
            assert!((mended.area_m2[0] / declared.area_m2[0] - 1.0).abs() < 1e-12);
            assert!((mended.area_m2[1] / declared.area_m2[1] - 1.0).abs() < 1e-12);
            for place in 0..RAW_SUMS {
                let is_root = (RawSum::RootInternal as usize..=RawSum::RootB as usize).contains(&place);
                let of_pressures = [Of::PressureA, Of::PressureB, Of::Pressures];
                if is_root
                    && matches!(mistake, M::Factor(of, _) | M::Absolute(of) if of_pressures.contains(&of))
                {
                    continue;
                }
                let (found, truth) = (dot(&mended.sums[place], &wrong), dot(&declared.sums[place], &right));
                assert!((found / truth - 1.0).abs() < 1e-9, "{mistake:?} {place}: {found}, not {truth}");
            }
        }
    }

    /// Flows that are mended by a factor are as much denser; a clock mends both.
    #[test]
    fn mending_scales_the_density_of_flows() {
        let ln_2 = std::f64::consts::LN_2;
        for (mistake, expected) in [
            (Mistake::Factor(Of::FlowA, 2.0), -ln_2),
            (Mistake::Factor(Of::FlowB, 0.5), ln_2),
            (Mistake::Factor(Of::Flows, 2.0), -2.0 * ln_2),
            (Mistake::Clock(2.0), -2.0 * ln_2),
            (Mistake::Factor(Of::Pressures, 2.0), 0.0),
            (Mistake::Sign(Of::FlowA), 0.0),
        ] {
            assert!((mistake.ln_jacobian() - expected).abs() < 1e-12, "{mistake:?}");
        }
    }

    #[test]
    fn mended_pressures_are_those_across_the_leaks() {
        let read = PerLeak { internal: 2.0, external_a: 6.0, external_b: 4.0 };
        let turned = PerLeak { external_a: 4.0, external_b: 6.0, ..read };
        for (mistake, expected) in [
            (Mistake::PressuresExchanged, turned),
            (Mistake::ChambersExchanged, turned),
            (Mistake::Factor(Of::Pressures, 2.0), read.map(|pressure| 0.5 * pressure)),
            (Mistake::Factor(Of::PressureA, 2.0), PerLeak { external_a: 3.0, ..read }),
            (Mistake::Factor(Of::PressureB, 2.0), PerLeak { external_b: 2.0, ..read }),
            (Mistake::Clock(2.0), read),
        ] {
            assert_eq!(mistake.mended_pressures(read), expected, "{mistake:?}");
        }
    }
}
