//! Samples in the order of their times, each once, also where messages come twice.

use serde::{Deserialize, Serialize};

/// What becomes of a sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Turn {
    /// It is the next one.
    Next,
    /// It came before, or too late.
    Late,
    /// It is early only by the sender's clock, which was set back a while ago.
    SetBack,
}

/// How far a cylinder's samples have come.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Order {
    /// Samples that had their turn.
    count: u64,
    last_s: Option<f64>,
    /// Samples of a stretch of time that is over, in order and new: its first time and its last.
    over_again_s: Option<[f64; 2]>,
}

impl Order {
    /// Samples that had their turn.
    pub(super) fn count(&self) -> u64 {
        self.count
    }

    /// Whether the sample at `t_s` is next. Samples that stay before the last one for `set_back_after_s` are of a clock that
    /// was set back, unless they may have come before (`resent`).
    pub(super) fn turn(&mut self, t_s: f64, resent: bool, set_back_after_s: f64) -> Turn {
        if self.last_s.is_none_or(|last_s| t_s > last_s) {
            *self = Self { count: self.count.saturating_add(1), last_s: Some(t_s), over_again_s: None };
            return Turn::Next;
        }
        if resent {
            return Turn::Late;
        }
        let from_s = match self.over_again_s {
            Some([from_s, to_s]) if t_s > to_s => from_s,
            Some([from_s, _]) if t_s >= from_s => return Turn::Late,
            _ => t_s,
        };
        self.over_again_s = Some([from_s, t_s]);
        if t_s - from_s < set_back_after_s {
            return Turn::Late;
        }
        *self = Self { count: self.count.saturating_add(1), last_s: Some(t_s), over_again_s: None };
        Turn::SetBack
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_sample_has_its_turn_once() {
        let mut order = Order::default();
        let turns = [1.0, 2.0, 2.0, 1.5, 3.0].map(|t_s| order.turn(t_s, false, 60.0));
        assert_eq!(turns, [Turn::Next, Turn::Next, Turn::Late, Turn::Late, Turn::Next]);
    }

    #[test]
    fn a_clock_that_was_set_back_is_believed_after_a_while_and_a_message_sent_again_never() {
        let mut order = Order::default();
        order.turn(1000.0, false, 60.0);
        let again: Vec<_> = (0..200).map(|t_s| order.turn(f64::from(t_s), true, 60.0)).collect();
        assert!(again.iter().all(|turn| *turn == Turn::Late));
        let turns: Vec<_> = (0..200).map(|t_s| order.turn(f64::from(t_s), false, 60.0)).collect();
        let first = turns.iter().position(|turn| *turn != Turn::Late);
        assert_eq!((first, turns[60], turns[61]), (Some(60), Turn::SetBack, Turn::Next));
    }

    #[test]
    fn a_leap_ahead_costs_no_more_than_that_while() {
        let mut order = Order::default();
        order.turn(0.0, false, 60.0);
        order.turn(1e9, false, 60.0);
        let taken = (1..200).filter(|t_s| order.turn(f64::from(*t_s), false, 60.0) != Turn::Late).count();
        assert_eq!(taken, 139);
    }
}
