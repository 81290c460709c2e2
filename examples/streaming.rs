//! The streaming estimator as a firmware or gateway embeds it: nothing but `pitchleak_core`, which needs neither
//! std nor an allocator. Run with `cargo run --release --example streaming`.

use pitchleak_core::{
    AlarmSettings, Cylinder, Fluid, LPM_PER_M3S, LeakDetector, Rls, RlsError, RlsSettings, Sample, Sensors,
    Update,
};

/// Stands for the fieldbus: a cylinder whose piston seal lets 0.3 L/min through at 15 bar.
fn read_sensors(t_s: f32) -> Sample<f32> {
    let (pa, pb) = (5.5e6 + 1e6 * (1.3 * t_s).sin(), 4e6 + 8e5 * (0.7 * t_s).sin());
    let (travel, speed) = (0.03 * (0.9 * t_s).sin(), 0.027 * (0.9 * t_s).cos());
    let leak = 3.3e-12 * (pa - pb);
    let store_a = (1.26e-3 * (0.1 + travel)) / 0.8e9 * 1.3e6 * (1.3 * t_s).cos();
    let store_b = (0.94e-3 * (0.1 - travel)) / 0.8e9 * 5.6e5 * (0.7 * t_s).cos();
    let (qa, qb) = (1.26e-3 * speed + store_a + leak, -0.94e-3 * speed + store_b - leak);
    Sample { x_m: 0.1 + travel, pa_pa: pa, pb_pa: pb, qa_m3s: Some(qa), qb_m3s: Some(qb), force_n: None }
}

fn main() -> Result<(), RlsError> {
    let settings = RlsSettings::default();
    let mut rls = Rls::<f32, 4>::new(Cylinder::paper(), Fluid::paper(), &Sensors::paper(), settings)?;
    let mut detector = LeakDetector::new(AlarmSettings::default());
    for k in 0..3000_u16 {
        let t_s = f32::from(k) * 0.01;
        if let Update::Renewed { elapsed_s, .. } = rls.update(0.01, &read_sensors(t_s)) {
            let flows = rls.estimates().mean_leaks_m3s;
            if let Some(state) = detector.update(elapsed_s, &flows).internal {
                let internal = flows.internal.scaled(LPM_PER_M3S as f32);
                println!(
                    "{t_s:5.2} s: {state:?}, internal {:.3} ± {:.3} L/min",
                    internal.value, internal.std
                );
            }
        }
    }
    Ok(())
}
