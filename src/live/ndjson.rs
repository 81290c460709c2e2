//! A JSON object a line. Numbers are taken as they stand, and read as those of a file are.

use super::format::Fields;
use serde::de::{Deserialize, Deserializer, MapAccess, Visitor};
use serde_json::value::RawValue;
use std::borrow::Cow;
use std::fmt;

pub(super) fn parse(line: &str) -> Result<Fields<'_>, String> {
    let Object(members) =
        serde_json::from_str(line).map_err(|error| format!("not a JSON object: {error}"))?;
    let mut fields = Fields::default();
    for (name, value) in members {
        fields.push(name.into(), cell(value.get()));
    }
    Ok(fields)
}

/// Without the quotes of a string; null is a missing value.
pub(super) fn cell(value: &str) -> Cow<'_, str> {
    if value == "null" {
        return Cow::Borrowed("");
    }
    match serde_json::from_str::<String>(value) {
        Ok(text) => Cow::Owned(text),
        Err(_) => Cow::Borrowed(value),
    }
}

/// Members in their order, values unread.
struct Object<'a>(Vec<(String, &'a RawValue)>);

impl<'de: 'a, 'a> Deserialize<'de> for Object<'a> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_map(Members)
    }
}

struct Members;

impl<'de> Visitor<'de> for Members {
    type Value = Object<'de>;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("an object")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Object<'de>, A::Error> {
        let mut members = Vec::new();
        while let Some(member) = map.next_entry()? {
            members.push(member);
        }
        Ok(Object(members))
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
    fn what_is_no_object_is_refused() {
        for line in ["[1]", "{", "3", "{\"a\": }", "{\"a\": NaN}"] {
            assert!(parse(line).is_err(), "{line}");
        }
    }
}
