use crate::errors::replay_error;
use crate::signals::Stopped;
use crate::table::{NAME, Table};
use pitchleak::Rig;
use pitchleak::trace::{BadRows, TraceReader};
use pyo3::prelude::*;
use std::path::PathBuf;

/// Where a trace comes from.
#[derive(FromPyObject)]
pub enum Source<'py> {
    Table(Bound<'py, Table>),
    Path(PathBuf),
}

impl Source<'_> {
    /// Gives `work` a reader of the trace, with the interpreter released.
    pub fn read<T: Send>(
        &self,
        py: Python<'_>,
        rig: &Rig,
        strict: bool,
        work: impl FnOnce(TraceReader<'_>) -> Result<T, Stopped> + Send,
    ) -> PyResult<T> {
        self.read_again(py, rig, strict, |open| work(open()?))
    }

    /// Gives `work` what opens the trace, as often as it likes, with the interpreter released.
    pub fn read_again<T: Send>(
        &self,
        py: Python<'_>,
        rig: &Rig,
        strict: bool,
        work: impl for<'a> FnOnce(&'a dyn Fn() -> Result<TraceReader<'a>, Stopped>) -> Result<T, Stopped> + Send,
    ) -> PyResult<T> {
        let bad_rows = if strict { BadRows::Fatal } else { BadRows::Skip };
        let done = match self {
            Self::Path(path) => {
                py.detach(|| work(&|| Ok(TraceReader::open(path, rig)?.with_bad_rows(bad_rows))))
            }
            Self::Table(table) => {
                let table = table.get();
                let lent = table.lend(py)?;
                let batches = table.slices(&lent)?;
                py.detach(|| {
                    work(&|| {
                        let reader = TraceReader::from_table(NAME, table.layout(), batches.clone(), rig)?;
                        Ok(reader.since(table.first_ns()).with_bad_rows(bad_rows))
                    })
                })
            }
        };
        done.map_err(|stopped| match stopped {
            Stopped::Failed(error) => replay_error(py, &error),
            Stopped::Asked(error) => error,
        })
    }
}
