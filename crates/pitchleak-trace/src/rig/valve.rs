//! `[valve]`: the data sheet of the valve, by which flows are known where there are no meters.

use super::bound::{self, Bound};
use super::document::{RigError, Section};
use super::keys::{Done, Keys};
use crate::units::{self, Dimension};

/// The valve between supply and cylinder, of four edges: supply to A, A to tank, supply to B, B to tank.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
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
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
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
const DROP: Bound = Bound::between(Dimension::Pressure, 1e3, 1e8);
const LAP: Bound = Bound::between(Dimension::Share, -1.0, 1.0);
const STROKE_M: Bound = Bound::between(Dimension::Length, 1e-6, 1.0);
const LAG_S: Bound = Bound::between(Dimension::Time, -1.0, 1.0);
const TANK_PA: Bound = Bound::between(Dimension::Pressure, -1.01325e5, 1e8);
const SUPPLY_PA: Bound = Bound::between(Dimension::Pressure, 1e4, 1e9);

impl ValveSheet {
    pub(super) fn read(section: &Section<'_>) -> Result<Option<Self>, RigError> {
        if !section.is_present() {
            return Ok(None);
        }
        section.read(Self::default(), Self::keys).map(Some)
    }

    pub(super) fn keys(keys: &mut Keys<'_>, own: &mut Self) -> Done {
        keys.needed("rated_flow", bound::FLOW_SCALE, &mut own.rated_flow_m3s)?;
        keys.needed("rated_drop", DROP, &mut own.rated_drop_pa)?;
        keys.share("gain_std", &mut own.gain_std, GAIN_STD)?;
        keys.number("lap", LAP, &mut own.lap, 0.0)?;
        keys.share("lap_std", &mut own.lap_std, LAP_STD)?;
        keys.share("null_leak", &mut own.null_leak, NULL_LEAK)?;
        keys.optional("stroke", STROKE_M, &mut own.stroke_m)?;
        keys.word("shut", shut_below, |share| format!("below {share:?}"), SHUT, &mut own.shut_below)?;
        keys.share("hysteresis", &mut own.hysteresis, HYSTERESIS)?;
        keys.number("spool_lag", LAG_S, &mut own.spool_lag_s, 0.0)?;
        keys.table("drift", &mut own.drift, |keys, drift| {
            keys.share("gain", &mut drift.gain, DRIFT.gain)?;
            keys.share("lap", &mut drift.lap, DRIFT.lap)?;
            keys.share("null_leak", &mut drift.null_leak, DRIFT.null_leak)
        })?;
        keys.optional("supply", SUPPLY_PA, &mut own.supply_pa)?;
        let usual_pa = SUPPLY_STD * own.supply_pa.unwrap_or(0.0);
        keys.number("supply_std", bound::BULK_MODULUS_STD, &mut own.supply_std_pa, usual_pa)?;
        keys.number("tank", TANK_PA, &mut own.tank_pa, 0.0)?;
        keys.word("calibration", |name| Some(name.to_owned()), String::clone, "", &mut own.calibration)
    }
}

/// What `shut` may be.
const SHUT: &str = "\"below 0.5 %\", a share of the spool's stroke";

fn shut_below(text: &str) -> Option<f64> {
    let share = units::parse(text.trim().strip_prefix("below ")?, Dimension::Share).ok()?;
    (share > 0.0 && share < 1.0).then_some(share)
}
