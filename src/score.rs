//! Estimates against reference leak flows, as the paper judges them: Wu et al. (2011), eq. (15)–(16).

use serde::Serialize;

/// The estimate has converged once its coefficient stays within this share of the measured one: the leakage
/// has the pressure sensors' noise in it, which does not converge.
const BAND: f64 = 0.05;
/// … for at least so long before the trace ends, s.
const DWELL_S: f64 = 1.0;
/// Memory of the measured coefficient, s.
const COEFFICIENT_MEMORY_S: f64 = 10.0;
/// A measured coefficient below this share of its largest is that of a leak that was mended: there is nothing to be compared with.
const MENDED: f64 = 0.01;

/// How one leak's estimate compares with its reference in steady state, that is after convergence;
/// over all samples where it never converges.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct LeakScore {
    /// Mean of |Q̂ − Q_ref| over the size of the reference, %: |Q_ref|, or its mean so far where that is
    /// larger, since an internal leak goes through zero with P_L.
    pub leakage_mean_error_percent: f64,
    /// Peak of the same, %.
    pub leakage_peak_error_percent: f64,
    /// Mean of |Ĉ − C_m| / |C_m|, eq. (16), %. C_m = Q_ref / P by least squares over the last 10 s.
    pub coefficient_mean_error_percent: f64,
    /// Peak of the same, %.
    pub coefficient_peak_error_percent: f64,
    /// Time from the first sample on until the coefficient's error stays within 5 %; none if it never does.
    pub convergence_time_s: Option<f64>,
}

/// Scores one leak over a stream in constant memory.
#[derive(Clone, Copy, Debug, Default, serde::Serialize, serde::Deserialize)]
pub struct Scorer {
    first_s: Option<f64>,
    last_s: f64,
    reference: Mean,
    measured: MeasuredCoefficient,
    /// The same of what the rig file's effects let leak.
    #[serde(default)]
    of_effects: MeasuredCoefficient,
    /// Largest measured coefficient so far, m³/(s·Pa).
    #[serde(default)]
    largest: f64,
    overall: Errors,
    /// Since the error last came into the band, and when that was.
    steady: Option<(f64, Errors)>,
}

#[derive(Clone, Copy, Debug, Default, serde::Serialize, serde::Deserialize)]
struct Mean {
    sum: f64,
    count: f64,
}

impl Mean {
    fn add(&mut self, value: f64) {
        self.sum += value;
        self.count += 1.0;
    }

    fn value(&self) -> f64 {
        if self.count > 0.0 { self.sum / self.count } else { 0.0 }
    }
}

#[derive(Clone, Copy, Debug, Default, serde::Serialize, serde::Deserialize)]
struct Errors {
    leakage: Mean,
    leakage_peak: f64,
    coefficient: Mean,
    coefficient_peak: f64,
}

impl Errors {
    fn add(&mut self, leakage: f64, coefficient: f64) {
        self.leakage.add(leakage);
        self.leakage_peak = self.leakage_peak.max(leakage);
        self.coefficient.add(coefficient);
        self.coefficient_peak = self.coefficient_peak.max(coefficient);
    }
}

impl Scorer {
    /// Takes the estimate and the reference of one leak at `t_s`: flows in m³/s, the coefficient in
    /// m³/(s·Pa), and the pressure that drives the leak (P_L, P_A or P_B), Pa. The paper passes
    /// reference and pressure through its 5 Hz filter before; so does the caller.
    pub fn update(
        &mut self,
        t_s: f64,
        leak_flow_m3s: f64,
        coefficient: f64,
        reference_m3s: f64,
        pressure_pa: f64,
    ) {
        let kept = &mut Kept::default();
        self.update_beside(t_s, [leak_flow_m3s, 0.0], coefficient, reference_m3s, pressure_pa, kept);
    }

    /// Adds a leak beside other leaks, with what they share: its flow by the coefficient, and by the rig file's effects.
    pub(crate) fn update_beside(
        &mut self,
        t_s: f64,
        [by_coefficient_m3s, by_effects_m3s]: [f64; 2],
        coefficient: f64,
        reference_m3s: f64,
        pressure_pa: f64,
        kept: &mut Kept,
    ) {
        let leak_flow_m3s = by_coefficient_m3s + by_effects_m3s;
        let finite = [t_s, leak_flow_m3s, coefficient, reference_m3s, pressure_pa];
        if !finite.into_iter().all(f64::is_finite) {
            return;
        }
        let dt_s = if self.first_s.is_some() { t_s - self.last_s } else { 0.0 };
        self.first_s.get_or_insert(t_s);
        self.last_s = t_s;
        self.reference.add(reference_m3s.abs());
        let kept = kept.after(dt_s);
        self.measured.add(kept, reference_m3s, pressure_pa);
        self.of_effects.add(kept, by_effects_m3s, pressure_pa);
        let coefficient = coefficient + self.of_effects.value().unwrap_or(0.0);
        let Some(measured) = self.measured.value() else { return };
        let size_m3s = self.reference.value().max(reference_m3s.abs());
        if size_m3s > 0.0 && !self.is_mended(measured) {
            let leakage = (leak_flow_m3s - reference_m3s).abs() / size_m3s;
            self.add(t_s, leakage, (coefficient / measured - 1.0).abs());
        }
    }

    fn is_mended(&mut self, measured: f64) -> bool {
        self.largest = self.largest.max(measured.abs());
        measured.abs() < MENDED * self.largest
    }

    fn add(&mut self, t_s: f64, leakage: f64, coefficient: f64) {
        self.overall.add(leakage, coefficient);
        if coefficient > BAND {
            self.steady = None;
        } else {
            let (_, errors) = self.steady.get_or_insert((t_s, Errors::default()));
            errors.add(leakage, coefficient);
        }
    }

    /// The score so far; none where no sample had a reference to compare with.
    pub fn score(&self) -> Option<LeakScore> {
        let converged = self.steady.filter(|(since_s, _)| self.last_s - since_s >= DWELL_S);
        let errors = converged.map_or(self.overall, |(_, errors)| errors);
        (errors.leakage.count > 0.0).then(|| LeakScore {
            leakage_mean_error_percent: 100.0 * errors.leakage.value(),
            leakage_peak_error_percent: 100.0 * errors.leakage_peak,
            coefficient_mean_error_percent: 100.0 * errors.coefficient.value(),
            coefficient_peak_error_percent: 100.0 * errors.coefficient_peak,
            convergence_time_s: converged.zip(self.first_s).map(|((since_s, _), first_s)| since_s - first_s),
        })
    }
}

/// The share of the samples before that still counts after a step: worked out once for all leaks of a record.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Kept {
    dt_s: f64,
    share: f64,
}

impl Default for Kept {
    fn default() -> Self {
        Self { dt_s: 0.0, share: 1.0 }
    }
}

impl Kept {
    #[inline]
    fn after(&mut self, dt_s: f64) -> f64 {
        if dt_s.to_bits() != self.dt_s.to_bits() {
            *self = Self { dt_s, share: 1.0 / (1.0 + dt_s.max(0.0) / COEFFICIENT_MEMORY_S) };
        }
        self.share
    }
}

/// C_m of eq. (16) from a reference flow and the pressure that drives it: P near zero says nothing about
/// it, so samples count by P².
#[derive(Clone, Copy, Debug, Default, serde::Serialize, serde::Deserialize)]
struct MeasuredCoefficient {
    flow_pressure: f64,
    pressure_square: f64,
}

impl MeasuredCoefficient {
    /// Takes in a sample; `kept` is the share of those before it that still counts.
    fn add(&mut self, kept: f64, reference_m3s: f64, pressure_pa: f64) {
        self.flow_pressure = kept * self.flow_pressure + reference_m3s * pressure_pa;
        self.pressure_square = kept * self.pressure_square + pressure_pa * pressure_pa;
    }

    /// m³/(s·Pa); none where nothing has leaked.
    fn value(&self) -> Option<f64> {
        if self.flow_pressure == 0.0 {
            return None;
        }
        let value = self.flow_pressure / self.pressure_square;
        (value.is_finite() && value != 0.0).then_some(value)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const COEFFICIENT: f64 = 1e-11;

    /// 10 s at 100 Hz of a leak under 3 MPa to either side, estimated with the relative error `error(t)`.
    fn score(error: impl Fn(f64) -> f64) -> LeakScore {
        let mut scorer = Scorer::default();
        for i in 0..1000 {
            let t = f64::from(i) * 0.01;
            let pressure = if t.sin() > 0.0 { 3e6 } else { -3e6 };
            let coefficient = COEFFICIENT * (1.0 + error(t));
            scorer.update(t, coefficient * pressure, coefficient, COEFFICIENT * pressure, pressure);
        }
        scorer.score().unwrap()
    }

    #[test]
    fn errors_count_from_convergence_on() {
        let score = score(|t| if t < 2.0 { -0.5 } else { 0.02 });
        assert!((score.convergence_time_s.unwrap() - 2.0).abs() < 1e-9);
        assert!((score.leakage_mean_error_percent - 2.0).abs() < 1e-9);
        assert!((score.leakage_peak_error_percent - 2.0).abs() < 1e-9);
        assert!((score.coefficient_peak_error_percent - 2.0).abs() < 1e-9);
    }

    #[test]
    fn leaving_the_band_starts_anew() {
        let score = score(|t| if t < 2.0 || (t > 5.0 && t < 6.0) { 0.2 } else { 0.01 });
        assert!(score.convergence_time_s.unwrap() > 5.9);
    }

    #[test]
    fn without_convergence_all_samples_count() {
        let score = score(|t| if t < 9.5 { 0.2 } else { 0.0 });
        assert_eq!(score.convergence_time_s, None);
        assert!((score.leakage_mean_error_percent - 19.0).abs() < 1e-9);
        assert!((score.leakage_peak_error_percent - 20.0).abs() < 1e-9);
    }

    #[test]
    fn a_leak_that_was_mended_is_not_held_against_nothing() {
        let mut scorer = Scorer::default();
        for i in 0..20_000 {
            let (t, mended) = (f64::from(i) * 0.01, i >= 10_000);
            let truth = if mended { 0.0 } else { COEFFICIENT };
            scorer.update(t, (truth + 1e-14) * 3e6, truth + 1e-14, truth * 3e6, 3e6);
        }
        let score = scorer.score().unwrap();
        assert!(score.coefficient_peak_error_percent < 101.0 / MENDED, "{score:?}");
    }

    #[test]
    fn no_leak_no_score() {
        let mut scorer = Scorer::default();
        for i in 0..100 {
            scorer.update(f64::from(i), 1e-7, 1e-13, 0.0, 3e6);
            scorer.update(f64::from(i), f64::NAN, 1e-13, 1e-6, 3e6);
        }
        assert_eq!(scorer.score(), None);
    }

    #[test]
    fn a_reference_through_zero_is_scored_against_its_size() {
        let mut scorer = Scorer::default();
        for i in 0..2000 {
            let t = f64::from(i) * 0.01;
            let pressure = 3e6 * t.cos();
            // An offset of 1 % of the mean leak in the reference.
            let reference = COEFFICIENT * pressure + 2e-7;
            scorer.update(t, COEFFICIENT * pressure, COEFFICIENT, reference, pressure);
        }
        let score = scorer.score().unwrap();
        assert!(score.leakage_peak_error_percent < 1.5, "{score:?}");
        assert!(score.coefficient_mean_error_percent < 1.0, "{score:?}");
    }
}
