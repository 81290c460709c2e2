//! Decimal numbers of a trace, correctly rounded, in one pass over the text.

/// Readers look this far ahead: the text of a number must be followed by so many more bytes, the
/// first of which is no part of it.
pub(super) const LOOK_AHEAD: usize = 8;

/// Powers of ten that a double holds exactly.
const POWERS: [f64; 23] = [
    1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15, 1e16, 1e17, 1e18,
    1e19, 1e20, 1e21, 1e22,
];

const TEN_TO: [u64; 9] = [1, 10, 100, 1000, 10_000, 100_000, 1_000_000, 10_000_000, 100_000_000];

/// The number at the start of `text` and its length; none where no number starts there.
#[inline]
pub(super) fn leading_number(text: &[u8]) -> Option<(f64, usize)> {
    fast_float2::parse_partial(text).ok()
}

/// As [`leading_number`], for the short numbers of most traces: none does not mean that there is no
/// number. `text` must go on for [`LOOK_AHEAD`] bytes after the number.
///
/// Up to 2^53 and with few decimals a number is one exact multiplication or division of two exact
/// doubles (W. D. Clinger, "How to read floating point numbers accurately", 1990).
#[inline(always)]
pub(super) fn short_number(text: &[u8]) -> Option<(f64, usize)> {
    let negative = text.first() == Some(&b'-');
    let first = usize::from(negative);
    let (mut mantissa, mut at) = one_digit(text, first).or_else(|| append_digits(text, first, 0))?;
    let mut count = at - first;
    let mut exponent = 0;
    if text.get(at) == Some(&b'.') {
        let (with_fraction, end) = append_digits(text, at + 1, mantissa)?;
        let places = end - at - 1;
        (mantissa, at, count, exponent) = (with_fraction, end, count + places, -(places as i64));
    }
    if count == 0 || count > 19 || mantissa > 1 << 53 {
        return None;
    }
    if let Some(b'e' | b'E') = text.get(at) {
        let (power, end) = signed_power(text, at + 1)?;
        (exponent, at) = (exponent + power, end);
    }
    let scale = *POWERS.get(exponent.unsigned_abs() as usize)?;
    let digits = mantissa as f64;
    let magnitude = if exponent < 0 { digits / scale } else { digits * scale };
    Some((if negative { -magnitude } else { magnitude }, at))
}

/// The digit at `at` and where it ends, if no other follows: most numbers are scaled so.
#[inline(always)]
fn one_digit(text: &[u8], at: usize) -> Option<(u64, usize)> {
    let [digit, next] = *text.get(at..)?.first_chunk()?;
    let value = digit.wrapping_sub(b'0');
    (value <= 9 && !next.is_ascii_digit()).then_some((u64::from(value), at + 1))
}

/// Appends the digits from `at` on to `mantissa`; gives the sum and where they end. None for more than
/// 15 of them, and where `text` ends too soon to tell.
#[inline(always)]
fn append_digits(text: &[u8], at: usize, mantissa: u64) -> Option<(u64, usize)> {
    let (value, count) = eight_digits(text, at)?;
    let mantissa = mantissa.wrapping_mul(*TEN_TO.get(count)?).wrapping_add(value);
    if count < 8 {
        return Some((mantissa, at + count));
    }
    let (value, count) = eight_digits(text, at + 8).filter(|(_, count)| *count < 8)?;
    Some((mantissa.wrapping_mul(*TEN_TO.get(count)?).wrapping_add(value), at + 8 + count))
}

/// Value and count of the digits, at most eight, that start at `at`: all at once in one word (D. Lemire,
/// "Number parsing at a gigabyte per second", Software: Practice and Experience 51, 2021, §7).
#[inline(always)]
fn eight_digits(text: &[u8], at: usize) -> Option<(u64, usize)> {
    let word = u64::from_le_bytes(*text.get(at..)?.first_chunk()?) ^ 0x3030_3030_3030_3030;
    let others = (word.wrapping_add(0x7676_7676_7676_7676) | word) & 0x8080_8080_8080_8080;
    let count = others.trailing_zeros() as usize / 8;
    // Zeros before the digits instead of what follows them.
    let digits = word.checked_shl(64 - 8 * count as u32).unwrap_or(0);
    let pairs = digits.wrapping_mul(10).wrapping_add(digits >> 8);
    let odd = (pairs & 0x0000_00ff_0000_00ff).wrapping_mul(100 + (1_000_000 << 32));
    let even = ((pairs >> 16) & 0x0000_00ff_0000_00ff).wrapping_mul(1 + (10_000 << 32));
    Some((odd.wrapping_add(even) >> 32, count))
}

/// The exponent after an `e`: sign and one to three digits.
#[inline(always)]
fn signed_power(text: &[u8], at: usize) -> Option<(i64, usize)> {
    let (negative, first) = match text.get(at)? {
        b'-' => (true, at + 1),
        b'+' => (false, at + 1),
        _ => (false, at),
    };
    let (mut power, mut at) = (0, first);
    while let Some(digit) = text.get(at).map(|byte| byte.wrapping_sub(b'0')).filter(|&digit| digit <= 9) {
        power = 10 * power + i64::from(digit);
        at += 1;
        if at - first > 3 {
            return None;
        }
    }
    (at > first).then_some((if negative { -power } else { power }, at))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const AFTER: &str = ",1234567";

    /// By the short way where it can, and surely by the long one; both must agree.
    fn read(text: &str) -> Option<(f64, usize)> {
        let long = leading_number(text.as_bytes());
        let short = short_number((text.to_owned() + AFTER).as_bytes());
        if short.is_some() {
            assert_eq!(short.map(|(v, n)| (v.to_bits(), n)), long.map(|(v, n)| (v.to_bits(), n)), "{text}");
        }
        long
    }

    #[test]
    fn what_is_no_number_is_none() {
        for text in ["", "-", ".", "e5", "abc", ",1", "--1"] {
            assert_eq!(read(text), None, "{text}");
        }
        for (text, value) in
            [("1.5,2", (1.5, 3)), ("1.,2", (1.0, 2)), ("12e,2", (12.0, 2)), ("-0;", (0.0, 2))]
        {
            assert_eq!(read(text), Some(value));
        }
    }

    #[test]
    fn common_numbers_take_the_short_way() {
        for text in ["0", "-1", "5001146.43", "0.1002500", "3.1548e-05", "1763676631.250", "12345678", "1E6"]
        {
            let short = short_number((text.to_owned() + AFTER).as_bytes());
            assert_eq!(short, Some((text.parse().unwrap(), text.len())));
        }
    }

    proptest! {
        #[test]
        fn as_the_standard_library_reads_it(text in r"-?[0-9]{0,12}\.?[0-9]{0,12}([eE][-+]?[0-9]{1,4})?") {
            let expected = text.parse::<f64>().ok().map(f64::to_bits);
            let ours = read(&text).filter(|(_, length)| *length == text.len());
            prop_assert_eq!(ours.map(|(value, _)| value.to_bits()), expected);
        }

        #[test]
        fn any_double_comes_back(value in proptest::num::f64::NORMAL, places in 0..17usize) {
            for text in [format!("{value}"), format!("{value:e}"), format!("{value:.places$e}")] {
                let expected = text.parse::<f64>().unwrap();
                prop_assert_eq!(read(&text), Some((expected, text.len())));
            }
        }

        #[test]
        fn any_bytes_agree(bytes in prop::collection::vec(any::<u8>(), 0..24)) {
            read(&String::from_utf8_lossy(&bytes));
        }
    }
}
