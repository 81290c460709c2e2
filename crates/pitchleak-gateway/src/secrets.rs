//! Certificates, keys and passwords: read from files, and who else could read them.

use crate::failure::Failure;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};

/// A path that begins so is in the folder that systemd gives a service its credentials in (`systemd.exec(5)`).
const CREDENTIALS: &str = "$CREDENTIALS_DIRECTORY/";

/// Who we are.
#[derive(Clone, PartialEq, Eq)]
pub struct Identity {
    /// PEM, with those between it and the authority.
    pub certificate: Vec<u8>,
    /// PEM.
    pub key: Vec<u8>,
}

#[derive(Clone, PartialEq, Eq)]
pub struct Login {
    pub user: String,
    pub password: String,
}

impl std::fmt::Debug for Identity {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Identity")
    }
}

impl std::fmt::Debug for Login {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Login").field("user", &self.user).finish_non_exhaustive()
    }
}

/// Reads the files that a configuration names.
pub struct Files<'a> {
    /// The configuration: paths are from its folder.
    pub config: &'a Path,
    /// What whoever set it up should know.
    pub warnings: Vec<String>,
}

impl Files<'_> {
    pub fn path(&self, file: &Path) -> Result<PathBuf, Failure> {
        let Some(name) = file.to_str().and_then(|path| path.strip_prefix(CREDENTIALS)) else {
            return Ok(self.config.parent().unwrap_or(Path::new("")).join(file));
        };
        let folder = std::env::var_os("CREDENTIALS_DIRECTORY");
        let none =
            || Failure::content(self.config, format!("{}: systemd gives no credentials", file.display()));
        folder.map(|folder| PathBuf::from(folder).join(name)).ok_or_else(none)
    }

    /// Certificates in PEM.
    pub fn certificate(&self, file: &Path) -> Result<Vec<u8>, Failure> {
        self.pem(&self.path(file)?, "CERTIFICATE-----")
    }

    /// A private key in PEM.
    pub fn key(&mut self, file: &Path) -> Result<Vec<u8>, Failure> {
        let path = self.path(file)?;
        self.warn_if_open(&path);
        self.pem(&path, "PRIVATE KEY-----")
    }

    /// Its one line.
    pub fn password(&mut self, file: &Path) -> Result<String, Failure> {
        let path = self.path(file)?;
        self.warn_if_open(&path);
        let text = String::from_utf8(read(&path)?).map_err(|_| Failure::content(&path, "not UTF-8"))?;
        match text.lines().next() {
            Some(line) if !line.is_empty() => Ok(line.to_owned()),
            _ => Err(Failure::content(&path, "no password in its first line")),
        }
    }

    fn pem(&self, path: &Path, what: &str) -> Result<Vec<u8>, Failure> {
        let bytes = read(path)?;
        if String::from_utf8_lossy(&bytes).contains(what) {
            return Ok(bytes);
        }
        let what = what.trim_end_matches('-').to_lowercase();
        Err(Failure::content(path, format!("no {what} in PEM")))
    }

    /// A secret is one's own.
    fn warn_if_open(&mut self, path: &Path) {
        let mode = std::fs::metadata(path).map_or(0, |about| about.permissions().mode());
        if mode & 0o077 != 0 {
            let mode = mode & 0o777;
            self.warnings.push(format!(
                "{}: others can read this secret (mode {mode:03o}): chmod 600",
                path.display()
            ));
        }
    }
}

pub fn read(path: &Path) -> Result<Vec<u8>, Failure> {
    std::fs::read(path).map_err(|source| Failure::Read { path: path.to_owned(), source })
}
