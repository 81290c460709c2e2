//! Files that a run writes: whole or not at all, and never over what it reads.
//!
//! A file is written beside its place under a name of its own, synced, and renamed. A run that fails or is killed leaves
//! the old file; a kill may leave a hidden `.pitchleak-….tmp` too, which [`abandon`] removes where there is time for it. What is no regular file (a pipe, a device) is written
//! to as it is.

mod fault;
#[cfg(feature = "parquet")]
pub(crate) mod parquet;
mod replacement;

pub use replacement::abandon;

use flate2::Compression;
use flate2::write::GzEncoder;
use replacement::Replacement;
use std::fs::{self, File, OpenOptions};
use std::io::{self, BufWriter, ErrorKind, Write};
use std::path::{Path, PathBuf};

/// Why a file is not written.
#[derive(Debug, thiserror::Error)]
pub enum OutputError {
    /// It would take the place of a file that the run reads.
    #[error("{path}: not written over the run's own input {input}", path = path.display(), input = input.display())]
    OverInput {
        /// The output as the user named it.
        path: PathBuf,
        /// The input as the user named it.
        input: PathBuf,
    },
    /// The system refuses.
    #[error("cannot write {path}: {source}", path = path.display())]
    Write {
        /// As the user named it.
        path: PathBuf,
        /// What the system says.
        source: io::Error,
    },
}

/// A file being written; gzip where its name ends in `.gz`. Without [`finish`](Self::finish) it never was.
pub struct OutputFile {
    path: PathBuf,
    coding: Coding,
}

enum Coding {
    Plain(BufWriter<Sink>),
    Gzip(Box<GzEncoder<BufWriter<Sink>>>),
}

impl Coding {
    #[inline]
    fn out(&mut self) -> &mut dyn Write {
        match self {
            Self::Plain(out) => out,
            Self::Gzip(out) => out,
        }
    }

    /// Its bytes, all on the disk.
    fn sealed(self) -> io::Result<Sink> {
        let out = match self {
            Self::Plain(out) => out,
            Self::Gzip(encoder) => encoder.finish()?,
        };
        let mut sink = out.into_inner().map_err(io::IntoInnerError::into_error)?;
        sink.seal()?;
        Ok(sink)
    }
}

enum Sink {
    Replacement(Replacement),
    Device(File),
}

impl OutputFile {
    /// Makes sure that `path` can be written and is not one of `inputs`.
    ///
    /// # Errors
    /// [`OutputError`].
    pub fn create(path: impl AsRef<Path>, inputs: &Inputs) -> Result<Self, OutputError> {
        let path = path.as_ref().to_owned();
        if let Some(input) = inputs.at(&path) {
            return Err(OutputError::OverInput { input: input.to_owned(), path });
        }
        let sink = match Sink::open(&path) {
            Ok(sink) => BufWriter::new(sink),
            Err(source) => return Err(OutputError::Write { path, source }),
        };
        let gzip = path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("gz"));
        let coding = if gzip {
            // Files a twelfth larger than by the usual level, in an eighth of its time.
            Coding::Gzip(Box::new(GzEncoder::new(sink, Compression::fast())))
        } else {
            Coding::Plain(sink)
        };
        Ok(Self { path, coding })
    }

    /// Ends it: from here on it is at its path, whole.
    ///
    /// # Errors
    /// [`OutputError::Write`]; then the old file is still there, unless only the folder could not be synced.
    pub fn finish(self) -> Result<(), OutputError> {
        finish_all([self])
    }

    /// Writes all of it and ends it.
    ///
    /// # Errors
    /// As [`finish`](Self::finish).
    pub fn finish_with(mut self, bytes: impl AsRef<[u8]>) -> Result<(), OutputError> {
        self.write_all(bytes.as_ref()).map_err(|source| self.error(source))?;
        self.finish()
    }

    /// What a failed write to it means.
    pub fn error(&self, source: io::Error) -> OutputError {
        OutputError::Write { path: self.path.clone(), source }
    }
}

impl Write for OutputFile {
    #[inline]
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.coding.out().write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.coding.out().flush()
    }
}

impl Sink {
    fn open(path: &Path) -> io::Result<Self> {
        // A link stays one: what it points to is replaced.
        let target = fs::canonicalize(path).unwrap_or_else(|_| path.to_owned());
        let Ok(old) = fs::metadata(&target) else {
            return Replacement::of(target).map(Self::Replacement);
        };
        // Renaming would pass over a file's protection, and wait until the end to find a folder.
        let opened = OpenOptions::new().write(true).open(&target)?;
        if old.is_file() { Replacement::of(target).map(Self::Replacement) } else { Ok(Self::Device(opened)) }
    }

    fn out(&mut self) -> &mut dyn Write {
        match self {
            Self::Replacement(file) => file,
            Self::Device(file) => file,
        }
    }

    fn seal(&mut self) -> io::Result<()> {
        match self {
            Self::Replacement(file) => file.seal(),
            Self::Device(file) => file.flush(),
        }
    }

    fn place(self) -> io::Result<()> {
        match self {
            Self::Replacement(file) => file.place(),
            Self::Device(_) => Ok(()),
        }
    }
}

impl Write for Sink {
    /// Again where a signal came within it: not every writer above does that.
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        loop {
            match self.out().write(bytes) {
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                done => return done,
            }
        }
    }

    fn flush(&mut self) -> io::Result<()> {
        self.out().flush()
    }
}

/// Ends files that belong together: the first gets its place once all are on the disk.
///
/// # Errors
/// As [`OutputFile::finish`].
pub(crate) fn finish_all(files: impl IntoIterator<Item = OutputFile>) -> Result<(), OutputError> {
    let sealed = |OutputFile { path, coding }| match coding.sealed() {
        Ok(sink) => Ok((path, sink)),
        Err(source) => Err(OutputError::Write { path, source }),
    };
    let sealed = files.into_iter().map(sealed).collect::<Result<Vec<_>, _>>()?;
    sealed
        .into_iter()
        .try_for_each(|(path, sink)| sink.place().map_err(|source| OutputError::Write { path, source }))
}

/// Writes a whole file at once.
///
/// # Errors
/// [`OutputError`].
pub fn write(path: impl AsRef<Path>, bytes: impl AsRef<[u8]>, inputs: &Inputs) -> Result<(), OutputError> {
    OutputFile::create(path, inputs)?.finish_with(bytes)
}

/// Makes the folder where it is not there, and finds out whether files can be made in it.
///
/// # Errors
/// [`OutputError::Write`].
pub fn make_folder(folder: &Path) -> Result<(), OutputError> {
    let made = fs::create_dir_all(folder).and_then(|()| Replacement::of(folder.join("output")));
    // Not placed, it goes.
    made.map(drop).map_err(|source| OutputError::Write { path: folder.to_owned(), source })
}

/// The files that a run reads. They are known by their identity, so that another name or a link doesn't hide one.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Inputs(Vec<(PathBuf, Identity)>);

/// Device and number of the file there.
#[cfg(unix)]
pub(crate) type Identity = (u64, u64);

/// The path without links; a hard link is another file.
#[cfg(not(unix))]
pub(crate) type Identity = PathBuf;

impl Inputs {
    /// Those among `paths` that are files; `-` is standard input.
    pub fn of(paths: impl IntoIterator<Item = impl AsRef<Path>>) -> Self {
        let known = |path: &Path| Some((path.to_owned(), identity(path)?));
        Self(paths.into_iter().filter_map(|path| known(path.as_ref())).collect())
    }

    /// With those of another list.
    #[must_use]
    pub fn and(mut self, others: Self) -> Self {
        self.0.extend(others.0);
        self
    }

    /// The input that lies at `path`.
    pub(super) fn at(&self, path: &Path) -> Option<&Path> {
        let identity = identity(path)?;
        self.0.iter().find(|(_, input)| *input == identity).map(|(path, _)| path.as_path())
    }
}

#[cfg(unix)]
pub(crate) fn identity(path: &Path) -> Option<Identity> {
    use std::os::unix::fs::MetadataExt;
    let path = if path == Path::new("-") { Path::new("/dev/stdin") } else { path };
    // Not opened: that would take from a pipe, or wait for one.
    let metadata = std::fs::metadata(path).ok().filter(std::fs::Metadata::is_file)?;
    Some((metadata.dev(), metadata.ino()))
}

#[cfg(not(unix))]
pub(crate) fn identity(path: &Path) -> Option<Identity> {
    std::fs::canonicalize(path).ok().filter(|path| path.is_file())
}

#[cfg(test)]
mod tests;
