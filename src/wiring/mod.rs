//! Mistakes of wiring, sign and unit, as people are told of them. Which there is the [posterior](crate::explain) weighs.
//!
//! Nothing is ever mended in silence: [`Wiring`] names the mistake that explains what the declared wiring does not, with
//! its evidence and the lines of `[columns]` that mend it. docs/channels-and-wiring.md says what can't be told.

mod mending;
mod refused;

pub use refused::Refused;

use crate::explain::{Decision, Explained, NEAR};
use crate::rig::{ColumnMap, Rig};
use crate::signal::Signal;
use serde::Serialize;

/// A mistake is named where its residual is [`NEAR`] noise, or so many times smaller than with the wiring as declared: effects
/// that nobody declared leave more than noise.
const FALLS: f64 = 7.0;

/// A mistake of wiring, sign or unit that explains a trace whose columns are known.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Wiring {
    /// The mistake and its evidence, in one sentence.
    pub suggestion: String,
    /// Size of the residual in standard deviations of the declared noise, as the wiring is declared; none where
    /// something else speaks.
    pub residual_before: Option<f64>,
    /// Size of the residual with the mistake mended, in standard deviations of the declared noise.
    pub residual_after: Option<f64>,
    /// Lines for `[columns]` of the rig file that mend the first; none where the recording has to be mended, or the cylinder.
    pub columns: Vec<String>,
    /// Lines for its `[cylinder]` that do.
    pub cylinder: Vec<String>,
    /// Sensors whose readings carry the first.
    pub sensors: Vec<Signal>,
    /// Mistakes that explain the trace as well.
    pub alternatives: Vec<String>,
}

impl Wiring {
    /// What the decision is sure of: some mistake with probability 1 − α. The likeliest is named, beside those that are not
    /// much less likely; `columns` are those that the trace was read by.
    pub fn of(decision: &Decision, columns: &ColumnMap, rig: &Rig) -> Option<Self> {
        let alpha = rig.decision.alpha;
        let mistaken = || decision.explanations.iter().filter(|one| one.mistake.is_some());
        let first = mistaken().next().filter(|_| decision.wiring >= 1.0 - alpha)?;
        let mistake = first.mistake?;
        let is_motion = matches!(mistake, crate::explain::Mistake::LostSign(_));
        let [before, after] = decision.residuals;
        let leaves_much =
            after.is_some_and(|after| after > NEAR && before.is_none_or(|before| before < FALLS * after));
        if !is_motion && leaves_much {
            return None;
        }
        let mut names = vec![mistake.text()];
        let others = mistaken().filter(|one| one.probability > alpha * decision.wiring);
        for name in others.filter_map(|one| Some(one.mistake?.text())) {
            if !names.contains(&name) {
                names.push(name);
            }
        }
        let residuals = before.zip(after).filter(|_| !is_motion);
        let lines = mistake.mending(columns, rig);
        let (columns, cylinder) = if mistake.is_of_rig() { (vec![], lines) } else { (lines, vec![]) };
        Some(Self {
            suggestion: suggestion(first, &names, residuals),
            residual_before: residuals.map(|(before, _)| before),
            residual_after: residuals.map(|(_, after)| after),
            columns,
            cylinder,
            sensors: mistake.sensors().to_vec(),
            alternatives: names.split_off(1),
        })
    }

    /// It in one sentence, without a full stop.
    pub fn sentence(&self) -> String {
        format!("{}; {}", self.suggestion, remedy(self.mending()))
    }

    /// The table of the rig file, and the lines in it, that mend it; none where the recording has to be mended.
    pub fn mending(&self) -> Option<(&'static str, &[String])> {
        let tables = [("columns", &self.columns[..]), ("cylinder", &self.cylinder[..])];
        tables.into_iter().find(|(_, lines)| !lines.is_empty())
    }
}

/// What to do about a mistake that these lines of a table of the rig file mend; none where the recording has to be mended.
pub(crate) fn remedy(mending: Option<(&str, &[String])>) -> String {
    const COLUMNS: &str = "check how the columns are wired and recorded";
    let Some((table, lines)) = mending else { return format!("{COLUMNS}, and record anew") };
    let check = match table {
        "cylinder" => "compare both areas in the rig file with the data sheet",
        _ => COLUMNS,
    };
    format!("{check}; where that is so, mend it in the rig file: [{table}] {}", lines.join("; "))
}

fn suggestion(first: &Explained, names: &[String], residuals: Option<(f64, f64)>) -> String {
    let name = names.first().map_or("", String::as_str);
    let evidence = match residuals {
        Some((before, after)) if before > 1.5 * after => {
            format!(
                "with {name} the residual falls from {} to {} times the noise",
                figure(before),
                figure(after)
            )
        }
        _ => format!("{}: with {name} the readings are explained", first.cause),
    };
    if names.len() > 1 { format!("{evidence}; cannot be told apart: {}", names.join(", ")) } else { evidence }
}

fn figure(residual: f64) -> String {
    if residual < 9.95 { format!("{residual:.1}") } else { format!("{residual:.0}") }
}

impl Decision {
    /// With the lines of the rig file that mend mistakes of wiring, of a trace that was read by `columns`.
    #[must_use]
    pub fn read_by(mut self, columns: &ColumnMap, rig: &Rig) -> Self {
        for one in &mut self.explanations {
            if let Some(mistake) = one.mistake {
                one.columns = mistake.mending(columns, rig);
            }
        }
        self
    }
}
