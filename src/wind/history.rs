use super::{Wind, WindCase};
use crate::openfast;
use std::io::Read;
use std::path::{Path, PathBuf};

/// Pitch and pitch moment of one blade over time, on the turbine's own scale.
#[derive(Clone, Debug, PartialEq)]
pub struct History {
    /// Time of each sample, s; increasing, evenly spaced to 5 %.
    pub t_s: Vec<f64>,
    /// Wind at hub height, m/s, where the source has it.
    pub wind_mps: Option<Vec<f64>>,
    /// Pitch angle θ, rad, positive towards feather.
    pub pitch_rad: Vec<f64>,
    /// Pitch moment T_w of eq. (18), N m, positive against the extending piston: OpenFAST's
    /// `RootMzb` with its own sign. Inertia about the pitch axis is not in it.
    pub moment_nm: Vec<f64>,
}

/// Why a file gives no wind history.
#[derive(Debug, thiserror::Error)]
pub enum HistoryError {
    /// The file cannot be read.
    #[error("{path}: {source}", path = path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// Neither built in nor a file.
    #[error("{path}: no such file; built in are the winds 5, 13, 21 and 30 (m/s)", path = path.display())]
    NoSuchWind {
        /// As given.
        path: PathBuf,
    },
    /// More than any history has: a device, or the wrong file.
    #[error("{path}: longer than {} MiB: no wind history is", LARGEST_BYTES >> 20, path = path.display())]
    TooLarge {
        /// The file.
        path: PathBuf,
    },
    /// An OpenFAST file that cannot be read.
    #[error(transparent)]
    OpenFast(#[from] openfast::Error),
    /// A needed channel or column is not there.
    #[error("{path}: has no {missing}", path = path.display())]
    Missing {
        /// The file.
        path: PathBuf,
        /// What was looked for.
        missing: &'static str,
    },
    /// A channel has a unit the program does not know.
    #[error("{path}: {channel} is in {unit:?}; {allowed} is needed", path = path.display())]
    Unit {
        /// The file.
        path: PathBuf,
        /// Name of the channel.
        channel: String,
        /// Its unit in the file.
        unit: String,
        /// The units that are known.
        allowed: &'static str,
    },
    /// A cell of a CSV file is not a number.
    #[error("{path}: line {line}, column {column}: not a finite number", path = path.display())]
    Cell {
        /// The file.
        path: PathBuf,
        /// Line, from 1.
        line: u64,
        /// Name of the column.
        column: &'static str,
    },
    /// The samples do not make a history.
    #[error("{path}: {why}", path = path.display())]
    Samples {
        /// The file.
        path: PathBuf,
        /// What is wrong with them.
        why: &'static str,
    },
}

/// More than an hour of OpenFAST output with a hundred channels at 80 Hz, in text.
const LARGEST_BYTES: u64 = 512 << 20;

impl History {
    /// Reads the history of `wind`, from within the program or from its file.
    ///
    /// # Errors
    /// [`HistoryError`]; a built-in case gives none.
    pub fn of(wind: &Wind) -> Result<Self, HistoryError> {
        match wind {
            Wind::BuiltIn(case) => Self::from_csv(built_in(*case), Path::new("(built-in wind)")),
            Wind::File(path) => Self::from_file(path),
        }
    }

    fn from_file(path: &Path) -> Result<Self, HistoryError> {
        let bytes = std::fs::File::open(path).and_then(bounded).map_err(|source| match source.kind() {
            std::io::ErrorKind::NotFound => HistoryError::NoSuchWind { path: path.to_owned() },
            _ => HistoryError::Io { path: path.to_owned(), source },
        })?;
        let bytes = bytes.ok_or_else(|| HistoryError::TooLarge { path: path.to_owned() })?;
        if is_csv(path) {
            return Self::from_csv(&bytes, path);
        }
        let run = openfast::parse(&bytes)
            .map_err(|problem| openfast::Error::Content { path: path.into(), problem })?;
        Self::from_run(&run, path)
    }

    /// The first blade of which `run` has both pitch (`BldPitch1`…) and moment (`RootMzb1`… or
    /// `RootMzc1`…). `path` is named in errors.
    ///
    /// # Errors
    /// [`HistoryError::Missing`], [`HistoryError::Unit`], [`HistoryError::Samples`].
    pub fn from_run(run: &openfast::Run, path: &Path) -> Result<Self, HistoryError> {
        let find = |names: [String; 2]| names.iter().find_map(|name| run.channel(name));
        let (pitch, moment) = (1..=3)
            .find_map(|blade| {
                let pitch = find([format!("BldPitch{blade}"), format!("PtchPMzc{blade}")])?;
                Some((pitch, find([format!("RootMzb{blade}"), format!("RootMzc{blade}")])?))
            })
            .ok_or_else(|| HistoryError::Missing {
                path: path.into(),
                missing: "pair of BldPitchN and RootMzbN (or RootMzcN) of one blade",
            })?;
        let wind = find(["Wind1VelX".into(), "RtVAvgxh".into()]);
        Self {
            t_s: run.time_s.clone(),
            wind_mps: wind.map(|channel| channel.values.clone()),
            pitch_rad: in_si(pitch, &[("deg", 1.0_f64.to_radians()), ("rad", 1.0)], "deg or rad", path)?,
            moment_nm: in_si(
                moment,
                &[
                    ("kN-m", 1e3),
                    ("kN\u{b7}m", 1e3),
                    ("kNm", 1e3),
                    ("N-m", 1.0),
                    ("N\u{b7}m", 1.0),
                    ("Nm", 1.0),
                ],
                "kN-m or N-m",
                path,
            )?,
        }
        .checked(path)
    }

    /// CSV, plain or gzip, with the columns of `data/wind/README.md`.
    fn from_csv(bytes: &[u8], path: &Path) -> Result<Self, HistoryError> {
        let io = |source| HistoryError::Io { path: path.to_owned(), source };
        let plain = if bytes.starts_with(&[0x1f, 0x8b]) {
            let inflated = bounded(flate2::read::MultiGzDecoder::new(bytes)).map_err(io)?;
            inflated.ok_or_else(|| HistoryError::TooLarge { path: path.to_owned() })?
        } else {
            bytes.to_vec()
        };
        let csv_io = |e: csv::Error| io(std::io::Error::other(e));
        let mut reader = csv::ReaderBuilder::new().trim(csv::Trim::All).from_reader(plain.as_slice());
        let headers = reader.byte_headers().map_err(csv_io)?.clone();
        let find = |name: &'static str| {
            headers.iter().position(|h| h.eq_ignore_ascii_case(name.as_bytes())).map(|index| (index, name))
        };
        let need = |missing| find(missing).ok_or(HistoryError::Missing { path: path.into(), missing });
        let (t, pitch, moment) = (need("t_s")?, need("pitch_deg")?, need("pitch_moment_Nm")?);
        let wind = find("wind_mps");
        let mut history = Self {
            t_s: Vec::new(),
            wind_mps: wind.map(|_| Vec::new()),
            pitch_rad: Vec::new(),
            moment_nm: Vec::new(),
        };
        for record in reader.byte_records() {
            let record = record.map_err(csv_io)?;
            let cell = |(index, column)| {
                let text = record.get(index).and_then(|cell| std::str::from_utf8(cell).ok());
                let line = record.position().map_or(0, csv::Position::line);
                text.and_then(|text| text.parse().ok())
                    .filter(|value: &f64| value.is_finite())
                    .ok_or_else(|| HistoryError::Cell { path: path.into(), line, column })
            };
            history.t_s.push(cell(t)?);
            history.pitch_rad.push(cell(pitch)?.to_radians());
            history.moment_nm.push(cell(moment)?);
            if let (Some(values), Some(column)) = (&mut history.wind_mps, wind) {
                values.push(cell(column)?);
            }
        }
        history.checked(path)
    }

    /// Step between samples, s.
    pub fn step_s(&self) -> f64 {
        match (self.t_s.first(), self.t_s.last()) {
            (Some(first), Some(last)) if self.t_s.len() > 1 => (last - first) / (self.t_s.len() - 1) as f64,
            _ => 0.0,
        }
    }

    fn checked(self, path: &Path) -> Result<Self, HistoryError> {
        let wrong = |why| Err(HistoryError::Samples { path: path.into(), why });
        let step = self.step_s();
        let finite = |values: &[f64]| values.iter().all(|v| v.is_finite());
        if self.t_s.len() < 5 {
            wrong("has fewer than five samples")
        } else if ![&self.t_s, &self.pitch_rad, &self.moment_nm].into_iter().all(|v| finite(v))
            || !self.wind_mps.as_deref().is_none_or(finite)
        {
            wrong("holds a value that is not a finite number")
        } else if self
            .t_s
            .windows(2)
            .any(|pair| ((pair[1] - pair[0]) - step).abs() > 0.05 * step || step <= 0.0)
        {
            wrong("its samples are not evenly spaced in time")
        } else {
            Ok(self)
        }
    }
}

/// All there is to read; none where that is more than any history has.
fn bounded(from: impl Read) -> std::io::Result<Option<Vec<u8>>> {
    let mut bytes = Vec::new();
    from.take(LARGEST_BYTES + 1).read_to_end(&mut bytes)?;
    Ok((bytes.len() as u64 <= LARGEST_BYTES).then_some(bytes))
}

fn built_in(case: WindCase) -> &'static [u8] {
    match case {
        WindCase::Mps5 => include_bytes!("../../data/wind/wp15_05mps.csv.gz"),
        WindCase::Mps13 => include_bytes!("../../data/wind/wp15_13mps.csv.gz"),
        WindCase::Mps21 => include_bytes!("../../data/wind/wp15_21mps.csv.gz"),
        WindCase::Mps30 => include_bytes!("../../data/wind/wp15_30mps.csv.gz"),
    }
}

fn is_csv(path: &Path) -> bool {
    let name = path.to_string_lossy().to_ascii_lowercase();
    name.ends_with(".csv") || name.ends_with(".csv.gz")
}

/// The values of a channel times the factor of its unit.
fn in_si(
    channel: &openfast::Channel,
    factors: &[(&str, f64)],
    allowed: &'static str,
    path: &Path,
) -> Result<Vec<f64>, HistoryError> {
    let factor =
        factors.iter().find(|(unit, _)| channel.unit.eq_ignore_ascii_case(unit)).ok_or_else(|| {
            HistoryError::Unit {
                path: path.into(),
                channel: channel.name.clone(),
                unit: channel.unit.clone(),
                allowed,
            }
        })?;
    Ok(channel.values.iter().map(|value| value * factor.1).collect())
}
