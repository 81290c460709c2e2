//! Do model and declared noise explain the whole trace? What the estimator forgets when it begins anew is kept here.

use crate::report::Misfit;
use pitchleak_core::Innovation;

/// An innovation larger than this, in its own variance, counts as this: one spike is no misfit.
const LARGEST: f64 = 16.0;
/// Innovations of a window of which the worst is kept: a quarter of a minute.
const WINDOW: u32 = 60;
/// The odometer's ratio counts once it is the mean of so many renewals, 10 s.
const SETTLED: u32 = 20;

/// Sums over the trace, a few instructions per block.
#[derive(Clone, Copy, Debug, Default, serde::Serialize, serde::Deserialize)]
pub(super) struct Consistency {
    balance_sum: f64,
    balance_count: u64,
    window_sum: f64,
    window_count: u32,
    worst_window: f64,
    odometer_sum: f64,
    odometer_count: u64,
    worst_odometer: f64,
    renewals: u32,
    restarts: u64,
}

impl Consistency {
    /// Takes an innovation of the flow balance.
    pub fn balance(&mut self, Innovation { value, variance }: Innovation<f64>) {
        let ratio = (value * value / variance).min(LARGEST);
        self.balance_sum += ratio;
        self.balance_count += 1;
        self.window_sum += ratio;
        self.window_count += 1;
        if self.window_count == WINDOW {
            self.worst_window = self.worst_window.max(self.window_sum / f64::from(WINDOW));
            (self.window_sum, self.window_count) = (0.0, 0);
        }
    }

    /// Takes the odometer's ν²/S as the estimator has it after a renewal.
    pub fn odometer(&mut self, ratio: f64) {
        self.renewals += 1;
        self.odometer_sum += ratio.min(LARGEST);
        self.odometer_count += 1;
        if self.renewals >= SETTLED {
            self.worst_odometer = self.worst_odometer.max(ratio.min(LARGEST));
        }
    }

    /// The estimates began anew.
    pub fn restarted(&mut self) {
        self.renewals = 0;
        self.restarts += 1;
    }

    /// How often they did.
    pub fn restarts(&self) -> u64 {
        self.restarts
    }

    /// As it stands.
    pub fn misfit(&self) -> Misfit {
        let mean = |sum: f64, count: u64| if count > 0 { sum / count as f64 } else { 0.0 };
        Misfit {
            balance: mean(self.balance_sum, self.balance_count),
            balances: self.balance_count,
            worst_window: self.worst_window,
            odometer: mean(self.odometer_sum, self.odometer_count),
            worst_odometer: self.worst_odometer,
        }
    }
}
