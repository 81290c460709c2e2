use super::*;
use pitchleak_core::{PerLeak, Sample};
use proptest::prelude::*;
use std::io::Write;

const HEADER: &str = "t_s,x_m,pa_pa,pb_pa,qa_m3s,qb_m3s";

fn open(text: impl Into<Vec<u8>>, rig: &Rig) -> Result<TraceReader<'static>, TraceError> {
    TraceReader::from_stream("trace.csv", Box::new(std::io::Cursor::new(text.into())), rig)
}

fn read_all(mut reader: TraceReader<'_>) -> Result<(Vec<Record>, TraceQuality), TraceError> {
    let (mut records, mut record) = (Vec::new(), Record::default());
    while reader.next_record(&mut record)? {
        records.push(record);
    }
    assert!(!reader.next_record(&mut record)?, "the end stays the end");
    Ok((records, reader.quality().clone()))
}

fn read(text: impl Into<Vec<u8>>) -> Result<(Vec<Record>, TraceQuality), TraceError> {
    open(text, &Rig::paper()).and_then(read_all)
}

fn message(text: impl Into<Vec<u8>>) -> String {
    let message = read(text).unwrap_err().to_string();
    assert!(!message.contains('\n'), "{message}");
    message
}

/// `count` sound rows at 100 Hz under [`HEADER`].
fn rows(count: usize) -> Vec<String> {
    let row = |i: usize| format!("{:.2},0.1,5e6,4e6,1e-5,-1e-5", i as f64 * 0.01);
    (0..count).map(row).collect()
}

fn file(rows: &[String]) -> String {
    format!("{HEADER}\n{}\n", rows.join("\n"))
}

fn gzip(text: &str) -> Vec<u8> {
    let mut encoder = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::default());
    encoder.write_all(text.as_bytes()).unwrap();
    encoder.finish().unwrap()
}

#[test]
fn a_row_is_a_record_in_si() {
    let text = "t_ms,x_mm,v_mmps,pa_bar,pb_mpa,qa_lpm,qb_lpm,force_kn,temp_c,q_int_lpm,q_ext_a_m3s,note\n\
                0,100,25,50,4,6,-3,1.5,25,6,1e-6,a\n10,101,25,50,4,,-3,1.5,25,6,1e-6,b\n";
    let (records, quality) = read(text).unwrap();
    let first = Record {
        line: 2,
        sample: Sample {
            x_m: 0.1,
            pa_pa: 5e6,
            pb_pa: 4e6,
            qa_m3s: Some(1e-4),
            qb_m3s: Some(-5e-5),
            force_n: Some(1500.0),
        },
        speed_mps: Some(0.025),
        temperature_k: Some(298.15),
        leak_m3s: PerLeak { internal: Some(1e-4), external_a: Some(1e-6), external_b: None },
        ..Record::default()
    };
    assert_eq!(records[0], first);
    assert_eq!((records[1].t_s, records[1].dt_s, records[1].sample.qa_m3s), (0.01, 0.01, None));
    assert_eq!(quality.ignored_columns, ["note"]);
    assert_eq!(quality.flow_rests, [1, 0]);
}

#[test]
fn header_errors_say_what_is_expected() {
    let cases = [
        ("", "the trace is empty"),
        ("\u{feff}", "no column for time: t_s or t_ms or t_us or timestamp expected"),
        (HEADER, "no usable row: the trace has only a header"),
        (
            "t_s,x_m,pa_pa\n",
            "no column for pressure B: pb_pa or pb_kpa or pb_mpa or pb_bar or pb_psi expected; the header has t_s, x_m, pa_pa",
        ),
        ("t_s,x_m,x_mm,pa_pa,pb_pa\n", "columns `x_m` and `x_mm` both give `x`"),
        ("t_s,x_m,x_m,pa_pa,pb_pa\n", "columns `x_m` and `x_m` both give `x`"),
        (
            "t_s,x_m,pa_atm,pb_pa\n",
            "column `pa_atm`: unknown unit `atm`; allowed for `pa`: pa, kpa, mpa, bar, psi",
        ),
        (
            "t_s,x_m,pa_pa,pb_pa,qa_cfm\n",
            "column `qa_cfm`: unknown unit `cfm`; allowed for `qa`: m3s, lpm, m3h, gpm",
        ),
        ("t_s,x_m,pa_pa,pb_pa,qa\n", "column `qa`: unknown unit ``"),
        ("PAR1\u{0}", if cfg!(feature = "parquet") { "damaged" } else { "Parquet" }),
        ("\u{0}\u{1}\u{2}\u{3}", "not a CSV file"),
        ("\u{1b}[31m\n", "\\u{1b}"),
        (
            "\"Laufzeit\nT\",x_m,pa_pa,pb_pa\n0,0.1,5e6,4e6\n1,0.1,5e6,4e6\n",
            r#"say t = { name = "Laufzeit\nT", unit = "ms" }"#,
        ),
    ];
    for (text, expected) in cases {
        let message = message(text);
        assert!(message.starts_with("trace.csv: ") && message.contains(expected), "{message}");
        assert!(!message.contains('\n'), "{message}");
    }
}

#[test]
fn unrelated_columns_that_look_alike_are_ignored() {
    let text = format!("{HEADER},x_ref_m,t_amb,pa_raw_v\n0,0.1,5e6,4e6,0,0,a,b,c\n");
    let (_, quality) = read(text).unwrap();
    assert_eq!(quality.ignored_columns, ["x_ref_m", "t_amb", "pa_raw_v"]);
}

#[test]
fn bad_rows_are_counted_with_their_place_and_skipped() {
    let bad = [
        ("abc,0.1,5e6,4e6,0,0", BadReason::NotANumber, Some("t_s")),
        ("0.03,NaN,5e6,4e6,0,0", BadReason::NotANumber, Some("x_m")),
        ("0.03,0.1,inf,4e6,0,0", BadReason::NotANumber, Some("pa_pa")),
        ("0.03,0.1,5e6,1e999,0,0", BadReason::NotANumber, Some("pb_pa")),
        ("0.03,0.1,5e6,4e6,0,nan", BadReason::NotANumber, Some("qb_m3s")),
        ("0.03,0.1,5e6,4e6,1.2.3,0", BadReason::NotANumber, Some("qa_m3s")),
        (",0.1,5e6,4e6,0,0", BadReason::Missing, Some("t_s")),
        ("0.03,0.1,5e6,4e6,0", BadReason::ShortRow, None),
        ("0.03,0.1,5e6,4e6,0,0,0", BadReason::LongRow, None),
        ("0.03,0.31,5e6,4e6,0,0", BadReason::OutOfRange, Some("x_m")),
        ("0.03,-0.02,5e6,4e6,0,0", BadReason::OutOfRange, Some("x_m")),
        ("0.03,0.1,-2e6,4e6,0,0", BadReason::OutOfRange, Some("pa_pa")),
        ("0.03,0.1,5e6,4e6,1,0", BadReason::OutOfRange, Some("qa_m3s")),
        ("0.02,0.1,5e6,4e6,0,0", BadReason::TimeBack, Some("t_s")),
        ("0.01,0.1,5e6,4e6,0,0", BadReason::TimeBack, Some("t_s")),
        ("\"0.03,0.1,5e6,4e6,0,0", BadReason::NotANumber, Some("t_s")),
        ("\u{fffd}", BadReason::NotANumber, Some("t_s")),
    ];
    for (row, reason, column) in bad {
        let mut all = rows(6);
        all.insert(3, row.to_owned());
        let (records, quality) = read(file(&all)).unwrap();
        let kept = quality.first_bad.first().unwrap_or_else(|| panic!("{row} passed"));
        assert_eq!((kept.line, kept.reason, kept.column.as_deref()), (5, reason, column), "{row}: {kept}");
        assert_eq!((records.len(), quality.skipped), (6, 1), "{row}");
        assert_eq!(records[3].line, 6);

        let strict = open(file(&all), &Rig::paper()).unwrap().with_bad_rows(BadRows::Fatal);
        let message = read_all(strict).unwrap_err().to_string();
        assert!(message.starts_with("trace.csv: line 5"), "{message}");
    }
}

/// A straight line, so that each reading between two others is known.
fn on_own_clocks(cells: impl Fn(usize, usize) -> bool) -> String {
    let row = |k: usize| {
        let t = k as f64;
        let values = [0.05 + 1e-4 * t, 5e6 + 1e3 * t, 4e6 - 2e3 * t, 1e-6 * t, -1e-6 * t];
        let cell = |(place, value): (usize, f64)| {
            if cells(k, place) { format!(",{value:.9}") } else { ",".to_owned() }
        };
        format!("{:.2}{}", 0.01 * t, values.into_iter().enumerate().map(cell).collect::<String>())
    };
    file(&(0..400).map(row).collect::<Vec<_>>())
}

/// Each channel in rows of its own: a row for each reading of the slowest, all else on the straight line there, and no row is bad.
#[test]
fn channels_on_clocks_of_their_own_meet_in_the_rows_of_the_slowest() {
    let apart = on_own_clocks(|k, place| k % 5 == place);
    let slow_pressures = on_own_clocks(|k, place| !(1..=2).contains(&place) || k % 7 == 3);
    for (text, every, flows) in [(apart, 5, true), (slow_pressures, 7, true)] {
        let (records, quality) = read(text).unwrap();
        assert_eq!(quality.skipped, 0, "{:?}", quality.first_bad);
        assert!(records.len() >= 400 / every - 2, "{}", records.len());
        for record in &records[1..] {
            let (k, sample) = (record.t_s / 0.01, record.sample);
            assert!(
                (sample.x_m - 0.05 - 1e-4 * k).abs() < 1e-8 && (sample.pa_pa - 5e6 - 1e3 * k).abs() < 0.1
            );
            assert!((sample.pb_pa - 4e6 + 2e3 * k).abs() < 0.1);
            assert_eq!(sample.qa_m3s.is_some(), flows);
            assert!((sample.qa_m3s.unwrap() - 1e-6 * k).abs() < 1e-9);
        }
    }
}

/// A slow flow stands in one row for each of its readings, where all else is faster.
#[test]
fn no_reading_counts_as_two() {
    let text = on_own_clocks(|k, place| match place {
        0..=2 => k % 4 == place,
        _ => k % 20 == 3,
    });
    let (records, _) = read(text).unwrap();
    let with_flow = records.iter().filter(|record| record.sample.qa_m3s.is_some()).count();
    assert!((18..=20).contains(&with_flow) && records.len() > 95, "{with_flow} of {}", records.len());
}

/// A channel that rests for long: its rows are bad, each with its place, and those around it as they were.
#[test]
fn where_a_channel_rests_rows_are_bad() {
    let (records, quality) = read(on_own_clocks(|k, place| place != 1 || !(100..200).contains(&k))).unwrap();
    assert_eq!(records.len(), 300);
    assert!((88..=100).contains(&quality.skipped), "{}", quality.skipped);
    let bad = &quality.first_bad[0];
    assert_eq!((bad.reason, bad.column.as_deref()), (BadReason::Missing, Some("pa_pa")));
    let message = read(on_own_clocks(|_, place| place != 1)).unwrap_err().to_string();
    assert!(message.contains("`pa_pa`: empty"), "{message}");
}

#[test]
fn when_all_rows_are_bad_the_first_says_why() {
    let text = file(&rows(3)).replace("5e6", "5e9");
    let message = message(text);
    assert!(
        message.contains("no usable row: 3 skipped, the first for this: line 2, column `pa_pa`"),
        "{message}"
    );
}

#[test]
fn bom_crlf_blank_lines_quotes_and_other_delimiters_are_fine() {
    let plain = file(&rows(4));
    let (expected, _) = read(plain.clone()).unwrap();
    let quoted = plain.replace("0.1,", "\"0.1\",").replace("x_m", "\"x_m\"");
    let variants = [
        format!("\u{feff}{}", plain.replace('\n', "\r\n")),
        plain.replace(',', ";"),
        plain.replace(',', "\t"),
        plain.replace(',', " , "),
        plain.trim_end().to_owned(),
        quoted,
        plain.replace("5e6", "+5.0E+06"),
    ];
    for text in variants {
        let (records, quality) = read(text.clone()).unwrap();
        assert_eq!((&records, quality.skipped), (&expected, 0), "{text}");
    }
    let (records, _) = read(plain.replace('\n', "\n\n")).unwrap();
    assert_eq!(records.len(), expected.len());
}

#[test]
fn a_quoted_cell_may_hold_delimiters_quotes_and_line_ends() {
    let text = format!("note,{HEADER}\n\"a, \"\"b\"\"\nc\",0,0.1,5e6,4e6,0,0\nplain,0.01,0.1,5e6,4e6,0,0\n");
    let (records, quality) = read(text).unwrap();
    assert_eq!((records.len(), quality.skipped), (2, 0));
    assert_eq!(records[1].line, 4);
}

#[test]
fn a_stray_quote_costs_its_own_row_only() {
    let mut all = rows(5000);
    all[7] = all[7].replace("5e6", "\"5e6");
    let (records, quality) = read(file(&all)).unwrap();
    assert_eq!((records.len(), quality.skipped), (4999, 1), "{:?}", quality.first_bad);
}

#[test]
fn gaps_are_marked_and_counted() {
    let mut all = rows(300);
    all.drain(100..200);
    let (records, quality) = read(file(&all)).unwrap();
    let marked: Vec<_> = records.iter().filter(|record| record.after_gap).map(|record| record.line).collect();
    assert_eq!((marked.as_slice(), quality.gaps), (&[102][..], 1));
    assert!((quality.longest_gap_s - 1.01).abs() < 1e-9);
    assert!((quality.sample_rate_hz().unwrap() - 100.0).abs() < 1e-6);
    assert!((quality.duration_s - 2.99).abs() < 1e-12);
}

#[test]
fn gzip_in_members_reads_as_one_file() {
    let all = rows(2000);
    let mut bytes = gzip(&file(&all[..1000]));
    bytes.extend(gzip(&(all[1000..].join("\n") + "\n")));
    assert_eq!(read(bytes).unwrap().0, read(file(&all)).unwrap().0);
}

#[test]
fn a_broken_gzip_keeps_the_rows_before_the_break_and_says_so() {
    let whole = gzip(&file(&rows(20_000)));
    let broken = &whole[..whole.len() / 2];
    let (records, quality) = read(broken).unwrap();
    assert!(records.len() > 1000 && records.len() < 20_000);
    let warning = &quality.warnings()[0];
    assert!(warning.contains("the gzip stream breaks off in line"), "{warning}");

    let strict = open(broken, &Rig::paper()).unwrap().with_bad_rows(BadRows::Fatal);
    assert!(read_all(strict).unwrap_err().to_string().contains("breaks off"));
    assert!(message(&whole[..12]).starts_with("trace.csv: "));
}

#[test]
fn foreign_columns_are_mapped() {
    let rig = Rig::paper().to_toml()
        + "[columns]\ntimestamp = { name = \"Zeit\" }\nx = { name = \"Weg, innen\", unit = \"mm\" }\n\
           pa = { name = \"Head pressure\", unit = \"bar\" }\npb = { name = \"Rod pressure\", unit = \"bar\" }\n\
           qa = { name = \"Flow\", unit = \"L/min\" }\n";
    let rig = Rig::parse(&rig, "rig.toml").unwrap();
    let text = "Zeit,\"Weg, innen\",Head pressure,Rod pressure\n\
                2026-11-20T12:00:00Z,100,50,40\n2026-11-20T12:00:00.010Z,100,50,40\nlater,100,50,40\n";
    let (records, quality) = read_all(open(text, &rig).unwrap()).unwrap();
    assert_eq!(records[1].sample, Sample { x_m: 0.1, pa_pa: 5e6, pb_pa: 4e6, ..Sample::default() });
    assert_eq!((records[1].t_s, records[1].dt_s), (0.01, 0.01));
    assert_eq!(quality.absent_columns, ["Flow"]);
    assert_eq!(quality.first_bad[0].to_string(), "line 4, column `Zeit`: `later` is not a time in ISO 8601");
}

#[test]
fn a_line_without_end_is_an_error_in_bounded_memory() {
    let stream = std::io::Read::chain(std::io::Cursor::new("t_s,x_m,pa_pa,pb_pa\n"), std::io::repeat(b'1'));
    let reader = TraceReader::from_stream("endless", Box::new(stream), &Rig::paper()).unwrap();
    assert!(read_all(reader).unwrap_err().to_string().contains("line 2 is longer than a megabyte"));
}

fn in_units(rows: &[[f64; 6]], header: &str, factors: [f64; 6]) -> String {
    let mut text = format!("{header}\n");
    for row in rows {
        let cells: Vec<_> = row.iter().zip(factors).map(|(v, f)| format!("{:e}", v * f)).collect();
        text += &(cells.join(",") + "\n");
    }
    text
}

proptest! {
    #[test]
    fn the_units_of_the_columns_do_not_matter(
        cells in prop::collection::vec((0.0..0.2f64, 0.0..16e6f64, 0.0..16e6f64, -3e-4..3e-4f64, -3e-4..3e-4f64), 1..20),
    ) {
        let rows: Vec<_> =
            cells.iter().enumerate().map(|(i, c)| [i as f64 * 0.01, c.0, c.1, c.2, c.3, c.4]).collect();
        let (si, _) = read(in_units(&rows, HEADER, [1.0; 6])).unwrap();
        let field = in_units(&rows, "t_ms,x_mm,pa_bar,pb_mpa,qa_lpm,qb_lpm", [1e3, 1e3, 1e-5, 1e-6, 6e4, 6e4]);
        let (field, _) = read(field).unwrap();
        prop_assert_eq!(si.len(), field.len());
        let same = |a: f64, b: f64| (a - b).abs() <= 1e-15 * a.abs().max(b.abs());
        for (a, b) in si.iter().zip(&field) {
            prop_assert!(same(a.t_s, b.t_s) && same(a.sample.x_m, b.sample.x_m));
            prop_assert!(same(a.sample.pa_pa, b.sample.pa_pa) && same(a.sample.pb_pa, b.sample.pb_pa));
            prop_assert!(same(a.sample.qa_m3s.unwrap(), b.sample.qa_m3s.unwrap()));
            prop_assert!(same(a.sample.qb_m3s.unwrap(), b.sample.qb_m3s.unwrap()));
        }
    }

    #[test]
    fn any_bytes_give_finite_records_in_order_or_one_line(
        body in prop::collection::vec(prop_oneof![
            r#"[-+0-9.,eE"; \r\n\t]{0,40}"#.prop_map(String::into_bytes),
            (0..200u32).prop_map(|i| format!("{},0.1,5e6,4e6,1e-5,-1e-5\n", f64::from(i) * 0.01).into_bytes()),
            prop::collection::vec(any::<u8>(), 0..40),
        ], 0..30),
        with_header in any::<bool>(),
    ) {
        let mut bytes = if with_header { format!("{HEADER}\n").into_bytes() } else { Vec::new() };
        bytes.extend(body.concat());
        match read(bytes) {
            Err(error) => prop_assert!(!error.to_string().contains('\n')),
            Ok((records, quality)) => {
                prop_assert_eq!(records.len() as u64, quality.rows);
                for record in &records {
                    prop_assert!(record.sample.is_finite() && record.t_s.is_finite() && record.dt_s >= 0.0);
                }
                prop_assert!(quality.warnings().iter().all(|warning| !warning.contains('\n')));
            }
        }
    }
}

/// Gives its bytes a few at a time, so that records end anywhere in what has been read.
struct Dribble(std::io::Cursor<Vec<u8>>, usize);

impl std::io::Read for Dribble {
    fn read(&mut self, into: &mut [u8]) -> std::io::Result<usize> {
        let few = self.1.min(into.len());
        std::io::Read::read(&mut self.0, &mut into[..few])
    }
}

proptest! {
    #[test]
    fn a_stream_in_pieces_reads_as_a_whole(
        body in prop::collection::vec(prop_oneof![
            r#"[0-9.,"\r\n]{0,40}"#.prop_map(String::into_bytes),
            (0..200u32).prop_map(|i| format!("{},0.1,\"5e6\",4e6,1e-5,-1e-5\r\n", f64::from(i) * 0.01).into_bytes()),
            prop::collection::vec(any::<u8>(), 0..40),
        ], 0..30),
        few in 1..9usize,
    ) {
        let mut bytes = format!("{HEADER}\n").into_bytes();
        bytes.extend(body.concat());
        let stream = Box::new(Dribble(std::io::Cursor::new(bytes.clone()), few));
        let pieces = TraceReader::from_stream("trace.csv", stream, &Rig::paper()).and_then(read_all);
        prop_assert_eq!(pieces.map_err(|e| e.to_string()), read(bytes).map_err(|e| e.to_string()));
    }

    #[test]
    fn quotes_around_cells_do_not_matter(
        quoted in prop::collection::vec(prop::collection::vec(any::<bool>(), 6), 1..20),
        delimiter in prop::sample::select(vec![",", ";", "\t"]),
        line_end in prop::sample::select(vec!["\n", "\r\n"]),
        last in any::<bool>(),
    ) {
        let plain = rows(quoted.len());
        let mut text = HEADER.replace(',', delimiter) + line_end;
        for (row, quoted) in plain.iter().zip(&quoted) {
            let cell = |(cell, quoted): (&str, &bool)| if *quoted { format!("\"{cell}\"") } else { cell.to_owned() };
            text += &row.split(',').zip(quoted).map(cell).collect::<Vec<_>>().join(delimiter);
            text += line_end;
        }
        let text = if last { text.trim_end() } else { &text };
        let (records, quality) = read(text).unwrap();
        let quality = TraceQuality { reading: None, ..quality };
        prop_assert_eq!((records, quality), read(file(&plain)).unwrap());
    }
}

#[test]
fn quotes_that_do_not_close_cost_their_rows_wherever_they_stand() {
    for at in [0, 1, 2000, 4998, 4999] {
        for end in ["\n", ""] {
            let mut all = rows(5000);
            all[at] = all[at].replace("4e6", "\"4e6");
            let text = file(&all).trim_end().to_owned() + end;
            let (records, quality) = read(text).unwrap();
            assert_eq!((records.len(), quality.skipped), (4999, 1), "{at}: {:?}", quality.first_bad);
            assert_eq!(
                (quality.first_bad[0].line, quality.first_bad[0].reason),
                (at as u64 + 2, BadReason::NotANumber)
            );
        }
    }
}

#[test]
fn nul_bytes_cost_their_row_only() {
    let mut all = rows(6);
    all[3] = all[3].replace("0.1", "0.\u{0}1");
    let (records, quality) = read(file(&all)).unwrap();
    assert_eq!((records.len(), quality.first_bad[0].reason), (5, BadReason::NotANumber));
}

const TABLE: [[f64; 4]; 6] = [
    [0.0, 10.0, 20.0, 30.0],
    [100.0, 101.0, 102.0, 103.0],
    [50.0, 51.0, 52.0, 53.0],
    [40.0, 41.0, 42.0, 43.0],
    [6.0, 6.5, f64::NAN, 7.0],
    [-3.0, -3.5, -4.0, -4.5],
];
const TABLE_HEADER: &str = "t_ms,x_mm,pa_bar,pb_bar,qa_lpm,qb_lpm";

fn layout() -> TableLayout {
    let headers: Vec<_> = TABLE_HEADER.split(',').map(str::to_owned).collect();
    TableLayout::new("table", &headers, &Rig::paper()).unwrap()
}

/// The rows `rows` of [`TABLE`].
fn batch(rows: std::ops::Range<usize>) -> Batch<'static> {
    TABLE.iter().map(|column| &column[rows.clone()]).collect()
}

fn read_table(batches: Vec<Batch<'_>>) -> Result<(Vec<Record>, TraceQuality), TraceError> {
    TraceReader::from_table("table", &layout(), batches, &Rig::paper()).and_then(read_all)
}

#[test]
fn columns_in_memory_are_read_as_a_file() {
    let mut text = TABLE_HEADER.to_owned();
    for row in 0..4 {
        let cell = |column: &[f64; 4]| Some(column[row]).filter(|v| !v.is_nan()).map(|v| v.to_string());
        let cells = TABLE.iter().map(|column| cell(column).unwrap_or_default());
        text += &format!("\n{}", cells.collect::<Vec<_>>().join(","));
    }
    let (file, file_quality) = read(text).unwrap();
    for batches in [vec![batch(0..4)], vec![batch(0..1), batch(1..1), batch(1..4)]] {
        let (table, quality) = read_table(batches).unwrap();
        assert_eq!(quality, file_quality);
        for (row, (ours, theirs)) in table.iter().zip(&file).enumerate() {
            assert_eq!(*ours, Record { line: row as u64, ..*theirs });
        }
    }
}

#[test]
fn a_trace_in_parts_is_one_trace() {
    let (whole, whole_quality) = read_table(vec![batch(0..4)]).unwrap();
    let rig = Rig::paper();
    let part = |rows| TraceReader::from_table("table", &layout(), vec![batch(rows)], &rig).unwrap();
    let (mut records, mut record) = (Vec::new(), Record::default());
    let mut first = part(0..3);
    while first.next_record(&mut record).unwrap() {
        records.push(record);
    }
    let mut second = part(3..4).resuming(first.into_validator());
    while second.next_record(&mut record).unwrap() {
        records.push(record);
    }
    assert_eq!((records, second.quality()), (whole, &whole_quality));
}

#[test]
fn bad_cells_of_a_table_are_named() {
    let message = |column: usize, row: usize, value: f64| {
        let mut table = TABLE.map(|column| column.to_vec());
        table[column][row] = value;
        let batch = table.iter().map(Vec::as_slice).collect();
        let reader = TraceReader::from_table("table", &layout(), vec![batch], &Rig::paper()).unwrap();
        read_all(reader.with_bad_rows(BadRows::Fatal)).unwrap_err().to_string()
    };
    assert_eq!(message(0, 2, f64::NAN), "table: row 2, column `t_ms`: missing");
    assert_eq!(message(4, 1, f64::INFINITY), "table: row 1, column `qa_lpm`: not a finite number");
    assert_eq!(message(0, 3, 5.0), "table: row 3, column `t_ms`: 0.005 s is not after 0.02 s");
    assert!(message(2, 0, 900.0).starts_with("table: row 0, column `pa_bar`: 900 bar is outside"));
    assert!(message(2, 3, 1e305).starts_with("table: row 3, column `pa_bar`: out of physical range"));
}

#[test]
fn columns_of_a_table_are_of_one_length() {
    let mut short = batch(0..4);
    short[2] = &[50.0];
    let message = read_table(vec![short]).unwrap_err().to_string();
    assert_eq!(message, "table: column `pa_bar` has 1 rows, `t_ms` has 4: all must be of one length");
    let message = read_table(vec![batch(0..0)]).unwrap_err().to_string();
    assert_eq!(message, "table: no usable row: the trace has only a header");
}

/// `0.1234` cut to `0.12` is another number.
#[test]
fn a_last_row_that_may_be_cut_is_not_used() {
    let whole = "t_s,x_m,pa_pa,pb_pa\n0,0.1,1e5,250000.5\n0.01,0.1,1e5,250000.5\n0.02,0.1,1e5,250000.5";
    let rows = |text: &str| {
        let stream = Box::new(std::io::Cursor::new(text.as_bytes().to_vec()));
        let mut reader = TraceReader::from_stream("t", stream, &Rig::paper()).unwrap();
        let mut record = Record::default();
        while reader.next_record(&mut record).unwrap() {}
        (reader.quality().rows, reader.quality().cut_off.is_some())
    };
    assert_eq!(rows(whole), (3, false), "no line end, and as long as the others");
    assert_eq!(rows(&format!("{whole}\n")), (3, false));
    for cut in 1..8 {
        assert_eq!(rows(&whole[..whole.len() - cut]), (2, true), "{cut} characters cut");
    }
    assert_eq!(rows(&format!("{}\n", &whole[..whole.len() - 3])), (3, false), "ended lines are whole");
}

#[test]
fn times_and_references_that_cannot_be_are_bad_rows() {
    for (time, reference) in [("1e160", "0"), ("-1e300", "0"), ("0.01", "1e308"), ("0.01", "-1e30")] {
        let text =
            format!("t_s,x_m,pa_pa,pb_pa,q_int_m3s\n0,0.1,1e5,1e5,0\n{time},0.1,1e5,1e5,{reference}\n");
        let stream = Box::new(std::io::Cursor::new(text.into_bytes()));
        let mut reader = TraceReader::from_stream("t", stream, &Rig::paper()).unwrap();
        let mut record = Record::default();
        while reader.next_record(&mut record).unwrap() {}
        assert_eq!((reader.quality().rows, reader.quality().skipped), (1, 1), "{time} {reference}");
    }
}

/// Whatever comes, and wherever in a batch: the thread gives what the reader alone gives.
#[test]
fn reading_ahead_changes_nothing() {
    let stamped = |i: u32| format!("2026-11-20T22:{:02}:{:02}.{:02}Z", i / 6000, i / 100 % 60, i % 100);
    let row = |i: u32| match i {
        // One in a batch of its own, one behind a whole batch, and many in a row.
        4096 | 4352 | 5000..5300 => format!("{},0.1,broken,4000000\n", stamped(i)),
        i => format!("{},{},5000000,4000000\n", stamped(i), 0.1 + 1e-6 * f64::from(i)),
    };
    for rows in [0, 1, 4095, 4096, 4097, 4351, 4352, 4353, 20_000] {
        let mut text = "timestamp,x_m,pa_pa,pb_pa\n".to_owned() + &(0..rows).map(row).collect::<String>();
        for end in ["", "2026-11-20T23:00:00Z,0"] {
            text.push_str(end);
            let alone = open(text.as_str(), &Rig::paper()).unwrap();
            let ahead = RowsAhead::of(open(text.as_str(), &Rig::paper()).unwrap().rows);
            let ahead = TraceReader::over("trace.csv", Box::new(ahead), &Rig::paper());
            match (read_all(ahead), read_all(alone)) {
                (Ok(ahead), Ok(alone)) => assert_eq!(ahead, alone, "{rows} rows"),
                (Err(ahead), Err(alone)) => assert_eq!(ahead.to_string(), alone.to_string(), "{rows} rows"),
                (ahead, alone) => panic!("{rows} rows: {ahead:?}, alone {alone:?}"),
            }
        }
    }
}

#[test]
fn a_reader_that_is_dropped_ends_its_thread() {
    struct Endless {
        _alive: std::sync::Arc<()>,
        row: u64,
    }
    impl Read for Endless {
        fn read(&mut self, mut into: &mut [u8]) -> std::io::Result<usize> {
            let room = into.len();
            self.row += 1;
            writeln!(into, "{},0.1,5000000,4000000", self.row)?;
            Ok(room - into.len())
        }
    }
    let alive = std::sync::Arc::new(());
    let text = std::io::Cursor::new("t_s,x_m,pa_pa,pb_pa\n").chain(Endless { _alive: alive.clone(), row: 0 });
    let mut reader = TraceReader::from_stream("-", Box::new(text), &Rig::paper()).unwrap();
    reader.rows = Box::new(RowsAhead::of(reader.rows));
    let mut row = Row::empty();
    for _ in 0..10_000 {
        assert!(matches!(reader.rows.next_row(&mut row), Ok(Next::Row)));
    }
    drop(reader);
    let waited = std::time::Instant::now();
    while std::sync::Arc::strong_count(&alive) > 1 {
        assert!(waited.elapsed().as_secs() < 10, "the thread reads on");
        std::thread::yield_now();
    }
}

/// `shut` has no unit: 0 or 1, by its own name or a foreign one; an empty cell says nothing, another number is a bad row.
#[test]
fn shut_is_zero_or_one() {
    let mut rig = Rig::paper();
    let map = "[columns]\nshut = \"Valve closed\"\n";
    for header in ["shut", "Valve closed"] {
        let text = format!(
            "t_s,x_m,pa_pa,pb_pa,{header}\n0,0.1,5e6,4e6,0\n1,0.1,5e6,4e6,1\n2,0.1,5e6,4e6,\n3,0.1,5e6,4e6,7\n"
        );
        if header != "shut" {
            rig.columns = Rig::parse(&format!("{}{map}", rig.to_toml()), "rig").expect("a rig").columns;
        }
        let mut reader =
            TraceReader::from_stream("t", Box::new(std::io::Cursor::new(text)), &rig).expect("a trace");
        let (mut record, mut shut) = (Record::default(), Vec::new());
        while reader.next_record(&mut record).expect("rows") {
            shut.push(record.shut);
        }
        assert_eq!(shut, [Some(false), Some(true), None], "{header}");
        assert_eq!(reader.quality().skipped, 1, "{header}");
        let warnings = reader.quality().warnings().join("\n");
        assert!(warnings.contains("7 is outside what is possible (0 to 1)"), "{warnings}");
    }
}

#[test]
fn beside_a_valve_one_chamber_pressure_may_be_missing() {
    let rig = Rig::paper();
    let open =
        |text: &'static str| TraceReader::from_stream("one", Box::new(std::io::Cursor::new(text)), &rig);
    let text = "t_s,x_m,pa_pa,spool_percent,ps_pa\n0,0.1,5e6,10,1e7\n0.01,,5e6,10,1e7\n0.02,0.1,5e6,10,1e7\n";
    let mut reader = open(text).unwrap();
    assert!(
        reader
            .need_both_pressures(&rig.columns)
            .unwrap_err()
            .to_string()
            .contains("no column for pressure B")
    );
    let mut record = Record::default();
    // A row for each reading of the position.
    for _ in 0..2 {
        assert!(reader.next_record(&mut record).unwrap());
        assert!(record.sample.pb_pa.is_nan() && record.sample.pa_pa > 4.9e6 && !record.has_both_pressures());
        assert!((record.sample.x_m - 0.1).abs() < 1e-12);
    }
    assert!(!reader.next_record(&mut record).unwrap() && reader.quality().skipped == 0);
    for header in
        ["t_s,x_m,pa_pa,spool_percent,qa_m3s\n0,0.1,5e6,10,0\n", "t_s,x_m,spool_percent\n0,0.1,10\n"]
    {
        assert!(open(header).is_err(), "{header}");
    }
}

/// A rig with a valve, whose `[valve]` says `more`.
fn valve(more: &str) -> Rig {
    let valve = format!("[valve]\nrated_flow = \"4 L/min\"\nrated_drop = \"35 bar\"\n{more}");
    Rig::parse(&format!("{}{valve}", Rig::paper().to_toml()), "rig").expect("a rig")
}

fn records(text: String, rig: &Rig) -> Result<Vec<Record>, TraceError> {
    let mut reader = TraceReader::from_stream("t", Box::new(std::io::Cursor::new(text)), rig)?;
    let (mut record, mut records) = (Record::default(), Vec::new());
    while reader.next_record(&mut record)? {
        records.push(record);
    }
    Ok(records)
}

/// By its own name, by `[columns]` and by a row of units; without a stroke the message says what to write.
#[test]
fn a_spool_in_millimetres_is_a_share_of_its_stroke() {
    let text = |header: &str, units: &str| {
        format!(
            "t_s,x_m,pa_pa,pb_pa,{header},valve_command_mm\n{units}0,0.1,5e6,4e6,-0.5,0.5\n1,0.1,5e6,4e6,,0.5\n"
        )
    };
    let mapped = "stroke = \"2 mm\"\n[columns]\nspool = { name = \"LVDT\", unit = \"mm\", scale = -1, offset = \"0.1 mm\" }";
    let cases = [
        (text("spool_mm", ""), "stroke = \"2 mm\"", [-0.25, 0.25]),
        (text("LVDT", ""), mapped, [0.3, 0.25]),
        (text("Spool position [mm]", ""), "stroke = \"2 mm\"", [-0.25, 0.25]),
        (text("Spool", "s,m,Pa,Pa,mm,mm\n"), "stroke = \"2 mm\"", [-0.25, 0.25]),
    ];
    for (text, more, expected) in cases {
        let shares: Vec<_> = records(text, &valve(more))
            .expect(more)
            .iter()
            .map(|record| record.valve.map(|valve| valve.spool))
            .collect();
        for (share, expected) in shares.iter().zip(expected) {
            assert!((share.expect("a spool") - expected).abs() < 1e-12, "{more}: {shares:?}");
        }
    }
    let message = records(text("spool_mm", ""), &valve("")).expect_err("no stroke").to_string();
    assert!(message.contains("`spool_mm`") && message.contains("stroke = \"2 mm\""), "{message}");
    assert!(records(text("spool_mm", ""), &Rig::paper()).is_ok(), "nothing asks for it without a valve");
}

/// Once it has rested for a second, until it moves; what the trace itself says goes before.
#[test]
fn a_spool_that_rests_near_its_middle_shuts_the_ports() {
    let rig = valve("shut = \"below 0.5 %\"");
    let spool = |k: i32| match k {
        0..100 | 350.. => 3.0,
        100..130 => 0.2,
        130..140 => -0.6,
        _ => -0.4,
    };
    let rows = |shut: &str| {
        let mut text =
            format!("t_s,x_m,pa_pa,pb_pa,spool_percent{}\n", if shut.is_empty() { "" } else { ",shut" });
        (0..400).for_each(|k| text += &format!("{},0.1,5e6,4e6,{}{shut}\n", f64::from(k) / 100.0, spool(k)));
        records(text, &rig).expect("rows")
    };
    for (k, record) in rows("").iter().enumerate() {
        assert_eq!(record.shut, Some((240..350).contains(&k)), "{k}");
    }
    assert!(rows(",0").iter().all(|record| record.shut == Some(false)));
}
