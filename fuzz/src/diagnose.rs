//! A trace with any numbers in it: diagnosed to numbers, and the rig that comes of it can be read.

use super::{Dice, trace_text};
use pitchleak::Rig;
use pitchleak::diagnose::{Declared, Series, diagnose};
use pitchleak::trace::TraceReader;
use pitchleak_view::{Palette, Text, residual_figures};
use std::io::Cursor;

pub fn enter(bytes: &[u8]) {
    let mut dice = Dice(bytes);
    let text = trace_text(0, 150 + usize::from(dice.byte()));
    let mut lines: Vec<String> = text.lines().map(str::to_owned).collect();
    for _ in 0..dice.byte() % 32 {
        let line = 1 + (usize::from(dice.byte()) * 7) % (lines.len() - 1);
        let column = usize::from(dice.byte()) % 7;
        let number = if dice.byte() % 5 == 0 { String::new() } else { dice.number().to_string() };
        let mut cells: Vec<&str> = lines[line].split(',').collect();
        cells[column] = &number;
        lines[line] = cells.join(",");
    }
    let rig = Rig::paper();
    let stream = Box::new(Cursor::new(lines.join("\n").into_bytes()));
    let Ok(mut reader) = TraceReader::from_stream("fuzz", stream, &rig) else { return };
    let Ok(series) = Series::read(&mut reader) else { return };
    let diagnosis = diagnose(&[series], &[], &Declared::of(&rig), &|| ());
    let text = diagnosis.to_text(&Palette::PLAIN);
    assert!(!text.contains("NaN"), "{text}");
    let _ = residual_figures(&diagnosis);
    Rig::parse(&diagnosis.rig(&rig).to_toml(), "fuzz").expect("reads what it wrote");
}
