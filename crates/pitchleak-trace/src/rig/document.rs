//! A rig file as spanned TOML: every read names section, key and line when it fails.

use super::bound::Bound;
use crate::units::{self, UnitError};
use std::fmt;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// The whole text, to turn a byte offset into a line.
pub(super) struct Document<'a> {
    pub(super) file: &'a str,
    pub(super) text: &'a str,
}

impl Document<'_> {
    pub(super) fn fail(&self, offset: Option<usize>, fault: Fault) -> RigError {
        let line = offset.and_then(|end| self.text.get(..end)).map(|head| head.matches('\n').count() + 1);
        RigError::Content { place: Place { file: self.file.to_owned(), line }, fault }
    }
}

/// One table of the file, or the absence of an optional one.
pub(super) struct Section<'a> {
    document: &'a Document<'a>,
    name: String,
    table: Option<&'a DeTable<'a>>,
    offset: Option<usize>,
}

impl<'a> Section<'a> {
    pub(super) fn root(document: &'a Document<'a>, table: &'a DeTable<'a>) -> Self {
        Self { document, name: String::new(), table: Some(table), offset: None }
    }

    pub(super) fn is_present(&self) -> bool {
        self.table.is_some()
    }

    /// Fails on the first key that is not among `keys`.
    pub(super) fn allow(&self, keys: &[&str]) -> Result<(), RigError> {
        let Some((key, _)) = self.entries().find(|(key, _)| !keys.contains(&key.get_ref().as_ref())) else {
            return Ok(());
        };
        let fault = Fault::UnknownKey { key: self.path(key.get_ref()), allowed: keys.join(", ") };
        Err(self.document.fail(Some(key.span().start), fault))
    }

    /// The keys of this table.
    pub(super) fn keys(&self) -> impl Iterator<Item = &'a str> {
        self.entries().map(|(key, _)| key.get_ref().as_ref())
    }

    /// The table under `key`; an absent one is an empty section.
    pub(super) fn section(&self, key: &str) -> Result<Section<'a>, RigError> {
        let (document, name) = (self.document, self.path(key));
        let Some(value) = self.value(key) else {
            return Ok(Self { document, name, table: None, offset: self.offset });
        };
        let offset = Some(value.span().start);
        match value.get_ref() {
            DeValue::Table(table) => Ok(Self { document, name, table: Some(table), offset }),
            _ => Err(self.kind(key, "a table")),
        }
    }

    /// The number under `key`, in SI and within `bound`.
    pub(super) fn quantity(&self, key: &str, bound: Bound) -> Result<Option<f64>, RigError> {
        let dimension = bound.dimension;
        let Some(value) = self.value(key) else { return Ok(None) };
        let si = match value.get_ref() {
            DeValue::String(text) => units::parse(text, dimension)
                .map_err(|source| self.fail(key, Fault::Quantity { key: self.path(key), source }))?,
            DeValue::Integer(digits) => i64::from_str_radix(digits.as_str(), digits.radix())
                .map_err(|_| self.kind(key, "a number in the range of a 64-bit integer"))?
                as f64,
            DeValue::Float(digits) => {
                digits.as_str().parse().map_err(|_| self.kind(key, "a finite number"))?
            }
            _ => return Err(self.kind(key, &format!("a quantity, e.g. \"1 {}\"", dimension.si()))),
        };
        if bound.holds(si) {
            return Ok(Some(si));
        }
        Err(self.impossible(key, &format!("{si} {}", dimension.si()), &bound.text()))
    }

    /// As [`quantity`](Self::quantity), where the key must be there.
    pub(super) fn required(&self, key: &str, bound: Bound) -> Result<f64, RigError> {
        self.quantity(key, bound)?.ok_or_else(|| {
            if let Some((offset, note)) = self.blank(key) {
                return self.document.fail(Some(offset), Fault::Blank { key: self.path(key), note });
            }
            self.missing(key, &bound.text())
        })
    }

    /// Where a key stands as a blank to fill in, `# area_a = "…"   # where it is found`, and that note.
    fn blank(&self, key: &str) -> Option<(usize, String)> {
        let start = self.offset?;
        let mut at = start;
        for line in self.document.text.get(start..)?.split_inclusive('\n') {
            if at > start && line.trim_start().starts_with('[') {
                return None;
            }
            let value = line
                .trim_start()
                .strip_prefix('#')
                .map(str::trim_start)
                .and_then(|line| line.strip_prefix(key));
            if let Some(value) = value.and_then(|value| value.trim_start().strip_prefix('=')) {
                let note = value.split_once('#').map_or("", |(_, note)| note);
                return Some((at, note.trim().to_owned()));
            }
            at += line.len();
        }
        None
    }

    /// The string under `key`.
    pub(super) fn text(&self, key: &str) -> Result<Option<&'a str>, RigError> {
        match self.value(key).map(|value| value.get_ref()) {
            None => Ok(None),
            Some(DeValue::String(text)) => Ok(Some(text.as_ref())),
            Some(_) => Err(self.kind(key, "a text in quotes")),
        }
    }

    /// What the word under `key` stands for; `allowed` are the words that stand for something.
    pub(super) fn named<T>(
        &self,
        key: &str,
        by_name: impl Fn(&str) -> Option<T>,
        allowed: &str,
    ) -> Result<Option<T>, RigError> {
        let Some(name) = self.text(key)? else { return Ok(None) };
        by_name(name).map(Some).ok_or_else(|| self.impossible(key, name, allowed))
    }

    /// Whether `key` is there.
    pub(super) fn has(&self, key: &str) -> bool {
        self.value(key).is_some()
    }

    /// Whether `key` holds a table.
    pub(super) fn is_table(&self, key: &str) -> bool {
        self.value(key).is_some_and(|value| value.get_ref().is_table())
    }

    pub(super) fn impossible(&self, key: &str, value: &str, allowed: &str) -> RigError {
        let (key_path, value) = (self.path(key), value.trim().to_owned());
        self.fail(key, Fault::Impossible { key: key_path, value, allowed: allowed.to_owned() })
    }

    pub(super) fn missing(&self, key: &str, wanted: &str) -> RigError {
        let fault = Fault::MissingKey { key: self.path(key), wanted: wanted.to_owned() };
        self.document.fail(self.offset, fault)
    }

    pub(super) fn fail(&self, key: &str, fault: Fault) -> RigError {
        self.document.fail(self.value(key).map(|value| value.span().start), fault)
    }

    pub(super) fn path(&self, key: &str) -> String {
        if self.name.is_empty() { key.to_owned() } else { format!("{}.{key}", self.name) }
    }

    fn kind(&self, key: &str, wanted: &str) -> RigError {
        self.fail(key, Fault::Kind { key: self.path(key), wanted: wanted.to_owned() })
    }

    fn entries(
        &self,
    ) -> impl Iterator<Item = (&'a Spanned<toml::de::DeString<'a>>, &'a Spanned<DeValue<'a>>)> {
        self.table.into_iter().flat_map(|table| table.iter())
    }

    fn value(&self, key: &str) -> Option<&'a Spanned<DeValue<'a>>> {
        self.table.and_then(|table| table.get(key))
    }
}

/// Where in a rig file something stands.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Place {
    /// The file as the user named it.
    pub file: String,
    /// Line, from 1, where one is known.
    pub line: Option<usize>,
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.line {
            Some(line) => write!(f, "{}:{line}", self.file),
            None => f.write_str(&self.file),
        }
    }
}

/// What is wrong with a rig file.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Fault {
    /// The text is not TOML.
    #[error("not a TOML file: {0}")]
    Syntax(String),
    /// A key that no rig file has.
    #[error("unknown key `{key}`; allowed here: {allowed}")]
    UnknownKey {
        /// With its section, e.g. `cylinder.aera_a`.
        key: String,
        /// The keys that may stand there.
        allowed: String,
    },
    /// A key that every rig file must have.
    #[error("missing key `{key}`: {wanted}")]
    MissingKey {
        /// With its section.
        key: String,
        /// What belongs there.
        wanted: String,
    },
    /// A key of a file that `init` began, which nobody has filled in.
    #[error("`{key}` is still blank: take its `#` away and write the number there; {note}")]
    Blank {
        /// With its section.
        key: String,
        /// Where the number is found.
        note: String,
    },
    /// The value is of another kind, e.g. a list.
    #[error("`{key}` must be {wanted}")]
    Kind {
        /// With its section.
        key: String,
        /// What belongs there.
        wanted: String,
    },
    /// The value is no quantity, or has a wrong unit.
    #[error("`{key}`: {source}")]
    Quantity {
        /// With its section.
        key: String,
        /// What is wrong with the quantity.
        source: UnitError,
    },
    /// The value can't be.
    #[error("`{key}` is {value}; it must be {allowed}")]
    Impossible {
        /// With its section.
        key: String,
        /// The value as understood.
        value: String,
        /// The values allowed.
        allowed: String,
    },
}

/// Error returned by [`Rig::load`](super::Rig::load) and [`Rig::parse`](super::Rig::parse).
#[derive(Debug, thiserror::Error)]
pub enum RigError {
    /// The file cannot be read.
    #[error("{file}: {source}")]
    Read {
        /// The file as the user named it.
        file: String,
        /// What the system says.
        source: std::io::Error,
    },
    /// The file does not describe a rig.
    #[error("{place}: {fault}")]
    Content {
        /// File and line.
        place: Place,
        /// What is wrong there.
        fault: Fault,
    },
}
