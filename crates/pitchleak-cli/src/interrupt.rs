//! Ctrl-C, the signal to end, and a terminal that is gone: nothing half-written stays.

use crate::failure::Failure;
use crate::output;
use pitchleak::output::abandon;
use std::io;

/// From here on these end the program at once, with its half-written files removed. Where whoever started it has one of them
/// ignored (`nohup`), all stay as they are.
pub fn leave_nothing_half_written() -> Result<(), Failure> {
    let handler = || {
        abandon();
        output::complain("error", &Failure::Interrupted);
        std::process::exit(i32::from(Failure::Interrupted.status()));
    };
    match ctrlc::try_set_handler(handler) {
        Ok(()) | Err(ctrlc::Error::MultipleHandlers) => Ok(()),
        Err(error) => Err(Failure::Output(io::Error::other(error))),
    }
}
