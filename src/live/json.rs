//! Samples in JSON: an object a line, many in an array, or what Neuron uploads. Numbers are taken as they stand, and read as
//! those of a file are.

use super::format::Fields;
use jiff::Timestamp;
use serde::Deserialize;
use serde::de::{Deserializer, MapAccess, Visitor};
use serde_json::value::RawValue;
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::fmt;

/// A line's object.
pub(super) fn parse(line: &str) -> Result<Fields<'_>, String> {
    serde_json::from_str(line).map_err(|error| format!("not a JSON object: {error}"))
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
        let mut fields = Fields::with_room();
        while let Some((Text(name), value)) = map.next_entry::<Text<'de>, &'de RawValue>()? {
            fields.push(name, cell(value.get()));
        }
        Ok(fields)
    }
}

/// A string, as it stands where nothing in it is escaped.
#[derive(Deserialize)]
struct Text<'a>(#[serde(borrow)] Cow<'a, str>);

/// What Neuron's MQTT plug-in uploads: `values` and `errors` by tag, or a list of `tags` (Neuron's documentation, "Data
/// upload"). The driver's name is the cylinder's; a tag that could not be read is a missing value.
#[derive(Deserialize)]
struct Upload<'a> {
    /// ms since 1970.
    timestamp: i64,
    #[serde(default)]
    node: Cow<'a, str>,
    #[serde(default, borrow)]
    values: BTreeMap<String, &'a RawValue>,
    #[serde(default)]
    errors: BTreeMap<String, i64>,
    #[serde(default, borrow)]
    tags: Vec<Tag<'a>>,
}

#[derive(Deserialize)]
struct Tag<'a> {
    name: String,
    #[serde(borrow)]
    value: Option<&'a RawValue>,
}

/// The sample of an [`Upload`].
pub(super) fn parse_neuron(payload: &str) -> Result<Fields<'_>, String> {
    let upload: Upload<'_> =
        serde_json::from_str(payload).map_err(|error| format!("no upload of Neuron: {error}"))?;
    let time = Timestamp::from_millisecond(upload.timestamp)
        .map_err(|_| format!("{} ms is no time", upload.timestamp))?;
    let mut fields = Fields { cylinder: upload.node, ..Fields::default() };
    fields.push("timestamp".into(), time.to_string().into());
    let values = upload.values.into_iter().map(|(name, value)| (name, Some(value)));
    let errors = upload.errors.into_keys().map(|name| (name, None));
    let mut tags: Vec<_> = upload.tags.into_iter().map(|tag| (tag.name, tag.value)).collect();
    tags.extend(values.chain(errors));
    // In one order, whichever could be read.
    tags.sort_by(|a, b| a.0.cmp(&b.0));
    for (name, value) in tags {
        fields.push(name.into(), value.map_or(Cow::Borrowed(""), |value| cell(value.get())));
    }
    Ok(fields)
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

    #[test]
    fn samples_are_read_with_any_blanks_about_them() {
        let text = r#" [ {"cylinder":"T7/B2", "t_s" : 0.10, "x_mm": -4e+1,"qa_lpm":null} , {"t_s":1} ] "#;
        let [first, second]: [Fields<'_>; 2] = serde_json::from_str(text).unwrap();
        assert_eq!(first.cylinder, "T7/B2");
        assert_eq!(first.names, ["t_s", "x_mm", "qa_lpm"]);
        assert_eq!(first.cells, ["0.10", "-4e+1", ""]);
        assert_eq!(parse(r#"{"t_s":1}"#), Ok(second));
    }

    #[test]
    fn both_formats_say_the_same() {
        let values = r#"{"timestamp": 1650006388943, "node": "T7/B2", "group": "g",
            "values": {"x_mm": 40.5, "pa_bar": 51}, "errors": {"qa_lpm": 2014}, "metas": {}}"#;
        let tags = r#"{"node": "T7/B2", "group": "g", "timestamp": 1650006388943, "tags":
            [{"name": "qa_lpm", "error": 2014}, {"name": "pa_bar", "value": 51}, {"name": "x_mm", "value": 40.5}]}"#;
        let fields = parse_neuron(values).unwrap();
        assert_eq!(fields, parse_neuron(tags).unwrap());
        assert_eq!(fields.cylinder, "T7/B2");
        assert_eq!(fields.names, ["timestamp", "pa_bar", "qa_lpm", "x_mm"]);
        assert_eq!(fields.cells, ["2022-04-15T07:06:28.943Z", "51", "", "40.5"]);
    }

    #[test]
    fn what_is_no_upload_is_refused() {
        for text in ["{}", "[]", r#"{"timestamp": 9223372036854775807, "values": {}}"#] {
            assert!(parse_neuron(text).is_err(), "{text}");
        }
    }
}
