//! The cylinders' states in a folder, a file for each, so that what is wrong with one is nobody else's. A record is put behind
//! those before while that is the least to write; then a new file begins, and the one before is kept.

use super::cylinder::Cylinder;
use super::event::NoticeEvent;
use super::record::{self, Records};
use super::watch::Watch;
use crate::Rig;
use crate::output::{self, OutputError};
use percent_encoding::{AsciiSet, NON_ALPHANUMERIC, percent_decode_str, utf8_percent_encode};
use std::collections::{BTreeMap, BTreeSet};
use std::fs::{self, File, TryLockError};
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};

/// Folder of the states, in the folder that is given.
const CYLINDERS: &str = "cylinders";
/// Whose process has the folder for itself.
const LOCK: &str = "lock";

const STATE: &str = "state";
const BEFORE: &str = "state.before";
/// Being written.
const NEW: &str = "state.new";
/// What a cylinder could not go on from, kept for whoever asks why.
const ASIDE: &str = "state.aside";

/// What stays as it is in the name of a file.
const PLAIN: &AsciiSet = &NON_ALPHANUMERIC.remove(b'-').remove(b'_');
/// Bytes of a cylinder's name in that of a file: with an ending, file systems take 255.
const LONGEST_NAME: usize = 240;
/// A file grows to so many times its first record. More writes less, and a restart reads more; chosen.
const GROWTH: usize = 5;

/// Whether a cylinder may have this name.
pub(super) fn can_name(name: &str) -> bool {
    !name.contains(char::is_control)
        && utf8_percent_encode(name, PLAIN).map(str::len).sum::<usize>() <= LONGEST_NAME
}

/// The folder, which nobody else has meanwhile.
#[derive(Debug)]
pub struct Checkpoint {
    folder: PathBuf,
    _lock: File,
    /// Files that a record may be put behind.
    files: Mutex<BTreeMap<String, Written>>,
}

/// A file of this process.
#[derive(Clone, Copy, Debug)]
struct Written {
    /// Blocks that its last state has taken in.
    blocks: u64,
    /// Bytes of its first record, none where there is no file before, and of all.
    first: usize,
    all: usize,
}

/// What a [`Watch`] knew of some cylinders at one moment, to be written while it goes on.
#[derive(Default)]
pub struct Snapshot {
    cylinders: BTreeMap<String, Cylinder>,
    /// States that nobody goes on from.
    aside: BTreeMap<String, Cylinder>,
}

impl Snapshot {
    /// Of the cylinders that changed since the last one.
    pub fn of(watch: &mut Watch) -> Self {
        let changed = watch.cylinders.iter_mut().filter(|(_, cylinder)| cylinder.changed);
        let as_of_now = |(name, cylinder): (&String, &mut Cylinder)| {
            let now = (name.clone(), cylinder.clone());
            cylinder.changed = false;
            cylinder.stream.forget_fresh();
            now
        };
        let mut cylinders: BTreeMap<_, _> = changed.map(as_of_now).collect();
        cylinders.append(&mut watch.gone);
        Self { cylinders, aside: std::mem::take(&mut watch.replaced) }
    }

    /// Whether nothing changed.
    pub fn is_empty(&self) -> bool {
        self.cylinders.is_empty() && self.aside.is_empty()
    }

    /// It could not be written: all of it goes into the next one.
    pub fn give_back(self, watch: &mut Watch) {
        for (name, cylinder) in self.cylinders {
            match watch.cylinders.get_mut(&name) {
                Some(known) => known.changed = true,
                None => _ = watch.gone.entry(name).or_insert(cylinder),
            }
        }
        for (name, cylinder) in self.aside {
            watch.replaced.entry(name).or_insert(cylinder);
        }
    }
}

/// Why there is no checkpoint.
#[derive(Debug, thiserror::Error)]
pub enum CheckpointError {
    /// There is no folder for it, or the disk does not take it.
    #[error(transparent)]
    Write(#[from] OutputError),
    /// Another process keeps its state there: both would spoil it.
    #[error("{folder}: another process keeps its state there")]
    Taken {
        /// The folder.
        folder: String,
    },
    /// The system does not let us read it.
    #[error("cannot read {file}: {source}")]
    Read {
        /// Which.
        file: String,
        /// What the system says.
        source: io::Error,
    },
}

impl Checkpoint {
    /// Makes the folder where it is not there, and takes it for this process.
    ///
    /// # Errors
    /// Where files cannot be made in it, or another process has it.
    pub fn new(folder: impl AsRef<Path>) -> Result<Self, CheckpointError> {
        let folder = folder.as_ref();
        output::make_folder(folder)?;
        let path = folder.join(LOCK);
        let write = |source| not_written(&path, source);
        let lock = File::options().create(true).truncate(false).write(true).open(&path).map_err(write)?;
        lock.try_lock().map_err(|error| match error {
            TryLockError::WouldBlock => CheckpointError::Taken { folder: folder.display().to_string() },
            TryLockError::Error(source) => write(source),
        })?;
        let folder = folder.join(CYLINDERS);
        output::make_folder(&folder)?;
        Ok(Self { folder, _lock: lock, files: Mutex::default() })
    }

    /// Writes what was known; says how many bytes it took.
    ///
    /// # Errors
    /// Where the disk does not take it; then each cylinder's state is the old one or the new one.
    pub fn save(&self, snapshot: &Snapshot) -> Result<usize, CheckpointError> {
        let mut files = self.files();
        let mut bytes = 0;
        for (name, cylinder) in &snapshot.aside {
            files.remove(name);
            bytes += self.begin(name, cylinder, ASIDE)?;
        }
        for (name, cylinder) in &snapshot.cylinders {
            bytes += self.put(&mut files, name, cylinder)?;
        }
        let synced = File::open(&self.folder).and_then(|folder| folder.sync_all());
        synced.map(|()| bytes).map_err(|source| not_written(&self.folder, source))
    }

    fn files(&self) -> MutexGuard<'_, BTreeMap<String, Written>> {
        self.files.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Puts a state behind those before, and begins a new file where there is none or it is long.
    fn put(
        &self,
        files: &mut BTreeMap<String, Written>,
        name: &str,
        cylinder: &Cylinder,
    ) -> Result<usize, CheckpointError> {
        let [before, blocks] = cylinder.stream.blocks();
        let mut more = 0;
        // It is known again once it is written.
        if let Some(mut file) = files.remove(name).filter(|file| file.blocks == before) {
            more = self.append(name, cylinder, file.all)?;
            file = Written { blocks, all: file.all + more, ..file };
            if file.all < GROWTH * file.first {
                files.insert(name.to_owned(), file);
                return Ok(more);
            }
        }
        // The file before ends with the same state: where this one is damaged nothing is lost.
        let has_before = self.file(name, STATE).exists();
        let all = self.begin(name, cylinder, STATE)?;
        files.insert(name.to_owned(), Written { blocks, first: if has_before { all } else { 0 }, all });
        Ok(more + all)
    }

    /// One more record, all on the disk.
    fn append(&self, name: &str, cylinder: &Cylinder, end: usize) -> Result<usize, CheckpointError> {
        let written = record::since(name, cylinder).and_then(|bytes| {
            let mut file = File::options().append(true).open(self.file(name, STATE))?;
            let written = file.write_all(&bytes).and_then(|()| file.sync_data());
            written.inspect_err(|_| _ = file.set_len(end as u64)).map(|()| bytes.len())
        });
        written.map_err(|source| not_written(&self.file(name, STATE), source))
    }

    /// A new file, all on the disk.
    fn begin(&self, name: &str, cylinder: &Cylinder, ending: &str) -> Result<usize, CheckpointError> {
        let written = record::whole(name, cylinder).and_then(|bytes| {
            let mut new = File::create(self.file(name, NEW))?;
            new.write_all(&bytes)?;
            new.sync_all()?;
            self.place(name, ending)?;
            Ok(bytes.len())
        });
        written.map_err(|source| {
            // Room for what else the disk has to take.
            let _ = fs::remove_file(self.file(name, NEW));
            not_written(&self.file(name, STATE), source)
        })
    }

    /// Gives it its name. A moment without a state under that name there is not.
    fn place(&self, name: &str, ending: &str) -> io::Result<()> {
        if ending == STATE {
            let before = self.file(name, BEFORE);
            let _ = fs::remove_file(&before);
            // None yet, or a file system that knows no links: then there is no state before.
            let _ = fs::hard_link(self.file(name, STATE), before);
        }
        fs::rename(self.file(name, NEW), self.file(name, ending))
    }

    fn file(&self, name: &str, ending: &str) -> PathBuf {
        self.folder.join(format!("{}.{ending}", utf8_percent_encode(name, PLAIN)))
    }

    /// Each cylinder that is not watched yet goes on from its last state, if there is one. Where that is damaged the one
    /// before is used. Where that is damaged, too, or the cylinder has another rig now, it begins anew and its state is put
    /// aside. Both is said; the others know nothing of it.
    ///
    /// # Errors
    /// Where the folder cannot be read.
    pub fn restore(&self, watch: &mut Watch) -> Result<Vec<NoticeEvent>, CheckpointError> {
        let read = |source| CheckpointError::Read { file: self.folder.display().to_string(), source };
        let entries = fs::read_dir(&self.folder).map_err(read)?;
        let names: BTreeSet<_> =
            entries.filter_map(|entry| name_of(&entry.ok()?.file_name().into_string().ok()?)).collect();
        let mut notices = Vec::new();
        for name in names {
            if watch.cylinders.contains_key(&name) || watch.config().rig_of(&name).is_none() {
                continue;
            }
            let restored = self.restore_one(watch, &name);
            notices.extend(restored.err().map(|text| NoticeEvent::once(name, "checkpoint", text)));
        }
        Ok(notices)
    }

    /// What there is to say, if something is wrong.
    fn restore_one(&self, watch: &mut Watch, name: &str) -> Result<(), String> {
        let file = self.file(name, STATE);
        if watch.cylinders() >= watch.config().most_cylinders {
            return Err(format!("{}: there are too many cylinders", file.display()));
        }
        let Some(rig) = watch.config().rig_of(name) else { return Ok(()) };
        self.files().remove(name);
        let (why, cylinder) = match [STATE, BEFORE].map(|ending| self.read(name, ending, rig)) {
            [None, None] => return Ok(()),
            [Some(Records { cylinder: Some(cylinder), damage: None, .. }), _] => {
                watch.cylinders.insert(name.to_owned(), cylinder);
                return Ok(());
            }
            [Some(Records { cylinder: Some(cylinder), damage: Some(why), sound }), _] => {
                self.cut(name, sound);
                (why, Some(cylinder))
            }
            [newest, before] => {
                let why = newest.map_or("missing".to_owned(), |newest| newest.damage.unwrap_or_default());
                let cylinder = before.and_then(|before| before.cylinder);
                self.put_aside(name, cylinder.is_some());
                (why, cylinder)
            }
        };
        let then = if cylinder.is_some() { "the one before is used" } else { "the cylinder begins anew" };
        watch.cylinders.extend(cylinder.map(|cylinder| (name.to_owned(), cylinder)));
        Err(format!("{}: {why}: {then}", file.display()))
    }

    /// What a file holds for a cylinder of this rig; none where there is no file.
    fn read(&self, name: &str, ending: &str, rig: &Rig) -> Option<Records> {
        let broken = |damage| Records { cylinder: None, sound: 0, damage: Some(damage) };
        match fs::read(self.file(name, ending)) {
            Ok(bytes) => Some(match record::read(&bytes, name) {
                Records { cylinder: Some(cylinder), .. } if !cylinder.is_of(rig) => {
                    broken("of another rig than it has now".to_owned())
                }
                records => records,
            }),
            Err(error) if error.kind() == io::ErrorKind::NotFound => None,
            Err(error) => Some(broken(error.to_string())),
        }
    }

    /// Keeps what is sound of a file; all of it stays aside.
    fn cut(&self, name: &str, sound: usize) {
        let file = self.file(name, STATE);
        let _ = fs::copy(&file, self.file(name, ASIDE));
        let _ = File::options().write(true).open(&file).and_then(|file| file.set_len(sound as u64));
    }

    /// Nobody goes on from the newest file, and from the one before only where that is used.
    fn put_aside(&self, name: &str, uses_before: bool) {
        let [aside, before] = [ASIDE, BEFORE].map(|ending| self.file(name, ending));
        // Else the next checkpoint would put it in the place of the one before.
        let is_aside = fs::rename(self.file(name, STATE), &aside).is_ok();
        if !uses_before {
            let _ = if is_aside { fs::remove_file(before) } else { fs::rename(before, aside) };
        }
    }
}

fn not_written(path: &Path, source: io::Error) -> CheckpointError {
    OutputError::Write { path: path.to_owned(), source }.into()
}

/// Of the cylinder whose state a file holds.
fn name_of(file: &str) -> Option<String> {
    let (stem, ending) = file.split_once('.')?;
    let name = percent_decode_str(stem).decode_utf8().ok()?;
    ([STATE, BEFORE].contains(&ending) && utf8_percent_encode(&name, PLAIN).to_string() == stem)
        .then(|| name.into_owned())
}
