//! Long calls: Python stays awake for Ctrl-C, which is asked for now and then, and for whoever wants to know how far they are.

use crate::errors::value_error;
use pitchleak::replay::ReplayError;
use pitchleak::trace::TraceError;
use pyo3::exceptions::{PyKeyboardInterrupt, PyRuntimeError};
use pyo3::prelude::*;
use std::panic::resume_unwind;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{RecvTimeoutError, SyncSender, sync_channel};
use std::thread;
use std::time::{Duration, Instant};

/// Why a call ended early.
pub enum Stopped {
    /// The engine can't go on.
    Failed(ReplayError),
    /// Python wants it to end: `KeyboardInterrupt`, or what a handler of signals raised.
    Asked(PyErr),
}

impl Stopped {
    /// What Python raised, if it did.
    pub fn asked(self) -> Option<PyErr> {
        match self {
            Self::Asked(error) => Some(error),
            Self::Failed(_) => None,
        }
    }

    /// What a call raises that was told to end.
    pub fn interrupted() -> PyErr {
        PyKeyboardInterrupt::new_err("stopped")
    }
}

/// Tells calls in other threads to end: only the main thread of Python hears of Ctrl-C.
#[pyclass(frozen, module = "pitchleak._pitchleak")]
#[derive(Default)]
pub struct Stop(Arc<AtomicBool>);

#[pymethods]
impl Stop {
    #[new]
    fn new() -> Self {
        Self::default()
    }

    /// From here on they end.
    fn set(&self) {
        self.0.store(true, Ordering::Relaxed);
    }
}

impl From<ReplayError> for Stopped {
    fn from(error: ReplayError) -> Self {
        Self::Failed(error)
    }
}

impl From<TraceError> for Stopped {
    fn from(error: TraceError) -> Self {
        Self::Failed(error.into())
    }
}

/// Time between two questions; after Ctrl-C nobody notices it.
const PERIOD: Duration = Duration::from_millis(50);
/// Records between two looks at the clock.
const RECORDS: u32 = 64;

/// When to ask next.
pub struct Signals {
    records: u32,
    asked: Instant,
    stop: Option<Arc<AtomicBool>>,
}

impl Signals {
    /// Asks Python, and ends where `stop` is set.
    pub fn new(stop: Option<&Stop>) -> Self {
        Self { records: 0, asked: Instant::now(), stop: stop.map(|stop| Arc::clone(&stop.0)) }
    }

    /// Fails where Python wants the call to end.
    #[inline]
    pub fn heed(&mut self) -> Result<(), Stopped> {
        if self.due() { self.ask(|_| Ok(())) } else { Ok(()) }
    }

    /// As [`heed`](Self::heed), and when Python is asked, it is told too.
    #[inline]
    pub fn heed_and(&mut self, tell: impl FnOnce(Python<'_>) -> PyResult<()>) -> Result<(), Stopped> {
        if self.due() { self.ask(tell) } else { Ok(()) }
    }

    /// As [`heed`](Self::heed), for long work that is no records.
    pub fn heed_now(&mut self) -> Result<(), Stopped> {
        self.ask(|_| Ok(()))
    }

    #[inline]
    fn due(&mut self) -> bool {
        self.records += 1;
        if self.records < RECORDS {
            return false;
        }
        self.records = 0;
        self.asked.elapsed() >= PERIOD
    }

    #[cold]
    fn ask(&mut self, tell: impl FnOnce(Python<'_>) -> PyResult<()>) -> Result<(), Stopped> {
        self.asked = Instant::now();
        if self.stop.as_ref().is_some_and(|stop| stop.load(Ordering::Relaxed)) {
            return Err(Stopped::Asked(Stopped::interrupted()));
        }
        Python::attach(|py| py.check_signals().and_then(|()| tell(py))).map_err(Stopped::Asked)
    }
}

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
