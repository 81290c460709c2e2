use super::{Channel, Problem, Run, bare_unit, latin1};
use crate::header::shorten;

/// Longest piece of a bad value that a message quotes.
const QUOTED: usize = 24;

/// Parses a text output file: a free description, the line of names, the line of units, one row
/// per sample.
pub(super) fn parse(bytes: &[u8]) -> Result<Run, Problem> {
    let mut lines = bytes.split(|&b| b == b'\n').map(latin1).zip(1..);
    let mut description = String::new();
    let names = loop {
        let (line, _) = lines.next().ok_or(Problem::NoHeader)?;
        if cells(&line).next().is_some_and(|first| first.eq_ignore_ascii_case("time")) {
            break line;
        }
        describe(&mut description, line.trim());
    };
    let (units, line) = lines.next().ok_or(Problem::NoHeader)?;
    let expected = cells(&names).count();
    let found = cells(&units).count();
    if found != expected {
        return Err(Problem::Units { line, found, expected });
    }
    let channel = |(name, unit): (&str, &str)| Channel {
        name: name.to_owned(),
        unit: bare_unit(unit),
        values: Vec::new(),
    };
    let mut run = Run {
        description,
        time_s: Vec::new(),
        channels: cells(&names).zip(cells(&units)).skip(1).map(channel).collect(),
    };
    for (row, line) in lines.filter(|(row, _)| !row.trim().is_empty()) {
        push(&mut run, &row, line)?;
    }
    Ok(run)
}

fn describe(description: &mut String, line: &str) {
    if !line.is_empty() {
        if !description.is_empty() {
            description.push(' ');
        }
        description.push_str(line);
    }
}

/// The cells of one line. OpenFAST separates them by tabs or, with another `OutFmt`, by spaces.
fn cells(line: &str) -> impl Iterator<Item = &str> {
    line.split_ascii_whitespace()
}

fn push(run: &mut Run, row: &str, line: usize) -> Result<(), Problem> {
    let expected = run.channels.len() + 1;
    let found = cells(row).count();
    if found != expected {
        return Err(Problem::RowLength { line, found, expected });
    }
    let columns = std::iter::once(&mut run.time_s).chain(run.channels.iter_mut().map(|c| &mut c.values));
    for (column, (text, values)) in cells(row).zip(columns).enumerate() {
        let text_error = || Problem::NotANumber { line, column: column + 1, text: shorten(text, QUOTED) };
        values.push(text.parse().map_err(|_| text_error())?);
    }
    Ok(())
}
