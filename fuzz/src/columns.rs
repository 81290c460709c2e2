//! Any columns in memory, in parts: estimates that are numbers, or a typed error.

use super::{Dice, assert_numbers};
use pitchleak::Rig;
use pitchleak::replay::Stream;
use pitchleak::trace::{BadRows, TableLayout, TraceReader};

const HEADERS: [&str; 12] = [
    "t_s",
    "x_m",
    "pa_pa",
    "pb_pa",
    "qa_m3s",
    "qb_m3s",
    "force_n",
    "v_mps",
    "temp_k",
    "q_int_m3s",
    "x_mm",
    "t_ms",
];

pub fn enter(bytes: &[u8]) {
    let mut dice = Dice(bytes);
    let width = 4 + usize::from(dice.byte() % 9);
    let headers: Vec<String> = HEADERS[..width].iter().map(ToString::to_string).collect();
    let rig = Rig::paper();
    let Ok(layout) = TableLayout::new("fuzz", &headers, &rig) else { return };
    let Ok(mut stream) = Stream::new(&rig, BadRows::Skip) else { return };
    let mut t_s = 0.0;
    for _ in 0..1 + dice.byte() % 4 {
        let rows = usize::from(dice.byte());
        let mut columns: Vec<Vec<f64>> = (0..width).map(|_| Vec::with_capacity(rows)).collect();
        for row in 0..rows {
            let odd = dice.byte();
            t_s += 0.01;
            for (signal, column) in columns.iter_mut().enumerate() {
                let usual = [
                    t_s,
                    0.1 + 1e-4 * row as f64,
                    5e6,
                    4e6,
                    1e-5,
                    -1e-5,
                    100.0,
                    0.01,
                    310.0,
                    0.0,
                    100.0,
                    t_s,
                ];
                column.push(if usize::from(odd) % 23 == signal { dice.number() } else { usual[signal] });
            }
        }
        let batch = columns.iter().map(Vec::as_slice).collect();
        let Ok(reader) = TraceReader::from_table("fuzz", &layout, vec![batch], &rig) else { return };
        if stream.extend(reader).is_err() {
            return;
        }
        if let Some(report) = stream.report("fuzz") {
            assert_numbers(&report);
        }
    }
}
