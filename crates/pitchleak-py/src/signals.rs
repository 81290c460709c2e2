//! Ctrl-C in a long call: the interpreter is asked now and then.

use pitchleak::replay::ReplayError;
use pitchleak::trace::TraceError;
use pyo3::prelude::*;
use std::time::{Duration, Instant};

/// Why a call ended early.
pub enum Stopped {
    /// The engine can't go on.
    Failed(ReplayError),
    /// Python wants it to end: `KeyboardInterrupt`, or what a handler of signals raised.
    Asked(PyErr),
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
}

impl Default for Signals {
    fn default() -> Self {
        Self { records: 0, asked: Instant::now() }
    }
}

impl Signals {
    /// Fails where Python wants the call to end.
    #[inline]
    pub fn heed(&mut self) -> Result<(), Stopped> {
        self.records += 1;
        if self.records < RECORDS {
            return Ok(());
        }
        self.records = 0;
        if self.asked.elapsed() < PERIOD {
            return Ok(());
        }
        self.asked = Instant::now();
        Python::attach(|py| py.check_signals()).map_err(Stopped::Asked)
    }
}
