// Index loops over const bounds: they read like the algebra and the bounds checks vanish.
#![allow(clippy::needless_range_loop)]

use crate::{Cylinder, Real, Sample};

/// Integrals of one chamber's continuity equation (theory: Q = A ẋ + κ V Ṗ + leaks, κ = 1/β), by the
/// trapezoidal rule over a step or summed over a block.
///
/// No derivative is taken of a noisy signal: ∫ V Ṗ dt is V at mid-step times the pressure's rise.
#[derive(Clone, Copy, Debug, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct ChamberIntegral<T> {
    /// ∫ Q dt, m³.
    pub flow: T,
    /// ∫ V dP, m³·Pa.
    pub compression: T,
    /// ∫ P dt, Pa·s.
    pub pressure: T,
}

/// What the flow meters say of a step.
pub(super) struct Fed<T> {
    pub chambers: FedChambers,
    /// Sum of chamber A's flow at both ends, m³/s.
    a_m3s: T,
    /// The same of chamber B.
    b_m3s: T,
}

/// Chambers whose flow was measured at both ends of a step.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum FedChambers {
    Both,
    OnlyA,
    OnlyB,
    Neither,
}

impl<T: Real> Fed<T> {
    #[inline]
    pub fn over(last: &Sample<T>, now: &Sample<T>) -> Self {
        match (last.qa_m3s, now.qa_m3s, last.qb_m3s, now.qb_m3s) {
            (Some(a), Some(a_now), Some(b), Some(b_now)) => {
                Self { chambers: FedChambers::Both, a_m3s: a + a_now, b_m3s: b + b_now }
            }
            _ => Self::not_both(last, now),
        }
    }

    #[cold]
    fn not_both(last: &Sample<T>, now: &Sample<T>) -> Self {
        let none = T::zero();
        let (chambers, a_m3s, b_m3s) = match (last.qa_m3s, now.qa_m3s, last.qb_m3s, now.qb_m3s) {
            (Some(a), Some(a_now), ..) => (FedChambers::OnlyA, a + a_now, none),
            (.., Some(b), Some(b_now)) => (FedChambers::OnlyB, none, b + b_now),
            _ => (FedChambers::Neither, none, none),
        };
        Self { chambers, a_m3s, b_m3s }
    }
}

/// Both chambers over the same time.
#[derive(Clone, Copy, Debug, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Integrals<T> {
    pub a: ChamberIntegral<T>,
    pub b: ChamberIntegral<T>,
    /// ∫ dt, s.
    pub time: T,
    /// Σ dt², s²: times the variance of one sample it is the variance of ∫ Q dt.
    pub time_square: T,
    /// Number of steps.
    pub steps: T,
}

impl<T: Real> Integrals<T> {
    /// Integrals over the step from `last` to `now`; a chamber that is not fed counts as one without flow.
    #[inline]
    pub fn step(cylinder: &Cylinder<T>, dt_s: T, last: &Sample<T>, now: &Sample<T>, fed: &Fed<T>) -> Self {
        let half = T::lit(0.5);
        let half_dt = half * dt_s;
        let x = (half * (last.x_m + now.x_m)).at_least(T::zero()).at_most(cylinder.stroke_m);
        Self {
            a: ChamberIntegral {
                flow: half_dt * fed.a_m3s,
                compression: cylinder.volume_a_m3(x) * (now.pa_pa - last.pa_pa),
                pressure: half_dt * (last.pa_pa + now.pa_pa),
            },
            b: ChamberIntegral {
                flow: half_dt * fed.b_m3s,
                compression: cylinder.volume_b_m3(x) * (now.pb_pa - last.pb_pa),
                pressure: half_dt * (last.pb_pa + now.pb_pa),
            },
            time: dt_s,
            time_square: dt_s * dt_s,
            steps: T::one(),
        }
    }

    pub fn add(&mut self, step: &Self) {
        self.a.add(&step.a);
        self.b.add(&step.b);
        self.time += step.time;
        self.time_square += step.time_square;
        self.steps += step.steps;
    }
}

impl<T: Real> ChamberIntegral<T> {
    fn add(&mut self, step: &Self) {
        self.flow += step.flow;
        self.compression += step.compression;
        self.pressure += step.pressure;
    }
}

/// One scalar equation, left side and regressor.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(
    feature = "serde",
    serde(bound(
        serialize = "T: serde::Serialize + Copy",
        deserialize = "T: Real + serde::Deserialize<'de>"
    ))
)]
pub(super) struct Equation<T, const N: usize> {
    pub left: T,
    #[cfg_attr(feature = "serde", serde(with = "crate::number::arrays::vector"))]
    pub columns: [T; N],
}

impl<T: Real, const N: usize> Equation<T, N> {
    /// Left side less columnsᵀθ.
    #[inline]
    pub fn remainder(&self, theta: &[T; N]) -> T {
        let mut left = self.left;
        for i in 0..N {
            left -= self.columns[i] * theta[i];
        }
        left
    }
}

/// w_a·(chamber A) + w_b·(chamber B), in prior units: `scale` holds each parameter's prior standard
/// deviation, `compressibility` its prior mean 1/β (the other means are zero). Columns in the order of
/// [`Parameter`](super::Parameter).
#[inline]
pub(super) fn combine<T: Real, const N: usize>(
    integrals: &Integrals<T>,
    weight_a: T,
    weight_b: T,
    compressibility: T,
    scale: &[T; N],
) -> Equation<T, N> {
    let (a, b) = (&integrals.a, &integrals.b);
    let compression = weight_a * a.compression + weight_b * b.compression;
    let flow_a = weight_a * a.flow;
    let flow_b = weight_b * b.flow;
    let left = flow_a + flow_b - compressibility * compression;
    let all = [
        compression,
        (weight_a - weight_b) * (a.pressure - b.pressure),
        weight_a * a.pressure,
        weight_b * b.pressure,
        weight_a * integrals.time,
        weight_b * integrals.time,
        flow_a,
        flow_b,
        // A position that reads (1 + γ) x travels (1 + γ) times as far: only the odometer sees it.
        T::zero(),
    ];
    let mut columns = [T::zero(); N];
    for ((column, value), scale) in columns.iter_mut().zip(all).zip(scale) {
        *column = value * *scale;
    }
    Equation { left, columns }
}
