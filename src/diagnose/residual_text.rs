//! What is left, in a few lines for people.

use super::outcome::{BinnedResidual, Diagnosis};
use super::residual::BalanceResidual;
use super::whiteness;
use crate::units::LPM_PER_M3S;
use std::fmt::Write;

/// A variable is named where chance does so once in a hundred diagnoses.
const CHANCE: f64 = 0.01;
/// Variables named per balance.
const MOST_NAMED: usize = 3;
const TESTS: usize = 33;
const LEVELS: [char; 8] = ['▁', '▂', '▃', '▄', '▅', '▆', '▇', '█'];

impl Diagnosis {
    /// Size against the sensors' noise, whiteness, normality, and what the remainder goes with.
    pub(super) fn write_residuals(&self, out: &mut String) {
        out.push_str("\nwhat is left                 of noise    white p   normal p   goes with\n");
        let sides = [("before", &self.residuals.before), ("after", &self.residuals.after)];
        let shown = if self.effects.is_empty() { &sides[..1] } else { &sides[..] };
        for name in ["chamber_a", "chamber_b", "force"] {
            let label = balance_name(name);
            for (side, residuals) in shown {
                let Some((_, left)) = residuals.balances().find(|(n, _)| *n == name) else { continue };
                let p = |p: Option<f64>| p.map_or_else(|| "-".into(), probability);
                let named = self.named(left);
                let _ = writeln!(
                    out,
                    "  {label:<12} {side:<10} {:>10.2} {:>10} {:>10}   {named}",
                    left.excess,
                    p(left.whiteness_p),
                    p(left.normality_p)
                );
            }
        }
    }

    fn named(&self, left: &BalanceResidual) -> String {
        let beyond = whiteness::bonferroni_sigma(CHANCE, TESTS);
        let named = left.goes_with(beyond).into_iter().take(MOST_NAMED);
        let named: Vec<String> =
            named.map(|(variable, c)| format!("{} ({:+.0} sigma)", symbol(variable), c.sigma)).collect();
        if named.is_empty() { "nothing".into() } else { named.join(", ") }
    }

    /// The shape of the remainder against the variables that it follows most, for each balance that is not
    /// explained.
    pub(super) fn write_shapes(&self, out: &mut String) {
        for (name, left) in self.residuals.after.balances() {
            let beyond = whiteness::bonferroni_sigma(CHANCE, TESTS);
            if left.excess <= 1.0 && left.goes_with(beyond).is_empty() {
                continue;
            }
            let mut shapes: Vec<&BinnedResidual> =
                self.remainder.iter().filter(|s| s.balance == name && s.varies()).collect();
            shapes.sort_by(|a, b| b.strength().total_cmp(&a.strength()));
            for shape in shapes.into_iter().take(MOST_NAMED) {
                let _ = writeln!(out, "{}", shape.line());
            }
        }
    }
}

impl BinnedResidual {
    /// How far the bins' means are from one another, in their standard errors: what a correlation cannot see
    /// of a hump.
    fn strength(&self) -> f64 {
        let pairs = self.mean.iter().zip(&self.std_error).filter(|(_, error)| **error > 0.0);
        pairs.map(|(mean, error)| (mean / error).powi(2)).sum()
    }

    fn line(&self) -> String {
        let (unit, factor) = if self.balance == "force" { ("N", 1.0) } else { ("L/min", LPM_PER_M3S) };
        let [low, high] = extremes(&self.mean);
        let bars: String = self.mean.iter().map(|mean| level((mean - low) / (high - low))).collect();
        let [from, to] = extremes(&self.at);
        let (scale, scale_unit) = people(self.against);
        format!(
            "  {:<10} left over {} to {} {unit} against {} from {} to {} {scale_unit}: {bars}",
            balance_name(self.balance),
            short(low * factor),
            short(high * factor),
            symbol(self.against),
            short(from * scale),
            short(to * scale)
        )
    }
}

fn level(share: f64) -> char {
    let index = (share * LEVELS.len() as f64) as usize;
    LEVELS.get(index).or(LEVELS.last()).copied().unwrap_or(' ')
}

fn extremes(values: &[f64]) -> [f64; 2] {
    let fold = |f: fn(f64, f64) -> f64, start| values.iter().copied().fold(start, f);
    [fold(f64::min, f64::INFINITY), fold(f64::max, f64::NEG_INFINITY)]
}

/// Name of a balance in text and figures.
pub(super) fn balance_name(balance: &str) -> &'static str {
    match balance {
        "chamber_a" => "chamber A",
        "chamber_b" => "chamber B",
        _ => "force",
    }
}

/// Name of a variable in text and figures.
pub(super) fn symbol(variable: &str) -> &'static str {
    match variable {
        "load_pressure_pa" => "P_L",
        "pa_pa" => "P_A",
        "pb_pa" => "P_B",
        "x_m" => "x",
        "v_mps" => "speed",
        "direction" => "direction",
        "qa_m3s" => "Q_A",
        "qb_m3s" => "Q_B",
        "force_n" => "force",
        "temp_k" => "temperature",
        _ => "time",
    }
}

/// Factor to people's unit, and that unit.
pub(super) fn people(variable: &str) -> (f64, &'static str) {
    match variable {
        "load_pressure_pa" | "pa_pa" | "pb_pa" => (1e-5, "bar"),
        "x_m" => (1e3, "mm"),
        "v_mps" => (1e3, "mm/s"),
        "qa_m3s" | "qb_m3s" => (LPM_PER_M3S, "L/min"),
        "force_n" => (1e-3, "kN"),
        "temp_k" => (1.0, "K"),
        "direction" => (1.0, ""),
        _ => (1.0, "s"),
    }
}

fn probability(p: f64) -> String {
    if p < 1e-3 { "<0.001".into() } else { format!("{p:.3}") }
}

/// Three significant digits.
fn short(value: f64) -> String {
    let decimals = (2.0 - value.abs().max(1e-3).log10().floor()).clamp(0.0, 4.0) as usize;
    format!("{value:.decimals$}")
}
