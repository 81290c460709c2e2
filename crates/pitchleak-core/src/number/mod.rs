//! The number type, and how arrays of it are kept.

#[cfg(feature = "serde")]
pub(crate) mod arrays;

use core::fmt::Debug;
use core::ops::{AddAssign, DivAssign, MulAssign, SubAssign};
use num_traits::Float;

/// 1 m³/s in L/min, in which people think of flows.
pub const LPM_PER_M3S: f64 = 60e3;

/// The number type of the core: `f32` on a microcontroller, `f64` elsewhere, and no other.
///
/// The functions named `libm_…` come from libm on every target. [`Float`]'s own come from the
/// platform as soon as anything in the program turns on num-traits' `std`, and then differ in the
/// last bit from one machine to the next; the basic operations and the square root never do.
pub trait Real:
    sealed::Sealed + Float + Default + Debug + AddAssign + SubAssign + MulAssign + DivAssign + 'static
{
    /// The constant nearest to `value`.
    fn lit(value: f64) -> Self;
    /// The value as `f64` (exact).
    fn as_f64(self) -> f64;
    /// The larger of both; `least` where this is no number. [`Float::max`] is a call on a microcontroller.
    #[inline(always)]
    fn at_least(self, least: Self) -> Self {
        if self > least { self } else { least }
    }
    /// The smaller of both; `most` where this is no number.
    #[inline(always)]
    fn at_most(self, most: Self) -> Self {
        if self < most { self } else { most }
    }
    /// Finite and above zero.
    #[cfg_attr(target_os = "none", inline(never))] // once in the flash
    fn is_positive(self) -> bool {
        self.is_finite() && self > Self::zero()
    }
    /// Finite and not below zero.
    #[cfg_attr(target_os = "none", inline(never))] // once in the flash
    fn is_not_negative(self) -> bool {
        self.is_finite() && self >= Self::zero()
    }
    /// One over the square root of a positive number, within a few units in the last place. In `f32` by Newton's iteration from the
    /// bits of the number, on every target: a microcontroller's library takes five times as long for a root and a division.
    fn inverse_root(self) -> Self;
    /// e to the power of `self`.
    fn libm_exp(self) -> Self;
    /// Natural logarithm.
    fn libm_ln(self) -> Self;
    /// Natural logarithm of `1 + self`, exact near zero.
    fn libm_ln_1p(self) -> Self;
    /// Sine of an angle in rad.
    fn libm_sin(self) -> Self;
    /// Cosine of an angle in rad.
    fn libm_cos(self) -> Self;
    /// Tangent of an angle in rad.
    fn libm_tan(self) -> Self;
    /// Angle in rad with this cosine.
    fn libm_acos(self) -> Self;
    /// Hyperbolic tangent.
    fn libm_tanh(self) -> Self;
}

/// A number that serde knows, too: what is said of the generic types whose arrays it does not know by itself.
#[cfg(feature = "serde")]
pub trait Saved: Real + serde::Serialize + serde::de::DeserializeOwned {}
#[cfg(feature = "serde")]
impl<T: Real + serde::Serialize + serde::de::DeserializeOwned> Saved for T {}

/// Nobody else may add a [`Real`]: the last bit of each result depends on it.
mod sealed {
    pub trait Sealed {}
    impl Sealed for f32 {}
    impl Sealed for f64 {}
}

macro_rules! real {
    ($type:ty, $inverse_root:expr, $($function:ident $libm:ident),*) => {
        impl Real for $type {
            #[inline(always)]
            fn lit(value: f64) -> Self {
                value as $type
            }
            #[inline(always)]
            fn as_f64(self) -> f64 {
                f64::from(self)
            }
            #[inline(always)]
            fn inverse_root(self) -> Self {
                $inverse_root(self)
            }
            $(
                #[cfg_attr(target_os = "none", inline(never))] // once in the flash
                fn $function(self) -> Self {
                    libm::$libm(self)
                }
            )*
        }
    };
}

/// Half the exponent, turned, is within 4 % (Lomont 2003, "Fast inverse square root"); each iteration squares the error.
#[inline(always)]
fn newtons_inverse_root(number: f32) -> f32 {
    let mut root = f32::from_bits(0x5f37_5a86_u32.wrapping_sub(number.to_bits() >> 1));
    let half = 0.5 * number;
    for _ in 0..3 {
        root *= 1.5 - half * root * root;
    }
    root
}

real!(
    f32, newtons_inverse_root, libm_exp expf, libm_ln logf, libm_ln_1p log1pf, libm_sin sinf, libm_cos cosf, libm_tan tanf,
    libm_acos acosf, libm_tanh tanhf
);
real!(
    f64, |number: f64| 1.0 / number.sqrt(), libm_exp exp, libm_ln log, libm_ln_1p log1p, libm_sin sin, libm_cos cos,
    libm_tan tan, libm_acos acos, libm_tanh tanh
);

/// Items in the order in which they came.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Filled<T, const N: usize> {
    items: [T; N],
    count: usize,
}

impl<T: Copy + Default, const N: usize> Filled<T, N> {
    /// None in use.
    pub fn new() -> Self {
        Self { items: [T::default(); N], count: 0 }
    }

    pub fn all(&self) -> &[T] {
        self.items.get(..self.count).unwrap_or(&self.items)
    }

    pub fn get_mut(&mut self, place: usize) -> Option<&mut T> {
        self.items.get_mut(..self.count)?.get_mut(place)
    }

    pub fn last_mut(&mut self) -> Option<&mut T> {
        self.get_mut(self.count.checked_sub(1)?)
    }

    pub fn is_full(&self) -> bool {
        self.count == N
    }

    /// One more, where there is room.
    pub fn push(&mut self, item: T) {
        if let Some(place) = self.items.get_mut(self.count) {
            *place = item;
            self.count += 1;
        }
    }

    /// Leaves out so many from a place on.
    pub fn remove(&mut self, place: usize, removed: usize) {
        let place = place.min(self.count);
        let removed = removed.min(self.count - place);
        self.items.copy_within(place + removed..self.count, place);
        self.count -= removed;
    }
}

#[cfg(feature = "serde")]
impl<T: Copy + Default + serde::Serialize, const N: usize> serde::Serialize for Filled<T, N> {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_seq(self.all())
    }
}

#[cfg(feature = "serde")]
impl<'de, T: Copy + Default + serde::Deserialize<'de>, const N: usize> serde::Deserialize<'de>
    for Filled<T, N>
{
    fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_seq(Few(core::marker::PhantomData))
    }
}

#[cfg(feature = "serde")]
struct Few<T, const N: usize>(core::marker::PhantomData<T>);

#[cfg(feature = "serde")]
impl<'de, T: Copy + Default + serde::Deserialize<'de>, const N: usize> serde::de::Visitor<'de> for Few<T, N> {
    type Value = Filled<T, N>;

    fn expecting(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "at most {N} elements")
    }

    fn visit_seq<A: serde::de::SeqAccess<'de>>(self, mut elements: A) -> Result<Self::Value, A::Error> {
        let mut filled = Filled::new();
        while let Some(element) = elements.next_element()? {
            if filled.is_full() {
                return Err(serde::de::Error::invalid_length(N + 1, &self));
            }
            filled.push(element);
        }
        Ok(filled)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn inverse_roots_are_those_of_the_root() {
        let mut number = 1e-30_f32;
        while number < 1e30 {
            let exact = 1.0 / f64::from(number).sqrt();
            assert!((number.inverse_root().as_f64() / exact - 1.0).abs() < 3e-7, "{number}");
            assert!((f64::from(number).inverse_root() / exact - 1.0).abs() < 1e-15);
            number *= 1.037;
        }
    }
}
