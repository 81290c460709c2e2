//! Texts that are written as lengths, or as what differs from the text before: as plain texts. The crate `parquet` makes
//! room for as many as such a page says, and holds texts that each begin with the whole one before.
//! <https://github.com/apache/parquet-format/blob/master/Encodings.md>

use super::footer::damaged;
use super::thrift::Front;
use crate::read::format::MOST_HELD;
use parquet::errors::Result;

/// More texts than this are not in a page: plain, each takes four bytes beside its own.
const MOST_TEXTS: u64 = MOST_HELD / 16;

/// Of `DELTA_LENGTH_BYTE_ARRAY`.
pub(super) fn from_lengths(bytes: &[u8]) -> Result<Vec<u8>> {
    let (lengths, rest) = numbers(bytes)?;
    let mut rest = Front(rest);
    let mut plain = Vec::new();
    for length in lengths {
        append(&mut plain, &[], rest.take(length)?)?;
    }
    Ok(plain)
}

/// Of `DELTA_BYTE_ARRAY`.
pub(super) fn from_differences(bytes: &[u8]) -> Result<Vec<u8>> {
    let (shared, rest) = numbers(bytes)?;
    let (lengths, rest) = numbers(rest)?;
    let mut rest = Front(rest);
    let (mut plain, mut before) = (Vec::new(), 0..0);
    for (shared, length) in shared.into_iter().zip(lengths) {
        let start = plain.get(before).and_then(|before: &[u8]| before.get(..usize::try_from(shared).ok()?));
        let start = start.ok_or_else(|| damaged("a text shares more than there is"))?.to_vec();
        let end = rest.take(length)?;
        append(&mut plain, &start, end)?;
        before = plain.len() - start.len() - end.len()..plain.len();
    }
    Ok(plain)
}

fn append(plain: &mut Vec<u8>, start: &[u8], end: &[u8]) -> Result<()> {
    let length = start.len() + end.len();
    if (plain.len() + length) as u64 > MOST_HELD {
        return Err(damaged("texts of more than a gigabyte"));
    }
    plain.extend(u32::try_from(length)?.to_le_bytes());
    plain.extend([start, end].concat());
    Ok(())
}

/// Whole numbers as differences in blocks of blocks of bits (`DELTA_BINARY_PACKED`), and what follows them.
fn numbers(bytes: &[u8]) -> Result<(Vec<u64>, &[u8])> {
    let mut front = Front(bytes);
    let (block, parts, count) = (front.varint()?, front.varint()?, front.varint()?);
    let mut number = front.whole()?;
    let size = block.checked_div(parts).filter(|size| *size > 0 && size % 8 == 0 && size * parts == block);
    let size = size.filter(|_| count <= MOST_TEXTS).ok_or_else(|| damaged("blocks that can't be"))?;
    let mut numbers = Vec::new();
    if count > 0 {
        numbers.push(length(number)?);
    }
    while (numbers.len() as u64) < count {
        let least = front.whole()?;
        for width in front.take(parts)?.iter().map(|width| u64::from(*width)) {
            let left = count - numbers.len() as u64;
            if left == 0 {
                break;
            }
            // 64 of a length is more than any text's.
            let bits = size.checked_mul(width).filter(|_| width < 64);
            let packed = front.take(bits.ok_or_else(|| damaged("blocks that can't be"))? / 8)?;
            for at in 0..size.min(left) {
                number = number.wrapping_add(least).wrapping_add(bits_at(packed, at * width, width));
                numbers.push(length(number)?);
            }
        }
    }
    Ok((numbers, front.0))
}

/// The lowest bit first.
fn bits_at(packed: &[u8], at: u64, width: u64) -> i64 {
    let bit = |at: u64| packed.get((at / 8) as usize).map_or(0, |byte| i64::from(byte >> (at % 8) & 1));
    (0..width).map(|place| bit(at + place) << place).sum()
}

fn length(number: i64) -> Result<u64> {
    u64::try_from(number).map_err(|_| damaged("a length below zero"))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The two examples of the format's description: 7, 5, 3, 1, 2, 3, 4, 5, whose differences are packed by two bits
    /// (−2, −2, −2, 1, 1, 1, 1 over −2), in a block of 128 of which the first of four parts is needed.
    fn example() -> Vec<u8> {
        let mut bytes = vec![0x80, 1, 4, 8, 14, 3, 2, 0, 0, 0];
        bytes.extend([0b1100_0000, 0b0011_1111]);
        bytes.extend([0; 6]);
        bytes
    }

    #[test]
    fn numbers_are_those_of_the_description() {
        let bytes = [example(), vec![9]].concat();
        let (found, rest) = numbers(&bytes).unwrap();
        assert_eq!(found, [7, 5, 3, 1, 2, 3, 4, 5]);
        assert_eq!(rest, [9]);
    }

    fn plain(texts: &[&str]) -> Vec<u8> {
        texts
            .iter()
            .flat_map(|text| [&(text.len() as u32).to_le_bytes()[..], text.as_bytes()].concat())
            .collect()
    }

    /// One block of one part of eight numbers of eight bits over zero.
    fn packed(numbers: &[u8]) -> Vec<u8> {
        let steps = numbers.windows(2).map(|pair| pair[1] - pair[0]);
        let mut bytes = vec![8, 1, numbers.len() as u8, 2 * numbers[0], 0, 8];
        bytes.extend(steps);
        bytes.resize(14, 0);
        bytes
    }

    #[test]
    fn texts_come_plain() {
        let lengths = [packed(&[1, 2, 2]), b"abbcc".to_vec()].concat();
        assert_eq!(from_lengths(&lengths).unwrap(), plain(&["a", "bb", "cc"]));
        let differences = [packed(&[0, 1, 2]), packed(&[1, 1, 2]), b"abcd".to_vec()].concat();
        assert_eq!(from_differences(&differences).unwrap(), plain(&["a", "ab", "abcd"]));
        assert!(from_differences(&[packed(&[0, 9]), packed(&[1, 1]), b"ab".to_vec()].concat()).is_err());
    }

    /// A few bytes that say billions, or texts that grow by the one before.
    #[test]
    fn no_more_is_unpacked_than_a_page_may_hold() {
        let billions = [0x80, 0x80, 0x80, 0x80, 8, 1, 0x80, 0x80, 0x80, 0x80, 4, 2, 0, 0];
        assert!(from_lengths(&billions).is_err());
        // 65,536 texts, each of all of the one before and 64 bytes more: 137 GB. Zigzag: 128 is 64.
        let count = [0x80, 0x80, 4];
        let (sixty_four, zero, one_part, no_bits) = ([0x80, 1], [0], [1], [0]);
        let shared: [&[u8]; 6] = [&count, &one_part, &count, &zero, &sixty_four, &no_bits];
        let lengths: [&[u8]; 6] = [&count, &one_part, &count, &sixty_four, &zero, &no_bits];
        let bytes = [shared.concat(), lengths.concat(), vec![b'a'; 64 << 16]].concat();
        let error = from_differences(&bytes).unwrap_err().to_string();
        assert!(error.contains("more than a gigabyte"), "{error}");
    }
}
