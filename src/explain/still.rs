//! Pressures that stand still: what varies of them within their sensors' noise is that noise.
//!
//! At rest a leak's column C P is a constant and noise. Taken off in closed form, that noise leaves a power that is zero but for
//! chance, and what divides by it is any number: a flow that changed by 0.5 L/min was called two leaks of 28 and 22 L/min. So a
//! pressure that varies no more than its noise does is its mean, segment by segment: then it tells a leak from nothing that is
//! constant as well, and from nothing else.

//!
//! Of the flows' changes the same holds: where what flows into one chamber flows out of the other, so that what is left of both is
//! their noise, each is the other's opposite. Else two lags that nearly make each other up divide by it: a lag of 50 ms was one of 5 s.

use super::evidence::chance_of_mean_square;
use super::raw_products::SegmentProducts;
use pitchleak_core::continuity::{COLUMNS, EQUATIONS, RawSum, column as place_of};

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
    set_opposite(segments);
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
                for products in segment.products_mut(equation) {
                    maps.iter().for_each(|(place, truly)| replace(products, *place, truly));
                }
            }
        }
    }
}

/// Makes each flow's change the other's opposite where they are that but for noise.
fn set_opposite(segments: &mut [SegmentProducts]) {
    let [flow_a, flow_b] = FLOW_CHANGES;
    for equation in 0..EQUATIONS {
        if are_opposite(segments, equation) {
            for products in segments.iter_mut().flat_map(|segment| segment.products_mut(equation)) {
                replace(products, flow_a, &[(flow_a, 0.5), (flow_b, -0.5)]);
                replace(products, flow_b, &[(flow_a, -1.0)]);
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
    is_noise(power, noise, rows)
}

/// Whether a power over so many rows is their noise's, but for chance.
fn is_noise(power: f64, noise: f64, rows: f64) -> bool {
    rows > 0.0 && power < noise * (1.0 + chance_of_mean_square(rows))
}

/// Q_A's change in the equation of A, and Q_B's in that of B.
const FLOW_CHANGES: [usize; 2] = [place_of(RawSum::FlowChangeA, 0), place_of(RawSum::FlowChangeB, 1)];

/// Whether the sum of both flows' changes is their noise, in this equation.
fn are_opposite(segments: &[SegmentProducts], equation: usize) -> bool {
    let square_of_sum = |products: &[f64]| -> f64 {
        FLOW_CHANGES.iter().flat_map(|i| FLOW_CHANGES.map(|j| products[i * COLUMNS + j])).sum()
    };
    let rows: f64 = segments.iter().map(|segment| segment.rows[equation]).sum();
    let power: f64 = segments.iter().map(|segment| square_of_sum(&segment.gram[equation])).sum();
    let noise: f64 = segments.iter().map(|segment| square_of_sum(&segment.scattered[equation])).sum();
    is_noise(power, noise, rows)
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
fn replace(products: &mut [f64], place: usize, truly: &[(usize, f64)]) {
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
    use super::*;
    use pitchleak_core::PerLeak;

    const ROWS: f64 = 500.0;

    /// A segment in whose balance both flows' changes have this power, and their sum another; of noise 1 each row.
    fn segment(power: f64, of_sum: f64) -> SegmentProducts {
        let empty = || vec![0.0; COLUMNS * COLUMNS];
        let [a, b] = FLOW_CHANGES;
        let (mut gram, mut noise) = ([empty(), empty()], [empty(), empty()]);
        for (i, j) in [(a, a), (b, b)] {
            (gram[0][i * COLUMNS + j], noise[0][i * COLUMNS + j]) = (power, 0.5 * ROWS);
        }
        (gram[0][a * COLUMNS + b], gram[0][b * COLUMNS + a]) = (0.5 * of_sum - power, 0.5 * of_sum - power);
        SegmentProducts {
            gram,
            scattered: noise.clone(),
            quiet: noise.clone(),
            noise,
            rows: [ROWS, 0.0],
            begin_s: 0.0,
            time_s: 60.0,
            pressures_pa: PerLeak::default(),
        }
    }

    #[test]
    fn flows_whose_sum_is_noise_are_each_the_others_opposite() {
        let [a, b] = FLOW_CHANGES;
        for (of_sum, is_noise) in [(1.1 * ROWS, true), (0.8 * ROWS, true), (2.0 * ROWS, false)] {
            let mut segments = [segment(1e6, of_sum)];
            settle(&mut segments);
            let of = |products: &[f64]| [products[a * COLUMNS + a], products[a * COLUMNS + b]];
            let [own, both] = of(&segments[0].gram[0]);
            assert!((own / 1e6 - 1.0).abs() < 1e-3, "{own}");
            assert_eq!((own + both).abs() < 1e-6, is_noise, "{of_sum}: {own} {both}");
            let [own, both] = of(&segments[0].noise[0]);
            assert_eq!((own + both).abs() < 1e-9, is_noise, "{of_sum}: {own} {both}");
        }
    }
}
