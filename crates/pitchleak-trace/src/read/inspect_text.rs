use super::inspect::{ColumnReading, FileReading};
use std::fmt::Write;

impl FileReading {
    /// For people, on a terminal.
    pub fn to_text(&self) -> String {
        let mut out = format!("file     {}\n", self.path);
        if let Some(text) = &self.text {
            let decimal = text.decimal.unwrap_or("not clear");
            let _ = writeln!(out, "cells    {} between them, decimal {decimal}", text.delimiter);
            let units = text.units_line.map(|line| format!(", units in line {line}")).unwrap_or_default();
            let _ = writeln!(out, "header   in line {}{units}", text.header_line);
        }
        if let Some(format) = &self.time_format {
            let _ = writeln!(out, "times    {format}");
        }
        self.write_columns(&mut out);
        if let Some(problem) = &self.problem {
            let _ = writeln!(out, "\nNot read as it is: {problem}");
        }
        if !self.misspelt.is_empty() {
            let _ = writeln!(out, "\nNamed under [columns], and not in the file:");
            self.misspelt.iter().for_each(|line| _ = writeln!(out, "    {line}"));
        }
        if !self.proposals.is_empty() {
            let _ =
                writeln!(out, "\nWhere that is so, this in the rig file names the columns:\n    [columns]");
            let width =
                self.proposals.iter().map(|proposal| proposal.line.chars().count()).max().unwrap_or(0);
            for proposal in &self.proposals {
                let _ = writeln!(out, "    {:<width$}  # {}", proposal.line, proposal.why);
            }
        }
        if self.problem.is_none() {
            let _ = writeln!(out, "\nIt is read as it is.");
        }
        out
    }

    fn write_columns(&self, out: &mut String) {
        let width = |text: fn(&ColumnReading) -> &str, least: usize| {
            self.columns.iter().map(|column| text(column).chars().count()).max().unwrap_or(0).max(least)
        };
        let name = width(|column| &column.header, 6);
        let _ = writeln!(out, "\n{:<name$}  {:<9}  {:<6}  first rows", "column", "signal", "unit");
        for column in &self.columns {
            let (signal, unit) = (column.signal.unwrap_or("-"), column.unit.unwrap_or_default());
            let line =
                format!("{:<name$}  {signal:<9}  {unit:<6}  {}", column.header, column.first.join("  "));
            let _ = writeln!(out, "{}", line.trim_end());
        }
    }
}
