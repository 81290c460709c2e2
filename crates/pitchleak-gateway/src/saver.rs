//! Checkpoints, alarms and summaries to the disk, in a thread of its own: samples don't wait for it.

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
}
