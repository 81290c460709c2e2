//! Influx line protocol: measurement, tags, fields, time in ns.

use super::format::{CYLINDER, Fields};
use crate::header::shorten;
use jiff::Timestamp;
use std::borrow::Cow;

/// The fields of a line; none of a comment.
pub(super) fn parse(line: &str) -> Result<Option<Fields<'_>>, String> {
    if line.starts_with('#') {
        return Ok(None);
    }
    let mut parts = split(line, ' ').filter(|part| !part.is_empty());
    let (Some(series), Some(values)) = (parts.next(), parts.next()) else {
        return Err("measurement, fields and time expected".to_owned());
    };
    let mut fields = Fields::default();
    for tag in split(series, ',').skip(1) {
        let (name, value) = pair(tag)?;
        if name == CYLINDER {
            fields.cylinder = value;
        }
    }
    for field in split(values, ',') {
        let (name, value) = pair(field)?;
        fields.push(name, value);
    }
    if let Some(time) = parts.next() {
        let time: i128 = time.trim().parse().map_err(|_| format!("`{time}` is no time in ns"))?;
        let stamp = Timestamp::from_nanosecond(time).map_err(|_| format!("{time} ns is no time"))?;
        if !fields.names.iter().any(|name| name == "t_s" || name == "t_ms") {
            fields.push("timestamp".into(), stamp.to_string().into());
        }
    }
    Ok(Some(fields))
}

/// Parts between delimiters that are neither escaped nor within quotes.
fn split(text: &str, delimiter: char) -> impl Iterator<Item = &str> {
    let (mut quoted, mut escaped) = (false, false);
    text.split(move |c| {
        let here = c == delimiter && !quoted && !escaped;
        quoted ^= c == '"' && !escaped;
        escaped = c == '\\' && !escaped;
        here
    })
}

fn pair(text: &str) -> Result<(Cow<'_, str>, Cow<'_, str>), String> {
    let mut parts = split(text, '=');
    match (parts.next(), parts.next(), parts.next()) {
        (Some(name), Some(value), None) if !name.is_empty() => Ok((plain(name), plain(number(value)))),
        _ => Err(format!("`{}` is no name=value", shorten(text, 40))),
    }
}

/// A whole number carries a letter.
fn number(value: &str) -> &str {
    match value.strip_suffix(['i', 'u']) {
        Some(digits) if digits.trim_start_matches('-').bytes().all(|b| b.is_ascii_digit()) => digits,
        _ => value,
    }
}

/// Without escapes and quotes.
fn plain(text: &str) -> Cow<'_, str> {
    let text = text.strip_prefix('"').and_then(|text| text.strip_suffix('"')).unwrap_or(text);
    if !text.contains('\\') {
        return Cow::Borrowed(text);
    }
    let mut escaped = false;
    let kept = |c: &char| {
        escaped = *c == '\\' && !escaped;
        !escaped
    };
    Cow::Owned(text.chars().filter(kept).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tags_fields_and_time() {
        let line = r"pitch,cylinder=T7\ a\,b,host=gw x_mm=40.5,pa_bar=3i,qa_lpm=-1e-3 1700000000500000000";
        let fields = parse(line).unwrap().unwrap();
        assert_eq!(fields.cylinder, "T7 a,b");
        assert_eq!(fields.names, ["x_mm", "pa_bar", "qa_lpm", "timestamp"]);
        assert_eq!(fields.cells, ["40.5", "3", "-1e-3", "2023-11-14T22:13:20.5Z"]);
        assert_eq!(parse("# comment"), Ok(None));
    }

    #[test]
    fn what_is_no_line_is_refused() {
        for line in ["pitch", "pitch x", "pitch =3", "pitch x=1=2", "pitch x=1 soon"] {
            assert!(parse(line).is_err(), "{line}");
        }
    }
}
