//! Products of the raw sums, segment by segment, and what the sensors' noise adds to them in closed form.

use super::still::settle;
use crate::rig::Rig;
use pitchleak_core::continuity::{
    CHANNELS, COLUMNS, ContinuityStatistic, EQUATIONS, RawSum, Segment, column as place_of,
};
use pitchleak_core::{ATMOSPHERE_PA, PerLeak, Sensors};

/// Segments that the engine keeps of a trace.
pub const SEGMENTS: usize = 12;
/// The statistic as the engine keeps it.
pub type Statistic = ContinuityStatistic<f64, SEGMENTS>;

/// Readings that a flow's value at a block's end is the mean of.
const END_READINGS: f64 = 7.0;

const LEAST_TIME_S: f64 = 1e-9;
/// Readings that scatter by less of their sheet's noise are computed: they count as noise of that size, and tell no unit.
pub(super) const LEAST_SCATTER: f64 = 0.01;

/// Of a whole trace.
pub(super) struct RawProducts {
    pub segments: Vec<SegmentProducts>,
    pub total_s: f64,
}

/// Of one segment, by equation.
pub(super) struct SegmentProducts {
    pub gram: [Vec<f64>; EQUATIONS],
    pub noise: [Vec<f64>; EQUATIONS],
    /// The same of noise as the readings scatter, where that is not as declared.
    pub scattered: [Vec<f64>; EQUATIONS],
    /// The same of the smaller of both, sensor by sensor.
    pub quiet: [Vec<f64>; EQUATIONS],
    pub rows: [f64; EQUATIONS],
    pub begin_s: f64,
    pub time_s: f64,
    /// Mean size of the pressures across the leaks, Pa.
    pub pressures_pa: PerLeak<f64>,
}

impl SegmentProducts {
    /// When it begins, and how long it lasts, s.
    pub fn span_s(&self) -> [f64; 2] {
        [self.begin_s, self.time_s.max(LEAST_TIME_S)]
    }
}

impl RawProducts {
    pub fn of(statistic: &Statistic, rig: &Rig) -> Self {
        let noise_of = NoiseOf::declared(rig);
        let scattered = noise_of.scattered(&statistic.scatter());
        let quiet = noise_of.quieter(&scattered);
        let mut total_s = 0.0;
        let mut segments = Vec::new();
        for segment in statistic.segments() {
            segments.push(SegmentProducts {
                gram: [0, 1].map(|equation| dense(|i, j| segment.product(equation, i, j))),
                noise: [0, 1].map(|equation| noise_of.products(segment, equation)),
                scattered: [0, 1].map(|equation| scattered.products(segment, equation)),
                quiet: [0, 1].map(|equation| quiet.products(segment, equation)),
                rows: [0, 1].map(|equation| segment.rows(equation)),
                begin_s: total_s,
                time_s: segment.time_s(),
                pressures_pa: segment.mean_pressures_pa(),
            });
            total_s += segment.time_s();
        }
        settle(&mut segments);
        Self { segments, total_s }
    }

    /// With so many times fewer independent blocks by equation.
    pub fn worth(mut self, inflation: [f64; EQUATIONS]) -> Self {
        for segment in &mut self.segments {
            for (equation, inflation) in inflation.into_iter().enumerate() {
                segment.gram[equation].iter_mut().for_each(|product| *product /= inflation);
                segment.noise[equation].iter_mut().for_each(|product| *product /= inflation);
                segment.scattered[equation].iter_mut().for_each(|product| *product /= inflation);
                segment.quiet[equation].iter_mut().for_each(|product| *product /= inflation);
                segment.rows[equation] /= inflation;
            }
        }
        self
    }

    /// All as one segment, for columns that do not change along the trace.
    pub fn whole(&self) -> Self {
        let sum = |of: &dyn Fn(&SegmentProducts) -> &Vec<f64>| {
            let mut sum = vec![0.0; COLUMNS * COLUMNS];
            for segment in &self.segments {
                sum.iter_mut().zip(of(segment)).for_each(|(sum, value)| *sum += value);
            }
            sum
        };
        let whole = SegmentProducts {
            gram: [0, 1].map(|equation| sum(&|segment| &segment.gram[equation])),
            noise: [0, 1].map(|equation| sum(&|segment| &segment.noise[equation])),
            scattered: [0, 1].map(|equation| sum(&|segment| &segment.scattered[equation])),
            quiet: [0, 1].map(|equation| sum(&|segment| &segment.quiet[equation])),
            rows: [0, 1].map(|equation| self.segments.iter().map(|segment| segment.rows[equation]).sum()),
            begin_s: 0.0,
            time_s: self.total_s,
            pressures_pa: self.mean_pressures_pa(0),
        };
        Self { segments: vec![whole], total_s: self.total_s }
    }

    /// Mean size of the pressures across the leaks from a segment on, Pa.
    pub fn mean_pressures_pa(&self, from: usize) -> PerLeak<f64> {
        let later = || self.segments.iter().skip(from);
        let time_s: f64 = later().map(|segment| segment.time_s).sum();
        PerLeak::from_fn(|leak| {
            later().map(|segment| segment.time_s * segment.pressures_pa[leak]).sum::<f64>()
                / time_s.max(LEAST_TIME_S)
        })
    }

    /// How many times larger the coefficient of one flow is from each segment on than through all of them.
    pub fn coefficients_since(&self) -> [PerLeak<f64>; SEGMENTS] {
        let whole = self.mean_pressures_pa(0);
        std::array::from_fn(|from| {
            let since = if from < self.segments.len() { self.mean_pressures_pa(from) } else { whole };
            whole.zip(since).map(|(whole, since)| whole.max(LEAST_PA) / since.max(LEAST_PA))
        })
    }
}

/// The atmosphere: below it a chamber has run empty, and no leak has a pressure.
const LEAST_PA: f64 = ATMOSPHERE_PA;

fn dense(entry: impl Fn(usize, usize) -> f64) -> Vec<f64> {
    let mut matrix = vec![0.0; COLUMNS * COLUMNS];
    for i in 0..COLUMNS {
        for j in 0..=i {
            let value = entry(i, j);
            matrix[i * COLUMNS + j] = value;
            matrix[j * COLUMNS + i] = value;
        }
    }
    matrix
}

/// Sensors' noise in the raw sums.
struct NoiseOf {
    flow: [f64; 2],
    pressure_mpa: [f64; 2],
    position: f64,
    area_m2: [f64; 2],
    compressibility: f64,
}

/// A reading at a block's end in a raw sum: by how much, and times which volume (none, V_A, V_B).
type AtEnd = (RawSum, f64, usize);

impl NoiseOf {
    fn declared(rig: &Rig) -> Self {
        let Sensors { flow_a, flow_b, pressure, position, .. } = rig.sensors();
        let cylinder = &rig.cylinder;
        Self {
            flow: [flow_a.noise_std, flow_b.noise_std],
            pressure_mpa: [1e-6 * pressure.noise_std; 2],
            position: position.noise_std,
            area_m2: [cylinder.area_a_m2, cylinder.area_b_m2],
            compressibility: 1e6 / rig.fluid.bulk_modulus_pa,
        }
    }

    /// With the channels' own scatter (x, P_A, P_B, Q_A, Q_B) where that is known: readings that have none are computed,
    /// and count as a hundredth of the sheet's.
    fn scattered(&self, scatter: &[Option<f64>; CHANNELS]) -> Self {
        let [x, pa, pb, qa, qb] = *scatter;
        let of = |found: Option<f64>, declared: f64| {
            found.map_or(declared, |found| found.max(LEAST_SCATTER * declared))
        };
        let mpa = |std_pa: Option<f64>| std_pa.map(|std_pa| 1e-6 * std_pa);
        Self {
            flow: [of(qa, self.flow[0]), of(qb, self.flow[1])],
            pressure_mpa: [of(mpa(pa), self.pressure_mpa[0]), of(mpa(pb), self.pressure_mpa[1])],
            position: of(x, self.position),
            ..*self
        }
    }

    /// The smaller of both, sensor by sensor.
    fn quieter(&self, other: &Self) -> Self {
        let least = |one: [f64; 2], other: [f64; 2]| [one[0].min(other[0]), one[1].min(other[1])];
        Self {
            flow: least(self.flow, other.flow),
            pressure_mpa: least(self.pressure_mpa, other.pressure_mpa),
            position: self.position.min(other.position),
            ..*self
        }
    }

    /// What noise adds to the products of raw columns in a segment.
    fn products(&self, segment: &Segment<f64>, equation: usize) -> Vec<f64> {
        use RawSum as R;
        let mut out = vec![0.0; COLUMNS * COLUMNS];
        let [flow_a, flow_b, pressure] = segment.integral_noise(equation);
        let integrals = [
            (R::ResidualA, self.flow[0], flow_a),
            (R::ResidualB, self.flow[1], flow_b),
            (R::PressureA, self.pressure_mpa[0], pressure),
            (R::PressureB, self.pressure_mpa[1], pressure),
        ];
        for (raw, std, noise) in integrals {
            add_pair(&mut out, raw, raw, noise, std * std);
        }
        let [area_a, area_b] = self.area_m2;
        let kappa = self.compressibility;
        let ends: [(f64, Vec<AtEnd>); 6] = [
            // Out and in alike, so that it goes with nothing else.
            (self.position, vec![(R::Way, 1.0, 0)]),
            (self.position, vec![(R::Travel, 1.0, 0), (R::ResidualA, -area_a, 0), (R::ResidualB, area_b, 0)]),
            (
                self.pressure_mpa[0],
                vec![
                    (R::PressureChangeA, 1.0, 0),
                    (R::StorageA, 1.0, 1),
                    (R::StorageBOfA, 1.0, 2),
                    (R::ResidualA, -kappa, 1),
                ],
            ),
            (
                self.pressure_mpa[1],
                vec![
                    (R::PressureChangeB, 1.0, 0),
                    (R::StorageB, 1.0, 2),
                    (R::StorageAOfB, 1.0, 1),
                    (R::ResidualB, -kappa, 2),
                ],
            ),
            (self.flow[0] / END_READINGS.sqrt(), vec![(R::FlowChangeA, 1.0, 0)]),
            (self.flow[1] / END_READINGS.sqrt(), vec![(R::FlowChangeB, 1.0, 0)]),
        ];
        let noise = segment.end_noise(equation);
        for (std, sums) in &ends {
            for (one, of_one, volume) in sums {
                for (other, of_other, other_volume) in sums {
                    let power = volume_power(*volume, *other_volume);
                    add_pair(&mut out, *one, *other, noise[power], std * std * of_one * of_other);
                }
            }
        }
        out
    }
}

/// Place of a product of two volumes among 1, V_A, V_B, V_A², V_A V_B, V_B².
fn volume_power(one: usize, other: usize) -> usize {
    match (one.min(other), one.max(other)) {
        (0, power) => power,
        (1, 1) => 3,
        (1, _) => 4,
        _ => 5,
    }
}

fn add_pair(out: &mut [f64], one: RawSum, other: RawSum, [aa, ab, bb]: [f64; 3], variance: f64) {
    for (chamber, other_chamber, value) in [(0, 0, aa), (0, 1, ab), (1, 0, ab), (1, 1, bb)] {
        let (i, j) = (place_of(one, chamber), place_of(other, other_chamber));
        out[i * COLUMNS + j] += variance * value;
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use pitchleak_core::{Cylinder, Sample};
    use pitchleak_testkit::{noisy, seeded};

    pub fn rig() -> Rig {
        let mut rig = Rig::paper();
        rig.cylinder = Cylinder { dead_volume_a_m3: 5e-5, dead_volume_b_m3: 3e-5, ..rig.cylinder };
        rig
    }

    /// Of a piston at rest for half a minute, as noisy sensors read it, with these pressures.
    pub fn at_rest(rig: &Rig, seed: u64, pressures_pa: impl Fn(f64) -> [f64; 2]) -> RawProducts {
        let sensors = rig.sensors();
        let mut statistic = Box::new(Statistic::new(&rig.cylinder, &rig.fluid, &sensors));
        let mut random = seeded(seed);
        for k in 0..3000 {
            let [pa_pa, pb_pa] = pressures_pa(0.01 * f64::from(k));
            let flow = Some(0.0);
            let still = Sample { x_m: 0.07, pa_pa, pb_pa, qa_m3s: flow, qb_m3s: flow, force_n: None };
            statistic.push(if k == 0 { 0.0 } else { 0.01 }, &noisy(&still, &sensors, &mut random));
        }
        statistic.close();
        RawProducts::of(&statistic, rig)
    }

    /// At rest all changes are noise: their products are what is foretold of it, declared or by the readings'
    /// scatter.
    #[test]
    fn products_of_nothing_but_noise_are_foretold() {
        use RawSum as R;
        let rig = rig();
        let of_noise = [
            R::ResidualA,
            R::ResidualB,
            R::Travel,
            R::StorageA,
            R::StorageB,
            R::PressureChangeA,
            R::PressureChangeB,
            R::StorageAOfB,
            R::StorageBOfA,
        ];
        let flow_changes = [R::FlowChangeA, R::FlowChangeB];
        let wholes: Vec<SegmentProducts> =
            (0..20).map(|seed| at_rest(&rig, seed, |_| [5e6, 3e6]).whole().segments.remove(0)).collect();
        for equation in 0..EQUATIONS {
            let sum = |of: &dyn Fn(&SegmentProducts) -> &Vec<f64>, i: usize, j: usize| {
                wholes.iter().map(|own| of(own)[i * COLUMNS + j]).sum::<f64>()
            };
            for raws in [of_noise.as_slice(), flow_changes.as_slice()] {
                let places = || raws.iter().flat_map(|raw| [0, 1].map(|chamber| place_of(*raw, chamber)));
                for (i, j) in places().flat_map(|i| places().map(move |j| (i, j))) {
                    let noise = |i: usize, j: usize| sum(&|own| &own.noise[equation], i, j);
                    let size = (noise(i, i) * noise(j, j)).sqrt();
                    let found = [
                        noise(i, j),
                        sum(&|own| &own.scattered[equation], i, j),
                        sum(&|own| &own.quiet[equation], i, j),
                    ];
                    let gram = sum(&|own| &own.gram[equation], i, j);
                    for found in found {
                        assert!(
                            (gram - found).abs() < 0.12 * size,
                            "{equation} {i} {j}: {gram} {found} {size}"
                        );
                    }
                }
            }
        }
    }

    /// Fewer independent blocks are worth as many times less, all of them.
    #[test]
    fn products_are_worth_their_blocks() {
        let whole = at_rest(&rig(), 1, |_| [5e6, 3e6]).whole();
        let sums = |products: &RawProducts, equation: usize| {
            let own = &products.segments[0];
            let all = [&own.gram, &own.noise, &own.scattered, &own.quiet];
            all.map(|products| products[equation].iter().map(|product| product.abs()).sum::<f64>())
        };
        let before = [0, 1].map(|equation| (sums(&whole, equation), whole.segments[0].rows[equation]));
        let worth = whole.worth([2.0, 4.0]);
        for (equation, times) in [(0, 2.0), (1, 4.0)] {
            let (products, rows) = before[equation];
            assert!((rows / worth.segments[0].rows[equation] - times).abs() < 1e-12);
            for (before, after) in products.into_iter().zip(sums(&worth, equation)) {
                assert!((before / after - times).abs() < 1e-9);
            }
        }
    }
}
