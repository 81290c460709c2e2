use crate::units::Dimension;

/// The values that a quantity of a rig may take, in SI. Wide enough for any machine, narrow enough
/// to catch a forgotten unit (an area of 12.6 m²).
#[derive(Clone, Copy)]
pub(super) struct Bound {
    least: f64,
    least_included: bool,
    most: f64,
}

impl Bound {
    pub(super) const fn above_zero(most: f64) -> Self {
        Self { least: 0.0, least_included: false, most }
    }

    pub(super) const fn from_zero(most: f64) -> Self {
        Self { least: 0.0, least_included: true, most }
    }

    pub(super) const fn between(least: f64, most: f64) -> Self {
        Self { least, least_included: true, most }
    }

    /// False for a NaN.
    pub(super) fn holds(self, value: f64) -> bool {
        let above = if self.least_included { value >= self.least } else { value > self.least };
        above && value <= self.most
    }

    pub(super) fn text(self, dimension: Dimension) -> String {
        let word = if self.least_included { "from" } else { "above" };
        let unit = dimension.si();
        let text = if self.most.is_finite() {
            format!("{word} {} to {} {unit}", self.least, self.most)
        } else {
            format!("{word} {} {unit}", self.least)
        };
        text.trim_end().to_owned()
    }
}
