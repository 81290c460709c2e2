//! Proof by linking that the core cannot panic: the panic handler calls a function that does not exist, so
//! the linker fails as soon as one call into the panic machinery is left in the release code.
//!
//! Every input comes from a volatile read, so the optimiser can assume nothing about it.
#![no_std]
#![no_main]

use core::ptr::{read_volatile, write_volatile};

use pitchleak_core::{
    AlarmSettings, AlarmState, Butterworth, Cylinder, Effect, EffectSet, Estimates, Excitation, ExcitationSettings,
    Fluid, LeakDetector, LeakPressures, Linkage, LoadEstimator, Model, Signals, Momentum, PaperEstimator, PaperGains,
    PaperLaw, PerLeak, Real, Rls, RlsSettings, Sample, Sensors, Update, VALVE_COVARIANCES, VALVE_UNKNOWNS,
    ValveCalibration, ValveFilter, ValveNoise, ValveSample,
    continuity::Readings,
    effects::EffectConstants,
    emulator::{Emulator, EmulatorParams},
    force_imbalance_n,
    plant::{CylinderPlant, Drive},
    regressors,
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
    let rls = Rls::<T, N>::new(any(Cylinder::paper()), any(Fluid::paper()), &sensors, settings);
    let Ok(mut rls) = rls else { return keep(rls.is_ok()) };
    let mut detector = LeakDetector::new(any(AlarmSettings::default()));
    loop {
        let update: Update<T> = rls.update(any(T::lit(0.01)), &any_sample());
        keep(rls.update_readings(any(T::lit(0.01)), &any(Readings::default())));
        let found: Estimates<T> = rls.estimates();
        let changed: PerLeak<Option<AlarmState>> =
            detector.update(any(T::lit(0.25)), &found.mean_leaks_m3s);
        let excitation: Excitation<T> = rls.excitation(&any(ExcitationSettings::default())).bulk_modulus;
        keep((update, changed, excitation, found, rls.leak_coefficients()));
        keep((rls.pressure_biases_pa(), rls.leak_flows_m3s(&any(LeakPressures::default()))));
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

#[inline(never)]
fn paper_chain<T: Real>() {
    let gains =
        PaperGains::scaled(&any(Cylinder::paper()), &any(Fluid::paper()), any(T::one()), any(T::one()));
    let chain =
        PaperEstimator::new(any(Cylinder::paper()), any(Fluid::paper()), gains, any(T::one()), any(T::one()));
    if let Ok(mut chain) = chain {
        while any(true) {
            keep((chain.update(any(T::one()), &any_sample()), chain.leak_coefficients()));
        }
    }
}

#[inline(never)]
fn filter_and_linkage<T: Real>() {
    if let Ok(mut filter) = Butterworth::new(any(T::one()), any(T::lit(100.0))) {
        keep(filter.update(any(T::one())));
    }
    let linkage: Linkage<T> = any(Linkage::paper());
    keep((linkage.position_m(any(T::one())), linkage.pitch_rad(any(T::one())), linkage.check()));
    keep((linkage.torque_nm(any(T::one()), any(T::one())), linkage.force_n(any(T::one()), any(T::one()))));
}

#[inline(never)]
fn plant_and_emulator<T: Real>() {
    let model: Model<T> = any(Model::paper());
    let mut effects = EffectSet::default();
    for effect in Effect::ALL {
        keep(effects.set(any(*effect), any(T::one()), any(EffectConstants::default())));
    }
    let signals: Signals<T> = any(Signals::default());
    keep((effects.read(&signals), effects.correct(&signals), model.residual(&signals)));
    if let Ok(plant) = CylinderPlant::new(model) {
        let state = plant.state_at(any(T::one()), any(T::one()), any(T::one()), any(T::one()));
        let drive = any(Drive { qa_m3s: T::one(), qb_m3s: T::one(), force_n: T::one() });
        keep(plant.step(&state, any(T::one()), |_| drive));
    }
    let Ok(mut params) = EmulatorParams::for_model(model) else { return };
    params.pitch.plant.effects = effects;
    if let Ok(mut emulator) = Emulator::new(params, any(T::one()), any(T::one())) {
        while any(true) {
            keep(emulator.step(any(T::one()), any(T::one()), any(T::one())).is_ok());
            keep(emulator.reading());
        }
    }
}

#[inline(never)]
fn valve<T: Real>() {
    let one = T::one();
    let calibration = any(ValveCalibration {
        mean: [one; VALVE_UNKNOWNS],
        covariance: [one; VALVE_COVARIANCES],
        rated_flow_m3s: one,
        rated_drop_pa: one,
        tank_pa: one,
        hysteresis: one,
        null_leak: one,
        gain_drift: one,
        lap_drift: one,
        null_leak_drift: one,
    });
    let noise = any(ValveNoise { position_m: one, pressure_pa: one, spool: one, supply_pa: one });
    let filter = ValveFilter::new(&any(Cylinder::paper()), &any(Fluid::paper()), &calibration, &noise, any(one));
    let Ok(mut filter) = filter else { return keep(filter.is_ok()) };
    while any(true) {
        let sample = any(ValveSample { x_m: one, pa_pa: one, pb_pa: one, spool: one, ps_pa: one });
        keep((filter.update(any(one), &sample), filter.estimates()));
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
        paper_chain::<f32>();
        paper_chain::<f64>();
        filter_and_linkage::<f32>();
        filter_and_linkage::<f64>();
        plant_and_emulator::<f32>();
        plant_and_emulator::<f64>();
        valve::<f32>();
        valve::<f64>();
    }
}
