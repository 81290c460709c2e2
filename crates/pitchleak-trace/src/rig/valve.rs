//! `[valve]`: the data sheet of the valve, by which flows are known where there are no meters.

use super::bound::{self, Bound};
use super::document::{RigError, Section};
use crate::units::{self, Dimension};

/// The valve between supply and cylinder, of four edges: supply to A, A to tank, supply to B, B to tank.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct ValveSheet {
    /// Flow over one fully open edge …
    pub rated_flow_m3s: f64,
    /// … at this drop of pressure over it.
    pub rated_drop_pa: f64,
    /// How far each edge's gain may be off, 1 σ, as a share of it.
    pub gain_std: f64,
    /// Overlap of each edge, a share of the spool's stroke; below zero where the edges are open at the middle …
    pub lap: f64,
    /// … and how far that may be off, 1 σ.
    pub lap_std: f64,
    /// What the whole valve leaks at its middle, as a share of the rated flow.
    pub null_leak: f64,
    /// Travel of the spool from its middle to full flow, m, where a trace has its position in millimetres.
    pub stroke_m: Option<f64>,
    /// Both ports are shut while the spool rests nearer to its middle than this share of its stroke.
    pub shut_below: Option<f64>,
    /// Half width of the spool's hysteresis, a share of its stroke.
    pub hysteresis: f64,
    /// By how much the spool's reading is late, s.
    pub spool_lag_s: f64,
    /// Since a calibration.
    pub drift: ValveDrift,
    /// Supply pressure where it is not recorded, Pa, …
    pub supply_pa: Option<f64>,
    /// … and how far that may be off, 1 σ.
    pub supply_std_pa: f64,
    /// Tank pressure where it is not recorded, Pa.
    pub tank_pa: f64,
    /// What `pitchleak calibrate` wrote.
    pub calibration: Option<String>,
}

/// By how much a valve changes after its calibration, 1 σ: shares of each edge's gain, of the stroke, and of `null_leak`.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct ValveDrift {
    /// Of each edge's gain.
    pub gain: f64,
    /// Of the spool's stroke.
    pub lap: f64,
    /// Of the leakage at the middle.
    pub null_leak: f64,
}

/// What the file leaves out: guesses by data sheets of proportional valves, but for a lap and a lag that are none.
const GAIN_STD: f64 = 0.1;
const LAP_STD: f64 = 0.01;
const NULL_LEAK: f64 = 0.02;
const HYSTERESIS: f64 = 0.003;
const DRIFT: ValveDrift = ValveDrift { gain: 0.03, lap: 0.001, null_leak: 0.1 };
/// Where neither a sensor nor its spread is given: a tenth of the supply pressure.
const SUPPLY_STD: f64 = 0.1;
/// Over an edge, Pa: from hoses to hammers.
const DROP: Bound = Bound::between(1e3, 1e8);
const LAP: Bound = Bound::between(-1.0, 1.0);
const STROKE_M: Bound = Bound::between(1e-6, 1.0);
const LAG_S: Bound = Bound::between(-1.0, 1.0);
const TANK_PA: Bound = Bound::between(-1.01325e5, 1e8);
const SUPPLY_PA: Bound = Bound::between(1e4, 1e9);

impl ValveSheet {
    pub(super) fn read(section: &Section<'_>) -> Result<Option<Self>, RigError> {
        if !section.is_present() {
            return Ok(None);
        }
        section.allow(&[
            "rated_flow",
            "rated_drop",
            "gain_std",
            "lap",
            "lap_std",
            "null_leak",
            "stroke",
            "shut",
            "hysteresis",
            "spool_lag",
            "drift",
            "supply",
            "supply_std",
            "tank",
            "calibration",
        ])?;
        let share = |key| section.quantity(key, Dimension::Share, bound::SHARE);
        let pressure = |key, bound| section.quantity(key, Dimension::Pressure, bound);
        let supply_pa = pressure("supply", SUPPLY_PA)?;
        Ok(Some(Self {
            rated_flow_m3s: section.required("rated_flow", Dimension::Flow, bound::FLOW_SCALE)?,
            rated_drop_pa: section.required("rated_drop", Dimension::Pressure, DROP)?,
            gain_std: share("gain_std")?.unwrap_or(GAIN_STD),
            lap: section.quantity("lap", Dimension::Share, LAP)?.unwrap_or(0.0),
            lap_std: share("lap_std")?.unwrap_or(LAP_STD),
            null_leak: share("null_leak")?.unwrap_or(NULL_LEAK),
            stroke_m: section.quantity("stroke", Dimension::Length, STROKE_M)?,
            shut_below: read_shut(section)?,
            hysteresis: share("hysteresis")?.unwrap_or(HYSTERESIS),
            spool_lag_s: section.quantity("spool_lag", Dimension::Time, LAG_S)?.unwrap_or(0.0),
            drift: ValveDrift::read(&section.section("drift")?)?,
            supply_std_pa: pressure("supply_std", bound::BULK_MODULUS_STD)?
                .unwrap_or(SUPPLY_STD * supply_pa.unwrap_or(0.0)),
            supply_pa,
            tank_pa: pressure("tank", TANK_PA)?.unwrap_or(0.0),
            calibration: section.text("calibration")?.map(str::to_owned),
        }))
    }
}

/// Reads `shut = "below 0.5 %"`.
fn read_shut(section: &Section<'_>) -> Result<Option<f64>, RigError> {
    let Some(text) = section.text("shut")? else { return Ok(None) };
    let below =
        text.trim().strip_prefix("below ").and_then(|share| units::parse(share, Dimension::Share).ok());
    let below = below.filter(|share| *share > 0.0 && *share < 1.0);
    below
        .map(Some)
        .ok_or_else(|| section.impossible("shut", text, "\"below 0.5 %\", a share of the spool's stroke"))
}

impl ValveDrift {
    fn read(section: &Section<'_>) -> Result<Self, RigError> {
        section.allow(&["gain", "lap", "null_leak"])?;
        let share = |key, default| {
            section.quantity(key, Dimension::Share, bound::SHARE).map(|given| given.unwrap_or(default))
        };
        Ok(Self {
            gain: share("gain", DRIFT.gain)?,
            lap: share("lap", DRIFT.lap)?,
            null_leak: share("null_leak", DRIFT.null_leak)?,
        })
    }
}
