//! Estimates that scatter beyond their own errors: the random effects of a meta-analysis.

use pitchleak_core::Estimate;
use statrs::distribution::{ContinuousCDF, StudentsT};

/// A weighted fit with a scatter between traces beside their own errors.
///
/// The scatter's variance is by moments (DerSimonian & Laird 1986, "Meta-analysis in clinical trials"), the intervals by
/// Student's t and the weighted residual, never below 1 (Knapp & Hartung 2003, "Improved tests for a random effects
/// meta-regression with a single covariate").
pub(super) struct Scatter {
    freedom: f64,
    student: StudentsT,
}

impl Scatter {
    /// Of a fit with so many values more than unknowns. None without one: then nobody knows what traces scatter.
    pub fn with_freedom(freedom: usize) -> Option<Self> {
        let freedom = freedom as f64;
        Some(Self { freedom, student: StudentsT::new(0.0, 1.0, freedom).ok()? })
    }

    /// Variance between traces, from a fit weighted by the values' own variances: its weighted sum of squares, and its
    /// weight times what is not leverage.
    pub fn variance(&self, residual: f64, free_weight: f64) -> f64 {
        ((residual - self.freedom) / free_weight).max(0.0)
    }

    /// Factor of the variances of a fit with this weighted sum of squares.
    pub fn inflation(&self, residual: f64) -> f64 {
        (residual / self.freedom).max(1.0)
    }

    /// Factor of standard deviations such that 1.96 of them are the half of the 95 % interval.
    pub fn width(&self) -> f64 {
        self.student.inverse_cdf(0.975) / Estimate { value: 0.0, std: 1.0 }.half_width95()
    }

    /// How probable it is that chance alone is above so many standard deviations.
    pub fn chance(&self, deviations: f64) -> f64 {
        self.student.sf(deviations)
    }
}
