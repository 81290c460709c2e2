//! Decimal numbers of a trace, correctly rounded.

/// Digits that a double holds exactly whatever they are: 10^15 < 2^53.
const EXACT_DIGITS: usize = 15;

/// Powers of ten that a double holds exactly.
const POWERS: [f64; 23] = [
    1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15, 1e16, 1e17, 1e18,
    1e19, 1e20, 1e21, 1e22,
];

/// The number at the start of `text` and its length; none where no number starts there.
///
/// Short numbers take one exact multiplication or division of two exact doubles (W. D. Clinger,
/// "How to read floating point numbers accurately", 1990); the rest goes to `fast_float2`.
#[inline]
pub(super) fn leading_number(text: &[u8]) -> Option<(f64, usize)> {
    short_number(text).or_else(|| fast_float2::parse_partial(text).ok())
}

#[inline(always)]
fn short_number(text: &[u8]) -> Option<(f64, usize)> {
    let negative = text.first() == Some(&b'-');
    let first = usize::from(negative);
    let (mut mantissa, mut at) = digits(text, first, 0);
    let mut count = at - first;
    let mut exponent = 0;
    if text.get(at) == Some(&b'.') {
        let (with_fraction, end) = digits(text, at + 1, mantissa);
        let places = end - at - 1;
        (mantissa, at, count, exponent) = (with_fraction, end, count + places, -(places as i64));
    }
    if count == 0 || count > EXACT_DIGITS {
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

/// Appends the digits from `at` on to `mantissa`; gives the sum and where they end.
#[inline(always)]
fn digits(text: &[u8], mut at: usize, mut mantissa: u64) -> (u64, usize) {
    while let Some(digit) = text.get(at).map(|byte| byte.wrapping_sub(b'0')).filter(|&digit| digit <= 9) {
        mantissa = mantissa.wrapping_mul(10).wrapping_add(u64::from(digit));
        at += 1;
    }
    (mantissa, at)
}

/// The exponent after an `e`: sign and one to three digits.
#[inline(always)]
fn signed_power(text: &[u8], at: usize) -> Option<(i64, usize)> {
    let (negative, first) = match text.get(at)? {
        b'-' => (true, at + 1),
        b'+' => (false, at + 1),
        _ => (false, at),
    };
    let (power, end) = digits(text, first, 0);
    if end == first || end - first > 3 {
        return None;
    }
    let power = power as i64;
    Some((if negative { -power } else { power }, end))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn what_is_no_number_is_none() {
        for text in ["", "-", ".", "e5", "abc", ",1", "--1", "1e5"].map(str::as_bytes) {
            let expected = fast_float2::parse_partial::<f64, _>(text).ok();
            assert_eq!(leading_number(text), expected, "{}", String::from_utf8_lossy(text));
        }
        assert_eq!(leading_number(b"1.5,2"), Some((1.5, 3)));
        assert_eq!(leading_number(b"1.,2"), Some((1.0, 2)));
        assert_eq!(leading_number(b"12e,2"), Some((12.0, 2)));
    }

    proptest! {
        #[test]
        fn as_the_standard_library_reads_it(text in r"-?[0-9]{0,12}\.?[0-9]{0,12}([eE][-+]?[0-9]{1,4})?") {
            let expected = text.parse::<f64>().ok().map(f64::to_bits);
            let ours = leading_number(text.as_bytes())
                .filter(|(_, length)| *length == text.len())
                .map(|(value, _)| value.to_bits());
            prop_assert_eq!(ours, expected);
        }

        #[test]
        fn any_double_comes_back(value in proptest::num::f64::NORMAL, places in 0..17usize) {
            for text in [format!("{value}"), format!("{value:e}"), format!("{value:.places$e}")] {
                let expected = text.parse::<f64>().unwrap();
                prop_assert_eq!(leading_number(text.as_bytes()), Some((expected, text.len())));
            }
        }
    }
}
