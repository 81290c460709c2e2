//! `pitchleak explanations`: what a verdict weighs.

use crate::Outcome;
use crate::failure::Failure;
use clap::Args;
use pitchleak::explain::explanations;
use std::io::Write;

/// Lists what a verdict weighs beside leaks: sensors, rig and wiring, each with its prior share
#[derive(Args)]
pub struct Arguments {}

pub fn run(_: &Arguments) -> Result<Outcome, Failure> {
    let mut out = std::io::stdout().lock();
    writeln!(out, "{:<10} {:<26} {:>7}  what", "kind", "id", "share")?;
    for entry in explanations() {
        let (kind, percent) = (entry.kind.name(), 100.0 * entry.share);
        writeln!(out, "{kind:<10} {:<26} {percent:>5.2} %  {}", entry.id, entry.text)?;
    }
    Ok(Outcome::Done)
}
