use pitchleak_core::{Estimate, Estimates, PerLeak, Sample};

/// One reading of the sensors, SI; pressures are gauge, a flow is positive into its chamber.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct PitchleakSample {
    /// Piston position from the A end, m.
    pub x_m: f32,
    /// Pressure of chamber A, Pa.
    pub pa_pa: f32,
    /// Pressure of chamber B, Pa.
    pub pb_pa: f32,
    /// Flow into chamber A, m³/s; NaN where it is not measured.
    pub qa_m3s: f32,
    /// Flow into chamber B, m³/s; NaN where it is not measured.
    pub qb_m3s: f32,
}

impl From<PitchleakSample> for Sample<f32> {
    fn from(sample: PitchleakSample) -> Self {
        let measured = |flow: f32| (!flow.is_nan()).then_some(flow);
        let PitchleakSample { x_m, pa_pa, pb_pa, qa_m3s, qb_m3s } = sample;
        Self { x_m, pa_pa, pb_pa, qa_m3s: measured(qa_m3s), qb_m3s: measured(qb_m3s), force_n: None }
    }
}

/// A value and its standard deviation.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default)]
pub struct PitchleakEstimate {
    /// Best value.
    pub value: f32,
    /// Standard deviation; infinite where nothing is known.
    pub std: f32,
}

impl From<Estimate<f32>> for PitchleakEstimate {
    fn from(estimate: Estimate<f32>) -> Self {
        let known = estimate.value.is_finite() && !estimate.std.is_nan();
        if known {
            Self { value: estimate.value, std: estimate.std }
        } else {
            Self { value: 0.0, std: f32::INFINITY }
        }
    }
}

/// Which alarms are active, 1 or 0.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default)]
pub struct PitchleakAlarms {
    /// Internal leak.
    pub internal: u8,
    /// External leak of chamber A.
    pub external_a: u8,
    /// External leak of chamber B.
    pub external_b: u8,
}

impl From<PerLeak<bool>> for PitchleakAlarms {
    fn from(active: PerLeak<bool>) -> Self {
        let PerLeak { internal, external_a, external_b } = active.map(u8::from);
        Self { internal, external_a, external_b }
    }
}

/// What has been found so far.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default)]
pub struct PitchleakFound {
    /// Internal leak past the piston at the mean pressures, m³/s.
    pub internal_m3s: PitchleakEstimate,
    /// Leak out of chamber A at its mean pressure, m³/s.
    pub external_a_m3s: PitchleakEstimate,
    /// Leak out of chamber B at its mean pressure, m³/s.
    pub external_b_m3s: PitchleakEstimate,
    /// Coefficient of the internal leak, m³/(s·Pa).
    pub internal_m3spa: PitchleakEstimate,
    /// Coefficient of the leak out of chamber A, m³/(s·Pa).
    pub external_a_m3spa: PitchleakEstimate,
    /// Coefficient of the leak out of chamber B, m³/(s·Pa).
    pub external_b_m3spa: PitchleakEstimate,
    /// Compressibility of the oil, 1/Pa: one over the bulk modulus.
    pub compressibility_per_pa: PitchleakEstimate,
    /// Normalised innovation squared of the balance: 1 where the model and the declared noise explain the readings.
    pub innovation_balance: f32,
    /// Normalised innovation squared of the position equation.
    pub innovation_position: f32,
    /// Active alarms.
    pub alarms: PitchleakAlarms,
}

impl PitchleakFound {
    pub(crate) fn new(found: &Estimates<f32>, active: PerLeak<bool>) -> Self {
        let (flows, leaks) = (&found.mean_leaks_m3s, &found.leaks_m3spa);
        let [innovation_balance, innovation_position] = found.normalised_innovation;
        Self {
            internal_m3s: flows.internal.into(),
            external_a_m3s: flows.external_a.into(),
            external_b_m3s: flows.external_b.into(),
            internal_m3spa: leaks.internal.into(),
            external_a_m3spa: leaks.external_a.into(),
            external_b_m3spa: leaks.external_b.into(),
            compressibility_per_pa: found.compressibility_per_pa.into(),
            innovation_balance,
            innovation_position,
            alarms: active.into(),
        }
    }
}
