//! Numbers as nearly every cell has them: a few digits, a point, a few digits.

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

#[cfg(test)]
mod tests {
    use super::plain_number;
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
}
