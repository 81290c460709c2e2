//! What a bench is asked for: words and `name=value`, in any order.

use std::process::Command;
use std::str::FromStr;

/// The words after `--`.
pub struct Options(Vec<String>);

impl Options {
    /// Of this process; what cargo adds is left out.
    pub fn of_arguments() -> Self {
        Self(std::env::args().skip(1).filter(|word| !word.starts_with("--")).collect())
    }

    /// The value of a name.
    pub fn value(&self, name: &str) -> Option<&str> {
        self.0.iter().find_map(|word| word.strip_prefix(name)?.strip_prefix('='))
    }

    /// The same as a number; none where it is none.
    pub fn number<T: FromStr>(&self, name: &str) -> Option<T> {
        self.value(name)?.parse().ok()
    }

    /// Whether a word is there.
    pub fn has(&self, word: &str) -> bool {
        self.0.iter().any(|own| own == word)
    }

    /// Words that end like that, such as files.
    pub fn ending_in<'a>(&'a self, ending: &'a str) -> impl Iterator<Item = &'a String> {
        self.0.iter().filter(move |word| word.ends_with(ending))
    }

    /// `seed`, else the version's commit, else `0`.
    pub fn seed(&self) -> String {
        let commit = || {
            let git = Command::new("git").args(["rev-parse", "--short=7", "HEAD"]).output().ok()?;
            Some(String::from_utf8(git.stdout).ok()?.trim().to_owned())
        };
        let seed = self.value("seed").map(str::to_owned).or_else(commit);
        seed.filter(|seed| !seed.is_empty()).unwrap_or("0".into())
    }
}
