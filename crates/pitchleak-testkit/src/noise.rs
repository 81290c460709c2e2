//! White sensor noise.

use pitchleak_core::{Sample, Sensors};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

/// The stream of random numbers of a seed, the same on every machine.
pub fn seeded(seed: u64) -> ChaCha8Rng {
    ChaCha8Rng::seed_from_u64(seed)
}

/// Independent normal numbers of standard deviation one.
pub fn white_noise(seed: u64) -> impl Iterator<Item = f64> {
    StandardNormal.sample_iter(seeded(seed))
}

/// The paper's sensors with 3 σ = `share` of full scale.
pub fn sensors_of(share: f64) -> Sensors<f64> {
    let mut sensors = Sensors::paper();
    let Sensors { flow_a, flow_b, pressure, position, force } = &mut sensors;
    for spread in [flow_a, flow_b, pressure, position, force] {
        spread.noise_std *= share / 0.01;
    }
    sensors
}

/// The sample as the sensors read it: white noise on every channel but the force.
pub fn noisy(sample: &Sample<f64>, sensors: &Sensors<f64>, random: &mut ChaCha8Rng) -> Sample<f64> {
    let mut normal = |std: f64| std * <StandardNormal as Distribution<f64>>::sample(&StandardNormal, random);
    Sample {
        x_m: sample.x_m + normal(sensors.position.noise_std),
        pa_pa: sample.pa_pa + normal(sensors.pressure.noise_std),
        pb_pa: sample.pb_pa + normal(sensors.pressure.noise_std),
        qa_m3s: sample.qa_m3s.map(|q| q + normal(sensors.flow_a.noise_std)),
        qb_m3s: sample.qb_m3s.map(|q| q + normal(sensors.flow_b.noise_std)),
        force_n: sample.force_n,
    }
}
