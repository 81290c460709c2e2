//! Traces made by the emulator: what a rig with known leaks would have measured.
//!
//! [`Scenario::run`] gives the truth; [`Sensing`] makes readings of it; [`Recording`] puts both into a
//! trace file and the truth beside it. The controllers act on the truth, not on the readings.

mod effects;
mod leak;
mod oil_temperature;
mod plan;
mod recording;
mod sensing;
pub mod sensor_fault;
mod span;
mod valve;
mod writer;

pub use effects::{EffectSize, EffectsError, effects};
pub use leak::{LeakCourse, LeakCourseError, LeakSize, LeakSizeError, Opening};
pub use oil_temperature::{OilTemperature, OilTemperatureError};
pub use plan::{Followed, Noise, Plan, PlanError, ShareError, share_of_full_scale};
pub use recording::{LeakTruth, Recording, RecordingError, TruthFile};
pub use sensing::{Biases, Normal, Sensing};
pub use sensor_fault::{SensorFault, SensorFaults};
pub use span::{Span, SpanError};
pub use valve::{ValveFlaw, ValveFlawError, ValveTruth};
pub use writer::{Columns, Reading, TraceLayout, TraceWriter};

use crate::Rig;
use crate::reference::Reference;
use effects::RememberingSensor;
use pitchleak_core::emulator::{Emulator, EmulatorParams};
use pitchleak_core::plant::PlantError;
use pitchleak_core::{EffectSet, Model, PerLeak, Sample, Signals};

/// What is simulated: a rig, what it follows, its leaks, and for how long.
#[derive(Clone, Debug)]
pub struct Scenario {
    /// The rig; the emulator's valve, supply and controllers follow from its cylinder.
    pub rig: Rig,
    /// Position and load to follow.
    pub reference: Reference,
    /// Laminar leaks.
    pub leaks: PerLeak<LeakCourse>,
    /// The oil's temperature, which the leaks follow by its viscosity; none where it doesn't matter.
    pub oil_temperature: Option<OilTemperature>,
    /// While both ports are shut, in the trace's time: a hold test.
    pub shut: Option<Span>,
    /// Effects beyond the model.
    pub effects: EffectSet<f64>,
    /// What the valve of a rig with `[valve]` does beside its data sheet.
    pub valve_flaws: Vec<ValveFlaw>,
    /// Time of the reference at which the trace begins, s.
    pub start_s: f64,
    /// Time for which the loops run before the trace begins, s.
    pub warm_up_s: f64,
    /// Length of the trace, s.
    pub duration_s: f64,
    /// Samples per second.
    pub sample_rate_hz: f64,
}

/// One instant of a simulation.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct Truth {
    /// Time since the trace began, s.
    pub t_s: f64,
    /// Position that was asked for, m.
    pub position_reference_m: f64,
    /// Load that was asked for, N.
    pub load_reference_n: f64,
    /// What happened.
    pub signals: Signals<f64>,
    /// What sensors without noise show of it: the same, but for sensor effects.
    pub sample: Sample<f64>,
    /// Leak flows, m³/s.
    pub leaks_m3s: PerLeak<f64>,
    /// Oil temperature, K, where the scenario has one.
    pub temp_k: Option<f64>,
    /// The valve, where the rig has `[valve]`.
    pub valve: Option<ValveTruth>,
    /// Whether both ports are shut, where the scenario has a hold.
    pub is_shut: Option<bool>,
}

/// Why a scenario cannot be simulated.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum SimulateError {
    /// Rig, leaks or references make no emulator.
    #[error(transparent)]
    Plant(#[from] PlantError),
    /// Duration, warm-up or sample rate is out of range.
    #[error("{what} must lie between {low} and {high}")]
    Range {
        /// Which.
        what: &'static str,
        /// Least value.
        low: f64,
        /// Greatest value.
        high: f64,
    },
    /// The supply cannot feed a leak of this mean flow.
    #[error("no leak coefficient gives the mean leak flow asked for: the rig's pressures fall too far")]
    LeakOutOfReach,
    /// Who asked for it wants no more of it.
    #[error("stopped")]
    Stopped,
}

/// Time for which the loops run before a trace begins, s.
const WARM_UP_S: f64 = 10.0;
/// Longest step between two looks at the reference, s; the emulator divides it further.
const STEP_S: f64 = 1e-3;
/// Coefficients of a leak given by its mean flow are found on this much of a run, s.
const CALIBRATION_S: f64 = 60.0;
/// … from these pressures on, Pa, …
const FIRST_GUESS_PA: PerLeak<f64> = PerLeak { internal: 1e6, external_a: 5e6, external_b: 5e6 };
/// … to this share of the flow …
const CALIBRATION_ACCURACY: f64 = 0.01;
/// … in so many runs at most.
const CALIBRATION_RUNS: usize = 12;

impl Scenario {
    /// A minute of a sound rig, 100 samples a second, from 10 s into what it follows on, the loops run in for 10 s.
    pub fn new(rig: Rig, reference: Reference) -> Self {
        Self {
            rig,
            reference,
            leaks: PerLeak::default(),
            oil_temperature: None,
            shut: None,
            effects: EffectSet::default(),
            valve_flaws: Vec::new(),
            start_s: 10.0,
            warm_up_s: WARM_UP_S,
            duration_s: 60.0,
            sample_rate_hz: 100.0,
        }
    }

    /// Coefficients of the leaks at their largest: as given, or found so that the mean |flow| over the run, its
    /// first minute where it is longer, is as given to 1 % while they are open all the time. A leak takes
    /// pressure away, so this takes some runs.
    ///
    /// # Errors
    /// [`SimulateError`].
    pub fn leak_coefficients(&self) -> Result<PerLeak<f64>, SimulateError> {
        self.check()?;
        let sizes = self.leaks.map(|leak| leak.size);
        let calibration = Self {
            duration_s: self.duration_s.min(CALIBRATION_S),
            leaks: sizes.map(LeakCourse::from),
            oil_temperature: None,
            ..self.clone()
        };
        let coefficients = |pressures: &PerLeak<f64>| {
            leak::coefficients(&sizes, pressures).ok_or(SimulateError::LeakOutOfReach)
        };
        let mut guess = coefficients(&FIRST_GUESS_PA)?;
        if !leak::any_by_flow(&sizes) {
            return Ok(guess);
        }
        let mut last = None;
        for _ in 0..CALIBRATION_RUNS {
            let found = coefficients(&calibration.mean_pressures_pa(guess)?)?;
            if leak::differ(&found, &guess) <= CALIBRATION_ACCURACY {
                return Ok(guess);
            }
            let next = leak::next_guess(last, (guess, found));
            last = Some((guess, found));
            guess = next;
        }
        Err(SimulateError::LeakOutOfReach)
    }

    /// Means of |P_L|, P_A, P_B over the run with these leaks, Pa.
    fn mean_pressures_pa(&self, leaks_m3spa: PerLeak<f64>) -> Result<PerLeak<f64>, SimulateError> {
        let (mut sum, mut count) = (PerLeak::<f64>::default(), 0.0);
        self.run(leaks_m3spa, |truth| {
            sum.internal += (truth.signals.pa_pa - truth.signals.pb_pa).abs();
            sum.external_a += truth.signals.pa_pa;
            sum.external_b += truth.signals.pb_pa;
            count += 1.0;
        })?;
        Ok(sum.map(|sum| sum / f64::max(count, 1.0)))
    }

    /// Runs the emulator with leaks that have these coefficients at their largest, and hands each sample to
    /// `each`.
    ///
    /// # Errors
    /// [`SimulateError`].
    pub fn run(&self, leaks_m3spa: PerLeak<f64>, mut each: impl FnMut(&Truth)) -> Result<(), SimulateError> {
        self.run_while(leaks_m3spa, |truth| {
            each(truth);
            true
        })
    }

    /// Runs the simulation until `each` has had enough.
    ///
    /// # Errors
    /// [`SimulateError`].
    pub(crate) fn run_while(
        &self,
        leaks_m3spa: PerLeak<f64>,
        mut each: impl FnMut(&Truth) -> bool,
    ) -> Result<(), SimulateError> {
        self.check()?;
        let period_s = 1.0 / self.sample_rate_hz;
        let steps = (period_s / STEP_S).ceil().max(1.0);
        let step_s = period_s / steps;
        let warm_up = (self.warm_up_s / period_s).round() as i64;
        let samples = (self.duration_s / period_s).round() as i64;
        let mut rig = RunningRig::new(self, self.start_s - warm_up as f64 * period_s)?;
        for sample in -warm_up..samples {
            let t_s = sample as f64 * period_s;
            for step in 0..steps as i64 {
                self.set_course(t_s + step as f64 * step_s, &leaks_m3spa, &mut rig)?;
                if step == 0 && sample >= 0 && !each(&rig.truth(self, t_s)) {
                    return Ok(());
                }
                let (position_m, load_n) = self.reference.at(self.start_s + t_s + (step + 1) as f64 * step_s);
                rig.step(step_s, position_m, load_n)?;
            }
        }
        Ok(())
    }

    /// Leaks and oil as they are at a time of the trace.
    fn set_course(
        &self,
        t_s: f64,
        leaks_m3spa: &PerLeak<f64>,
        rig: &mut RunningRig,
    ) -> Result<(), SimulateError> {
        let factor = self.oil_temperature.as_ref().map_or(1.0, |oil| oil.leak_factor(t_s));
        let now = self.leaks.zip(*leaks_m3spa).map(|(leak, most)| most * leak.opening.share(t_s) * factor);
        if now != rig.leaks_m3spa {
            rig.emulator.set_leaks(now)?;
            rig.leaks_m3spa = now;
        }
        rig.emulator.set_time(t_s);
        if let Some(shut) = &self.shut {
            rig.emulator.set_shut(shut.contains(t_s));
        }
        match &self.oil_temperature {
            Some(oil) => Ok(rig.emulator.set_temperature(oil.at(t_s))?),
            None => Ok(()),
        }
    }

    /// The whole run in memory.
    ///
    /// # Errors
    /// [`SimulateError`].
    pub fn collect(&self, leaks_m3spa: PerLeak<f64>) -> Result<Vec<Truth>, SimulateError> {
        let mut truths = Vec::new();
        self.run(leaks_m3spa, |truth| truths.push(*truth))?;
        Ok(truths)
    }

    fn check(&self) -> Result<(), SimulateError> {
        let within = |what, value: f64, low, high| {
            let fits = value >= low && value <= high;
            if fits { Ok(()) } else { Err(SimulateError::Range { what, low, high }) }
        };
        within("the duration in s", self.duration_s, 0.01, 1e6)?;
        within("the warm-up in s", self.warm_up_s, 0.0, 1e4)?;
        within("the start in s", self.start_s, -1e9, 1e9)?;
        within("the sample rate in Hz", self.sample_rate_hz, 1.0, 1e5)
    }
}

/// The emulator with what its sensors remember.
struct RunningRig {
    emulator: Emulator<f64>,
    /// Coefficients that its leaks have now, m³/(s·Pa).
    leaks_m3spa: PerLeak<f64>,
    /// What the sensors do to the readings at once.
    prompt: EffectSet<f64>,
    remembering: Vec<RememberingSensor>,
}

impl RunningRig {
    fn new(scenario: &Scenario, t_s: f64) -> Result<Self, PlantError> {
        let Scenario { rig, reference, effects, .. } = scenario;
        let healthy = Model { cylinder: rig.cylinder, fluid: rig.fluid, leaks_m3spa: PerLeak::default() };
        let mut params = EmulatorParams::for_model(healthy)?;
        params.pitch.plant.effects = *effects;
        if let Some(valve) = valve::of_plant(rig, &scenario.valve_flaws) {
            params = params.with_pitch_valve(valve);
        }
        params.internal_step_s = STEP_S;
        let (position_m, load_n) = reference.at(t_s);
        let emulator = Emulator::new(params, position_m, load_n)?;
        let (mut prompt, mut remembering) = (EffectSet::default(), Vec::new());
        let mut now = emulator.reading().signals;
        for active in effects.iter() {
            match RememberingSensor::new(active.effect, active.value, &mut now) {
                Some(sensor) => remembering.push(sensor),
                None => {
                    // As many fit as there were, and they were within their bounds.
                    let _ = prompt.set(active.effect, active.value, active.constants);
                }
            }
        }
        Ok(Self { emulator, leaks_m3spa: PerLeak::default(), prompt, remembering })
    }

    fn step(&mut self, step_s: f64, position_m: f64, load_n: f64) -> Result<(), PlantError> {
        self.emulator.step(step_s, position_m, load_n)?;
        if !self.remembering.is_empty() {
            let mut signals = self.emulator.reading().signals;
            self.remembering.iter_mut().for_each(|one| one.show(step_s, &mut signals));
        }
        Ok(())
    }

    fn truth(&mut self, scenario: &Scenario, t_s: f64) -> Truth {
        let (position_reference_m, load_reference_n) = scenario.reference.at(scenario.start_s + t_s);
        let reading = self.emulator.reading();
        let signals = reading.signals;
        let mut seen = signals;
        self.remembering.iter_mut().for_each(|one| one.show(0.0, &mut seen));
        let shown = self.prompt.read(&seen);
        Truth {
            t_s,
            position_reference_m,
            load_reference_n,
            signals,
            sample: Sample {
                x_m: shown.x_m,
                pa_pa: shown.pa_pa,
                pb_pa: shown.pb_pa,
                qa_m3s: Some(shown.qa_m3s),
                qb_m3s: Some(shown.qb_m3s),
                force_n: Some(shown.force_n),
            },
            leaks_m3s: reading.leaks_m3s,
            temp_k: scenario.oil_temperature.as_ref().map(|oil| oil.at(t_s)),
            valve: scenario.rig.valve.as_ref().map(|_| ValveTruth {
                spool: reading.pitch_spool,
                command: reading.pitch_command,
                supply_pa: reading.supply_pa,
            }),
            is_shut: scenario.shut.map(|shut| shut.contains(t_s)),
        }
    }
}
