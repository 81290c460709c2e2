//! Files of one recording, each with some of its channels and a clock of their own, as one source of rows in the order of time.

use super::clock::is_same;
use super::columns::{Layout, REQUIRED};
use super::error::{TraceError, TraceFault};
use super::format;
use super::format::Rows;
use super::row::{Next, Row, RowSource};
use crate::rig::Rig;
use crate::signal::Signal;
use std::fs::File;
use std::path::Path;

const NS_PER_S: f64 = 1e9;

/// One of the files.
struct Part {
    rows: Rows,
    /// Its next row, in the recording's time.
    next: Option<Row>,
    ended: bool,
}

/// All of them.
pub(super) struct Joined {
    parts: Vec<Part>,
    layout: Layout,
    /// From which the recording's seconds count, where the files have stamps.
    epoch_ns: Option<i64>,
}

impl Joined {
    /// Opens the files; together they must have what a trace has.
    pub(super) fn open(paths: &[impl AsRef<Path>], rig: &Rig) -> Result<Self, TraceError> {
        let open = |path: &Path| Part::open(path, rig).map_err(|fault| fault.of(&path.display().to_string()));
        let parts = paths.iter().map(|path| open(path.as_ref())).collect::<Result<Vec<_>, _>>()?;
        let whole = |fault: TraceFault| fault.of("the files together");
        let layout = Layout::joined(parts.iter().map(|part| part.rows.layout()));
        layout.check(&rig.columns, &REQUIRED).map_err(whole)?;
        let mut joined = Self { parts, layout, epoch_ns: None };
        joined.begin().map_err(whole)?;
        Ok(joined)
    }

    /// Reads the first rows, and puts all clocks on one.
    fn begin(&mut self) -> Result<(), TraceFault> {
        for part in &mut self.parts {
            // What stands before the first good row is told where rows are asked for.
            while !part.ended && part.next.is_none() {
                part.read(None)?;
            }
        }
        let epochs: Vec<Option<i64>> = self.parts.iter().map(|part| part.rows.epoch_ns()).collect();
        self.epoch_ns = epochs.iter().flatten().min().copied();
        if self.epoch_ns.is_some() && epochs.iter().any(Option::is_none) {
            return Err(TraceFault::Ambiguous {
                what: "some of the files have dates, others seconds".to_owned(),
                settle: "export all with the same clock".to_owned(),
            });
        }
        let epoch_ns = self.epoch_ns;
        for part in &mut self.parts {
            let since_s = part.since_s(epoch_ns);
            if let Some(row) = &mut part.next {
                row.set(Signal::Time, row.get(Signal::Time) + since_s);
            }
        }
        Ok(())
    }
}

impl Part {
    fn open(path: &Path, rig: &Rig) -> Result<Self, TraceFault> {
        let mut rig = rig.clone();
        rig.csv.part = Some(path.file_stem().unwrap_or_default().to_string_lossy().into_owned());
        let file = File::open(path).map_err(TraceFault::Open)?;
        let again = file.try_clone().ok();
        Ok(Self { rows: format::open(Box::new(file), again, &rig)?, next: None, ended: false })
    }

    /// How much later than the recording its own seconds begin, s.
    fn since_s(&self, epoch_ns: Option<i64>) -> f64 {
        let own = self.rows.epoch_ns().zip(epoch_ns);
        own.map_or(0.0, |(own, epoch)| (own - epoch) as f64 / NS_PER_S)
    }

    /// Reads its next row; what is none is given back.
    fn read(&mut self, epoch_ns: Option<i64>) -> Result<Option<Next>, TraceFault> {
        let mut row = Row::empty();
        let next = self.rows.next_row(&mut row)?;
        self.ended = matches!(next, Next::End | Next::CutOff(_));
        match next {
            Next::Row => {
                row.set(Signal::Time, row.get(Signal::Time) + self.since_s(epoch_ns));
                self.next = Some(row);
                Ok(None)
            }
            Next::End => Ok(None),
            other => Ok(Some(other)),
        }
    }
}

impl RowSource for Joined {
    fn layout(&self) -> &Layout {
        &self.layout
    }

    fn epoch_ns(&self) -> Option<i64> {
        self.epoch_ns
    }

    fn next_row(&mut self, row: &mut Row) -> Result<Next, TraceFault> {
        for part in &mut self.parts {
            while !part.ended && part.next.is_none() {
                if let Some(other) = part.read(self.epoch_ns)? {
                    return Ok(other);
                }
            }
        }
        let times = self.parts.iter().filter_map(|part| part.next.as_ref().map(|row| row.get(Signal::Time)));
        let Some(first_s) = times.min_by(f64::total_cmp) else { return Ok(Next::End) };
        let is_now = |next: &mut Row| is_same(next.get(Signal::Time), first_s);
        let now = self.parts.iter_mut().filter_map(|part| part.next.take_if(is_now));
        *row = Row::empty();
        for part in now {
            row.line = part.line;
            row.fill(&part);
        }
        Ok(Next::Row)
    }
}
