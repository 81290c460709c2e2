//! Numbers as cells have them: a few digits, a point, a few digits; and whether a point or a comma stands before decimals.

use super::error::TraceFault;
use crate::header::shorten;
use crate::rig::Decimal;
use std::hint::black_box;

/// Most digits of such a number: as a whole number, and so as their quotient by a power of ten, it is exact.
const MOST_DIGITS: usize = 15;

/// Powers of ten for the digits that [`decimals`] reads.
const WHOLE: [u64; 8] = [1, 10, 100, 1_000, 10_000, 100_000, 1_000_000, 10_000_000];
const POWERS: [f64; 8] = [1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7];

/// The number that `text` begins with, and its length; none where it is written in another way or at length, or ends too
/// close to the text's end. It is the nearest double: a whole number below 2⁵³ over a power of ten that is exact is
/// rounded once (Clinger, How to read floating point numbers accurately, 1990).
///
/// `usual_places` is how many decimals the number before had. A branch that is foreseen lets the processor begin with the
/// next cell before it has found the end of this one; without it a cell takes a third longer. Hence also the black boxes:
/// a compiler would make sums of the branches again.
#[inline(always)]
pub(super) fn plain_number(text: &[u8], usual_places: &mut usize) -> Option<(f64, usize)> {
    let negative = text.first() == Some(&b'-');
    let first = if negative { black_box(1) } else { 0 };
    let (mut whole, mut at) = (0_u64, first);
    let mut byte = *text.get(at)?;
    while byte.is_ascii_digit() {
        whole = whole.wrapping_mul(10).wrapping_add(u64::from(byte - b'0'));
        at += 1;
        byte = *text.get(at)?;
    }
    let digits = at - first;
    let (mantissa, places) = match byte {
        b'.' => {
            let (part, places) = decimals(text.get(at + 1..at + 9)?)?;
            if places != *usual_places {
                *usual_places = black_box(places);
            }
            at += 1 + *usual_places;
            (whole.wrapping_mul(*WHOLE.get(*usual_places)?).wrapping_add(part), *usual_places)
        }
        _ => (whole, 0),
    };
    if digits == 0 || digits + places > MOST_DIGITS {
        return None;
    }
    let value = mantissa as f64 / POWERS.get(places)?;
    Some((if negative { -value } else { value }, at))
}

/// The digits that eight bytes begin with as a whole number, and how many they are; none where all are digits. All eight at
/// once (Lemire, Number parsing at a gigabyte per second, 2021, section 8).
#[inline(always)]
fn decimals(bytes: &[u8]) -> Option<(u64, usize)> {
    let digits = u64::from_le_bytes(bytes.try_into().ok()?) ^ 0x3030_3030_3030_3030;
    // What is no digit has a bit in its upper half, or has one once six are added.
    let others = (digits | digits.wrapping_add(0x0606_0606_0606_0606)) & 0xf0f0_f0f0_f0f0_f0f0;
    let bits = if others == 0 { return None } else { others.trailing_zeros() & !7 };
    let digits = digits.checked_shl(64 - bits).unwrap_or(0);
    let pairs = digits.wrapping_mul(10).wrapping_add(digits >> 8);
    let upper = (pairs & 0x0000_00ff_0000_00ff).wrapping_mul(0x000f_4240_0000_0064);
    let lower = ((pairs >> 16) & 0x0000_00ff_0000_00ff).wrapping_mul(0x0000_2710_0000_0001);
    Some((upper.wrapping_add(lower) >> 32, bits as usize / 8))
}

/// A cell as a number, whatever stands around its decimals; of the first rows, which are looked at.
pub(super) fn number(cell: &str, decimal: Decimal) -> Option<f64> {
    match decimal {
        Decimal::Point => fast_float2::parse(cell).ok(),
        Decimal::Comma => fast_float2::parse(cell.replace(',', ".")).ok(),
    }
}

/// What the marks in the cells of a column, or of all, speak for.
#[derive(Default)]
struct Marks {
    cells: usize,
    /// Whole numbers below a thousand.
    small: usize,
    /// A comma that can be nothing but decimal: `0,5`, `12,3456`.
    commas: usize,
    /// `1,234`, which may be a thousand and more.
    open_commas: usize,
    /// A point that can be nothing but decimal.
    points: usize,
    /// `1.234`
    open_points: usize,
    /// `1.234.567` or `1,234.5`.
    thousands: usize,
    /// A cell that may be thousands.
    example: Option<String>,
}

/// So many cells such as `1.234` and none such as `1.5` are no chance.
const MANY: usize = 10;

/// What the columns of numbers, a list of cells each, speak for.
pub(super) fn decimal(columns: &[Vec<&str>]) -> Result<Decimal, TraceFault> {
    let mut all = Marks::default();
    columns.iter().for_each(|column| all.join(Marks::of(column)));
    let example = || all.example.clone().unwrap_or_default();
    if 10 * all.thousands > all.cells {
        return Err(TraceFault::Ambiguous {
            what: format!("`{}` has a mark between its thousands", example()),
            settle: "export the numbers without marks between thousands".to_owned(),
        });
    }
    match all.commas {
        0 if all.open_commas == 0 => Ok(Decimal::Point),
        0 => Err(TraceFault::Ambiguous {
            what: format!("`{}` may have a decimal comma or one between thousands", example()),
            settle: "--decimal comma (`decimal = \"comma\"` under [csv] of the rig file) where it is decimal, else \
                     export the numbers without marks between thousands"
                .to_owned(),
        }),
        commas if 10 * (all.points + all.open_points) > commas => Err(TraceFault::Ambiguous {
            what: "some numbers have a comma and some a point".to_owned(),
            settle: "--decimal comma or --decimal point says which is decimal; rows with the other are left out".to_owned(),
        }),
        _ => Ok(Decimal::Comma),
    }
}

impl Marks {
    fn of(column: &[&str]) -> Self {
        let mut marks = Self::default();
        column.iter().for_each(|cell| marks.add(cell));
        // 998, 999, 1.000, 1.001: no decimals but thousands.
        if marks.points == 0 && marks.open_points > MANY && marks.small > MANY {
            marks.thousands += marks.cells;
        }
        marks
    }

    fn add(&mut self, cell: &str) {
        let number = cell.trim_start_matches(['+', '-']);
        if !number.starts_with(|c: char| c.is_ascii_digit() || c == '.' || c == ',') || is_date(number) {
            return;
        }
        self.cells += 1;
        let marks = |mark: u8| number.bytes().filter(|byte| *byte == mark).count();
        let count = match (marks(b'.'), marks(b',')) {
            (0, 0) if number.len() < 4 => &mut self.small,
            (0, 0) => return,
            (0, 1) if !is_group(number, ',') => &mut self.commas,
            (1, 0) if !is_group(number, '.') => &mut self.points,
            open => {
                self.example = Some(shorten(cell, 40));
                match open {
                    (0, 1) => &mut self.open_commas,
                    (1, 0) => &mut self.open_points,
                    _ => &mut self.thousands,
                }
            }
        };
        *count += 1;
    }

    fn join(&mut self, other: Self) {
        self.cells += other.cells;
        self.commas += other.commas;
        self.open_commas += other.open_commas;
        self.points += other.points;
        self.open_points += other.open_points;
        self.thousands += other.thousands;
        // Of a column that has thousands rather than of one that has decimals.
        if other.thousands > 0 || self.example.is_none() {
            self.example = other.example;
        }
    }
}

/// Whether it is no number but a date or a time: other characters, or marks as between day, month and year.
fn is_date(cell: &str) -> bool {
    let in_threes = |mark: char| cell.split(mark).skip(1).all(|group| group.len() == 3);
    let is_between = |mark: char| cell.matches(mark).count() > 1 && !in_threes(mark);
    let other = |c: char| !c.is_ascii_digit() && !".,eE+-".contains(c);
    cell.contains(other) || is_between('.') || is_between(',')
}

/// Whether a number could be thousands: one to three digits, not led by 0, and three behind the mark.
fn is_group(number: &str, mark: char) -> bool {
    let Some((before, behind)) = number.split_once(mark) else { return false };
    let digits = |text: &str| text.bytes().all(|byte| byte.is_ascii_digit());
    (1..=3).contains(&before.len())
        && !before.starts_with('0')
        && behind.len() == 3
        && digits(before)
        && digits(behind)
}

#[cfg(test)]
mod tests {
    use super::{plain_number, *};
    use proptest::prelude::*;

    fn library(text: &str) -> Option<(u64, usize)> {
        let (value, length) = fast_float2::parse_partial::<f64, _>(text).ok()?;
        Some((value.to_bits(), length))
    }

    fn plain(text: &str) -> Option<(u64, usize)> {
        let of = |mut places: usize| plain_number(text.as_bytes(), &mut places);
        let read = of(0).map(|(value, length)| (value.to_bits(), length));
        assert!((1..8).all(|places| of(places).map(|(value, length)| (value.to_bits(), length)) == read));
        read
    }

    #[test]
    fn plain_numbers_are_read_here() {
        for number in
            ["0", "-0", "0.0", "-0.0", "12", "-0.5", "5.", "100.2499990", "1700000000.125", "123456789012345"]
        {
            let text = format!("{number},12.5\n1234567");
            assert_eq!(plain(&text).map(|(_, length)| length), Some(number.len()), "{number}");
            assert_eq!(plain(&text), library(&text), "{number}");
        }
    }

    #[test]
    fn others_are_left() {
        for text in [
            "",
            "-",
            ".5,1234567",
            ",1234567",
            "+1,1234567",
            "0.12345678,1234567",
            "1234567890123456,1234567",
            "0.5",
            "1e5",
        ] {
            let read = plain(text);
            assert!(read.is_none() || (text == "1e5" && read == Some((1_f64.to_bits(), 1))), "{text}");
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(4_000))]
        /// To the last bit, whatever stands around it.
        #[test]
        fn what_is_read_here_is_what_the_library_reads(text in "-?[0-9]{0,17}(\\.[0-9]{0,10})?[,;\\t\\r\\nA-D\"/:]{1,3}[0-9.,]{0,9}") {
            if let Some(read) = plain(&text) {
                prop_assert_eq!(Some(read), library(&text));
            }
        }
    }

    #[test]
    fn marks_say_what_they_are() {
        let of = |cells: &[&str]| decimal(&[cells.to_vec()]).map_err(|fault| fault.to_string());
        assert_eq!(of(&["0.5", "1", "-2.25e3", ""]), Ok(Decimal::Point));
        assert_eq!(of(&["0,5", "1", "-2,25e3"]), Ok(Decimal::Comma));
        assert_eq!(of(&["1,234", "0,500"]), Ok(Decimal::Comma));
        assert_eq!(of(&["1.234", "5.678"]), Ok(Decimal::Point));
        assert!(of(&["1,234", "5,678"]).unwrap_err().contains("--decimal"));
        assert!(of(&["1,234.5", "5,678.5"]).unwrap_err().contains("thousands"));
        assert!(of(&["5.000.000", "0,5"]).unwrap_err().contains("thousands"));
        assert!(of(&["5.5", "0,5"]).unwrap_err().contains("--decimal"));
        assert_eq!(of(&["19.11.2026 06:30:00,250", "19.11.2026", "0,5", "06:30:00.25"]), Ok(Decimal::Comma));
        let ms: Vec<String> = (900..1100)
            .map(|i| if i < 1000 { i.to_string() } else { format!("1.{:03}", i - 1000) })
            .collect();
        assert!(of(&ms.iter().map(String::as_str).collect::<Vec<_>>()).unwrap_err().contains("thousands"));
    }
}
