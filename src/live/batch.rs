//! Many samples in one message.

use super::csv::Csv;
use super::format::Fields;
use super::{ndjson, neuron};
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

/// Hands each sample of a message on, or why it is none; an error where the whole message is of no use.
pub(super) fn parse(
    batch: &Batch<'_>,
    mut each: impl FnMut(Result<Fields<'_>, String>),
) -> Result<(), String> {
    let payload = std::str::from_utf8(batch.payload).map_err(|_| "not UTF-8".to_owned())?;
    match batch.format {
        BatchFormat::Json if payload.trim_start().starts_with('[') => {
            let samples: Vec<&RawValue> =
                serde_json::from_str(payload).map_err(|error| format!("not a JSON array: {error}"))?;
            samples.iter().for_each(|sample| each(ndjson::parse(sample.get())));
        }
        BatchFormat::Json => lines(payload).for_each(|line| each(ndjson::parse(line))),
        BatchFormat::Csv => {
            let mut csv = Csv::default();
            for line in lines(payload) {
                match csv.parse(line) {
                    Ok(None) => {}
                    Ok(Some(fields)) => each(Ok(fields)),
                    Err(why) => each(Err(why)),
                }
            }
        }
        BatchFormat::Neuron => each(neuron::parse(payload)),
    }
    Ok(())
}

fn lines(payload: &str) -> impl Iterator<Item = &str> {
    payload.lines().filter(|line| !line.trim().is_empty())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cells(format: BatchFormat, payload: &str) -> Vec<Result<String, ()>> {
        let mut found = Vec::new();
        let batch = Batch { cylinder: "", format, payload: payload.as_bytes(), resent: false };
        let keep = |fields: Result<Fields<'_>, _>| {
            found.push(fields.map(|fields| fields.cells.join(" ")).map_err(|_| ()))
        };
        if parse(&batch, keep).is_err() {
            found.push(Err(()));
        }
        found
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
