use crate::errors::value_error;
use numpy::{IntoPyArray, PyReadonlyArrayDyn, ndarray::ArrayViewD};
use pitchleak::core::{Linkage as Core, LinkageError};
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple};

/// The slider-crank between blade and cylinder, Wu et al. (2011), eq. (17) and (18).
///
/// Angles in rad, positive towards feather; positions in m from the A end, growing with the pitch.
/// Every function takes a number or an array of any shape and gives the like; a value that the linkage
/// cannot reach raises ``ValueError``, which names its place in the array.
///
/// >>> import math, pitchleak as pl
/// >>> linkage = pl.Linkage()
/// >>> round(linkage.position_m(math.radians(30.0)), 4)
/// 0.2319
/// >>> round(math.degrees(linkage.pitch_rad(0.0)), 2)
/// 2.28
#[pyclass(frozen, eq, module = "pitchleak")]
#[derive(Clone, PartialEq)]
pub struct Linkage(Core<f64>);

/// A number, or numbers in an array.
pub enum Values<'py> {
    Number(f64),
    Array(PyReadonlyArrayDyn<'py, f64>),
}

impl<'py> FromPyObject<'_, 'py> for Values<'py> {
    type Error = PyErr;

    /// Lists, and arrays of other numbers, are made arrays of f64.
    fn extract(given: Borrowed<'_, 'py, PyAny>) -> PyResult<Self> {
        if let Ok(number) = given.extract() {
            return Ok(Self::Number(number));
        }
        if let Ok(array) = given.extract() {
            return Ok(Self::Array(array));
        }
        let numpy = given.py().import("numpy")?;
        let array = numpy.call_method1("asarray", (given,))?;
        let kind: String = array.getattr("dtype")?.getattr("kind")?.extract()?;
        if !["i", "u", "f"].contains(&kind.as_str()) {
            let kind = given.get_type().name()?.to_string();
            return Err(PyTypeError::new_err(format!(
                "{kind} is none; give a number or an array of numbers, angles in rad, positions in m"
            )));
        }
        Ok(Self::Array(array.call_method1("astype", ("float64",))?.extract()?))
    }
}

type Function = fn(&Core<f64>, f64) -> Result<f64, LinkageError>;

#[pymethods]
impl Linkage {
    /// Lengths in m and an angle in rad; those of the paper where left out.
    #[new]
    #[pyo3(signature = (*, pivot_distance_m = None, retracted_length_m = None, crank_radius_m = None, zero_angle_rad = None))]
    fn new(
        pivot_distance_m: Option<f64>,
        retracted_length_m: Option<f64>,
        crank_radius_m: Option<f64>,
        zero_angle_rad: Option<f64>,
    ) -> PyResult<Self> {
        let paper = Core::paper();
        let linkage = Core {
            pivot_distance_m: pivot_distance_m.unwrap_or(paper.pivot_distance_m),
            retracted_length_m: retracted_length_m.unwrap_or(paper.retracted_length_m),
            crank_radius_m: crank_radius_m.unwrap_or(paper.crank_radius_m),
            zero_angle_rad: zero_angle_rad.unwrap_or(paper.zero_angle_rad),
        };
        linkage.check().map(|()| Self(linkage)).map_err(value_error)
    }

    /// Piston position x_p(θ), eq. (17), m.
    fn position_m<'py>(&self, py: Python<'py>, pitch_rad: Values<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.each(py, pitch_rad, Core::position_m)
    }

    /// Pitch angle θ(x_p), the inverse of eq. (17), rad.
    fn pitch_rad<'py>(&self, py: Python<'py>, position_m: Values<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.each(py, position_m, Core::pitch_rad)
    }

    /// Lever arm dx_p/dθ, m/rad: piston speed over pitch rate, and torque over cylinder force.
    fn arm_m<'py>(&self, py: Python<'py>, pitch_rad: Values<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.each(py, pitch_rad, Core::arm_m)
    }

    /// Torque on the blade by a cylinder force (N) at a pitch angle (rad), eq. (18), N·m.
    fn torque_nm(&self, pitch_rad: f64, force_n: f64) -> PyResult<f64> {
        self.0.torque_nm(pitch_rad, force_n).map_err(value_error)
    }

    /// Cylinder force that makes a torque (N·m) at a pitch angle (rad), eq. (18), N.
    fn force_n(&self, pitch_rad: f64, torque_nm: f64) -> PyResult<f64> {
        self.0.force_n(pitch_rad, torque_nm).map_err(value_error)
    }

    /// What pickle and copy make it of again.
    fn __getnewargs_ex__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyTuple>, Bound<'py, PyDict>)> {
        let lengths = PyDict::new(py);
        lengths.set_item("pivot_distance_m", self.0.pivot_distance_m)?;
        lengths.set_item("retracted_length_m", self.0.retracted_length_m)?;
        lengths.set_item("crank_radius_m", self.0.crank_radius_m)?;
        lengths.set_item("zero_angle_rad", self.0.zero_angle_rad)?;
        Ok((PyTuple::empty(py), lengths))
    }

    fn __repr__(&self) -> String {
        let Core { pivot_distance_m, retracted_length_m, crank_radius_m, zero_angle_rad } = &self.0;
        format!(
            "Linkage(pivot_distance_m={pivot_distance_m:?}, retracted_length_m={retracted_length_m:?}, \
             crank_radius_m={crank_radius_m:?}, zero_angle_rad={zero_angle_rad:?})"
        )
    }
}

impl Linkage {
    fn each<'py>(&self, py: Python<'py>, values: Values<'py>, of: Function) -> PyResult<Bound<'py, PyAny>> {
        match values {
            Values::Number(value) => {
                let result = of(&self.0, value).map_err(value_error)?;
                Ok(result.into_pyobject(py)?.into_any())
            }
            Values::Array(array) => {
                let view = array.as_array();
                let results = py.detach(|| self.each_of(&view, of));
                let results = results.map_err(|(index, error)| value_error(format!("[{index}]: {error}")))?;
                Ok(numpy::ndarray::ArrayD::from_shape_vec(view.raw_dim(), results)
                    .map_err(value_error)?
                    .into_pyarray(py)
                    .into_any())
            }
        }
    }

    fn each_of(&self, view: &ArrayViewD<'_, f64>, of: Function) -> Result<Vec<f64>, (usize, LinkageError)> {
        let result = |(index, value): (usize, &f64)| of(&self.0, *value).map_err(|error| (index, error));
        view.iter().enumerate().map(result).collect()
    }
}
