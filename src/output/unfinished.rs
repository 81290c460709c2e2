//! Temporaries of this process that have no place yet.

use std::collections::BTreeSet;
use std::fs;
use std::path::PathBuf;
use std::sync::{Mutex, MutexGuard, PoisonError};

static UNFINISHED: Mutex<BTreeSet<PathBuf>> = Mutex::new(BTreeSet::new());

/// While it is held no file begins and none is finished.
pub(super) fn unfinished() -> MutexGuard<'static, BTreeSet<PathBuf>> {
    UNFINISHED.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Removes every file that this process has begun and not finished, for a process that ends at once: whichever of its
/// threads would begin or finish one from here on waits for ever.
pub fn abandon() {
    let mut unfinished = unfinished();
    for path in std::mem::take(&mut *unfinished) {
        // Gone already or not to be removed: there is nobody left to tell.
        let _ = fs::remove_file(path);
    }
    std::mem::forget(unfinished);
}
