use super::bound::{self, Bound};
use super::document::{RigError, Section};
use super::keys::{Done, Keys};
use crate::units::LPM_PER_M3S;
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
