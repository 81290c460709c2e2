//! The examples as C and C++ programs: the same bits as Rust.

#![allow(clippy::unwrap_used)]

use pitchleak_core::{
    AlarmSettings, Cylinder, Fluid, LeakDetector, PerLeak, Rls, RlsSettings, Sample, SensorSpread, Sensors,
    Update, VALVE_COVARIANCES, VALVE_UNKNOWNS, ValveCalibration, ValveFilter, ValveNoise, ValveSample,
    ValveUpdate,
};
use pitchleak_testkit::Motion;
use pitchleak_testkit::valve::ValveCylinder;
use std::fmt::Write as _;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

const STRICT: [&str; 4] = ["-Wall", "-Wextra", "-Werror", "-pedantic"];
const LPM: f32 = 1e-3 / 60.0;

fn here() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// Runs a program that must succeed; gives what it prints.
fn run(command: &mut Command) -> String {
    let output = command.stderr(Stdio::inherit()).output().unwrap();
    assert!(output.status.success(), "{command:?}");
    String::from_utf8(output.stdout).unwrap()
}

/// Compiles an example against the library that was built beside this test.
fn compile(example: &str, compiler: &str, arguments: &[&str]) -> PathBuf {
    let library = std::env::current_exe().unwrap().with_file_name("libpitchleak_c.a");
    let program = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("{example}-{compiler}"));
    let mut command = Command::new(compiler);
    command.args(arguments).args(STRICT).arg("-I").arg(here().join("include"));
    // Of whoever builds: `ci/sanitizers` has some.
    command.args(std::env::var("CFLAGS").unwrap_or_default().split_whitespace());
    command.arg(here().join("examples").join(example).with_extension("c")).args(["-x", "none"]).arg(library);
    run(command.args(["-lpthread", "-ldl", "-lm", "-o"]).arg(&program));
    program
}

/// Half a minute in which chamber B's meter rests for a while, and a pause.
fn samples() -> Vec<(f32, Sample<f32>)> {
    let motion = Motion::wind_like(PerLeak { internal: 1e-11, external_a: 3e-12, external_b: 0.0 });
    let rounded = |k: usize, s: &Sample<f64>| Sample {
        x_m: s.x_m as f32,
        pa_pa: s.pa_pa as f32,
        pb_pa: s.pb_pa as f32,
        qa_m3s: s.qa_m3s.map(|q| q as f32),
        qb_m3s: s.qb_m3s.map(|q| q as f32).filter(|_| !(1000..1200).contains(&k)),
        force_n: None,
    };
    let dt_s = |k: usize| if k == 2000 { 3.0 } else { 0.01 };
    motion.samples(30).iter().enumerate().map(|(k, sample)| (dt_s(k), rounded(k, sample))).collect()
}

fn rows() -> String {
    let mut text = String::new();
    for (dt_s, Sample { x_m, pa_pa, pb_pa, qa_m3s, qb_m3s, .. }) in samples() {
        let [qa, qb] = [qa_m3s, qb_m3s].map(|flow| flow.unwrap_or(f32::NAN));
        writeln!(text, "{dt_s} {x_m} {pa_pa} {pb_pa} {qa:e} {qb:e}").unwrap();
    }
    text.replace("NaN", "nan")
}

/// What the example prints, from Rust.
fn expected() -> Vec<([f32; 6], bool)> {
    let cylinder = Cylinder {
        area_a_m2: 12.6e-4,
        area_b_m2: 9.4e-4,
        stroke_m: 0.2,
        moving_mass_kg: 20.0,
        dead_volume_a_m3: 50e-6,
        dead_volume_b_m3: 50e-6,
    };
    let fluid = Fluid { bulk_modulus_pa: 0.8e9, bulk_modulus_std_pa: 0.2e9 };
    let noise = |noise_std: f32| SensorSpread { noise_std, ..SensorSpread::default() };
    let flow = noise(0.0667 * LPM);
    let sensors = Sensors {
        flow_a: flow,
        flow_b: flow,
        pressure: noise(53e3),
        position: noise(0.667e-3),
        force: noise(0.0),
    };
    let mut rls = Rls::<f32, 4>::new(cylinder, fluid, &sensors, RlsSettings::default()).unwrap();
    let threshold = 0.1 * LPM;
    let threshold_m3s = PerLeak { internal: threshold, external_a: threshold, external_b: threshold };
    let mut detector = LeakDetector::new(AlarmSettings { threshold_m3s, ..AlarmSettings::default() });
    let mut told = Vec::new();
    for (dt_s, sample) in samples() {
        if let Update::Renewed { elapsed_s, .. } = rls.update_waiting(dt_s, &sample) {
            detector.update(elapsed_s, &rls.mean_leaks_m3s());
            let PerLeak { internal: i, external_a: a, external_b: b } = rls.estimates().mean_leaks_m3s;
            told.push(([i.value, i.std, a.value, a.std, b.value, b.std], detector.active().internal));
        }
    }
    told
}

/// A valve as it is, known as well as a calibration knows one, which begins to leak out of A.
fn valve() -> (ValveCalibration<f32>, Vec<(f32, ValveSample<f32>)>) {
    let cylinder = ValveCylinder::drawn(3).leaking(1, 0.5);
    let (mut mean, mut covariance) = ([0.0; VALVE_UNKNOWNS], [0.0; VALVE_COVARIANCES]);
    mean[3] = (0.8e9 / cylinder.bulk_pa) as f32;
    let of = cylinder.valve;
    let edges = of.gains.iter().chain(&of.laps).chain([&of.rounding, &of.saturation]);
    mean[4..].iter_mut().zip(edges).for_each(|(mean, own)| *mean = *own as f32);
    mean[16..].iter_mut().zip(of.clearances_lpm).for_each(|(mean, own)| *mean = own as f32);
    (0..VALVE_UNKNOWNS).for_each(|row| covariance[row * (row + 3) / 2] = 1e-6);
    let calibration = ValveCalibration {
        mean,
        covariance,
        rated_flow_m3s: 4.0 * LPM,
        rated_drop_pa: 35e5,
        tank_pa: 2e5,
        hysteresis: 0.003,
        null_leak: 0.02,
        gain_drift: 0.03,
        lap_drift: 0.001,
        null_leak_drift: 0.1,
    };
    let text = ValveCylinder { leaks_from_s: 20.0, ..cylinder }.trace(80.0, 100.0, 3e-3);
    let row = |line: &str| {
        let cells: Vec<f32> = line.split(',').filter_map(|cell| cell.parse().ok()).collect();
        let [_, x_mm, pa, pb, spool, ps] = cells.try_into().unwrap();
        let sample = ValveSample {
            x_m: 1e-3 * x_mm,
            pa_pa: 1e5 * pa,
            pb_pa: 1e5 * pb,
            spool: 1e-2 * spool,
            ps_pa: 1e5 * ps,
        };
        (0.01, sample)
    };
    (calibration, text.lines().skip(1).map(row).collect())
}

fn valve_rows() -> String {
    let (calibration, samples) = valve();
    let mut text = String::new();
    for number in calibration.mean.iter().chain(&calibration.covariance) {
        writeln!(text, "{number:e}").unwrap();
    }
    for (dt_s, ValveSample { x_m, pa_pa, pb_pa, spool, ps_pa }) in samples {
        writeln!(text, "{dt_s} {x_m} {pa_pa} {pb_pa} {spool:e} {ps_pa}").unwrap();
    }
    text
}

/// What the valve's example prints, from Rust.
fn valve_expected() -> Vec<([f32; 6], bool)> {
    let (calibration, samples) = valve();
    let cylinder = Cylinder {
        area_a_m2: 12.6e-4,
        area_b_m2: 9.4e-4,
        stroke_m: 0.2,
        moving_mass_kg: 60.0,
        dead_volume_a_m3: 50e-6,
        dead_volume_b_m3: 50e-6,
    };
    let fluid = Fluid { bulk_modulus_pa: 0.8e9, bulk_modulus_std_pa: 0.2e9 };
    let noise = ValveNoise { position_m: 0.2e-3, pressure_pa: 16e3, spool: 1e-3, supply_pa: 16e3 };
    let mut filter = ValveFilter::new(&cylinder, &fluid, &calibration, &noise, 0.5).unwrap();
    let threshold = 0.1 * LPM;
    let threshold_m3s = PerLeak { internal: threshold, external_a: threshold, external_b: threshold };
    let mut detector = LeakDetector::new(AlarmSettings { threshold_m3s, ..AlarmSettings::default() });
    let mut told = Vec::new();
    for (dt_s, sample) in samples {
        if let ValveUpdate::Renewed { elapsed_s, .. } = filter.update(dt_s, &sample) {
            let found = filter.estimates();
            if found.is_explained {
                detector.update(elapsed_s, &found.mean_leaks_m3s);
            }
            let PerLeak { internal: i, external_a: a, external_b: b } = found.mean_leaks_m3s;
            told.push(([i.value, i.std, a.value, a.std, b.value, b.std], detector.active().external_a));
        }
    }
    told
}

fn assert_same_bits(program: &Path, rows: String, expected: Vec<([f32; 6], bool)>) {
    let mut child = Command::new(program).stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().unwrap();
    let mut input = child.stdin.take().unwrap();
    let writer = std::thread::spawn(move || input.write_all(rows.as_bytes()));
    let output = child.wait_with_output().unwrap();
    writer.join().unwrap().unwrap();
    assert!(output.status.success());
    let printed = String::from_utf8(output.stdout).unwrap();
    assert!(expected.len() > 40 && expected.iter().any(|(_, alarm)| *alarm));
    assert_eq!(printed.lines().count(), expected.len());
    for (line, (values, alarm)) in printed.lines().zip(expected) {
        let words: Vec<_> = line.split(' ').collect();
        let found: Vec<u32> = words[..6].iter().map(|word| word.parse::<f32>().unwrap().to_bits()).collect();
        assert_eq!(found, values.map(f32::to_bits));
        assert_eq!(words[6], if alarm { "1" } else { "0" });
    }
}

#[test]
fn a_c_program_gets_the_bits_of_rust() {
    assert_same_bits(&compile("leaks", "cc", &["-std=c11"]), rows(), expected());
    assert_same_bits(&compile("valve", "cc", &["-std=c11"]), valve_rows(), valve_expected());
}

#[test]
fn a_cpp_program_gets_the_bits_of_rust() {
    let arguments = ["-std=c++11", "-x", "c++"];
    assert_same_bits(&compile("leaks", "c++", &arguments), rows(), expected());
    assert_same_bits(&compile("valve", "c++", &arguments), valve_rows(), valve_expected());
}

/// The header alone asks for nothing that a bare machine lacks.
#[test]
#[ignore = "needs arm-none-eabi-gcc; .ci/run runs it"]
fn a_microcontroller_can_link_it() {
    let target_dir = Path::new(env!("CARGO_TARGET_TMPDIR")).join("bare");
    let mut cargo = Command::new("cargo");
    cargo.args(["build", "--locked", "--release", "-p", "pitchleak-c", "--no-default-features"]);
    cargo.args(["--target", "thumbv7em-none-eabihf", "--target-dir"]).arg(&target_dir).current_dir(here());
    run(cargo.env("CARGO_PROFILE_RELEASE_LTO", "fat").env("CARGO_PROFILE_RELEASE_CODEGEN_UNITS", "1"));
    let library = target_dir.join("thumbv7em-none-eabihf/release/libpitchleak_c.a");
    for (example, update) in [("leaks", "pitchleak4_update"), ("valve", "pitchleak_valve_update")] {
        let program = target_dir.join(example).with_extension("elf");
        let source = here().join("examples").join(example).with_extension("c");
        let mut link = Command::new("arm-none-eabi-gcc");
        link.args(["-mcpu=cortex-m4", "-mthumb", "-mfloat-abi=hard", "-mfpu=fpv4-sp-d16", "-std=c11"]);
        link.args(STRICT).arg("-I").arg(here().join("include")).arg(source).arg(&library);
        run(link.args(["--specs=nosys.specs", "-Wl,--gc-sections", "-lm", "-o"]).arg(&program));
        let symbols = run(Command::new("arm-none-eabi-nm").arg(&program));
        assert!(symbols.contains(update));
        let panics: Vec<_> = symbols.lines().filter(|line| line.contains("panic")).collect();
        assert!(panics.is_empty(), "{panics:?}");
    }
}
