//! Do model and declared noise explain what was read? What the estimator forgets when it begins anew is kept here: of the
//! whole trace, which a file's verdict is held against, and of the last stretch, which a stream's is.

use crate::report::Misfit;
use pitchleak_core::Innovation;
use serde::{Deserialize, Serialize};

/// An innovation larger than this, in its own variance, counts as this: one spike is no misfit.
const LARGEST: f64 = 16.0;
/// Innovations of a window of which the worst is kept: a quarter of a minute.
const WINDOW: u32 = 60;
/// The position equation's ratio counts once it is the mean of so many renewals, 10 s.
const SETTLED: u32 = 20;
/// Renewals of a stretch: ten minutes, or longer where samples come so slowly that a renewal does.
const STRETCH_RENEWALS: u32 = 1200;

/// Sums over the trace, a few instructions per block.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub(super) struct Consistency {
    window_sum: f64,
    window_count: u32,
    /// Since the estimates began anew.
    renewals: u32,
    whole: Stretch,
    /// The stretch that goes on, and the one before it.
    now: Stretch,
    before: Stretch,
    /// Of the last stretch before those two that model and noise did not explain, begin and end, s.
    unexplained_s: Option<[f64; 2]>,
    /// Whether there was any.
    forgets: bool,
}

/// Sums over a part of the trace.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
struct Stretch {
    balance_sum: f64,
    balance_count: u64,
    worst_window: f64,
    position_sum: f64,
    position_count: u64,
    worst_position: f64,
    renewals: u32,
    restarts: u64,
    span_s: Option<[f64; 2]>,
}

impl Consistency {
    /// Takes an innovation of the flow balance.
    pub fn balance(&mut self, Innovation { value, variance }: Innovation<f64>) {
        let ratio = (value * value / variance).min(LARGEST);
        self.window_sum += ratio;
        self.window_count += 1;
        let window = (self.window_count == WINDOW).then(|| self.window_sum / f64::from(WINDOW));
        if window.is_some() {
            (self.window_sum, self.window_count) = (0.0, 0);
        }
        for stretch in [&mut self.whole, &mut self.now] {
            stretch.balance_sum += ratio;
            stretch.balance_count += 1;
            stretch.worst_window = stretch.worst_window.max(window.unwrap_or_default());
        }
    }

    /// Counts a renewal at `t_s`; says whether it is the first of the next stretch.
    pub fn is_next_stretch(&mut self, t_s: f64) -> bool {
        let is_full = self.now.renewals >= STRETCH_RENEWALS;
        if is_full {
            let forgotten = std::mem::replace(&mut self.before, std::mem::take(&mut self.now));
            self.forgets |= forgotten.span_s.is_some();
            if forgotten.misfit().contradicts() {
                self.unexplained_s = forgotten.span_s;
            }
        }
        let [from_s, _] = self.now.span_s.unwrap_or([t_s; 2]);
        self.now.span_s = Some([from_s, t_s]);
        self.now.renewals += 1;
        is_full
    }

    /// Takes the position equation's ν²/S as the estimator has it after a renewal.
    pub fn position(&mut self, ratio: f64) {
        let ratio = ratio.min(LARGEST);
        self.renewals = self.renewals.saturating_add(1);
        for stretch in [&mut self.whole, &mut self.now] {
            stretch.position_sum += ratio;
            stretch.position_count += 1;
            if self.renewals >= SETTLED {
                stretch.worst_position = stretch.worst_position.max(ratio);
            }
        }
    }

    /// The estimates began anew.
    pub fn restarted(&mut self) {
        self.renewals = 0;
        self.whole.restarts += 1;
        self.now.restarts += 1;
    }

    /// How often the estimates began anew.
    pub fn restarts(&self) -> u64 {
        self.whole.restarts
    }

    /// Over the whole trace.
    pub fn whole(&self) -> Misfit {
        self.whole.misfit()
    }

    /// Over the last ten to twenty minutes, and what is known of the time before.
    pub fn lately(&self) -> Misfit {
        if !self.forgets {
            return self.whole();
        }
        let since_s = self.before.span_s.map_or(f64::NEG_INFINITY, |[from_s, _]| from_s);
        Misfit { since_s, unexplained_s: self.unexplained_s, ..self.before.and(&self.now).misfit() }
    }
}

impl Stretch {
    fn and(&self, next: &Self) -> Self {
        Self {
            balance_sum: self.balance_sum + next.balance_sum,
            balance_count: self.balance_count.saturating_add(next.balance_count),
            worst_window: self.worst_window.max(next.worst_window),
            position_sum: self.position_sum + next.position_sum,
            position_count: self.position_count.saturating_add(next.position_count),
            worst_position: self.worst_position.max(next.worst_position),
            renewals: self.renewals.saturating_add(next.renewals),
            restarts: self.restarts.saturating_add(next.restarts),
            span_s: self.span_s.zip(next.span_s).map(|([from_s, _], [_, to_s])| [from_s, to_s]),
        }
    }

    fn misfit(&self) -> Misfit {
        let mean = |sum: f64, count: u64| if count > 0 { sum / count as f64 } else { 0.0 };
        Misfit {
            balance: mean(self.balance_sum, self.balance_count),
            balances: self.balance_count,
            worst_window: self.worst_window,
            position: mean(self.position_sum, self.position_count),
            worst_position: self.worst_position,
            restarts: self.restarts,
            since_s: f64::NEG_INFINITY,
            unexplained_s: None,
        }
    }
}
