//! The paper's experiment, end to end: who is how good, against the bound and against the paper.

use pitchleak_reproduce::{Row, reproduce};
use pitchleak_testkit::{NormalScatter, coverage_bounds};

const SEEDS: u64 = 280;
/// Root mean square error over the Cramér–Rao bound, as docs/reproduction.md has it without biases and with.
const EFFICIENCY: [f64; 2] = [1.06, 1.07];
const COVERAGE: f64 = 0.945;

fn ours(rows: &[Row]) -> impl Iterator<Item = &Row> {
    rows.iter().filter(|row| row.estimator == "rls")
}

/// Each figure beside that of an efficient estimator, and the goal that stands where noise allows it.
fn figures(row: &Row) -> [(&'static str, f64, f64, f64); 5] {
    let (ours, limit) = (&row.median, &row.bound.median);
    let of = |ours: Option<f64>| ours.unwrap_or(f64::INFINITY);
    [
        ("leakage mean %", of(ours.leakage_mean_error_percent), of(limit.leakage_mean_error_percent), 1.0),
        ("leakage peak %", of(ours.leakage_peak_error_percent), of(limit.leakage_peak_error_percent), 2.5),
        ("mean %", of(ours.coefficient_mean_error_percent), of(limit.coefficient_mean_error_percent), 1.0),
        ("peak %", of(ours.coefficient_peak_error_percent), of(limit.coefficient_peak_error_percent), 3.0),
        ("convergence s", of(ours.convergence_time_s), of(limit.convergence_time_s), 2.0),
    ]
}

/// Lines of the tables in docs/reproduction.md that `pitchleak reproduce` prints; the alarms' are tests/onset.rs's.
fn documented_lines() -> Vec<String> {
    let text = include_str!("../../../docs/reproduction.md");
    let blocks = text.split("```text\n").skip(1).filter_map(|block| block.split("```").next());
    let tables = blocks.filter(|block| !block.starts_with("Delay"));
    let lines: Vec<String> = tables.flat_map(str::lines).map(str::to_owned).collect();
    assert!(lines.len() > 100, "the tables are there");
    lines
}

/// Every figure meets its goal or is within 1.3 of what noise allows, and intervals cover, with biases and
/// without.
#[test]
fn regress_table() {
    let reproduction = reproduce(SEEDS, |_| ()).expect("runs");
    let page = pitchleak_reproduce::page(&reproduction).expect("draws").to_html();
    assert!(page.contains(">ACCURACY MET</h1>") && page.len() <= 1_000_000, "{} bytes", page.len());
    let report = reproduction.report;
    assert_eq!((report.rows.len(), report.rows_with_bias.len(), report.tracking.len()), (32, 16, 8));
    for (rows, efficiency) in [&report.rows, &report.rows_with_bias].into_iter().zip(EFFICIENCY) {
        let [least, most] = NormalScatter { n: SEEDS }.rms_bounds(efficiency);
        let [low, high] = coverage_bounds(COVERAGE, SEEDS);
        for row in ours(rows) {
            let name = format!("{} m/s, case {:?}, {}", row.wind_mps, row.case, row.leak);
            assert!(row.identifiable, "{name}");
            for (figure, value, limit, goal) in figures(row) {
                assert!(value <= f64::max(goal, 1.3 * limit), "{name}, {figure}: {value}, limit {limit}");
            }
            let ratio = row.bound.error_over_bound;
            assert!((least..=most).contains(&ratio), "{name}: {ratio} of the bound");
            let coverage = row.coverage_percent.unwrap_or(f64::NAN);
            assert!((low..=high).contains(&(coverage / 100.0)), "{name}: {coverage} % of the intervals");
        }
        let covered: Vec<f64> = ours(rows).filter_map(|row| row.coverage_percent).collect();
        let mean = covered.iter().sum::<f64>() / covered.len() as f64;
        // Both leaks of a run share its noise.
        let [low, high] = coverage_bounds(COVERAGE, SEEDS * covered.len() as u64 / 2);
        assert!((low..=high).contains(&(mean / 100.0)), "{mean} % of all intervals hold the truth");
    }
    for row in ours(&report.rows) {
        assert!(row.median.coefficient_mean_error_percent <= Some(1.0), "{row:?}");
    }
    for (paper, ours) in report.rows.iter().filter(|row| row.estimator == "paper").zip(ours(&report.rows)) {
        assert_eq!((paper.wind_mps, paper.case, paper.leak), (ours.wind_mps, ours.case, ours.leak));
        assert!(ours.median.coefficient_mean_error_percent < paper.median.coefficient_mean_error_percent);
    }
    let printed = report.to_text();
    for line in documented_lines() {
        assert!(printed.contains(&line), "docs/reproduction.md has a line that is no longer printed: {line}");
    }
    let json = serde_json::to_value(&report).expect("is JSON");
    assert_eq!(json["schema"], "pitchleak.reproduce/1");
    assert_eq!(json["rows"][0]["case"], 1);
    assert!(json["rows"][1]["leakage_mean_error_percent"].is_number());
    assert!(json["rows"][1]["bound"]["leakage_mean_error_percent"].is_number());
}
