//! The valve of a rig with `[valve]`, as it is and as its sensors show it.

use super::{Normal, Truth};
use crate::rig::{Instruments, Rig};
use crate::units::{self, Dimension};
use pitchleak_core::plant::Valve;
use std::str::FromStr;

/// What a valve does beside its data sheet.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ValveFlaw {
    /// Each edge leaks this flow by its clearance at the rated drop, m³/s.
    Clearance(f64),
    /// The spool's reading is off by so much after it went up, and the other way after it went down, a share of its stroke.
    Hysteresis(f64),
    /// The zero of the spool's reading walks off by this over the trace, a share of its stroke.
    Drift(f64),
    /// The supply is measured so far away that its pressure drops by this on the way to the valve at the rated flow, Pa.
    Droop(f64),
}

/// Why a text is no flaw of a valve.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("`{text}` is none of clearance=0.05 L/min, hysteresis=1 %, drift=0.5 %, droop=2 bar{}", why.as_ref().map(|why| format!(": {why}")).unwrap_or_default())]
pub struct ValveFlawError {
    text: String,
    why: Option<String>,
}

impl FromStr for ValveFlaw {
    type Err = ValveFlawError;

    fn from_str(text: &str) -> Result<Self, ValveFlawError> {
        let wrong = |why| ValveFlawError { text: text.to_owned(), why };
        let (key, value) = text.split_once('=').ok_or_else(|| wrong(None))?;
        let size = |dimension| match units::parse(value, dimension) {
            Ok(size) if size >= 0.0 => Ok(size),
            Ok(_) => Err(wrong(Some("must not be negative".to_owned()))),
            Err(error) => Err(wrong(Some(error.to_string()))),
        };
        match key.trim() {
            "clearance" => size(Dimension::Flow).map(Self::Clearance),
            "hysteresis" => size(Dimension::Share).map(Self::Hysteresis),
            "drift" => size(Dimension::Share).map(Self::Drift),
            "droop" => size(Dimension::Pressure).map(Self::Droop),
            _ => Err(wrong(None)),
        }
    }
}

/// What is true of the valve at an instant.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct ValveTruth {
    /// Position of the spool, a share of its stroke, positive: supply to A.
    pub spool: f64,
    /// What it is told.
    pub command: f64,
    /// Supply pressure at the valve, Pa.
    pub supply_pa: f64,
}

/// The valve of the plant, by the data sheet of the rig; none where the rig has none.
pub(super) fn of_plant(rig: &Rig, flaws: &[ValveFlaw]) -> Option<Valve<f64>> {
    let sheet = rig.valve.as_ref()?;
    let clearance = flaws.iter().map(|flaw| if let ValveFlaw::Clearance(flow) = flaw { *flow } else { 0.0 });
    Some(Valve {
        rated_flow_m3s: sheet.rated_flow_m3s,
        rated_drop_pa: sheet.rated_drop_pa,
        underlap: -sheet.lap,
        area_ratio_b: 1.0,
        clearance_m3spa: clearance.sum::<f64>() / sheet.rated_drop_pa,
        ..Valve::paper()
    })
}

/// Sensors of a valve, with the flaws that are theirs.
pub(super) struct ValveSensors {
    flaws: Vec<ValveFlaw>,
    rated_flow_m3s: f64,
    noise_std: [f64; 2],
    normal: Normal,
    last: Option<f64>,
    /// Within a hysteresis: −1 after the spool went down, 1 after it went up.
    play: f64,
}

/// Of the streams that a seed has, the one of this noise: the cylinder's sensors have 0, what happens to them others.
const NOISE_STREAM: u64 = 7;

impl ValveSensors {
    /// For a rig with `[valve]`; `instruments` say their noise.
    pub fn of(rig: &Rig, instruments: &Instruments, flaws: &[ValveFlaw], seed: u64) -> Option<Self> {
        let sheet = rig.valve.as_ref()?;
        Some(Self {
            flaws: flaws.to_vec(),
            rated_flow_m3s: sheet.rated_flow_m3s,
            noise_std: [&instruments.spool, &instruments.supply].map(|sheet| sheet.spread().noise_std),
            normal: Normal::stream(seed, NOISE_STREAM),
            last: None,
            play: 0.0,
        })
    }

    /// What they show of an instant, `share` of the trace being over.
    pub fn read(&mut self, truth: &Truth, share: f64) -> Option<ValveTruth> {
        let valve = truth.valve?;
        let moved = valve.spool - self.last.replace(valve.spool).unwrap_or(valve.spool);
        let drawn_m3s = truth.signals.qa_m3s.max(0.0) + truth.signals.qb_m3s.max(0.0);
        let [spool_std, supply_std] = self.noise_std;
        let mut shown = valve;
        for flaw in &self.flaws {
            match *flaw {
                ValveFlaw::Hysteresis(half) if half > 0.0 => {
                    // The spool stands still until the reading has passed its width.
                    if moved != 0.0 {
                        self.play = moved.signum();
                    }
                    shown.spool += half * self.play;
                }
                ValveFlaw::Hysteresis(_) | ValveFlaw::Clearance(_) => {}
                ValveFlaw::Drift(drift) => shown.spool += drift * share,
                ValveFlaw::Droop(droop_pa) => shown.supply_pa += droop_pa * drawn_m3s / self.rated_flow_m3s,
            }
        }
        shown.spool += spool_std * self.normal.draw();
        shown.supply_pa += supply_std * self.normal.draw();
        Some(shown)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn flaws_are_read_with_their_units() {
        assert_eq!("droop=2 bar".parse(), Ok(ValveFlaw::Droop(2e5)));
        assert_eq!("hysteresis = 1 %".parse(), Ok(ValveFlaw::Hysteresis(0.01)));
        for wrong in ["droop", "droop=2 mm", "lag=1 ms", "drift=-1 %"] {
            let message = wrong.parse::<ValveFlaw>().expect_err(wrong).to_string();
            assert!(message.contains("none of clearance=0.05 L/min"), "{message}");
        }
    }
}
