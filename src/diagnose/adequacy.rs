//! Whether what is left can be the sensors' noise, and if not, where it shows.

use super::fit::Fit;
use super::outcome::WhitenessP;
use super::rows::Balance;
use super::select;
use super::series::{FastNoise, Series};
use super::whiteness;
use pitchleak_core::Sensors;

/// A sound rig fails any one of these tests this rarely.
const LEAST_P: f64 = 2e-4;
/// Noise this many times the declared one is remarked upon.
const NOISIER: f64 = 1.25;
/// Correlation of fast noise beyond which it is a ripple.
const RIPPLE: f64 = 0.25;

/// How the noise of one kind of sensor compares with its data sheet.
pub(super) struct SensorCheck {
    pub(super) name: &'static str,
    pub(super) declared_std: f64,
    pub(super) found: FastNoise,
}

impl SensorCheck {
    pub(super) fn is_noisier(&self) -> bool {
        self.found.std > NOISIER * self.declared_std
    }

    pub(super) fn is_ripple(&self) -> bool {
        self.is_noisier() && self.found.colour > RIPPLE
    }
}

/// Compares each signal's fast part with the data sheet.
pub(super) fn check_sensors(traces: &[Series], declared: &Sensors<f64>) -> Vec<SensorCheck> {
    type Column = fn(&Series) -> &[f64];
    let signals: [(&'static str, f64, Column); 6] = [
        ("position", declared.position.noise_std, |s| &s.x_m),
        ("pressure a", declared.pressure.noise_std, |s| &s.pa_pa),
        ("pressure b", declared.pressure.noise_std, |s| &s.pb_pa),
        ("flow a", declared.flow_a.noise_std, |s| &s.qa_m3s),
        ("flow b", declared.flow_b.noise_std, |s| &s.qb_m3s),
        ("force", declared.force.noise_std, |s| &s.force_n),
    ];
    let check = |(name, declared_std, column): (_, _, Column)| {
        let found = super::series::fast_noise(traces.iter().map(column));
        SensorCheck { name, declared_std, found }
    };
    signals.map(check).into()
}

/// The declared noise, or what the traces really carry where that is more.
pub(super) fn effective(declared: &Sensors<f64>, checks: &[SensorCheck]) -> Sensors<f64> {
    let found = |name: &str| {
        checks
            .iter()
            .filter(|c| c.name.starts_with(name) && c.is_noisier())
            .map(|c| c.found.std)
            .fold(0.0, f64::max)
    };
    let mut sensors = *declared;
    for (spread, name) in [
        (&mut sensors.position, "position"),
        (&mut sensors.pressure, "pressure"),
        (&mut sensors.flow_a, "flow a"),
        (&mut sensors.flow_b, "flow b"),
        (&mut sensors.force, "force"),
    ] {
        spread.noise_std = spread.noise_std.max(found(name));
    }
    sensors
}

/// Reasons to believe that more than noise is left; none when the model is complete.
pub(super) fn complaints(fit: &Fit<'_>) -> Vec<String> {
    let mut found = Vec::new();
    for (balance, name) in Balance::ALL.into_iter().zip(["chamber A", "chamber B", "the force balance"]) {
        let left = fit.regression.innovations(&fit.rows, &fit.solution, balance);
        let excess = fit.excess(balance);
        if excess > 1.0 {
            found.push(format!("what is left in {name} is {excess:.2} times the sensors' noise"));
        } else if whiteness::portmanteau_p(&left, 1.0).is_some_and(|p| p < LEAST_P) {
            found.push(format!("what is left in {name} is as small as noise but not white"));
        }
    }
    let strongest = select::nameless_gain(fit).sqrt();
    if strongest > whiteness::bonferroni_sigma(LEAST_P, 7) {
        found.push(format!(
            "what is left follows a product of signals that no known effect makes ({strongest:.1} sigma)"
        ));
    }
    found
}

pub(super) fn whiteness_p(fit: &Fit<'_>) -> WhitenessP {
    let p = |balance| {
        let left = fit.regression.innovations(&fit.rows, &fit.solution, balance);
        whiteness::portmanteau_p(&left, 1.0)
    };
    WhitenessP { chamber_a: p(Balance::ChamberA), chamber_b: p(Balance::ChamberB), force: p(Balance::Force) }
}
