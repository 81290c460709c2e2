//! Exact traces: position and pressures are chosen as sums of sines, the flows then follow from
//! eq. (1) with analytic derivatives, so nothing is approximated.

use pitchleak_core::{Cylinder, Fluid, PerLeak, Sample};

/// Sum of sines about a mean.
#[derive(Clone, Debug)]
pub struct Multisine {
    /// The mean.
    pub mean: f64,
    /// Amplitude, frequency in Hz, phase in rad.
    pub lines: Vec<(f64, f64, f64)>,
}

impl Multisine {
    /// Value at time t, s.
    pub fn value(&self, t: f64) -> f64 {
        let tau = std::f64::consts::TAU;
        self.mean + self.lines.iter().map(|(a, f, p)| a * (tau * f * t + p).sin()).sum::<f64>()
    }

    /// Its slope, 1/s.
    pub fn slope(&self, t: f64) -> f64 {
        let tau = std::f64::consts::TAU;
        self.lines.iter().map(|(a, f, p)| a * tau * f * (tau * f * t + p).cos()).sum()
    }
}

/// A cylinder with leaks and its motion.
#[derive(Clone, Debug)]
pub struct Motion {
    /// The cylinder.
    pub cylinder: Cylinder<f64>,
    /// β, Pa.
    pub bulk_modulus_pa: f64,
    /// C_ip, C_epA, C_epB, m³/(s·Pa).
    pub leaks: PerLeak<f64>,
    /// Piston position, m.
    pub position_m: Multisine,
    /// P_A, Pa.
    pub pressure_a_pa: Multisine,
    /// P_B, Pa.
    pub pressure_b_pa: Multisine,
}

impl Motion {
    /// The paper's cylinder under wind-like motion and load.
    pub fn wind_like(leaks: PerLeak<f64>) -> Self {
        let lines = |size: f64, rows: &[(f64, f64, f64)]| {
            rows.iter().map(|(a, f, p)| (size * a, *f, *p)).collect::<Vec<_>>()
        };
        let slow = [(0.6, 0.07, 0.1), (0.3, 0.19, 1.0), (0.12, 0.43, 2.0)];
        let load_a = [(0.8, 0.05, 0.4), (0.5, 0.21, 2.2), (0.4, 0.34, 0.7), (0.2, 0.9, 1.9)];
        let load_b = [(0.5, 0.05, 3.0), (0.4, 0.11, 1.3), (0.4, 0.34, 3.9), (0.2, 0.9, 5.1)];
        Self {
            cylinder: Cylinder::paper(),
            bulk_modulus_pa: Fluid::paper().bulk_modulus_pa,
            leaks,
            position_m: Multisine { mean: 0.09, lines: lines(0.04, &slow) },
            pressure_a_pa: Multisine { mean: 5.2e6, lines: lines(1e6, &load_a) },
            pressure_b_pa: Multisine { mean: 4.1e6, lines: lines(1e6, &load_b) },
        }
    }

    /// The paper's cylinder with one slow sine for each signal.
    pub fn sines(leaks: PerLeak<f64>) -> Self {
        let sine = |mean, amplitude, rate_rad_s: f64, phase| Multisine {
            mean,
            lines: vec![(amplitude, rate_rad_s / std::f64::consts::TAU, phase)],
        };
        Self {
            cylinder: Cylinder::paper(),
            bulk_modulus_pa: Fluid::paper().bulk_modulus_pa,
            leaks,
            position_m: sine(0.1, 0.04, 0.9, 0.0),
            pressure_a_pa: sine(6e6, 1e6, 1.3, 0.0),
            pressure_b_pa: sine(4e6, 8e5, 0.7, 1.0),
        }
    }

    /// `seconds` of readings at 100 Hz.
    pub fn samples(&self, seconds: u32) -> Vec<Sample<f64>> {
        (0..100 * seconds).map(|k| self.sample(f64::from(k) * 0.01)).collect()
    }

    /// Noise-free reading at time t.
    pub fn sample(&self, t: f64) -> Sample<f64> {
        let (x, v) = (self.position_m.value(t), self.position_m.slope(t));
        let (pa, pb) = (self.pressure_a_pa.value(t), self.pressure_b_pa.value(t));
        let kappa = 1.0 / self.bulk_modulus_pa;
        let cross = self.leaks.internal * (pa - pb);
        let store_a = kappa * self.cylinder.volume_a_m3(x) * self.pressure_a_pa.slope(t);
        let store_b = kappa * self.cylinder.volume_b_m3(x) * self.pressure_b_pa.slope(t);
        let qa = store_a + self.cylinder.area_a_m2 * v + cross + self.leaks.external_a * pa;
        let qb = store_b - self.cylinder.area_b_m2 * v - cross + self.leaks.external_b * pb;
        Sample { x_m: x, pa_pa: pa, pb_pa: pb, qa_m3s: Some(qa), qb_m3s: Some(qb), force_n: None }
    }
}
