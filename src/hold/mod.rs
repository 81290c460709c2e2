//! The hold test: both ports shut, so that no oil comes or goes but through a leak. The leaks follow from the pressures and
//! the position alone, without flow meters and without their noise.
//!
//! 1. [`Recorder`] keeps the readings while `shut` is 1, until the hold ends by itself: a chamber below 5 bar, the piston moved by
//!    2 mm, or the trace.
//! 2. `fit` finds compressibility and leaks by maximum likelihood (docs/hold-test.md), with the linear equations of `equations`; `nodes` has
//!    the likelihood of the leaks at one compressibility, `profile` over all of them.
//! 3. [`presence`](crate::presence) weighs which leaks there are: none is negative, most cylinders have none.
//! 4. [`HoldTest`] is what was found, [`HoldTest::report`] the verdict and its words.

mod advice;
mod equations;
mod fit;
mod nodes;
mod outcome;
mod profile;
mod recorder;
mod report;
mod verdict;

pub use advice::advise;
pub use outcome::{HoldSummary, HoldTest};
pub use recorder::{EndedBy, Recorder};
