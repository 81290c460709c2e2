//! Pressures that stand still: what varies of them within their sensors' noise is that noise.
//!
//! At rest a leak's column C P is a constant and noise. Taken off in closed form, that noise leaves a power that is zero but for
//! chance, and what divides by it is any number: a flow that changed by 0.5 L/min was called two leaks of 28 and 22 L/min. So a
//! pressure that varies no more than its noise does is its mean, segment by segment: then it tells a leak from nothing that is
//! constant as well, and from nothing else.

use super::evidence::chance_of_mean_square;
use super::raw_products::SegmentProducts;
use pitchleak_core::continuity::{COLUMNS, RawSum, column as place_of};

/// A quantity that may stand still: combinations of the pressures' integrals, and what stands still with it.
struct Quantity {
    /// P_A's and P_B's share in it.
    of: [f64; 2],
    /// Integrals that become a mean times `Time` or `AgedTime`, each with that.
    means: &'static [(RawSum, RawSum)],
}

const A: Quantity = Quantity {
    of: [1.0, 0.0],
    means: &[
        (RawSum::PressureA, RawSum::Time),
        (RawSum::AgedPressureA, RawSum::AgedTime),
        (RawSum::RootA, RawSum::Time),
    ],
};
const B: Quantity = Quantity {
    of: [0.0, 1.0],
    means: &[
        (RawSum::PressureB, RawSum::Time),
        (RawSum::AgedPressureB, RawSum::AgedTime),
        (RawSum::RootB, RawSum::Time),
    ],
};
const LOAD: Quantity = Quantity { of: [1.0, -1.0], means: &[(RawSum::RootInternal, RawSum::Time)] };

/// What a column truly is: others, each times a factor.
type Truly = Vec<(usize, f64)>;

/// Puts means in the place of what stands still.
pub(super) fn settle(segments: &mut [SegmentProducts]) {
    let still = [A, B, LOAD].map(|quantity| is_still(segments, &quantity).then_some(quantity));
    let [a, b, load] = still;
    // Where the pressures move together, B is A less the load's mean.
    let together = load.is_some() && a.is_none() && b.is_none();
    for segment in segments {
        for equation in 0..segment.gram.len() {
            for chamber in 0..2 {
                let gram = segment.gram[equation].clone();
                let mut maps: Vec<(usize, Truly)> = Vec::new();
                for quantity in [&a, &b, &load].into_iter().flatten() {
                    maps.extend(quantity.means.iter().map(|(raw, time)| mean(&gram, *raw, *time, chamber)));
                }
                if together {
                    use RawSum::{AgedPressureA, AgedPressureB, AgedTime, PressureA, PressureB, Time};
                    for (one, other, time) in
                        [(PressureB, PressureA, Time), (AgedPressureB, AgedPressureA, AgedTime)]
                    {
                        let (place, less) = less_mean(&gram, one, other, time, chamber);
                        maps.push((place, less));
                    }
                }
                for products in [
                    &mut segment.gram[equation],
                    &mut segment.noise[equation],
                    &mut segment.scattered[equation],
                    &mut segment.quiet[equation],
                ] {
                    maps.iter().for_each(|(place, truly)| replace(products, *place, truly));
                }
            }
        }
    }
}

/// Whether the variance of a quantity within the segments is its noise's, as the readings scatter.
fn is_still(segments: &[SegmentProducts], quantity: &Quantity) -> bool {
    let (mut power, mut noise, mut rows) = (0.0, 0.0, 0.0);
    for segment in segments {
        for equation in 0..segment.gram.len() {
            rows += segment.rows[equation];
            for chamber in 0..2 {
                let (gram, scatter) = (&segment.gram[equation], &segment.scattered[equation]);
                let time = place_of(RawSum::Time, chamber);
                let of_time = product_with(gram, quantity, chamber, time);
                let time_square = gram[time * COLUMNS + time];
                if time_square > 0.0 {
                    power += square(gram, quantity, chamber) - of_time * of_time / time_square;
                    noise += square(scatter, quantity, chamber);
                }
            }
        }
    }
    rows > 0.0 && power < noise * (1.0 + chance_of_mean_square(rows))
}

const PRESSURES: [RawSum; 2] = [RawSum::PressureA, RawSum::PressureB];

fn product_with(products: &[f64], quantity: &Quantity, chamber: usize, other: usize) -> f64 {
    let of = |(raw, share): (RawSum, f64)| share * products[place_of(raw, chamber) * COLUMNS + other];
    PRESSURES.into_iter().zip(quantity.of).map(of).sum()
}

fn square(products: &[f64], quantity: &Quantity, chamber: usize) -> f64 {
    let of = |(raw, share): (RawSum, f64)| {
        share * product_with(products, quantity, chamber, place_of(raw, chamber))
    };
    PRESSURES.into_iter().zip(quantity.of).map(of).sum()
}

/// An integral as its mean times the integral of time.
fn mean(gram: &[f64], raw: RawSum, time: RawSum, chamber: usize) -> (usize, Truly) {
    let (place, time) = (place_of(raw, chamber), place_of(time, chamber));
    (place, vec![(time, ratio(gram[place * COLUMNS + time], gram[time * COLUMNS + time]))])
}

/// An integral as another one less the mean of what parts them.
fn less_mean(gram: &[f64], raw: RawSum, other: RawSum, time: RawSum, chamber: usize) -> (usize, Truly) {
    let [place, other, time] = [raw, other, time].map(|sum| place_of(sum, chamber));
    let apart = gram[other * COLUMNS + time] - gram[place * COLUMNS + time];
    (place, vec![(other, 1.0), (time, -ratio(apart, gram[time * COLUMNS + time]))])
}

fn ratio(product: f64, square: f64) -> f64 {
    if square > 0.0 { product / square } else { 0.0 }
}

/// Puts a combination of other columns in a column's place.
fn replace(products: &mut [f64], place: usize, truly: &Truly) {
    for other in 0..COLUMNS {
        products[place * COLUMNS + other] =
            truly.iter().map(|(column, by)| by * products[column * COLUMNS + other]).sum();
    }
    for other in 0..COLUMNS {
        products[other * COLUMNS + place] =
            truly.iter().map(|(column, by)| by * products[other * COLUMNS + column]).sum();
    }
}

#[cfg(test)]
mod tests {
    use super::super::raw_products::tests::{at_rest, rig};
    use super::*;
    use pitchleak_core::PerLeak;

    const SWING_PA: f64 = 5e5;

    /// Each column of a pressure in chamber A's equation: how much of its power its mean leaves, and its
    /// noise.
    fn left(pressures_pa: impl Fn(f64) -> [f64; 2]) -> [(f64, f64); 2] {
        let segments = at_rest(&rig(), 3, pressures_pa).segments;
        PRESSURES.map(|raw| {
            let (place, time) = (place_of(raw, 0), place_of(RawSum::Time, 0));
            let of = |products: &[f64], i: usize, j: usize| products[i * COLUMNS + j];
            let powers = segments.iter().map(|own| {
                let gram = &own.gram[1];
                of(gram, place, place) - of(gram, place, time).powi(2) / of(gram, time, time)
            });
            (powers.sum(), segments.iter().map(|own| of(&own.noise[1], place, place)).sum())
        })
    }

    /// What varies by no more than its noise is its mean, and has no noise; what swings stays as it was read.
    #[test]
    fn a_pressure_that_stands_still_is_its_mean() {
        let swing = |t_s: f64| SWING_PA * (3.0 * t_s).sin();
        let [still_a, still_b] = left(|_| [5e6, 3e6]);
        let [moving_a, beside] = left(|t_s| [5e6 + swing(t_s), 3e6]);
        for (power, noise) in [still_a, still_b, beside] {
            assert!(power.abs() < 1e-6 * moving_a.0 && noise == 0.0, "{power} {noise}");
        }
        assert!(moving_a.0 > 0.0 && moving_a.1 > 0.0);
        // Swinging together they differ by the load's mean: B is A less that, noise and all.
        let [one, other] = left(|t_s| [5e6 + swing(t_s), 3e6 + swing(t_s)]);
        assert!((one.0 / other.0 - 1.0).abs() < 1e-6 && (one.1 / other.1 - 1.0).abs() < 1e-6);
        let [one, other] = left(|t_s| [5e6 + swing(t_s), 3e6 - swing(t_s)]);
        assert!((one.1 / other.1 - 1.0).abs() < 0.1 && (one.0 / other.0 - 1.0).abs() > 1e-6);
    }

    /// Means stay as they are: of a pressure, of the load's root, in each segment.
    #[test]
    fn settled_sums_keep_their_means() {
        let products = at_rest(&rig(), 3, |_| [5e6, 3e6]);
        let PerLeak { external_a, external_b, .. } = products.segments[0].pressures_pa;
        for segment in &products.segments {
            let time = place_of(RawSum::Time, 0);
            let mean = |raw: RawSum| {
                segment.gram[1][place_of(raw, 0) * COLUMNS + time] / segment.gram[1][time * COLUMNS + time]
            };
            assert!((1e6 * mean(RawSum::PressureA) / external_a - 1.0).abs() < 1e-2);
            assert!((1e6 * mean(RawSum::PressureB) / external_b - 1.0).abs() < 1e-2);
            assert!((mean(RawSum::RootInternal) / 2e6_f64.sqrt() - 1.0).abs() < 1e-2);
        }
    }
}
