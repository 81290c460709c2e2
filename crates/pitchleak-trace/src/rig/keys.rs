//! The keys of a section, listed once: by the same list they are read, written, and named where another one stands there.

use super::bound::{self, Bound};
use super::document::{RigError, Section};
use crate::units::Dimension;

/// A key that can't be read is an error; to write and to name one is none.
pub(super) type Done = Result<(), RigError>;

/// What is done with the keys of a list, one after the other.
pub(super) enum Keys<'s> {
    /// Their names are gathered.
    Name(Vec<&'static str>),
    /// They are read from a section.
    Read(&'s Section<'s>),
    /// They are written, each with its value as text.
    Write(Vec<(String, String)>),
}

impl Keys<'_> {
    /// A quantity that may be left out, SI.
    pub(super) fn optional(&mut self, key: &'static str, bound: Bound, value: &mut Option<f64>) -> Done {
        match self {
            Self::Name(names) => names.push(key),
            Self::Read(section) => *value = section.quantity(key, bound)?,
            Self::Write(lines) => {
                lines.extend(value.map(|value| (key.to_owned(), written(value, bound))));
            }
        }
        Ok(())
    }

    /// One that is `default` where it is left out.
    pub(super) fn number(&mut self, key: &'static str, bound: Bound, value: &mut f64, default: f64) -> Done {
        let mut given = Some(*value);
        self.optional(key, bound, &mut given)?;
        *value = given.unwrap_or(default);
        Ok(())
    }

    /// One that must be there.
    pub(super) fn needed(&mut self, key: &'static str, bound: Bound, value: &mut f64) -> Done {
        match self {
            Self::Read(section) => *value = section.required(key, bound)?,
            _ => self.number(key, bound, value, 0.0)?,
        }
        Ok(())
    }

    /// A share, from none to all of something, that is `default` where it is left out.
    pub(super) fn share(&mut self, key: &'static str, value: &mut f64, default: f64) -> Done {
        self.number(key, bound::SHARE, value, default)
    }

    /// A text in quotes that may be left out; `allowed` are those that stand for something.
    pub(super) fn word<T>(
        &mut self,
        key: &'static str,
        by_name: impl Fn(&str) -> Option<T>,
        name: impl Fn(&T) -> String,
        allowed: &str,
        value: &mut Option<T>,
    ) -> Done {
        match self {
            Self::Name(names) => names.push(key),
            Self::Read(section) => *value = section.named(key, by_name, allowed)?,
            Self::Write(lines) => {
                lines.extend(value.as_ref().map(|value| (key.to_owned(), toml_text(&name(value)))));
            }
        }
        Ok(())
    }

    /// A table with keys of its own.
    pub(super) fn table<T>(
        &mut self,
        key: &'static str,
        value: &mut T,
        list: impl Fn(&mut Keys<'_>, &mut T) -> Done,
    ) -> Done {
        match self {
            Self::Name(names) => names.push(key),
            Self::Read(section) => section.section(key)?.read_into(value, list)?,
            Self::Write(lines) => {
                let inner = lines_of(value, list).into_iter();
                lines.extend(inner.map(|(name, value)| (format!("{key}.{name}"), value)));
            }
        }
        Ok(())
    }

    /// The data sheet of a sensor, in a line; `value` stays where there is none.
    pub(super) fn sheet<T>(
        &mut self,
        key: &'static str,
        value: &mut T,
        list: impl Fn(&mut Keys<'_>, &mut T) -> Done,
    ) -> Done {
        match self {
            Self::Name(names) => names.push(key),
            Self::Read(section) if section.has(key) => section.section(key)?.read_into(value, list)?,
            Self::Read(_) => {}
            Self::Write(lines) => {
                let inner =
                    lines_of(value, list).into_iter().map(|(name, value)| format!("{name} = {value}"));
                lines.push((key.to_owned(), format!("{{ {} }}", inner.collect::<Vec<_>>().join(", "))));
            }
        }
        Ok(())
    }
}

impl Section<'_> {
    /// Reads the keys of `list`, beside which no other may be, over what `value` is.
    pub(super) fn read<T>(
        &self,
        mut value: T,
        list: impl Fn(&mut Keys<'_>, &mut T) -> Done,
    ) -> Result<T, RigError> {
        self.read_into(&mut value, list)?;
        Ok(value)
    }

    fn read_into<T>(&self, value: &mut T, list: impl Fn(&mut Keys<'_>, &mut T) -> Done) -> Done {
        let mut keys = Keys::Name(Vec::new());
        list(&mut keys, value)?;
        if let Keys::Name(names) = keys {
            self.allow(&names)?;
        }
        list(&mut Keys::Read(self), value)
    }
}

/// The keys of `list` with their values as text.
pub(super) fn lines_of<T>(
    value: &mut T,
    list: impl Fn(&mut Keys<'_>, &mut T) -> Done,
) -> Vec<(String, String)> {
    let mut keys = Keys::Write(Vec::new());
    // What can't be is a matter of reading.
    let _ = list(&mut keys, value);
    if let Keys::Write(lines) = keys { lines } else { Vec::new() }
}

/// A number that reads back to the same, or to the nearest that the reader takes: a bare share, or a quantity as text.
fn written(value: f64, bound: Bound) -> String {
    let (value, dimension) = (bound.nearest(value), bound.dimension);
    if dimension == Dimension::Share { format!("{value:?}") } else { quantity(value, dimension) }
}

/// A quantity that reads back to the same number.
pub(super) fn quantity(value: f64, dimension: Dimension) -> String {
    toml_text(format!("{value} {}", dimension.si()).trim_end())
}

pub(super) fn toml_text(text: &str) -> String {
    toml::Value::String(text.to_owned()).to_string()
}
