//! Any bytes as a saved estimator, and saved ones with bytes changed and the checksum put right: refused, or an
//! estimator that goes on with numbers.

use super::{Dice, assert_numbers, trace_text};
use pitchleak::Rig;
use pitchleak::replay::Stream;
use pitchleak::trace::{BadRows, TraceReader};
use std::io::Cursor;
use std::sync::LazyLock;

static SAVED: LazyLock<Vec<u8>> = LazyLock::new(|| {
    let mut stream = Stream::new(&Rig::paper(), BadRows::Skip).expect("the paper's rig");
    go_on(&mut stream, 0, 300);
    stream.save().expect("saves")
});
static MORE: LazyLock<String> = LazyLock::new(|| trace_text(300, 120));

fn go_on(stream: &mut Stream, from: usize, rows: usize) {
    let text = if from == 0 { trace_text(from, rows) } else { MORE.clone() };
    let bytes = Box::new(Cursor::new(text.into_bytes()));
    let reader = TraceReader::from_stream("fuzz", bytes, &Rig::paper()).expect("a trace");
    let _ = stream.extend(reader);
}

pub fn enter(bytes: &[u8]) {
    let _ = Stream::restore(bytes);
    let mut forged = SAVED[..SAVED.len() - 4].to_vec();
    let mut dice = Dice(bytes);
    for _ in 0..1 + dice.byte() % 4 {
        let at = usize::from(dice.byte()) << 8 | usize::from(dice.byte());
        let at = 18 + at % (forged.len() - 18);
        forged[at] = dice.byte();
    }
    let mut crc = flate2::Crc::new();
    crc.update(&forged);
    forged.extend(crc.sum().to_le_bytes());
    let Ok(mut stream) = Stream::restore(&forged) else { return };
    go_on(&mut stream, 300, 120);
    if let Some(report) = stream.report("fuzz") {
        assert_numbers(&report);
    }
}
