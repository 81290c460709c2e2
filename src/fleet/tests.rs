use super::*;
use crate::Rig;
use crate::output::Inputs;
use crate::replay::{ReplayError, replay};
use crate::trace::TraceReader;
use pitchleak_core::{Leak, PerLeak};
use pitchleak_testkit::Motion;
use pitchleak_testkit::rig::PAPER;
use pitchleak_testkit::trace_text::file;
use std::fs;
use std::path::Path;
use std::sync::Mutex;
use std::sync::atomic::AtomicBool;
use tempfile::TempDir;

/// Two cylinders of one farm, each with a rig and two days; one file of the second is no trace.
fn farm() -> TempDir {
    let farm = TempDir::new().unwrap();
    for (blade, internal) in [("B1", 1.2e-11), ("B2", 0.0)] {
        let folder = farm.path().join("T7").join(blade);
        fs::create_dir_all(&folder).unwrap();
        fs::write(folder.join("rig.toml"), PAPER).unwrap();
        let motion = Motion::sines(PerLeak { internal, external_a: 0.0, external_b: 0.0 });
        fs::write(folder.join("2026-05-01.csv"), file(&motion.rows(3000))).unwrap();
        fs::write(folder.join("2026-05-02.csv"), file(&motion.rows(1500))).unwrap();
    }
    fs::write(farm.path().join("T7/B2/2026-05-02.csv"), "no trace\n1\n").unwrap();
    farm
}

fn pattern(farm: &TempDir, pattern: &str) -> Vec<String> {
    vec![farm.path().join(pattern).display().to_string()]
}

fn rows(traces: &[FleetTrace]) -> Vec<FleetRow> {
    judge_all(traces, |_| (), &AtomicBool::new(false)).unwrap()
}

#[test]
fn a_row_says_what_a_replay_says() {
    let farm = farm();
    let traces = FleetTrace::find(&pattern(&farm, "**/*.csv"), &FleetRig::Beside).unwrap();
    let seen = Mutex::new(0);
    let rows = judge_all(&traces, |_| *seen.lock().unwrap() += 1, &AtomicBool::new(false)).unwrap();
    assert_eq!((rows.len(), *seen.lock().unwrap()), (4, 4));
    for row in rows.iter().filter(|row| row.error.is_none()) {
        let rig = Rig::beside(Path::new(&row.path)).unwrap();
        let mut reader = TraceReader::open(&row.path, &rig).unwrap();
        let report = replay(&mut reader, &rig, |_, _, _| Ok::<_, ReplayError>(())).unwrap();
        let identity = TraceIdentity { cylinder: row.cylinder.clone(), begins: row.begins };
        assert_eq!(FleetRow::from_bytes(&row.to_bytes().unwrap()).unwrap(), *row);
        assert_eq!(*row, FleetRow::of(&identity, &report, &rig));
        assert!(row.begins.is_some_and(|begins| begins.to_string().starts_with("2026-05-0")));
    }
    let names: Vec<_> = rows.iter().map(|row| row.cylinder.rsplit_once('/').unwrap().1).collect();
    assert_eq!(names, ["B1", "B1", "B2", "B2"]);
    let counts = FleetReport::of(&rows).counts;
    assert_eq!(counts, Counts { leak: 2, sound: 1, error: 1, ..Counts::default() });
}

/// What a day tells of such a leak is neither its flow at the trace's end nor the mean with the time that it was away.
#[test]
fn a_leak_that_comes_and_goes_is_as_large_as_while_it_was_there() {
    let farm = farm();
    let path = farm.path().join("T7/B1/2026-05-01.csv");
    let rows_with = |internal| {
        let motion = Motion::sines(PerLeak { internal, external_a: 0.0, external_b: 0.0 });
        motion.rows(9000)
    };
    let (leaking, sound) = (rows_with(1.2e-11), rows_with(0.0));
    let is_there = |k: usize| (k / 1000) % 3 == 1;
    let mixed = (0..sound.len()).map(|k| if is_there(k) { leaking[k].clone() } else { sound[k].clone() });
    fs::write(&path, file(&mixed.collect::<Vec<_>>())).unwrap();
    let rows = rows(&FleetTrace::find(&pattern(&farm, "T7/B1/*.csv"), &FleetRig::Beside).unwrap());
    let [mixed, always] = &rows[..] else { panic!("{rows:?}") };
    let [there, steady] = [mixed, always].map(|row| row.leaks.unwrap().internal);
    assert_eq!((mixed.status, &mixed.faults[..]), (Some(crate::report::Status::Leak), &[Leak::Internal][..]));
    assert!(there.comes_and_goes && !steady.comes_and_goes);
    assert!((there.mean_lpm - steady.mean_lpm).abs() < 0.15 * steady.mean_lpm, "{there:?} {steady:?}");
    assert_eq!((there.std_lpm, there.ci95), (None, None));
    assert!(there.flow_text().starts_with("comes and goes, 1."));
}

#[test]
fn time_stamps_say_when_before_the_name_does() {
    let farm = farm();
    let path = farm.path().join("T7/B1/2026-05-01.csv");
    let text = fs::read_to_string(&path).unwrap().replacen("t_s", "timestamp", 1);
    let mut lines = text.lines();
    let mut stamped = vec![lines.next().unwrap().to_owned()];
    stamped.extend(lines.map(|line| {
        let (t, rest) = line.split_once(',').unwrap();
        let t: f64 = t.parse().unwrap();
        format!("2026-04-30T23:00:{t:05.2}Z,{rest}")
    }));
    fs::write(&path, stamped.join("\n")).unwrap();
    let traces = FleetTrace::find(&[path.display().to_string()], &FleetRig::Beside).unwrap();
    assert_eq!(rows(&traces)[0].begins.unwrap().to_string(), "2026-04-30T23:00:00Z");
}

#[test]
fn what_cannot_be_judged_is_a_row_with_its_error() {
    let farm = farm();
    fs::write(farm.path().join("T7/B1/rig.toml"), "[cylinder]\nstroke = 1").unwrap();
    let traces = FleetTrace::find(&pattern(&farm, "**/*.csv"), &FleetRig::Beside).unwrap();
    let rows = rows(&traces);
    let errors: Vec<_> = rows.iter().map(|row| row.error.clone().unwrap_or_default()).collect();
    assert!(errors[0].contains("rig.toml") && errors[0] == errors[1] && errors[2].is_empty(), "{errors:?}");
    assert!(errors[3].contains("2026-05-02.csv") && rows[3].status.is_none());
}

#[test]
fn each_file_is_read_once_and_what_is_none_is_told() {
    let farm = farm();
    let mut patterns = pattern(&farm, "T7/B1/*.csv");
    patterns.extend(pattern(&farm, "T7/../T7/B1/2026-05-01.csv"));
    let other = farm.path().join("T7/B1/other.csv");
    fs::hard_link(farm.path().join("T7/B1/2026-05-01.csv"), &other).unwrap();
    patterns.push(other.display().to_string());
    let traces = FleetTrace::find(&patterns, &FleetRig::Beside).unwrap();
    assert_eq!(traces.len(), 2);
    assert_eq!((traces[0].other_names.first(), traces[1].other_names.len()), (Some(&other), 0));
    let error = |name: &str| FleetTrace::find(&pattern(&farm, name), &FleetRig::Beside).unwrap_err();
    assert!(matches!(error("T8/*.csv"), FleetError::NoTrace(_)));
    assert!(matches!(error("T7"), FleetError::Folder(_)));
    assert!(matches!(error("T7/[.csv"), FleetError::Content { .. }));
}

#[test]
fn a_copy_counts_once_and_is_told() {
    let farm = farm();
    let day = |name: &str| farm.path().join("T7").join(name);
    fs::create_dir_all(day("backup")).unwrap();
    fs::copy(day("B1/rig.toml"), day("backup/rig.toml")).unwrap();
    fs::copy(day("B1/2026-05-01.csv"), day("backup/old.csv")).unwrap();
    fs::hard_link(day("backup/old.csv"), day("backup/older.csv")).unwrap();
    // As long as its model, with another last digit; and the same bytes on another machine.
    let text = fs::read_to_string(day("B1/2026-05-02.csv")).unwrap();
    let other = text.trim_end().trim_end_matches(|c: char| c.is_ascii_digit()).len();
    fs::write(
        day("B1/2026-05-03.csv"),
        format!("{}{}\n", &text[..other], "7".repeat(text.trim_end().len() - other)),
    )
    .unwrap();
    fs::create_dir(day("B4")).unwrap();
    fs::write(day("B4/rig.toml"), PAPER.replace("stroke = \"0.2 m\"", "stroke = \"0.3 m\"")).unwrap();
    fs::copy(day("B1/2026-05-01.csv"), day("B4/2026-05-01.csv")).unwrap();
    let traces = FleetTrace::find(&pattern(&farm, "**/*.csv"), &FleetRig::Beside).unwrap();
    let names: Vec<_> = traces
        .iter()
        .map(|trace| trace.path.strip_prefix(farm.path().join("T7")).unwrap().to_str().unwrap())
        .collect();
    let expected = [
        "B1/2026-05-01.csv",
        "B1/2026-05-02.csv",
        "B1/2026-05-03.csv",
        "B2/2026-05-01.csv",
        "B2/2026-05-02.csv",
        "B4/2026-05-01.csv",
    ];
    assert_eq!(names, expected);
    assert_eq!(traces[0].copies, [day("backup/old.csv"), day("backup/older.csv")]);
    let told: Vec<_> = FleetTrace::doubles(&traces).collect();
    assert!(told.len() == 2 && told[0].contains("old.csv is a copy of"), "{told:?}");
    let inputs = FleetTrace::inputs(&traces, &FleetRig::Beside);
    assert!(FleetFile::create(&day("backup/old.csv"), &inputs).is_err());
}

#[test]
fn a_table_says_which_rig_and_whose_trace() {
    let farm = farm();
    let table = farm.path().join("rigs.csv");
    let all = pattern(&farm, "**/2026*.csv");
    fs::write(&table, "trace,rig,cylinder\nT7/B1/*.csv,T7/B2/rig.toml,left\n**/*.csv,T7/B1/rig.toml,\n")
        .unwrap();
    let traces = FleetTrace::find(&all, &FleetRig::from_file(Some(table.clone()))).unwrap();
    let of: Vec<_> =
        traces.iter().map(|trace| (&trace.identity.cylinder[..], trace.rig_file.clone().unwrap())).collect();
    assert_eq!(of[0], ("left", farm.path().join("T7/B2/rig.toml")));
    assert!(of[2].0.ends_with("T7/B2") && of[2].1 == farm.path().join("T7/B1/rig.toml"));
    fs::write(&table, "trace,rig\nT7/B1/*.csv,r.toml\n").unwrap();
    let error = FleetTrace::find(&all, &FleetRig::Table(table.clone())).unwrap_err();
    assert!(matches!(&error, FleetError::NotInTable { others: 1, .. }), "{error}");
    for wrong in ["rig,file\n", "trace,rig\n,r.toml\n", "trace,rig\na,b,c\n", "trace,rig\n***,r.toml\n"] {
        fs::write(&table, wrong).unwrap();
        let error = FleetTrace::find(&all, &FleetRig::Table(table.clone())).unwrap_err();
        assert!(matches!(error, FleetError::Content { .. }), "{wrong}");
    }
}

#[test]
fn a_fleet_that_is_stopped_has_no_rows() {
    let farm = farm();
    let traces = FleetTrace::find(&pattern(&farm, "**/*.csv"), &FleetRig::Beside).unwrap();
    assert_eq!(judge_all(&traces, |_| (), &AtomicBool::new(true)), Err(Stopped));
}

#[test]
fn the_table_reads_back_from_csv() {
    let farm = farm();
    let rows = rows(&FleetTrace::find(&pattern(&farm, "**/*.csv"), &FleetRig::Beside).unwrap());
    let table = FleetTable::of(&rows);
    let path = farm.path().join("fleet.csv");
    FleetFile::create(&path, &Inputs::default()).unwrap().write(&table).unwrap();
    let mut reader = csv::Reader::from_path(&path).unwrap();
    let headers = reader.headers().unwrap().clone();
    let mean = headers.iter().position(|header| header == "internal_lpm").unwrap();
    let records: Vec<_> = reader.records().map(Result::unwrap).collect();
    assert_eq!(records.len(), rows.len());
    for (record, row) in records.iter().zip(&rows) {
        assert_eq!(&record[0], row.cylinder);
        let expected = row.leaks.map_or(String::new(), |leaks| leaks.internal.mean_lpm.to_string());
        assert_eq!(record[mean], expected);
    }
}

#[cfg(feature = "parquet")]
#[test]
fn the_table_reads_back_from_parquet() {
    use parquet::file::reader::{FileReader, SerializedFileReader};
    use parquet::record::Field;
    let farm = farm();
    let rows = rows(&FleetTrace::find(&pattern(&farm, "**/*.csv"), &FleetRig::Beside).unwrap());
    let table = FleetTable::of(&rows);
    let path = farm.path().join("fleet.parquet");
    FleetFile::create(&path, &Inputs::default()).unwrap().write(&table).unwrap();
    let reader = SerializedFileReader::new(fs::File::open(&path).unwrap()).unwrap();
    let read: Vec<_> = reader.get_row_iter(None).unwrap().map(Result::unwrap).collect();
    assert_eq!(read.len(), table.rows());
    for (at, row) in read.iter().enumerate() {
        for ((name, field), (header, column)) in row.get_column_iter().zip(table.columns()) {
            assert_eq!(name, header);
            let same = match (field, column) {
                (Field::Null, column) => column.cell(at).is_empty(),
                (Field::Double(value), _) => column.cell(at) == value.to_string(),
                (Field::Long(value), _) => column.cell(at) == value.to_string(),
                (Field::Bool(value), _) => column.cell(at) == value.to_string(),
                (Field::Str(value), _) => column.cell(at) == *value,
                (Field::TimestampMillis(value), FleetColumn::Times(times)) => {
                    times[at].unwrap().as_millisecond() == *value
                }
                _ => false,
            };
            assert!(same, "{header} {field:?}");
        }
    }
}

#[test]
fn a_table_has_a_format_and_is_written_over_no_trace() {
    let farm = farm();
    let rigs = FleetRig::Beside;
    let traces = FleetTrace::find(&pattern(&farm, "**/*.csv"), &rigs).unwrap();
    let inputs = FleetTrace::inputs(&traces, &rigs);
    let create = |name: &str| FleetFile::create(&farm.path().join(name), &inputs).err().unwrap();
    assert!(matches!(create("fleet.xlsx"), FleetError::Kind(_)));
    assert!(matches!(create("T7/B1/2026-05-01.csv"), FleetError::Output(_)));
}

#[test]
fn a_leak_that_grows_from_day_to_day_is_told() {
    let farm = TempDir::new().unwrap();
    for day in 1..=5 {
        let internal = 0.8e-12 + 0.02e-12 * f64::from(day);
        let motion = Motion::sines(PerLeak { internal, external_a: 0.0, external_b: 0.0 });
        fs::write(farm.path().join(format!("2026-05-0{day}.csv")), file(&motion.rows(2000))).unwrap();
    }
    fs::write(farm.path().join("rig.toml"), PAPER).unwrap();
    let rows = rows(&FleetTrace::find(&pattern(&farm, "*.csv"), &FleetRig::Beside).unwrap());
    let report = FleetReport::of(&rows);
    let internal = report.trends[0].leaks.internal.unwrap();
    assert_eq!((report.trends.len(), internal.traces), (1, 5));
    let flow = |at: usize| rows[at].leaks.unwrap().internal.mean_lpm;
    let expected = (flow(4) - flow(0)) / (4.0 * 24.0);
    let slope = internal.trend.slope();
    assert!((slope.value - expected).abs() < slope.half_width95(), "{slope:?} {expected}");
    assert!((internal.mean_lpm - flow(4)).abs() < 0.01);
    let json: serde_json::Value = serde_json::from_str(&report.to_json().unwrap()).unwrap();
    assert_eq!(json["trends"][0]["leaks"]["internal"]["traces"], 5);
}

#[cfg(feature = "parquet")]
#[test]
fn time_stamps_of_parquet_say_when() {
    use parquet::basic::{LogicalType, Repetition, TimeUnit, Type as Physical};
    use parquet::data_type::{DoubleType, Int64Type};
    use parquet::file::writer::SerializedFileWriter;
    use parquet::schema::types::Type;
    use std::sync::Arc;
    let farm = TempDir::new().unwrap();
    let folder = farm.path().join("turbine=T7/blade=B2");
    fs::create_dir_all(&folder).unwrap();
    let micros = LogicalType::timestamp(true, TimeUnit::MICROS);
    let stamp = Type::primitive_type_builder("timestamp", Physical::INT64).with_logical_type(Some(micros));
    let double = |name| Type::primitive_type_builder(name, Physical::DOUBLE);
    let columns = [stamp].into_iter().chain(["x_m", "pa_pa", "pb_pa", "qa_m3s", "qb_m3s"].map(double));
    let field = |column: parquet::schema::types::PrimitiveTypeBuilder<'_>| {
        Arc::new(column.with_repetition(Repetition::REQUIRED).build().unwrap())
    };
    let schema =
        Type::group_type_builder("schema").with_fields(columns.map(field).collect()).build().unwrap();
    let out = fs::File::create(folder.join("part-0.parquet")).unwrap();
    let mut writer = SerializedFileWriter::new(out, Arc::new(schema), Arc::default()).unwrap();
    let mut group = writer.next_row_group().unwrap();
    let motion = Motion::sines(PerLeak { internal: 1.2e-11, external_a: 0.0, external_b: 0.0 });
    let samples: Vec<_> = (0..3000).map(|k| motion.sample(f64::from(k) * 0.01)).collect();
    let begins_us = 1_777_615_200_000_000;
    let stamps: Vec<i64> = (0..3000).map(|k| begins_us + 10_000 * k).collect();
    let mut column = group.next_column().unwrap().unwrap();
    column.typed::<Int64Type>().write_batch(&stamps, None, None).unwrap();
    column.close().unwrap();
    for number in 0..5 {
        let reading = |s: &pitchleak_core::Sample<f64>| {
            [s.x_m, s.pa_pa, s.pb_pa, s.qa_m3s.unwrap(), s.qb_m3s.unwrap()][number]
        };
        let values: Vec<f64> = samples.iter().map(reading).collect();
        let mut column = group.next_column().unwrap().unwrap();
        column.typed::<DoubleType>().write_batch(&values, None, None).unwrap();
        column.close().unwrap();
    }
    group.close().unwrap();
    writer.close().unwrap();
    let rows = rows(&FleetTrace::find(&pattern(&farm, "**/*.parquet"), &FleetRig::Beside).unwrap());
    assert_eq!((rows[0].cylinder.as_str(), rows[0].error.as_deref()), ("T7/B2", None));
    assert_eq!(rows[0].begins.unwrap().to_string(), "2026-05-01T06:00:00Z");
}
