use crate::Rig;
use crate::read::{FileReading, Record, TraceError, TraceReader};

/// The paper's rig with the lines that `columns` proposes, as a new user would paste them.
fn rig_for(text: &str) -> Rig {
    let file = tempfile::NamedTempFile::new().unwrap();
    std::fs::write(file.path(), text).unwrap();
    let reading = FileReading::of(file.path(), &Rig::paper()).unwrap();
    let lines = reading.proposals.iter().chain(&reading.named).map(|line| line.line.as_str());
    let lines = lines.collect::<Vec<_>>().join("\n");
    Rig::parse(&format!("{}[columns]\n{lines}\n", Rig::paper().to_toml()), "rig.toml").unwrap()
}

fn read_by(text: &str, rig: &Rig) -> Result<(Vec<Record>, String), TraceError> {
    let mut reader = TraceReader::from_stream("trace", Box::new(std::io::Cursor::new(text.to_owned())), rig)?;
    let (mut records, mut record) = (Vec::new(), Record::default());
    while reader.next_record(&mut record)? {
        records.push(record);
    }
    Ok((records, reader.quality().reading.clone().unwrap_or_default()))
}

const ROWS: u32 = 40;

/// Position in mm, pressures in bar, flow A in L/min at a tick of 10 ms.
fn values(i: u32) -> [(&'static str, f64); 4] {
    let i = f64::from(i);
    [("x_mm", 100.0 + i), ("pa_bar", 50.0 + 0.5 * i), ("pb_bar", 40.0), ("qa_lpm", 6.0 - 0.25 * i)]
}

fn assert_is_the_trace(text: &str, shape: &str) {
    let plain = (0..ROWS).map(|i| {
        let [x, pa, pb, qa] = values(i).map(|(_, value)| value);
        format!("{:.2},{x},{pa},{pb},{qa}\n", f64::from(i) / 100.0)
    });
    let plain = "t_s,x_mm,pa_bar,pb_bar,qa_lpm\n".to_owned() + &plain.collect::<String>();
    let (expected, _) = read_by(&plain, &Rig::paper()).unwrap();
    let (found, said) = read_by(text, &rig_for(text)).unwrap_or_else(|error| panic!("{shape}: {error}"));
    assert!(said.contains(shape), "{said}");
    assert_eq!(found.len(), expected.len(), "{shape}");
    for (found, expected) in found.iter().zip(&expected) {
        assert!((found.t_s - expected.t_s).abs() < 2e-6, "{shape}: {} s, not {} s", found.t_s, expected.t_s);
        assert_eq!(found.sample, expected.sample, "{shape}");
    }
}

fn stamp(i: u32) -> String {
    format!("2026-11-20T22:10:31.{:03}Z", 10 * i)
}

/// A result of a query, one series after the other, as `influx query --raw` and the export of a dashboard write it.
#[test]
fn influx_annotated_csv_is_read_long() {
    let mut text =
        "#datatype,string,long,dateTime:RFC3339,dateTime:RFC3339,dateTime:RFC3339,double,string,string\r\n\
                    #group,false,false,true,true,false,false,true,true\r\n#default,_result,,,,,,,\r\n"
            .to_owned();
    for table in 0..4 {
        text.push_str(",result,table,_start,_stop,_time,_value,_field,_measurement\r\n");
        for i in 0..ROWS {
            let (name, value) = values(i)[table];
            text.push_str(&format!(
                ",,{table},2026-11-20T22:00:00Z,2026-11-20T23:00:00Z,{},{value},{name},pitch\r\n",
                stamp(i)
            ));
        }
        text.push_str("\r\n");
    }
    assert_is_the_trace(&text, "a reading per row");
    // Each measurement with one field, as some collectors write.
    let by_measurement = values(0)
        .iter()
        .fold(text, |text, (name, _)| text.replace(&format!(",{name},pitch"), &format!(",value,{name}")));
    assert_is_the_trace(&by_measurement, "a reading per row");
}

#[test]
fn influx_annotated_csv_is_read_pivoted() {
    let mut text = "#datatype,string,long,dateTime:RFC3339,double,double,double,double\n\
                    #group,false,false,false,false,false,false,false\n#default,_result,,,,,,\n\
                    ,result,table,_time,pa_bar,pb_bar,qa_lpm,x_mm\n"
        .to_owned();
    for i in 0..ROWS {
        let [x, pa, pb, qa] = values(i).map(|(_, value)| value);
        text.push_str(&format!(",,0,{},{pa},{pb},{qa},{x}\n", stamp(i)));
    }
    assert_is_the_trace(&text, "header in line 4");
}

/// Millionths of days, decimal commas, and a line where the runtime was left.
#[test]
fn a_log_of_wincc_is_read() {
    let mut text = "\"VarName\";\"TimeString\";\"VarValue\";\"Validity\";\"Time_ms\"\n".to_owned();
    for i in 0..ROWS {
        for (name, value) in values(i) {
            let millionths = (46_346.924 + f64::from(i) * 0.01 / 86_400.0) * 1e6;
            text.push_str(
                &format!("\"{name}\";\"20.11.2026 22:10:31\";{value};1;{millionths:.5}\n")
                    .replacen('.', ".", 2),
            );
        }
        // What is not valid is no reading.
        text.push_str("\"pb_bar\";\"20.11.2026 22:10:31\";999;0;46346924000,00000\n");
    }
    text.push_str("\"$RT_OFF$\";\"20.11.2026 22:11:31\";0;2;46346925000,00000\n");
    assert_is_the_trace(&text, "a reading per row");
}

/// Readings of a historian in no order, with their units and what they are worth.
#[test]
fn a_long_table_is_read_in_any_order() {
    let mut rows = Vec::new();
    for i in 0..ROWS {
        for (name, value) in values(i) {
            let (name, unit) = match name {
                "x_mm" => ("Position", "mm"),
                "pa_bar" => ("Pressure A", "bar"),
                "pb_bar" => ("Pressure B", "bar"),
                _ => ("Flow A", "l/min"),
            };
            rows.push(format!("{},{name},{value},{unit},Good\n", stamp(i)));
        }
        rows.push(format!("{},Pressure B,-1,bar,Bad\n", stamp(i)));
    }
    rows.sort_by_key(|row| (7 * row.len() + row.bytes().map(usize::from).sum::<usize>()) % 101);
    assert_is_the_trace(
        &("Timestamp,Tag,Value,Unit,Quality\n".to_owned() + &rows.concat()),
        "a reading per row",
    );
}

/// Flows at a fifth of the rate: their cells are empty between.
#[test]
fn channels_with_times_of_their_own_are_merged() {
    let mut text = "Time [s];x_mm;Time [s];pa_bar;Time [s];pb_bar;Time [s];qa_lpm\n".to_owned();
    for i in 0..ROWS {
        let time = format!("{:.2}", f64::from(i) / 100.0);
        for (name, value) in values(i) {
            match name {
                "qa_lpm" if 5 * i < ROWS => {
                    let [.., (_, value)] = values(5 * i);
                    text.push_str(&format!("{:.2};{value}", f64::from(5 * i) / 100.0));
                }
                "qa_lpm" => text.push(';'),
                _ => text.push_str(&format!("{time};{value};")),
            }
        }
        text.push('\n');
    }
    let (records, said) = read_by(&text, &rig_for(&text)).unwrap();
    assert!(said.contains("a column of times for each channel"), "{said}");
    assert_eq!(records.len(), ROWS as usize);
    let flows = records.iter().filter(|record| record.sample.qa_m3s.is_some()).count();
    assert_eq!(flows, ROWS as usize / 5);
    assert_eq!(records[5].sample.qa_m3s, Some(4.75 / 60e3));
}

fn labview(x_columns: &str) -> String {
    let mut text = format!(
        "LabVIEW Measurement\t\nWriter_Version\t2\nReader_Version\t2\nSeparator\tTab\nDecimal_Separator\t.\n\
         Multi_Headings\tNo\nX_Columns\t{x_columns}\nTime_Pref\tRelative\n***End_of_Header***\t\n\t\nChannels\t4\n\
         Samples\t{ROWS}\t{ROWS}\t{ROWS}\t{ROWS}\nDate\t2026/11/20\t2026/11/20\t2026/11/20\t2026/11/20\n\
         Time\t22:10:31.5\t22:10:31.5\t22:10:31.5\t22:10:31.5\nX_Dimension\tTime\tTime\tTime\tTime\n\
         X0\t0.0\t0.0\t0.0\t0.0\nDelta_X\t0.010000\t0.010000\t0.010000\t0.010000\n***End_of_Header***\t\t\t\t\n\
         X_Value\tx_mm\tpa_bar\tpb_bar\tqa_lpm\tComment\n"
    );
    for i in 0..ROWS {
        let [x, pa, pb, qa] = values(i).map(|(_, value)| value);
        let time = if x_columns == "No" { String::new() } else { format!("{:.6}", f64::from(i) / 100.0) };
        text.push_str(&format!("{time}\t{x:.6}\t{pa:.6}\t{pb:.6}\t{qa:.6}\n"));
    }
    text
}

#[test]
fn measurement_files_of_labview_are_read_with_and_without_times() {
    for x_columns in ["One", "No"] {
        assert_is_the_trace(&labview(x_columns), "LabVIEW's measurement file");
    }
    let multi: String = labview("One")
        .lines()
        .map(|line| match line.split('\t').collect::<Vec<_>>()[..] {
            [time, x, pa, pb, qa, ..] if time.starts_with("X_Value") || time.starts_with("0.") => {
                [time, x, time, pa, time, pb, time, qa].join("\t") + "\n"
            }
            _ => line.to_owned() + "\n",
        })
        .collect();
    let (records, _) = read_by(&multi, &Rig::paper()).unwrap();
    assert_eq!((records.len(), records[7].t_s, records[7].sample.pa_pa), (ROWS as usize, 0.07, 53.5e5));
}

#[test]
fn units_in_cells_are_read_as_grafana_writes_them() {
    let mut text = "\"Time\",\"Position\",\"Pressure A\",\"Pressure B\",\"Flow A\"\n".to_owned();
    for i in 0..ROWS {
        let [x, pa, pb, qa] = values(i).map(|(_, value)| value);
        text.push_str(&format!("2026-11-20 22:10:31.{:03},{x} mm,{pa} bar,{pb} bar,{qa} L/min\n", 10 * i));
    }
    assert_is_the_trace(&text, "units in the cells");
}

#[test]
fn date_and_time_apart_are_one() {
    let mut text = "Datum;Uhrzeit;x_mm;pa_bar;pb_bar;qa_lpm\n".to_owned();
    for i in 0..ROWS {
        let [x, pa, pb, qa] = values(i).map(|(_, value)| value);
        text.push_str(
            &format!("20.11.2026;22:10:31.{:03};{x};{pa};{pb};{qa}\n", 10 * i).replace("31.", "31,"),
        );
    }
    assert_is_the_trace(&text, "date and time apart");
}

/// As of any other text that breaks off.
#[test]
fn the_rows_before_a_stream_breaks_off_are_read() {
    let mut text = "LabVIEW Measurement\t\nSeparator\tTab\nX_Value\tx_mm\tpa_bar\tpb_bar\n".to_owned();
    for i in 0..5000_u32 {
        let noise = f64::from(i.wrapping_mul(2_654_435_761) % 1000) / 1000.0;
        text.push_str(&format!("{:.2}\t{}\t{}\t40\n", f64::from(i) / 100.0, 100.0 + noise, 50.0 - noise));
    }
    let mut gzip = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
    std::io::Write::write_all(&mut gzip, text.as_bytes()).unwrap();
    let mut bytes = gzip.finish().unwrap();
    bytes.truncate(bytes.len() / 2);
    let mut reader =
        TraceReader::from_stream("trace", Box::new(std::io::Cursor::new(bytes)), &Rig::paper()).unwrap();
    let mut record = Record::default();
    while reader.next_record(&mut record).unwrap() {}
    assert!(reader.quality().rows > 1000, "{:?}", reader.quality());
    assert!(reader.quality().cut_off.is_some());
}
