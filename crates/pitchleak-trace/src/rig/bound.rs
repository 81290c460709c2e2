//! What a rig may be. Every machine that moves oil lies well within; a forgotten unit (an area of 12.6 m²) or a
//! typing error does not, and no estimate on the way overflows.

use crate::units::Dimension;

/// Piston areas, m²: of a piston of 1 mm to one of 3.5 m.
pub(super) const AREA: Bound = Bound::between(Dimension::Area, 1e-6, 10.0);
/// Stroke, m.
pub(super) const STROKE: Bound = Bound::between(Dimension::Length, 1e-3, 100.0);
/// Moving mass, kg.
pub(super) const MOVING_MASS: Bound = Bound::between(Dimension::Mass, 1e-3, 1e7);
/// Dead volumes, m³.
pub(super) const DEAD_VOLUME: Bound = Bound::from_zero(Dimension::Volume, 10.0);
/// Bulk modulus, Pa: from froth to steel.
pub(super) const BULK_MODULUS: Bound = Bound::between(Dimension::Pressure, 1e6, 1e11);
/// Its standard deviation, Pa.
pub(super) const BULK_MODULUS_STD: Bound = Bound::from_zero(Dimension::Pressure, 1e11);
/// Full scale of a flow meter, m³/s: 60 µL/min to 600 m³/min.
pub(super) const FLOW_SCALE: Bound = Bound::between(Dimension::Flow, 1e-9, 10.0);
/// Full scale of a pressure sensor, Pa: 10 mbar to 1 GPa.
pub(super) const PRESSURE_SCALE: Bound = Bound::between(Dimension::Pressure, 1e3, 1e9);
/// Full scale of the position sensor, m.
pub(super) const POSITION_SCALE: Bound = Bound::between(Dimension::Length, 1e-4, 1e3);
/// Full scale of the force sensor, N: 10 g to 100 000 t.
pub(super) const FORCE_SCALE: Bound = Bound::between(Dimension::Force, 0.1, 1e9);
/// Shares of full scale and of a reading.
pub(super) const SHARE: Bound = Bound::from_zero(Dimension::Share, 1.0);
/// What may speak against a sure verdict.
pub(super) const ALPHA: Bound = Bound::between(Dimension::Share, 1e-6, 0.5);
/// How often an explanation is true: never certain, nor impossible.
pub(super) const ODDS: Bound = Bound::between(Dimension::Share, 1e-9, 0.99);
/// Shares of full scale in an hour: a recording of seconds may drift by a percent.
pub(super) const DRIFT_PER_HOUR: Bound = Bound::from_zero(Dimension::Share, 1e3);
/// Times that an estimator remembers or gathers for, s.
pub(super) const MEMORY: Bound = Bound::between(Dimension::Time, 1e-4, 1e7);
/// Cut-off of a filter, Hz.
pub(super) const CUTOFF: Bound = Bound::between(Dimension::Frequency, 1e-4, 1e5);
/// Gains of the paper's law.
pub(super) const GAIN: Bound = Bound::between(Dimension::Share, 1e-12, 1e12);
/// Time that an alarm's evidence must last, s.
pub(super) const HOLD_TIME: Bound = Bound::from_zero(Dimension::Time, 1e7);
/// Standard deviation of an effect, in its unit.
pub(super) const EFFECT_STD: Bound = Bound::from_zero(Dimension::Share, 1e15);

/// Size of a foreign column's scale.
pub(super) const SCALE: Bound = Bound::between(Dimension::Share, 1e-12, 1e12);

/// A foreign column's offset, and its scale before its size is looked at.
pub(super) const fn offset(dimension: Dimension) -> Bound {
    Bound::between(dimension, -1e12, 1e12)
}

/// Alarm thresholds where the larger flow meter has this full scale, m³/s.
pub(super) fn threshold(full_scale_m3s: f64) -> Bound {
    Bound::between(Dimension::Flow, 1e-15, full_scale_m3s)
}

/// What a quantity of a rig measures, and the values that it may take, in SI. Wide enough for any machine, narrow enough
/// to catch a forgotten unit (an area of 12.6 m²).
#[derive(Clone, Copy)]
pub(super) struct Bound {
    pub(super) dimension: Dimension,
    least: f64,
    most: f64,
}

impl Bound {
    pub(super) const fn from_zero(dimension: Dimension, most: f64) -> Self {
        Self::between(dimension, 0.0, most)
    }

    pub(super) const fn between(dimension: Dimension, least: f64, most: f64) -> Self {
        Self { dimension, least, most }
    }

    /// False for a NaN.
    pub(super) fn holds(self, value: f64) -> bool {
        (self.least..=self.most).contains(&value)
    }

    /// The value allowed that is next to `value`; the least for a NaN.
    pub(super) fn nearest(self, value: f64) -> f64 {
        if value > self.least { value.min(self.most) } else { self.least }
    }

    pub(super) const fn most(self) -> f64 {
        self.most
    }

    pub(super) fn text(self) -> String {
        let text = format!("from {} to {} {}", self.least, self.most, self.dimension.si());
        text.trim_end().to_owned()
    }
}
