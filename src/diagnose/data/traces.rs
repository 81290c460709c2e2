//! Traces of any length and number in bounded memory, and which files are fitted and which judged on.
//!
//! A fit takes several passes over what it is fitted to, so that has to be held, and time grows with it. What is held are
//! pieces, evenly over all the traces whatever happens in them, so that the choice favours no effect; their
//! standard deviations are those of so many samples. Whole traces are fitted as long as they are not too many.

use super::series::Series;
use crate::Rig;
use crate::diagnose::thresholds::{LEAST_STEP_S, MOST_SAMPLES, PIECES};
use crate::output::{Identity, identity};
use crate::trace::{Record, TraceError, TraceReader};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Samples in a piece of a trace too long to be fitted whole: of what is held, each piece of the jackknife has one at least.
const PIECE_SAMPLES: usize = MOST_SAMPLES / (2 * PIECES);

/// Pieces of the traces of one rig, evenly over them. Once there are too many samples every other piece goes, and
/// from then on every other one is left out.
#[derive(Clone, Debug)]
pub struct Traces {
    /// Each trace without its samples, all of them left out so far.
    traces: Vec<Series>,
    pieces: Vec<Piece>,
    stride: u64,
    begun: u64,
}

#[derive(Clone, Debug)]
struct Piece {
    number: u64,
    trace: usize,
    series: Series,
}

impl Default for Traces {
    fn default() -> Self {
        Self { traces: Vec::new(), pieces: Vec::new(), stride: 1, begun: 0 }
    }
}

impl Traces {
    /// Reads a trace to its end; `each` is called after every record.
    ///
    /// # Errors
    /// Those of [`TraceReader::next_record`], and of `each`.
    pub fn read<E: From<TraceError>>(
        &mut self,
        reader: &mut TraceReader<'_>,
        rig: &Rig,
        mut each: impl FnMut() -> Result<(), E>,
    ) -> Result<(), E> {
        reader.need_both_pressures(&rig.columns)?;
        let columns = reader.columns(&rig.columns);
        let mut own = Series { name: reader.name().to_owned(), columns, ..Series::default() };
        let (mut piece, mut count, mut t_s, mut in_piece) = (Series::default(), None, 0.0, 0);
        let mut record = Record::default();
        while reader.next_record(&mut record)? {
            each()?;
            t_s += Series::step_to(&record);
            own.left_out += 1;
            own.channels.add(&Record { t_s, ..record });
            in_piece += 1;
            if self.begun.is_multiple_of(self.stride) {
                piece.push(t_s, &record.sample, record.temperature_k);
            }
            if in_piece < PIECE_SAMPLES * count.unwrap_or(1) {
                continue;
            }
            // The first piece tells how fast the recording is, and goes on to its full length.
            if count.is_none() && !piece.is_empty() {
                count = Some(piece.samples_per(LEAST_STEP_S).max(1));
                if count != Some(1) {
                    continue;
                }
            }
            self.end_piece(&mut piece, count);
            in_piece = 0;
        }
        self.end_piece(&mut piece, count);
        self.traces.push(own);
        Ok(())
    }

    /// What is held of each trace: of one among very many, maybe nothing.
    pub fn into_series(self) -> Vec<Series> {
        let mut all = self.traces;
        for Piece { trace, series, .. } in self.pieces {
            let own = &mut all[trace];
            if own.is_empty() {
                own.merged = series.merged;
            }
            own.extend(&series);
            own.left_out = own.left_out.saturating_sub(series.held());
        }
        all
    }

    fn end_piece(&mut self, piece: &mut Series, count: Option<usize>) {
        let number = self.begun;
        self.begun += 1;
        let whole = std::mem::take(piece);
        if whole.is_empty() {
            return;
        }
        let count = count.unwrap_or_else(|| whole.samples_per(LEAST_STEP_S));
        self.pieces.push(Piece { number, trace: self.traces.len(), series: whole.thinned(count) });
        while self.pieces.len() > 1 && self.held() > MOST_SAMPLES {
            self.stride *= 2;
            self.pieces.retain(|piece| piece.number.is_multiple_of(self.stride));
        }
    }

    fn held(&self) -> usize {
        self.pieces.iter().map(|piece| piece.series.len()).sum()
    }
}

/// What tells one input from another, whatever path or link leads to it.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Input {
    File(Identity),
    /// What is no file.
    Other(PathBuf),
}

impl Input {
    fn at(path: &Path) -> Self {
        identity(path).map_or_else(|| Self::Other(path.to_owned()), Self::File)
    }
}

/// A file to judge on that is fitted too: its error would say nothing.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{} is both fitted and judged on{}", .judged.display(), also_known_as(.judged, .fitted))]
pub struct FittedAndJudged {
    /// As it was given to be judged on.
    pub judged: PathBuf,
    /// As it was given to be fitted.
    pub fitted: PathBuf,
}

/// A file that was given twice; it is read once.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SameFile {
    /// As it was given first.
    pub first: PathBuf,
    /// As it was given again.
    pub again: PathBuf,
}

impl std::fmt::Display for SameFile {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { first, again } = self;
        write!(f, "{} is given twice{}: it is read once", again.display(), also_known_as(again, first))
    }
}

fn also_known_as(path: &Path, other: &Path) -> String {
    if path == other { String::new() } else { format!(" (as {})", other.display()) }
}

/// The files of a diagnosis, each once.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Roles {
    /// Files to fit.
    pub fitted: Vec<PathBuf>,
    /// Files to judge on.
    pub judged: Vec<PathBuf>,
    /// What was given more than once.
    pub repeated: Vec<SameFile>,
}

impl Roles {
    /// Tells the files apart before any is read.
    ///
    /// # Errors
    /// Where a file has both roles.
    pub fn of(fitted: &[PathBuf], judged: &[PathBuf]) -> Result<Self, FittedAndJudged> {
        let mut roles = Self::default();
        let fitted = roles.each_once(fitted);
        let judged = roles.each_once(judged);
        if let Some((one, judged)) = judged.iter().find(|(one, _)| fitted.iter().any(|(own, _)| own == one)) {
            let fitted = fitted.iter().find(|(own, _)| own == one).map(|(_, path)| path.clone());
            return Err(FittedAndJudged { judged: judged.clone(), fitted: fitted.unwrap_or_default() });
        }
        roles.fitted = fitted.into_iter().map(|(_, path)| path).collect();
        roles.judged = judged.into_iter().map(|(_, path)| path).collect();
        Ok(roles)
    }

    fn each_once(&mut self, paths: &[PathBuf]) -> Vec<(Input, PathBuf)> {
        let mut seen: BTreeMap<Input, PathBuf> = BTreeMap::new();
        let mut once = Vec::new();
        for path in paths {
            let input = Input::at(path);
            if let Some(first) = seen.get(&input) {
                self.repeated.push(SameFile { first: first.clone(), again: path.clone() });
                continue;
            }
            seen.insert(input.clone(), path.clone());
            once.push((input, path.clone()));
        }
        once
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fmt::Write;
    use std::io::Cursor;

    /// `rows` readings at a rate, the position telling their number.
    fn add(traces: &mut Traces, rows: usize, rate_hz: f64) {
        let mut text = "t_s,x_m,pa_pa,pb_pa,qa_m3s,qb_m3s\n".to_owned();
        for row in 0..rows {
            let x = 0.1 * row as f64 / rows as f64;
            let _ = writeln!(text, "{:.5},{x:.7},4e6,3e6,0,0", row as f64 / rate_hz);
        }
        let rig = Rig::paper();
        let mut reader = TraceReader::from_stream("trace", Box::new(Cursor::new(text.into_bytes())), &rig)
            .expect("a trace");
        traces.read(&mut reader, &rig, || Ok::<_, TraceError>(())).expect("reads");
    }

    #[test]
    fn what_is_short_is_held_whole_and_joined_without_a_gap() {
        for (rate_hz, merged) in [(100.0, 0), (500.0, 4)] {
            let mut traces = Traces::default();
            add(&mut traces, 25_000, rate_hz);
            let all = traces.into_series();
            let [series] = all.as_slice() else { panic!("one trace") };
            assert_eq!((series.held(), series.merged, series.left_out), (25_000, merged, 0));
            assert_eq!(series.stretches().len(), 1);
        }
    }

    #[test]
    fn what_is_long_is_held_in_pieces_evenly_over_it() {
        let rows = 3 * MOST_SAMPLES;
        let mut traces = Traces::default();
        add(&mut traces, rows, 100.0);
        let all = traces.into_series();
        let series = &all[0];
        assert!((MOST_SAMPLES / 2..=MOST_SAMPLES).contains(&series.len()), "{}", series.len());
        assert_eq!(series.held() + series.left_out, rows as u64);
        assert!(series.stretches().iter().all(|stretch| stretch.len() == PIECE_SAMPLES));
        let mean = series.x_m.iter().sum::<f64>() / series.len() as f64;
        assert!((mean / 0.05 - 1.0).abs() < 0.05, "{mean}");
    }

    #[test]
    fn many_short_traces_are_held_whole_and_of_too_many_every_other_one() {
        let mut traces = Traces::default();
        (0..1000).for_each(|_| add(&mut traces, 50, 100.0));
        assert_eq!(traces.clone().into_series().iter().map(Series::held).sum::<u64>(), 50_000);
        (0..40).for_each(|_| add(&mut traces, 4000, 100.0));
        let all = traces.into_series();
        let held = all.iter().map(Series::len).sum::<usize>();
        assert!(held <= MOST_SAMPLES && held > MOST_SAMPLES / 2, "{held}");
        assert_eq!(all.iter().map(|one| one.held() + one.left_out).sum::<u64>(), 50_000 + 160_000);
    }
}

#[cfg(test)]
mod role_tests {
    use super::*;

    #[test]
    fn a_file_has_one_role_and_is_read_once_whatever_it_is_called() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = |name: &str| folder.path().join(name);
        for name in ["a.csv", "b.csv"] {
            std::fs::write(path(name), name).expect("a file");
        }
        let around = folder.path().join(".").join("a.csv");
        let roles = Roles::of(&[path("a.csv"), around.clone()], &[path("b.csv")]).expect("apart");
        assert_eq!((roles.fitted, roles.judged), (vec![path("a.csv")], vec![path("b.csv")]));
        assert_eq!(roles.repeated, [SameFile { first: path("a.csv"), again: around }]);
        #[cfg(unix)]
        for link in [
            std::fs::hard_link::<PathBuf, PathBuf> as fn(PathBuf, PathBuf) -> _,
            std::os::unix::fs::symlink::<PathBuf, PathBuf>,
        ] {
            link(path("a.csv"), path("c.csv")).expect("a link");
            let both = FittedAndJudged { judged: path("c.csv"), fitted: path("a.csv") };
            assert_eq!(Roles::of(&[path("a.csv")], &[path("c.csv")]), Err(both));
            std::fs::remove_file(path("c.csv")).expect("the link");
        }
        assert!(Roles::of(&[path("absent.csv")], &[path("none.csv")]).is_ok());
    }
}
