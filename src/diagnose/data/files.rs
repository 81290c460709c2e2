//! Which files are fitted and which are judged on: never the same one, whatever it is called.

use crate::output::{Identity, identity};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// What tells one input from another, whatever path or link leads to it.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Input {
    File(Identity),
    /// What is no file.
    Other(PathBuf),
}

impl Input {
    fn at(path: &Path) -> Self {
        identity(path).map_or_else(|| Self::Other(path.to_owned()), Self::File)
    }
}

/// A file to judge on that is fitted too: its error would say nothing.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{} is both fitted and judged on{}", .judged.display(), also_known_as(.judged, .fitted))]
pub struct FittedAndJudged {
    /// As it was given to be judged on.
    pub judged: PathBuf,
    /// As it was given to be fitted.
    pub fitted: PathBuf,
}

/// A file that was given twice; it is read once.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SameFile {
    /// As it was given first.
    pub first: PathBuf,
    /// As it was given again.
    pub again: PathBuf,
}

impl std::fmt::Display for SameFile {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { first, again } = self;
        write!(f, "{} is given twice{}: it is read once", again.display(), also_known_as(again, first))
    }
}

fn also_known_as(path: &Path, other: &Path) -> String {
    if path == other { String::new() } else { format!(" (as {})", other.display()) }
}

/// The files of a diagnosis, each once.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Roles {
    /// Files to fit.
    pub fitted: Vec<PathBuf>,
    /// Files to judge on.
    pub judged: Vec<PathBuf>,
    /// What was given more than once.
    pub repeated: Vec<SameFile>,
}

impl Roles {
    /// Tells the files apart before any is read.
    ///
    /// # Errors
    /// Where a file has both roles.
    pub fn of(fitted: &[PathBuf], judged: &[PathBuf]) -> Result<Self, FittedAndJudged> {
        let mut roles = Self::default();
        let fitted = roles.each_once(fitted);
        let judged = roles.each_once(judged);
        if let Some((one, judged)) = judged.iter().find(|(one, _)| fitted.iter().any(|(own, _)| own == one)) {
            let fitted = fitted.iter().find(|(own, _)| own == one).map(|(_, path)| path.clone());
            return Err(FittedAndJudged { judged: judged.clone(), fitted: fitted.unwrap_or_default() });
        }
        roles.fitted = fitted.into_iter().map(|(_, path)| path).collect();
        roles.judged = judged.into_iter().map(|(_, path)| path).collect();
        Ok(roles)
    }

    fn each_once(&mut self, paths: &[PathBuf]) -> Vec<(Input, PathBuf)> {
        let mut seen: BTreeMap<Input, PathBuf> = BTreeMap::new();
        let mut once = Vec::new();
        for path in paths {
            let input = Input::at(path);
            if let Some(first) = seen.get(&input) {
                self.repeated.push(SameFile { first: first.clone(), again: path.clone() });
                continue;
            }
            seen.insert(input.clone(), path.clone());
            once.push((input, path.clone()));
        }
        once
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_has_one_role_and_is_read_once_whatever_it_is_called() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = |name: &str| folder.path().join(name);
        for name in ["a.csv", "b.csv"] {
            std::fs::write(path(name), name).expect("a file");
        }
        let around = folder.path().join(".").join("a.csv");
        let roles = Roles::of(&[path("a.csv"), around.clone()], &[path("b.csv")]).expect("apart");
        assert_eq!((roles.fitted, roles.judged), (vec![path("a.csv")], vec![path("b.csv")]));
        assert_eq!(roles.repeated, [SameFile { first: path("a.csv"), again: around }]);
        #[cfg(unix)]
        for link in [
            std::fs::hard_link::<PathBuf, PathBuf> as fn(PathBuf, PathBuf) -> _,
            std::os::unix::fs::symlink::<PathBuf, PathBuf>,
        ] {
            link(path("a.csv"), path("c.csv")).expect("a link");
            let both = FittedAndJudged { judged: path("c.csv"), fitted: path("a.csv") };
            assert_eq!(Roles::of(&[path("a.csv")], &[path("c.csv")]), Err(both));
            std::fs::remove_file(path("c.csv")).expect("the link");
        }
        assert!(Roles::of(&[path("absent.csv")], &[path("none.csv")]).is_ok());
    }
}
