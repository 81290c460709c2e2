//! Any bytes as a trace: replayed to a report or refused, and the report holds numbers only.
#![no_main]

use libfuzzer_sys::fuzz_target;
use pitchleak::Rig;
use pitchleak::replay::{ReplayError, replay};
use pitchleak::trace::TraceReader;

fuzz_target!(|bytes: &[u8]| {
    let rig = Rig::paper();
    let stream = Box::new(std::io::Cursor::new(bytes.to_vec()));
    let Ok(mut reader) = TraceReader::from_stream("fuzz", stream, &rig) else { return };
    if let Ok(report) = replay(&mut reader, &rig, |_, _, _| Ok::<(), ReplayError>(())) {
        let json = report.to_json().expect("a report has a JSON form");
        assert!(!json.contains("NaN") && !json.contains("Infinity"));
    }
});
