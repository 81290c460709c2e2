//! Columns that Python holds, lent to the engine without a copy where they are f64 already.

use crate::errors::{out_of_order, replay_error, trace_error};
use crate::rig::Rig;
use crate::signals::Stopped;
use numpy::{PyArray1, PyArrayMethods, PyReadonlyArray1, PyUntypedArray, PyUntypedArrayMethods};
use pitchleak::Rig as EngineRig;
use pitchleak::trace::{BadRows, ColumnContent, TableLayout, TraceReader, seconds_between};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::{PyType, PyWeakrefReference};
use std::path::PathBuf;

/// What the columns of a table are read as, by their headers.
#[pyclass(frozen, module = "pitchleak._pitchleak")]
#[derive(Clone)]
pub struct Layout {
    read: TableLayout,
    headers: Vec<String>,
    rig: Rig,
}

#[pymethods]
impl Layout {
    /// Reads headers as those of a trace file.
    #[new]
    fn new(py: Python<'_>, headers: Vec<String>, rig: &Rig) -> PyResult<Self> {
        let read = TableLayout::new(NAME, &headers, &rig.0).map_err(|error| trace_error(py, &error))?;
        Ok(Self { read, headers, rig: rig.clone() })
    }

    /// ``numbers``, ``timestamps`` or ``ignored`` for each header.
    #[getter]
    fn contents(&self) -> Vec<&'static str> {
        let word = |content| match content {
            ColumnContent::Numbers => "numbers",
            ColumnContent::Timestamps => "timestamps",
            ColumnContent::Ignored => "ignored",
        };
        self.read.contents().map(word).collect()
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> (Bound<'py, PyType>, (Vec<String>, Rig)) {
        let this = slf.get();
        (slf.get_type(), (this.headers.clone(), this.rig.clone()))
    }
}

/// How columns in memory are called in messages.
pub const NAME: &str = "data";

/// Time that is not a time, ns: as numpy and pandas write it.
pub const NOT_A_TIME: i64 = i64::MIN;

/// Rows that go back in time oftener than this, and oftener than once in so many rows, are in no order of time. Chosen: a
/// clock that is set back, or a logger's late reading, is rarer; rows in any other order go back at every second one.
const MOST_STEPS_BACK: usize = 3;
const ROWS_PER_STEP_BACK: usize = 20;

/// Columns in memory, and what they hold.
#[pyclass(frozen, module = "pitchleak._pitchleak")]
pub struct Table {
    layout: Layout,
    batches: Vec<Vec<Column>>,
    first_ns: Option<i64>,
}

enum Column {
    Ignored,
    Numpy(Py<PyArray1<f64>>),
    Converted(Vec<f64>),
}

/// An array as the Python side hands it over.
#[derive(FromPyObject)]
enum Given<'py> {
    Numbers(Bound<'py, PyArray1<f64>>),
    Nanoseconds(PyReadonlyArray1<'py, i64>),
}

#[pymethods]
impl Table {
    /// Of each batch of rows a contiguous float64 array per header, int64 nanoseconds for timestamps, None where
    /// ignored. ``first_ns`` is where timestamps count from, else their own first.
    #[staticmethod]
    #[pyo3(signature = (layout, batches, first_ns = None))]
    fn from_arrays(
        py: Python<'_>,
        layout: &Layout,
        batches: Vec<Vec<Option<Given<'_>>>>,
        first_ns: Option<i64>,
    ) -> PyResult<Self> {
        let mut first_ns = first_ns;
        let mut hold = |column: Option<Given<'_>>| match column {
            None => Ok(Column::Ignored),
            Some(Given::Numbers(array)) if is_plain(&array) => Ok(Column::Numpy(array.unbind())),
            Some(Given::Numbers(_)) => Err(PyValueError::new_err("arrays must be contiguous")),
            Some(Given::Nanoseconds(array)) => {
                let times = array.as_array();
                Ok(Column::Converted(seconds(times.iter().copied(), &mut first_ns)))
            }
        };
        let batches = batches.into_iter().map(|columns| columns.into_iter().map(&mut hold).collect());
        let batches = batches.collect::<PyResult<_>>()?;
        let table = Self { layout: layout.clone(), batches, first_ns };
        table.check_order(py)?;
        Ok(table)
    }

    /// Where its timestamps count from, ns since 1970; None where it has none.
    #[getter]
    pub fn first_ns(&self) -> Option<i64> {
        self.first_ns
    }

    /// The columns of each batch, times in seconds; float64 ones are those that were lent, not copies.
    #[getter]
    fn batches<'py>(&self, py: Python<'py>) -> Batches<'py> {
        let array = |column: &Column| match column {
            Column::Ignored => None,
            Column::Numpy(array) => Some(array.bind(py).clone()),
            Column::Converted(values) => Some(PyArray1::from_slice(py, values)),
        };
        self.batches.iter().map(|batch| batch.iter().map(array).collect()).collect()
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<(Bound<'py, PyAny>, Parts<'py>)> {
        let this = slf.get();
        let parts = (this.layout.clone(), this.batches(slf.py()), this.first_ns);
        Ok((slf.get_type().getattr("from_arrays")?, parts))
    }
}

/// An array per header in each batch.
type Batches<'py> = Vec<Vec<Option<Bound<'py, PyArray1<f64>>>>>;

/// What [`Table::from_arrays`] makes a table of.
type Parts<'py> = (Layout, Batches<'py>, Option<i64>);

impl Table {
    /// Refuses rows of which so many go back in time that they are in another order: shuffled, or sorted by something else.
    /// Single steps back are the reader's to judge.
    fn check_order(&self, py: Python<'_>) -> PyResult<()> {
        let Some(time) = self.layout.read.time() else { return Ok(()) };
        let lent = self.lend(py)?;
        let (mut rows, mut back, mut first) = (0, 0, None);
        for batch in self.slices(&lent)? {
            let times = batch.get(time).copied().unwrap_or_default();
            let steps_back = times.windows(2).filter(|pair| pair[1] < pair[0]).count();
            if steps_back > 0 && first.is_none() {
                first = times.windows(2).position(|pair| pair[1] < pair[0]).map(|row| rows + row + 1);
            }
            back += steps_back;
            rows += times.len();
        }
        match first.zip(self.layout.headers.get(time)) {
            Some((row, header)) if back > MOST_STEPS_BACK.max(rows / ROWS_PER_STEP_BACK) => {
                Err(out_of_order(py, header, row, &format!("{back} times in {rows} rows")))
            }
            _ => Ok(()),
        }
    }

    pub fn layout(&self) -> &TableLayout {
        &self.layout.read
    }

    /// What keeps the arrays as they are while they are read.
    pub fn lend<'py>(&self, py: Python<'py>) -> PyResult<Vec<Vec<Option<Lent<'py>>>>> {
        let lend = |column: &Column| match column {
            Column::Numpy(array) => Lent::new(array.bind(py).clone()).map(Some),
            _ => Ok(None),
        };
        self.batches.iter().map(|batch| batch.iter().map(lend).collect()).collect()
    }

    /// The values, those of numpy arrays from `lent`.
    pub fn slices<'a>(&'a self, lent: &'a [Vec<Option<Lent<'_>>>]) -> PyResult<Vec<Vec<&'a [f64]>>> {
        let slice = |(column, lent): (&'a Column, &'a Option<Lent<'_>>)| match (column, lent) {
            (Column::Numpy(_), Some(array)) => array.as_slice(),
            (Column::Converted(values), _) => Ok(&values[..]),
            (Column::Ignored | Column::Numpy(_), _) => Ok(&[][..]),
        };
        self.batches
            .iter()
            .zip(lent)
            .map(|(batch, lent)| batch.iter().zip(lent).map(slice).collect())
            .collect()
    }
}

/// An array that is being read. Another thread may write into it meanwhile, but not free its memory: numpy's `resize`
/// refuses where weak references to the array or the one that it views are alive, even with `refcheck=False`.
pub struct Lent<'py> {
    array: PyReadonlyArray1<'py, f64>,
    _held: Vec<Bound<'py, PyWeakrefReference>>,
}

impl<'py> Lent<'py> {
    pub fn new(array: Bound<'py, PyArray1<f64>>) -> PyResult<Self> {
        let mut held = Vec::new();
        let mut owner = array.clone().into_any();
        while owner.cast::<PyUntypedArray>().is_ok() {
            held.push(PyWeakrefReference::new(&owner)?);
            owner = owner.getattr("base")?;
        }
        Ok(Self { array: array.readonly(), _held: held })
    }

    pub fn as_slice(&self) -> PyResult<&[f64]> {
        Ok(self.array.as_slice()?)
    }
}

/// Whether an array's memory is a slice of f64.
pub fn is_plain(array: &Bound<'_, PyArray1<f64>>) -> bool {
    array.is_contiguous() && array.data().is_aligned()
}

/// Seconds since the first of `times_ns`.
fn seconds(times_ns: impl Iterator<Item = i64>, first_ns: &mut Option<i64>) -> Vec<f64> {
    let mut since_first = |time: i64| {
        if time == NOT_A_TIME {
            return f64::NAN;
        }
        seconds_between(i128::from(*first_ns.get_or_insert(time)), i128::from(time))
    };
    times_ns.map(&mut since_first).collect()
}

/// Where a trace comes from.
#[derive(FromPyObject)]
pub enum Source<'py> {
    Table(Bound<'py, Table>),
    Path(PathBuf),
}

impl Source<'_> {
    /// How messages call it.
    pub fn name(&self) -> String {
        match self {
            Self::Path(path) => path.display().to_string(),
            Self::Table(_) => NAME.to_owned(),
        }
    }

    /// Gives `work` a reader of the trace, with the interpreter released.
    pub fn read<T: Send>(
        &self,
        py: Python<'_>,
        rig: &EngineRig,
        strict: bool,
        work: impl FnOnce(TraceReader<'_>) -> Result<T, Stopped> + Send,
    ) -> PyResult<T> {
        self.read_again(py, rig, strict, |open| work(open()?))
    }

    /// Gives `work` what opens the trace, as often as it likes, with the interpreter released.
    pub fn read_again<T: Send>(
        &self,
        py: Python<'_>,
        rig: &EngineRig,
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
