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
    /// An OpenFAST file that cannot be read.
    #[error(transparent)]
    OpenFast(#[from] openfast::Error),
    /// Another one.
    #[error("{path}: {fault}", path = path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        fault: HistoryFault,
    },
}

/// What is wrong with a file of a wind history.
#[derive(Debug, thiserror::Error)]
pub enum HistoryFault {
    /// It cannot be read.
    #[error(transparent)]
    Io(#[from] std::io::Error),
    /// Neither built in nor a file.
    #[error("no such file; built in are the winds 5, 13, 21 and 30 (m/s)")]
    NoSuchWind,
    /// More than any history has: a device, or the wrong file.
    #[error("longer than {} MiB: no wind history is", LARGEST_BYTES >> 20)]
    TooLarge,
    /// A needed channel or column is not there.
    #[error("has no {0}")]
    Missing(&'static str),
    /// A channel has a unit the program does not know.
    #[error("{channel} is in {unit:?}; {allowed} is needed")]
    Unit {
        /// Name of the channel.
        channel: String,
        /// Its unit in the file.
        unit: String,
        /// The units that are known.
        allowed: &'static str,
    },
    /// A cell of a CSV file is not a number.
    #[error("line {line}, column {column}: not a finite number")]
    Cell {
        /// Line, from 1.
        line: u64,
        /// Name of the column.
        column: &'static str,
    },
    /// The samples do not make a history.
    #[error("{0}")]
    Samples(&'static str),
}

/// More than an hour of OpenFAST output with a hundred channels at 80 Hz, in text.
const LARGEST_BYTES: u64 = 512 << 20;

impl History {
    /// Reads the history of `wind`, from within the program or from its file.
    ///
    /// # Errors
    /// [`HistoryError`]; a built-in case gives none.
    pub fn of(wind: &Wind) -> Result<Self, HistoryError> {
        let path = match wind {
            Wind::BuiltIn(case) => {
                return Self::from_csv(built_in(*case)).map_err(in_file("(built-in wind)"));
            }
            Wind::File(path) => path,
        };
        let bytes = std::fs::File::open(path).map_err(HistoryFault::opening).and_then(bounded);
        let bytes = bytes.map_err(in_file(path))?;
        if is_csv(path) {
            return Self::from_csv(&bytes).map_err(in_file(path));
        }
        let run = openfast::parse(&bytes)
            .map_err(|problem| openfast::Error::Content { path: path.into(), problem })?;
        Self::from_run(&run, path)
    }

    /// The first blade of which `run` has both pitch (`BldPitch1`…) and moment (`RootMzb1`… or
    /// `RootMzc1`…). `path` is named in errors.
    ///
    /// # Errors
    /// [`HistoryFault::Missing`], [`HistoryFault::Unit`], [`HistoryFault::Samples`].
    pub fn from_run(run: &openfast::Run, path: &Path) -> Result<Self, HistoryError> {
        let find = |names: [String; 2]| names.iter().find_map(|name| run.channel(name));
        let of_blade = |blade: u8| {
            let pitch = find([format!("BldPitch{blade}"), format!("PtchPMzc{blade}")])?;
            Some((pitch, find([format!("RootMzb{blade}"), format!("RootMzc{blade}")])?))
        };
        let wind = find(["Wind1VelX".into(), "RtVAvgxh".into()]);
        let read = || {
            let (pitch, moment) = (1..=3)
                .find_map(of_blade)
                .ok_or(HistoryFault::Missing("pair of BldPitchN and RootMzbN (or RootMzcN) of one blade"))?;
            Self {
                t_s: run.time_s.clone(),
                wind_mps: wind.map(|channel| channel.values.clone()),
                pitch_rad: in_si(pitch, &PITCH_UNITS, "deg or rad")?,
                moment_nm: in_si(moment, &MOMENT_UNITS, "kN-m or N-m")?,
            }
            .checked()
        };
        read().map_err(in_file(path))
    }

    /// CSV, plain or gzip, with the columns of `data/wind/README.md`.
    fn from_csv(bytes: &[u8]) -> Result<Self, HistoryFault> {
        let plain = if bytes.starts_with(&[0x1f, 0x8b]) {
            bounded(flate2::read::MultiGzDecoder::new(bytes))?
        } else {
            bytes.to_vec()
        };
        let mut reader = csv::ReaderBuilder::new().trim(csv::Trim::All).from_reader(plain.as_slice());
        let headers = reader.byte_headers().map_err(std::io::Error::other)?.clone();
        let find = |name: &'static str| {
            headers.iter().position(|h| h.eq_ignore_ascii_case(name.as_bytes())).map(|index| (index, name))
        };
        let need = |name| find(name).ok_or(HistoryFault::Missing(name));
        let (t, pitch, moment) = (need("t_s")?, need("pitch_deg")?, need("pitch_moment_Nm")?);
        let wind = find("wind_mps");
        let mut history = Self {
            t_s: Vec::new(),
            wind_mps: wind.map(|_| Vec::new()),
            pitch_rad: Vec::new(),
            moment_nm: Vec::new(),
        };
        for record in reader.byte_records() {
            let record = record.map_err(std::io::Error::other)?;
            let cell = |(index, column)| {
                let text = record.get(index).and_then(|cell| std::str::from_utf8(cell).ok());
                let line = record.position().map_or(0, csv::Position::line);
                text.and_then(|text| text.parse().ok())
                    .filter(|value: &f64| value.is_finite())
                    .ok_or(HistoryFault::Cell { line, column })
            };
            history.t_s.push(cell(t)?);
            history.pitch_rad.push(cell(pitch)?.to_radians());
            history.moment_nm.push(cell(moment)?);
            if let (Some(values), Some(column)) = (&mut history.wind_mps, wind) {
                values.push(cell(column)?);
            }
        }
        history.checked()
    }

    /// Step between samples, s.
    pub fn step_s(&self) -> f64 {
        match (self.t_s.first(), self.t_s.last()) {
            (Some(first), Some(last)) if self.t_s.len() > 1 => (last - first) / (self.t_s.len() - 1) as f64,
            _ => 0.0,
        }
    }

    fn checked(self) -> Result<Self, HistoryFault> {
        let wrong = |why| Err(HistoryFault::Samples(why));
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

fn in_file(path: impl Into<PathBuf>) -> impl FnOnce(HistoryFault) -> HistoryError {
    |fault| HistoryError::File { path: path.into(), fault }
}

impl HistoryFault {
    fn opening(error: std::io::Error) -> Self {
        if error.kind() == std::io::ErrorKind::NotFound { Self::NoSuchWind } else { Self::Io(error) }
    }
}

/// All there is to read.
fn bounded(from: impl Read) -> Result<Vec<u8>, HistoryFault> {
    let mut bytes = Vec::new();
    from.take(LARGEST_BYTES + 1).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > LARGEST_BYTES { Err(HistoryFault::TooLarge) } else { Ok(bytes) }
}

/// Units of OpenFAST's channels, in SI.
const PITCH_UNITS: [(&str, f64); 2] = [("deg", 1.0_f64.to_radians()), ("rad", 1.0)];
const MOMENT_UNITS: [(&str, f64); 6] =
    [("kN-m", 1e3), ("kN\u{b7}m", 1e3), ("kNm", 1e3), ("N-m", 1.0), ("N\u{b7}m", 1.0), ("Nm", 1.0)];

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
) -> Result<Vec<f64>, HistoryFault> {
    let known = factors.iter().find(|(unit, _)| channel.unit.eq_ignore_ascii_case(unit));
    let strange = || {
        let (channel, unit) = (channel.name.clone(), channel.unit.clone());
        HistoryFault::Unit { channel, unit, allowed }
    };
    let factor = known.ok_or_else(strange)?;
    Ok(channel.values.iter().map(|value| value * factor.1).collect())
}
