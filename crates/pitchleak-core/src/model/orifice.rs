use crate::Real;

/// Pressure difference below which an orifice turns laminar, Pa.
const LAMINAR_PA: f64 = 2e4;

/// sign(Δp) √|Δp| with a finite slope at zero: Δp / (Δp² + p_t²)^{1/4}, p_t = 0.2 bar, after
/// Borutzky, Barnard and Thoma, "An orifice flow model for laminar and turbulent conditions",
/// Simulation Modelling Practice and Theory 10 (2002). Off by less than 1 % above 1 bar.
#[inline]
pub fn signed_root<T: Real>(difference_pa: T) -> T {
    metering(difference_pa, T::lit(LAMINAR_PA))
}

/// [`signed_root`] with the transition at `laminar_pa`.
#[inline]
pub fn metering<T: Real>(difference_pa: T, laminar_pa: T) -> T {
    difference_pa / (difference_pa * difference_pa + laminar_pa * laminar_pa).sqrt().sqrt()
}

/// Slope of [`metering`] by the difference.
#[inline]
pub fn metering_slope<T: Real>(difference_pa: T, laminar_pa: T) -> T {
    let size = difference_pa.abs().max(laminar_pa);
    let (own, laminar) = (difference_pa / size, laminar_pa / size);
    let (own, laminar) = (own * own, laminar * laminar);
    let square = own + laminar;
    (own * T::lit(0.5) + laminar) / (square * square.sqrt().sqrt() * size.sqrt())
}

#[cfg(test)]
mod tests {
    use super::{metering, metering_slope, signed_root};

    #[test]
    fn is_the_root_at_metering_pressures_and_smooth_at_zero() {
        for p in [1e5, 1e6, 1e7_f64] {
            assert!((signed_root(p) / p.sqrt() - 1.0).abs() < 0.0101);
            assert!((signed_root(-p) + signed_root(p)).abs() < 1e-12);
        }
        assert!((signed_root(1.0_f64) - 1.0 / 2e4_f64.sqrt()).abs() < 1e-9);
        assert!(signed_root(f64::MAX).is_finite());
    }

    #[test]
    fn its_slope_is_that_of_its_differences() {
        for p in [-3e6, -2e4, -7.0, 0.0, 9e3, 1e4, 5e6_f64] {
            let step = 1.0 + 1e-5 * p.abs();
            let rise = metering(p + step, 1e4) - metering(p - step, 1e4);
            let slope = metering_slope(p, 1e4);
            assert!((rise / (2.0 * step) / slope - 1.0).abs() < 1e-6, "{p}: {slope}");
        }
    }
}
