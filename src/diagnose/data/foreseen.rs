//! How a flow goes on by eq. (1) where its own meter shows nothing: the other chamber's meter says so, or the position where that shows nothing
//! either.

use super::dead_band::{Beside, Shown, is_silent, median_of_three, within_band};
use super::motion::{shown, slope, slope_std};
use super::play::Sides;
use super::series::Series;
use pitchleak_core::{EffectSet, Sensors, Signals, Terms};

/// What is special about one chamber among signals and equations.
pub(super) struct Chamber {
    flow_m3s: fn(&Signals<f64>) -> f64,
    with_flow: fn(Signals<f64>, f64) -> Signals<f64>,
    left_m3s: fn(Terms<f64>) -> f64,
}

pub(super) const CHAMBER_A: Chamber = Chamber {
    flow_m3s: |all| all.qa_m3s,
    with_flow: |all, qa_m3s| Signals { qa_m3s, ..all },
    left_m3s: |all| all.chamber_a_m3s,
};
pub(super) const CHAMBER_B: Chamber = Chamber {
    flow_m3s: |all| all.qb_m3s,
    with_flow: |all, qb_m3s| Signals { qb_m3s, ..all },
    left_m3s: |all| all.chamber_b_m3s,
};

/// A trace, its model and what its sensors are known to be off by.
pub(super) struct Foreseen<'t, R> {
    series: &'t Series,
    residual: R,
    effects: &'t EffectSet<f64>,
    /// Without single outliers, as read.
    calm: Vec<Signals<f64>>,
    /// Standard deviations of the readings' noise.
    noise: Signals<f64>,
}

impl<'t, R: Fn(f64, &Signals<f64>) -> Terms<f64>> Foreseen<'t, R> {
    /// `residual` is that of the model at a time, of readings without `effects`.
    pub fn new(series: &'t Series, residual: R, effects: &'t EffectSet<f64>, sensors: &Sensors<f64>) -> Self {
        let [qa, qb] = [&series.qa_m3s, &series.qb_m3s].map(|flow| median_of_three(flow));
        let calm = |(qa_m3s, qb_m3s)| Signals { qa_m3s, qb_m3s, ..Signals::default() };
        let of_slope = |std: f64| slope_std(std, 1, series.step_s());
        let of_pressure = of_slope(sensors.pressure.noise_std);
        let noise = Signals {
            v_mps: of_slope(sensors.position.noise_std),
            dpa_pas: of_pressure,
            dpb_pas: of_pressure,
            qa_m3s: sensors.flow_a.noise_std,
            qb_m3s: sensors.flow_b.noise_std,
            ..Signals::default()
        };
        Self { series, residual, effects, calm: qa.into_iter().zip(qb).map(calm).collect(), noise }
    }

    /// Where in its meter's dead band the flow of a chamber would lie.
    pub fn within_band(&self, own: &Chamber, other: &Chamber) -> Sides {
        let flows = |of: &dyn Fn(usize) -> f64| (0..self.series.len()).map(of).collect::<Vec<f64>>();
        let (calm, raw) = (
            flows(&|at| (own.flow_m3s)(&self.calm[at])),
            flows(&|at| (own.flow_m3s)(&shown(self.series, at))),
        );
        let by_meter = |reading: &Signals<f64>| self.by_meter(own, other, reading);
        let by_position = |reading: &Signals<f64>| self.at_speed(own, self.effects.correct(reading));
        let beside = [
            Beside {
                flow_m3s: &|at| by_meter(&self.reading(at)),
                is_silent: &|at| is_silent((other.flow_m3s)(&self.calm[at]), (other.flow_m3s)(&self.noise)),
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
            flow_m3s: &raw,
            calm_m3s: &calm,
            noise_std_m3s: (own.flow_m3s)(&self.noise),
            mean_of: self.series.merged + 1,
        };
        within_band(&meter, &beside)
    }

    /// What the sensors show at a sample and its neighbours.
    fn reading(&self, at: usize) -> Signals<f64> {
        let rate = |values: &[f64]| slope(&self.series.t_s, values, 1, at);
        let Signals { qa_m3s, qb_m3s, .. } = self.calm[at];
        Signals {
            v_mps: rate(&self.series.x_m),
            dpa_pas: rate(&self.series.pa_pa),
            dpb_pas: rate(&self.series.pb_pa),
            qa_m3s,
            qb_m3s,
            ..shown(self.series, at)
        }
    }

    /// The flow at which nothing is left of its chamber's equation, at the speed at which nothing is left of the other's.
    fn by_meter(&self, own: &Chamber, other: &Chamber, reading: &Signals<f64>) -> f64 {
        let seen = self.effects.correct(reading);
        let left = |v_mps: f64| (other.left_m3s)((self.residual)(seen.t_s, &Signals { v_mps, ..seen }));
        self.at_speed(own, Signals { v_mps: zero_of_line(left(0.0), left(1.0)), ..seen })
    }

    fn at_speed(&self, own: &Chamber, seen: Signals<f64>) -> f64 {
        let left =
            |flow_m3s: f64| (own.left_m3s)((self.residual)(seen.t_s, &(own.with_flow)(seen, flow_m3s)));
        zero_of_line(left(0.0), left(1.0))
    }

    /// What the readings' noise makes of a flow that is foreseen, standard deviation; NaN where no sample has all that it needs.
    fn std(&self, flow_m3s: impl Fn(&Signals<f64>) -> f64) -> f64 {
        // The middle of the stroke is likelier in the middle of a trace than at its begin.
        let (middle, count) = (self.series.len() / 2, self.series.len());
        let mut readings = (middle..count).chain(0..middle).map(|at| self.reading(at));
        let Some(read) = readings.find(|reading| flow_m3s(reading).is_finite()) else {
            return f64::NAN;
        };
        let (own, noise) = (flow_m3s(&read), &self.noise);
        let shifted = [
            Signals { qa_m3s: read.qa_m3s + noise.qa_m3s, qb_m3s: read.qb_m3s + noise.qb_m3s, ..read },
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
