//! Sampling times: which follow, which leap, and which go back.

/// A step this many times the usual one is a gap.
const GAP_FACTOR: f64 = 5.0;
/// A first step longer than this counts as a pause, s; the second then says how long steps are.
const LONGEST_FIRST_STEP_S: f64 = 1.0;
/// Times closer than this are the same, s.
const LEAST_STEP_S: f64 = 1e-9;

/// Whether two times, s, are the same.
pub(super) fn is_same(one_s: f64, other_s: f64) -> bool {
    (one_s - other_s).abs() < LEAST_STEP_S
}
/// So many rows in order, all before the last good one, are a clock that was set back.
const RESTART_ROWS: u32 = 10;
/// So many steps of a new length in a row are a new sampling rate.
const RATE_CHANGE_STEPS: u32 = 5;

#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Step {
    First,
    Next {
        dt_s: f64,
        regular: bool,
        gap: bool,
    },
    /// Not after the last good row.
    Back {
        last_s: f64,
    },
    /// As `Back`, but the clock has been running on from there for a while.
    Restart {
        usual_s: f64,
    },
}

/// Follows the time column in constant memory.
#[derive(Clone, Default, serde::Serialize, serde::Deserialize)]
pub(super) struct Clock {
    last_s: Option<f64>,
    usual_s: Option<f64>,
    unusual_steps: u32,
    rows_back: u32,
    last_back_s: f64,
    began_with_pause: bool,
}

impl Clock {
    /// Time of the last good row, s.
    pub(super) fn last_s(&self) -> Option<f64> {
        self.last_s
    }

    #[inline]
    pub(super) fn step(&mut self, t_s: f64) -> Step {
        let Some(last_s) = self.last_s else {
            self.last_s = Some(t_s);
            return Step::First;
        };
        let dt_s = t_s - last_s;
        if dt_s < LEAST_STEP_S || dt_s.is_nan() {
            return self.back(t_s, last_s);
        }
        self.rows_back = 0;
        self.last_s = Some(t_s);
        if self.usual_s.is_none() && dt_s > LONGEST_FIRST_STEP_S && !self.began_with_pause {
            self.began_with_pause = true;
            return Step::Next { dt_s, regular: false, gap: true };
        }
        let usual_s = *self.usual_s.get_or_insert(dt_s);
        let regular = dt_s < 1.5 * usual_s && usual_s < 1.5 * dt_s;
        let gap = dt_s > GAP_FACTOR * usual_s;
        self.learn(dt_s, usual_s, regular);
        Step::Next { dt_s, regular, gap }
    }

    fn back(&mut self, t_s: f64, last_s: f64) -> Step {
        let goes_on = self.rows_back > 0 && t_s > self.last_back_s;
        self.rows_back = if goes_on { self.rows_back + 1 } else { 1 };
        self.last_back_s = t_s;
        if self.rows_back < RESTART_ROWS {
            return Step::Back { last_s };
        }
        self.rows_back = 0;
        self.last_s = Some(t_s);
        Step::Restart { usual_s: self.usual_s.unwrap_or(0.0) }
    }

    #[inline]
    fn learn(&mut self, dt_s: f64, usual_s: f64, regular: bool) {
        if regular {
            self.unusual_steps = 0;
            self.usual_s = Some(usual_s + 0.05 * (dt_s - usual_s));
        } else {
            self.unusual_steps += 1;
            if self.unusual_steps >= RATE_CHANGE_STEPS {
                self.unusual_steps = 0;
                self.usual_s = Some(dt_s);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn steps(times: impl IntoIterator<Item = f64>) -> Vec<Step> {
        let mut clock = Clock::default();
        times.into_iter().map(|t| clock.step(t)).collect()
    }

    fn gaps(steps: &[Step]) -> usize {
        steps.iter().filter(|step| matches!(step, Step::Next { gap: true, .. })).count()
    }

    #[test]
    fn a_pause_is_a_gap_and_a_lost_sample_is_not() {
        let times = (0..100).filter(|i| *i != 20 && !(50..70).contains(i)).map(|i| f64::from(i) * 0.01);
        assert_eq!(gaps(&steps(times)), 1);
    }

    #[test]
    fn a_gap_at_the_very_start_does_not_hide_the_rate() {
        let times = std::iter::once(0.0).chain((0..100).map(|i| 10.0 + f64::from(i) * 0.01));
        let steps = steps(times.chain([12.0]));
        assert_eq!(gaps(&steps), 2);
    }

    #[test]
    fn a_first_row_far_too_early_is_before_a_gap() {
        let times = std::iter::once(-3600.0).chain((0..100).map(|i| f64::from(i) * 0.01));
        let steps = steps(times);
        assert_eq!(steps.get(1), Some(&Step::Next { dt_s: 3600.0, regular: false, gap: true }));
        assert_eq!(gaps(&steps), 1);
    }

    #[test]
    fn a_slow_trace_is_one_all_the_same() {
        assert_eq!(gaps(&steps((0..100).map(|i| 10.0 * f64::from(i)))), 1);
    }

    #[test]
    fn no_step_is_so_short_that_speeds_overflow() {
        assert_eq!(steps([0.0, 5e-324, 1e-300]).get(2), Some(&Step::Back { last_s: 0.0 }));
    }

    #[test]
    fn a_new_rate_is_learnt() {
        let times = (0..100).map(|i| f64::from(i) * 0.01).chain((1..100).map(|i| 0.99 + f64::from(i)));
        assert_eq!(gaps(&steps(times)), RATE_CHANGE_STEPS as usize);
    }

    #[test]
    fn a_clock_set_back_loses_few_rows() {
        let times = (0..100).chain(0..100).map(|i| f64::from(i) * 0.01);
        let steps = steps(times);
        let lost = steps.iter().filter(|step| matches!(step, Step::Back { .. })).count();
        let restarts = steps.iter().filter(|step| matches!(step, Step::Restart { .. })).count();
        assert_eq!((lost, restarts), (RESTART_ROWS as usize - 1, 1));
    }

    #[test]
    fn a_repeated_time_is_lost() {
        let steps = steps([0.0, 0.01, 0.01, 0.02]);
        assert_eq!(steps.get(2), Some(&Step::Back { last_s: 0.01 }));
    }
}
