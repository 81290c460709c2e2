use crate::Real;

/// Parabola through a signal by discounted least squares: value, slope and curvature at the newest sample,
/// older samples weighted by exp(−age/memory).
///
/// The recursive form has gains that do not change (N. Morrison 1969, Introduction to Sequential Smoothing and
/// Prediction, ch. 13; E. Brookner 1998, Tracking and Kalman Filtering Made Easy, §1.3, "critically
/// damped g-h-k filter"). Exact on a parabola, without lag.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct FadingMemoryFilter<T> {
    memory_s: T,
    value: T,
    slope: T,
    curvature: T,
    started: bool,
}

impl<T: Real> FadingMemoryFilter<T> {
    /// With a memory of `memory_s` seconds.
    pub fn new(memory_s: T) -> Self {
        Self { memory_s, value: T::zero(), slope: T::zero(), curvature: T::zero(), started: false }
    }

    /// Takes a reading `dt_s` after the one before; a step that is not positive starts anew.
    pub fn update(&mut self, dt_s: T, reading: T) -> &Self {
        if !self.started || dt_s <= T::zero() {
            *self = Self { value: reading, started: true, ..Self::new(self.memory_s) };
            return self;
        }
        let half = T::lit(0.5);
        let discount = (-dt_s / self.memory_s).libm_exp();
        let fresh = T::one() - discount;
        let slope = self.slope + dt_s * self.curvature;
        let value = self.value + dt_s * (self.slope + half * dt_s * self.curvature);
        let error = reading - value;
        self.value = value + (T::one() - discount.powi(3)) * error;
        self.slope = slope + T::lit(1.5) * fresh * fresh * (T::one() + discount) * error / dt_s;
        self.curvature += fresh.powi(3) * error / (dt_s * dt_s);
        self
    }

    /// The signal now.
    pub fn value(&self) -> T {
        self.value
    }

    /// Its first derivative, per s.
    pub fn slope(&self) -> T {
        self.slope
    }

    /// Its second derivative, per s².
    pub fn curvature(&self) -> T {
        self.curvature
    }
}
