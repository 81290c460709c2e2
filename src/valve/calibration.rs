//! A valve's calibration: what traces of this rig say of its edges, kept in a file for later traces.

use super::equations::Known;
use super::meter::{Taken, ValveMeter};
use super::unknowns::{
    Belief, CERTAIN, CLEARANCES, GAINS, Information, LAPS, LEAK_STD, LEAKS, UNKNOWNS, Unknowns,
};
use crate::report::{ReplayReport, Status};
use crate::rig::{Rig, ValveSheet};
use crate::trace::{Record, TraceError, TraceReader};
use jiff::Zoned;
use jiff::civil::Date;
use pitchleak_core::{ValveCalibration, ValveNoise};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// What is known of the leaks while the valve is calibrated.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum LeaksThen {
    /// There are none: later leaks are absolute.
    Zero,
    /// There may be any: later external leaks are changes since.
    Unknown,
}

impl LeaksThen {
    /// Each by its name, as the file has it.
    pub const NAMES: [&'static str; 2] = ["zero", "unknown"];

    /// By one of [`Self::NAMES`].
    pub fn by_name(name: &str) -> Option<Self> {
        let place = Self::NAMES.iter().position(|own| *own == name);
        place.map(|place| [Self::Zero, Self::Unknown][place])
    }
}

/// Which calibration leaks are told against.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Since {
    /// Its day.
    pub date: Date,
    /// What was known of the leaks then.
    pub leaks: LeaksThen,
    /// Whether a hold test showed that there were none; else that was assumed.
    pub has_evidence: bool,
}

/// A calibration, as `valve.toml` has it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Calibration {
    /// `pitchleak.valve/1`.
    pub schema: String,
    /// When it was made.
    pub date: Date,
    /// What was known of the leaks.
    pub leaks: LeaksThen,
    /// The hold test that shows that there were none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub evidence: Option<String>,
    /// Of the rig's numbers that it depends on.
    pub rig: String,
    /// What it was made of.
    pub traces: Vec<String>,
    /// Time in them, s.
    pub seconds: f64,
    /// Least and greatest position of the spool, shares of its stroke: beyond them nothing is known.
    pub spool_range: [f64; 2],
    /// What the readings scatter, in the declared noise's standard deviations.
    pub scatter: f64,
    /// The unknowns, in the order of docs/valve.md, …
    mean: Vec<f64>,
    /// … and their covariances: the rows of a lower triangle.
    covariance: Vec<Vec<f64>>,
}

/// Why a valve is not calibrated.
#[derive(Debug, thiserror::Error)]
pub enum CalibrationError {
    /// The rig has no `[valve]`.
    #[error("{0} has no [valve]: give at least its rated_flow and rated_drop")]
    NoValve(String),
    /// A trace cannot be read.
    #[error(transparent)]
    Trace(#[from] TraceError),
    /// A trace has no spool or no supply pressure.
    #[error(
        "{0}: no row has a spool position (`spool_percent`) and a supply pressure (`ps_bar`, or `supply` in [valve])"
    )]
    NoSpool(String),
    /// The traces are too short, or nothing fits them.
    #[error("the traces say nothing of the valve: record a minute or more, in motion and both ways")]
    Nothing,
    /// A leak set in while it was recorded: when, s.
    #[error("a leak changed {0:.0} s into the traces: calibrate with traces in which nothing changes")]
    LeakChanged(f64),
    /// A hold test shows that nothing leaks, beside leaks that are said to be unknown: a warning, the calibration goes on without it.
    #[error(
        "evidence that nothing leaks is left aside beside leaks that are `unknown`: with it they are `zero`"
    )]
    UnknownInSpiteOfEvidence,
    /// A trace that was to show that nothing leaks does not.
    #[error("{trace} is no evidence that nothing leaks: {text}")]
    NoEvidence {
        /// The trace's name.
        trace: String,
        /// Its verdict.
        text: String,
    },
    /// The file cannot be read.
    #[error("{}: {source}", file.display())]
    Read {
        /// The file.
        file: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// The file is none of ours.
    #[error("{}: no calibration of a valve: {message}; write one with `pitchleak calibrate`", file.display())]
    Content {
        /// The file.
        file: PathBuf,
        /// What is wrong.
        message: String,
    },
    /// It has no form as a file.
    #[error("the calibration has no TOML form: {0}")]
    Form(#[from] toml::ser::Error),
    /// The file is of another rig.
    #[error("{}: made for another rig: areas, stroke, volumes or the valve's rated flow differ; calibrate anew", .0.display())]
    OtherRig(PathBuf),
}

const SCHEMA: &str = "pitchleak.valve/1";
/// Clearances that an unknown external leak may hide in, 1 σ, L/min at 50 bar.
const LEAK_IN_CLEARANCE: f64 = 1.0;

/// Calibrates the valve of a rig with traces of it.
#[derive(Clone, Debug)]
pub struct Calibrator {
    leaks: LeaksThen,
    meter: ValveMeter,
    traces: Vec<String>,
    evidence: Option<String>,
}

impl Calibrator {
    /// For a rig with `[valve]`, of which a calibration before is left aside.
    ///
    /// # Errors
    /// [`CalibrationError::NoValve`].
    pub fn new(rig: &Rig, leaks: LeaksThen) -> Result<Self, CalibrationError> {
        let sheet = rig.valve.as_ref().ok_or_else(|| CalibrationError::NoValve(rig.name.clone()))?;
        let meter = ValveMeter::with(rig, sheet, before(rig, sheet, leaks), None);
        Ok(Self { leaks, meter, traces: Vec::new(), evidence: None })
    }

    /// Takes in a trace of this rig.
    ///
    /// # Errors
    /// [`CalibrationError::Trace`], [`CalibrationError::NoSpool`].
    pub fn read(&mut self, reader: &mut TraceReader<'_>) -> Result<(), CalibrationError> {
        reader.need_both_pressures(&self.meter.rig.columns)?;
        let mut record = Record::default();
        let (mut is_first, mut rows) = (true, 0);
        while reader.next_record(&mut record)? {
            record.after_gap |= std::mem::take(&mut is_first);
            rows += usize::from(self.meter.push(&record));
        }
        self.traces.push(reader.name().to_owned());
        if rows > 0 { Ok(()) } else { Err(CalibrationError::NoSpool(reader.name().to_owned())) }
    }

    /// Rests the calibration on a hold test that shows that nothing leaks.
    ///
    /// # Errors
    /// [`CalibrationError::NoEvidence`], [`CalibrationError::UnknownInSpiteOfEvidence`].
    pub fn rest_on(&mut self, hold: &ReplayReport) -> Result<(), CalibrationError> {
        let trace = hold.trace.path.clone();
        if hold.hold.is_none() || hold.verdict.status != Status::Sound {
            return Err(CalibrationError::NoEvidence { trace, text: hold.verdict.text.clone() });
        }
        if self.leaks == LeaksThen::Unknown {
            return Err(CalibrationError::UnknownInSpiteOfEvidence);
        }
        self.evidence = Some(trace);
        Ok(())
    }

    /// What the traces say.
    ///
    /// # Errors
    /// [`CalibrationError::Nothing`], [`CalibrationError::LeakChanged`].
    pub fn finish(mut self) -> Result<Calibration, CalibrationError> {
        // What goes to and fro about values that noise explains is known by as much as its spread says.
        let is_known = |taken: &Taken| taken.is_settled || taken.is_explained();
        let taken = self.meter.taken().filter(is_known).ok_or(CalibrationError::Nothing)?;
        if let Some(at_s) = taken.changed_at_s {
            return Err(CalibrationError::LeakChanged(at_s));
        }
        let covariance = taken.summary.belief.covariance().ok_or(CalibrationError::Nothing)?;
        let widened = covariance * taken.summary.noise.max(1.0);
        Ok(Calibration {
            schema: SCHEMA.to_owned(),
            date: Zoned::now().date(),
            leaks: self.leaks,
            evidence: self.evidence,
            rig: rig_hash(&self.meter.rig, &self.meter.sheet),
            seconds: taken.summary.pressures.time_s,
            spool_range: self.meter.spool_range().ok_or(CalibrationError::Nothing)?,
            scatter: taken.summary.noise.sqrt(),
            mean: taken.summary.belief.mean.iter().copied().collect(),
            covariance: (0..UNKNOWNS).map(|i| (0..=i).map(|j| widened[(i, j)]).collect()).collect(),
            traces: self.traces,
        })
    }
}

/// What is believed before a calibration: no leaks, or external ones within the clearances, which look the same.
fn before(rig: &Rig, sheet: &ValveSheet, leaks: LeaksThen) -> Belief {
    let mut before = Belief::of_sheet(rig, sheet);
    let mut set = |at: usize, std: f64| before.information[(at, at)] = std.powi(-2);
    set(LEAKS + 1, CERTAIN);
    set(LEAKS + 2, CERTAIN);
    match leaks {
        LeaksThen::Zero => set(LEAKS, CERTAIN),
        // A–T and B–T.
        LeaksThen::Unknown => [1, 3].into_iter().for_each(|edge| set(CLEARANCES + edge, LEAK_IN_CLEARANCE)),
    }
    before
}

/// One edge as a calibration knows it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EdgeFound {
    /// `P–A`, …
    pub name: &'static str,
    /// Beside the data sheet's, and 1 σ.
    pub gain: [f64; 2],
    /// Overlap, a share of the stroke, and 1 σ.
    pub lap: [f64; 2],
    /// Clearance at 50 bar, L/min, and 1 σ.
    pub clearance_lpm: [f64; 2],
}

impl Calibration {
    /// Reads what `pitchleak calibrate` wrote.
    ///
    /// # Errors
    /// [`CalibrationError::Read`], [`CalibrationError::Content`].
    pub fn load(file: &Path) -> Result<Self, CalibrationError> {
        let text = std::fs::read_to_string(file)
            .map_err(|source| CalibrationError::Read { file: file.to_owned(), source })?;
        let wrong = |message: String| CalibrationError::Content { file: file.to_owned(), message };
        let found: Self = toml::from_str(&text).map_err(|error| wrong(error.message().replace('\n', " ")))?;
        let is_whole = found.schema == SCHEMA
            && found.mean.len() == UNKNOWNS
            && found.covariance.len() == UNKNOWNS
            && found.covariance.iter().enumerate().all(|(i, row)| row.len() == i + 1)
            && found.mean.iter().chain(found.covariance.iter().flatten()).all(|number| number.is_finite());
        if is_whole { Ok(found) } else { Err(wrong("its numbers are not those of this version".to_owned())) }
    }

    /// As a file.
    ///
    /// # Errors
    /// None in practice: every field has a TOML form.
    pub fn to_toml(&self) -> Result<String, CalibrationError> {
        let head = "# Written by `pitchleak calibrate`. In rig.toml: [valve] calibration = \"valve.toml\"\n";
        Ok(head.to_owned() + &toml::to_string(self)?)
    }

    /// What leaks are told against.
    pub fn since(&self) -> Since {
        Since { date: self.date, leaks: self.leaks, has_evidence: self.evidence.is_some() }
    }

    /// The edges.
    pub fn edges(&self) -> [EdgeFound; 4] {
        let of = |at: usize| {
            let variance = self.covariance.get(at).and_then(|row| row.last()).copied().unwrap_or_default();
            [self.mean.get(at).copied().unwrap_or_default(), variance.sqrt()]
        };
        let names = ["P–A", "A–T", "P–B", "B–T"];
        [0, 1, 2, 3].map(|edge| EdgeFound {
            name: names[edge],
            gain: of(GAINS + edge),
            lap: of(LAPS + edge),
            clearance_lpm: of(CLEARANCES + edge),
        })
    }

    /// As a controller takes it ([`ValveFilter`](pitchleak_core::ValveFilter)), with the noise of the rig's sensors; none where the rig
    /// has no valve.
    pub fn for_controller(&self, rig: &Rig) -> Option<(ValveCalibration<f64>, ValveNoise<f64>)> {
        let sheet = rig.valve.as_ref()?;
        let [position_m, pressure_pa, _, spool, supply_pa] =
            Known::of(rig, sheet).variances.map(f64::sqrt).into();
        let calibration = ValveCalibration {
            mean: self.mean.as_slice().try_into().ok()?,
            covariance: self.covariance.concat().try_into().ok()?,
            rated_flow_m3s: sheet.rated_flow_m3s,
            rated_drop_pa: sheet.rated_drop_pa,
            tank_pa: sheet.tank_pa,
            hysteresis: sheet.hysteresis,
            null_leak: sheet.null_leak,
            gain_drift: sheet.drift.gain,
            lap_drift: sheet.drift.lap,
            null_leak_drift: sheet.drift.null_leak,
        };
        Some((calibration, ValveNoise { position_m, pressure_pa, spool, supply_pa }))
    }

    /// What is believed of a later trace: the valve may have changed as declared, the oil as well, and the leaks are open.
    pub(super) fn belief(&self, rig: &Rig, sheet: &ValveSheet) -> Option<Belief> {
        let covariance = Information::from_fn(|i, j| {
            let (i, j) = (i.max(j), i.min(j));
            self.covariance[i][j]
        });
        Belief::of(Unknowns::from_iterator(self.mean.iter().copied()), covariance, [LEAK_STD; 3])?.later(
            rig,
            sheet,
            f64::INFINITY,
        )
    }
}

/// The calibration that a rig names, where it names one; a path is meant beside the rig file.
pub(super) fn of_rig(rig: &Rig, sheet: &ValveSheet) -> Result<Option<Calibration>, CalibrationError> {
    let Some(name) = &sheet.calibration else { return Ok(None) };
    let beside = rig.file().and_then(Path::parent).unwrap_or(Path::new(""));
    let file = beside.join(name);
    let found = Calibration::load(&file)?;
    if found.rig == rig_hash(rig, sheet) { Ok(Some(found)) } else { Err(CalibrationError::OtherRig(file)) }
}

/// A checksum over the numbers that a calibration depends on.
fn rig_hash(rig: &Rig, sheet: &ValveSheet) -> String {
    let cylinder = &rig.cylinder;
    let numbers = [
        cylinder.area_a_m2,
        cylinder.area_b_m2,
        cylinder.stroke_m,
        cylinder.dead_volume_a_m3,
        cylinder.dead_volume_b_m3,
        rig.fluid.bulk_modulus_pa,
        sheet.rated_flow_m3s,
        sheet.rated_drop_pa,
    ];
    let mut sum = flate2::Crc::new();
    numbers.iter().for_each(|number| sum.update(&number.to_bits().to_le_bytes()));
    format!("{:08x}", sum.sum())
}
