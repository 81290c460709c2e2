//! Any bytes as OpenFAST output: read or refused; what was read drives the emulator with numbers.

use pitchleak::wind::{Emulation, History};
use std::path::Path;

pub fn enter(bytes: &[u8]) {
    let Ok(run) = pitchleak::openfast::parse(bytes) else { return };
    let Ok(history) = History::from_run(&run, Path::new("fuzz")) else { return };
    let Ok(reference) = Emulation::paper().reference(&history, 0.2) else { return };
    if let Some((from_s, to_s)) = reference.span_s() {
        for t_s in [from_s, 0.5 * (from_s + to_s), to_s, to_s + 1.0] {
            let (position_m, load_n) = reference.at(t_s);
            assert!(position_m.is_finite() && load_n.is_finite(), "{position_m} {load_n}");
        }
    }
}
