//! The hold test: both ports shut, so that no oil comes or goes but through a leak. The leaks follow from the pressures and
//! the position alone, without flow meters and without their noise.
//!
//! 1. [`Recorder`] keeps the readings while `shut` is 1, until the hold ends by itself: a chamber below 5 bar, the piston moved by
//!    2 mm, or the trace.
//! 2. `fit` finds compressibility and leaks by maximum likelihood (docs/hold-test.md), with the linear equations of `equations`; `profile`
//!    has the likelihood of the leaks over the compressibilities.
//! 3. [`presence`](crate::presence) weighs which leaks there are: none is negative, most cylinders have none.
//! 4. [`HoldTest`] is what was found, [`HoldTest::report`] the verdict and its words.

mod equations;
mod fit;
mod outcome;
mod profile;
mod recorder;
mod verdict;

pub use outcome::{HoldSummary, HoldTest};
pub use recorder::{EndedBy, Recorder};
pub use verdict::advise;
