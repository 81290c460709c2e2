//! Pages that are compressed by zstd (RFC 8878), which polars writes of itself: the crate `parquet` needs a C library for
//! them, and a C compiler where the program is built.

use crate::trace::format::MOST_HELD;
use bytes::Bytes;
use parquet::column::page::{Page, PageMetadata, PageReader};
use parquet::errors::{ParquetError, Result};
use ruzstd::decoding::StreamingDecoder;
use std::io::Read;

/// Decompresses the pages of another reader, which hands them on as they are in the file.
pub(super) struct ZstdPages<P>(pub(super) P);

impl<P: PageReader> PageReader for ZstdPages<P> {
    fn get_next_page(&mut self) -> Result<Option<Page>> {
        self.0.get_next_page()?.map(unpacked).transpose()
    }

    fn peek_next_page(&mut self) -> Result<Option<PageMetadata>> {
        self.0.peek_next_page()
    }

    fn skip_next_page(&mut self) -> Result<()> {
        self.0.skip_next_page()
    }
}

impl<P: PageReader> Iterator for ZstdPages<P> {
    type Item = Result<Page>;

    fn next(&mut self) -> Option<Self::Item> {
        self.get_next_page().transpose()
    }
}

fn unpacked(mut page: Page) -> Result<Page> {
    match &mut page {
        Page::DataPage { buf, .. } | Page::DictionaryPage { buf, .. } => *buf = decompressed(&[], buf)?,
        // The levels stand before what is compressed.
        Page::DataPageV2 { buf, def_levels_byte_len, rep_levels_byte_len, is_compressed: true, .. } => {
            let levels = u64::from(*def_levels_byte_len) + u64::from(*rep_levels_byte_len);
            let split = usize::try_from(levels).ok().and_then(|levels| buf.split_at_checked(levels));
            let (levels, values) = split.ok_or_else(|| damaged(&"levels longer than their page"))?;
            *buf = decompressed(levels, values)?;
        }
        Page::DataPageV2 { .. } => {}
    }
    Ok(page)
}

/// `start`, and behind it what the frames hold.
fn decompressed(start: &[u8], mut frames: &[u8]) -> Result<Bytes> {
    let mut bytes = start.to_vec();
    while !frames.is_empty() {
        let frame = StreamingDecoder::new(&mut frames).map_err(|error| damaged(&error))?;
        let room = MOST_HELD.saturating_sub(bytes.len() as u64);
        frame.take(room + 1).read_to_end(&mut bytes).map_err(|error| damaged(&error))?;
        if bytes.len() as u64 > MOST_HELD {
            return Err(damaged(&"a page of more than a gigabyte"));
        }
    }
    Ok(bytes.into())
}

fn damaged(what: &dyn std::fmt::Display) -> ParquetError {
    ParquetError::General(format!("zstd: {what}"))
}
