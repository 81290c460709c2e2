//! The adaptive law of Wu et al. (2011), eq. (8)–(13).

use crate::{Cylinder, Fluid, PerLeak, Real};

/// θ of eq. (5): [β, β C_ip, β C_epA, β C_epB, β/m], in Pa, Pa·m³/(s·Pa), …, Pa/kg.
pub type Theta<T> = [T; 5];

/// Gains of the law.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct PaperGains<T> {
    /// λ of eq. (8), 1/s.
    pub lambda_per_s: T,
    /// γ_i of eq. (12), one per parameter: the diagonal of Γ, SI (θ_i²/Pa²).
    pub gamma: [T; 5],
}

impl<T: Real> PaperGains<T> {
    /// Gains that suit a rig: one number λ, one number `gamma` without unit.
    ///
    /// θ spans twelve decades, so one scalar γ cannot work. γ_i = `gamma` (θ_i*/P*)² with the size θ_i* that
    /// the parameter may have on this rig (β the prior's, C* a leak that empties the cylinder in 100 s
    /// at P* = 1 MPa) lets every parameter move at a rate of its own size.
    pub fn scaled(cylinder: &Cylinder<T>, fluid: &Fluid<T>, lambda_per_s: T, gamma: T) -> Self {
        let pressure = T::lit(1e6);
        let leak = cylinder.area_a_m2 * cylinder.stroke_m / (T::lit(100.0) * pressure);
        let beta = fluid.bulk_modulus_pa;
        let size = [beta, beta * leak, beta * leak, beta * leak, beta / cylinder.moving_mass_kg];
        Self { lambda_per_s, gamma: size.map(|theta| gamma * (theta / pressure).powi(2)) }
    }
}

/// State of the law: P̂_L and θ̂.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct PaperLaw<T> {
    /// P̂_L, Pa.
    pub load_pressure_pa: T,
    /// θ̂.
    pub theta: Theta<T>,
}

/// Time derivatives of the state of [`PaperLaw`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PaperLawRate<T> {
    /// dP̂_L/dt, Pa/s.
    pub load_pressure_pa_s: T,
    /// dθ̂/dt.
    pub theta_per_s: Theta<T>,
}

impl<T: Real> PaperLaw<T> {
    /// Starts at P_L with θ̂ from the rig: β and m as declared, no leak.
    pub fn new(cylinder: &Cylinder<T>, fluid: &Fluid<T>, load_pressure_pa: T) -> Self {
        let beta = fluid.bulk_modulus_pa;
        let none = T::zero();
        Self { load_pressure_pa, theta: [beta, none, none, none, beta / cylinder.moving_mass_kg] }
    }

    /// The law as continuous fields, eq. (8) and (12), at the measured P_L and regressors f.
    pub fn rate(&self, gains: &PaperGains<T>, load_pressure_pa: T, f: &[T; 5]) -> PaperLawRate<T> {
        let error = self.load_pressure_pa - load_pressure_pa;
        let mut theta_per_s = [T::zero(); 5];
        for ((rate, gamma), f) in theta_per_s.iter_mut().zip(&gains.gamma).zip(f) {
            *rate = -*gamma * error * *f;
        }
        PaperLawRate { load_pressure_pa_s: -gains.lambda_per_s * error + dot(&self.theta, f), theta_per_s }
    }

    /// One step of length `dt_s` to the new sample (P_L, f) by backward Euler in closed form:
    ///
    /// ```text
    /// e = (P̂ + h fᵀθ̂ − P_L) / (1 + λ h + h² fᵀ Γ f)      θ̂ ← θ̂ − h Γ f e      P̂ ← P_L + e
    /// ```
    ///
    /// V of eq. (10) does not grow for any h > 0 on data that obey P_L(k) − P_L(k−1) = h fᵀθ.
    #[inline]
    pub fn step(&mut self, gains: &PaperGains<T>, dt_s: T, load_pressure_pa: T, f: &[T; 5]) {
        let mut turn = [T::zero(); 5];
        for ((turn, gamma), f) in turn.iter_mut().zip(&gains.gamma).zip(f) {
            *turn = *gamma * *f;
        }
        let predicted = self.load_pressure_pa + dt_s * dot(&self.theta, f);
        let stiffness = T::one() + dt_s * (gains.lambda_per_s + dt_s * dot(&turn, f));
        let error = (predicted - load_pressure_pa) / stiffness;
        let push = dt_s * error;
        for (theta, turn) in self.theta.iter_mut().zip(&turn) {
            *theta -= *turn * push;
        }
        self.load_pressure_pa = load_pressure_pa + error;
    }

    /// V = ½ P̃_L² + Σ θ̃_i²/(2 γ_i), eq. (10), Pa².
    pub fn lyapunov(&self, gains: &PaperGains<T>, load_pressure_pa: T, theta: &Theta<T>) -> T {
        let half = T::lit(0.5);
        let error = self.load_pressure_pa - load_pressure_pa;
        let mut v = half * error * error;
        for ((own, truth), gamma) in self.theta.iter().zip(theta).zip(&gains.gamma) {
            v += half * (*own - *truth).powi(2) / *gamma;
        }
        v
    }

    /// Whether every number of the state is finite.
    pub fn is_finite(&self) -> bool {
        self.load_pressure_pa.is_finite() && self.theta.iter().all(|theta| theta.is_finite())
    }

    /// β, Pa.
    pub fn bulk_modulus_pa(&self) -> T {
        self.theta[0]
    }

    /// C_ip, C_epA, C_epB by eq. (5), m³/(s·Pa); zero while β̂ is not positive.
    pub fn leak_coefficients(&self) -> PerLeak<T> {
        let beta = self.theta[0];
        let per_beta = if beta > T::zero() { T::one() / beta } else { T::zero() };
        PerLeak {
            internal: self.theta[1] * per_beta,
            external_a: self.theta[2] * per_beta,
            external_b: self.theta[3] * per_beta,
        }
    }
}

/// Sum over both halves first: the compiler then works on two numbers at a time.
#[inline(always)]
fn dot<T: Real>(a: &[T; 5], b: &[T; 5]) -> T {
    let mut product = [T::zero(); 4];
    for ((product, a), b) in product.iter_mut().zip(a).zip(b) {
        *product = *a * *b;
    }
    let [p0, p1, p2, p3] = product;
    let pair = [p0 + p2, p1 + p3];
    (pair[0] + pair[1]) + a[4] * b[4]
}
