use super::EstimateRow;
use flate2::Compression;
use flate2::write::GzEncoder;
use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::Path;

/// Error returned by [`EstimateFile`].
#[derive(Debug, thiserror::Error)]
pub enum EstimateFileError {
    /// Not a kind of file that estimates are written to.
    #[error("{0}: estimates over time are written as .csv or .csv.gz")]
    Kind(String),
    /// The file cannot be written.
    #[error("{file}: {source}")]
    Write {
        /// As the user named it.
        file: String,
        /// What the system says.
        source: io::Error,
    },
}

/// A CSV file of estimates over time, a row per record: coefficients in m³/(s·Pa), flows in L/min at the
/// instant's pressures, active alarms as 1.
pub struct EstimateFile {
    file: String,
    sink: Sink,
}

enum Sink {
    Plain(BufWriter<File>),
    Gzip(Box<GzEncoder<BufWriter<File>>>),
}

impl EstimateFile {
    /// Creates the file, `.csv` or `.csv.gz` by its name.
    ///
    /// # Errors
    /// Where it has another name, or cannot be written.
    pub fn create(path: impl AsRef<Path>) -> Result<Self, EstimateFileError> {
        let file = path.as_ref().display().to_string();
        let gzip = file.ends_with(".csv.gz");
        if !gzip && !file.ends_with(".csv") {
            return Err(EstimateFileError::Kind(file));
        }
        let writer = match File::create(path) {
            Ok(created) => BufWriter::new(created),
            Err(source) => return Err(EstimateFileError::Write { file, source }),
        };
        let sink = if gzip {
            Sink::Gzip(Box::new(GzEncoder::new(writer, Compression::default())))
        } else {
            Sink::Plain(writer)
        };
        let mut created = Self { file, sink };
        let header = created.sink.write_line(format_args!("{}", EstimateRow::COLUMNS.join(",")));
        header.map_err(|source| created.error(source))?;
        Ok(created)
    }

    /// Writes one row.
    ///
    /// # Errors
    /// Where the file cannot be written on.
    pub fn write(&mut self, point: &EstimateRow) -> Result<(), EstimateFileError> {
        let [t_s, numbers @ .., internal, external_a, external_b] = point.values();
        let [a, b, c, d, e, f, g, h, i] = numbers;
        let written = self.sink.write_line(format_args!(
            "{t_s},{a:e},{b:e},{c:e},{d:e},{e:e},{f:e},{g:e},{h:e},{i:e},{internal},{external_a},{external_b}",
        ));
        written.map_err(|source| self.error(source))
    }

    /// Writes what is still held back.
    ///
    /// # Errors
    /// Where that fails: the file is then not whole.
    pub fn finish(self) -> Result<(), EstimateFileError> {
        let Self { file, sink } = self;
        let finished = match sink {
            Sink::Plain(mut writer) => writer.flush(),
            Sink::Gzip(encoder) => encoder.finish().and_then(|mut writer| writer.flush()),
        };
        finished.map_err(|source| EstimateFileError::Write { file, source })
    }

    fn error(&self, source: io::Error) -> EstimateFileError {
        EstimateFileError::Write { file: self.file.clone(), source }
    }
}

impl Sink {
    fn write_line(&mut self, line: std::fmt::Arguments<'_>) -> io::Result<()> {
        match self {
            Self::Plain(writer) => writeln!(writer, "{line}"),
            Self::Gzip(encoder) => writeln!(encoder, "{line}"),
        }
    }
}
