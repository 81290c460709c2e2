//! One trace in the layouts that loggers and spreadsheets write: each gives the estimates and the verdict of the original,
//! or one line that says how to read it. None a wrong verdict.

#![allow(clippy::unwrap_used)]

use flate2::read::GzDecoder;
use jiff::civil::date;
use pitchleak::Rig;
use pitchleak::replay::{ReplayError, replay};
use pitchleak::report::ReplayReport;
use pitchleak::trace::TraceReader;
use rand::seq::IndexedRandom;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::io::{Cursor, Read};

/// t, x, p_A, p_B, Q_A, Q_B of the first 20 s.
fn original() -> Vec<[String; 6]> {
    let mut text = String::new();
    let file = std::fs::File::open("data/traces/internal.csv.gz").unwrap();
    GzDecoder::new(file).read_to_string(&mut text).unwrap();
    let cells = |line: &str| {
        let mut cells = line.split(',').map(str::to_owned);
        std::array::from_fn(|_| cells.next().unwrap())
    };
    text.lines().skip(1).take(2000).map(cells).collect()
}

fn run(bytes: Vec<u8>, settings: &str) -> Result<ReplayReport, String> {
    let text = std::fs::read_to_string("data/traces/rig.toml").unwrap() + settings;
    let rig = Rig::parse(&text, "rig.toml").map_err(|error| error.to_string())?;
    let mut reader = TraceReader::from_stream("trace", Box::new(Cursor::new(bytes)), &rig)
        .map_err(|error| error.to_string())?;
    let report = replay(&mut reader, &rig, |_, _, _| Ok::<(), ReplayError>(()));
    report.map_err(|error| error.to_string())
}

/// How a column of times is written.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Time {
    Seconds,
    Milliseconds,
    Iso,
    IsoZoned,
    Points,
    PointsComma,
    Slashes,
    AmbiguousSlashes,
    American,
    Named,
    OfDay,
    PastMidnight,
    Zone,
    EpochSeconds,
    EpochMilliseconds,
    Excel,
    WholeSeconds,
}

fn time(row: usize, how: Time) -> String {
    let ms = 10 * row as i64;
    let start = match how {
        Time::AmbiguousSlashes => date(2026, 4, 3).at(12, 10, 31, 0),
        Time::PastMidnight => date(2026, 11, 20).at(23, 59, 55, 0),
        _ => date(2026, 11, 20).at(22, 10, 31, 0),
    };
    let civil = start.checked_add(jiff::Span::new().milliseconds(ms)).unwrap();
    let write = |pattern: &str| civil.strftime(pattern).to_string();
    let epoch_ms = start.to_zoned(jiff::tz::TimeZone::UTC).unwrap().timestamp().as_millisecond() + ms;
    match how {
        Time::Seconds => format!("{}.{:03}", ms / 1000, ms % 1000),
        Time::Milliseconds => ms.to_string(),
        Time::Iso => write("%Y-%m-%dT%H:%M:%S%.3f"),
        Time::IsoZoned => write("%Y-%m-%dT%H:%M:%S%.3f+01:00"),
        Time::Points => write("%d.%m.%Y %H:%M:%S%.3f"),
        Time::PointsComma => write("%d.%m.%Y %H:%M:%S,%3f"),
        Time::Slashes => write("%d/%m/%Y %H:%M:%S%.3f"),
        Time::AmbiguousSlashes => write("%d/%m/%Y %H:%M:%S%.3f"),
        Time::American => write("%m/%d/%Y %I:%M:%S%.3f %p"),
        Time::Named => write("%d-%b-%Y %H:%M:%S%.3f"),
        Time::OfDay | Time::PastMidnight => write("%H:%M:%S%.3f"),
        Time::Zone => write("%Y/%m/%d %H:%M:%S%.3f CET"),
        Time::EpochSeconds => format!("{}.{:03}", epoch_ms / 1000, epoch_ms % 1000),
        Time::EpochMilliseconds => epoch_ms.to_string(),
        Time::Excel => format!("{:.11}", 25_569.0 + epoch_ms as f64 / 86_400e3),
        Time::WholeSeconds => write("%d.%m.%Y %H:%M:%S"),
    }
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Encoding {
    Utf8,
    Bom,
    Utf16,
    Utf16Big,
    Latin1,
}

fn encode(text: &str, encoding: Encoding) -> Vec<u8> {
    let utf16 = |bytes: fn(u16) -> [u8; 2]| {
        "\u{feff}".encode_utf16().chain(text.encode_utf16()).flat_map(bytes).collect()
    };
    match encoding {
        Encoding::Utf8 => text.as_bytes().to_vec(),
        Encoding::Bom => format!("\u{feff}{text}").into_bytes(),
        Encoding::Utf16 => utf16(u16::to_le_bytes),
        Encoding::Utf16Big => utf16(u16::to_be_bytes),
        Encoding::Latin1 => text.chars().map(|c| u8::try_from(u32::from(c)).unwrap_or(b'?')).collect(),
    }
}

/// Headers in one style, time first; the row of units where there is one.
type Names = ([&'static str; 6], Option<[&'static str; 6]>);

const OURS: Names = (["t_s", "x_mm", "pa_bar", "pb_bar", "qa_lpm", "qb_lpm"], None);
const EXCEL: Names = (
    ["Time [s]", "Position [mm]", "Pressure A [bar]", "Pressure B [bar]", "Flow A [L/min]", "Flow B [L/min]"],
    None,
);
const UNITS_ROW: Names = (
    ["Time", "Position", "Pressure A", "Pressure B", "Flow A", "Flow B"],
    Some(["s", "mm", "bar", "bar", "l/min", "l/min"]),
);
const BRACKETED_ROW: Names =
    (["t", "x", "pA", "pB", "qA", "qB"], Some(["[s]", "[mm]", "[bar]", "[bar]", "[l/min]", "[l/min]"]));
const DIN: Names = (["t / s", "x / mm", "p_A / bar", "p_B / bar", "q_A / L/min", "q_B / L/min"], None);
const GERMAN: Names = (
    [
        "Zeit (s)",
        "Kolbenweg (mm)",
        "Druck A (bar)",
        "Druck B (bar)",
        "Durchfluss A (l/min)",
        "Durchfluss B (l/min)",
    ],
    None,
);
const FOREIGN: Names = (["Zähler", "AI0", "AI1", "AI2", "AI3", "AI4"], None);

#[derive(Clone, Debug)]
struct Layout {
    names: Names,
    time: Time,
    time_name: Option<&'static str>,
    delimiter: char,
    comma: bool,
    quoted: bool,
    preamble: &'static str,
    trailing: bool,
    line_end: &'static str,
    encoding: Encoding,
    settings: &'static str,
}

const PLAIN: Layout = Layout {
    names: OURS,
    time: Time::Seconds,
    time_name: None,
    delimiter: ',',
    comma: false,
    quoted: false,
    preamble: "",
    trailing: false,
    line_end: "\n",
    encoding: Encoding::Utf8,
    settings: "",
};

fn write(rows: &[[String; 6]], layout: &Layout) -> Vec<u8> {
    let delimiter = layout.delimiter.to_string();
    let line = |cells: Vec<String>| {
        let quote = |cell: String| if layout.quoted { format!("\"{cell}\"") } else { cell };
        let end = if layout.trailing { delimiter.as_str() } else { "" };
        cells.into_iter().map(quote).collect::<Vec<_>>().join(&delimiter) + end + layout.line_end
    };
    let (names, units) = layout.names;
    let mut headers: Vec<String> = names.iter().map(|name| (*name).to_owned()).collect();
    if let Some(name) = layout.time_name {
        headers[0] = name.to_owned();
    }
    let mut text = layout.preamble.to_owned() + &line(headers);
    if let Some(units) = units {
        text += &line(units.iter().map(|unit| (*unit).to_owned()).collect());
    }
    for (row, cells) in rows.iter().enumerate() {
        let number = |cell: &String| if layout.comma { cell.replace('.', ",") } else { cell.clone() };
        let stamp = time(row, layout.time);
        let is_number = matches!(layout.time, Time::Seconds | Time::EpochSeconds | Time::Excel);
        let first = if is_number { number(&stamp) } else { stamp };
        text += &line(std::iter::once(first).chain(cells[1..].iter().map(number)).collect());
    }
    encode(&text, layout.encoding)
}

/// How far two reports are apart, in standard deviations of the first.
fn distance(original: &ReplayReport, other: &ReplayReport) -> f64 {
    let leaks = original.estimates.leaks().zip(other.estimates.leaks());
    let apart = leaks.iter().map(|(_, (ours, theirs))| (ours.value - theirs.value).abs() / ours.std.unwrap());
    apart.fold(0.0, f64::max)
}

/// Whether it was read; a line that says how to, else.
fn holds(original: &ReplayReport, layout: &Layout, bytes: Vec<u8>) -> Result<(), String> {
    let report = run(bytes, layout.settings)?;
    // A serial number of a spreadsheet holds its time to a microsecond, by which a block may end a sample later.
    let bound = if layout.time == Time::Excel { 0.3 } else { 1e-6 };
    let apart = distance(original, &report);
    assert!(apart < bound, "{layout:?}: {apart} standard deviations off");
    assert_eq!(report.verdict.status, original.verdict.status, "{layout:?}");
    assert_eq!(report.verdict.faults, original.verdict.faults, "{layout:?}");
    assert_eq!(
        (report.trace.samples, report.trace.skipped),
        (2000, 0),
        "{layout:?}: {:?}",
        report.trace.warnings
    );
    Ok(())
}

#[test]
fn plain_layouts_give_the_original() {
    let rows = original();
    let truth = run(write(&rows, &PLAIN), "").unwrap();
    let stamped = |time, time_name| Layout { time, time_name: Some(time_name), ..PLAIN };
    let european = Layout { delimiter: ';', comma: true, line_end: "\r\n", ..PLAIN };
    let layouts = [
        Layout { delimiter: ';', ..PLAIN },
        Layout { delimiter: '\t', ..PLAIN },
        Layout { delimiter: '|', ..PLAIN },
        european.clone(),
        Layout { delimiter: '\t', comma: true, ..PLAIN },
        Layout { comma: true, quoted: true, ..PLAIN },
        Layout { preamble: "sep=;\r\n", names: EXCEL, ..european.clone() },
        Layout {
            preamble: "Logger 3000\nStart: 20.11.2026, 22:10\n\nRate [Hz];100\n",
            names: EXCEL,
            ..european.clone()
        },
        Layout { preamble: "# made by hand, twice, and, again\n# ", ..PLAIN },
        Layout { names: EXCEL, quoted: true, ..PLAIN },
        Layout { names: UNITS_ROW, ..european.clone() },
        Layout { names: BRACKETED_ROW, delimiter: '\t', ..PLAIN },
        Layout { names: DIN, ..european.clone() },
        Layout { names: GERMAN, encoding: Encoding::Latin1, ..european.clone() },
        Layout { names: EXCEL, encoding: Encoding::Bom, ..PLAIN },
        Layout { names: EXCEL, encoding: Encoding::Utf16, delimiter: '\t', comma: true, ..PLAIN },
        Layout { encoding: Encoding::Utf16Big, ..european.clone() },
        Layout { trailing: true, ..european.clone() },
        stamped(Time::Milliseconds, "t_ms"),
        stamped(Time::Iso, "timestamp"),
        stamped(Time::IsoZoned, "Date/Time"),
        stamped(Time::Points, "timestamp"),
        Layout { time: Time::PointsComma, time_name: Some("Zeitstempel"), ..european.clone() },
        stamped(Time::Slashes, "timestamp"),
        stamped(Time::American, "DateTime"),
        stamped(Time::Named, "Time"),
        stamped(Time::OfDay, "Time"),
        stamped(Time::PastMidnight, "Time (hh:mm:ss)"),
        stamped(Time::Zone, "timestamp"),
        stamped(Time::Points, "Time [Europe/Berlin]"),
        stamped(Time::EpochSeconds, "timestamp"),
        stamped(Time::EpochMilliseconds, "timestamp"),
        stamped(Time::Excel, "Time"),
        Layout { time: Time::Excel, time_name: Some("Date/Time"), ..european.clone() },
        Layout {
            settings: "[columns]\ntimestamp = { name = \"timestamp\", format = \"dmy\" }\n",
            ..stamped(Time::AmbiguousSlashes, "timestamp")
        },
        Layout { settings: "[csv]\ntime_format = \"dmy\"\n", ..stamped(Time::AmbiguousSlashes, "timestamp") },
        Layout {
            settings: "[columns]\ntimestamp = { name = \"Zeit\", format = \"%d.%m.%Y %H:%M:%S%.f\", zone = \"Europe/Berlin\" }\n",
            ..stamped(Time::Points, "Zeit")
        },
        Layout {
            names: FOREIGN,
            settings: "[columns]\nt = { name = \"Zähler\", unit = \"s\" }\nx = { name = \"AI0\", unit = \"mm\" }\npa = { name = \"AI1\", unit = \"bar\" }\n\
                       pb = { name = \"AI2\", unit = \"bar\" }\nqa = { name = \"AI3\", unit = \"lpm\" }\nqb = { name = \"AI4\", unit = \"lpm\" }\n",
            encoding: Encoding::Latin1,
            ..european.clone()
        },
        Layout {
            names: EXCEL,
            settings: "[columns]\npa = \"Pressure A [bar]\"\npb = \"Pressure B [bar]\"\n",
            ..PLAIN
        },
    ];
    for layout in layouts {
        if let Err(why) = holds(&truth, &layout, write(&rows, &layout)) {
            panic!("{layout:?}: {why}");
        }
    }
}

#[test]
fn what_can_be_read_in_two_ways_is_refused_with_what_settles_it() {
    let rows = original();
    let stamped = |time, time_name| Layout { time, time_name: Some(time_name), ..PLAIN };
    type Change = fn(String) -> String;
    let cases: [(Layout, Change, &str); 12] = [
        (stamped(Time::AmbiguousSlashes, "timestamp"), |text| text, "format = \"dmy\""),
        (stamped(Time::WholeSeconds, "timestamp"), |text| text, "fractions of a second"),
        (stamped(Time::Seconds, "Time"), |text| text, "pitchleak columns"),
        (stamped(Time::Seconds, "timestamp"), |text| text, "unit = \"s\""),
        (Layout { comma: true, ..PLAIN }, |text| text, "decimal comma"),
        (Layout { delimiter: ';', ..PLAIN }, |text| text.replace("0.", "0,"), "--decimal"),
        (Layout { delimiter: ' ', ..PLAIN }, |text| text, "no column for"),
        (Layout { names: FOREIGN, ..PLAIN }, |text| text, "pitchleak columns"),
        (PLAIN, |text| text.split_once('\n').unwrap().1.to_owned(), "put a line above it"),
        (
            Layout { names: (OURS.0, Some(["s", "m", "bar", "bar", "lpm", "lpm"])), ..PLAIN },
            |text| text,
            "the row of units says m",
        ),
        (
            Layout {
                names: (["t_s", "x_mm", "pa_bar", "pb_bar", "Flow A [L/min]", "Flow A (m3/h)"], None),
                ..PLAIN
            },
            |text| text,
            "both give `qa`",
        ),
        (Layout { delimiter: ';', ..PLAIN }, |text| text.replace("5", "5,1"), "thousands"),
    ];
    for (layout, change, expected) in cases {
        let text = change(String::from_utf8(write(&rows, &layout)).unwrap());
        let why =
            run(text.into_bytes(), layout.settings).map(|report| report.verdict.text).expect_err(expected);
        assert!(why.contains(expected) && !why.contains('\n'), "{layout:?}: {why}");
    }
}

/// Any of them together.
#[test]
fn no_layout_gives_another_verdict() {
    let rows = original();
    let truth = run(write(&rows, &PLAIN), "").unwrap();
    let mut rng = ChaCha8Rng::seed_from_u64(20);
    let (mut read, mut refused) = (0, 0);
    for _ in 0..60 {
        let time = *[
            Time::Seconds,
            Time::Points,
            Time::Slashes,
            Time::American,
            Time::EpochSeconds,
            Time::Excel,
            Time::AmbiguousSlashes,
            Time::OfDay,
        ]
        .choose(&mut rng)
        .unwrap();
        let layout = Layout {
            names: *[OURS, EXCEL, UNITS_ROW, BRACKETED_ROW, DIN, GERMAN, FOREIGN].choose(&mut rng).unwrap(),
            time,
            time_name: (time != Time::Seconds).then_some("timestamp"),
            delimiter: *[',', ';', '\t', '|', ' '].choose(&mut rng).unwrap(),
            comma: rng.random(),
            quoted: rng.random_ratio(1, 4),
            preamble: ["", "sep=;\n", "Logger 3000\nStation: 7, Blade 2\n\n"].choose(&mut rng).unwrap(),
            trailing: rng.random_ratio(1, 4),
            line_end: ["\n", "\r\n"].choose(&mut rng).unwrap(),
            encoding: *[Encoding::Utf8, Encoding::Bom, Encoding::Utf16, Encoding::Utf16Big, Encoding::Latin1]
                .choose(&mut rng)
                .unwrap(),
            settings: "",
        };
        match holds(&truth, &layout, write(&rows, &layout)) {
            Ok(()) => read += 1,
            Err(why) => {
                assert!(!why.contains('\n') && why.len() < 600, "{why}");
                refused += 1;
            }
        }
    }
    assert!(read >= 20, "{read} read, {refused} refused");
}
