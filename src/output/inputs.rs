use std::path::{Path, PathBuf};

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
