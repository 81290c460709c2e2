//! Messages of many samples: the numbers of `replay`, in every format, in whatever order and however often they come.

#![allow(clippy::unwrap_used)]

use pitchleak::Rig;
use pitchleak::core::{Leak, PerLeak, Sample};
use pitchleak::live::{
    Batch, BatchFormat, Checkpoint, EstimateEvent, Event, LiveConfig, OutputFormat, Snapshot, Watch,
};
use pitchleak::replay::{ReplayError, Stream, replay};
use pitchleak::report::{Status, Verdict};
use pitchleak::trace::{BadRows, TraceReader};
use pitchleak_testkit::trace_text::{file, row};
use pitchleak_testkit::{Motion, noisy, seeded};
use std::io::Read;
use std::path::PathBuf;

const TRACES: [&str; 8] = [
    "traces/both",
    "traces/external_a",
    "traces/healthy",
    "traces/internal",
    "hopsan/h02",
    "hopsan/h06",
    "hopsan/u04",
    "hopsan/u07",
];

fn data(name: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("data").join(name)
}

fn rig() -> Rig {
    Rig::load(data("traces/rig.toml")).unwrap()
}

/// Header and rows.
fn rows(trace: &str) -> (Vec<String>, Vec<Vec<String>>) {
    let file = std::fs::File::open(data(&format!("{trace}.csv.gz"))).unwrap();
    let mut text = String::new();
    flate2::read::GzDecoder::new(file).read_to_string(&mut text).unwrap();
    let mut lines = text.lines().map(|line| line.split(',').map(str::to_owned).collect());
    (lines.next().unwrap(), lines.collect())
}

fn json(header: &[String], rows: &[Vec<String>]) -> String {
    let object = |row: &Vec<String>| {
        let cells = header.iter().zip(row).filter(|(_, cell)| !cell.is_empty());
        format!(
            "{{{}}}",
            cells.map(|(name, cell)| format!("\"{name}\":{cell}")).collect::<Vec<_>>().join(",")
        )
    };
    format!("[{}]", rows.iter().map(object).collect::<Vec<_>>().join(","))
}

fn csv(header: &[String], rows: &[Vec<String>]) -> String {
    std::iter::once(header.join(","))
        .chain(rows.iter().map(|row| row.join(",")))
        .collect::<Vec<_>>()
        .join("\n")
}

struct Feed {
    watch: Watch,
    events: Vec<Event>,
}

impl Feed {
    fn new() -> Self {
        Self { watch: Watch::new(LiveConfig::of(rig()), None), events: Vec::new() }
    }

    fn take(&mut self, format: BatchFormat, payload: &str, resent: bool) {
        let payload = payload.as_bytes();
        self.watch.take_batch(&Batch { cylinder: "T7/B2", format, payload, resent }, &mut self.events);
    }

    /// The bytes of its checkpoint.
    fn state(&mut self) -> Vec<u8> {
        let folder = tempfile::tempdir().unwrap();
        Checkpoint::new(folder.path()).unwrap().save(&Snapshot::of(&mut self.watch)).unwrap();
        std::fs::read(folder.path().join("cylinders/T7%2FB2.state")).unwrap()
    }

    fn last_estimate(mut self) -> EstimateEvent {
        self.watch.finish(&mut self.events);
        let mut estimates = self.events.into_iter().filter_map(|event| match event {
            Event::Estimate(estimate) => Some(estimate),
            _ => None,
        });
        *estimates.next_back().unwrap()
    }
}

#[test]
fn batches_give_the_numbers_of_replay_on_every_trace() {
    for trace in TRACES {
        let rig = rig();
        let mut reader = TraceReader::open(data(&format!("{trace}.csv.gz")), &rig).unwrap();
        let report = replay(&mut reader, &rig, |_, _, _| Ok::<_, ReplayError>(())).unwrap();
        let (header, rows) = rows(trace);
        for (format, write) in
            [(BatchFormat::Json, json as fn(&[String], &[Vec<String>]) -> String), (BatchFormat::Csv, csv)]
        {
            let mut feed = Feed::new();
            rows.chunks(37).for_each(|chunk| feed.take(format, &write(&header, chunk), false));
            let last = feed.last_estimate();
            assert_eq!(
                (last.status, &last.faults),
                (report.verdict.status, &report.verdict.faults),
                "{trace}"
            );
            assert_eq!(last.trend, report.trend, "{trace}");
            for (leak, leakage) in last.leakage {
                let expected = report.leakage[leak];
                assert_eq!(leakage.mean_lpm.to_bits(), expected.mean_lpm.to_bits(), "{trace} {format:?}");
                assert_eq!(leakage.std_lpm, expected.std_lpm, "{trace} {format:?}");
            }
        }
    }
}

#[test]
fn messages_that_come_twice_and_samples_in_disorder_change_nothing_to_the_last_bit() {
    let (header, rows) = rows("traces/both");
    let (mut plain, mut disturbed) = (Feed::new(), Feed::new());
    let mut before: Vec<String> = Vec::new();
    for (k, chunk) in rows.chunks(50).enumerate() {
        plain.take(BatchFormat::Json, &json(&header, chunk), false);
        let mut shuffled = chunk.to_vec();
        shuffled.rotate_left(k % 50);
        // A row that cannot be used counts once, too.
        shuffled.push(chunk[0].clone());
        let text = json(&header, &shuffled);
        disturbed.take(BatchFormat::Json, &text, false);
        before.push(text);
        if k % 10 == 9 {
            // As after a lost connection: all that was not acknowledged.
            before.drain(..).for_each(|text| disturbed.take(BatchFormat::Json, &text, true));
        }
    }
    assert!(plain.state() == disturbed.state());
    let late = disturbed.events.iter().filter(|event| matches!(event, Event::Notice(_))).count();
    assert!((1..10).contains(&late), "{late}");
}

#[test]
fn bad_rows_count_once_however_often_they_come() {
    let (header, mut rows) = rows("traces/both");
    for (k, row) in rows.iter_mut().enumerate().filter(|(k, _)| k % 100 == 49) {
        row[2] = if k % 200 == 49 { "nonsense".to_owned() } else { "9e9".to_owned() };
    }
    let (mut plain, mut twice) = (Feed::new(), Feed::new());
    for chunk in rows.chunks(50) {
        let text = csv(&header, chunk);
        plain.take(BatchFormat::Csv, &text, false);
        twice.take(BatchFormat::Csv, &text, false);
        twice.take(BatchFormat::Csv, &text, true);
    }
    assert!(plain.state() == twice.state());
}

#[test]
fn a_name_with_a_line_break_is_told_in_one_line() {
    let mut feed = Feed::new();
    feed.take(
        BatchFormat::Json,
        r#"{"cylinder":"T7\nB2\u001b[2J","t_s":0.0,"x_m":0.1,"pa_pa":1e6,"pb_pa":1e6}"#,
        false,
    );
    feed.watch.finish(&mut feed.events);
    assert!(!feed.events.is_empty());
    for event in &feed.events {
        let [influx, ndjson] =
            [OutputFormat::Influx, OutputFormat::Ndjson].map(|format| event.line(format).unwrap());
        assert!(influx.contains("too_many_cylinders") && influx.contains("T7"), "{influx}");
        assert!(!influx.trim_end().contains(char::is_control), "{influx:?}");
        assert!(!ndjson.trim_end().contains(char::is_control), "{ndjson:?}");
    }
}

#[test]
fn neurons_uploads_are_samples() {
    let (header, rows) = rows("traces/internal");
    let (mut neuron, mut json) = (Feed::new(), Feed::new());
    for (k, row) in rows.iter().take(1000).enumerate() {
        let time_ms = 1_700_000_000_000 + 10 * k as i64;
        let cells: Vec<_> =
            header.iter().zip(row).skip(1).map(|(name, cell)| format!("\"{name}\": {cell}")).collect();
        let values = cells.join(", ");
        neuron.take(
            BatchFormat::Neuron,
            &format!("{{\"timestamp\": {time_ms}, \"node\": \"T7/B2\", \"group\": \"g\", \"values\": {{{values}}}}}"),
            false,
        );
        let stamp = format!("2023-11-14T22:13:{:02}.{:02}Z", 20 + k / 100, k % 100);
        json.take(BatchFormat::Json, &format!("{{\"timestamp\": \"{stamp}\", {values}}}"), false);
    }
    let (neuron, json) = (neuron.last_estimate(), json.last_estimate());
    assert_eq!(neuron, json);
    assert_eq!(neuron.time_ns, Some(1_700_000_009_990_000_000));
}

/// A cylinder in motion for three quarters of an hour, read 25 times a second by sensors of 0.3 %; `lie` changes readings.
fn long_trace(rig: &Rig, lie: impl Fn(f64, &mut Sample<f64>)) -> Vec<String> {
    let motion = Motion::wind_like(PerLeak { internal: 1e-11, external_a: 0.0, external_b: 0.0 });
    let (sensors, mut random) = (rig.sensors(), seeded(7));
    let read = |k: u32| {
        let t_s = f64::from(k) * 0.04;
        let mut sample = noisy(&motion.sample(t_s), &sensors, &mut random);
        lie(t_s, &mut sample);
        row(t_s, motion.position_m.slope(t_s), &sample)
    };
    (0..45 * 60 * 25).map(read).collect()
}

fn reader<'a>(rows: &[String], rig: &Rig) -> TraceReader<'a> {
    TraceReader::from_stream("t", Box::new(std::io::Cursor::new(file(rows).into_bytes())), rig).unwrap()
}

/// What misfitted, or hung, for a while counts for ten to twenty minutes; what hung is told as long as the stream runs. A file's
/// verdict is on the whole of it.
#[test]
fn what_was_wrong_once_does_not_keep_a_stream_in_doubt_for_ever() {
    let mut rig = Rig::paper();
    rig.instruments = rig.instruments.with_accuracy(3e-3);
    let wrong = |t_s: f64| (60.0..90.0).contains(&t_s);
    let hangs = |t_s: f64, sample: &mut Sample<f64>| {
        if wrong(t_s) {
            sample.qa_m3s = Some(5e-5);
        }
    };
    let scatters = |t_s: f64, sample: &mut Sample<f64>| {
        let by_m3s = if wrong(t_s) { 7e-5 * (40.0 * t_s).sin() } else { 0.0 };
        sample.qa_m3s = sample.qa_m3s.map(|flow| flow + by_m3s);
    };
    for (rows, said) in [
        (long_trace(&rig, hangs), "Earlier: qa reads 3 L/min from 60.00 s to 89.96 s"),
        (long_trace(&rig, scatters), ""),
    ] {
        let mut stream = Stream::new(&rig, BadRows::Skip).unwrap();
        let (begun, rest) = rows.split_at(5 * 60 * 25);
        stream.extend(reader(begun, &rig)).unwrap();
        assert_eq!(stream.report("t").unwrap().verdict.status, Status::Doubtful, "{said}");
        stream.extend(reader(rest, &rig)).unwrap();
        let Verdict { status, faults, text, .. } = stream.report("t").unwrap().verdict;
        assert_eq!((status, faults), (Status::Leak, vec![Leak::Internal]), "{text}");
        assert!(text.contains(said), "{text}");
        let whole = replay(&mut reader(&rows, &rig), &rig, |_, _, _| Ok::<_, ReplayError>(())).unwrap();
        // A meter that hung is none to rely on; one that was loud for half a minute of 45 is.
        let status = if said.is_empty() { Status::Leak } else { Status::Doubtful };
        assert_eq!(whole.verdict.status, status, "{said}");
    }
}
