//! The crate `parquet` panics on some damaged pages: here that is an error as any other.

use crate::read::error::TraceFault;
use std::cell::Cell;
use std::panic::{self, AssertUnwindSafe};
use std::sync::Once;

thread_local! {
    static GUARDED: Cell<bool> = const { Cell::new(false) };
}

/// Runs `read`; a panic within is damage of the file, and nobody hears of it but by the error. What `read` leaves half-done
/// must not be used after an error.
pub(super) fn guarded<T>(read: impl FnOnce() -> Result<T, TraceFault>) -> Result<T, TraceFault> {
    static HOOK: Once = Once::new();
    HOOK.call_once(|| {
        let before = panic::take_hook();
        panic::set_hook(Box::new(move |panic| {
            if !GUARDED.get() {
                before(panic);
            }
        }));
    });
    GUARDED.set(true);
    let result = panic::catch_unwind(AssertUnwindSafe(read));
    GUARDED.set(false);
    result.unwrap_or_else(|_| {
        Err(TraceFault::Damaged("a page of the Parquet file contradicts itself".to_owned()))
    })
}
