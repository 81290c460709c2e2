//! All that is reported of one model: the same for the declared one and for that with the effects found.

use super::held_out::HeldOut;
use super::leaks::leaks;
use super::residual::whitened_residual;
use crate::diagnose::data::Series;
use crate::diagnose::equation::PerEquation;
use crate::diagnose::fit::Fit;
use crate::diagnose::outcome::{ModelFit, Quality};

/// How well a model fits: on `test`, or, where that is empty, on blocks that the fit left out.
pub(crate) fn model_fit(fit: &Fit<'_>, test: &[Series]) -> ModelFit {
    let held_out = HeldOut::of(fit, test);
    ModelFit {
        quality: Quality {
            rmse: held_out.rmse(),
            whiteness_p: PerEquation::from_fn(|equation| fit.whiteness_p(equation)),
        },
        leaks: leaks(fit),
        noise_ratio: fit.noise_ratio(),
        residuals: PerEquation::from_fn(|equation| whitened_residual(fit, equation)),
        binned_residuals: held_out.binned(),
        residual_over_time: held_out.over_time(),
    }
}
