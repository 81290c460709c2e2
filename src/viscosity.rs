//! How thick the oil is: a laminar leak lets through as much more as it is thinner.

/// Temperature of the grade's name, K: 40 °C (ISO 3448).
pub const GRADE_K: f64 = 313.15;
const HOT_K: f64 = 373.15;
/// Kinematic viscosities at 40 °C and 100 °C, mm²/s: ISO VG 32 with viscosity index about 100.
const AT_GRADE_MM2PS: f64 = 32.0;
const AT_HOT_MM2PS: f64 = 5.4;
/// Kinematic viscosities are shifted by this before their logarithms are taken, mm²/s.
const SHIFT_MM2PS: f64 = 0.7;
/// Relative standard deviation of [`thinning_per_k`] among hydraulic oils of grades 22 to 68 and viscosity indices 90 to 150.
pub const THINNING_SPREAD: f64 = 0.15;

/// Kinematic viscosity of a mineral oil ISO VG 32, mm²/s, by Walther's law (ASTM D341): lg lg(ν + 0.7) = A − B lg T.
pub fn viscosity_mm2ps(temp_k: f64) -> f64 {
    let level = double_log(AT_GRADE_MM2PS) - steepness() * (libm::log10(temp_k) - libm::log10(GRADE_K));
    libm::pow(10.0, libm::pow(10.0, level)) - SHIFT_MM2PS
}

/// −d ln ν/dT, 1/K: the share by which a laminar leak grows per kelvin.
pub fn thinning_per_k(temp_k: f64) -> f64 {
    let shifted = viscosity_mm2ps(temp_k) + SHIFT_MM2PS;
    steepness() * libm::log(shifted) / temp_k * shifted / (shifted - SHIFT_MM2PS)
}

/// B of Walther's law.
fn steepness() -> f64 {
    (double_log(AT_GRADE_MM2PS) - double_log(AT_HOT_MM2PS)) / (libm::log10(HOT_K) - libm::log10(GRADE_K))
}

fn double_log(viscosity_mm2ps: f64) -> f64 {
    libm::log10(libm::log10(viscosity_mm2ps + SHIFT_MM2PS))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn warm_oil_is_thin() {
        let near = |temp_k: f64, expected: f64, within: f64| {
            let found = viscosity_mm2ps(temp_k);
            assert!((found - expected).abs() < within, "{found} at {temp_k} K");
        };
        near(GRADE_K, 32.0, 1e-9);
        near(HOT_K, 5.4, 1e-9);
        // Tables of mineral oils VG 32.
        near(273.15, 300.0, 40.0);
        near(293.15, 87.0, 5.0);
    }

    #[test]
    fn thinning_is_the_slope_of_the_logarithm() {
        for temp_k in [263.15, 293.15, 323.15, 363.15] {
            let [cold, warm] =
                [temp_k - 0.01, temp_k + 0.01].map(|temp_k| libm::log(viscosity_mm2ps(temp_k)));
            assert!((thinning_per_k(temp_k) - (cold - warm) / 0.02).abs() < 1e-6);
        }
    }
}
