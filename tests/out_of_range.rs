//! Rows that the reader refuses as out of range: the unit, or the slipped decimal point, behind it is named with its evidence, at
//! every door, and what cannot be told apart is said to be so.

#![allow(clippy::unwrap_used)]

use pitchleak::Rig;
use pitchleak::core::{PerLeak, Sample};
use pitchleak::live::{Event, LineFormat, LiveConfig, Watch};
use pitchleak::replay::{ReplayError, Stream, replay};
use pitchleak::report::ReplayReport;
use pitchleak::rig::ForeignColumn;
use pitchleak::signal::Signal;
use pitchleak::simulate::{Biases, LeakCourse, LeakSize, Scenario, Sensing, Truth};
use pitchleak::trace::{BadRows, TraceReader};
use pitchleak::units::{Dimension, unit};
use pitchleak::wind::{Emulation, History, Wind, WindCase};
use std::io::Cursor;

const PSI_PER_BAR: f64 = 14.503_773_773;

fn rig(accuracy: f64) -> Rig {
    let mut rig = Rig::paper();
    rig.instruments = rig.instruments.with_accuracy(accuracy);
    rig
}

/// Of a cylinder that leaks past its piston by about 0.4 L/min.
fn truths(wind: WindCase, duration_s: f64) -> Vec<Truth> {
    let history = History::of(&Wind::BuiltIn(wind)).unwrap();
    let rig = rig(0.003);
    let leaks = PerLeak { internal: 8e-12, external_a: 0.0, external_b: 0.0 };
    let reference = Emulation::paper().reference(&history, rig.cylinder.stroke_m).unwrap();
    let scenario = Scenario {
        leaks: leaks.map(|size| LeakCourse::from_onset(LeakSize::Coefficient(size), 0.0)),
        start_s: 30.0,
        duration_s,
        ..Scenario::new(rig, reference)
    };
    scenario.collect(leaks).unwrap()
}

/// The lines of a trace as CSV, its pressures in bar before `change` reads them otherwise.
fn lines(truths: &[Truth], accuracy: f64, change: impl Fn(usize, [f64; 2]) -> [f64; 2]) -> Vec<String> {
    let mut sensing = Sensing::new(rig(accuracy).sensors(), Biases::default(), 4711);
    let row = |(at, truth): (usize, &Truth)| {
        let Sample { x_m, pa_pa, pb_pa, qa_m3s, qb_m3s, force_n } = sensing.read(&truth.sample);
        let [pa, pb] = change(at, [pa_pa / 1e5, pb_pa / 1e5]);
        let (qa, qb) = (qa_m3s.unwrap() * 60e3, qb_m3s.unwrap() * 60e3);
        format!("{},{},{pa},{pb},{qa},{qb},{}", truth.t_s, 1e3 * x_m, force_n.unwrap())
    };
    let header = "t_s,x_mm,pa_bar,pb_bar,qa_lpm,qb_lpm,force_n".to_owned();
    std::iter::once(header).chain(truths.iter().enumerate().map(row)).collect()
}

fn replayed(lines: &[String], rig: &Rig) -> Result<ReplayReport, String> {
    let bytes = (lines.join("\n") + "\n").into_bytes();
    let mut reader = TraceReader::from_stream("trace", Box::new(Cursor::new(bytes)), rig).unwrap();
    replay(&mut reader, rig, |_, _, _| Ok::<_, ReplayError>(())).map_err(|error| error.to_string())
}

fn without_force(lines: &[String]) -> Vec<String> {
    lines.iter().map(|line| line.rsplit_once(',').unwrap().0.to_owned()).collect()
}

/// Also where the piston hardly moves, where another rig's sensors are read, and where the other pressure would bear the factor.
#[test]
fn the_load_force_tells_the_unit_of_refused_pressures() {
    type Change = fn(usize, [f64; 2]) -> [f64; 2];
    let cases: [(&str, Change); 5] = [
        ("with pa divided by 14.504 (psi) they are", |_, [a, b]| [PSI_PER_BAR * a, b]),
        ("with pb divided by 14.504 (psi) they are", |_, [a, b]| [a, PSI_PER_BAR * b]),
        ("with pa and pb divided by 14.504 (psi) they are", |_, p| p.map(|p| PSI_PER_BAR * p)),
        ("with pa and pb divided by 10 they are", |_, p| p.map(|p| 10.0 * p)),
        ("with pa and pb divided by 100 (kPa) they are", |_, p| p.map(|p| 100.0 * p)),
    ];
    for wind in WindCase::ALL {
        let truths = truths(wind, 30.0);
        for (accuracy, full_scale_pa) in [(0.001, 160e5), (0.003, 100e5), (0.01, 160e5)] {
            let mut rig = rig(accuracy);
            rig.instruments.pressure.full_scale = full_scale_pa;
            for (words, change) in cases {
                let said = replayed(&lines(&truths, accuracy, change), &rig);
                let said = match said {
                    Err(error) => error,
                    Ok(report) => report.verdict.text,
                };
                let named = format!("{wind:?}, {accuracy}: {words}: {said}");
                assert!(!said.contains('\n'), "{named}");
                assert!(said.to_lowercase().contains(&words.to_lowercase()), "{named}");
                assert!(said.contains("balance the load force"), "{named}");
                assert!(!said.contains("cannot be told apart"), "{named}");
            }
        }
    }
}

/// By their scatter where sensors are as declared, else not at all: then every reading that the rig allows is said, and never one
/// alone.
#[test]
fn what_cannot_be_told_apart_is_said_to_be_so() {
    let truths = truths(WindCase::Mps13, 30.0);
    for (times, words) in
        [(PSI_PER_BAR, "pa and pb divided by 14.504 (psi)"), (10.0, "pa and pb divided by 10")]
    {
        let lines = without_force(&lines(&truths, 0.003, |_, p| p.map(|p| times * p)));
        let told = replayed(&lines, &rig(0.003)).unwrap_err();
        assert!(told.contains(words) && !told.contains("cannot be told apart"), "{told}");
        // Sensors better than their data sheet.
        let open = replayed(&lines, &rig(0.01)).unwrap_err();
        assert!(open.contains("cannot be told apart: ") && open.contains(words), "{open}");
        assert!(open.contains("pa and pb divided by 14.504 (psi)"), "{open}");
        assert!(open.contains("pa and pb divided by 10,"), "{open}");
    }
}

/// The lines that mend it are those of the file, and mend it.
#[test]
fn what_is_suggested_mends_the_trace() {
    let truths = truths(WindCase::Mps13, 30.0);
    let honest = replayed(&lines(&truths, 0.003, |_, p| p), &rig(0.003)).unwrap();
    // Columns of a file that has names and units of its own.
    let mut own = rig(0.003);
    let megapascal = unit("MPa", Dimension::Pressure).unwrap();
    for (signal, name) in [(Signal::PressureA, "pa_bar"), (Signal::PressureB, "pb_bar")] {
        own.columns.insert(signal, ForeignColumn::new(name, Some(megapascal)));
    }
    for (times, rig) in [(PSI_PER_BAR, rig(0.003)), (10.0, rig(0.003)), (1.0, own)] {
        let lines = lines(&truths, 0.003, |_, p| p.map(|p| times * p));
        let said = replayed(&lines, &rig).unwrap_err();
        let (_, mending) = said.rsplit_once("[columns] ").unwrap();
        let mending = mending.replace("; ", "\n");
        let mut plain = rig.clone();
        plain.columns.clear();
        let mended = Rig::parse(&format!("{}[columns]\n{mending}\n", plain.to_toml()), "rig.toml").unwrap();
        let report = replayed(&lines, &mended).unwrap();
        assert_eq!(
            (report.verdict.status, &report.verdict.faults),
            (honest.verdict.status, &honest.verdict.faults)
        );
        let off = report.leakage.internal.mean_lpm - honest.leakage.internal.mean_lpm;
        assert!(off.abs() < 1e-3, "{times}: {off}");
    }
}

/// A sensor that fails, and readings that come and go, are no unit.
#[test]
fn a_broken_sensor_is_no_unit() {
    let (truths, rig) = (truths(WindCase::Mps13, 30.0), rig(0.003));
    let dead = replayed(&lines(&truths, 0.003, |_, [_, b]| [600.0, b]), &rig).unwrap_err();
    assert!(!dead.contains("divided by"), "{dead}");
    let absurd = replayed(&lines(&truths, 0.003, |_, [a, b]| [1e300 * a, b]), &rig).unwrap_err();
    assert!(!absurd.contains("divided by"), "{absurd}");
    // A wild row in ten, and the last two seconds: the rest is as it would be without them.
    let honest = replayed(&lines(&truths, 0.003, |_, p| p), &rig).unwrap();
    let wild = |at: usize, [a, b]: [f64; 2]| if at % 10 == 3 || at > 2800 { [12.0 * a, b] } else { [a, b] };
    let report = replayed(&lines(&truths, 0.003, wild), &rig).unwrap();
    assert_eq!(report.verdict.status, honest.verdict.status, "{}", report.verdict.text);
    assert!(report.verdict.reasons.is_empty());
}

/// A stream of which no line is good says so once a minute, and what would mend it.
#[test]
fn a_stream_says_it_too() {
    let truths = truths(WindCase::Mps13, 130.0);
    let lines = lines(&truths, 0.003, |_, p| p.map(|p| PSI_PER_BAR * p));
    let mut events = Vec::new();
    let mut watch = Watch::new(LiveConfig::of(rig(0.003)), Some(LineFormat::Csv));
    lines.iter().for_each(|line| watch.take(line.as_bytes(), &mut events));
    watch.finish(&mut events);
    let notices: Vec<_> = events
        .iter()
        .filter_map(|event| if let Event::Notice(notice) = event { Some(notice) } else { None })
        .collect();
    assert_eq!(notices.len(), events.len());
    assert_eq!(notices.iter().map(|notice| notice.count).sum::<u64>(), lines.len() as u64 - 1);
    assert_eq!(notices.len(), 4, "{notices:#?}");
    for notice in notices.iter().skip(1) {
        assert_eq!((notice.kind.as_str(), notice.t_s), ("out_of_range", None));
        assert!(notice.text.contains("with pa and pb divided by 14.504 (psi) they are"), "{}", notice.text);
        assert!(
            notice.text.contains("[columns] pa = { name = \"pa_bar\", unit = \"psi\" }; pb = "),
            "{}",
            notice.text
        );
    }
}

/// A stream of rows of these pressures, in bar, without the force that could tell a unit from another.
fn streamed(
    duration_s: f64,
    rows: std::ops::Range<usize>,
    change: impl Fn(usize, [f64; 2]) -> [f64; 2],
) -> Stream {
    let lines = without_force(&lines(&truths(WindCase::Mps13, duration_s), 0.003, change));
    let mut stream = Stream::new(&rig(0.003), BadRows::Skip).unwrap();
    stream.extend(part(&lines, rows)).unwrap();
    stream
}

fn part(lines: &[String], rows: std::ops::Range<usize>) -> TraceReader<'static> {
    let text =
        std::iter::once(&lines[0]).chain(&lines[rows]).fold(String::new(), |text, line| text + line + "\n");
    TraceReader::from_stream("part", Box::new(Cursor::new(text.into_bytes())), &rig(0.003)).unwrap()
}

/// A reading that no sensor has in any unit does not hide the unit of the others.
#[test]
fn absurd_readings_among_them_change_nothing() {
    let absurd = |at: usize, p: [f64; 2]| p.map(|p| if at % 100 == 7 { 1e300 } else { 10.0 * p });
    let told = streamed(30.0, 1..2900, absurd).refused_for().unwrap();
    assert!(told.suggestion.contains("divided by 10"), "{}", told.suggestion);
}

/// What a stream has seen of refused rows goes through its saved state, and is forgotten a minute after they have stopped,
/// although they were most.
#[test]
fn a_saved_stream_goes_on_and_forgets() {
    let truths = truths(WindCase::Mps13, 145.0);
    let lines = lines(&truths, 0.003, |at, p| p.map(|p| if at < 8000 { 10.0 * p } else { p }));
    let mut whole = Stream::new(&rig(0.003), BadRows::Skip).unwrap();
    whole.extend(part(&lines, 1..1500)).unwrap();
    let mut saved = Stream::restore(&whole.save().unwrap()).unwrap();
    for stream in [&mut whole, &mut saved] {
        stream.extend(part(&lines, 1500..7900)).unwrap();
        let told = stream.refused_for().unwrap();
        assert!(told.suggestion.contains("with pa and pb divided by 10 they are"), "{}", told.suggestion);
    }
    assert_eq!(whole.refused_for(), saved.refused_for());
    saved.extend(part(&lines, 7900..14_300)).unwrap();
    assert!(saved.refused_for().is_none());
}
