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

/// Samples that were bad, of which one that comes again is known.
const BAD: usize = 64;

/// How far a cylinder's samples have come.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Order {
    /// Samples that had their turn.
    pub count: u64,
    /// Of the last one taken.
    last_s: Option<f64>,
    /// After it: times of samples that had their turn and were bad.
    bad_s: Vec<f64>,
    /// Samples of a stretch of time that is over, in order and new: its first time and its last.
    over_again_s: Option<[f64; 2]>,
}

impl Order {
    /// Whether counts and times can be those of samples.
    pub(super) fn is_possible(&self) -> bool {
        self.bad_s.len() <= BAD
    }

    /// The sample at `t_s`, whose turn it was, was taken.
    pub(super) fn took(&mut self, t_s: f64) {
        self.last_s = Some(t_s);
        self.bad_s.retain(|bad_s| *bad_s > t_s);
    }

    /// It was bad: the next one may be before it, and itself may come again.
    pub(super) fn left_out(&mut self, t_s: f64) {
        if self.bad_s.len() < BAD && !self.bad_s.contains(&t_s) {
            self.bad_s.push(t_s);
        }
    }

    /// Whether it is the turn of the sample at `t_s`. Samples that stay before the last one taken for `set_back_after_s` are
    /// of a clock that was set back, unless they may have come before (`resent`).
    pub(super) fn turn(&mut self, t_s: f64, resent: bool, set_back_after_s: f64) -> Turn {
        if self.last_s.is_none_or(|last_s| t_s > last_s) {
            if resent && self.bad_s.contains(&t_s) {
                return Turn::Late;
            }
            self.count = self.count.saturating_add(1);
            self.over_again_s = None;
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
        let count = self.count.saturating_add(1);
        *self = Self { count, last_s: Some(t_s), ..Self::default() };
        Turn::SetBack
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The turn of a good sample.
    fn turn(order: &mut Order, t_s: f64, resent: bool) -> Turn {
        let turn = order.turn(t_s, resent, 60.0);
        if turn != Turn::Late {
            order.took(t_s);
        }
        turn
    }

    #[test]
    fn each_sample_has_its_turn_once() {
        let mut order = Order::default();
        let turns = [1.0, 2.0, 2.0, 1.5, 3.0].map(|t_s| turn(&mut order, t_s, false));
        assert_eq!(turns, [Turn::Next, Turn::Next, Turn::Late, Turn::Late, Turn::Next]);
    }

    #[test]
    fn a_bad_sample_makes_none_late_and_comes_again_in_vain() {
        let mut order = Order::default();
        turn(&mut order, 1.0, false);
        assert_eq!(order.turn(5.0, false, 60.0), Turn::Next);
        order.left_out(5.0);
        assert_eq!(order.turn(5.0, true, 60.0), Turn::Late);
        assert_eq!([2.0, 5.0].map(|t_s| turn(&mut order, t_s, false)), [Turn::Next; 2]);
        assert!(order.bad_s.is_empty());
    }

    #[test]
    fn a_clock_that_was_set_back_is_believed_after_a_while_and_a_message_sent_again_never() {
        let mut order = Order::default();
        turn(&mut order, 1000.0, false);
        let again: Vec<_> = (0..200).map(|t_s| turn(&mut order, f64::from(t_s), true)).collect();
        assert!(again.iter().all(|turn| *turn == Turn::Late));
        let turns: Vec<_> = (0..200).map(|t_s| turn(&mut order, f64::from(t_s), false)).collect();
        let first = turns.iter().position(|turn| *turn != Turn::Late);
        assert_eq!((first, turns[60], turns[61]), (Some(60), Turn::SetBack, Turn::Next));
    }

    #[test]
    fn a_leap_ahead_costs_no_more_than_that_while() {
        let mut order = Order::default();
        turn(&mut order, 0.0, false);
        turn(&mut order, 1e9, false);
        let taken = (1..200).filter(|t_s| turn(&mut order, f64::from(*t_s), false) != Turn::Late).count();
        assert_eq!(taken, 139);
    }
}
