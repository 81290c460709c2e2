//! What compresses the pages of a column. A page says how large it is: more is not unpacked, whatever its bytes hold.
//!
//! Decoders without C: a C compiler is not needed where the program is built.

use crate::read::format::MOST_HELD;
use bytes::Bytes;
use flate2::read::MultiGzDecoder;
use parquet::errors::{ParquetError, Result};
use ruzstd::decoding::StreamingDecoder;
use std::fmt::Display;
use std::io::Read;

#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Codec {
    Plain,
    Snappy,
    Gzip,
    /// Blocks of LZ4 with their lengths before them, as Hadoop writes them; also what was written under this name by others.
    Lz4,
    Zstd,
    /// One block of LZ4.
    Lz4Raw,
}

/// What the error of a codec that is not read begins with; its name follows.
pub(super) const UNREAD: &str = "codec ";

impl Codec {
    /// That of a number in the footer.
    pub(super) fn of(number: i64) -> Result<Self> {
        let unread = |name: &str| Err(ParquetError::NYI(format!("{UNREAD}{name}")));
        Ok(match number {
            0 => Self::Plain,
            1 => Self::Snappy,
            2 => Self::Gzip,
            3 => return unread("LZO"),
            4 => return unread("brotli"),
            5 => Self::Lz4,
            6 => Self::Zstd,
            7 => Self::Lz4Raw,
            _ => return unread("an unknown codec"),
        })
    }

    /// `before`, and behind it what `packed` holds: `size` bytes in all.
    pub(super) fn unpacked(self, before: &[u8], packed: &[u8], size: u64) -> Result<Bytes> {
        if size > MOST_HELD {
            return Err(damaged(&"a page of more than a gigabyte"));
        }
        let size = size as usize;
        let room = size.checked_sub(before.len()).ok_or_else(|| damaged(&"levels longer than their page"))?;
        let values = match self {
            // Some writers say another size of what they don't compress.
            Self::Plain => return Ok([before, packed].concat().into()),
            // So is a page of missing cells alone.
            _ if room == 0 => Vec::new(),
            Self::Snappy => snappy(packed, room)?,
            Self::Gzip => stream(MultiGzDecoder::new(packed), room)?,
            Self::Lz4 => lz4(packed, room)?,
            Self::Zstd => zstd(packed, room)?,
            Self::Lz4Raw => lz4_block(packed, room)?,
        };
        if values.len() != room {
            return Err(damaged(&"a page is not as large as it says"));
        }
        Ok(if before.is_empty() { values.into() } else { [before, &values].concat().into() })
    }
}

/// All of a stream, but not much more than fits.
fn stream(from: impl Read, room: usize) -> Result<Vec<u8>> {
    let mut bytes = Vec::new();
    from.take(room as u64 + 1).read_to_end(&mut bytes).map_err(|error| damaged(&error))?;
    Ok(bytes)
}

fn snappy(packed: &[u8], room: usize) -> Result<Vec<u8>> {
    if snap::raw::decompress_len(packed).map_err(|error| damaged(&error))? != room {
        return Err(damaged(&"a page is not as large as it says"));
    }
    // Zeros of the system, which take no memory until they are written.
    let mut bytes = vec![0; room];
    let length = snap::raw::Decoder::new().decompress(packed, &mut bytes).map_err(|error| damaged(&error))?;
    bytes.truncate(length);
    Ok(bytes)
}

fn zstd(mut frames: &[u8], room: usize) -> Result<Vec<u8>> {
    let mut bytes = Vec::new();
    while !frames.is_empty() && bytes.len() <= room {
        let frame = StreamingDecoder::new(&mut frames).map_err(|error| damaged(&error))?;
        let left = (room - bytes.len()) as u64;
        frame.take(left + 1).read_to_end(&mut bytes).map_err(|error| damaged(&error))?;
    }
    Ok(bytes)
}

fn lz4_block(packed: &[u8], room: usize) -> Result<Vec<u8>> {
    let mut bytes = vec![0; room];
    let length = lz4_flex::block::decompress_into(packed, &mut bytes).map_err(|error| damaged(&error))?;
    bytes.truncate(length);
    Ok(bytes)
}

fn lz4(packed: &[u8], room: usize) -> Result<Vec<u8>> {
    let fits = |bytes: &Vec<u8>| bytes.len() == room;
    let hadoop = lz4_hadoop(packed, room).filter(fits);
    let frame = || stream(lz4_flex::frame::FrameDecoder::new(packed), room).ok().filter(fits);
    hadoop.or_else(frame).map_or_else(|| lz4_block(packed, room), Ok)
}

/// Blocks, each behind its length unpacked and packed; nothing where they are not such.
fn lz4_hadoop(mut packed: &[u8], room: usize) -> Option<Vec<u8>> {
    let mut bytes = Vec::new();
    while !packed.is_empty() {
        let (length, rest) = packed.split_first_chunk()?;
        let (held, rest) = rest.split_first_chunk()?;
        let (block, rest) = rest.split_at_checked(u32::from_be_bytes(*held) as usize)?;
        let length = u32::from_be_bytes(*length) as usize;
        let left = room.checked_sub(bytes.len())?;
        bytes.append(&mut lz4_block(block, length.min(left)).ok()?);
        packed = rest;
    }
    Some(bytes)
}

fn damaged(what: &dyn Display) -> ParquetError {
    ParquetError::General(format!("a page can't be unpacked: {what}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    const PACKED: [Codec; 5] = [Codec::Snappy, Codec::Gzip, Codec::Lz4, Codec::Zstd, Codec::Lz4Raw];

    /// It would take all memory otherwise.
    #[test]
    fn of_a_stream_without_end_no_more_is_read_than_a_page_may_hold() {
        assert_eq!(stream(std::io::repeat(0), 240).unwrap().len(), 241);
    }

    #[test]
    fn a_page_that_says_more_than_a_gigabyte_is_refused() {
        for codec in PACKED.into_iter().chain([Codec::Plain]) {
            let error = codec.unpacked(&[], &[], MOST_HELD + 1).unwrap_err().to_string();
            assert!(error.contains("more than a gigabyte"), "{codec:?}: {error}");
        }
    }

    /// Zeros that are packed a thousand times smaller, behind a head that says less.
    #[test]
    fn a_page_that_holds_more_than_it_says_is_refused() {
        let zeros = vec![0; 1 << 20];
        let mut gzip = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::best());
        std::io::Write::write_all(&mut gzip, &zeros).unwrap();
        let block = lz4_flex::block::compress(&zeros);
        let lengths = [zeros.len() as u32, block.len() as u32].map(u32::to_be_bytes).concat();
        let packed = [
            (Codec::Gzip, gzip.finish().unwrap()),
            (Codec::Snappy, snap::raw::Encoder::new().compress_vec(&zeros).unwrap()),
            (Codec::Lz4Raw, block.clone()),
            (Codec::Lz4, [lengths, block].concat()),
            (
                Codec::Zstd,
                ruzstd::encoding::compress_to_vec(
                    zeros.as_slice(),
                    ruzstd::encoding::CompressionLevel::Fastest,
                ),
            ),
        ];
        for (codec, packed) in &packed {
            assert_eq!(
                codec.unpacked(b"ab", packed, 2 + (1 << 20)).unwrap().len(),
                2 + (1 << 20),
                "{codec:?}"
            );
            for size in [1, 240, (1 << 20) - 1, (1 << 20) + 1, MOST_HELD] {
                assert!(codec.unpacked(&[], packed, size).is_err(), "{codec:?}, {size}");
            }
        }
    }

    /// Not only as Hadoop writes it.
    #[test]
    fn lz4_is_read_in_each_of_its_forms() {
        let text = b"what is written, what is written".repeat(9);
        let mut frame = lz4_flex::frame::FrameEncoder::new(Vec::new());
        std::io::Write::write_all(&mut frame, &text).unwrap();
        for packed in [frame.finish().unwrap(), lz4_flex::block::compress(&text)] {
            assert_eq!(Codec::Lz4.unpacked(&[], &packed, text.len() as u64).unwrap(), text);
        }
    }
}
