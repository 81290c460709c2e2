//! Checkpoints and summaries to the disk, in a thread of its own: samples don't wait for it.

use crate::broker::Ticket;
use crate::failure::Failure;
use crate::input::Input;
use crate::summaries::Summaries;
use pitchleak::live::{Checkpoint, Snapshot, SummaryEvent};
use rustix::process::{getpriority_process, setpriority_process};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// A tenth of the processor, while the thread of the samples wants all of it.
const NICER: i32 = 10;

/// What is to be written, and the deliveries that may be acknowledged then.
pub struct Job {
    pub snapshot: Snapshot,
    pub summaries: Vec<SummaryEvent>,
    pub tickets: Vec<Ticket>,
}

/// What became of it.
#[derive(Debug)]
pub struct Saved {
    /// Bytes of the checkpoint; or why there is none.
    pub result: Result<usize, String>,
    pub took: Duration,
    pub tickets: Vec<Ticket>,
    /// Those that could not be written.
    pub summaries: Vec<SummaryEvent>,
}

/// Starts the thread; it ends when nobody can send it jobs any more.
pub fn start(
    checkpoint: Checkpoint,
    summaries: Summaries,
    inbox: SyncSender<Input>,
) -> Result<(SyncSender<Job>, JoinHandle<()>), Failure> {
    let (jobs, queue) = sync_channel(1);
    let run = move || {
        give_way();
        work(&checkpoint, &summaries, &queue, &inbox);
    };
    let spawned = std::thread::Builder::new().name("saver".to_owned()).spawn(run);
    let thread = spawned.map_err(|source| Failure::System { what: "start the saver", source })?;
    Ok((jobs, thread))
}

/// Where samples come meanwhile on the same core, they go first. On Linux a priority is the thread's own.
fn give_way() {
    let _ = getpriority_process(None).and_then(|nice| setpriority_process(None, nice + NICER));
}

fn work(checkpoint: &Checkpoint, summaries: &Summaries, queue: &Receiver<Job>, inbox: &SyncSender<Input>) {
    for Job { snapshot, summaries: new, tickets } in queue {
        let began = Instant::now();
        // First the summaries: after a crash in between they are written twice, and not missing.
        let (unwritten, result) = match summaries.append(&new) {
            Ok(()) => (Vec::new(), checkpoint.save(&snapshot).map_err(|error| error.to_string())),
            Err(error) => (new, Err(format!("cannot write summaries: {error}"))),
        };
        let saved = Saved { result, took: began.elapsed(), tickets, summaries: unwritten };
        if inbox.send(Input::Saved(saved)).is_err() {
            return;
        }
    }
}
