//! Long work while Python stays awake: for Ctrl-C, and for whoever wants to know how far it is.

use crate::errors::value_error;
use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use std::panic::resume_unwind;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{RecvTimeoutError, SyncSender, sync_channel};
use std::thread;
use std::time::Duration;

/// Time between two questions whether Python wants the call to end.
const PERIOD: Duration = Duration::from_millis(50);

/// The end of work that nobody waits for any more: unwound through it, so that no layer between has to pass it on.
struct GivenUp;

enum Message<T> {
    /// What is done, and the whole.
    At(f64, f64),
    Done(T),
}

/// The work's end of the call.
pub struct Caller<T> {
    messages: SyncSender<Message<T>>,
    gone: Arc<AtomicBool>,
}

impl<T> Caller<T> {
    /// Now and then: work that nobody waits for ends here.
    pub fn heed(&self) {
        if self.gone.load(Ordering::Relaxed) {
            resume_unwind(Box::new(GivenUp));
        }
    }

    /// As [`heed`](Self::heed), and says how far the work is; a caller who is busy misses it.
    pub fn at(&self, done: f64, whole: f64) {
        self.heed();
        let _ = self.messages.try_send(Message::At(done, whole));
    }
}

/// Runs `work` on threads of its own that end with it, `progress` told how far it is. `KeyboardInterrupt`, or what
/// `progress` raises, comes at once; the work itself ends when it next heeds its caller. A process that is forked (as
/// `multiprocessing` does) has none of its parent's threads: with a pool that outlives the call, the child's work would
/// wait for them forever.
pub fn detached<T: Send + 'static>(
    py: Python<'_>,
    progress: Option<&Bound<'_, PyAny>>,
    work: impl FnOnce(&Caller<T>) -> T + Send + 'static,
) -> PyResult<T> {
    let (messages, mut received) = sync_channel(1);
    let gone = Arc::new(AtomicBool::new(false));
    let caller = Caller { messages, gone: Arc::clone(&gone) };
    let pool = rayon::ThreadPoolBuilder::new().build().map_err(value_error)?;
    let thread = thread::spawn(move || {
        let done = pool.install(|| work(&caller));
        let _ = caller.messages.send(Message::Done(done));
    });
    let mut wait = || -> PyResult<Option<T>> {
        loop {
            let received = &mut received;
            match py.detach(move || received.recv_timeout(PERIOD)) {
                Ok(Message::Done(done)) => return Ok(Some(done)),
                Ok(Message::At(done, whole)) => {
                    progress.map(|progress| progress.call1((done, whole))).transpose()?;
                }
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => return Ok(None),
            }
            py.check_signals()?;
        }
    };
    let waited = wait();
    gone.store(true, Ordering::Relaxed);
    match waited {
        Ok(Some(done)) => {
            let _ = py.detach(|| thread.join());
            Ok(done)
        }
        Err(raised) => Err(raised),
        Ok(None) => match py.detach(|| thread.join()) {
            Err(panic) => resume_unwind(panic),
            Ok(()) => Err(PyRuntimeError::new_err("the work ended without a result")),
        },
    }
}
