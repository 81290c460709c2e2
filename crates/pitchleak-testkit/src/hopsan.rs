//! The traces that an independent simulator made, with their truth; see `data/hopsan/README.md`.

use pitchleak_core::{Cylinder, Fluid, PerLeak, Sample};
use std::path::PathBuf;

/// A noise-free run of the independent simulator at 100 Hz.
pub struct Recording {
    /// Its name, `h02` and so on.
    pub name: &'static str,
    /// The cylinder to declare.
    pub cylinder: Cylinder<f64>,
    /// The oil to declare, known to a quarter.
    pub fluid: Fluid<f64>,
    /// The true leak coefficients, m³/(s·Pa).
    pub leaks: PerLeak<f64>,
    /// All samples.
    pub rows: Vec<Row>,
}

/// What the simulator recorded at one instant.
#[derive(Clone, Copy)]
pub struct Row {
    /// Readings of perfect sensors, force included.
    pub sample: Sample<f64>,
    /// Piston speed, m/s.
    pub v_mps: f64,
}

/// Time between samples, s.
pub const STEP_S: f64 = 0.01;

/// The file of a trace.
pub fn path(name: &str) -> PathBuf {
    folder().join(name).with_extension("csv.gz")
}

/// Reads a trace and its truth.
pub fn read(name: &'static str) -> Recording {
    let truth = std::fs::read_to_string(folder().join("truth.json")).expect("data/hopsan has truth.json");
    let truth: serde_json::Value = serde_json::from_str(&truth).expect("truth.json is JSON");
    let number = |key: &str| truth[name][key].as_f64().expect("truth.json has every number");
    let bulk_modulus_pa = number("bulk_modulus_pa");
    Recording {
        name,
        cylinder: Cylinder {
            area_a_m2: number("area_a_m2"),
            area_b_m2: number("area_b_m2"),
            stroke_m: number("stroke_m"),
            moving_mass_kg: number("moving_mass_kg"),
            dead_volume_a_m3: number("dead_volume_a_m3"),
            dead_volume_b_m3: number("dead_volume_b_m3"),
        },
        fluid: Fluid { bulk_modulus_pa, bulk_modulus_std_pa: 0.25 * bulk_modulus_pa },
        leaks: PerLeak {
            internal: number("leak_internal_m3_per_s_pa"),
            external_a: number("leak_external_a_m3_per_s_pa"),
            external_b: number("leak_external_b_m3_per_s_pa"),
        },
        rows: rows(name),
    }
}

fn rows(name: &str) -> Vec<Row> {
    let file = std::fs::File::open(path(name)).expect("data/hopsan has the trace");
    let mut reader = csv::Reader::from_reader(flate2::read::GzDecoder::new(file));
    let header = reader.headers().expect("the trace has a header").clone();
    let place = |name: &str| header.iter().position(|cell| cell == name).expect("the trace has the column");
    let [x, v, pa, pb, qa, qb, force] =
        ["x_m", "v_mps", "pa_pa", "pb_pa", "qa_m3s", "qb_m3s", "force_n"].map(place);
    let row = |record: csv::StringRecord| {
        let cell = |place: usize| record[place].parse::<f64>().expect("every cell is a number");
        let sample = Sample {
            x_m: cell(x),
            pa_pa: cell(pa),
            pb_pa: cell(pb),
            qa_m3s: Some(cell(qa)),
            qb_m3s: Some(cell(qb)),
            force_n: Some(cell(force)),
        };
        Row { sample, v_mps: cell(v) }
    };
    reader.records().map(|record| row(record.expect("the trace is whole"))).collect()
}

fn folder() -> PathBuf {
    [env!("CARGO_MANIFEST_DIR"), "..", "..", "data", "hopsan"].iter().collect()
}
