//! Mistakes at the command line: each ends with status 2 and one line that says what is allowed, and none is accepted in silence.

#![allow(clippy::unwrap_used)]

use std::path::Path;
use std::process::Command;

const ROWS: &str = "t_s,x_mm,pa_bar,pb_bar,qa_lpm,qb_lpm\n0.00,100,50,40,1,-1\n0.01,100.1,50,40,1,-1\n";
const HALF: &str = "[cylinder]\narea_a = \"12.6 cm^2\"\n";

/// Arguments, apart by `|`, and what the line says.
const MISTAKES: [(&str, &str); 51] = [
    ("repaly|a.csv", "a similar subcommand exists: 'replay'"),
    ("replay", "usage: pitchleak replay <TRACE>..."),
    ("replay|none.csv", "none.csv: No such file"),
    ("none.csv", "none.csv: No such file"),
    ("replay|.", "a folder, not a trace: name the files in it"),
    ("replay|a.csv|--rigg|rig.toml", "a similar argument exists: '--rig'"),
    ("replay|a.csv|--rig|none.toml", "none.toml: No such file"),
    ("replay|a.csv|--rig|a.csv", "a.csv:1: not a TOML file"),
    ("replay|a.csv|--rig|half.toml", "area_b"),
    ("replay|rig.toml", "a rig file, not a trace: give it by `--rig FILE`"),
    ("replay|page.html", "a page for a browser"),
    ("replay|empty.csv", "the trace is empty"),
    ("replay|a.csv|--estimator|rsl", "one of: rls, paper"),
    ("replay|a.csv|--out|est.xlsx", "written as .csv, .csv.gz or .parquet"),
    ("replay|a.csv|--out|a.csv", "not written over the run's own input"),
    ("replay|a.csv|--report|r.pdf", "a report is written as .html"),
    ("replay|a.csv|b.csv|--out|e.csv", "--out is of one trace"),
    ("replay|a.csv|--json=yes", "'--json'"),
    ("replay|a.csv|--delimiter|colon", "one of: comma, semicolon, tab, bar"),
    ("replay|a.csv|--decimal|dot", "one of: point, comma"),
    ("replay|a.csv|--time-format|german", "one of: iso, dmy"),
    ("replay|--join|a.csv|b.csv", "columns"),
    ("check|a.csv|--out|x.csv", "unexpected argument '--out'"),
    ("simulate|--wind|7|--out|x.csv", "built in are the winds 5, 13, 21 and 30"),
    ("simulate|--wind|13", "usage: pitchleak simulate"),
    ("simulate|--wind|13|--out|x.txt", "written as .csv or .csv.gz"),
    ("simulate|--wind|13|--leak-internal|0.5|--out|x.csv", "a leak needs its unit, e.g. \"0.5 L/min\""),
    ("simulate|--wind|13|--leak-internal|0.5 L|--out|x.csv", "L/min"),
    ("simulate|--wind|13|--leak-internal|-0.5 L/min|--out|x.csv", "must not be negative"),
    ("simulate|--wind|13|--noise|lots|--out|x.csv", "`none`, or `rig`"),
    ("simulate|--wind|13|--effect|foo=1|--out|x.csv", "the known ones are dead_volume_a"),
    ("simulate|--wind|13|--effect|dead_volume_a|--out|x.csv", "id=value"),
    ("simulate|--wind|13|--fault|qa brocken|--out|x.csv", "dead, stuck, missing"),
    ("simulate|--wind|13|--duration|0 s|--out|x.csv", "must lie between"),
    ("simulate|--wind|13|--sample-rate|0|--out|x.csv", "must lie between"),
    ("simulate|--wind|13|--seed|abc|--out|x.csv", "'--seed <N>'"),
    ("simulate|--wind|13|--position-scale|10|--out|x.csv", "take a smaller position scale"),
    ("simulate|--position|500 mm|--load|1 kN|--out|x.csv", "beyond the cylinder's stroke (0 to 200 mm)"),
    ("simulate|--position|100 mm|--wind|13|--out|x.csv", "cannot be used with '--wind"),
    ("simulate|--position|100 mm|--out|x.csv", "--load <F|FILE>"),
    ("diagnose", "usage: pitchleak diagnose"),
    ("diagnose|a.csv|--test|a.csv", "both fitted and judged on"),
    ("columns|none.csv", "none.csv: No such file"),
    ("init|a.csv", "rig.toml is there already"),
    ("fleet|*.nothing|--out|f.csv", "*.nothing: no such trace"),
    ("fleet|a.csv|--out|f.txt", "written as .parquet, .csv or .csv.gz"),
    ("watch|--format|xml", "one of: ndjson, csv, influx"),
    ("prove|a.csv|--leak-internal|5", "a flow needs its unit, e.g. \"0.3 L/min\""),
    ("prove|-", "give a file"),
    ("explanations|--foo", "unexpected argument '--foo'"),
    ("completions|tcsh", "possible values: bash"),
];

fn run(arguments: &str, folder: &Path) -> (Option<i32>, String) {
    let mut command = Command::new(env!("CARGO_BIN_EXE_pitchleak"));
    let output =
        command.args(arguments.split('|').filter(|part| !part.is_empty())).current_dir(folder).output();
    let output = output.unwrap();
    (output.status.code(), String::from_utf8(output.stderr).unwrap())
}

#[test]
fn each_mistake_is_one_line_with_its_remedy() {
    let folder = tempfile::tempdir().unwrap();
    let rig = include_str!("../../../data/traces/rig.toml");
    let page = "<!doctype html><html>";
    let files = [
        ("a.csv", ROWS),
        ("b.csv", ROWS),
        ("rig.toml", rig),
        ("half.toml", HALF),
        ("page.html", page),
        ("empty.csv", ""),
    ];
    for (name, text) in files {
        std::fs::write(folder.path().join(name), text).unwrap();
    }
    for (arguments, words) in MISTAKES {
        let (status, said) = run(arguments, folder.path());
        assert_eq!(status, Some(2), "{arguments}: {said}");
        assert_eq!(said.lines().count(), 1, "{arguments}: {said}");
        assert!(said.starts_with("error: ") && said.contains(words), "{arguments}: {said}");
    }
    let left: Vec<_> =
        std::fs::read_dir(folder.path()).unwrap().map(|entry| entry.unwrap().file_name()).collect();
    assert_eq!(left.len(), files.len(), "{left:?}");
}
