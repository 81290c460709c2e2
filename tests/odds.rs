//! A fleet teaches how often a sensor errs: as often as it does.

#![allow(clippy::unwrap_used)]

use pitchleak::Rig;
use pitchleak::fleet::{FleetOdds, FleetRow, TraceIdentity, judge_opened};
use pitchleak::trace::TraceReader;
use pitchleak::wind::WindCase;
use pitchleak_testkit::windy::minute;
use rayon::prelude::*;
use std::fmt::Write;
use std::io::Cursor;

/// 2 % of the flow meters' full scale.
const OFF_M3S: f64 = 0.02 * 20.0 / 60_000.0;

/// The row of a sound cylinder whose flow meter A shows `zero_m3s` too much.
fn row(cylinder: usize, zero_m3s: f64) -> FleetRow {
    let mut text = "t_s,x_m,pa_pa,pb_pa,qa_m3s,qb_m3s\n".to_owned();
    for (t_s, read) in minute(WindCase::ALL[cylinder % 4], None, 4_400 + cylinder as u64) {
        let (qa_m3s, qb_m3s) = (read.qa_m3s.unwrap() + zero_m3s, read.qb_m3s.unwrap());
        let _ = writeln!(text, "{t_s:.3},{},{},{},{qa_m3s:e},{qb_m3s:e}", read.x_m, read.pa_pa, read.pb_pa);
    }
    let rig = Rig::paper();
    let opened = TraceReader::from_stream("trace", Box::new(Cursor::new(text)), &rig);
    let identity = TraceIdentity { cylinder: format!("T{cylinder}"), begins: None };
    judge_opened("trace", &identity, &rig, opened.map_err(Into::into), || true).unwrap()
}

#[test]
fn a_fleet_with_ten_wrong_zeros_of_forty_learns_that() {
    let rows: Vec<_> =
        (0..40).into_par_iter().map(|at| row(at, if at < 10 { OFF_M3S } else { 0.0 })).collect();
    let odds = FleetOdds::learn(&rows);
    let met = |id: &str| odds.shares.iter().find(|one| one.id == id).map_or(0.0, |one| one.cylinders);
    println!("{odds:#?}");
    assert_eq!(odds.cylinders, 40);
    assert!((8.0..=12.0).contains(&(met("flow_zero") + met("flow_zeros_gross"))), "{odds:?}");
    assert!((28.0..=32.0).contains(&(met("zeros_usual") + met("flow_zeros"))), "{odds:?}");
    assert!(met("as_declared") > 38.0, "{odds:?}");
}
