//! What people see of pitchleak's results. The engine knows values only; here they become
//!
//! - [`text`]: lines of text, on a terminal that knows Unicode with bars and courses;
//! - [`page`]: a report as one HTML page that needs nothing else;
//! - [`figure`], [`residual_figures`]: plots as SVG.
//!
//! ```
//! use pitchleak::Rig;
//! use pitchleak::replay::{ReplayError, replay};
//! use pitchleak::trace::TraceReader;
//! use pitchleak_view::{Palette, Text};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let rig = Rig::paper();
//! let mut reader = TraceReader::open("../../data/hopsan/h02.csv.gz", &rig)?;
//! let report = replay(&mut reader, &rig, |_, _, _| Ok::<_, ReplayError>(()))?;
//! assert!(report.to_text(&Palette::PLAIN).starts_with("LEAK  Internal leak of "));
//! # Ok(())
//! # }
//! ```

mod envelope;
pub mod figure;
pub mod page;
mod residuals;
pub mod text;

pub use envelope::{Envelopes, Range, Spot};
pub use residuals::residual_figures;
pub use text::{Palette, Text};
