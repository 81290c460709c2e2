//! What Neuron's MQTT plug-in uploads: `values` and `errors` by tag, or a list of `tags` (Neuron's documentation, "Data
//! upload"). The driver's name is the cylinder's; a tag that could not be read is a missing value.

use super::format::Fields;
use super::ndjson::cell;
use jiff::Timestamp;
use serde::Deserialize;
use serde_json::value::RawValue;
use std::borrow::Cow;
use std::collections::BTreeMap;

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

pub(super) fn parse(payload: &str) -> Result<Fields<'_>, String> {
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
    fn both_formats_say_the_same() {
        let values = r#"{"timestamp": 1650006388943, "node": "T7/B2", "group": "g",
            "values": {"x_mm": 40.5, "pa_bar": 51}, "errors": {"qa_lpm": 2014}, "metas": {}}"#;
        let tags = r#"{"node": "T7/B2", "group": "g", "timestamp": 1650006388943, "tags":
            [{"name": "qa_lpm", "error": 2014}, {"name": "pa_bar", "value": 51}, {"name": "x_mm", "value": 40.5}]}"#;
        let fields = parse(values).unwrap();
        assert_eq!(fields, parse(tags).unwrap());
        assert_eq!(fields.cylinder, "T7/B2");
        assert_eq!(fields.names, ["timestamp", "pa_bar", "qa_lpm", "x_mm"]);
        assert_eq!(fields.cells, ["2022-04-15T07:06:28.943Z", "51", "", "40.5"]);
    }

    #[test]
    fn what_is_no_upload_is_refused() {
        for text in ["{}", "[]", r#"{"timestamp": 9223372036854775807, "values": {}}"#] {
            assert!(parse(text).is_err(), "{text}");
        }
    }
}
