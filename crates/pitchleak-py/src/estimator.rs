use crate::errors::{output_error, trace_error, value_error};
use crate::rig::Rig;
use crate::table::{Lent, NAME, Source, is_plain};
use numpy::{PyArray1, PyArrayMethods, PyReadonlyArray1};
use pitchleak::Rig as EngineRig;
use pitchleak::output::{self, Inputs};
use pitchleak::replay::Stream;
use pitchleak::trace::{BadRows, TableLayout, TraceError, TraceReader};
use pitchleak_view::{Palette, Text};
use pyo3::prelude::*;
use pyo3::sync::MutexExt;
use pyo3::types::PyBytes;
use std::path::PathBuf;
use std::sync::{Mutex, MutexGuard, PoisonError};

/// The running estimator under `pitchleak.Estimator`.
#[pyclass(frozen, subclass, module = "pitchleak._pitchleak")]
pub struct Estimator {
    rig: Rig,
    /// Without the rig file's foreign names: here the arguments are the columns.
    bare_rig: EngineRig,
    running: Mutex<Running>,
}

struct Running {
    stream: Stream,
    /// Which optional signals the last samples had, and the layout for it.
    layout: Option<([bool; 5], TableLayout)>,
}

/// A sample's reading, or those of many samples.
#[derive(FromPyObject)]
enum Readings<'py> {
    Number(f64),
    Array(PyReadonlyArray1<'py, f64>),
    Other(Bound<'py, PyAny>),
}

impl<'py> Readings<'py> {
    /// What is no contiguous f64 array is made one.
    fn contiguous(self, py: Python<'py>, name: &str) -> PyResult<Self> {
        let other = match self {
            Self::Number(_) => return Ok(self),
            Self::Array(array) if is_plain(&array) => return Ok(Self::Array(array)),
            Self::Array(array) => array.as_any().clone(),
            Self::Other(any) => any,
        };
        let numbers = py.import("pitchleak._columns")?.call_method1("numbers", (name, other))?;
        Ok(Self::Array(numbers.cast::<PyArray1<f64>>()?.readonly()))
    }

    fn array(&self) -> Option<&Bound<'py, PyArray1<f64>>> {
        match self {
            Self::Array(array) => Some(array),
            Self::Number(_) | Self::Other(_) => None,
        }
    }

    fn slice(&self) -> PyResult<&[f64]> {
        match self {
            Self::Number(value) => Ok(std::slice::from_ref(value)),
            Self::Array(array) => Ok(array.as_slice()?),
            Self::Other(_) => Ok(&[]),
        }
    }
}

const REQUIRED: [&str; 4] = ["t_s", "x_m", "pa_pa", "pb_pa"];
const OPTIONAL: [&str; 5] = ["qa_m3s", "qb_m3s", "force_n", "v_mps", "temp_k"];

#[pymethods]
impl Estimator {
    #[new]
    #[pyo3(signature = (rig, *, estimator = None, strict = false))]
    fn new(rig: &Rig, estimator: Option<&str>, strict: bool) -> PyResult<Self> {
        let bad_rows = if strict { BadRows::Fatal } else { BadRows::Skip };
        let stream = Stream::new(&rig.with_estimator(estimator)?, bad_rows).map_err(value_error)?;
        Ok(Self::over(stream))
    }

    /// What `save` writes.
    fn saved<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        let bytes = self.lock(py)?.stream.save().map_err(value_error)?;
        Ok(PyBytes::new(py, &bytes))
    }

    /// Writes all that the estimator knows, rig included, so that :meth:`load` goes on from here.
    ///
    /// The file is replaced as a whole: a crash leaves the old one.
    fn save(&self, py: Python<'_>, path: PathBuf) -> PyResult<()> {
        let bytes = self.lock(py)?.stream.save().map_err(value_error)?;
        let written = py.detach(|| output::write(path, bytes, &Inputs::default()));
        written.map_err(|error| output_error(py, &error))
    }

    /// Takes over the stream that `saved` gave, of an estimator of the same rig.
    fn restore(&self, py: Python<'_>, saved: &[u8]) -> PyResult<()> {
        let stream = Stream::restore_for(saved, &self.rig.0).map_err(value_error)?;
        *self.lock(py)? = Running { stream, layout: None };
        Ok(())
    }

    /// The rig in what `saved` gave.
    #[staticmethod]
    fn saved_rig(saved: &[u8]) -> PyResult<Rig> {
        Stream::restore(saved).map(|stream| Rig(stream.rig().clone())).map_err(value_error)
    }

    /// Where a column ``timestamp`` counts from, ns since 1970; None before the first.
    #[getter]
    fn epoch_ns(&self, py: Python<'_>) -> PyResult<Option<i64>> {
        Ok(self.lock(py)?.stream.epoch_ns)
    }

    /// Takes in one sample, or many as arrays of one length; in SI whatever the rig file's columns are.
    ///
    /// Time ``t`` in s; position ``x`` in m from the A end; chamber pressures ``pa``, ``pb`` in Pa gauge;
    /// flows into the chambers ``qa``, ``qb`` in m³/s, left out or NaN where they are not measured; load
    /// ``force`` against extension in N; piston speed ``v`` in m/s; oil temperature ``temp`` in K.
    /// Samples that no estimate can use (not finite, out of range, time going back) are skipped and
    /// counted, or raise :class:`TraceError` where the estimator is strict.
    ///
    /// Returns how often the estimates were renewed, about four times a second.
    ///
    /// >>> import pitchleak as pl
    /// >>> est = pl.Estimator(pl.Rig.paper())
    /// >>> est.update(0.0, 0.1, 5e6, 4e6, 1e-5, -1e-5)
    /// 0
    #[pyo3(signature = (t, x, pa, pb, qa = None, qb = None, *, force = None, v = None, temp = None))]
    #[expect(clippy::too_many_arguments, reason = "the signals of a sample")]
    fn update<'py>(
        &self,
        py: Python<'py>,
        t: Readings<'py>,
        x: Readings<'py>,
        pa: Readings<'py>,
        pb: Readings<'py>,
        qa: Option<Readings<'py>>,
        qb: Option<Readings<'py>>,
        force: Option<Readings<'py>>,
        v: Option<Readings<'py>>,
        temp: Option<Readings<'py>>,
    ) -> PyResult<u64> {
        let optional = [qa, qb, force, v, temp];
        let given = optional.each_ref().map(Option::is_some);
        let named =
            REQUIRED.into_iter().zip([t, x, pa, pb].map(Some)).chain(OPTIONAL.into_iter().zip(optional));
        let readings = named.filter_map(|(name, readings)| Some(readings?.contiguous(py, name)));
        let readings = readings.collect::<PyResult<Vec<_>>>()?;
        let batch = readings.iter().map(Readings::slice).collect::<PyResult<Vec<_>>>()?;
        let done = if batch.iter().all(|column| column.len() == 1) {
            self.lock(py)?.take(given, batch, self)
        } else {
            let arrays = readings.iter().filter_map(Readings::array);
            let _held = arrays.map(|array| Lent::new(array.clone())).collect::<PyResult<Vec<_>>>()?;
            py.detach(|| self.lock_detached().take(given, batch, self))
        };
        done.map_err(|error| trace_error(py, &error))
    }

    /// Takes in a part of a trace.
    fn extend_source(&self, py: Python<'_>, source: Source<'_>) -> PyResult<u64> {
        if let Source::Table(table) = &source {
            let mut running = self.lock(py)?;
            running.stream.epoch_ns = running.stream.epoch_ns.or(table.get().first_ns());
        }
        source.read(py, &self.rig.0, false, |reader| Ok(self.lock_detached().stream.extend(reader)?))
    }

    /// JSON and text of the report as it stands; None before the first sample.
    fn report(&self, py: Python<'_>) -> PyResult<Option<(String, String)>> {
        let Some(report) = self.lock(py)?.stream.report(NAME) else { return Ok(None) };
        Ok(Some((report.to_json().map_err(value_error)?, report.to_text(&Palette::PLAIN))))
    }

    /// Time of the last sample taken in, s; None before the first.
    #[getter]
    fn time_s(&self, py: Python<'_>) -> PyResult<Option<f64>> {
        Ok(self.lock(py)?.stream.time_s())
    }

    /// The rig.
    #[getter]
    fn rig(&self) -> Rig {
        self.rig.clone()
    }

    /// Whether bad samples raise.
    #[getter]
    fn strict(&self, py: Python<'_>) -> PyResult<bool> {
        Ok(self.lock(py)?.stream.bad_rows() == BadRows::Fatal)
    }
}

impl Estimator {
    fn over(stream: Stream) -> Self {
        let rig = Rig(stream.rig().clone());
        let mut bare_rig = rig.0.clone();
        bare_rig.columns.clear();
        Self { rig, bare_rig, running: Mutex::new(Running { stream, layout: None }) }
    }

    fn lock(&self, py: Python<'_>) -> PyResult<MutexGuard<'_, Running>> {
        self.running.lock_py_attached(py).map_err(value_error)
    }

    /// Only a panic in whoever had it could have poisoned it.
    fn lock_detached(&self) -> MutexGuard<'_, Running> {
        self.running.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Running {
    fn take(
        &mut self,
        given: [bool; 5],
        batch: Vec<&[f64]>,
        estimator: &Estimator,
    ) -> Result<u64, TraceError> {
        let layout = match &self.layout {
            Some((last, layout)) if *last == given => layout.clone(),
            _ => {
                let optional =
                    OPTIONAL.into_iter().zip(given).filter_map(|(name, given)| given.then_some(name));
                let headers: Vec<_> = REQUIRED.into_iter().chain(optional).map(str::to_owned).collect();
                TableLayout::new(NAME, &headers, &estimator.bare_rig)?
            }
        };
        let reader = TraceReader::from_table(NAME, &layout, vec![batch], &estimator.rig.0)?;
        self.layout = Some((given, layout));
        self.stream.extend(reader)
    }
}
