use crate::errors::rig_error;
use pitchleak::Rig as EngineRig;
use pitchleak::rig::EstimatorKind;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use std::path::PathBuf;

/// A rig file: the cylinder, its oil, its sensors, its alarms.
///
/// Build one with :meth:`paper`, :meth:`load` or :meth:`parse`; it never changes.
///
/// >>> import pitchleak as pl
/// >>> rig = pl.Rig.paper()
/// >>> rig.stroke_m, rig.bulk_modulus_pa
/// (0.2, 800000000.0)
#[pyclass(frozen, eq, module = "pitchleak")]
#[derive(Clone, PartialEq)]
pub struct Rig(pub EngineRig);

#[pymethods]
impl Rig {
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
