//! Traces of hydraulic cylinders, from a logger's file to checked records in SI. From the ground up:
//!
//! - [`units`]: quantities as people write them (`"12.6 cm^2"`, `"0.5 L/min"`), SI inside.
//! - [`signal`]: what can be measured, and [`header`]: how a column names its signal and unit.
//! - [`times`]: time stamps of any format, with zones and daylight saving.
//! - [`rig`]: the rig file: cylinder, oil, sensors, and `[columns]` where a file's names are foreign.
//! - [`read`]: rows of CSV, Parquet, MAT, or columns in memory as [`read::Record`]s, one by one in constant memory. A row that
//!   can't be is counted with its place, never lost in silence.
//! - [`template`]: a rig file to fill in, of what a trace says of itself.
//! - [`openfast`]: loads and pitch angles that OpenFAST wrote.
//!
//! ```
//! use pitchleak_trace::Rig;
//! use pitchleak_trace::read::{Record, TraceReader};
//!
//! # fn main() -> Result<(), pitchleak_trace::read::TraceError> {
//! let text = "t_s,x_mm,pa_bar,pb_bar,qa_lpm,qb_lpm\n0.00,100,50,40,1.2,-0.9\n0.01,100.2,51,40,1.2,-0.9\n";
//! let mut reader = TraceReader::from_stream("memory", Box::new(text.as_bytes()), &Rig::paper())?;
//! let mut record = Record::default();
//! assert!(reader.next_record(&mut record)?);
//! assert_eq!(record.sample.pa_pa, 5e6);
//! # Ok(())
//! # }
//! ```

pub mod header;
pub mod openfast;
pub mod read;
pub mod rig;
pub mod signal;
pub mod template;
pub mod times;
pub mod units;

pub use rig::Rig;
