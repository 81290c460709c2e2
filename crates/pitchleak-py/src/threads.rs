use crate::errors::value_error;
use pyo3::prelude::*;

/// Runs `work` without the interpreter's lock, on threads of its own that end with it. A process that is
/// forked (as `multiprocessing` does) has none of its parent's threads: with a pool that outlives the
/// call, the child's work would wait for them forever.
pub fn detached<T: Send>(py: Python<'_>, work: impl FnOnce() -> T + Send) -> PyResult<T> {
    py.detach(|| rayon::ThreadPoolBuilder::new().build().map(|pool| pool.install(work))).map_err(value_error)
}
