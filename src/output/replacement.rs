//! A file that takes another's place when it is whole.

use super::fault;
use std::collections::BTreeSet;
use std::fs::{self, File, OpenOptions};
use std::io::{self, ErrorKind, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{SystemTime, UNIX_EPOCH};

/// Written beside `target` under a name of its own; [`place`](Self::place) gives it the target's name. Dropped
/// before, it goes and the target stays as it was.
pub(super) struct Replacement {
    file: File,
    temporary: PathBuf,
    target: PathBuf,
    placed: bool,
}

impl Replacement {
    /// Of what is or will be at `target`, which may be written to and is no link.
    pub(super) fn of(target: PathBuf) -> io::Result<Self> {
        let (temporary, file) = create_beside(&target)?;
        let made = Self { file, temporary, target, placed: false };
        if let Ok(old) = fs::metadata(&made.target) {
            made.file.set_permissions(old.permissions())?;
        }
        Ok(made)
    }

    /// Sees to it that all bytes have reached the disk.
    pub(super) fn seal(&mut self) -> io::Result<()> {
        fault::strike()?;
        self.file.sync_all()
    }

    /// Puts it in the target's place; the name has reached the disk too.
    pub(super) fn place(mut self) -> io::Result<()> {
        fault::strike()?;
        let mut unfinished = unfinished();
        fs::rename(&self.temporary, &self.target)?;
        unfinished.remove(&self.temporary);
        drop(unfinished);
        self.placed = true;
        fault::strike()?;
        sync(folder_of(&self.target))
    }
}

impl Write for Replacement {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let count = fault::strike_write(bytes.len())?;
        self.file.write(bytes.get(..count).unwrap_or(bytes))
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
}

impl Drop for Replacement {
    fn drop(&mut self) {
        if !self.placed {
            let mut unfinished = unfinished();
            unfinished.remove(&self.temporary);
            // Gone already or not to be removed: nothing is lost by it.
            let _ = fs::remove_file(&self.temporary);
        }
    }
}

/// Names tried before it is given up.
const ATTEMPTS: u32 = 100;

/// A new file in the folder of `target`, hidden, under a name that no other run and no other thread has.
fn create_beside(target: &Path) -> io::Result<(PathBuf, File)> {
    static COUNT: AtomicU64 = AtomicU64::new(0);
    fault::strike()?;
    let mut taken = None;
    for _ in 0..ATTEMPTS {
        let nanoseconds = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |time| time.subsec_nanos());
        let count = COUNT.fetch_add(1, Ordering::Relaxed);
        let name = format!(".pitchleak-{:x}-{nanoseconds:x}-{count:x}.tmp", std::process::id());
        let path = folder_of(target).join(name);
        let mut unfinished = unfinished();
        match OpenOptions::new().write(true).create_new(true).open(&path) {
            Ok(file) => {
                unfinished.insert(path.clone());
                return Ok((path, file));
            }
            Err(error) if error.kind() == ErrorKind::AlreadyExists => taken = Some(error),
            Err(error) => return Err(error),
        }
    }
    Err(taken.unwrap_or_else(|| ErrorKind::AlreadyExists.into()))
}

fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// Where the system has folders that can be opened and synced; elsewhere the name is safe without.
fn sync(folder: &Path) -> io::Result<()> {
    let Ok(folder) = File::open(folder) else { return Ok(()) };
    match folder.sync_all() {
        Err(error) if matches!(error.kind(), ErrorKind::InvalidInput | ErrorKind::Unsupported) => Ok(()),
        done => done,
    }
}

/// Temporaries of this process that have no place yet.
static UNFINISHED: Mutex<BTreeSet<PathBuf>> = Mutex::new(BTreeSet::new());

/// While it is held no file begins and none is finished.
fn unfinished() -> MutexGuard<'static, BTreeSet<PathBuf>> {
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
