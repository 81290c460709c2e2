//! The residuals of several traces on one axis.

/// A step so many times the usual one is a pause.
const PAUSE: f64 = 5.0;

/// One trace after the other: each begins where the one before ended. Where one ends, or pauses, a point without a value
/// breaks the line.
pub(crate) fn in_a_row(points: &[(f64, f64)]) -> Vec<(f64, f64)> {
    let mut steps: Vec<f64> =
        points.windows(2).filter_map(|pair| Some(pair.last()?.0 - pair.first()?.0)).collect();
    steps.retain(|step| *step > 0.0);
    steps.sort_by(f64::total_cmp);
    let usual = steps.get(steps.len() / 2).copied().unwrap_or(f64::INFINITY);
    let (mut row, mut start, mut last) = (Vec::with_capacity(points.len()), 0.0, None);
    for &(t, value) in points {
        if let Some(last) = last {
            let step = t - last;
            if step < 0.0 {
                start += last;
            }
            if step < 0.0 || step > PAUSE * usual {
                row.push((start + t - usual.min(0.5 * t.max(0.0)), f64::NAN));
            }
        }
        row.push((start + t, value));
        last = Some(t);
    }
    row
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_breaks_where_a_trace_pauses_and_between_traces() {
        let seconds = |from: u32, to: u32| (from..to).map(|t| (f64::from(t), 1.0));
        let points: Vec<_> = seconds(0, 10).chain(seconds(60, 70)).chain(seconds(1, 10)).collect();
        let row = in_a_row(&points);
        let breaks: Vec<_> = row.iter().filter(|point| point.1.is_nan()).map(|point| point.0).collect();
        assert_eq!(breaks, [59.0, 69.5]);
        assert!(row.windows(2).all(|pair| pair[0].0 < pair[1].0), "{row:?}");
        assert_eq!(row.last(), Some(&(78.0, 1.0)));
    }
}
