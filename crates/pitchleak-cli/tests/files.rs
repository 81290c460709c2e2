//! Files as loggers write them, many at once, and what the program says of them.

#![allow(clippy::unwrap_used)]

use std::path::Path;
use std::process::{Command, Output};

fn pitchleak(arguments: &[&str], folder: &Path) -> Output {
    Command::new(env!("CARGO_BIN_EXE_pitchleak")).args(arguments).current_dir(folder).output().unwrap()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).unwrap()
}

/// 200 rows of `cells`, under `header`.
fn write(folder: &Path, name: &str, header: &str, cells: impl Fn(f64) -> String) {
    let rows: Vec<String> = (0..200).map(|i| cells(f64::from(i))).collect();
    std::fs::write(folder.join(name), format!("{header}\n{}\n", rows.join("\n"))).unwrap();
}

fn plain(i: f64) -> String {
    format!("{:.2},{:.4},{:.3},40.5,1.2,-0.9", 0.01 * i, 100.0 + i.sin(), 50.0 + i.cos())
}

fn european(i: f64) -> String {
    plain(i).replace(',', ";").replace('.', ",")
}

#[test]
fn a_european_file_is_read_and_said() {
    let folder = tempfile::tempdir().unwrap();
    write(folder.path(), "a.csv", "t_s,x_mm,pa_bar,pb_bar,qa_lpm,qb_lpm", plain);
    let header =
        "sep=;\nTime [s];Position [mm];Pressure A [bar];Pressure B [bar];Flow A [L/min];Flow B [L/min]";
    write(folder.path(), "b.csv", header, european);
    let outputs = ["a.csv", "b.csv"].map(|name| pitchleak(&["replay", name, "--json"], folder.path()));
    let estimates = |output: &Output| {
        let report: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
        (report["estimates"].clone(), report["verdict"]["status"].clone())
    };
    assert_eq!(estimates(&outputs[0]), estimates(&outputs[1]));
    assert_eq!(text(&outputs[0].stderr), "");
    let said = text(&outputs[1].stderr);
    assert!(
        said.starts_with("note: b.csv read with semicolon between cells, decimal comma, header in line 2"),
        "{said}"
    );
}

#[test]
fn many_traces_are_many_reports() {
    let folder = tempfile::tempdir().unwrap();
    write(folder.path(), "a.csv", "t_s,x_mm,pa_bar,pb_bar,qa_lpm,qb_lpm", plain);
    write(folder.path(), "b.csv", "t_s,x_mm,pa_bar,pb_bar,qa_lpm,qb_lpm", plain);
    for command in ["replay", "check"] {
        let output = pitchleak(&[command, "a.csv", "b.csv", "--json"], folder.path());
        assert_eq!((output.status.code(), text(&output.stdout).lines().count()), (Some(0), 2), "{command}");
        let output = pitchleak(&[command, "a.csv", "none.csv", "b.csv"], folder.path());
        let said = text(&output.stderr);
        assert_eq!(
            (output.status.code(), text(&output.stdout).matches("a.csv").count()),
            (Some(2), 1),
            "{said}"
        );
        assert!(
            text(&output.stdout).contains("b.csv") && said.contains("1 of 3 traces could not be judged"),
            "{said}"
        );
    }
    let output = pitchleak(&["replay", "a.csv", "b.csv", "--out", "e.csv"], folder.path());
    assert!(
        output.status.code() == Some(2)
            && text(&output.stderr).contains("--out is of one trace: 2 are given")
    );
}

#[test]
fn columns_proposes_what_replay_then_reads() {
    let folder = tempfile::tempdir().unwrap();
    write(
        folder.path(),
        "x.csv",
        "Counter,Stroke [mm],Head pressure [bar],Rod pressure [bar],Flow head [l/min],Flow rod [l/min]",
        plain,
    );
    let refused = pitchleak(&["replay", "x.csv"], folder.path());
    assert_eq!(refused.status.code(), Some(2));
    assert!(
        text(&refused.stderr).contains("t = { name = \"Counter\", unit = \"s\" }"),
        "{}",
        text(&refused.stderr)
    );
    let shown = pitchleak(&["columns", "x.csv"], folder.path());
    assert!(
        text(&shown.stdout).contains("pa = { name = \"Head pressure [bar]\", unit = \"bar\" }"),
        "{}",
        text(&shown.stdout)
    );
    let json: serde_json::Value =
        serde_json::from_slice(&pitchleak(&["columns", "x.csv", "--json"], folder.path()).stdout).unwrap();
    let lines =
        json["proposals"].as_array().unwrap().iter().map(|line| line["line"].as_str().unwrap().to_owned());
    let rig =
        pitchleak::Rig::paper().to_toml() + "[columns]\n" + &lines.collect::<Vec<_>>().join("\n") + "\n";
    std::fs::write(folder.path().join("rig.toml"), rig).unwrap();
    let read = pitchleak(&["replay", "x.csv"], folder.path());
    assert_eq!(read.status.code(), Some(0), "{}", text(&read.stderr));
    assert!(text(&pitchleak(&["columns", "x.csv"], folder.path()).stdout).contains("It is read as it is."));
}

#[test]
fn estimates_are_written_as_parquet() {
    let folder = tempfile::tempdir().unwrap();
    write(folder.path(), "a.csv", "t_s,x_mm,pa_bar,pb_bar,qa_lpm,qb_lpm", plain);
    let output = pitchleak(&["replay", "a.csv", "--out", "e.parquet"], folder.path());
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    let bytes = std::fs::read(folder.path().join("e.parquet")).unwrap();
    assert!(bytes.starts_with(b"PAR1") && bytes.ends_with(b"PAR1"));
    let columns = pitchleak(&["columns", "e.parquet"], folder.path());
    assert!(text(&columns.stderr).contains("no column for"), "{}", text(&columns.stderr));
}

#[test]
fn manual_pages_are_of_the_program_and_its_commands() {
    let folder = tempfile::tempdir().unwrap();
    for (arguments, name) in [(vec!["man"], "pitchleak"), (vec!["man", "replay"], "pitchleak-replay")] {
        let page = text(&pitchleak(&arguments, folder.path()).stdout);
        assert!(page.contains(".TH") && page.contains(&name.replace('-', "\\-")), "{page}");
    }
    assert_eq!(pitchleak(&["man", "fly"], folder.path()).status.code(), Some(2));
}
