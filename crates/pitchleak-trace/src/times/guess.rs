//! Which format the cells of a column have, where they leave no doubt.

use super::civil::{open_order, plain_order};
use super::{DateOrder, TimeFormat, TimeKind};
use crate::header::shorten;

/// Why the cells of a column do not say how they are to be read.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum TimeFault {
    /// 03/04/2026.
    #[error("`{0}` may be day/month or month/day")]
    DayOrMonth(String),
    /// Neither can be all of them.
    #[error("`{day_first}` is day/month and `{month_first}` month/day: no one order fits")]
    BothOrders {
        /// A date with a day above 12 first.
        day_first: String,
        /// A date with a day above 12 second.
        month_first: String,
    },
    /// A number that no epoch and no serial number has.
    #[error("`{0}` is a number that says neither its unit nor its epoch")]
    BareNumber(String),
    /// Nothing known.
    #[error("`{0}` is no time in a known format")]
    Unknown(String),
}

/// So much of the cells must fit: a few may be bad.
const MOST: f64 = 0.8;
/// Steps of a serial number are below this, days (4 s); those of seconds above.
const LONGEST_SERIAL_STEP: f64 = 5e-5;

/// The format of a column's first cells, none of which is empty.
///
/// # Errors
/// Where they do not say it.
pub fn guess(cells: &[&str]) -> Result<TimeFormat, TimeFault> {
    let kind = number(cells)
        .or_else(|| first_that_fits(cells).map(Ok))
        .or_else(|| date_order(cells))
        .unwrap_or_else(|| Err(TimeFault::Unknown(sample(cells))))?;
    Ok(TimeFormat { kind, zone: None })
}

fn sample(cells: &[&str]) -> String {
    cells.first().map_or_else(String::new, |cell| shorten(cell, 40))
}

fn fits(cells: &[&str], reads: impl Fn(&str) -> bool) -> bool {
    let good = cells.iter().filter(|cell| reads(cell)).count();
    good > 0 && good as f64 >= MOST * cells.len() as f64
}

fn first_that_fits(cells: &[&str]) -> Option<TimeKind> {
    [TimeKind::Iso, TimeKind::OfDay].into_iter().find(|kind| fits(cells, |cell| kind.read(cell).is_some()))
}

fn number(cells: &[&str]) -> Option<Result<TimeKind, TimeFault>> {
    let value = |cell: &&str| fast_float2::parse::<f64, _>(cell.replace(',', ".").as_bytes()).ok();
    if !fits(cells, |cell| value(&cell).is_some()) {
        return None;
    }
    let values: Vec<f64> = cells.iter().filter_map(value).collect();
    let (least, most) =
        values.iter().fold((f64::MAX, f64::MIN), |(least, most), v| (least.min(*v), most.max(*v)));
    // From 1973 to 2128, in four units that are a thousand apart.
    for unit_ns in [1_000_000_000, 1_000_000, 1_000, 1] {
        let per_s = 1e9 / unit_ns as f64;
        if least > 1e8 * per_s && most < 5e9 * per_s {
            return Some(Ok(TimeKind::Epoch(unit_ns)));
        }
    }
    // From 1954 to 2119.
    let mut steps: Vec<f64> = values
        .windows(2)
        .filter_map(|pair| Some(pair.get(1)? - pair.first()?))
        .filter(|step| *step > 0.0)
        .collect();
    steps.sort_by(f64::total_cmp);
    let step = steps.get(steps.len() / 2);
    if least > 20_000.0 && most < 80_000.0 && step.is_some_and(|step| *step < LONGEST_SERIAL_STEP) {
        return Some(Ok(TimeKind::Excel));
    }
    Some(Err(TimeFault::BareNumber(sample(cells))))
}

fn date_order(cells: &[&str]) -> Option<Result<TimeKind, TimeFault>> {
    if !fits(cells, |cell| open_order(cell).is_some() || plain_order(cell).is_some()) {
        return None;
    }
    let reads = |order| fits(cells, |cell| TimeKind::Date(order).read(cell).is_some());
    if let Some(order) = cells.iter().find_map(|cell| plain_order(cell)) {
        return reads(order).then_some(Ok(TimeKind::Date(order)));
    }
    let above_12 = |place: usize| {
        let number = |cell: &&&str| open_order(cell).and_then(|numbers| numbers.get(place).copied());
        cells.iter().find(|cell| number(cell).is_some_and(|number| (13..=31).contains(&number)))
    };
    let order = match (above_12(0), above_12(1)) {
        (Some(_), None) => DateOrder::DayMonthYear,
        (None, Some(_)) => DateOrder::MonthDayYear,
        (None, None) => match settled_by_midnight(cells) {
            Some(order) => order,
            None => return Some(Err(TimeFault::DayOrMonth(sample(cells)))),
        },
        (Some(day_first), Some(month_first)) => {
            let (day_first, month_first) = (sample(&[day_first]), sample(&[month_first]));
            return Some(Err(TimeFault::BothOrders { day_first, month_first }));
        }
    };
    reads(order).then_some(Ok(TimeKind::Date(order)))
}

/// Past a midnight one order goes on by a step, and the other leaps by a month.
fn settled_by_midnight(cells: &[&str]) -> Option<DateOrder> {
    const HOUR_NS: i128 = 3_600_000_000_000;
    let longest_step = |order| {
        let format = TimeFormat { kind: TimeKind::Date(order), zone: None };
        let read = |cell: &&str| format.instant_ns(format.kind.read(cell)?, None);
        let times: Vec<i128> = cells.iter().filter_map(read).collect();
        let step = |pair: &[i128]| Some((pair.get(1)? - pair.first()?).abs());
        times.windows(2).filter_map(step).max()
    };
    let (dmy, mdy) = (longest_step(DateOrder::DayMonthYear)?, longest_step(DateOrder::MonthDayYear)?);
    if dmy < HOUR_NS && mdy > 24 * HOUR_NS {
        Some(DateOrder::DayMonthYear)
    } else if mdy < HOUR_NS && dmy > 24 * HOUR_NS {
        Some(DateOrder::MonthDayYear)
    } else {
        None
    }
}
