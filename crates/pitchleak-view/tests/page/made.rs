//! A page of every kind.

use jiff::Timestamp;
use pitchleak::Rig;
use pitchleak::check::check;
use pitchleak::diagnose::{Declared, Series, diagnose};
use pitchleak::fleet::{FleetReport, FleetRow, TraceIdentity};
use pitchleak::replay::{ReplayError, replay};
use pitchleak::report::ReplayReport;
use pitchleak::trace::TraceReader;
use pitchleak_reproduce::reproduce;
use pitchleak_view::page::{History, Page};
use std::path::Path;

pub const TRACE: &str = "../../data/traces/external_a.csv.gz";
/// A name that does something where it is not escaped.
pub const HOSTILE: &str = "</script><img src=x onerror=alert(1)>\"'&";

pub fn rig() -> Rig {
    Rig::load("../../data/traces/rig.toml").expect("a rig")
}

fn report(path: impl AsRef<Path>, rig: &Rig, history: &mut History) -> ReplayReport {
    let mut reader = TraceReader::open(path, rig).expect("a trace");
    let report = replay(&mut reader, rig, |replay, record, renewed| {
        history.add(replay, record, renewed);
        Ok::<_, ReplayError>(())
    });
    report.expect("replays")
}

pub fn replayed(path: impl AsRef<Path>, rig: &Rig) -> String {
    let mut history = History::default();
    let report = report(path, rig, &mut history);
    Page::of_replay(&report, rig, &history).to_html()
}

pub fn checked() -> String {
    let rig = rig();
    let mut reader = TraceReader::open(TRACE, &rig).expect("a trace");
    let mut history = History::default();
    let report = check(&mut reader, &rig, |replay, record, renewed| {
        history.add(replay, record, renewed);
        Ok::<_, ReplayError>(())
    });
    Page::of_check(&report.expect("checks"), &rig, &history).to_html()
}

/// A trace of an independent simulator, in which seals rub.
pub fn diagnosed() -> String {
    let mut rig = Rig::paper();
    (rig.cylinder.moving_mass_kg, rig.fluid.bulk_modulus_pa) = (30.0, 0.9e9);
    let mut reader = TraceReader::open("../../data/hopsan/u04.csv.gz", &rig).expect("a trace");
    let series = Series::read(&mut reader).expect("reads");
    let diagnosis = diagnose(&[series], &[], &Declared::of(&rig), &|| ());
    Page::of_diagnosis(&diagnosis, &rig, &[HOSTILE.to_owned()]).to_html()
}

/// A cylinder whose leak grows from day to day, and a file that is no trace.
pub fn fleet() -> String {
    let rig = rig();
    let report = report(TRACE, &rig, &mut History::default());
    let day = |k: u32| {
        let begins = Timestamp::from_second(1_750_000_000 + 86_400 * i64::from(k)).ok();
        let identity = TraceIdentity { cylinder: HOSTILE.to_owned(), begins };
        let mut row = FleetRow::of(&identity, &report, &rig);
        if let Some(leaks) = &mut row.leaks {
            leaks.internal.mean_lpm = 0.01 * f64::from(k);
        }
        row
    };
    let mut rows: Vec<_> = (0..6).map(day).collect();
    let identity = TraceIdentity { cylinder: "T7/B2".to_owned(), begins: None };
    rows.push(FleetRow::failed(&identity, "no trace.csv".to_owned(), format!("{HOSTILE}: no trace")));
    Page::of_fleet(&FleetReport::of(&rows)).to_html()
}

pub fn reproduced() -> String {
    let reproduction = reproduce(2, |_| ()).expect("reproduces");
    pitchleak_reproduce::page(&reproduction).expect("draws").to_html()
}
