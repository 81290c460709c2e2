//! The last defence: an estimate that is not a finite number counts as unknown, whatever no check before foresaw.

use pitchleak_core::{Estimate, PerLeak};

/// Larger than any leak or coefficient in SI, and small enough for its square and its value in L/min to be numbers.
const LARGEST: f64 = 1e30;
/// Nothing is known.
const UNKNOWN: Estimate<f64> = Estimate { value: 0.0, std: LARGEST };

/// The estimates, those that are no numbers as unknown: no alarm follows from one, nor the end of one.
pub(super) fn known_or_not(estimates: PerLeak<Estimate<f64>>) -> PerLeak<Estimate<f64>> {
    estimates.map(|estimate| {
        let Estimate { value, std } = estimate;
        if value.abs() < LARGEST && (0.0..LARGEST).contains(&std) { estimate } else { UNKNOWN }
    })
}

/// Whether anything is known at all.
pub(super) fn is_known(estimate: &Estimate<f64>) -> bool {
    estimate.std < LARGEST
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_nan_and_no_infinity_gets_through() {
        let sound = Estimate { value: -1e-12, std: 0.0 };
        for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e300] {
            for estimate in [Estimate { value: bad, ..sound }, Estimate { std: bad, ..sound }] {
                let PerLeak { internal, external_a, .. } =
                    known_or_not(PerLeak { internal: estimate, external_a: sound, external_b: sound });
                assert!(!is_known(&internal) && internal.value == 0.0);
                assert!(is_known(&external_a) && external_a == sound);
            }
        }
    }
}
