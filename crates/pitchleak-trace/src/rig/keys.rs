//! The keys of a section, listed once: by the same list they are read, written, and named where another one stands there.

use super::bound::{self, Bound};
use super::document::{RigError, Section};
use crate::units::{self, Dimension, FEW_DIGITS, rounded};
use std::fmt::Display;
use toml_writer::{ToTomlValue, TomlStringBuilder};

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
    /// One of the list: how it is read, and how it is written where it says anything.
    pub(super) fn entry<T>(
        &mut self,
        key: &'static str,
        value: &mut T,
        read: impl FnOnce(&Section<'_>) -> Result<T, RigError>,
        text: impl FnOnce(&mut T) -> Option<String>,
    ) -> Done {
        match self {
            Self::Name(names) => names.push(key),
            Self::Read(section) => *value = read(section)?,
            Self::Write(lines) => lines.extend(text(value).map(|text| (key.to_owned(), text))),
        }
        Ok(())
    }

    /// A quantity that may be left out, SI.
    pub(super) fn optional(&mut self, key: &'static str, bound: Bound, value: &mut Option<f64>) -> Done {
        let text = |value: &mut Option<f64>| value.map(|value| written(value, bound));
        self.entry(key, value, |section| section.quantity(key, bound), text)
    }

    /// One that is `default` where it is left out.
    pub(super) fn number(&mut self, key: &'static str, bound: Bound, value: &mut f64, default: f64) -> Done {
        let read = |section: &Section<'_>| Ok(section.quantity(key, bound)?.unwrap_or(default));
        self.entry(key, value, read, |value| Some(written(*value, bound)))
    }

    /// One that must be there.
    pub(super) fn needed(&mut self, key: &'static str, bound: Bound, value: &mut f64) -> Done {
        let read = |section: &Section<'_>| section.required(key, bound);
        self.entry(key, value, read, |value| Some(written(*value, bound)))
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
        let text = |value: &mut Option<T>| value.as_ref().map(|value| toml_text(&name(value)));
        self.entry(key, value, |section| section.named(key, by_name, allowed), text)
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
    pub(super) fn sheet<T: Copy>(
        &mut self,
        key: &'static str,
        value: &mut T,
        list: impl Fn(&mut Keys<'_>, &mut T) -> Done,
    ) -> Done {
        let usual = *value;
        let read = |section: &Section<'_>| match section.has(key) {
            true => section.section(key)?.read(usual, &list),
            false => Ok(usual),
        };
        self.entry(key, value, read, |value| Some(inline(lines_of(value, &list))))
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

/// Keys and values as a table in one line.
pub(super) fn inline(lines: impl IntoIterator<Item = (impl Display, impl Display)>) -> String {
    let entries: Vec<String> = lines.into_iter().map(|(key, value)| format!("{key} = {value}")).collect();
    format!("{{ {} }}", entries.join(", "))
}

/// A number that reads back to the same, or to the nearest that the reader takes: a bare share, or a quantity as text.
fn written(value: f64, bound: Bound) -> String {
    let (value, dimension) = (bound.nearest(value), bound.dimension);
    if dimension == Dimension::Share { format!("{value:?}") } else { quantity(value, dimension) }
}

/// A quantity that reads back to the same number.
fn quantity(value: f64, dimension: Dimension) -> String {
    toml_text(format!("{value} {}", dimension.si()).trim_end())
}

/// A quantity as text, within what the reader takes: in the unit that people read it in where few digits say the same number
/// there.
pub(super) fn for_people(value: f64, bound: Bound) -> String {
    let (si, dimension) = (bound.nearest(value), bound.dimension);
    let text = dimension.difference_for_people().and_then(|unit| {
        let text = format!("{} {}", rounded(unit.from_si(si), FEW_DIGITS), unit.text);
        let read = units::parse(&text, dimension).ok()?;
        (read.to_bits() == si.to_bits()).then(|| toml_text(&text))
    });
    text.unwrap_or_else(|| quantity(si, dimension))
}

/// On one line whatever it holds: a column's name may have line breaks, and messages say it.
pub(super) fn toml_text(text: &str) -> String {
    let text = TomlStringBuilder::new(text);
    text.as_basic_pretty().or_else(|| text.as_literal()).unwrap_or_else(|| text.as_basic()).to_toml_value()
}
