//! Whether numbers have a decimal point or a comma.

use super::error::TraceFault;
use crate::header::shorten;
use crate::rig::Decimal;

/// What the marks in the cells of a column, or of all, speak for.
#[derive(Default)]
struct Marks {
    cells: usize,
    /// Whole numbers below a thousand.
    small: usize,
    /// A comma that can be nothing but decimal: `0,5`, `12,3456`.
    commas: usize,
    /// `1,234`, which may be a thousand and more.
    open_commas: usize,
    /// A point that can be nothing but decimal.
    points: usize,
    /// `1.234`
    open_points: usize,
    /// `1.234.567` or `1,234.5`.
    thousands: usize,
    /// A cell that may be thousands.
    example: Option<String>,
}

/// So many cells such as `1.234` and none such as `1.5` are no chance.
const MANY: usize = 10;

/// What the columns of numbers, a list of cells each, speak for.
pub(super) fn decimal(columns: &[Vec<&str>]) -> Result<Decimal, TraceFault> {
    let mut all = Marks::default();
    columns.iter().for_each(|column| all.join(Marks::of(column)));
    let example = || all.example.clone().unwrap_or_default();
    if 10 * all.thousands > all.cells {
        return Err(TraceFault::Ambiguous {
            what: format!("`{}` has a mark between its thousands", example()),
            settle: "export the numbers without marks between thousands".to_owned(),
        });
    }
    match all.commas {
        0 if all.open_commas == 0 => Ok(Decimal::Point),
        0 => Err(TraceFault::Ambiguous {
            what: format!("`{}` may have a decimal comma or one between thousands", example()),
            settle: "--decimal comma (`decimal = \"comma\"` under [csv] of the rig file) where it is decimal, else \
                     export the numbers without marks between thousands"
                .to_owned(),
        }),
        commas if 10 * (all.points + all.open_points) > commas => Err(TraceFault::Ambiguous {
            what: "some numbers have a comma and some a point".to_owned(),
            settle: "--decimal comma or --decimal point says which is decimal; rows with the other are left out".to_owned(),
        }),
        _ => Ok(Decimal::Comma),
    }
}

impl Marks {
    fn of(column: &[&str]) -> Self {
        let mut marks = Self::default();
        column.iter().for_each(|cell| marks.add(cell));
        // 998, 999, 1.000, 1.001: no decimals but thousands.
        if marks.points == 0 && marks.open_points > MANY && marks.small > MANY {
            marks.thousands += marks.cells;
        }
        marks
    }

    fn add(&mut self, cell: &str) {
        let number = cell.trim_start_matches(['+', '-']);
        if !number.starts_with(|c: char| c.is_ascii_digit() || c == '.' || c == ',') || is_date(number) {
            return;
        }
        self.cells += 1;
        let marks = |mark: u8| number.bytes().filter(|byte| *byte == mark).count();
        let count = match (marks(b'.'), marks(b',')) {
            (0, 0) if number.len() < 4 => &mut self.small,
            (0, 0) => return,
            (0, 1) if !is_group(number, ',') => &mut self.commas,
            (1, 0) if !is_group(number, '.') => &mut self.points,
            open => {
                self.example = Some(shorten(cell, 40));
                match open {
                    (0, 1) => &mut self.open_commas,
                    (1, 0) => &mut self.open_points,
                    _ => &mut self.thousands,
                }
            }
        };
        *count += 1;
    }

    fn join(&mut self, other: Self) {
        self.cells += other.cells;
        self.commas += other.commas;
        self.open_commas += other.open_commas;
        self.points += other.points;
        self.open_points += other.open_points;
        self.thousands += other.thousands;
        // Of a column that has thousands rather than of one that has decimals.
        if other.thousands > 0 || self.example.is_none() {
            self.example = other.example;
        }
    }
}

/// Whether it is no number but a date or a time: other characters, or marks as between day, month and year.
fn is_date(cell: &str) -> bool {
    let in_threes = |mark: char| cell.split(mark).skip(1).all(|group| group.len() == 3);
    let is_between = |mark: char| cell.matches(mark).count() > 1 && !in_threes(mark);
    let other = |c: char| !c.is_ascii_digit() && !".,eE+-".contains(c);
    cell.contains(other) || is_between('.') || is_between(',')
}

/// Whether a number could be thousands: one to three digits, not led by 0, and three behind the mark.
fn is_group(number: &str, mark: char) -> bool {
    let Some((before, behind)) = number.split_once(mark) else { return false };
    let digits = |text: &str| text.bytes().all(|byte| byte.is_ascii_digit());
    (1..=3).contains(&before.len())
        && !before.starts_with('0')
        && behind.len() == 3
        && digits(before)
        && digits(behind)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn marks_say_what_they_are() {
        let of = |cells: &[&str]| decimal(&[cells.to_vec()]).map_err(|fault| fault.to_string());
        assert_eq!(of(&["0.5", "1", "-2.25e3", ""]), Ok(Decimal::Point));
        assert_eq!(of(&["0,5", "1", "-2,25e3"]), Ok(Decimal::Comma));
        assert_eq!(of(&["1,234", "0,500"]), Ok(Decimal::Comma));
        assert_eq!(of(&["1.234", "5.678"]), Ok(Decimal::Point));
        assert!(of(&["1,234", "5,678"]).unwrap_err().contains("--decimal"));
        assert!(of(&["1,234.5", "5,678.5"]).unwrap_err().contains("thousands"));
        assert!(of(&["5.000.000", "0,5"]).unwrap_err().contains("thousands"));
        assert!(of(&["5.5", "0,5"]).unwrap_err().contains("--decimal"));
        assert_eq!(of(&["19.11.2026 06:30:00,250", "19.11.2026", "0,5", "06:30:00.25"]), Ok(Decimal::Comma));
        let ms: Vec<String> = (900..1100)
            .map(|i| if i < 1000 { i.to_string() } else { format!("1.{:03}", i - 1000) })
            .collect();
        assert!(of(&ms.iter().map(String::as_str).collect::<Vec<_>>()).unwrap_err().contains("thousands"));
    }
}
