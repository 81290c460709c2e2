//! A header row, then rows.

use super::format::Fields;
use std::borrow::Cow;

#[derive(Default)]
pub(super) struct Csv {
    delimiter: char,
    /// Of the header; empty before it.
    names: Vec<String>,
}

impl Csv {
    /// The first line is the header; so is one that repeats it, as after a feed began anew.
    pub(super) fn parse<'a>(&'a mut self, line: &'a str) -> Result<Option<Fields<'a>>, String> {
        if self.names.is_empty() {
            let line = line.trim_start_matches('\u{feff}');
            let most = |delimiter: &char| line.matches(*delimiter).count();
            self.delimiter = [',', ';', '\t'].into_iter().rev().max_by_key(most).unwrap_or(',');
            self.names = split(line, self.delimiter).map(Cow::into_owned).collect();
            return Ok(None);
        }
        let mut fields = Fields::default();
        let mut cells = split(line, self.delimiter);
        let mut repeated = true;
        for name in &self.names {
            let cell = cells.next().ok_or_else(|| format!("{} cells expected", self.names.len()))?;
            repeated &= cell == name.as_str();
            fields.push(Cow::Borrowed(name), cell);
        }
        if cells.next().is_some() {
            return Err(format!("{} cells expected", self.names.len()));
        }
        Ok((!repeated).then_some(fields))
    }
}

/// Cells without blanks and quotes around them.
fn split(line: &str, delimiter: char) -> impl Iterator<Item = Cow<'_, str>> {
    let mut quoted = false;
    line.split(move |c| {
        quoted ^= c == '"';
        c == delimiter && !quoted
    })
    .map(|cell| {
        let cell = cell.trim();
        match cell.strip_prefix('"').and_then(|cell| cell.strip_suffix('"')) {
            Some(inner) => Cow::Owned(inner.replace("\"\"", "\"")),
            None => Cow::Borrowed(cell),
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_header_names_the_cells_of_the_rows() {
        let mut csv = Csv::default();
        assert_eq!(csv.parse("cylinder;t_s;x_mm"), Ok(None));
        let fields = csv.parse("\"T7; B2\"; 0.1;4e1").unwrap().unwrap();
        assert_eq!((fields.cylinder.as_ref(), fields.names.join(" ")), ("T7; B2", "t_s x_mm".to_owned()));
        assert_eq!(fields.cells, ["0.1", "4e1"]);
        assert_eq!(csv.parse("cylinder;t_s;x_mm"), Ok(None));
        assert!(csv.parse("a;1").is_err() && csv.parse("a;1;2;3").is_err());
    }
}
