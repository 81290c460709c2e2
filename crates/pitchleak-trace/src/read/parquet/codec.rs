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
    Zstd,
    /// One block of LZ4: `LZ4_RAW`.
    Lz4Raw,
}

/// What the error of what is sound, and not read, begins with: what it is follows, and in the next line what to do.
pub(super) const UNREAD: &str = "not read: ";

pub(super) fn unread(what: &str, settle: &str) -> ParquetError {
    ParquetError::NYI(format!("{UNREAD}{what}\n{settle}"))
}

impl Codec {
    /// That of a number in the footer.
    pub(super) fn of(number: i64) -> Result<Self> {
        let unread = |name: &str| {
            let what = format!("compressed by {name}");
            Err(unread(&what, "write it with compression=\"zstd\", \"snappy\", \"gzip\" or none"))
        };
        Ok(match number {
            0 => Self::Plain,
            1 => Self::Snappy,
            2 => Self::Gzip,
            3 => return unread("LZO"),
            4 => return unread("brotli"),
            5 => return unread("LZ4 as Hadoop frames it"),
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
            Self::Snappy => {
                if snap::raw::decompress_len(packed).map_err(|error| damaged(&error))? != room {
                    return Err(damaged(&"a page is not as large as it says"));
                }
                block(room, |bytes| snap::raw::Decoder::new().decompress(packed, bytes))?
            }
            Self::Gzip => stream(MultiGzDecoder::new(packed), room)?,
            Self::Zstd => zstd(packed, room)?,
            Self::Lz4Raw => block(room, |bytes| lz4_flex::block::decompress_into(packed, bytes))?,
        };
        if values.len() != room {
            return Err(damaged(&"a page is not as large as it says"));
        }
        Ok(if before.is_empty() { values.into() } else { [before, &values].concat().into() })
    }
}

/// All of a stream, but not much more than fits.
fn stream(from: impl Read, room: usize) -> Result<Vec<u8>> {
    let mut bytes = Vec::with_capacity(room + 1);
    from.take(room as u64 + 1).read_to_end(&mut bytes).map_err(|error| damaged(&error))?;
    Ok(bytes)
}

/// What `decode` writes of a block into so much room.
fn block<E: Display>(
    room: usize,
    decode: impl FnOnce(&mut [u8]) -> std::result::Result<usize, E>,
) -> Result<Vec<u8>> {
    // Zeros of the system, which take no memory until they are written.
    let mut bytes = vec![0; room];
    let length = decode(&mut bytes).map_err(|error| damaged(&error))?;
    bytes.truncate(length);
    Ok(bytes)
}

fn zstd(mut frames: &[u8], room: usize) -> Result<Vec<u8>> {
    // One byte more, by which the last read learns that there is no more. What is not written takes no memory.
    let mut bytes = Vec::with_capacity(room + 1);
    while !frames.is_empty() && bytes.len() <= room {
        let frame = StreamingDecoder::new(&mut frames).map_err(|error| damaged(&error))?;
        let left = (room - bytes.len()) as u64;
        frame.take(left + 1).read_to_end(&mut bytes).map_err(|error| damaged(&error))?;
    }
    Ok(bytes)
}

fn damaged(what: &dyn Display) -> ParquetError {
    ParquetError::General(format!("a page can't be unpacked: {what}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    const PACKED: [Codec; 4] = [Codec::Snappy, Codec::Gzip, Codec::Zstd, Codec::Lz4Raw];

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
        let packed = [
            (Codec::Gzip, gzip.finish().unwrap()),
            (Codec::Snappy, snap::raw::Encoder::new().compress_vec(&zeros).unwrap()),
            (Codec::Lz4Raw, block),
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
}
