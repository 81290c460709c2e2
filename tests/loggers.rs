//! Twenty-seven files as loggers write them, by the way of a new user: as it is; else with the lines that `init` proposes. Each
//! gives the right verdict, or one line with its remedy; none a wrong one.

#![allow(clippy::unwrap_used)]

use flate2::read::GzDecoder;
use pitchleak::Rig;
use pitchleak::core::Leak;
use pitchleak::replay::{ReplayError, replay};
use pitchleak::report::Status;
use pitchleak::trace::{FileReading, TraceReader};
use std::io::Read;
use std::path::{Path, PathBuf};

const NAMES: [&str; 5] = ["x_mm", "pa_bar", "pb_bar", "qa_lpm", "qb_lpm"];
const PEOPLE: [&str; 5] = ["Position", "Pressure A", "Pressure B", "Flow A", "Flow B"];
const UNITS: [&str; 5] = ["mm", "bar", "bar", "l/min", "l/min"];

/// Time in ms and x, P_A, P_B, Q_A, Q_B as text.
type Row = (i64, [String; 5]);

fn trace() -> Vec<Row> {
    let mut text = String::new();
    let file = std::fs::File::open("data/traces/internal.csv.gz").unwrap();
    GzDecoder::new(file).read_to_string(&mut text).unwrap();
    let row = |(at, line): (usize, &str)| {
        let mut cells = line.split(',').skip(1).map(str::to_owned);
        (10 * at as i64, std::array::from_fn(|_| cells.next().unwrap()))
    };
    text.lines().skip(1).enumerate().map(row).collect()
}

/// Seconds with so many decimals.
fn seconds(ms: i64, decimals: usize) -> String {
    format!("{:.decimals$}", ms as f64 / 1e3)
}

fn stamp(ms: i64, pattern: &str) -> String {
    let start = jiff::civil::date(2026, 11, 20).at(22, 10, 31, 0);
    start.checked_add(jiff::Span::new().milliseconds(ms)).unwrap().strftime(pattern).to_string()
}

const ISO: &str = "%Y-%m-%dT%H:%M:%S%.3f";

/// A table with a row per time.
fn wide(rows: &[Row], header: &str, delimiter: &str, time: impl Fn(i64) -> String) -> String {
    let row = |(ms, cells): &Row| format!("{}{delimiter}{}\n", time(*ms), cells.join(delimiter));
    format!("{header}\n{}", rows.iter().map(row).collect::<String>())
}

fn names(time: &str, names: [&str; 5], delimiter: &str) -> String {
    format!("{time}{delimiter}{}", names.join(delimiter))
}

fn with_units(open: &str, close: &str) -> [String; 5] {
    std::array::from_fn(|place| format!("{}{open}{}{close}", PEOPLE[place], UNITS[place]))
}

fn comma(text: &str) -> String {
    text.replace('.', ",")
}

/// A table with a row per reading.
fn long(rows: &[Row], header: &str, one: impl Fn(i64, usize, &str) -> String) -> String {
    let row = |(ms, cells): &Row| -> String {
        cells.iter().enumerate().map(|(place, cell)| one(*ms, place, cell) + "\n").collect()
    };
    format!("{header}\n{}", rows.iter().map(row).collect::<String>())
}

/// Each channel behind a column of its times, the flows at 20 Hz.
fn own_times(rows: &[Row], header: &str, delimiter: &str, time: impl Fn(i64) -> String) -> String {
    let mut text = header.to_owned() + "\n";
    for at in 0..rows.len() {
        let cell = |place: usize| {
            let from = if place < 3 { at } else { 5 * at };
            let read = rows.get(from).map(|(ms, cells)| format!("{}{delimiter}{}", time(*ms), cells[place]));
            read.unwrap_or_else(|| delimiter.to_owned())
        };
        text.push_str(&((0..5).map(cell).collect::<Vec<_>>().join(delimiter) + "\n"));
    }
    text
}

/// Cells that are there.
fn thinned(rows: &[Row], keeps: impl Fn(usize, usize) -> bool) -> Vec<Row> {
    let cell =
        |k: usize, place: usize, cell: &String| if keeps(k, place) { cell.clone() } else { String::new() };
    let row =
        |(k, (ms, cells)): (usize, &Row)| (*ms, std::array::from_fn(|place| cell(k, place, &cells[place])));
    rows.iter().enumerate().map(row).collect()
}

fn labview(rows: &[Row]) -> String {
    let five = |name: &str, cell: &str| format!("{name}\t{}\n", [cell; 5].join("\t"));
    let head = "LabVIEW Measurement\t\nWriter_Version\t2\nReader_Version\t2\nSeparator\tTab\nDecimal_Separator\t.\n\
                Multi_Headings\tNo\nX_Columns\tOne\nTime_Pref\tRelative\n***End_of_Header***\t\n\t\nChannels\t5\n";
    let head = head.to_owned()
        + &five("Samples", "4000")
        + &five("Date", "2026/11/20")
        + &five("Time", "22:10:31.5");
    let head = head + &five("X_Dimension", "Time") + &five("X0", "0.0") + &five("Delta_X", "0.010000");
    let head = head + "***End_of_Header***\t\t\t\t\t\n" + &names("X_Value", NAMES, "\t") + "\tComment";
    wide(rows, &head, "\t", |ms| seconds(ms, 6))
}

fn influx(rows: &[Row]) -> String {
    let head = "#datatype,string,long,dateTime:RFC3339,dateTime:RFC3339,dateTime:RFC3339,double,string,string\n\
                #group,false,false,true,true,false,false,true,true\n#default,_result,,,,,,,\n";
    let mut text = head.to_owned();
    for (place, name) in NAMES.iter().enumerate() {
        text.push_str(",result,table,_start,_stop,_time,_value,_field,_measurement\n");
        for (ms, cells) in rows {
            let time = stamp(*ms, ISO);
            text.push_str(&format!(
                ",,{place},2026-11-20T22:00:00Z,2026-11-20T23:00:00Z,{time}Z,{},{name},pitch\n",
                cells[place]
            ));
        }
        text.push('\n');
    }
    text
}

fn wincc(rows: &[Row]) -> String {
    let header = "\"VarName\";\"TimeString\";\"VarValue\";\"Validity\";\"Time_ms\"";
    long(rows, header, |ms, place, cell| {
        let millionths = comma(&format!("{:.5}", (46_346.924 + ms as f64 / 86_400e3) * 1e6));
        format!("\"{}\";\"20.11.2026 22:10:31\";{};1;{millionths}", NAMES[place], comma(cell))
    })
}

fn grafana(rows: &[Row]) -> String {
    let row = |(ms, cells): &Row| {
        let cell = |place: usize| format!("{} {}", cells[place], UNITS[place]);
        format!(
            "{},{}\n",
            stamp(*ms, "%Y-%m-%d %H:%M:%S%.3f"),
            (0..5).map(cell).collect::<Vec<_>>().join(",")
        )
    };
    format!("\"Time\",\"{}\"\n{}", PEOPLE.join("\",\""), rows.iter().map(row).collect::<String>())
}

/// Names of the files, and what stands in each.
fn files(rows: &[Row]) -> Vec<(&'static str, String)> {
    let people = with_units(" [", "]");
    let [a, b, c, d, e] = people.each_ref().map(String::as_str);
    let people = [a, b, c, d, e];
    let german =
        ["Kolbenweg (mm)", "Druck A (bar)", "Druck B (bar)", "Durchfluss A (l/min)", "Durchfluss B (l/min)"];
    let plain = names("t_s", NAMES, ",");
    let tenths: Vec<Row> = rows.iter().step_by(10).cloned().collect();
    let own =
        |time: &str, delimiter: &str| people.map(|name| format!("{time}{delimiter}{name}")).join(delimiter);
    let shuffled = |text: String| {
        let mut lines: Vec<&str> = text.lines().skip(1).collect();
        lines.sort_by_key(|line| line.bytes().map(usize::from).sum::<usize>() % 101);
        format!("Timestamp,Tag,Value,Unit,Quality\n{}\n", lines.join("\n"))
    };
    let excel = |time: &str| comma(&wide(rows, &names(time, people, ";"), ";", |ms| seconds(ms, 2)));
    vec![
        ("ours", wide(rows, &plain, ",", |ms| seconds(ms, 2))),
        ("spreadsheet, English", wide(rows, &names("Time [s]", people, ","), ",", |ms| seconds(ms, 2))),
        ("spreadsheet, German", excel("Zeit [s]")),
        (
            "spreadsheet, German names",
            comma(&wide(rows, &names("Zeit (s)", german, ";"), ";", |ms| seconds(ms, 2))),
        ),
        (
            "spreadsheet, mm:ss,0",
            comma(&wide(&tenths, &names("Time", people, ";"), ";", |ms| {
                format!("{:02}:{:04.1}", ms / 60_000, (ms % 60_000) as f64 / 1e3)
            })),
        ),
        (
            "spreadsheet, AM and PM",
            wide(rows, &names("Date/Time", people, ","), ",", |ms| stamp(ms, "%m/%d/%Y %I:%M:%S%.3f %p")),
        ),
        (
            "row of units",
            wide(rows, &format!("{}\ns,{}", names("Time", PEOPLE, ","), UNITS.join(",")), ",", |ms| {
                seconds(ms, 2)
            }),
        ),
        (
            "row of units in brackets",
            wide(rows, &format!("{}\n[s];[{}]", names("Time", PEOPLE, ";"), UNITS.join("];[")), ";", |ms| {
                seconds(ms, 2)
            }),
        ),
        ("preamble", wide(rows, &format!("Recorder 7\nSerial,0815\n\n{plain}"), ",", |ms| seconds(ms, 2))),
        (
            "ISO with zone",
            wide(rows, &names("timestamp", NAMES, ","), ",", |ms| stamp(ms, "%Y-%m-%dT%H:%M:%S%.3f+01:00")),
        ),
        (
            "epoch ms",
            wide(rows, &names("timestamp", NAMES, ","), ",", |ms| (1_795_212_631_000 + ms).to_string()),
        ),
        (
            "epoch us",
            wide(rows, &names("timestamp", NAMES, ","), ",", |ms| {
                (1_795_212_631_000_000 + 1000 * ms).to_string()
            }),
        ),
        (
            "points in dates",
            comma(&wide(rows, &names("Zeitstempel", people, ";"), ";", |ms| {
                stamp(ms, "%d.%m.%Y %H:%M:%S.%3f")
            }))
            .replace("20,11,2026", "20.11.2026"),
        ),
        (
            "date and time apart",
            wide(rows, &names("Datum;Uhrzeit", NAMES, ";"), ";", |ms| stamp(ms, "%d.%m.%Y;%H:%M:%S%.3f")),
        ),
        ("influx, a reading per row", influx(rows)),
        (
            "influx, pivoted",
            wide(
                rows,
                &format!(
                    "#datatype,string,long,dateTime:RFC3339,double,double,double,double,double\n#group,false,false,false,false,false,false,false,false\n#default,_result,,,,,,,\n,result,table,{}",
                    names("_time", NAMES, ",")
                ),
                ",",
                |ms| format!(",,0,{}Z", stamp(ms, ISO)),
            ),
        ),
        ("dashboard, units in cells", grafana(rows)),
        ("process log", wincc(rows)),
        (
            "historian",
            shuffled(long(rows, "", |ms, place, cell| {
                format!("{}Z,{},{cell},{},Good", stamp(ms, ISO), PEOPLE[place], UNITS[place])
            })),
        ),
        ("measurement file", labview(rows)),
        ("own times, seconds", own_times(rows, &own("Time [s]", ";"), ";", |ms| seconds(ms, 3))),
        ("own times, stamps", own_times(rows, &own("Time", "\t"), "\t", |ms| stamp(ms, ISO))),
        (
            "flows at 10 Hz",
            wide(&thinned(rows, |k, place| place < 3 || k % 10 == 0), &plain, ",", |ms| seconds(ms, 2)),
        ),
        (
            "each channel in its rows",
            wide(&thinned(rows, |k, place| k % 5 == place), &plain, ",", |ms| seconds(ms, 2)),
        ),
        (
            "foreign names",
            wide(
                rows,
                &names("Time", ["Stroke", "Head pressure", "Rod pressure", "Flow head", "Flow rod"], ","),
                ",",
                |ms| stamp(ms, ISO),
            ),
        ),
        ("nothing but numbers' names", wide(rows, "n,AI0,AI1,AI2,AI3,AI4", ",", |ms| seconds(ms, 2))),
        (
            "averages of a second",
            wide(&rows.iter().step_by(100).cloned().collect::<Vec<_>>(), &plain, ",", |ms| seconds(ms, 2)),
        ),
    ]
}

enum Outcome {
    Right,
    Told(String),
    Wrong(String),
}

fn judged(path: &Path, rig: &Rig) -> Outcome {
    let report = TraceReader::open(path, rig).map_err(|error| error.to_string()).and_then(|mut reader| {
        replay(&mut reader, rig, |_, _, _| Ok::<(), ReplayError>(())).map_err(|error| error.to_string())
    });
    match report {
        Err(said) => Outcome::Told(said),
        Ok(report) if report.verdict.status == Status::Leak && report.verdict.faults == [Leak::Internal] => {
            Outcome::Right
        }
        Ok(report) if report.verdict.status.is_sure() => Outcome::Wrong(report.verdict.text),
        Ok(report) => Outcome::Told(report.verdict.text),
    }
}

/// As `init` would write it, with the cylinder's numbers filled in.
fn begun(path: &Path, rig: &str) -> Result<Rig, String> {
    let reading = FileReading::of(path, &Rig::paper()).map_err(|error| error.to_string())?;
    let lines = reading.proposals.iter().chain(&reading.named).map(|line| line.line.as_str());
    let text = format!("{rig}\n[columns]\n{}\n", lines.collect::<Vec<_>>().join("\n"));
    Rig::parse(&text, "rig.toml").map_err(|error| error.to_string())
}

#[test]
fn loggers_files_are_judged_right_or_told_what_is_missing() {
    let folder = tempfile::tempdir().unwrap();
    let declared = std::fs::read_to_string("data/traces/rig.toml").unwrap();
    let rig = Rig::parse(&declared, "rig.toml").unwrap();
    let files = files(&trace());
    assert_eq!(files.len(), 27);
    let (mut right, mut at_once) = (0, 0);
    for (name, text) in &files {
        let path: PathBuf = folder.path().join("trace.csv");
        std::fs::write(&path, text).unwrap();
        let first = judged(&path, &rig);
        at_once += usize::from(matches!(first, Outcome::Right));
        let outcome = match first {
            Outcome::Told(_) => begun(&path, &declared).map_or_else(Outcome::Told, |rig| judged(&path, &rig)),
            other => other,
        };
        match outcome {
            Outcome::Right => right += 1,
            Outcome::Told(said) => println!("{name}: {said}"),
            Outcome::Wrong(said) => panic!("{name}: {said}"),
        }
    }
    println!("{right} of 27 right, {at_once} as they are");
    assert!(right >= 24, "{right} of 27");
}
