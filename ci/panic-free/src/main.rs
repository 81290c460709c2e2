//! Proof by linking that the core cannot panic: the panic handler calls a function that does not exist, so
//! the linker fails as soon as one call into the panic machinery is left in the release code.
//!
//! Every input comes from a volatile read, so the optimiser can assume nothing about it.
#![no_std]
#![no_main]

use core::ptr::{read_volatile, write_volatile};

use pitchleak_core::{
    AlarmSettings, AlarmState, Cylinder, Excitation, ExcitationSettings, Fluid, LeakDetector, LoadEstimator,
    Momentum, PaperGains, PaperLaw, PerLeak, Real, Rls, RlsSettings, Sample, Sensors, Update,
    force_imbalance_n, regressors,
};

unsafe extern "C" {
    /// Never defined.
    fn the_core_can_panic() -> !;
}

#[panic_handler]
fn panic(_: &core::panic::PanicInfo) -> ! {
    unsafe { the_core_can_panic() }
}

/// Whatever the caller may pass.
fn any<V: Copy>(start: V) -> V {
    unsafe { read_volatile(&start) }
}

fn keep<V>(value: V) {
    let mut sink = core::mem::MaybeUninit::<V>::uninit();
    unsafe { write_volatile(sink.as_mut_ptr(), value) };
}

fn any_sample<T: Real>() -> Sample<T> {
    any(Sample {
        x_m: T::lit(0.1),
        pa_pa: T::lit(1e6),
        pb_pa: T::lit(1e6),
        qa_m3s: Some(T::lit(1e-5)),
        qb_m3s: None,
        force_n: None,
    })
}

#[inline(never)]
fn rls<T: Real, const N: usize>() {
    let sensors: Sensors<T> = any(Sensors::paper());
    let settings: RlsSettings<T> = any(RlsSettings::default());
    let mut rls = Rls::<T, N>::new(any(Cylinder::paper()), any(Fluid::paper()), &sensors, settings);
    let mut detector = LeakDetector::new(any(AlarmSettings::default()));
    loop {
        let update: Update = rls.update(any(T::lit(0.01)), &any_sample());
        let changed: PerLeak<Option<AlarmState>> =
            detector.update(any(T::lit(0.25)), &rls.mean_leak_flows_m3s());
        let excitation: Excitation<T> = rls.excitation(&any(ExcitationSettings::default())).bulk_modulus;
        keep((update, changed, excitation, rls.leak_coefficients(), rls.compressibility()));
        keep((rls.flow_offsets_m3s(), rls.gains(), rls.normalised_innovation()));
        if any(false) {
            break;
        }
    }
}

#[inline(never)]
fn law<T: Real>() {
    let cylinder: Cylinder<T> = any(Cylinder::paper());
    let fluid: Fluid<T> = any(Fluid::paper());
    let gains = PaperGains::scaled(&cylinder, &fluid, any(T::lit(10.0)), any(T::one()));
    let mut law = PaperLaw::new(&cylinder, &fluid, any(T::zero()));
    let mut momentum = Momentum::new(any(T::one()), any(T::one()));
    let mut load = LoadEstimator::new(any(T::one()));
    loop {
        let sample = any_sample::<T>();
        let dt = any(T::lit(0.01));
        let force = load.update(&cylinder, dt, &sample);
        let impulse = momentum.update(dt, force_imbalance_n(&cylinder, &sample, force), sample.x_m);
        if let Some(f) = regressors(&cylinder, &sample, impulse) {
            law.step(&gains, dt, sample.load_pressure_pa(), &f);
            keep(law.rate(&gains, sample.load_pressure_pa(), &f));
        }
        keep((law.leak_coefficients(), law.bulk_modulus_pa()));
        if any(false) {
            break;
        }
    }
}

#[unsafe(no_mangle)]
extern "C" fn _start() -> ! {
    loop {
        #[cfg(feature = "with-a-panic")]
        keep([1_u8, 2, 3][any(1_usize)]);
        rls::<f32, 4>();
        rls::<f32, 6>();
        rls::<f32, 9>();
        rls::<f64, 4>();
        rls::<f64, 6>();
        rls::<f64, 9>();
        law::<f32>();
        law::<f64>();
    }
}
