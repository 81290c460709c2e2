use crate::Real;

/// One chamber of compressible oil that may cavitate. Its state is the oil it holds, counted at
/// zero gauge pressure, `W = V exp(P/β)`; d/dt of it is eq. (1) exactly:
/// `Q − leaks = V̇ + (V/β) Ṗ`.
///
/// When W no longer fills V at vapour pressure, the pressure stays there and the rest of V is
/// vapour (the vapour-volume form of column separation: Wylie and Streeter, "Fluid Transients in
/// Systems", ch. 8, discrete vapour cavity). As W goes on counting the oil, none is lost or made
/// when the cavity opens and closes, which clamping a pressure state would do.
#[derive(Clone, Copy)]
pub(super) struct Chamber<T> {
    pub bulk_modulus_pa: T,
    pub vapour_pressure_pa: T,
}

impl<T: Real> Chamber<T> {
    pub fn pressure_pa(&self, oil_m3: T, volume_m3: T) -> T {
        (self.bulk_modulus_pa * ln_of_quotient(oil_m3, volume_m3)).max(self.vapour_pressure_pa)
    }

    pub fn oil_m3(&self, pressure_pa: T, volume_m3: T) -> T {
        volume_m3 * self.density(pressure_pa.max(self.vapour_pressure_pa))
    }

    pub fn vapour_m3(&self, oil_m3: T, volume_m3: T) -> T {
        (volume_m3 - oil_m3 / self.density(self.vapour_pressure_pa)).max(T::zero())
    }

    /// Ṗ for a flow that a compliance V/β (and what stores oil beside it) has to take.
    pub fn slope_pas(&self, pressure_pa: T, net_m3s: T, compliance_m3pa: T) -> T {
        let opening = pressure_pa <= self.vapour_pressure_pa && net_m3s < T::zero();
        if opening { T::zero() } else { net_m3s / compliance_m3pa }
    }

    /// dW/dt for a net inflow at the chamber's own density. What passes is liquid, until only the
    /// last twentieth of the chamber is: then less and less leaves, so none is left owing.
    pub fn oil_rate_m3s(&self, oil_m3: T, volume_m3: T, inflow_m3s: T) -> T {
        let filled = oil_m3 / volume_m3;
        if filled >= T::one() {
            return filled * inflow_m3s;
        }
        let leaves = inflow_m3s < T::zero();
        let share = if leaves { (filled * T::lit(20.0)).min(T::one()) } else { T::one() };
        filled.max(self.density(self.vapour_pressure_pa)) * share * inflow_m3s
    }

    /// Density relative to that at zero gauge pressure.
    fn density(&self, pressure_pa: T) -> T {
        (pressure_pa / self.bulk_modulus_pa).libm_exp()
    }
}

/// Greatest z of the series: pressures up to 5 % of β. Below it, a chamber cavitates.
const NEAR_ZERO: f64 = 0.025;

/// ln(a/b) near a = b by the series of 2 artanh z, z = (a − b)/(a + b) (Abramowitz and Stegun, 4.1.27). What is left out
/// is less than rounding, and no logarithm is taken.
#[inline]
fn ln_of_quotient<T: Real>(a: T, b: T) -> T {
    let z = (a - b) / (a + b);
    if z.abs() > T::lit(NEAR_ZERO) {
        return (a / b).libm_ln();
    }
    let square = z * z;
    let series = [7.0, 5.0, 3.0]
        .into_iter()
        .fold(T::lit(1.0 / 9.0), |sum, odd: f64| sum * square + T::lit(odd.recip()));
    (z + z) * (series * square + T::one())
}

#[cfg(test)]
mod tests {
    use super::ln_of_quotient;

    /// Within the series, where it ends, and beyond.
    #[test]
    fn the_logarithm_is_that_of_libm_to_rounding() {
        let volume = 1.3e-4;
        for step in -4000..=4000 {
            let pressure_share = f64::from(step) * 5e-5;
            let oil = volume * pressure_share.exp();
            let found = ln_of_quotient(oil, volume);
            let rounding = 2.0 * f64::EPSILON;
            assert!((found - pressure_share).abs() <= rounding, "{found} of {pressure_share}");
            let single = f64::from(ln_of_quotient(oil as f32, volume as f32));
            assert!((single - pressure_share).abs() <= 2.0 * f64::from(f32::EPSILON), "{single} in f32");
        }
    }

    #[test]
    fn nothing_in_a_chamber_is_no_number_of_the_series() {
        assert!(ln_of_quotient(0.0_f64, 1e-4) < f64::MIN);
        assert!(ln_of_quotient(f64::NAN, 1e-4).is_nan());
    }
}
