//! Curves through samples: what the emulator follows between the points of a history.

/// A curve through samples at increasing times, by cubic Hermite pieces whose slopes are the
/// three-point differences at the samples (Fritsch and Carlson 1980, eq. 1, without their limiter).
///
/// It passes through every sample, its slope is continuous and it errs by O(h³) between samples;
/// before the first and after the last sample it keeps their value. One sample makes a constant.
#[derive(Clone, Debug, PartialEq)]
pub struct Curve {
    points: Vec<Point>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct Point {
    t: f64,
    value: f64,
    slope: f64,
}

/// Why samples make no curve. Samples count from 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum CurveError {
    /// There is no sample at all.
    #[error("there is no sample")]
    Empty,
    /// A time or a value is not a finite number.
    #[error("sample {0} is not a finite number")]
    NotFinite(usize),
    /// A time does not exceed the one before it.
    #[error("time does not increase at sample {0}")]
    Time(usize),
}

impl Curve {
    /// The curve that has `value` everywhere.
    pub fn constant(value: f64) -> Self {
        Self { points: vec![Point { t: 0.0, value, slope: 0.0 }] }
    }

    /// The curve through `values` at the times `t_s`; the longer of the two is cut.
    ///
    /// # Errors
    /// [`CurveError`] names the first sample that does not fit.
    pub fn through(t_s: &[f64], values: &[f64]) -> Result<Self, CurveError> {
        let mut points: Vec<Point> =
            t_s.iter().zip(values).map(|(&t, &value)| Point { t, value, slope: 0.0 }).collect();
        if points.is_empty() {
            return Err(CurveError::Empty);
        }
        if let Some(bad) = points.iter().position(|p| !p.t.is_finite() || !p.value.is_finite()) {
            return Err(CurveError::NotFinite(bad));
        }
        if let Some(before) = points.windows(2).position(|pair| pair[1].t <= pair[0].t) {
            return Err(CurveError::Time(before + 1));
        }
        for k in 1..points.len().saturating_sub(1) {
            points[k].slope = three_point_slope(points[k - 1], points[k], points[k + 1]);
        }
        Ok(Self { points })
    }

    /// Times of the first and the last sample.
    pub fn span_s(&self) -> (f64, f64) {
        match (self.points.first(), self.points.last()) {
            (Some(first), Some(last)) => (first.t, last.t),
            _ => (0.0, 0.0),
        }
    }

    /// The value at time `t_s`.
    pub fn at(&self, t_s: f64) -> f64 {
        let next = self.points.partition_point(|p| p.t <= t_s);
        match (next.checked_sub(1).and_then(|k| self.points.get(k)), self.points.get(next)) {
            (Some(a), Some(b)) => hermite(*a, *b, t_s),
            (Some(only), None) | (None, Some(only)) => only.value,
            (None, None) => 0.0,
        }
    }
}

/// Slope at `b` of the parabola through three points.
fn three_point_slope(a: Point, b: Point, c: Point) -> f64 {
    let (left, right) = (b.t - a.t, c.t - b.t);
    let (before, after) = ((b.value - a.value) / left, (c.value - b.value) / right);
    (right * before + left * after) / (left + right)
}

fn hermite(a: Point, b: Point, t: f64) -> f64 {
    let width = b.t - a.t;
    let s = (t - a.t) / width;
    let rise = s * s * (3.0 - 2.0 * s);
    let r = 1.0 - s;
    a.value + (b.value - a.value) * rise + width * s * r * (a.slope * r - b.slope * s)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn passes_through_samples_and_holds_its_ends() {
        let curve = Curve::through(&[0.0, 1.0, 3.0], &[2.0, -1.0, 5.0]).expect("a curve");
        let at: Vec<f64> = [-1.0, 0.0, 1.0, 3.0, 9.0].iter().map(|&t| curve.at(t)).collect();
        assert_eq!(at, [2.0, 2.0, -1.0, 5.0, 5.0]);
    }

    #[test]
    fn error_falls_with_the_third_power_of_the_step() {
        let worst = |n: i32| {
            let t: Vec<f64> = (0..=n).map(|k| 6.0 * f64::from(k) / f64::from(n)).collect();
            let y: Vec<f64> = t.iter().map(|t| t.sin()).collect();
            let curve = Curve::through(&t, &y).expect("a curve");
            (100..500)
                .map(f64::from)
                .map(|k| (curve.at(0.01 * k) - (0.01 * k).sin()).abs())
                .fold(0.0, f64::max)
        };
        assert!(worst(100) / worst(200) > 7.0);
    }

    #[test]
    fn bad_samples_are_named() {
        assert_eq!(Curve::through(&[], &[]), Err(CurveError::Empty));
        assert_eq!(Curve::through(&[0.0, 1.0], &[0.0, f64::NAN]), Err(CurveError::NotFinite(1)));
        assert_eq!(Curve::through(&[0.0, 0.0], &[0.0, 1.0]), Err(CurveError::Time(1)));
    }
}
