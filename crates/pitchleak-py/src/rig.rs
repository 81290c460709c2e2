use crate::errors::rig_error;
use crate::rig_arguments;
use pitchleak::Rig as EngineRig;
use pitchleak::rig::EstimatorKind;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::path::PathBuf;

/// A rig file: the cylinder, its oil, its sensors, its alarms.
///
/// Arguments are the keys of a rig file: ``area_a``, ``area_b``, ``stroke``, ``moving_mass``, ``dead_volume_a``,
/// ``dead_volume_b``; ``bulk_modulus``, ``bulk_modulus_std``; the sensors' data sheets ``flow`` (or ``flow_a``,
/// ``flow_b``), ``pressure``, ``position``, ``force`` as dicts, ``accuracy`` for all of them; ``estimator``, ``alarms``,
/// ``columns``, ``csv``, ``effects`` as dicts; ``name`` for messages. A quantity is a text with its unit or a
/// number in SI. Raises :class:`RigError`, which names the argument. See also :meth:`paper`, :meth:`load`, :meth:`parse`
/// and :meth:`replace`; a rig never changes.
///
/// >>> import pitchleak as pl
/// >>> rig = pl.Rig(
/// ...     area_a="12.6 cm^2", area_b="9.4 cm^2", stroke="200 mm", moving_mass="20 kg",
/// ...     bulk_modulus="0.8 GPa", pressure={"full_scale": "160 bar", "accuracy": "0.5 %"},
/// ... )
/// >>> rig.stroke_m, rig.bulk_modulus_pa
/// (0.2, 800000000.0)
#[pyclass(frozen, eq, module = "pitchleak")]
#[derive(Clone, PartialEq)]
pub struct Rig(pub EngineRig);

#[pymethods]
impl Rig {
    #[new]
    #[pyo3(signature = (**arguments))]
    fn new(arguments: Option<&Bound<'_, PyDict>>) -> PyResult<Self> {
        rig_arguments::rig(arguments).map(Self)
    }

    /// This rig with other values: arguments as for :class:`Rig`. Entries of a dict are put into the one that is there,
    /// None takes out what a rig file may leave out. Where more changes than how a trace is read, so does the name.
    ///
    /// >>> import pitchleak as pl
    /// >>> better = pl.Rig.paper().replace(stroke="250 mm", accuracy="0.1 %")
    /// >>> better.stroke_m, better.name
    /// (0.25, 'wu2011, changed')
    #[pyo3(signature = (**arguments))]
    fn replace(&self, arguments: Option<&Bound<'_, PyDict>>) -> PyResult<Self> {
        rig_arguments::replaced(&self.0, arguments).map(Self)
    }

    /// The rig of Wu et al. (2011), Section III.
    #[staticmethod]
    fn paper() -> Self {
        Self(EngineRig::paper())
    }

    /// Reads a rig file.
    ///
    /// Raises :class:`RigError` (file, line, key, values allowed) or ``OSError``.
    #[staticmethod]
    fn load(py: Python<'_>, path: PathBuf) -> PyResult<Self> {
        EngineRig::load(path).map(Self).map_err(|error| rig_error(py, &error))
    }

    /// Reads the text of a rig file; ``name`` stands in messages and results.
    ///
    /// >>> import pitchleak as pl
    /// >>> pl.Rig.parse(pl.Rig.paper().to_toml(), "copy").name
    /// 'copy'
    #[staticmethod]
    #[pyo3(signature = (text, name = "rig"))]
    fn parse(py: Python<'_>, text: &str, name: &str) -> PyResult<Self> {
        EngineRig::parse(text, name).map(Self).map_err(|error| rig_error(py, &error))
    }

    /// The rig for a trace file: ``rig.toml`` beside it, else :meth:`paper`.
    #[staticmethod]
    fn beside(py: Python<'_>, trace: PathBuf) -> PyResult<Self> {
        EngineRig::beside(&trace).map(Self).map_err(|error| rig_error(py, &error))
    }

    /// The text of a rig file that reads back to the same numbers.
    fn to_toml(&self) -> String {
        self.0.to_toml()
    }

    /// Path of the file, or ``wu2011``.
    #[getter]
    fn name(&self) -> &str {
        &self.0.name
    }

    /// Piston area A_A, m².
    #[getter]
    fn area_a_m2(&self) -> f64 {
        self.0.cylinder.area_a_m2
    }

    /// Rod-side area A_B, m².
    #[getter]
    fn area_b_m2(&self) -> f64 {
        self.0.cylinder.area_b_m2
    }

    /// Stroke L, m.
    #[getter]
    fn stroke_m(&self) -> f64 {
        self.0.cylinder.stroke_m
    }

    /// Moving mass m, kg.
    #[getter]
    fn moving_mass_kg(&self) -> f64 {
        self.0.cylinder.moving_mass_kg
    }

    /// Volume of port and hose A, m³.
    #[getter]
    fn dead_volume_a_m3(&self) -> f64 {
        self.0.cylinder.dead_volume_a_m3
    }

    /// Volume of port and hose B, m³.
    #[getter]
    fn dead_volume_b_m3(&self) -> f64 {
        self.0.cylinder.dead_volume_b_m3
    }

    /// Bulk modulus β, best guess before any data, Pa.
    #[getter]
    fn bulk_modulus_pa(&self) -> f64 {
        self.0.fluid.bulk_modulus_pa
    }

    /// Standard deviation of that guess, Pa.
    #[getter]
    fn bulk_modulus_std_pa(&self) -> f64 {
        self.0.fluid.bulk_modulus_std_pa
    }

    /// ``rls`` or ``paper``.
    #[getter]
    fn estimator(&self) -> &'static str {
        self.0.estimator.kind.name()
    }

    /// Leak flows at which an alarm is raised, L/min: internal, external_a, external_b.
    #[getter]
    fn alarm_thresholds_lpm(&self) -> [f64; 3] {
        let threshold = self.0.alarms.threshold_m3s.map(|flow| flow * pitchleak::units::LPM_PER_M3S);
        [threshold.internal, threshold.external_a, threshold.external_b]
    }

    /// Sizes of the effects beyond the model that the file declares (``[effects]``), SI, by id.
    #[getter]
    fn effects(&self) -> std::collections::BTreeMap<&'static str, f64> {
        self.0.effect_set().iter().map(|active| (active.effect.spec().id, active.value)).collect()
    }

    fn __repr__(&self) -> String {
        let cylinder = &self.0.cylinder;
        format!(
            "<Rig {}: areas {:.4} and {:.4} cm², stroke {:.4} m, bulk modulus {:.3} ± {:.3} GPa>",
            self.0.name,
            cylinder.area_a_m2 * 1e4,
            cylinder.area_b_m2 * 1e4,
            cylinder.stroke_m,
            self.0.fluid.bulk_modulus_pa / 1e9,
            self.0.fluid.bulk_modulus_std_pa / 1e9,
        )
    }

    fn _repr_html_<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        slf.py().import("pitchleak._html")?.call_method1("rig", (slf,))
    }

    fn __reduce__(slf: &Bound<'_, Self>) -> PyResult<(Py<PyAny>, (String, String))> {
        let this = slf.get();
        Ok((slf.get_type().getattr("parse")?.unbind(), (this.to_toml(), this.0.name.clone())))
    }
}

impl Rig {
    /// The engine's rig, with another estimator where one is named.
    pub fn with_estimator(&self, name: Option<&str>) -> PyResult<EngineRig> {
        let mut rig = self.0.clone();
        if let Some(name) = name {
            rig.estimator.kind = EstimatorKind::by_name(name).ok_or_else(|| {
                let names = EstimatorKind::NAMES.join(" or ");
                PyValueError::new_err(format!("estimator `{name}`: must be {names}"))
            })?;
        }
        Ok(rig)
    }
}
