//! The own estimator of Wu et al. (2011): regressors, eq. (4)–(7), adaptive law, eq. (8)–(13), and the chain around them.

use crate::{
    Butterworth, Cylinder, FilterError, Fluid, LoadEstimator, Momentum, PerLeak, Real, Sample, Update,
    force_imbalance_n,
};

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
        let [_, internal, external_a, external_b, _] = self.theta.map(|theta| theta * per_beta);
        PerLeak { internal, external_a, external_b }
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

/// f1–f5 of the regressor form dP_L/dt = Σ θ_i f_i, eq. (6)–(7), with
/// θ = [β, β C_ip, β C_epA, β C_epB, β/m], eq. (5).
///
/// Erratum: the paper prints f1 (eq. 4, 6, 12b) with a plus between its two terms. With eq. (1)'s own sign
/// of Q_B it has to be a minus, as here; `identity_7_needs_the_minus` pins it.
///
/// The volumes hold the dead volumes, too; without them the expressions are the paper's. The last argument is
/// the integral of the force imbalance P_A A_A − P_B A_B − F, N·s, which equals m ẋ, eq. (14). A resting
/// flow gives `None`: the law needs both.
#[inline]
pub fn regressors<T: Real>(cylinder: &Cylinder<T>, sample: &Sample<T>, momentum_n_s: T) -> Option<[T; 5]> {
    let (qa, qb) = (sample.qa_m3s?, sample.qb_m3s?);
    let x = guarded_position(cylinder, sample.x_m);
    let per_a = T::one() / cylinder.volume_a_m3(x);
    let per_b = T::one() / cylinder.volume_b_m3(x);
    Some([
        qa * per_a - qb * per_b,
        -sample.load_pressure_pa() * (per_a + per_b),
        -sample.pa_pa * per_a,
        sample.pb_pa * per_b,
        -(cylinder.area_a_m2 * per_a + cylinder.area_b_m2 * per_b) * momentum_n_s,
    ])
}

/// The position, kept 0.1 % of the stroke away from both ends: there the chamber volumes in the
/// denominators vanish.
fn guarded_position<T: Real>(cylinder: &Cylinder<T>, x_m: T) -> T {
    let guard = T::lit(1e-3) * cylinder.stroke_m;
    let end = cylinder.stroke_m - guard;
    if x_m > guard && x_m < end {
        x_m
    } else if x_m >= end {
        end
    } else {
        guard
    }
}

/// The paper's whole chain, sample by sample: second-order Butterworth on every signal (Section IV), load
/// by least squares where none is measured, momentum, regressors (6), adaptive law (8), (12) in its implicit
/// form.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct PaperEstimator<T> {
    cylinder: Cylinder<T>,
    fluid: Fluid<T>,
    gains: PaperGains<T>,
    filters: Filters<T>,
    load: LoadEstimator<T>,
    momentum: Momentum<T>,
    law: Option<PaperLaw<T>>,
    max_step_s: T,
    /// Time watched since the law last moved, s.
    since_renewal_s: T,
}

/// One filter per signal.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Filters<T> {
    x: Butterworth<T>,
    pa: Butterworth<T>,
    pb: Butterworth<T>,
    qa: Butterworth<T>,
    qb: Butterworth<T>,
    force: Butterworth<T>,
}

impl<T: Real> PaperEstimator<T> {
    /// For samples at `sample_rate_hz`, filtered at `cutoff_hz` (the paper: 100 Hz and 5 Hz).
    ///
    /// # Errors
    /// Where such a filter does not exist.
    pub fn new(
        cylinder: Cylinder<T>,
        fluid: Fluid<T>,
        gains: PaperGains<T>,
        cutoff_hz: T,
        sample_rate_hz: T,
    ) -> Result<Self, FilterError> {
        let filter = Butterworth::new(cutoff_hz, sample_rate_hz)?;
        // The load's memory is that of the filter: about 1/ω_c.
        let memory_s = T::one() / (T::lit(core::f64::consts::TAU) * cutoff_hz);
        Ok(Self {
            cylinder,
            fluid,
            gains,
            filters: Filters { x: filter, pa: filter, pb: filter, qa: filter, qb: filter, force: filter },
            load: LoadEstimator::new(memory_s),
            momentum: Momentum::new(cylinder.moving_mass_kg, T::one() / (T::lit(4.0) * memory_s)),
            law: None,
            max_step_s: T::lit(50.0) / sample_rate_hz,
            since_renewal_s: T::zero(),
        })
    }

    /// Takes in the reading `sample`, `dt_s` after the one before.
    pub fn update(&mut self, dt_s: T, sample: &Sample<T>) -> Update<T> {
        if !sample.is_finite() {
            return Update::Rejected;
        }
        let Some(mut law) = self.law else {
            return self.start(sample);
        };
        if !(dt_s > T::zero() && dt_s <= self.max_step_s) {
            let update = self.start(sample);
            // What was learnt survives the gap.
            self.law = Some(PaperLaw { load_pressure_pa: sample.load_pressure_pa(), ..law });
            return update;
        }
        self.since_renewal_s += dt_s;
        let smooth = self.filters.update(sample);
        let load_n = match smooth.force_n {
            Some(force_n) => force_n,
            None => self.load.update(&self.cylinder, dt_s, &smooth),
        };
        let imbalance = force_imbalance_n(&self.cylinder, &smooth, load_n);
        let momentum = self.momentum.update(dt_s, imbalance, smooth.x_m);
        let Some(f) = regressors(&self.cylinder, &smooth, momentum) else {
            law.load_pressure_pa = smooth.load_pressure_pa();
            self.law = Some(law);
            return Update::Accepted;
        };
        law.step(&self.gains, dt_s, smooth.load_pressure_pa(), &f);
        if law.is_finite() {
            self.law = Some(law);
            let elapsed_s = core::mem::take(&mut self.since_renewal_s);
            Update::Renewed { elapsed_s, changed: false, innovation: None }
        } else {
            Update::Rejected
        }
    }

    fn start(&mut self, sample: &Sample<T>) -> Update<T> {
        self.filters.reset(sample);
        self.momentum.restart(sample.x_m);
        self.law = Some(PaperLaw::new(&self.cylinder, &self.fluid, sample.load_pressure_pa()));
        Update::Started
    }

    /// The law's state; `None` before the first sample.
    pub fn law(&self) -> Option<&PaperLaw<T>> {
        self.law.as_ref()
    }

    /// Leak coefficients C_ip, C_epA, C_epB, m³/(s·Pa); zero before the first sample. The law knows no
    /// uncertainty.
    pub fn leak_coefficients(&self) -> PerLeak<T> {
        self.law.map_or_else(PerLeak::default, |law| law.leak_coefficients())
    }

    /// β, Pa.
    pub fn bulk_modulus_pa(&self) -> T {
        self.law.map_or(self.fluid.bulk_modulus_pa, |law| law.bulk_modulus_pa())
    }
}

impl<T: Real> Filters<T> {
    fn reset(&mut self, sample: &Sample<T>) {
        self.x.reset(sample.x_m);
        self.pa.reset(sample.pa_pa);
        self.pb.reset(sample.pb_pa);
        self.qa.reset(sample.qa_m3s.unwrap_or(T::zero()));
        self.qb.reset(sample.qb_m3s.unwrap_or(T::zero()));
        self.force.reset(sample.force_n.unwrap_or(T::zero()));
    }

    fn update(&mut self, sample: &Sample<T>) -> Sample<T> {
        Sample {
            x_m: self.x.update(sample.x_m),
            pa_pa: self.pa.update(sample.pa_pa),
            pb_pa: self.pb.update(sample.pb_pa),
            qa_m3s: sample.qa_m3s.map(|q| self.qa.update(q)),
            qb_m3s: sample.qb_m3s.map(|q| self.qb.update(q)),
            force_n: sample.force_n.map(|f| self.force.update(f)),
        }
    }
}
