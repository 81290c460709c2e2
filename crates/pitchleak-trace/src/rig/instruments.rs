//! Data sheets: `[sensors]`, and `[valve]`, by which flows are known where there are no meters.

use super::bound::{self, Bound};
use super::document::{RigError, Section};
use super::keys::{Done, Keys};
use crate::units::{self, Dimension, LPM_PER_M3S};
use pitchleak_core::{Cylinder, SensorSpread, Sensors};

/// One sensor as its data sheet declares it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Instrument {
    /// Full scale, in the sensor's SI unit.
    pub full_scale: f64,
    /// 3 σ of white noise, as a share of full scale.
    pub accuracy: f64,
    /// How far the offset may be off, 1 σ, as a share of full scale.
    pub bias: f64,
    /// How far the scale may be off, 1 σ, as a share of the reading.
    pub gain: f64,
    /// How far the offset may drift in an hour, 1 σ, as a share of full scale.
    pub drift: f64,
}

/// The data sheets of all sensors of a rig.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Instruments {
    /// Flow meter of chamber A, m³/s.
    pub flow_a: Instrument,
    /// Flow meter of chamber B, m³/s.
    pub flow_b: Instrument,
    /// Both pressure sensors, Pa.
    pub pressure: Instrument,
    /// Position sensor, m.
    pub position: Instrument,
    /// Force sensor, N.
    pub force: Instrument,
    /// Position sensor of the valve's spool, a share of its stroke.
    pub spool: Instrument,
    /// Pressure sensor of the supply, Pa.
    pub supply: Instrument,
}

impl Instrument {
    /// Wu et al. (2011), Section III: every sensor within 1 % of its full scale.
    const PAPER_ACCURACY: f64 = 0.01;

    /// A sensor of the paper's accuracy.
    pub fn of_full_scale(full_scale: f64) -> Self {
        Self { full_scale, accuracy: Self::PAPER_ACCURACY, bias: 0.0, gain: 0.0, drift: 0.0 }
    }

    /// The declared spread as the estimators use it.
    pub fn spread(&self) -> SensorSpread<f64> {
        SensorSpread {
            bias_std: self.bias * self.full_scale,
            gain_std: self.gain,
            drift_std_ph: self.drift * self.full_scale,
            ..SensorSpread::of_full_scale(self.full_scale, self.accuracy)
        }
    }
}

/// The keys of a sensor whose full scale is declared.
fn sheet(scale: Bound) -> impl Fn(&mut Keys<'_>, &mut Instrument) -> Done {
    move |keys, own| {
        keys.needed("full_scale", scale, &mut own.full_scale)?;
        shares(keys, own)
    }
}

/// Those of the spool, whose full scale is its stroke.
fn shares(keys: &mut Keys<'_>, own: &mut Instrument) -> Done {
    keys.share("accuracy", &mut own.accuracy, Instrument::PAPER_ACCURACY)?;
    keys.share("bias", &mut own.bias, 0.0)?;
    keys.share("gain", &mut own.gain, 0.0)?;
    keys.number("drift", bound::DRIFT_PER_HOUR, &mut own.drift, 0.0)
}

impl Instruments {
    /// The same sensors, each with white noise of 3 σ = `accuracy` of its full scale.
    pub fn with_accuracy(mut self, accuracy: f64) -> Self {
        let Self { flow_a, flow_b, pressure, position, force, spool, supply } = &mut self;
        for sheet in [flow_a, flow_b, pressure, position, force, spool, supply] {
            sheet.accuracy = accuracy;
        }
        self
    }

    /// Sensors of the paper's rig (Section III) on this cylinder: flow meters 20 L/min, the position
    /// sensor as long as the stroke.
    pub fn paper(cylinder: &Cylinder<f64>) -> Self {
        let flow = Instrument::of_full_scale(20.0 / LPM_PER_M3S);
        Self {
            flow_a: flow,
            flow_b: flow,
            pressure: Instrument::of_full_scale(16e6),
            position: Instrument::of_full_scale(cylinder.stroke_m),
            force: Instrument::of_full_scale(10e3),
            spool: Instrument::of_full_scale(1.0),
            supply: Instrument::of_full_scale(16e6),
        }
    }

    /// The declared spread of every sensor as the estimators use it.
    pub fn spread(&self) -> Sensors<f64> {
        Sensors {
            flow_a: self.flow_a.spread(),
            flow_b: self.flow_b.spread(),
            pressure: self.pressure.spread(),
            position: self.position.spread(),
            force: self.force.spread(),
        }
    }

    /// Full scale of the larger flow meter: no leak that is judged by them is larger, m³/s.
    pub(super) fn largest_flow_m3s(&self) -> f64 {
        self.flow_a.full_scale.max(self.flow_b.full_scale)
    }

    /// The sensors of the cylinder.
    pub(super) fn keys(keys: &mut Keys<'_>, own: &mut Self) -> Done {
        keys.sheet("flow_a", &mut own.flow_a, sheet(bound::FLOW_SCALE))?;
        keys.sheet("flow_b", &mut own.flow_b, sheet(bound::FLOW_SCALE))?;
        keys.sheet("pressure", &mut own.pressure, sheet(bound::PRESSURE_SCALE))?;
        keys.sheet("position", &mut own.position, sheet(bound::POSITION_SCALE))?;
        keys.sheet("force", &mut own.force, sheet(bound::FORCE_SCALE))
    }

    /// Those of its valve.
    pub(super) fn valve_keys(keys: &mut Keys<'_>, own: &mut Self) -> Done {
        keys.sheet("supply", &mut own.supply, sheet(bound::PRESSURE_SCALE))?;
        keys.sheet("spool", &mut own.spool, shares)
    }

    /// A sensor that the file leaves out is the paper's; that of the supply is as those of the chambers.
    pub(super) fn read(sensors: &Section<'_>, cylinder: &Cylinder<f64>) -> Result<Self, RigError> {
        sensors.allow(&["flow", "flow_a", "flow_b", "pressure", "position", "force", "spool", "supply"])?;
        let mut own = Self::paper(cylinder);
        let mut keys = Keys::Read(sensors);
        keys.sheet("flow", &mut own.flow_a, sheet(bound::FLOW_SCALE))?;
        own.flow_b = own.flow_a;
        if sensors.has("flow") && (sensors.has("flow_a") || sensors.has("flow_b")) {
            return Err(sensors.impossible(
                "flow",
                "declared twice",
                "either `flow` or `flow_a` and `flow_b`",
            ));
        }
        Self::keys(&mut keys, &mut own)?;
        own.supply = own.pressure;
        Self::valve_keys(&mut keys, &mut own)?;
        Ok(own)
    }
}

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
