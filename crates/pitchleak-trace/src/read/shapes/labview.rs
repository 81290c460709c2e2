//! LabVIEW's measurement files (`.lvm`): lines of properties, then `X_Value` and the channels. With `X_Columns` *No* the times
//! are not written but follow from `X0` and `Delta_X`, with *Multi* each channel has its own.
//! National Instruments, "Specification for the LabVIEW Measurement File (.lvm)".

use super::{Recast, Shape, Source, Text, merged};
use crate::read::error::TraceFault;
use crate::read::number::number;
use crate::read::records::text;
use crate::read::table_text::TextTable;
use crate::rig::Decimal;
use std::borrow::Cow;

pub(super) const SHAPE: Shape = Shape { name: "LabVIEW's measurement file", told };

/// What its times are called, and then by this program.
const X_VALUE: &str = "X_Value";
const TIME: &str = "t_s";

/// What stands above the rows.
struct Head {
    line: u64,
    delimiter: u8,
    headers: Vec<String>,
    start_s: f64,
    step_s: f64,
}

impl Head {
    fn of(preamble: &str) -> Option<Self> {
        let named = |key: &str| {
            preamble.lines().find_map(|line| line.strip_prefix(key)).filter(|rest| !rest.is_empty())
        };
        let delimiter = *named("Separator")?.as_bytes().first()?;
        let number_of = |key: &str| {
            let cell = named(key)?.split(char::from(delimiter)).nth(1)?;
            number(cell.trim(), Decimal::Comma)
        };
        let (line, header) = (1..).zip(preamble.lines()).find(|(_, line)| line.starts_with(X_VALUE))?;
        Some(Self {
            line,
            delimiter,
            headers: header.split(char::from(delimiter)).map(|header| header.trim().to_owned()).collect(),
            start_s: number_of("X0").unwrap_or(0.0),
            step_s: number_of("Delta_X").unwrap_or(0.0),
        })
    }
}

fn told(_: &TextTable, ahead: &[u8]) -> Option<Recast> {
    let preamble = text(ahead);
    let head = preamble.starts_with("LabVIEW Measurement").then(|| Head::of(&preamble))??;
    let own_times = {
        let rows = preamble.lines().skip(head.line as usize);
        let times = rows
            .filter_map(|row| row.split(char::from(head.delimiter)).next())
            .filter(|time| !time.is_empty());
        let seconds =
            |header: &String| if header == X_VALUE { "Time [s]".to_owned() } else { header.clone() };
        let headers: Vec<String> = head.headers.iter().map(seconds).collect();
        merged::of_columns(&headers, &[], &times.take(100).collect::<Vec<_>>())
    };
    Some(Box::new(move |source| {
        let source = Source { delimiter: head.delimiter, last_header_line: head.line, ..source };
        match own_times {
            Some(recast) => recast(source),
            None => rows(source, head),
        }
    }))
}

/// One time for all channels; the last column may be a comment.
fn rows(source: Source, head: Head) -> Result<Text, TraceFault> {
    let is_kept = |header: &&String| !header.is_empty() && *header != "Comment";
    let header: Vec<String> = head
        .headers
        .iter()
        .filter(is_kept)
        .map(|header| if header == X_VALUE { TIME.to_owned() } else { header.clone() })
        .collect();
    let kept: Vec<bool> = head.headers.iter().map(|header| is_kept(&header)).collect();
    let mut row = 0_u64;
    source.row_by_row(&header, move |cells| {
        let kept = kept.iter().enumerate().filter(|(_, kept)| **kept);
        let mut kept: Vec<Cow<'_, [u8]>> =
            kept.map(|(index, _)| Cow::Borrowed(cells.get(index).copied().unwrap_or_default())).collect();
        if let Some(time) = kept.first_mut().filter(|time| time.trim_ascii().is_empty()) {
            *time = Cow::Owned(format!("{:.9}", head.start_s + head.step_s * row as f64).into_bytes());
        }
        row += 1;
        kept
    })
}
