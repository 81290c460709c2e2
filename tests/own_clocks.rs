//! Channels that come on clocks of their own, in one file or in one for each: the verdict of the whole trace, and no reading is
//! called bad.

#![allow(clippy::unwrap_used)]

use pitchleak::Rig;
use pitchleak::core::{Leak, Sample};
use pitchleak::replay::{ReplayError, replay};
use pitchleak::report::{ReplayReport, Status};
use pitchleak::trace::TraceReader;
use pitchleak::wind::WindCase;
use pitchleak_testkit::windy::minute;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use std::fmt::Write;
use std::io::Cursor;

const NAMES: [&str; 5] = ["x_m", "pa_pa", "pb_pa", "qa_m3s", "qb_m3s"];

/// A minute at 100 Hz: times, and the readings of x, P_A, P_B, Q_A, Q_B.
fn trace(wind: WindCase, leak: Option<Leak>, seed: u64) -> Vec<(f64, [f64; 5])> {
    let readings = |(t_s, sample): (f64, Sample<f64>)| {
        let [qa, qb] = [sample.qa_m3s, sample.qb_m3s].map(Option::unwrap);
        (t_s, [sample.x_m, sample.pa_pa, sample.pb_pa, qa, qb])
    };
    minute(wind, leak.map(|leak| (leak, 0.4)), seed).into_iter().map(readings).collect()
}

/// Which cells of a row are there.
type Cells = fn(usize, usize, &mut ChaCha8Rng) -> bool;

const LAYOUTS: [(&str, Cells); 7] = [
    ("flows at 50 Hz", |k, place, _| place < 3 || k % 2 == 0),
    ("flows at 20 Hz", |k, place, _| place < 3 || k % 5 == 0),
    ("flows at 10 Hz", |k, place, _| place < 3 || k % 10 == 0),
    ("flows at 20 Hz, one after the other", |k, place, _| place < 3 || k % 5 == place - 3),
    ("pressures at 20 Hz", |k, place, _| !(1..3).contains(&place) || k % 5 == 0),
    ("each channel in rows of its own", |k, place, _| k % 5 == place),
    ("a tenth missing", |_, _, chance| chance.random::<f64>() > 0.1),
];

fn text(trace: &[(f64, [f64; 5])], cells: Cells, seed: u64) -> String {
    let mut chance = ChaCha8Rng::seed_from_u64(seed);
    let mut text = format!("t_s,{}\n", NAMES.join(","));
    for (k, (t_s, readings)) in trace.iter().enumerate() {
        let _ = write!(text, "{t_s:.3}");
        for (place, reading) in readings.iter().enumerate() {
            text.push(',');
            if cells(k, place, &mut chance) {
                let _ = write!(text, "{reading:.9e}");
            }
        }
        text.push('\n');
    }
    text
}

fn judged(text: String) -> ReplayReport {
    let rig = Rig::paper();
    let mut reader = TraceReader::from_stream("trace", Box::new(Cursor::new(text)), &rig).unwrap();
    replay(&mut reader, &rig, |_, _, _| Ok::<(), ReplayError>(())).unwrap()
}

fn is_right(report: &ReplayReport, leak: Option<Leak>) -> bool {
    match leak {
        None => report.verdict.status == Status::Sound,
        Some(leak) => report.verdict.status == Status::Leak && report.verdict.faults == [leak],
    }
}

/// Winds, leaks and seeds, fresh ones.
fn cases() -> Vec<(WindCase, Option<Leak>, u64)> {
    let leaks = [None, Some(Leak::Internal), Some(Leak::ExternalA), Some(Leak::ExternalB)];
    let of_wind = |wind| leaks.into_iter().flat_map(move |leak| [501, 502].map(|seed| (wind, leak, seed)));
    WindCase::ALL.into_iter().flat_map(of_wind).collect()
}

#[test]
fn verdicts_are_those_of_the_whole_trace() {
    let all: Vec<Vec<(bool, bool, f64)>> = cases()
        .into_par_iter()
        .map(|(wind, leak, seed)| {
            let trace = trace(wind, leak, seed);
            let whole = judged(text(&trace, |_, _, _| true, seed));
            let spread =
                |report: &ReplayReport| report.leakage[leak.unwrap_or(Leak::Internal)].std_lpm.unwrap();
            let of_layout = |(name, cells): (&str, Cells)| {
                let report = judged(text(&trace, cells, seed));
                assert_eq!(report.trace.skipped, 0, "{name}: {:?}", report.trace.warnings);
                let is_sure = report.verdict.status.is_sure();
                let right = is_right(&report, leak);
                if !right {
                    println!("{name}, {wind:?}, {leak:?}, {seed}: {}", report.verdict.text);
                }
                (right, is_sure && !right, spread(&report) / spread(&whole))
            };
            LAYOUTS.into_iter().map(of_layout).collect()
        })
        .collect();
    let mut right_of_all = 0;
    for (place, (name, _)) in LAYOUTS.into_iter().enumerate() {
        let of_layout = || all.iter().map(|runs| runs[place]);
        let right = of_layout().filter(|(right, _, _)| *right).count();
        let wrong = of_layout().filter(|(_, wrong, _)| *wrong).count();
        let mut spreads: Vec<f64> = of_layout().map(|(_, _, spread)| spread).collect();
        spreads.sort_by(f64::total_cmp);
        let middle = spreads[spreads.len() / 2];
        println!("{name}: {right} of {} right, {wrong} wrong, spread {middle:.2} times", spreads.len());
        assert_eq!(wrong, 0, "{name}");
        // In calm wind, where the piston hardly moves, a mistake of wiring is as likely for some.
        assert!(4 * right >= 3 * spreads.len(), "{name}: {right} of {} right", spreads.len());
        assert!(middle <= 2.5, "{name}: {middle}");
        right_of_all += right;
    }
    assert!(10 * right_of_all >= 9 * all.len() * LAYOUTS.len(), "{right_of_all} right");
}

/// One file for each channel, which is called as the file is; and one for each pair, with stamps and rates of their own.
#[test]
fn files_of_one_recording_are_joined() {
    let folder = tempfile::tempdir().unwrap();
    let trace = trace(WindCase::Mps13, Some(Leak::ExternalA), 7);
    let write = |name: &str, text: String| {
        let path = folder.path().join(name);
        std::fs::write(&path, text).unwrap();
        path
    };
    let one_channel = |(place, name): (usize, &&str)| {
        let rows = trace.iter().skip(place).step_by(1 + place);
        let rows: String =
            rows.map(|(t_s, readings)| format!("{t_s:.3},{:.9e}\n", readings[place])).collect();
        write(&format!("{name}.csv"), format!("t_s,value\n{rows}"))
    };
    let paths: Vec<_> = NAMES.iter().enumerate().map(one_channel).collect();
    let stamped = |name: &str, from: usize, header: &str| {
        let row = |(t_s, readings): &(f64, [f64; 5])| {
            let whole = t_s.floor();
            let cells: Vec<_> = readings[from..from + header.split(',').count()]
                .iter()
                .map(|value| format!("{value:.9e}"))
                .collect();
            format!(
                "2026-11-20T22:10:{:02}.{:03}Z,{}\n",
                whole,
                (1e3 * (t_s - whole)).round(),
                cells.join(",")
            )
        };
        let rows: String = trace.iter().skip(from).map(row).collect();
        write(name, format!("timestamp,{header}\n{rows}"))
    };
    let pairs = [stamped("a.csv", 0, "x_m,pa_pa,pb_pa"), stamped("b.csv", 3, "qa_m3s,qb_m3s")];
    let rig = Rig::paper();
    let joined = |paths: &[std::path::PathBuf]| {
        let mut reader = TraceReader::join(paths, &rig).map_err(|error| error.to_string())?;
        let report = replay(&mut reader, &rig, |_, _, _| Ok::<(), ReplayError>(()));
        report.map_err(|error| error.to_string())
    };
    for files in [&paths[..], &pairs] {
        let report = joined(files).unwrap();
        assert!(is_right(&report, Some(Leak::ExternalA)), "{}", report.verdict.text);
        assert_eq!(report.trace.skipped, 0, "{:?}", report.trace.warnings);
    }
    let missing = joined(&paths[..2]).unwrap_err();
    assert!(missing.starts_with("the files together: no column for pressure B"), "{missing}");
    let clocks =
        joined(&[paths[0].clone(), pairs[1].clone(), paths[1].clone(), paths[2].clone()]).unwrap_err();
    assert!(clocks.contains("some of the files have dates, others seconds"), "{clocks}");
    let twice = joined(&[pairs[0].clone(), paths[1].clone()]).unwrap_err();
    assert!(twice.contains("pa_pa"), "{twice}");
}
