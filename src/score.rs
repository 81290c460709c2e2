//! Estimates against reference leak flows, as the paper judges them: Wu et al. (2011), eq. (15)–(16).

use serde::Serialize;

/// The estimate has converged once its leakage error stays within this share of the reference.
const BAND: f64 = 0.05;
/// … for at least so long before the trace ends, s.
const DWELL_S: f64 = 1.0;
/// A reference flow or a pressure below this share of its own mean so far is near zero: an error
/// relative to it means nothing, so that sample is not scored.
const NEAR_ZERO: f64 = 0.1;

/// How one leak's estimate compares with its reference in steady state, that is after convergence;
/// over all samples where it never converges.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct LeakScore {
    /// Mean of |Q̂ − Q_ref| / |Q_ref|, %.
    pub leakage_mean_error_percent: f64,
    /// Peak of the same, %.
    pub leakage_peak_error_percent: f64,
    /// Mean of |Ĉ − C_m| / |C_m| with C_m = Q_ref / P, eq. (16), %.
    pub coefficient_mean_error_percent: f64,
    /// Peak of the same, %.
    pub coefficient_peak_error_percent: f64,
    /// Time from the first sample on until the leakage error stays within 5 %; none if it never does.
    pub convergence_time_s: Option<f64>,
}

/// Scores one leak over a stream in constant memory.
#[derive(Clone, Copy, Debug, Default)]
pub struct Scorer {
    first_s: Option<f64>,
    last_s: f64,
    reference: Mean,
    pressure: Mean,
    overall: Errors,
    /// Since the error last came into the band, and when that was.
    steady: Option<(f64, Errors)>,
}

#[derive(Clone, Copy, Debug, Default)]
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

#[derive(Clone, Copy, Debug, Default)]
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
        let finite = [t_s, leak_flow_m3s, coefficient, reference_m3s, pressure_pa];
        if !finite.into_iter().all(f64::is_finite) {
            return;
        }
        self.first_s.get_or_insert(t_s);
        self.last_s = t_s;
        self.reference.add(reference_m3s.abs());
        self.pressure.add(pressure_pa.abs());
        if is_near_zero(reference_m3s, &self.reference) || is_near_zero(pressure_pa, &self.pressure) {
            return;
        }
        let leakage = (leak_flow_m3s / reference_m3s - 1.0).abs();
        let measured_coefficient = reference_m3s / pressure_pa;
        self.add(t_s, leakage, (coefficient / measured_coefficient - 1.0).abs());
    }

    fn add(&mut self, t_s: f64, leakage: f64, coefficient: f64) {
        self.overall.add(leakage, coefficient);
        if leakage > BAND {
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

fn is_near_zero(value: f64, mean: &Mean) -> bool {
    value.abs() <= NEAR_ZERO * mean.value()
}

#[cfg(test)]
mod tests {
    use super::*;

    const COEFFICIENT: f64 = 1e-11;

    /// 10 s at 100 Hz of a leak under 2 to 4 MPa, estimated with the relative error `error(t)`.
    fn score(error: impl Fn(f64) -> f64) -> LeakScore {
        let mut scorer = Scorer::default();
        for i in 0..1000 {
            let t = f64::from(i) * 0.01;
            let pressure = 3e6 + 1e6 * t.sin();
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
    fn no_leak_no_score() {
        let mut scorer = Scorer::default();
        for i in 0..100 {
            scorer.update(f64::from(i), 1e-7, 1e-13, 0.0, 3e6);
            scorer.update(f64::from(i), f64::NAN, 1e-13, 1e-6, 3e6);
        }
        assert_eq!(scorer.score(), None);
    }

    #[test]
    fn a_reference_through_zero_is_not_scored_there() {
        let mut scorer = Scorer::default();
        for i in 0..1000 {
            let t = f64::from(i) * 0.01;
            let pressure = 3e6 * t.cos();
            // An offset of 1 % of the mean leak in the reference.
            let reference = COEFFICIENT * pressure + 2e-7;
            scorer.update(t, COEFFICIENT * pressure, COEFFICIENT, reference, pressure);
        }
        assert!(scorer.score().unwrap().leakage_peak_error_percent < 15.0);
    }
}
