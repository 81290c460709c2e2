//! Parquet: a flat table of numbers, times typed or as text.

use super::format::Format;

#[cfg(feature = "parquet")]
mod codec;
#[cfg(feature = "parquet")]
mod footer;
#[cfg(feature = "parquet")]
mod pages;
#[cfg(feature = "parquet")]
mod rows;
#[cfg(feature = "parquet")]
mod thrift;

#[cfg(feature = "parquet")]
pub(super) const FORMAT: Format = Format {
    starts_with: b"PAR1",
    reading: super::format::Reading::Rows { open: rows::open, look: rows::look },
};

#[cfg(not(feature = "parquet"))]
pub(super) const FORMAT: Format = Format::refused(
    b"PAR1",
    "Parquet needs a build with the cargo feature `parquet`: export the trace as .csv or .csv.gz",
);

#[cfg(all(test, feature = "parquet"))]
mod tests;
