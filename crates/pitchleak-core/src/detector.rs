//! Leak alarms: raised and cleared per fault from the estimate and its uncertainty.
//!
//! The test is sequential: it looks at every block, so a fixed 1.96 σ would raise a false alarm sooner or
//! later. The leak is compared with the threshold by a confidence sequence, an interval that holds the
//! true value at all times at once with probability 1 − α: Robbins' normal mixture (H. Robbins 1970,
//! "Statistical methods related to the law of the iterated logarithm", Ann. Math. Stat. 41; S. Howard,
//! A. Ramdas, J. McAuliffe, J. Sekhon 2021, "Time-uniform, nonparametric, nonasymptotic confidence
//! sequences", Ann. Stat. 49, eq. 14). With r = (threshold/σ)² its half width is
//!
//! ```text
//! σ √( (1 + 1/r) ln((1 + r)/α²) )
//! ```
//!
//! An alarm is raised when for the hold time the interval excludes that nothing leaks, and a second one, as
//! sure as a tolerated leak deserves, lies above the threshold: a false alarm on a sound cylinder costs trust,
//! one on a leak just below its threshold costs little. It is cleared when the whole interval stays below the
//! clearing level, so the band between the two is the hysteresis.

use crate::{Estimate, LPM_PER_M3S, PerLeak, Real};

/// Levels and times of [`LeakDetector`].
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct AlarmSettings<T> {
    /// Leak flow above which a cylinder is at fault, m³/s.
    pub threshold_m3s: PerLeak<T>,
    /// An alarm clears below this share of the threshold, 0 to 1.
    pub clear_share: T,
    /// How long the evidence has to last, s.
    pub hold_time_s: T,
    /// α: probability that a sound cylinder ever raises a false alarm within one memory of the estimator.
    pub false_alarm_probability: T,
    /// The same for a leak that is just at its threshold.
    pub early_alarm_probability: T,
}

impl<T: Real> Default for AlarmSettings<T> {
    /// 0.1 L/min, clearing at half of that, held for a second, one false alarm in 10 000 memories of a sound
    /// cylinder and in 20 of one whose leak is at the threshold.
    fn default() -> Self {
        let threshold = T::lit(0.1 / LPM_PER_M3S);
        Self {
            threshold_m3s: PerLeak { internal: threshold, external_a: threshold, external_b: threshold },
            clear_share: T::lit(0.5),
            hold_time_s: T::one(),
            false_alarm_probability: T::lit(1e-4),
            early_alarm_probability: T::lit(0.05),
        }
    }
}

impl<T: Real> AlarmSettings<T> {
    /// The level below which an alarm at `threshold_m3s` clears, m³/s.
    pub fn clearing_m3s(&self, threshold_m3s: T) -> T {
        self.clear_share * threshold_m3s
    }

    /// Whether a flow, m³/s, is above `threshold_m3s` for certain: what an alarm has to be for the hold time.
    pub fn is_evidence(&self, threshold_m3s: T, flow: &Estimate<T>) -> bool {
        let half_width = |alpha| confidence_half_width(flow.std, threshold_m3s, alpha);
        flow.value > half_width(self.false_alarm_probability)
            && flow.value - half_width(self.early_alarm_probability) > threshold_m3s
    }
}

/// A change of one alarm.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(rename_all = "snake_case"))]
pub enum AlarmState {
    /// The leak is above its threshold beyond doubt.
    Raised,
    /// The leak is below the clearing level beyond doubt.
    Cleared,
}

/// Alarms of the three leaks.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct LeakDetector<T> {
    settings: AlarmSettings<T>,
    channels: PerLeak<Channel<T>>,
}

#[derive(Clone, Copy, Debug, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Channel<T> {
    active: bool,
    evidence_time_s: T,
}

impl<T: Real> LeakDetector<T> {
    /// A detector with no alarm active.
    pub fn new(settings: AlarmSettings<T>) -> Self {
        Self { settings, channels: PerLeak::default() }
    }

    /// Takes the leak flows, m³/s, as estimated `dt_s` after those before; says which alarms changed.
    pub fn update(&mut self, dt_s: T, flows_m3s: &PerLeak<Estimate<T>>) -> PerLeak<Option<AlarmState>> {
        let settings = self.settings;
        let stepped = self.channels.zip(*flows_m3s).zip(settings.threshold_m3s).map(
            |((mut channel, flow), threshold)| {
                let change = channel.update(&settings, threshold, dt_s, &flow);
                (channel, change)
            },
        );
        self.channels = stepped.map(|(channel, _)| channel);
        stepped.map(|(_, change)| change)
    }

    /// Which alarms are active.
    pub fn active(&self) -> PerLeak<bool> {
        self.channels.map(|channel| channel.active)
    }
}

impl<T: Real> Channel<T> {
    fn update(
        &mut self,
        settings: &AlarmSettings<T>,
        threshold_m3s: T,
        dt_s: T,
        flow: &Estimate<T>,
    ) -> Option<AlarmState> {
        let evidence = if self.active {
            let sure = confidence_half_width(flow.std, threshold_m3s, settings.false_alarm_probability);
            flow.value + sure < settings.clearing_m3s(threshold_m3s)
        } else {
            settings.is_evidence(threshold_m3s, flow)
        };
        if !evidence {
            self.evidence_time_s = T::zero();
            return None;
        }
        self.evidence_time_s += dt_s.at_least(T::zero());
        if self.evidence_time_s < settings.hold_time_s {
            return None;
        }
        self.evidence_time_s = T::zero();
        self.active = !self.active;
        Some(if self.active { AlarmState::Raised } else { AlarmState::Cleared })
    }
}

/// Half width of the confidence sequence around an estimate of spread `std`, same unit.
#[cfg_attr(target_os = "none", inline(never))]
fn confidence_half_width<T: Real>(std: T, threshold: T, alpha: T) -> T {
    let r = (threshold / std).powi(2);
    let bound = (T::one() + r.recip()) * (r.libm_ln_1p() - T::lit(2.0) * alpha.libm_ln());
    if bound.is_finite() && bound > T::zero() { std * bound.sqrt() } else { T::infinity() }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn flows(internal_lpm: f64, std_lpm: f64) -> PerLeak<Estimate<f64>> {
        let sound = Estimate { value: 0.0, std: std_lpm / LPM_PER_M3S };
        PerLeak {
            internal: Estimate { value: internal_lpm / LPM_PER_M3S, std: std_lpm / LPM_PER_M3S },
            external_a: sound,
            external_b: sound,
        }
    }

    /// The module's formula by hand: r = 100, α = 0.01.
    #[test]
    fn the_confidence_sequence_is_as_wide_as_its_formula_says() {
        let by_hand = 0.1 * f64::sqrt(1.01 * (101_f64.ln() - 2.0 * 0.01_f64.ln()));
        assert!((confidence_half_width(0.1, 1.0, 0.01) - by_hand).abs() < 1e-12);
        assert!((by_hand - 0.373_68).abs() < 1e-5);
    }

    /// No estimator has a spread of zero: from one that says so nothing follows.
    #[test]
    fn without_a_spread_the_confidence_sequence_is_unbounded() {
        for std in [0.0, f64::NAN] {
            let width: f64 = confidence_half_width(std, 1.0, 0.01);
            assert!(width.is_infinite() && width > 0.0, "{std}: {width}");
        }
    }

    /// Four estimates of a quarter of a second are the second that evidence has to last.
    #[test]
    fn the_hold_time_is_over_when_it_has_passed() {
        let mut detector = LeakDetector::new(AlarmSettings::default());
        let changes: [_; 4] = std::array::from_fn(|_| detector.update(0.25, &flows(0.3, 0.005)).internal);
        assert_eq!(changes, [None, None, None, Some(AlarmState::Raised)]);
    }

    /// Two minutes of a small leak that may as well be a large one.
    #[test]
    fn an_alarm_stays_while_the_leak_may_still_be_there() {
        let mut detector = LeakDetector::new(AlarmSettings::default());
        for _ in 0..8 {
            let _ = detector.update(0.25, &flows(0.3, 0.005));
        }
        assert!(detector.active().internal);
        for _ in 0..480 {
            assert_eq!(detector.update(0.25, &flows(0.01, 0.1)).internal, None);
        }
    }

    #[test]
    fn raises_after_the_hold_time_and_clears_with_hysteresis() {
        let mut detector = LeakDetector::new(AlarmSettings::default());
        let mut states = std::vec::Vec::new();
        for (level, steps) in [(0.3, 10), (0.08, 20), (0.01, 10)] {
            for _ in 0..steps {
                let change = detector.update(0.25, &flows(level, 0.005));
                states.extend(change.internal);
                assert_eq!((change.external_a, change.external_b), (None, None));
            }
        }
        assert_eq!(states, [AlarmState::Raised, AlarmState::Cleared]);
    }

    #[test]
    fn an_uncertain_leak_raises_nothing() {
        let mut detector = LeakDetector::new(AlarmSettings::default());
        for _ in 0..1000 {
            assert_eq!(detector.update(0.25, &flows(0.3, 0.1)).internal, None);
        }
    }

    /// However low the threshold: an estimate that is surely above it, as sure as a tolerated leak deserves, but may yet be none raises
    /// nothing. As soon as none is ruled out, too, it does.
    #[test]
    fn what_may_be_none_raises_nothing() {
        let std = 0.1;
        let settings = AlarmSettings::<f64>::default();
        let threshold = settings.threshold_m3s.internal * LPM_PER_M3S;
        let sure = confidence_half_width(std, threshold, settings.false_alarm_probability);
        let above = threshold + confidence_half_width(std, threshold, settings.early_alarm_probability);
        assert!(above < sure, "{above} {sure}");
        for (level, raised) in [(0.5 * (above + sure), false), (1.001 * sure, true)] {
            let mut detector = LeakDetector::new(settings);
            for _ in 0..8 {
                let _ = detector.update(0.25, &flows(level, std));
            }
            assert_eq!(detector.active().internal, raised, "{level} L/min");
        }
    }

    #[test]
    fn a_leak_below_its_threshold_is_tolerated() {
        let mut detector = LeakDetector::new(AlarmSettings::default());
        for _ in 0..1000 {
            assert_eq!(detector.update(0.25, &flows(0.099, 0.001)).internal, None);
        }
    }

    #[test]
    fn one_bad_estimate_raises_nothing() {
        let mut detector = LeakDetector::new(AlarmSettings::default());
        for k in 0..1000 {
            let level = if k % 4 == 0 { 5.0 } else { 0.0 };
            assert_eq!(detector.update(0.25, &flows(level, 0.005)).internal, None);
        }
    }
}
