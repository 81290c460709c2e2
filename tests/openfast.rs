//! The OpenFAST reader: files written here in every layout, OpenFAST's own, and damaged ones.

use pitchleak::openfast::{self, Channel, Problem, Run};
use proptest::prelude::*;
use std::path::Path;

fn run() -> Run {
    let time_s: Vec<f64> = (0..50).map(|k| 60.0 + 0.0125 * f64::from(k)).collect();
    let channel = |name: &str, unit: &str, f: &dyn Fn(f64) -> f64| Channel {
        name: name.into(),
        unit: unit.into(),
        values: time_s.iter().map(|&t| f(t)).collect(),
    };
    let channels = vec![
        channel("Wind1VelX", "m/s", &|t| 13.0 + t.sin()),
        channel("BldPitch1", "deg", &|t| 2.6 + 0.1 * (t - 60.0)),
        channel("RootMzb1", "kN\u{b7}m", &|t| 5.0 * (2.0 * t).cos()),
    ];
    Run { description: "a run of the tests".into(), time_s, channels }
}

/// Scale and offset that map a channel onto the 16-bit range, as WrBinFAST chooses them.
fn packing(values: &[f64]) -> (f32, f32) {
    let low = values.iter().copied().fold(f64::INFINITY, f64::min);
    let high = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let scale = if high > low { 65535.0 / (high - low) } else { 1.0 };
    (scale as f32, (-32768.0 - low * scale) as f32)
}

fn padded(text: &str, length: usize) -> Vec<u8> {
    let mut bytes: Vec<u8> = text.chars().map(|c| c as u8).collect();
    bytes.resize(length, b' ');
    bytes
}

/// Writes `run` in the binary layout `id`, from the format's description.
fn binary(run: &Run, id: i16, name_length: usize) -> Vec<u8> {
    let (first, step) = (run.time_s[0], run.time_s[1] - run.time_s[0]);
    let mut out = id.to_le_bytes().to_vec();
    if id == 4 {
        out.extend((name_length as i16).to_le_bytes());
    }
    out.extend((run.channels.len() as i32).to_le_bytes());
    out.extend((run.time_s.len() as i32).to_le_bytes());
    let (time_scale, time_offset) = (1000.0 / step, -first * 1000.0 / step);
    let time_pair = if id == 1 { [time_scale, time_offset] } else { [first, step] };
    out.extend(time_pair.iter().flat_map(|v| v.to_le_bytes()));
    let packings: Vec<_> = run.channels.iter().map(|c| packing(&c.values)).collect();
    if id != 3 {
        out.extend(packings.iter().flat_map(|p| p.0.to_le_bytes()));
        out.extend(packings.iter().flat_map(|p| p.1.to_le_bytes()));
    }
    out.extend((run.description.len() as i32).to_le_bytes());
    out.extend(run.description.bytes());
    out.extend(padded("Time", name_length));
    run.channels.iter().for_each(|c| out.extend(padded(&c.name, name_length)));
    out.extend(padded("(s)", name_length));
    run.channels.iter().for_each(|c| out.extend(padded(&format!("({})", c.unit), name_length)));
    if id == 1 {
        let packed = run.time_s.iter().map(|t| (t * time_scale + time_offset).round() as i32);
        out.extend(packed.flat_map(i32::to_le_bytes));
    }
    for row in 0..run.time_s.len() {
        for (channel, (scale, offset)) in run.channels.iter().zip(&packings) {
            let value = channel.values[row];
            if id == 3 {
                out.extend(value.to_le_bytes());
            } else {
                let packed = (value * f64::from(*scale) + f64::from(*offset)).round() as i16;
                out.extend(packed.to_le_bytes());
            }
        }
    }
    out
}

fn text(run: &Run, separator: &str) -> Vec<u8> {
    let line = |cells: Vec<String>| cells.join(separator) + "\r\n";
    let mut out = format!("\r\n{}\r\n\r\n", run.description);
    out += &line(std::iter::once("Time".into()).chain(run.channels.iter().map(|c| c.name.clone())).collect());
    let units = run.channels.iter().map(|c| format!("({})", c.unit));
    out += &line(std::iter::once("(s)".into()).chain(units).collect());
    for (row, t) in run.time_s.iter().enumerate() {
        let values = run.channels.iter().map(|c| format!("{:.7E}", c.values[row]));
        out += &line(std::iter::once(format!("{t:10.4}")).chain(values).collect());
    }
    out.chars().map(|c| c as u8).collect()
}

/// Same names and units; same values but for `tolerance` of each channel's range.
fn assert_agree(read: &Run, written: &Run, tolerance: f64) {
    assert_eq!(read.time_s.len(), written.time_s.len());
    for (a, b) in read.time_s.iter().zip(&written.time_s) {
        assert!((a - b).abs() < 1e-4, "time {a} for {b}");
    }
    assert_eq!(read.channels.len(), written.channels.len());
    for (a, b) in read.channels.iter().zip(&written.channels) {
        assert_eq!((&a.name, &a.unit), (&b.name, &b.unit));
        let largest = b.values.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
        for (u, v) in a.values.iter().zip(&b.values) {
            assert!((u - v).abs() <= tolerance * largest, "{}: {u} for {v}", a.name);
        }
    }
}

#[test]
fn every_binary_layout_reads_back() {
    let written = run();
    for (id, name_length, tolerance) in
        [(1, 10, 2e-5), (2, 10, 2e-5), (3, 10, 0.0), (4, 9, 2e-5), (4, 20, 2e-5)]
    {
        let read = openfast::parse(&binary(&written, id, name_length)).expect("reads");
        assert_eq!(read.description, written.description);
        assert_agree(&read, &written, tolerance);
    }
}

#[test]
fn text_reads_back_with_tabs_or_spaces() {
    for separator in ["\t", "  "] {
        let read = openfast::parse(&text(&run(), separator)).expect("reads");
        assert_agree(&read, &run(), 1e-7);
        assert_eq!(read.channel("rootmzb1").map(|c| c.unit.as_str()), Some("kN\u{b7}m"));
    }
}

#[test]
fn damage_is_named() {
    let good = binary(&run(), 2, 10);
    let with = |offset: usize, bytes: &[u8]| {
        let mut bad = good.clone();
        bad[offset..offset + bytes.len()].copy_from_slice(bytes);
        openfast::parse(&bad)
    };
    assert_eq!(with(0, &[9]), Err(Problem::FileId(9)));
    assert_eq!(
        with(2, &(-3_i32).to_le_bytes()),
        Err(Problem::Count { part: "number of channels", value: -3 })
    );
    assert_eq!(with(2, &[0; 4]), Err(Problem::Count { part: "number of channels", value: 0 }));
    assert!(matches!(
        with(2, &i32::MAX.to_le_bytes()),
        Err(Problem::Truncated { part: "channel scales", .. })
    ));
    assert!(matches!(with(6, &i32::MAX.to_le_bytes()), Err(Problem::Truncated { part: "samples", .. })));
    assert_eq!(with(26, &[0; 4]), Err(Problem::Scale { channel: "Wind1VelX".into() }));

    let good =
        String::from_utf8(text(&run(), "\t").into_iter().filter(u8::is_ascii).collect()).expect("ascii");
    let with = |from: &str, to: &str| openfast::parse(good.replacen(from, to, 1).as_bytes());
    assert_eq!(with("Time", "Zeit"), Err(Problem::NoHeader));
    assert_eq!(with("\t(deg)", ""), Err(Problem::Units { line: 5, found: 3, expected: 4 }));
    assert_eq!(with("\t2.6000000E0", ""), Err(Problem::RowLength { line: 6, found: 3, expected: 4 }));
    assert_eq!(
        with("2.6000000E0", "****"),
        Err(Problem::NotANumber { line: 6, column: 3, text: "****".into() })
    );
}

#[test]
fn a_missing_file_is_named() {
    let error = openfast::read("no/such/run.outb".as_ref()).expect_err("no such file");
    assert!(error.to_string().starts_with("no/such/run.outb: "), "{error}");
}

proptest! {
    #[test]
    fn no_bytes_make_the_reader_panic(bytes in proptest::collection::vec(any::<u8>(), 0..400)) {
        let _ = openfast::parse(&bytes);
    }

    #[test]
    fn no_cut_or_flip_makes_the_reader_panic(
        id in 1_i16..=4,
        keep in 0.0..1.0_f64,
        flips in proptest::collection::vec((0_usize..140, any::<u8>()), 0..6),
    ) {
        let mut bytes = binary(&run(), id, 10);
        bytes.truncate((keep * bytes.len() as f64) as usize);
        prop_assert!(openfast::parse(&bytes).is_err());
        let mut bytes = binary(&run(), id, 10);
        flips.iter().for_each(|&(at, value)| bytes[at] = value);
        let _ = openfast::parse(&bytes);
        let _ = openfast::parse(&text(&run(), "\t")[..(keep * 2000.0) as usize]);
    }
}

/// Output of OpenFAST itself.
fn sample(name: &str) -> Vec<u8> {
    std::fs::read(Path::new(env!("CARGO_MANIFEST_DIR")).join("data/openfast").join(name)).expect("is shipped")
}

fn read(bytes: &[u8]) -> Run {
    openfast::parse(bytes).expect("reads")
}

#[test]
fn val_openfast_files_of_one_run_agree() {
    let packed = sample("wp15_13mps.outb");
    let scales = packed[28..].chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]]));
    let (text, full, unpacked) =
        (read(&sample("wp15_13mps.out")), read(&sample("wp15_13mps_uncompressed.outb")), read(&packed));
    assert_eq!((text.time_s.len(), text.channels.len()), (501, 31));
    assert_agree(&text, &full, 1e-7);
    assert_eq!((unpacked.time_s.len(), unpacked.channels.len()), (501, 31));
    for ((a, b), scale) in unpacked.channels.iter().zip(&full.channels).zip(scales) {
        for (u, v) in a.values.iter().zip(&b.values) {
            // Half a step of the 16 bits, and offset and scale rounded to 24 bits.
            let quantum = 0.51 / f64::from(scale) + 2e-7 * v.abs();
            assert!((u - v).abs() <= quantum, "{}: {u} for {v}, step {quantum}", b.name);
        }
    }
}
