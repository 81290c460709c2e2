//! Hours and days of every leak as files, a file a day, the last 90 kept.

use jiff::Timestamp;
use pitchleak::core::Leak;
use pitchleak::live::SummaryEvent;
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::fs::{self, OpenOptions};
use std::io::{self, Write as _};
use std::path::PathBuf;

/// Files kept, a file a day.
const FILES: usize = 90;
/// A day's file grows no more beyond this: ten thousand cylinders have room.
const LARGEST_FILE: u64 = 128 * 1024 * 1024;

const HEADER: &str =
    "from,span,cylinder,leak,mean_lpm,std_lpm,max_lpm,alarm_share,slope_lpm_per_day,slope_std\n";

/// The folder.
pub struct Summaries {
    folder: PathBuf,
}

impl Summaries {
    pub fn new(folder: PathBuf) -> io::Result<Self> {
        fs::create_dir_all(&folder)?;
        Ok(Self { folder })
    }

    /// Appends rows to the files of their days. Rows may come twice after a crash: the last of a cylinder, leak and time
    /// counts.
    pub fn append(&self, summaries: &[SummaryEvent]) -> io::Result<()> {
        let mut files: BTreeMap<String, String> = BTreeMap::new();
        for summary in summaries {
            let (day, from) = names(summary);
            rows(files.entry(day).or_default(), &from, summary);
        }
        for (day, rows) in &files {
            let mut file =
                OpenOptions::new().create(true).append(true).open(self.folder.join(format!("{day}.csv")))?;
            let length = file.metadata()?.len();
            if length + (rows.len() as u64) > LARGEST_FILE {
                continue;
            }
            let header = if length == 0 { HEADER } else { "" };
            file.write_all([header, rows].concat().as_bytes())?;
            file.sync_all()?;
        }
        if files.is_empty() { Ok(()) } else { self.forget() }
    }

    /// Removes the oldest files.
    fn forget(&self) -> io::Result<()> {
        let mut names: Vec<_> = fs::read_dir(&self.folder)?
            .filter_map(|entry| entry.ok()?.file_name().into_string().ok())
            .filter(|name| name.ends_with(".csv"))
            .collect();
        names.sort();
        let beyond = names.len().saturating_sub(FILES);
        names.iter().take(beyond).try_for_each(|name| fs::remove_file(self.folder.join(name)))
    }
}

/// Name of its day, and of its begin.
fn names(summary: &SummaryEvent) -> (String, String) {
    let stamp = summary.time_ns.and_then(|ns| Timestamp::from_nanosecond(i128::from(ns)).ok());
    match stamp {
        Some(stamp) => {
            let text = stamp.to_string();
            (text.chars().take_while(|c| *c != 'T').collect(), text)
        }
        None => (format!("day-{:06}", (summary.from_s / 86_400.0).floor()), format!("{}", summary.from_s)),
    }
}

fn rows(text: &mut String, from: &str, summary: &SummaryEvent) {
    let span = summary.span.id();
    let cylinder = summary.cylinder.replace('"', "\"\"");
    let number = |value: Option<f64>| value.map(|value| value.to_string()).unwrap_or_default();
    for leak in Leak::ALL {
        let name = leak.id();
        let leakage = summary.leakage[leak];
        let (slope, std) = (
            leakage.trend_lpm_per_day.map(|trend| trend.slope),
            leakage.trend_lpm_per_day.map(|trend| trend.std),
        );
        let _ = writeln!(
            text,
            "{from},{span},\"{cylinder}\",{name},{},{},{},{},{},{}",
            leakage.mean_lpm,
            number(leakage.std_lpm),
            leakage.max_lpm,
            leakage.alarm_share,
            number(slope),
            number(std)
        );
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use pitchleak::core::PerLeak;
    use pitchleak::live::Span;

    #[test]
    fn ninety_days_are_kept() {
        let folder = tempfile::tempdir().expect("a folder");
        let summaries = Summaries::new(folder.path().join("summaries")).expect("a folder");
        for day in 0..100_u32 {
            let hours = (24 * day..24 * (day + 1)).map(|hour| {
                let from_s = 1.7e9 + 3600.0 * f64::from(hour);
                SummaryEvent {
                    cylinder: "T7/B2".to_owned(),
                    span: Span::Hour,
                    from_s,
                    estimates: 3600,
                    leakage: PerLeak::default(),
                    time_ns: Some((from_s * 1e9) as i64),
                }
            });
            summaries.append(&hours.collect::<Vec<_>>()).expect("room");
        }
        let mut files: Vec<_> = fs::read_dir(&summaries.folder)
            .expect("a folder")
            .map(|entry| entry.expect("a file").path())
            .collect();
        files.sort();
        assert_eq!(files.len(), FILES);
        let text = fs::read_to_string(&files[40]).expect("a file");
        assert_eq!(text.lines().count(), 1 + 24 * 3);
        assert!(text.contains("T00:13:20Z,hour,\"T7/B2\",external_a,0,,0,0,,"), "{text}");
    }
}
