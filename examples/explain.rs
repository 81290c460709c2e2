//! The posterior over explanations of a trace: `cargo run --example explain -- TRACE [RIG]`.

use pitchleak::Rig;
use pitchleak::core::PerLeak;
use pitchleak::explain::{Statistic, explain};
use pitchleak::told::Beside;
use pitchleak::trace::{Record, TraceReader};
use std::path::Path;
use std::time::Instant;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let trace = arguments.next().ok_or("usage: explain TRACE [RIG]")?;
    let rig = match arguments.next() {
        Some(file) => Rig::load(file)?,
        None => Rig::beside(Path::new(&trace))?,
    };
    let mut statistic = Box::new(Statistic::new(&rig.cylinder, &rig.fluid, &rig.sensors()));
    let mut reader = TraceReader::open(&trace, &rig)?;
    let mut record = Record::default();
    let mut beside = Beside::default();
    while reader.next_record(&mut record)? {
        statistic.push(record.step_s(), &record.sample);
        beside.add(&record, &rig);
    }
    let begun = Instant::now();
    let decision =
        explain(&statistic, &rig, PerLeak::default(), &beside.told(&rig)).ok_or("too little to explain")?;
    eprintln!("{:.1} ms", begun.elapsed().as_secs_f64() * 1e3);
    println!("{}", serde_json::to_string_pretty(&decision)?);
    Ok(())
}
