use core::fmt::Debug;
use core::ops::{AddAssign, DivAssign, MulAssign, SubAssign};
use num_traits::Float;

/// The number type of the core: `f32` on a microcontroller, `f64` elsewhere.
pub trait Real: Float + Default + Debug + AddAssign + SubAssign + MulAssign + DivAssign + 'static {
    /// The constant nearest to `value`.
    fn lit(value: f64) -> Self;
    /// The value as `f64` (exact).
    fn as_f64(self) -> f64;
}

impl Real for f32 {
    #[inline(always)]
    fn lit(value: f64) -> Self {
        value as f32
    }
    #[inline(always)]
    fn as_f64(self) -> f64 {
        f64::from(self)
    }
}

impl Real for f64 {
    #[inline(always)]
    fn lit(value: f64) -> Self {
        value
    }
    #[inline(always)]
    fn as_f64(self) -> f64 {
        self
    }
}
