//! The pages of a column, one after the other. The crate `parquet` unpacks what a page holds before anyone can ask how much
//! it is, and makes room for as many values as the page says that it has.
//!
//! What compresses the pages of a column. A page says how large it is: more is not unpacked, whatever its bytes hold.
//!
//! Decoders without C: a C compiler is not needed where the program is built.

use super::footer::{Chunk, Footer, Leaf, damaged};
use super::thrift::{Fields, structure};
use crate::read::format::MOST_HELD;
use bytes::Bytes;
use flate2::read::MultiGzDecoder;
use parquet::basic::Encoding;
use parquet::column::page::{Page, PageMetadata, PageReader};
use parquet::column::reader::{ColumnReader, get_column_reader};
use parquet::errors::{ParquetError, Result};
use parquet::file::reader::ChunkReader;
use ruzstd::decoding::StreamingDecoder;
use std::fmt::Display;
use std::io::Read;
use std::sync::Arc;

/// Bytes read for the head of a page: at first, and at most (it may hold the least and the largest text).
const HEAD: u64 = 1 << 10;
const LONGEST_HEAD: u64 = 1 << 24;

/// Kinds of pages.
const DATA: i64 = 0;
const DICTIONARY: i64 = 2;
const DATA_2: i64 = 3;

/// So many bytes of a file from a place on.
pub(super) type ReadAt = Arc<dyn Fn(u64, usize) -> Result<Bytes> + Send + Sync>;

struct Pages {
    bytes: ReadAt,
    codec: Codec,
    /// Where the next one begins, and the bytes from there to the column's end.
    at: u64,
    left: u64,
}

impl Pages {
    fn of(bytes: ReadAt, chunk: Chunk) -> Result<Self> {
        Ok(Self { bytes, codec: Codec::of(chunk.codec)?, at: chunk.start, left: chunk.length })
    }

    fn take(&mut self, length: u64) -> Result<Bytes> {
        if length > self.left || length > MOST_HELD {
            return Err(damaged("a page is longer than its column"));
        }
        let bytes = (self.bytes)(self.at, length as usize)?;
        self.at += length;
        self.left -= length;
        Ok(bytes)
    }

    /// The head of the next page in its bytes.
    fn head<T>(&mut self, read: impl Fn(&Fields<'_>) -> Result<T>) -> Result<T> {
        let mut look = HEAD;
        loop {
            let bytes = (self.bytes)(self.at, look.min(self.left) as usize)?;
            match structure(&bytes) {
                Ok((fields, length)) => {
                    let head = read(&fields)?;
                    self.at += length as u64;
                    self.left -= length as u64;
                    return Ok(head);
                }
                Err(ParquetError::EOF(_)) if look < self.left && look < LONGEST_HEAD => look *= 16,
                Err(error) => return Err(error),
            }
        }
    }
}

/// What a page's head says.
struct Head {
    packed: u64,
    size: u64,
    /// The page without what it holds; none of one that holds no values.
    page: Option<Page>,
}

impl Head {
    fn of(fields: &Fields<'_>) -> Result<Self> {
        let size = |id| Ok::<_, ParquetError>(u64::try_from(fields.needed(id)?.whole()?)?);
        let page = match fields.needed(1)?.whole()? {
            DATA => Some(data(&fields.needed(5)?.fields()?)?),
            DICTIONARY => Some(dictionary(&fields.needed(7)?.fields()?)?),
            DATA_2 => Some(data_2(&fields.needed(8)?.fields()?)?),
            _ => None,
        };
        Ok(Self { packed: size(3)?, size: size(2)?, page })
    }
}

fn data(fields: &Fields<'_>) -> Result<Page> {
    let [num_values, encoding, levels] = [1, 2, 3].map(|id| count(fields, id));
    let (num_values, encoding, levels) = (num_values?, encoded(encoding?)?, encoded(levels?)?);
    Ok(Page::DataPage {
        buf: Bytes::new(),
        num_values,
        encoding,
        def_level_encoding: levels,
        rep_level_encoding: levels,
        statistics: None,
    })
}

fn data_2(fields: &Fields<'_>) -> Result<Page> {
    let [num_values, num_nulls, num_rows, encoding, definition, repetition] =
        [1, 2, 3, 4, 5, 6].map(|id| count(fields, id));
    Ok(Page::DataPageV2 {
        buf: Bytes::new(),
        num_values: num_values?,
        num_nulls: num_nulls?,
        num_rows: num_rows?,
        encoding: encoded(encoding?)?,
        rep_levels_byte_len: repetition?,
        def_levels_byte_len: definition?,
        is_compressed: fields.get(7).is_none_or(|packed| packed.is_true()),
        statistics: None,
    })
}

fn dictionary(fields: &Fields<'_>) -> Result<Page> {
    let (num_values, encoding) = (count(fields, 1)?, encoded(count(fields, 2)?)?);
    Ok(Page::DictionaryPage { buf: Bytes::new(), num_values, encoding, is_sorted: false })
}

/// The page with what it holds: these bytes, which are `size` once they are unpacked.
fn filled(mut page: Page, bytes: &Bytes, size: u64, codec: Codec) -> Result<Page> {
    match &mut page {
        Page::DataPage { buf, .. } => *buf = codec.unpacked(&[], bytes, size)?,
        Page::DataPageV2 { buf, rep_levels_byte_len, def_levels_byte_len, is_compressed, .. } => {
            // Levels stand before what is compressed.
            let split = u64::from(*rep_levels_byte_len) + u64::from(*def_levels_byte_len);
            let split = usize::try_from(split).ok().and_then(|split| bytes.split_at_checked(split));
            let (before, values) = split.ok_or_else(|| damaged("levels longer than their page"))?;
            let codec = if *is_compressed { codec } else { Codec::Plain };
            *buf = codec.unpacked(before, values, size)?;
        }
        Page::DictionaryPage { buf, num_values, .. } => {
            *buf = codec.unpacked(&[], bytes, size)?;
            if *num_values as usize > buf.len() {
                return Err(damaged("a dictionary has fewer values than it says"));
            }
        }
    }
    Ok(page)
}

impl PageReader for Pages {
    fn get_next_page(&mut self) -> Result<Option<Page>> {
        while self.left > 0 {
            let head = self.head(Head::of)?;
            let bytes = self.take(head.packed)?;
            if let Some(page) = head.page {
                return filled(page, &bytes, head.size, self.codec).map(Some);
            }
        }
        Ok(None)
    }

    /// Asked by nobody who reads a column from its begin to its end.
    fn peek_next_page(&mut self) -> Result<Option<PageMetadata>> {
        Err(damaged("pages are read one after the other"))
    }

    fn skip_next_page(&mut self) -> Result<()> {
        self.get_next_page().map(drop)
    }
}

impl Iterator for Pages {
    type Item = Result<Page>;

    fn next(&mut self) -> Option<Self::Item> {
        self.get_next_page().transpose()
    }
}

fn count(fields: &Fields<'_>, id: usize) -> Result<u32> {
    Ok(u32::try_from(fields.needed(id)?.whole()?)?)
}

fn encoded(number: u32) -> Result<Encoding> {
    #[expect(deprecated, reason = "old files have levels of it")]
    let bit_packed = Encoding::BIT_PACKED;
    Ok(match number {
        0 => Encoding::PLAIN,
        2 => Encoding::PLAIN_DICTIONARY,
        3 => Encoding::RLE,
        4 => bit_packed,
        5 => Encoding::DELTA_BINARY_PACKED,
        // The crate `parquet` makes room for as many texts as such a page says.
        6 | 7 => {
            return Err(unread(
                "texts written as differences",
                "write the column as times or numbers, or with use_dictionary=True",
            ));
        }
        8 => Encoding::RLE_DICTIONARY,
        9 => Encoding::BYTE_STREAM_SPLIT,
        _ => return Err(damaged("a page in an unknown encoding")),
    })
}

/// A file of columns.
pub(super) struct Columns {
    bytes: ReadAt,
    /// Without those that have a nest.
    pub(super) leaves: Vec<Leaf>,
    groups: Vec<Vec<Chunk>>,
}

impl Columns {
    /// Of a file on a disk or in memory.
    pub(super) fn of(file: impl ChunkReader + 'static) -> Result<Self> {
        let length = file.len();
        let bytes: ReadAt = Arc::new(move |start, length| file.get_bytes(start, length));
        let Footer { leaves, groups } = Footer::of(&bytes, length)?;
        Ok(Self { bytes, leaves: leaves.into_iter().filter(Leaf::is_flat).collect(), groups })
    }

    /// How many groups of rows there are.
    pub(super) fn groups(&self) -> usize {
        self.groups.len()
    }

    /// The flat column at `index` of a group of rows.
    pub(super) fn read(&self, group: usize, index: usize) -> Result<ColumnReader> {
        let leaf = self.leaves.get(index);
        let chunk = leaf.and_then(|leaf| self.groups.get(group)?.get(leaf.place));
        let (Some(chunk), Some(leaf)) = (chunk, leaf) else {
            return Err(damaged("a column that is not there"));
        };
        let pages = Pages::of(Arc::clone(&self.bytes), *chunk)?;
        Ok(get_column_reader(leaf.descriptor()?, Box::new(pages)))
    }
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Codec {
    Plain,
    Snappy,
    Gzip,
    Zstd,
    /// One block of LZ4: `LZ4_RAW`.
    Lz4Raw,
}

/// What the error of what is sound, and not read, begins with: what it is follows, and in the next line what to do.
pub(super) const UNREAD: &str = "not read: ";

fn unread(what: &str, settle: &str) -> ParquetError {
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
    fn unpacked(self, before: &[u8], packed: &[u8], size: u64) -> Result<Bytes> {
        if size > MOST_HELD {
            return Err(not_unpacked(&"a page of more than a gigabyte"));
        }
        let size = size as usize;
        let room =
            size.checked_sub(before.len()).ok_or_else(|| not_unpacked(&"levels longer than their page"))?;
        let values = match self {
            // Some writers say another size of what they don't compress.
            Self::Plain => return Ok([before, packed].concat().into()),
            // So is a page of missing cells alone.
            _ if room == 0 => Vec::new(),
            Self::Snappy => {
                if snap::raw::decompress_len(packed).map_err(|error| not_unpacked(&error))? != room {
                    return Err(not_unpacked(&"a page is not as large as it says"));
                }
                block(room, |bytes| snap::raw::Decoder::new().decompress(packed, bytes))?
            }
            Self::Gzip => stream(MultiGzDecoder::new(packed), room)?,
            Self::Zstd => zstd(packed, room)?,
            Self::Lz4Raw => block(room, |bytes| lz4_flex::block::decompress_into(packed, bytes))?,
        };
        if values.len() != room {
            return Err(not_unpacked(&"a page is not as large as it says"));
        }
        Ok(if before.is_empty() { values.into() } else { [before, &values].concat().into() })
    }
}

/// All of a stream, but not much more than fits.
fn stream(from: impl Read, room: usize) -> Result<Vec<u8>> {
    let mut bytes = Vec::with_capacity(room + 1);
    from.take(room as u64 + 1).read_to_end(&mut bytes).map_err(|error| not_unpacked(&error))?;
    Ok(bytes)
}

/// What `decode` writes of a block into so much room.
fn block<E: Display>(
    room: usize,
    decode: impl FnOnce(&mut [u8]) -> std::result::Result<usize, E>,
) -> Result<Vec<u8>> {
    // Zeros of the system, which take no memory until they are written.
    let mut bytes = vec![0; room];
    let length = decode(&mut bytes).map_err(|error| not_unpacked(&error))?;
    bytes.truncate(length);
    Ok(bytes)
}

fn zstd(mut frames: &[u8], room: usize) -> Result<Vec<u8>> {
    // One byte more, by which the last read learns that there is no more. What is not written takes no memory.
    let mut bytes = Vec::with_capacity(room + 1);
    while !frames.is_empty() && bytes.len() <= room {
        let frame = StreamingDecoder::new(&mut frames).map_err(|error| not_unpacked(&error))?;
        let left = (room - bytes.len()) as u64;
        frame.take(left + 1).read_to_end(&mut bytes).map_err(|error| not_unpacked(&error))?;
    }
    Ok(bytes)
}

fn not_unpacked(what: &dyn Display) -> ParquetError {
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
