//! The paper's experiment, end to end: who is how good, against the bound and against the paper.

use pitchleak::reproduce::{Row, reproduce};

fn ours(rows: &[Row]) -> impl Iterator<Item = &Row> {
    rows.iter().filter(|row| row.estimator == "rls")
}

#[test]
fn regress_table() {
    let report = reproduce(56, |_| ()).expect("runs").report;
    assert_eq!((report.rows.len(), report.rows_with_bias.len(), report.tracking.len()), (32, 16, 8));
    for row in ours(&report.rows) {
        let name = format!("{} m/s, case {:?}, {}", row.wind_mps, row.case, row.leak);
        assert!(row.identifiable, "{name}");
        assert!(row.bound.error_over_bound <= 1.3, "{name}: {} of the bound", row.bound.error_over_bound);
        let mean = row.median.coefficient_mean_error_percent.unwrap_or(f64::NAN);
        assert!(mean <= 1.0, "{name}: {mean} % mean coefficient error");
        let coverage = row.coverage_percent.unwrap_or(f64::NAN);
        assert!(coverage >= 85.0, "{name}: {coverage} % of the intervals hold the truth");
    }
    for (paper, ours) in report.rows.iter().filter(|row| row.estimator == "paper").zip(ours(&report.rows)) {
        assert_eq!((paper.wind_mps, paper.case, paper.leak), (ours.wind_mps, ours.case, ours.leak));
        assert!(ours.median.coefficient_mean_error_percent < paper.median.coefficient_mean_error_percent);
    }
    for row in ours(&report.rows_with_bias).filter(|row| row.wind_mps > 5) {
        let mean = row.median.coefficient_mean_error_percent.unwrap_or(f64::NAN);
        assert!(mean <= 3.0, "{} m/s, {:?}, {}: {mean} % with biases", row.wind_mps, row.case, row.leak);
    }
    let json = serde_json::to_value(&report).expect("is JSON");
    assert_eq!(json["schema"], "pitchleak.reproduce/1");
    assert_eq!(json["rows"][0]["case"], 1);
    assert!(json["rows"][1]["leakage_mean_error_percent"].is_number());
}
