//! How a flow goes on by eq. (1) where its own meter shows nothing: the other chamber's meter says so, or the position where that shows nothing
//! either.

use super::dead_band::{Beside, Shown, is_silent, median_of_three, within_band};
use super::motion::{rate, shown};
use super::play::Sides;
use super::series::Series;
use pitchleak_core::{EffectSet, Sensors, Signals, Terms};
use std::f64::consts::FRAC_1_SQRT_2;

/// What is special about one chamber among signals and equations.
pub(super) struct Chamber {
    /// Its place among flows.
    flow: usize,
    of: fn(&Signals<f64>) -> f64,
    with_flow: fn(Signals<f64>, f64) -> Signals<f64>,
    left_m3s: fn(Terms<f64>) -> f64,
}

pub(super) const CHAMBER_A: Chamber = Chamber {
    flow: 0,
    of: |all| all.qa_m3s,
    with_flow: |all, qa_m3s| Signals { qa_m3s, ..all },
    left_m3s: |all| all.chamber_a_m3s,
};
pub(super) const CHAMBER_B: Chamber = Chamber {
    flow: 1,
    of: |all| all.qb_m3s,
    with_flow: |all, qb_m3s| Signals { qb_m3s, ..all },
    left_m3s: |all| all.chamber_b_m3s,
};

/// A trace, its model and what its sensors are known to be off by.
pub(super) struct Foreseen<'t, R> {
    series: &'t Series,
    residual: R,
    effects: &'t EffectSet<f64>,
    /// As the meters of A and B show them, …
    flows_m3s: [&'t [f64]; 2],
    /// … and without single outliers.
    calm_m3s: [Vec<f64>; 2],
    flow_stds_m3s: [f64; 2],
    /// Standard deviations of what noise makes of rates.
    noise: Signals<f64>,
}

impl<'t, R: Fn(f64, &Signals<f64>) -> Terms<f64>> Foreseen<'t, R> {
    /// `residual` is that of the model at a time, of readings without `effects`.
    pub fn new(series: &'t Series, residual: R, effects: &'t EffectSet<f64>, sensors: &Sensors<f64>) -> Self {
        let flows_m3s = [series.qa_m3s.as_slice(), &series.qb_m3s];
        // Of the difference of two readings, two steps apart.
        let of_rate = |std: f64| std * FRAC_1_SQRT_2 / series.step_s().max(1e-9);
        let dp_pas = of_rate(sensors.pressure.noise_std);
        let v_mps = of_rate(sensors.position.noise_std);
        Self {
            series,
            residual,
            effects,
            flows_m3s,
            calm_m3s: flows_m3s.map(median_of_three),
            flow_stds_m3s: [sensors.flow_a.noise_std, sensors.flow_b.noise_std],
            noise: Signals { v_mps, dpa_pas: dp_pas, dpb_pas: dp_pas, ..Signals::default() },
        }
    }

    /// Where in its meter's dead band the flow of a chamber would lie.
    pub fn within_band(&self, own: &Chamber, other: &Chamber) -> Sides {
        let by_meter = |reading: &Signals<f64>| self.by_meter(own, other, reading);
        let by_position = |reading: &Signals<f64>| self.at_speed(own, self.effects.correct(reading));
        let other_m3s = &self.calm_m3s[other.flow];
        let beside = [
            Beside {
                flow_m3s: &|at| by_meter(&self.reading(at)),
                is_silent: &|at| is_silent(other_m3s[at], self.flow_stds_m3s[other.flow]),
                std_m3s: &|| self.std(by_meter),
            },
            Beside {
                flow_m3s: &|at| by_position(&self.reading(at)),
                is_silent: &|_| false,
                std_m3s: &|| self.std(by_position),
            },
        ];
        let meter = Shown {
            t_s: &self.series.t_s,
            flow_m3s: self.flows_m3s[own.flow],
            calm_m3s: &self.calm_m3s[own.flow],
            noise_std_m3s: self.flow_stds_m3s[own.flow],
            mean_of: self.series.merged + 1,
        };
        within_band(&meter, &beside)
    }

    /// What the sensors show at a sample and its neighbours.
    fn reading(&self, at: usize) -> Signals<f64> {
        let [qa, qb] = &self.calm_m3s;
        let v_mps = rate(&self.series.t_s, &self.series.x_m, at);
        Signals { v_mps, ..shown(self.series, [qa, qb], at) }
    }

    /// What the meter would show at the speed at which nothing is left of the other chamber's equation.
    fn by_meter(&self, own: &Chamber, other: &Chamber, reading: &Signals<f64>) -> f64 {
        let seen = self.effects.correct(reading);
        let left = |v_mps: f64| (other.left_m3s)((self.residual)(seen.t_s, &Signals { v_mps, ..seen }));
        self.at_speed(own, Signals { v_mps: zero_of_line(left(0.0), left(1.0)), ..seen })
    }

    /// What the meter would show, without its dead band, of the flow at which nothing is left of its chamber's equation.
    fn at_speed(&self, own: &Chamber, seen: Signals<f64>) -> f64 {
        let with = |flow_m3s: f64| (own.with_flow)(seen, flow_m3s);
        let left = |flow_m3s: f64| (own.left_m3s)((self.residual)(seen.t_s, &with(flow_m3s)));
        (own.of)(&self.effects.read(&with(zero_of_line(left(0.0), left(1.0)))))
    }

    /// What the readings' noise makes of a flow that is foreseen, standard deviation; NaN where no sample has all that it needs.
    fn std(&self, flow_m3s: impl Fn(&Signals<f64>) -> f64) -> f64 {
        // The middle of the stroke is likelier in the middle of a trace than at its begin.
        let (middle, count) = (self.series.len() / 2, self.series.len());
        let mut readings = (middle..count).chain(0..middle).map(|at| self.reading(at));
        let Some(read) = readings.find(|reading| flow_m3s(reading).is_finite()) else {
            return f64::NAN;
        };
        let (own, noise, [a, b]) = (flow_m3s(&read), &self.noise, self.flow_stds_m3s);
        let shifted = [
            Signals { qa_m3s: read.qa_m3s + a, qb_m3s: read.qb_m3s + b, ..read },
            Signals { v_mps: read.v_mps + noise.v_mps, ..read },
            Signals { dpa_pas: read.dpa_pas + noise.dpa_pas, ..read },
            Signals { dpb_pas: read.dpb_pas + noise.dpb_pas, ..read },
        ];
        shifted.iter().map(|shifted| flow_m3s(shifted) - own).fold(0.0, f64::hypot)
    }
}

/// Where a straight line with these values at 0 and 1 is zero.
pub(super) fn zero_of_line(at_none: f64, at_one: f64) -> f64 {
    at_none / (at_none - at_one)
}
