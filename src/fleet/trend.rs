//! A leak's course over the traces of days and months.

use super::{FleetCylinder, FleetRow};
use crate::report::{LeakTrend, with_interval};
use crate::units::S_PER_DAY;
use jiff::Timestamp;
use nalgebra::{SMatrix, SVector};
use pitchleak_core::{Estimate, Leak, PerLeak};
use serde::Serialize;
use statrs::distribution::{ContinuousCDF, StudentsT};

const H_PER_MONTH: f64 = 24.0 * 30.0;

/// How the leaks of a cylinder change from trace to trace.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CylinderTrend {
    /// Which cylinder.
    pub cylinder: String,
    /// None for a leak that fewer than three dated traces pin down without doubt.
    pub leaks: PerLeak<Option<LongTrend>>,
}

/// A straight line through the flows of one leak.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct LongTrend {
    /// Traces that it rests on.
    pub traces: usize,
    /// Middle of the first trace.
    pub from: Timestamp,
    /// Middle of the last trace.
    pub to: Timestamp,
    /// The line's flow at the last trace, L/min.
    pub mean_lpm: f64,
    /// Standard deviation of its error, L/min.
    pub std_lpm: f64,
    /// How much the flows scatter about the line beyond their own standard deviations, L/min: temperature, load, …
    pub scatter_lpm: f64,
    /// The slope, and when the line is at the alarm's threshold, from the last trace on.
    #[serde(flatten)]
    pub trend: LeakTrend,
}

/// One trace's flow of one leak, L/min.
pub struct Point {
    /// When.
    pub at: Timestamp,
    /// The leak, L/min.
    pub flow: Estimate<f64>,
    /// Its alarm level, L/min.
    pub threshold_lpm: f64,
}

impl CylinderTrend {
    /// Those of every cylinder that has one, in the order in which the cylinders come.
    pub(super) fn all(cylinders: &[FleetCylinder]) -> Vec<Self> {
        let mut order: Vec<_> = cylinders.iter().collect();
        order.sort_by_key(|cylinder| cylinder.rows.iter().min());
        let trend = |cylinder: &FleetCylinder| {
            let leaks = PerLeak::from_fn(|leak| cylinder.leaks[leak].trend);
            let any = leaks.iter().any(|(_, trend)| trend.is_some());
            any.then(|| Self { cylinder: cylinder.cylinder.clone(), leaks })
        };
        order.into_iter().filter_map(trend).collect()
    }
}

impl LongTrend {
    /// Whether the leak grows, with 95 % probability.
    pub fn grows(&self) -> bool {
        self.trend.is_significant() && self.trend.slope_lpm_per_h > 0.0
    }

    /// The slope, L/min a month of 30 days.
    pub(crate) fn monthly_lpm(&self) -> Estimate<f64> {
        self.trend.slope().scaled(H_PER_MONTH)
    }

    /// How fast the leak grows, and when it is at its alarm's threshold if it goes on like this, for people.
    pub fn rate(&self) -> String {
        let Estimate { value, std } = self.monthly_lpm();
        let reached = self.trend.reaches_threshold_in_s.map_or_else(String::new, |time| {
            let [days, low, high] = [time.value, time.ci95[0], time.ci95[1]].map(|s| (s / S_PER_DAY).round());
            let when = match days {
                ..1.0 => "within a day".to_owned(),
                1.0 => "in 1 day".to_owned(),
                days => format!("in {days} days"),
            };
            let interval = if high < 1.0 { String::new() } else { format!(" ({low} to {high})") };
            format!("; at its alarm level {when}{interval}")
        });
        format!("{} L/min a month over {} traces{reached}", with_interval(value, Some(std)), self.traces)
    }

    /// Of one cylinder's traces. Those whose verdict is doubtful are left out: their figures can't be believed.
    pub(super) fn of<'a>(rows: impl Iterator<Item = &'a FleetRow>, leak: Leak) -> Option<Self> {
        let mut points: Vec<_> = rows.filter_map(|row| Point::of(row, leak)).collect();
        points.sort_by_key(|point| point.at);
        let (first, last) = (points.first()?, points.last()?);
        let days = |point: &Point| last.at.duration_until(point.at).as_secs_f64() / S_PER_DAY;
        let values: Vec<_> = points.iter().map(|point| (days(point), point.flow)).collect();
        let line = Line::through(&values)?;
        let slope_ps = line.slope.scaled(1.0 / S_PER_DAY);
        Some(Self {
            traces: points.len(),
            from: first.at,
            to: last.at,
            mean_lpm: line.level.value,
            std_lpm: line.level.std,
            scatter_lpm: line.scatter,
            trend: LeakTrend::new(line.level, slope_ps, last.threshold_lpm)?,
        })
    }
}

impl Point {
    /// None where the row tells nothing of this leak, or not when.
    pub fn of(row: &FleetRow, leak: Leak) -> Option<Self> {
        let flow = row.estimate(leak)?;
        let half = jiff::SignedDuration::try_from_secs_f64(row.duration_s? / 2.0).ok()?;
        let at = row.begins?.checked_add(half).ok()?;
        Some(Self { at, flow, threshold_lpm: row.leaks?[leak].threshold_lpm })
    }
}

/// y = level + slope·t.
struct Line {
    level: Estimate<f64>,
    slope: Estimate<f64>,
    scatter: f64,
}

/// A flow, and the numbers by which it is the sum of `N` unknowns.
type Term<const N: usize> = (SVector<f64, N>, Estimate<f64>);

/// A least-squares fit of flows.
pub(super) struct Fit<const N: usize> {
    /// The unknowns.
    pub unknowns: SVector<f64, N>,
    /// Their covariance, were each flow's variance the one that it was weighted by.
    pub covariance: SMatrix<f64, N, N>,
    /// Weighted sum of the squares of what the flows differ from the fit.
    residual: f64,
    /// Weights times what is not leverage.
    free_weight: f64,
}

impl<const N: usize> Fit<N> {
    /// Variances of unknowns so many times those that each had alone tell nothing of them: traces of one moment have no slope.
    const MOST_INFLATION: f64 = 1e9;

    /// Weighted by the inverse of each flow's own variance plus `scatter`.
    fn of(flows: &[Term<N>], scatter: f64) -> Option<Self> {
        let weighed = || flows.iter().map(|(x, y)| (x, y.value, (y.std.powi(2) + scatter).recip()));
        let normal: SMatrix<f64, N, N> = weighed().map(|(x, _, w)| w * x * x.transpose()).sum();
        let right: SVector<f64, N> = weighed().map(|(x, y, w)| w * y * x).sum();
        let covariance = normal.try_inverse()?;
        let inflation = covariance.diagonal().component_mul(&normal.diagonal());
        if !inflation.iter().all(|inflation| *inflation < Self::MOST_INFLATION) {
            return None;
        }
        let unknowns = covariance * right;
        let residual = weighed().map(|(x, y, w)| w * (y - x.dot(&unknowns)).powi(2)).sum();
        let free_weight = weighed().map(|(x, _, w)| w * (1.0 - w * x.dot(&(covariance * x)))).sum();
        Some(Self { unknowns, covariance, residual, free_weight })
    }
}

impl Line {
    /// Regression with a scatter between traces beside their own errors; 1.96 of its standard deviations are the half of
    /// the 95 % interval.
    fn through(points: &[(f64, Estimate<f64>)]) -> Option<Self> {
        let points = points.iter().map(|(t, y)| (SVector::from([1.0, *t]), *y)).collect();
        let scattered = Scattered::of(&[points])?;
        let [Fit { unknowns, covariance, .. }] = &scattered.fits[..] else { return None };
        let inflation = scattered.inflation.sqrt() * scattered.width();
        let std = covariance.diagonal().map(|variance| variance.sqrt() * inflation);
        let [level, slope] = [0, 1].map(|at| Estimate { value: unknowns[at], std: std[at] });
        Some(Self { level, slope, scatter: scattered.variance.sqrt() })
    }
}

/// Weighted fits of groups of flows with one scatter between traces beside the flows' own errors.
///
/// The scatter's variance is by moments (DerSimonian & Laird 1986, "Meta-analysis in clinical trials"), the intervals by
/// Student's t and the weighted residual, never below 1 (Knapp & Hartung 2003, "Improved tests for a random effects
/// meta-regression with a single covariate").
pub(super) struct Scattered<const N: usize> {
    /// Of each group.
    pub fits: Vec<Fit<N>>,
    /// Factor of their variances, by the weighted residual.
    pub inflation: f64,
    /// Between traces.
    variance: f64,
    student: StudentsT,
}

impl<const N: usize> Scattered<N> {
    /// None where no flow is left beside the unknowns: then nobody knows what traces scatter.
    pub fn of(groups: &[Vec<Term<N>>]) -> Option<Self> {
        let freedom = groups.iter().map(|group| group.len().checked_sub(N)).sum::<Option<usize>>()? as f64;
        let student = StudentsT::new(0.0, 1.0, freedom).ok()?;
        let fits =
            |scatter: f64| groups.iter().map(|group| Fit::of(group, scatter)).collect::<Option<Vec<_>>>();
        let sum = |fits: &[Fit<N>], of: fn(&Fit<N>) -> f64| fits.iter().map(of).sum::<f64>();
        let own = fits(0.0)?;
        let excess = sum(&own, |fit| fit.residual) - freedom;
        let variance = (excess / sum(&own, |fit| fit.free_weight)).max(0.0);
        let fits = fits(variance)?;
        let inflation = (sum(&fits, |fit| fit.residual) / freedom).max(1.0);
        Some(Self { fits, inflation, variance, student })
    }

    /// Factor of standard deviations such that 1.96 of them are the half of the 95 % interval.
    pub fn width(&self) -> f64 {
        self.student.inverse_cdf(0.975) / Estimate { value: 0.0, std: 1.0 }.half_width95()
    }

    /// How probable it is that chance alone is above so many standard deviations.
    pub fn chance(&self, deviations: f64) -> f64 {
        self.student.sf(deviations)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::ReachTime;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};

    fn days(count: usize, slope: f64, scatter: f64, rng: &mut ChaCha8Rng) -> Vec<(f64, Estimate<f64>)> {
        let mut normal = || -> f64 { StandardNormal.sample(rng) };
        let day = |k: usize| {
            let std = 0.002 + 0.001 * (k % 3) as f64;
            let t = k as f64 - (count - 1) as f64;
            (t, Estimate { value: 0.05 + slope * t + scatter * normal() + std * normal(), std })
        };
        (0..count).map(day).collect()
    }

    #[test]
    fn an_exact_line_is_found() {
        let points: Vec<_> = (0..5)
            .map(|k| {
                (f64::from(k), Estimate { value: 0.1 + 0.01 * f64::from(k), std: 0.001 * f64::from(k + 1) })
            })
            .collect();
        let line = Line::through(&points).unwrap();
        assert!((line.slope.value - 0.01).abs() < 1e-12 && (line.level.value - 0.1).abs() < 1e-12);
        assert!(line.scatter.abs() < 1e-12);
    }

    #[test]
    fn the_time_to_an_alarm_is_told_in_days_as_people_count_them() {
        let moment = Timestamp::UNIX_EPOCH;
        let told = |days: [f64; 3]| {
            let [value, low, high] = days.map(|days| days * S_PER_DAY);
            let reached = ReachTime { value, ci95: [low, high] };
            let trend = LeakTrend {
                slope_lpm_per_h: 1e-4,
                std: 1e-5,
                reaches_threshold_in_s: Some(reached),
                oil: None,
            };
            let line = LongTrend {
                traces: 3,
                from: moment,
                to: moment,
                mean_lpm: 0.1,
                std_lpm: 0.0,
                scatter_lpm: 0.0,
                trend,
            };
            line.rate().split_once("level ").unwrap().1.to_owned()
        };
        assert_eq!(told([69.7, 55.2, 92.4]), "in 70 days (55 to 92)");
        assert_eq!(told([1.2, 0.8, 2.3]), "in 1 day (1 to 2)");
        assert_eq!(told([0.4, 0.1, 2.0]), "within a day (0 to 2)");
        assert_eq!(told([0.1, 0.0, 0.2]), "within a day");
    }

    #[test]
    fn two_traces_or_one_moment_have_no_trend() {
        let point = |t| (t, Estimate { value: 0.1, std: 0.01 });
        assert!(Line::through(&[point(0.0), point(1.0)]).is_none());
        assert!(Line::through(&[point(1.0), point(1.0), point(1.0)]).is_none());
    }

    #[test]
    fn the_interval_of_the_slope_holds_it_whatever_the_traces_scatter_and_however_few_they_are() {
        let mut rng = ChaCha8Rng::seed_from_u64(7);
        for (count, scatter) in [(4, 0.0), (4, 0.02), (10, 0.01), (60, 0.0), (60, 0.02)] {
            let runs = 400;
            let mut held = 0;
            for _ in 0..runs {
                let line = Line::through(&days(count, 0.001, scatter, &mut rng)).unwrap();
                held += u32::from((line.slope.value - 0.001).abs() < line.slope.half_width95());
            }
            // 95 % less three standard deviations of the count.
            assert!(held >= 367, "{count} traces, scatter {scatter}: {held} of {runs}");
        }
    }

    #[test]
    fn the_scatter_between_traces_is_found() {
        let mut rng = ChaCha8Rng::seed_from_u64(8);
        let line = Line::through(&days(200, 0.001, 0.02, &mut rng)).unwrap();
        assert!((0.017..0.023).contains(&line.scatter), "{}", line.scatter);
    }
}
