//! A JSON object a line. Numbers are taken as they stand, and read as those of a file are.

use super::format::{Fields, ROOM};
use super::plain_json;
use serde::de::{Deserialize, Deserializer, Error, MapAccess, Visitor};
use serde_json::value::RawValue;
use std::borrow::Cow;
use std::fmt;

pub(super) fn parse(line: &str) -> Result<Fields<'_>, String> {
    let plain = plain_json::object(line).map(Ok);
    plain.unwrap_or_else(|| serde_json::from_str(line)).map_err(|error| format!("not a JSON object: {error}"))
}

/// Without the quotes of a string; null is a missing value.
pub(super) fn cell(value: &str) -> Cow<'_, str> {
    match value.as_bytes().first() {
        Some(b'"') => serde_json::from_str(value).map_or(Cow::Borrowed(value), |Text(text)| text),
        _ if value == "null" => Cow::Borrowed(""),
        _ => Cow::Borrowed(value),
    }
}

/// An object's members in their order, values unread.
impl<'de: 'a, 'a> Deserialize<'de> for Fields<'a> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_map(Members)
    }
}

struct Members;

impl<'de> Visitor<'de> for Members {
    type Value = Fields<'de>;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("an object")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Fields<'de>, A::Error> {
        let mut fields = Fields::with_room(ROOM);
        while let Some((Text(name), value)) = map.next_entry::<Text<'de>, &'de RawValue>()? {
            fields.push(name, cell(value.get()));
        }
        Ok(fields)
    }
}

/// A string, as it stands where nothing in it is escaped.
struct Text<'a>(Cow<'a, str>);

impl<'de: 'a, 'a> Deserialize<'de> for Text<'a> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_str(Letters)
    }
}

struct Letters;

impl<'de> Visitor<'de> for Letters {
    type Value = Text<'de>;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a string")
    }

    fn visit_borrowed_str<E: Error>(self, text: &'de str) -> Result<Text<'de>, E> {
        Ok(Text(Cow::Borrowed(text)))
    }

    fn visit_str<E: Error>(self, text: &str) -> Result<Text<'de>, E> {
        Ok(Text(Cow::Owned(text.to_owned())))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_stand_as_they_are_written() {
        let fields = parse(r#"{"cylinder": "T7\/B2", "t_s": 0.1000, "x_mm": 4e1, "qa_lpm": null}"#).unwrap();
        assert_eq!(fields.cylinder, "T7/B2");
        assert_eq!(fields.names, ["t_s", "x_mm", "qa_lpm"]);
        assert_eq!(fields.cells, ["0.1000", "4e1", ""]);
    }

    #[test]
    fn strings_are_read_and_their_names_too() {
        let fields = parse(
            r#"{"timestamp": "2026-11-20 22:10", "\u0078_mm": "4\u0030", "note": null, "null": "null"}"#,
        );
        let fields = fields.unwrap();
        assert_eq!(fields.names, ["timestamp", "x_mm", "note", "null"]);
        assert_eq!(fields.cells, ["2026-11-20 22:10", "40", "", "null"]);
    }

    #[test]
    fn what_is_no_object_is_refused() {
        for line in ["[1]", "{", "3", "{\"a\": }", "{\"a\": NaN}"] {
            assert!(parse(line).is_err(), "{line}");
        }
    }
}
