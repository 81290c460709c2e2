//! Parquet: known, but not read yet.

use super::error::TraceFault;
use super::format::Format;

pub(super) const FORMAT: Format = Format {
    starts_with: b"PAR1",
    open: |_, _| Err(TraceFault::Format("Parquet cannot be read yet: export the trace as .csv or .csv.gz")),
};
