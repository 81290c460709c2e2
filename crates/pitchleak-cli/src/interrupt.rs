//! Ctrl-C, the signal to end, and a terminal that is gone: nothing half-written stays.

use crate::failure::Failure;
use crate::output;
use pitchleak::output::abandon;
use std::io;

/// From here on these end the program at once, with its half-written files removed.
pub fn leave_nothing_half_written() -> Result<(), Failure> {
    at_the_end(|signal| {
        abandon();
        output::complain("error", &Failure::Interrupted);
        // As shells tell of a signal.
        std::process::exit(128 + signal);
    })
}

/// Has the signals that end a program handled. Of those that whoever started it has ignored (`nohup`, a shell's job in the
/// background) each stays so.
#[cfg(unix)]
pub fn at_the_end(handle: impl Fn(i32) + Send + 'static) -> Result<(), Failure> {
    use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
    use signal_hook::iterator::Signals;

    let ignored = ignored();
    let heard = [SIGHUP, SIGINT, SIGTERM].into_iter().filter(|signal| ignored & 1 << (signal - 1) == 0);
    let mut signals = Signals::new(heard).map_err(|error| Failure::Output(io::Error::other(error)))?;
    std::thread::spawn(move || signals.forever().for_each(handle));
    Ok(())
}

/// A bit for each signal that is ignored (proc(5)); none where the system does not say.
#[cfg(unix)]
fn ignored() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    mask.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok()).unwrap_or_default()
}

/// As above, where there is Ctrl-C alone.
#[cfg(not(unix))]
pub fn at_the_end(handle: impl Fn(i32) + Send + 'static) -> Result<(), Failure> {
    const SIGINT: i32 = 2;
    ctrlc::set_handler(move || handle(SIGINT)).map_err(|error| Failure::Output(io::Error::other(error)))
}
