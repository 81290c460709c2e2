use crate::rig::{Instrument, Instruments};
use pitchleak_core::{Sample, Sensors};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use serde::Serialize;

/// Constant offsets of the sensors, reading minus truth, SI.
#[derive(Clone, Copy, Debug, PartialEq, Default, Serialize)]
pub struct Biases {
    /// Force sensor, N.
    pub force_n: f64,
    /// Pressure sensor A, Pa.
    pub pa_pa: f64,
    /// Pressure sensor B, Pa.
    pub pb_pa: f64,
    /// Flow meter A, m³/s.
    pub qa_m3s: f64,
    /// Flow meter B, m³/s.
    pub qb_m3s: f64,
    /// Position sensor, m.
    pub x_m: f64,
}

impl Biases {
    /// Offsets drawn evenly from ± `share` of each sensor's full scale.
    pub fn drawn(instruments: &Instruments, share: f64, seed: u64) -> Self {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        // A stream of its own: the noise may be drawn from the same seed.
        random.set_stream(1);
        let mut within =
            |sheet: &Instrument| (2.0 * unit(&mut random) - 1.0) * share * sheet.full_scale + 0.0;
        Self {
            x_m: within(&instruments.position),
            pa_pa: within(&instruments.pressure),
            pb_pa: within(&instruments.pressure),
            qa_m3s: within(&instruments.flow_a),
            qb_m3s: within(&instruments.flow_b),
            force_n: within(&instruments.force),
        }
    }
}

/// A number in 0 <= u < 1.
pub(super) fn unit(random: &mut ChaCha8Rng) -> f64 {
    (random.next_u64() >> 11) as f64 * f64::EPSILON / 2.0
}

/// Sensors that show the truth plus a constant bias plus white noise.
///
/// The same seed gives the same readings on every machine: ChaCha8 numbers, made normal with `libm`.
#[derive(Clone, Debug)]
pub struct Sensing {
    noise: Sensors<f64>,
    biases: Biases,
    normal: Normal,
}

impl Sensing {
    /// Sensors with the white noise of `noise` (its biases and gains are not used) and the offsets
    /// `biases`, from `seed`.
    pub fn new(noise: Sensors<f64>, biases: Biases, seed: u64) -> Self {
        Self { noise, biases, normal: Normal::stream(seed, 0) }
    }

    /// One reading of `truth`. Every sensor draws its number each time, so that a channel that is
    /// missing does not shift the others' noise.
    pub fn read(&mut self, truth: &Sample<f64>) -> Sample<f64> {
        let Self { noise, biases, normal } = self;
        let mut shown = |value: f64, bias: f64, std: f64| value + bias + std * normal.draw();
        let x_m = shown(truth.x_m, biases.x_m, noise.position.noise_std);
        let pa_pa = shown(truth.pa_pa, biases.pa_pa, noise.pressure.noise_std);
        let pb_pa = shown(truth.pb_pa, biases.pb_pa, noise.pressure.noise_std);
        let qa = shown(0.0, biases.qa_m3s, noise.flow_a.noise_std);
        let qb = shown(0.0, biases.qb_m3s, noise.flow_b.noise_std);
        let force = shown(0.0, biases.force_n, noise.force.noise_std);
        Sample {
            x_m,
            pa_pa,
            pb_pa,
            qa_m3s: truth.qa_m3s.map(|value| value + qa),
            qb_m3s: truth.qb_m3s.map(|value| value + qb),
            force_n: truth.force_n.map(|value| value + force),
        }
    }
}

/// Normal random numbers by the transform of Box and Muller (1958).
#[derive(Clone, Debug)]
pub struct Normal {
    uniform: ChaCha8Rng,
    spare: Option<f64>,
}

impl Normal {
    /// The numbers of one of the streams that a seed has; the sensors' noise is stream 0.
    pub fn stream(seed: u64, stream: u64) -> Self {
        let mut uniform = ChaCha8Rng::seed_from_u64(seed);
        uniform.set_stream(stream);
        Self { uniform, spare: None }
    }

    /// A number in 0 < u <= 1.
    fn unit(&mut self) -> f64 {
        ((self.uniform.next_u64() >> 11) + 1) as f64 * f64::EPSILON / 2.0
    }

    /// The next number.
    pub fn draw(&mut self) -> f64 {
        if let Some(spare) = self.spare.take() {
            return spare;
        }
        let radius = (-2.0 * libm::log(self.unit())).sqrt();
        let angle = std::f64::consts::TAU * self.unit();
        self.spare = Some(radius * libm::sin(angle));
        radius * libm::cos(angle)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_normal() {
        let mut normal = Normal::stream(7, 0);
        let draws: Vec<f64> = (0..200_000).map(|_| normal.draw()).collect();
        let signals = |p: i32| draws.iter().map(|x| x.powi(p)).sum::<f64>() / draws.len() as f64;
        assert!(signals(1).abs() < 0.01 && (signals(2) - 1.0).abs() < 0.02);
        assert!(signals(3).abs() < 0.05 && (signals(4) - 3.0).abs() < 0.1);
        let lagged: f64 = draws.windows(2).map(|w| w[0] * w[1]).sum::<f64>() / draws.len() as f64;
        assert!(lagged.abs() < 0.01);
    }

    #[test]
    fn a_seed_gives_its_readings_and_a_missing_flow_shifts_none() {
        let truth =
            Sample { x_m: 0.1, pa_pa: 2e6, qa_m3s: Some(1e-5), qb_m3s: Some(2e-5), ..Sample::default() };
        let resting = Sample { qa_m3s: None, ..truth };
        let sensing = |seed| Sensing::new(Sensors::paper(), Biases { pa_pa: 1e5, ..Biases::default() }, seed);
        let (mut one, mut same, mut other) = (sensing(1), sensing(1), sensing(2));
        for _ in 0..9 {
            let (a, b, c) = (one.read(&truth), same.read(&resting), other.read(&truth));
            assert_eq!((a.x_m, a.pa_pa, a.qb_m3s), (b.x_m, b.pa_pa, b.qb_m3s));
            assert!(b.qa_m3s.is_none() && (a.x_m - c.x_m).abs() > 1e-12);
            assert!((a.pa_pa - 2.1e6).abs() < 5.0 * 16e6 * 0.01 / 3.0);
        }
    }
}
