//! The engine for Python: `pitchleak._pitchleak`, under the package `pitchleak`. Data in, JSON and arrays
//! out; what Python makes of them is in `python/pitchleak`.

mod errors;
mod estimator;
mod fleet;
mod linkage;
mod replay;
mod rig;
mod signals;
mod simulate;
mod table;

use pyo3::prelude::*;

/// The compiled part of pitchleak.
#[pymodule(gil_used = false)]
mod _pitchleak {
    #[pymodule_export]
    use crate::errors::{RigError, TraceError};
    #[pymodule_export]
    use crate::estimator::Estimator;
    #[pymodule_export]
    use crate::fleet::{
        FleetNights, FleetRow, fleet_json, fleet_odds, fleet_page, fleet_row, fleet_save, fleet_table,
        fleet_text, fleet_traces,
    };
    #[pymodule_export]
    use crate::linkage::Linkage;
    #[pymodule_export]
    use crate::replay::diagnose;
    #[pymodule_export]
    use crate::replay::{
        calibrate, check, check_page, explanations, over_time, prove, replay, replay_page, write_page,
    };
    #[pymodule_export]
    use crate::rig::Rig;
    #[pymodule_export]
    use crate::signals::Stop;
    #[pymodule_export]
    use crate::simulate::{reproduce, simulate};
    #[pymodule_export]
    use crate::table::{Layout, Table};

    use super::*;

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        module.add("__version__", env!("CARGO_PKG_VERSION"))
    }
}
