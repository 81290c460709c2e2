//! The core on a Cortex-M4F in an emulator: the host's estimates, and what they cost.
//!
//! Needs qemu-system-arm and the target thumbv7em-none-eabihf, so `.ci/run` asks for it by name. The table in
//! docs/edge.md is the one printed here; `PITCHLEAK_WRITE_TABLE=1` puts it there.

#![allow(clippy::unwrap_used)]

use pitchleak::Rig;
use pitchleak::core::{
    AlarmSettings, Estimate, LeakDetector, PaperEstimator, PaperGains, Real, Rls, RlsSettings, Sample,
    SensorSpread, Sensors, Update,
};
use pitchleak::trace::{Record, TraceReader};
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::Command;

#[path = "firmware/scene.rs"]
mod scene;
#[path = "firmware/search.rs"]
mod search;
#[path = "firmware/single.rs"]
mod single;
#[path = "firmware/valve.rs"]
mod valve;

/// Instructions of one tick of the system timer: 25 MHz, and a nanosecond for each.
const TICK: u32 = 40;
const BEGIN: &str = "<!-- firmware table: begin -->\n";
const END: &str = "<!-- firmware table: end -->\n";

/// Programs of the firmware, and what the table calls them.
const PROGRAMS: [(&str, &str); 7] = [
    ("rls4", "N = 4"),
    ("rls6", "N = 6"),
    ("rls9", "N = 9"),
    ("clocks4", "N = 4, on clocks"),
    ("clocks6", "N = 6, on clocks"),
    ("clocks9", "N = 9, on clocks"),
    ("paper", "paper's law"),
];
/// Farthest that a microcontroller's estimates may be from the host's, in standard deviations of the estimate.
const FARTHEST: f64 = 0.01;

/// Values and standard deviations of κ and the three leak coefficients.
type Told = [f64; 8];

/// By how many samples it was told after.
type Renewals = BTreeMap<u32, Told>;

struct Run {
    told: Renewals,
    mean: u32,
    worst: u32,
    watch: u32,
    /// Worst sample, alarms included.
    sample: u32,
    state: u32,
    stack: u32,
    flash: u32,
}

#[test]
#[ignore = "needs qemu-system-arm; .ci/run runs it"]
fn a_microcontroller_tells_what_the_host_tells() {
    build();
    let rig = Rig::load("data/traces/rig.toml").unwrap();
    let records = records(&rig);
    let mut table = String::from(HEADER);
    for (program, title) in PROGRAMS {
        let sensors = sensors(&rig, program);
        let run = emulate(program, &[declared(&rig, &sensors), samples(&records)].concat());
        let host = on_host(program, &rig, &sensors, &records);
        add_row(&mut table, [program, title], &run, &host);
    }
    let (run, host) = valve::run();
    add_row(&mut table, ["valve", "calibrated valve"], &run, &host);
    println!("{table}");
    check_table(&table);
}

const HEADER: &str = "\
| estimator | instructions per sample, mean | worst | alarms, worst | state, bytes | stack, bytes | flash, bytes | farthest from the host, std |
|---|---|---|---|---|---|---|---|
";

/// The row of a program, that tells what the host does.
fn add_row(table: &mut String, [program, title]: [&str; 2], run: &Run, host: &Renewals) {
    assert!(run.told.keys().eq(host.keys()), "{program}: renewed after the same samples");
    let apart = farthest(&run.told, host);
    assert!(apart.is_none_or(|apart| apart <= FARTHEST), "{program}: {apart:?}");
    let Run { mean, worst, watch, state, stack, flash, .. } = run;
    let apart = apart.map_or("–".to_owned(), |apart| format!("{apart:.4}"));
    writeln!(table, "| {title} | {mean} | {worst} | {watch} | {state} | {stack} | {flash} | {apart} |")
        .unwrap();
}

/// The largest |f32 − f64| in standard deviations of the estimate; none where there is no such thing.
fn farthest(found: &Renewals, host: &Renewals) -> Option<f64> {
    let both = found.iter().filter_map(|(at, found)| Some((found, host.get(at)?)));
    both.map(|(found, host)| farthest_of(found, host)).filter(|apart| apart.is_finite()).reduce(f64::max)
}

fn farthest_of(found: &Told, host: &Told) -> f64 {
    (0..4).map(|k| (found[2 * k] - host[2 * k]).abs() / host[2 * k + 1]).fold(f64::NEG_INFINITY, f64::max)
}

fn firmware() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("firmware")
}

fn build() {
    let mut cargo = Command::new("cargo");
    // There alone: CARGO_TARGET_DIR would put it elsewhere, and an older one would be measured.
    cargo.args(["build", "--locked", "--release", "--target-dir"]).arg(firmware().join("target"));
    cargo.current_dir(firmware());
    // The settings of a build on the host are none of the firmware's.
    for (key, _) in std::env::vars().filter(|(key, _)| key.starts_with("CARGO_PROFILE_")) {
        cargo.env_remove(key);
    }
    assert!(cargo.status().unwrap().success());
}

fn records(rig: &Rig) -> Vec<Record> {
    let mut reader = TraceReader::open("data/traces/both.csv.gz", rig).unwrap();
    let mut record = Record::default();
    std::iter::from_fn(|| reader.next_record(&mut record).unwrap().then_some(record)).collect()
}

/// The rig's own for four parameters; with offsets of half a percent for six, with gains of as much for nine.
fn sensors(rig: &Rig, program: &str) -> Sensors<f64> {
    let mut sensors = rig.sensors();
    let declare = |sensor: &mut SensorSpread<f64>| {
        if program.ends_with(['6', '9']) {
            sensor.bias_std = 0.5 * sensor.noise_std;
        }
        if program.ends_with('9') {
            sensor.gain_std = 0.005;
        }
    };
    let Sensors { flow_a, flow_b, pressure, position, .. } = &mut sensors;
    [flow_a, flow_b, pressure, position].into_iter().for_each(declare);
    sensors
}

/// Runs a program over what it reads.
fn emulate(program: &str, numbers: &[f64]) -> Run {
    let folder = folder(program);
    let bytes: Vec<u8> = numbers.iter().flat_map(|number| (*number as f32).to_le_bytes()).collect();
    std::fs::write(folder.join("trace.f32"), bytes).unwrap();
    let binary = firmware().join("target/thumbv7em-none-eabihf/release").join(program);
    let output = Command::new("qemu-system-arm")
        .args(["-machine", "mps2-an386", "-nographic", "-monitor", "none", "-serial", "none"])
        .args(["-icount", "shift=0", "-semihosting-config", "enable=on,target=native", "-kernel"])
        .arg(&binary)
        .current_dir(&folder)
        .output()
        .unwrap();
    let text = [output.stdout, output.stderr].concat();
    let text = String::from_utf8(text).unwrap();
    let numbers = |line: &str| {
        line.split(' ').skip(1).map(|word| u32::from_str_radix(word, 16).unwrap()).collect::<Vec<_>>()
    };
    let of_kind = |kind: &'static str| text.lines().filter(move |line| line.starts_with(kind));
    let told = |line| {
        let [at, bits @ ..] = <[u32; 9]>::try_from(numbers(line)).unwrap();
        (at, bits.map(|bits| f64::from(f32::from_bits(bits))))
    };
    let cost = numbers(of_kind("cost").next().unwrap_or_else(|| panic!("the program ends: {text}")));
    let [updates, ticks, worst, watch, sample, state, stack] = cost.try_into().unwrap();
    Run {
        told: of_kind("told").map(told).collect(),
        mean: u32::try_from(u64::from(ticks) * u64::from(TICK) / u64::from(updates)).unwrap(),
        worst: worst * TICK,
        watch: watch * TICK,
        sample: sample * TICK,
        state,
        stack,
        flash: flash(&binary),
    }
}

/// Of a program in one of the tests, which run beside each other.
fn folder(program: &str) -> PathBuf {
    let test = std::thread::current().name().unwrap_or_default().replace(':', "-");
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("{program}-{test}"));
    std::fs::create_dir_all(&folder).unwrap();
    folder
}

/// What the firmware reads first: the rig.
fn declared(rig: &Rig, sensors: &Sensors<f64>) -> Vec<f64> {
    let c = &rig.cylinder;
    let mut numbers =
        vec![c.area_a_m2, c.area_b_m2, c.stroke_m, c.moving_mass_kg, c.dead_volume_a_m3, c.dead_volume_b_m3];
    numbers.extend([rig.fluid.bulk_modulus_pa, rig.fluid.bulk_modulus_std_pa]);
    let Sensors { flow_a, flow_b, pressure, position, force } = sensors;
    for sensor in [flow_a, flow_b, pressure, position, force] {
        numbers.extend([sensor.noise_std, sensor.bias_std, sensor.gain_std]);
    }
    numbers
}

/// … and then: the samples.
fn samples(records: &[Record]) -> Vec<f64> {
    let row = |record: &Record| {
        let Sample { x_m, pa_pa, pb_pa, qa_m3s, qb_m3s, force_n } = record.sample;
        let [qa, qb, force] = [qa_m3s, qb_m3s, force_n].map(|reading| reading.unwrap_or(f64::NAN));
        [record.step_s(), x_m, pa_pa, pb_pa, qa, qb, force]
    };
    records.iter().flat_map(row).collect()
}

/// Bytes that are written into the flash: code, constants, and what variables start with.
fn flash(binary: &Path) -> u32 {
    let output = Command::new("arm-none-eabi-size").arg(binary).output().unwrap();
    let text = String::from_utf8(output.stdout).unwrap();
    let sizes: Vec<u32> =
        text.lines().nth(1).unwrap().split_whitespace().take(2).map(|n| n.parse().unwrap()).collect();
    sizes.iter().sum()
}

fn on_host(program: &str, rig: &Rig, sensors: &Sensors<f64>, records: &[Record]) -> Renewals {
    match program {
        "rls4" => rls::<4>(rig, sensors, records, Rls::update),
        "rls6" => rls::<6>(rig, sensors, records, Rls::update),
        "rls9" => rls::<9>(rig, sensors, records, Rls::update),
        "clocks4" => rls::<4>(rig, sensors, records, Rls::update_waiting),
        "clocks6" => rls::<6>(rig, sensors, records, Rls::update_waiting),
        "clocks9" => rls::<9>(rig, sensors, records, Rls::update_waiting),
        _ => paper(rig, records),
    }
}

fn rls<const N: usize>(
    rig: &Rig,
    sensors: &Sensors<f64>,
    records: &[Record],
    update: impl Fn(&mut Rls<f64, N>, f64, &Sample<f64>) -> Update<f64>,
) -> Renewals {
    let mut rls = Rls::<f64, N>::new(rig.cylinder, rig.fluid, sensors, RlsSettings::default()).unwrap();
    let mut detector = LeakDetector::new(AlarmSettings::default());
    let mut told = Renewals::new();
    for (at, record) in (1..).zip(records) {
        if let Update::Renewed { elapsed_s, .. } = update(&mut rls, record.step_s(), &record.sample) {
            detector.update(elapsed_s, &rls.mean_leaks_m3s());
            told.insert(at, self::told(&rls));
        }
    }
    told
}

fn told<T: Real + Into<f64>, const N: usize>(rls: &Rls<T, N>) -> Told {
    let found = rls.estimates();
    let (kappa, leaks) = (found.compressibility_per_pa, found.leaks_m3spa);
    let all = [kappa, leaks.internal, leaks.external_a, leaks.external_b];
    std::array::from_fn(|k| {
        let Estimate { value, std } = all[k / 2];
        if k.is_multiple_of(2) { value } else { std }.into()
    })
}

fn paper(rig: &Rig, records: &[Record]) -> Renewals {
    let gains = PaperGains::scaled(&rig.cylinder, &rig.fluid, 10.0, 3e-5);
    let mut paper = PaperEstimator::new(rig.cylinder, rig.fluid, gains, 5.0, 100.0).unwrap();
    let mut told = Renewals::new();
    for (at, record) in (1..).zip(records) {
        if let Update::Renewed { .. } = paper.update(record.step_s(), &record.sample) {
            let leaks = paper.leak_coefficients();
            let kappa = 1.0 / paper.bulk_modulus_pa();
            let [c, a, b] = [leaks.internal, leaks.external_a, leaks.external_b];
            told.insert(at, [kappa, 0.0, c, 0.0, a, 0.0, b, 0.0]);
        }
    }
    told
}

fn check_table(table: &str) {
    if let Some(stands) = stands_in_docs([BEGIN, END], table) {
        assert_eq!(stands, table, "docs/edge.md has another table");
    }
}

/// What docs/edge.md has between two marks; none where it was asked to have this table from now on.
fn stands_in_docs([begin, end]: [&str; 2], table: &str) -> Option<String> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/edge.md");
    let text = std::fs::read_to_string(&path).unwrap();
    let (before, rest) = text.split_once(begin).unwrap();
    let (stands, after) = rest.split_once(end).unwrap();
    if std::env::var_os("PITCHLEAK_WRITE_TABLE").is_some() {
        std::fs::write(&path, [before, begin, table, end, after].concat()).unwrap();
        return None;
    }
    Some(stands.to_owned())
}
