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
