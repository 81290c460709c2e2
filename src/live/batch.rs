//! Many samples in one message.

use super::format::{Csv, Fields};
use super::json;
use serde_json::value::RawValue;

/// How a message holds its samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum BatchFormat {
    /// A JSON array of objects such as the lines of [`LineFormat::Ndjson`](super::LineFormat::Ndjson), or those lines.
    Json,
    /// A header row, then rows.
    Csv,
    /// What Neuron uploads: one sample, in its values format or its tags format.
    Neuron,
}

/// A message.
#[derive(Clone, Copy, Debug)]
pub struct Batch<'a> {
    /// Of the samples that name none themselves.
    pub cylinder: &'a str,
    /// How to read it.
    pub format: BatchFormat,
    /// What came.
    pub payload: &'a [u8],
    /// Whether it may have come before: then late samples in it say nothing about the sender's clock.
    pub resent: bool,
}

/// The samples of a message, or why one is none; an error where the whole message is of no use.
pub(super) fn parse<'a>(batch: &Batch<'a>) -> Result<Vec<Result<Fields<'a>, String>>, String> {
    let payload = std::str::from_utf8(batch.payload).map_err(|_| "not UTF-8".to_owned())?;
    Ok(match batch.format {
        BatchFormat::Json if payload.trim_start().starts_with('[') => array(payload)?,
        BatchFormat::Json => lines(payload).map(json::parse).collect(),
        BatchFormat::Csv => {
            let mut csv = Csv::default();
            let row = |line| csv.parse(line).map(|row| row.map(Fields::into_owned)).transpose();
            lines(payload).filter_map(row).collect()
        }
        BatchFormat::Neuron => vec![json::parse_neuron(payload)],
    })
}

/// All at once where each is a sample, else one by one.
fn array(payload: &str) -> Result<Vec<Result<Fields<'_>, String>>, String> {
    if let Ok(samples) = serde_json::from_str::<Vec<Fields<'_>>>(payload) {
        return Ok(samples.into_iter().map(Ok).collect());
    }
    let samples: Vec<&RawValue> =
        serde_json::from_str(payload).map_err(|error| format!("not a JSON array: {error}"))?;
    Ok(samples.into_iter().map(|sample| json::parse(sample.get())).collect())
}

fn lines(payload: &str) -> impl Iterator<Item = &str> {
    payload.lines().filter(|line| !line.trim().is_empty())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cells(format: BatchFormat, payload: &str) -> Vec<Result<String, ()>> {
        let batch = Batch { cylinder: "", format, payload: payload.as_bytes(), resent: false };
        let joined =
            |fields: Result<Fields<'_>, _>| fields.map(|fields| fields.cells.join(" ")).map_err(|_| ());
        parse(&batch).map_or_else(|_| vec![Err(())], |samples| samples.into_iter().map(joined).collect())
    }

    #[test]
    fn samples_stand_in_an_array_in_lines_or_in_rows() {
        let two = [Ok("1 2".to_owned()), Ok("2 3".to_owned())];
        assert_eq!(cells(BatchFormat::Json, r#" [{"t_s": 1, "x_mm": 2}, {"t_s": 2, "x_mm": 3}]"#), two);
        assert_eq!(cells(BatchFormat::Json, "{\"t_s\": 1, \"x_mm\": 2}\n\n{\"t_s\": 2, \"x_mm\": 3}\n"), two);
        assert_eq!(cells(BatchFormat::Csv, "t_s,x_mm\n1,2\n2,3\n"), two);
    }

    #[test]
    fn one_that_is_none_does_not_hide_the_others() {
        assert_eq!(cells(BatchFormat::Json, r#"[{"t_s": 1}, 7, {"t_s": 2}]"#).len(), 3);
        assert_eq!(cells(BatchFormat::Csv, "t_s,x_mm\n1\n2,3"), [Err(()), Ok("2 3".to_owned())]);
        assert_eq!(cells(BatchFormat::Json, "[{\"t_s\": 1}"), [Err(())]);
    }
}
