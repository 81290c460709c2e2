//! Ctrl-C in a long call: the interpreter is asked now and then.

use pitchleak::replay::ReplayError;
use pitchleak::trace::TraceError;
use pyo3::exceptions::PyKeyboardInterrupt;
use pyo3::prelude::*;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
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
