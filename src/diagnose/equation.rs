//! The three equations of the cylinder, and one value for each.

use pitchleak_core::Terms;
use serde::Serialize;
use std::ops::{Index, IndexMut};

/// One of the three equations.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Equation {
    /// Continuity of chamber A, a flow in m³/s.
    ChamberA,
    /// Continuity of chamber B, a flow in m³/s.
    ChamberB,
    /// Balance of forces on the piston, N.
    Force,
}

impl Equation {
    /// All three, in the order of every list.
    pub const ALL: [Self; 3] = [Self::ChamberA, Self::ChamberB, Self::Force];

    /// Name in JSON and in file names.
    pub fn id(self) -> &'static str {
        match self {
            Self::ChamberA => "chamber_a",
            Self::ChamberB => "chamber_b",
            Self::Force => "force",
        }
    }

    /// The same with the unit of its residual.
    pub fn id_with_unit(self) -> &'static str {
        match self {
            Self::ChamberA => "chamber_a_m3s",
            Self::ChamberB => "chamber_b_m3s",
            Self::Force => "force_n",
        }
    }
}

/// One value per equation.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct PerEquation<V> {
    /// Continuity of chamber A.
    pub chamber_a: V,
    /// Continuity of chamber B.
    pub chamber_b: V,
    /// Balance of forces.
    pub force: V,
}

impl<V> PerEquation<V> {
    /// What `of` says about each equation.
    pub fn from_fn(mut of: impl FnMut(Equation) -> V) -> Self {
        let [chamber_a, chamber_b, force] = Equation::ALL.map(&mut of);
        Self { chamber_a, chamber_b, force }
    }

    /// Each equation with its value.
    pub fn iter(&self) -> impl Iterator<Item = (Equation, &V)> {
        Equation::ALL.into_iter().map(|equation| (equation, &self[equation]))
    }
}

impl PerEquation<f64> {
    /// `f` of each value.
    #[inline]
    pub(crate) fn map(self, f: impl Fn(f64) -> f64) -> Self {
        Self { chamber_a: f(self.chamber_a), chamber_b: f(self.chamber_b), force: f(self.force) }
    }

    /// `f` of each value and that of `other`.
    #[inline]
    pub(crate) fn zip(self, other: Self, f: impl Fn(f64, f64) -> f64) -> Self {
        Self {
            chamber_a: f(self.chamber_a, other.chamber_a),
            chamber_b: f(self.chamber_b, other.chamber_b),
            force: f(self.force, other.force),
        }
    }
}

impl From<Terms<f64>> for PerEquation<f64> {
    fn from(terms: Terms<f64>) -> Self {
        let Terms { chamber_a_m3s, chamber_b_m3s, force_n } = terms;
        Self { chamber_a: chamber_a_m3s, chamber_b: chamber_b_m3s, force: force_n }
    }
}

impl<V> Index<Equation> for PerEquation<V> {
    type Output = V;

    fn index(&self, equation: Equation) -> &V {
        match equation {
            Equation::ChamberA => &self.chamber_a,
            Equation::ChamberB => &self.chamber_b,
            Equation::Force => &self.force,
        }
    }
}

impl<V> IndexMut<Equation> for PerEquation<V> {
    fn index_mut(&mut self, equation: Equation) -> &mut V {
        match equation {
            Equation::ChamberA => &mut self.chamber_a,
            Equation::ChamberB => &mut self.chamber_b,
            Equation::Force => &mut self.force,
        }
    }
}
