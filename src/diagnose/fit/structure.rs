//! What a fit consists of: its terms, and the constants of laws among them.

use super::problem::Problem;
use crate::diagnose::weak_form::{Linearisation, Term};
use pitchleak_core::effects::EffectConstants;

/// Which terms are fitted, and with which constants each column stands.
#[derive(Clone)]
pub(super) struct Structure {
    /// Places among the problem's terms, those of the declared model first.
    pub(super) active: Vec<usize>,
    pub(super) constants: Vec<EffectConstants<f64>>,
}

impl Structure {
    /// Without a term, and what is fitted of its constants.
    pub(super) fn without(mut self, term: usize, problem: &Problem<'_>) -> Self {
        let gone: Vec<usize> = problem.constants_of(term).chain([term]).collect();
        self.active.retain(|one| !gone.contains(one));
        self
    }

    /// With a term; its constants are unknowns, too, unless they are the usual ones.
    pub(super) fn with(
        mut self,
        term: usize,
        constants: EffectConstants<f64>,
        problem: &Problem<'_>,
    ) -> Self {
        self.active.push(term);
        self.constants[term] = constants;
        if constants != problem.usual(term) {
            self.active.extend(problem.constants_of(term));
        }
        self
    }

    /// With the constants that a linearisation has.
    pub(super) fn standing_at(mut self, at: &Linearisation, problem: &Problem<'_>) -> Self {
        for place in &self.active {
            let Term::Constant(effect, constant) = problem.terms[*place] else { continue };
            if let Some(own) =
                problem.place(Term::Effect(effect)).filter(|_| at.value(Term::Effect(effect)) != 0.0)
            {
                self.constants[own] = self.constants[own].with(constant, at.value(problem.terms[*place]));
            }
        }
        self
    }
}
