//! Checkpoints, alarms and summaries to the disk, in a thread of its own: samples don't wait for it.

use crate::broker::Ticket;
use crate::failure::Failure;
use crate::input::Input;
use crate::summaries::Summaries;
use pitchleak::live::{Checkpoint, Snapshot, SummaryEvent};
use pitchleak::output::{self, Inputs};
use rustix::process::{getpriority_process, setpriority_process};
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
    let spawned = std::thread::Builder::new().name("saver".to_owned()).spawn(run);
    let thread = spawned.map_err(|source| Failure::System { what: "start the saver", source })?;
    Ok((jobs, thread))
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
