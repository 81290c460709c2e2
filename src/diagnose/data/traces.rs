//! Traces of any length and number in bounded memory.
//!
//! A fit takes several passes over what it is fitted to, so that has to be held, and time grows with it. What is held are
//! pieces, evenly over all the traces whatever happens in them, so that the choice favours no effect; their
//! standard deviations are those of so many samples. Whole traces are fitted as long as they are not too many.

use super::series::Series;
use crate::Rig;
use crate::diagnose::thresholds::{LEAST_STEP_S, MOST_SAMPLES, PIECE_SAMPLES};
use crate::trace::{Record, TraceError, TraceReader};

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
