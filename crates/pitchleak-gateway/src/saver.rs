//! Checkpoints, alarms and summaries to the disk, in a thread of its own: samples don't wait for it.
//!
//! When to write a checkpoint: seldom, as a disk wears out, and often enough for a broker that waits for us.

use crate::Failure;
use crate::broker::Ticket;
use crate::run::{Input, thread};
use jiff::Timestamp;
use pitchleak::core::Leak;
use pitchleak::live::{Checkpoint, LeakSummary, Snapshot, SummaryEvent};
use pitchleak::output::{self, Inputs};
use rustix::process::{getpriority_process, setpriority_process};
use std::collections::BTreeMap;
use std::fs::{self, File, OpenOptions};
use std::io::{self, Write as _};
use std::os::unix::fs::FileExt;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// A tenth of the processor, while the thread of the samples wants all of it.
const NICER: i32 = 10;

/// What is to be written, and the deliveries that may be acknowledged then.
#[derive(Default)]
pub struct Job {
    /// Alarms, as in their file; none where the disk knows them.
    pub alarms: Option<String>,
    /// None where only alarms are to be written.
    pub snapshot: Option<Snapshot>,
    pub summaries: Vec<SummaryEvent>,
    pub tickets: Vec<Ticket>,
    /// Alarms that samples in the snapshot have raised.
    pub raised: Vec<u64>,
}

/// What became of it: what was written is gone from the job.
pub struct Saved {
    /// Bytes of the checkpoint, if it was one; or why it is not written.
    pub result: Result<Option<usize>, String>,
    pub took: Duration,
    pub job: Job,
}

/// Where it goes.
pub struct Disk {
    pub checkpoint: Arc<Checkpoint>,
    pub summaries: Summaries,
    /// File of the alarms.
    pub alarms: PathBuf,
}

/// Starts the thread; it ends when nobody can send it jobs any more.
pub fn start(disk: Disk, inbox: SyncSender<Input>) -> Result<(SyncSender<Job>, JoinHandle<()>), Failure> {
    let (jobs, queue) = sync_channel(1);
    let run = move || {
        give_way();
        work(&disk, &queue, &inbox);
    };
    Ok((jobs, thread("saver", run)?))
}

/// Where samples come meanwhile on the same core, they go first. On Linux a priority is the thread's own.
fn give_way() {
    let _ = getpriority_process(None).and_then(|nice| setpriority_process(None, nice + NICER));
}

fn work(disk: &Disk, queue: &Receiver<Job>, inbox: &SyncSender<Input>) {
    for mut job in queue {
        let began = Instant::now();
        let result = disk.write(&mut job);
        let saved = Saved { result, took: began.elapsed(), job };
        if inbox.send(Input::Saved(Box::new(saved))).is_err() {
            return;
        }
    }
}

impl Disk {
    /// First alarms and summaries: after a crash in between they are there twice, and not missing.
    fn write(&self, job: &mut Job) -> Result<Option<usize>, String> {
        if let Some(alarms) = job.alarms.take() {
            let written = output::write(&self.alarms, &alarms, &Inputs::default());
            written.map_err(|error| {
                job.alarms = Some(alarms);
                error.to_string()
            })?;
        }
        self.summaries.append(&job.summaries).map_err(|error| format!("cannot write summaries: {error}"))?;
        job.summaries.clear();
        let Some(snapshot) = &job.snapshot else { return Ok(None) };
        let bytes = self.checkpoint.save(snapshot).map_err(|error| error.to_string())?;
        job.snapshot = None;
        Ok(Some(bytes))
    }
}

/// Files kept, a file a day.
const FILES: usize = 90;
/// A day's file grows no more beyond this: ten thousand cylinders have room.
const LARGEST_FILE: u64 = 128 * 1024 * 1024;

const HEADER: &str =
    "from,span,cylinder,leak,mean_lpm,std_lpm,max_lpm,alarm_share,slope_lpm_per_day,slope_std\n";

/// Hours and days of every leak as files in a folder, a file a day, the last 90 kept.
pub struct Summaries {
    folder: PathBuf,
}

impl Summaries {
    pub fn new(folder: PathBuf) -> io::Result<Self> {
        fs::create_dir_all(&folder)?;
        Ok(Self { folder })
    }

    /// Appends rows to the files of their days. Rows may come twice after a crash: the last of a cylinder, leak and time
    /// counts.
    fn append(&self, summaries: &[SummaryEvent]) -> io::Result<()> {
        let mut files: BTreeMap<String, String> = BTreeMap::new();
        for summary in summaries {
            let (day, from) = names(summary);
            rows(files.entry(day).or_default(), &from, summary);
        }
        for (day, rows) in &files {
            let path = self.folder.join(format!("{day}.csv"));
            let mut file = OpenOptions::new().create(true).read(true).append(true).open(path)?;
            let length = whole_rows(&file)?;
            file.set_len(length)?;
            if length + (rows.len() as u64) > LARGEST_FILE {
                continue;
            }
            let header = if length == 0 { HEADER } else { "" };
            file.write_all([header, rows].concat().as_bytes())?;
            file.sync_all()?;
        }
        if files.is_empty() { Ok(()) } else { self.forget() }
    }

    /// Removes the oldest files.
    fn forget(&self) -> io::Result<()> {
        let mut names: Vec<_> = fs::read_dir(&self.folder)?
            .filter_map(|entry| entry.ok()?.file_name().into_string().ok())
            .filter(|name| name.ends_with(".csv"))
            .collect();
        names.sort();
        let beyond = names.len().saturating_sub(FILES);
        names.iter().take(beyond).try_for_each(|name| fs::remove_file(self.folder.join(name)))
    }
}

/// Length up to the end of the last whole row: a disk that is full or without power takes a part of one.
fn whole_rows(file: &File) -> io::Result<u64> {
    let mut length = file.metadata()?.len();
    let mut last = [0];
    while length > 0 {
        file.read_exact_at(&mut last, length - 1)?;
        if last == *b"\n" {
            break;
        }
        length -= 1;
    }
    Ok(length)
}

/// Name of its day, and of its begin.
fn names(summary: &SummaryEvent) -> (String, String) {
    let stamp = summary.time_ns.and_then(|ns| Timestamp::from_nanosecond(i128::from(ns)).ok());
    match stamp {
        Some(stamp) => {
            let text = stamp.to_string();
            (text.chars().take_while(|c| *c != 'T').collect(), text)
        }
        None => (format!("day-{:06}", (summary.from_s / 86_400.0).floor()), format!("{}", summary.from_s)),
    }
}

fn rows(text: &mut String, from: &str, summary: &SummaryEvent) {
    let span = summary.span.id();
    let cylinder = summary.cylinder.replace('"', "\"\"");
    let number = |value: Option<f64>| value.map(|value| value.to_string()).unwrap_or_default();
    for leak in Leak::ALL {
        let (name, of) = (leak.id(), summary.leakage[leak]);
        let LeakSummary { mean_lpm, max_lpm, alarm_share, trend_lpm_per_day: trend, .. } = of;
        let std_lpm = number(of.std_lpm);
        let (slope, std) = (number(trend.map(|trend| trend.slope)), number(trend.map(|trend| trend.std)));
        *text += &format!(
            "{from},{span},\"{cylinder}\",{name},{mean_lpm},{std_lpm},{max_lpm},{alarm_share},{slope},{std}\n"
        );
    }
}

/// Fewer deliveries than this are no sign of a broker that waits.
const LEAST_IN_FLIGHT: usize = 10;
/// A broker that has more to say does so sooner.
const SILENCE: Duration = Duration::from_millis(300);
/// One that waited for us goes on as soon as it has its acknowledgements.
const AT_ONCE: Duration = Duration::from_millis(150);
/// So often in a row it stopped at the same number.
const STALLS: u32 = 3;
/// Between two checkpoints for a broker that waits, at least.
const FOR_BROKER: Duration = Duration::from_secs(1);
/// At most, until a disk that took no checkpoint is tried again: a broker that waits makes it no emptier.
const TRY_AGAIN: Duration = Duration::from_secs(10);

/// One checkpoint `every` so often, whatever the senders do. Sooner only where the broker waits for us after fewer deliveries
/// than MQTT 5's Receive Maximum allows it, which is its own limit: it is in the configuration, or is found out.
pub struct Pace {
    every: Duration,
    /// Deliveries after which the broker waits for us; none where that is not known.
    in_flight: Option<usize>,
    asked: Instant,
    delivered: Instant,
    stall: Stall,
    /// The last checkpoint could not be written.
    failed: bool,
}

/// Where the broker had fallen silent when a checkpoint was due.
#[derive(Default)]
struct Stall {
    count: usize,
    /// How often in a row it went on at once when it had its acknowledgements.
    times: u32,
    /// When it had them; none where it had not been silent.
    released: Option<Instant>,
}

/// Whether a checkpoint is due.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Due {
    NotYet,
    Now,
    /// Also, it is known now that the broker waits after so many deliveries.
    NowThatBrokerWaits(usize),
}

impl Pace {
    pub fn new(every: Duration, in_flight: Option<u16>, now: Instant) -> Self {
        let in_flight = in_flight.map(usize::from);
        Self { every, in_flight, asked: now, delivered: now, stall: Stall::default(), failed: false }
    }

    /// By another configuration.
    pub fn set_every(&mut self, every: Duration) {
        self.every = every;
    }

    pub fn delivered(&mut self, now: Instant) {
        self.delivered = now;
        if let Some(released) = self.stall.released.take() {
            self.stall.times = if now.duration_since(released) < AT_ONCE { self.stall.times + 1 } else { 0 };
        }
    }

    /// The disk took no checkpoint.
    pub fn failed(&mut self) {
        self.failed = true;
    }

    /// It took one, and the broker has its acknowledgements.
    pub fn acknowledged(&mut self, now: Instant) {
        self.failed = false;
        if self.stall.released.is_some() {
            self.stall.released = Some(now);
        }
    }

    /// Whether a checkpoint is due while so many deliveries wait to be acknowledged; if so, it is taken to be written.
    pub fn due(&mut self, now: Instant, unacknowledged: usize) -> Due {
        let broker_waits = self.in_flight.is_some_and(|in_flight| unacknowledged >= in_flight);
        let pause = match (self.failed, broker_waits) {
            (true, _) => self.every.min(TRY_AGAIN),
            (false, true) => self.every.min(FOR_BROKER),
            (false, false) => self.every,
        };
        if now.duration_since(self.asked) < pause {
            return Due::NotYet;
        }
        self.asked = now;
        let silent = now.duration_since(self.delivered) >= SILENCE;
        if broker_waits || !silent || unacknowledged < LEAST_IN_FLIGHT {
            self.stall.released = None;
            return Due::Now;
        }
        if self.stall.count != unacknowledged {
            self.stall = Stall { count: unacknowledged, times: 0, released: None };
        }
        self.stall.released = Some(now);
        if self.stall.times >= STALLS {
            self.in_flight = Some(unacknowledged);
            return Due::NowThatBrokerWaits(unacknowledged);
        }
        Due::Now
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use pitchleak::core::PerLeak;
    use pitchleak::live::Span;

    fn of_hour(hour: u32) -> SummaryEvent {
        let from_s = 1.7e9 + 3600.0 * f64::from(hour);
        SummaryEvent {
            cylinder: "T7/B2".to_owned(),
            span: Span::Hour,
            from_s,
            estimates: 3600,
            leakage: PerLeak::default(),
            time_ns: Some((from_s * 1e9) as i64),
        }
    }

    #[test]
    fn a_row_of_which_the_disk_took_a_part_is_written_anew() {
        let folder = tempfile::tempdir().expect("a folder");
        let summaries = Summaries::new(folder.path().join("summaries")).expect("a folder");
        summaries.append(&[of_hour(0)]).expect("room");
        let file = summaries.folder.join("2023-11-14.csv");
        let whole = fs::read_to_string(&file).expect("a file");
        summaries.append(&[of_hour(1)]).expect("room");
        let both = fs::read_to_string(&file).expect("a file");
        for torn in [&both[..whole.len() + 30], &both[..HEADER.len() - 5], ""] {
            fs::write(&file, torn).expect("room");
            let hours =
                if torn.len() > HEADER.len() { vec![of_hour(1)] } else { vec![of_hour(0), of_hour(1)] };
            summaries.append(&hours).expect("room");
            assert_eq!(fs::read_to_string(&file).expect("a file"), both);
        }
    }

    #[test]
    fn ninety_days_are_kept() {
        let folder = tempfile::tempdir().expect("a folder");
        let summaries = Summaries::new(folder.path().join("summaries")).expect("a folder");
        for day in 0..100_u32 {
            let hours: Vec<_> = (24 * day..24 * (day + 1)).map(of_hour).collect();
            summaries.append(&hours).expect("room");
        }
        let mut files: Vec<_> = fs::read_dir(&summaries.folder)
            .expect("a folder")
            .map(|entry| entry.expect("a file").path())
            .collect();
        files.sort();
        assert_eq!(files.len(), FILES);
        let text = fs::read_to_string(&files[40]).expect("a file");
        assert_eq!(text.lines().count(), 1 + 24 * 3);
        assert!(text.contains("T00:13:20Z,hour,\"T7/B2\",external_a,0,,0,0,,"), "{text}");
    }

    /// What is due in so many seconds, where so many deliveries come together at the begin of each, unless the broker waits
    /// after `most`.
    fn dues(seconds: u32, burst: usize, most: usize) -> Vec<Due> {
        let begin = Instant::now();
        let mut pace = Pace::new(Duration::from_secs(10), None, begin);
        let (mut unacknowledged, mut queued) = (0, 0);
        let mut dues = Vec::new();
        for ms in (0..1000 * seconds).step_by(10) {
            let now = begin + Duration::from_millis(ms.into());
            queued += if ms % 1000 == 0 { burst } else { 0 };
            while queued > 0 && unacknowledged < most {
                (queued, unacknowledged) = (queued - 1, unacknowledged + 1);
                pace.delivered(now);
            }
            let due = pace.due(now, unacknowledged);
            if due != Due::NotYet {
                dues.push(due);
                unacknowledged = 0;
                pace.acknowledged(now);
            }
        }
        dues
    }

    #[test]
    fn senders_that_burst_cost_no_checkpoint_more() {
        assert_eq!(dues(100, 200, 65_535), [Due::Now; 9]);
    }

    #[test]
    fn a_broker_that_waits_is_found_out_and_costs_one_a_second_at_most() {
        let dues = dues(100, 200, 20);
        assert_eq!(dues[..4], [Due::Now, Due::Now, Due::Now, Due::NowThatBrokerWaits(20)]);
        assert!((50..=64).contains(&dues.len()), "{}", dues.len());
    }

    #[test]
    fn a_full_disk_is_tried_once_in_a_while_however_much_waits() {
        let begin = Instant::now();
        let at = |ms| begin + Duration::from_millis(ms);
        let mut pace = Pace::new(Duration::from_secs(10), Some(20), begin);
        let mut fails = |ms| {
            let due = pace.due(at(ms), 500) != Due::NotYet;
            if due {
                pace.failed();
            }
            due
        };
        assert_eq!((0..60_000).step_by(100).filter(|ms| fails(*ms)).count(), 6);
        let mut pace = Pace::new(Duration::from_secs(3600), Some(20), begin);
        pace.failed();
        assert_eq!(pace.due(at(9_900), 0), Due::NotYet);
        assert_eq!(pace.due(at(10_000), 0), Due::Now);
        pace.acknowledged(at(10_100));
        assert_eq!(pace.due(at(11_000), 20), Due::Now);
    }
}
