//! Columns that Python holds, lent to the engine without a copy where they are f64 already.

use crate::errors::trace_error;
use crate::rig::Rig;
use arrow_array::cast::AsArray;
use arrow_array::types::{Float64Type, TimestampNanosecondType};
use arrow_array::{Array, RecordBatch};
use arrow_buffer::ScalarBuffer;
use arrow_cast::cast;
use arrow_schema::{DataType, TimeUnit};
use numpy::{IntoPyArray, PyArray1, PyArrayMethods, PyReadonlyArray1, PyUntypedArray, PyUntypedArrayMethods};
use pitchleak::trace::{ColumnContent, TableLayout, seconds_between};
use pyo3::exceptions::{PyException, PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::type_object::PyTypeInfo;
use pyo3::types::{PyType, PyWeakrefReference};
use pyo3_arrow::input::AnyRecordBatch;

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
const NOT_A_TIME: i64 = i64::MIN;

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
    Arrow(ScalarBuffer<f64>),
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
    /// Contiguous float64 arrays, int64 nanoseconds for timestamps, None where ignored. ``first_ns`` is
    /// where timestamps count from, else their own first.
    #[staticmethod]
    #[pyo3(signature = (layout, columns, first_ns = None))]
    fn from_arrays(
        layout: &Layout,
        columns: Vec<Option<Given<'_>>>,
        first_ns: Option<i64>,
    ) -> PyResult<Self> {
        let mut first_ns = first_ns;
        let hold = |column: Option<Given<'_>>| match column {
            None => Ok(Column::Ignored),
            Some(Given::Numbers(array)) if is_plain(&array) => Ok(Column::Numpy(array.unbind())),
            Some(Given::Numbers(_)) => Err(PyValueError::new_err("arrays must be contiguous")),
            Some(Given::Nanoseconds(array)) => {
                let times = array.as_array();
                Ok(Column::Converted(seconds(times.iter().copied(), &mut first_ns)))
            }
        };
        let columns = columns.into_iter().map(hold).collect::<PyResult<_>>()?;
        Ok(Self { layout: layout.clone(), batches: vec![columns], first_ns })
    }

    /// Anything with the Arrow PyCapsule interface.
    #[staticmethod]
    #[pyo3(signature = (data, rig, first_ns = None))]
    fn from_arrow(
        py: Python<'_>,
        data: &Bound<'_, PyAny>,
        rig: &Rig,
        first_ns: Option<i64>,
    ) -> PyResult<Self> {
        // A library that breaks off halfway, or columns that are no table.
        let read = data.extract::<AnyRecordBatch>().and_then(|data| Ok(data.into_table()?));
        let (batches, schema) = read.map_err(|error| unreadable(py, &error))?.into_inner();
        let headers: Vec<String> = schema.fields().iter().map(|field| field.name().clone()).collect();
        let layout = Layout::new(py, headers, rig)?;
        let mut first_ns = first_ns;
        let batches = batches.iter().map(|batch| arrow_columns(batch, &layout.read, &mut first_ns));
        Ok(Self { batches: batches.collect::<PyResult<_>>()?, layout, first_ns })
    }

    /// Where its timestamps count from, ns since 1970; None where it has none.
    #[getter]
    pub fn first_ns(&self) -> Option<i64> {
        self.first_ns
    }

    /// Bytes of the columns that had to be converted; the others are not copied.
    #[getter]
    fn converted_bytes(&self) -> usize {
        let size = |column: &Column| match column {
            Column::Converted(values) => size_of_val(values.as_slice()),
            _ => 0,
        };
        self.batches.iter().flatten().map(size).sum()
    }

    /// As one batch of copies, times in seconds: what is read of them is the same.
    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<(Bound<'py, PyAny>, Parts<'py>)> {
        let (py, this) = (slf.py(), slf.get());
        let lent = this.lend(py)?;
        let batches = this.slices(&lent)?;
        let copied = |(index, content): (usize, ColumnContent)| {
            let parts: Vec<_> = batches.iter().filter_map(|batch| batch.get(index).copied()).collect();
            (content != ColumnContent::Ignored).then(|| parts.concat().into_pyarray(py))
        };
        let columns = this.layout.read.contents().enumerate().map(copied).collect();
        Ok((slf.get_type().getattr("from_arrays")?, (this.layout.clone(), columns, this.first_ns)))
    }
}

/// What [`Table::from_arrays`] makes a table of.
type Parts<'py> = (Layout, Vec<Option<Bound<'py, PyArray1<f64>>>>, Option<i64>);

impl Table {
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
            (Column::Arrow(buffer), _) => Ok(&buffer[..]),
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

fn arrow_columns(
    batch: &RecordBatch,
    layout: &TableLayout,
    first_ns: &mut Option<i64>,
) -> PyResult<Vec<Column>> {
    let schema = batch.schema();
    let columns = layout.contents().zip(batch.columns()).zip(schema.fields());
    let read =
        |((content, array), field): ((ColumnContent, &arrow_array::ArrayRef), &arrow_schema::FieldRef)| {
            match content {
                ColumnContent::Ignored => Ok(Column::Ignored),
                ColumnContent::Numbers => numbers(field.name(), array),
                ColumnContent::Timestamps => timestamps(field.name(), array, first_ns),
            }
        };
    columns.map(read).collect()
}

/// A column without nulls and of f64 is taken as it is.
fn numbers(name: &str, array: &dyn Array) -> PyResult<Column> {
    let kind = array.data_type();
    let whole = matches!(kind, DataType::Null) || kind.is_floating() || kind.is_integer();
    if !whole {
        return Err(wrong_type(name, kind, "numbers"));
    }
    let floats = cast(array, &DataType::Float64).map_err(|_| wrong_type(name, kind, "numbers"))?;
    let floats = floats.as_primitive::<Float64Type>();
    if floats.null_count() == 0 {
        return Ok(Column::Arrow(floats.values().clone()));
    }
    Ok(Column::Converted(floats.iter().map(|value| value.unwrap_or(f64::NAN)).collect()))
}

fn timestamps(name: &str, array: &dyn Array, first_ns: &mut Option<i64>) -> PyResult<Column> {
    let kind = array.data_type();
    if !matches!(kind, DataType::Timestamp(..)) {
        return Err(wrong_type(name, kind, "timestamps"));
    }
    let zone = match kind {
        DataType::Timestamp(_, zone) => zone.clone(),
        _ => None,
    };
    let times = cast(array, &DataType::Timestamp(TimeUnit::Nanosecond, zone))
        .map_err(|_| wrong_type(name, kind, "timestamps"))?;
    let times = times.as_primitive::<TimestampNanosecondType>();
    Ok(Column::Converted(seconds(times.iter().map(|time| time.unwrap_or(NOT_A_TIME)), first_ns)))
}

/// Of pyo3-arrow's errors some are a bare `Exception`; Python's own stay what they are.
fn unreadable(py: Python<'_>, error: &PyErr) -> PyErr {
    if error.get_type(py).is(PyException::type_object(py)) {
        let text = error.value(py).to_string().replace('\n', " ");
        return PyValueError::new_err(format!("no table of columns: {text}"));
    }
    error.clone_ref(py)
}

fn wrong_type(name: &str, found: &DataType, wanted: &str) -> PyErr {
    PyTypeError::new_err(format!("column `{name}` holds {found}; {wanted} are expected"))
}
