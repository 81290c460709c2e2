//! A known leak put into a trace.

use crate::errors::value_error;
use crate::rig::Rig;
use crate::signals::{Signals, Stopped};
use crate::simulate::Quantity;
use crate::source::Source;
use pitchleak::core::{Leak, PerLeak};
use pitchleak::prove::ProveError;
use pitchleak::units::{Dimension, LPM_PER_M3S};
use pitchleak_view::page::Page;
use pitchleak_view::{Palette, Text};
use pyo3::prelude::*;
use std::cell::RefCell;

/// Mean flows to put in, of each leak; of usual sizes where there is none at all.
type Sizes = [Vec<Quantity>; 3];

/// Puts leaks into a trace, one at a time; gives JSON, the text for people and the page.
#[pyfunction]
pub fn prove(
    py: Python<'_>,
    source: Source<'_>,
    rig: &Rig,
    strict: bool,
    sizes: Sizes,
) -> PyResult<(String, String, String)> {
    let sizes_lpm = in_lpm(&sizes)?;
    let proof = source.read_again(py, &rig.0, strict, |open| {
        let signals = RefCell::new(Signals::new(None));
        let heeded = || signals.borrow_mut().heed_now().and_then(|()| open());
        pitchleak::prove::prove(heeded, &rig.0, &sizes_lpm, || ())
    })?;
    let html = Page::of_proof(&proof, &rig.0).to_html();
    Ok((proof.to_json().map_err(value_error)?, proof.to_text(&Palette::PLAIN), html))
}

fn in_lpm([internal, external_a, external_b]: &Sizes) -> PyResult<PerLeak<Vec<f64>>> {
    let of = |leak: Leak, sizes: &[Quantity]| {
        let name = format!("leak_{}", leak.id());
        let lpm = |size: &Quantity| match size.si(&name, Dimension::Flow)? {
            0.0 => Err(value_error(format!("{name}: a leak that is put in is more than none"))),
            m3s => Ok(m3s * LPM_PER_M3S),
        };
        sizes.iter().map(lpm).collect::<PyResult<Vec<f64>>>()
    };
    Ok(PerLeak {
        internal: of(Leak::Internal, internal)?,
        external_a: of(Leak::ExternalA, external_a)?,
        external_b: of(Leak::ExternalB, external_b)?,
    })
}

impl From<ProveError> for Stopped {
    fn from(error: ProveError) -> Self {
        match error {
            ProveError::Replay(error) => Self::Failed(error),
            error => Self::Asked(value_error(error)),
        }
    }
}
