use crate::{
    Butterworth, Cylinder, FilterError, Fluid, LoadEstimator, Momentum, PaperGains, PaperLaw, PerLeak, Real,
    Sample, Update, force_imbalance_n, regressors,
};

/// The paper's whole chain, sample by sample: second-order Butterworth on every signal (Section IV), load
/// by least squares where none is measured, momentum, regressors (6), adaptive law (8), (12) in its implicit
/// form.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct PaperEstimator<T> {
    cylinder: Cylinder<T>,
    fluid: Fluid<T>,
    gains: PaperGains<T>,
    filters: Filters<T>,
    load: LoadEstimator<T>,
    momentum: Momentum<T>,
    law: Option<PaperLaw<T>>,
    max_step_s: T,
    /// Time watched since the law last moved, s.
    since_renewal_s: T,
}

/// One filter per signal.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Filters<T> {
    x: Butterworth<T>,
    pa: Butterworth<T>,
    pb: Butterworth<T>,
    qa: Butterworth<T>,
    qb: Butterworth<T>,
    force: Butterworth<T>,
}

impl<T: Real> PaperEstimator<T> {
    /// For samples at `sample_rate_hz`, filtered at `cutoff_hz` (the paper: 100 Hz and 5 Hz).
    ///
    /// # Errors
    /// Where such a filter does not exist.
    pub fn new(
        cylinder: Cylinder<T>,
        fluid: Fluid<T>,
        gains: PaperGains<T>,
        cutoff_hz: T,
        sample_rate_hz: T,
    ) -> Result<Self, FilterError> {
        let filter = Butterworth::new(cutoff_hz, sample_rate_hz)?;
        // The load's memory is that of the filter: about 1/ω_c.
        let memory_s = T::one() / (T::lit(core::f64::consts::TAU) * cutoff_hz);
        Ok(Self {
            cylinder,
            fluid,
            gains,
            filters: Filters { x: filter, pa: filter, pb: filter, qa: filter, qb: filter, force: filter },
            load: LoadEstimator::new(memory_s),
            momentum: Momentum::new(cylinder.moving_mass_kg, T::one() / (T::lit(4.0) * memory_s)),
            law: None,
            max_step_s: T::lit(50.0) / sample_rate_hz,
            since_renewal_s: T::zero(),
        })
    }

    /// Takes in the reading `sample`, `dt_s` after the one before.
    pub fn update(&mut self, dt_s: T, sample: &Sample<T>) -> Update<T> {
        if !sample.is_finite() {
            return Update::Rejected;
        }
        let Some(mut law) = self.law else {
            return self.start(sample);
        };
        if !(dt_s > T::zero() && dt_s <= self.max_step_s) {
            let update = self.start(sample);
            // What was learnt survives the gap.
            self.law = Some(PaperLaw { load_pressure_pa: sample.load_pressure_pa(), ..law });
            return update;
        }
        self.since_renewal_s += dt_s;
        let smooth = self.filters.update(sample);
        let load_n = match smooth.force_n {
            Some(force_n) => force_n,
            None => self.load.update(&self.cylinder, dt_s, &smooth),
        };
        let imbalance = force_imbalance_n(&self.cylinder, &smooth, load_n);
        let momentum = self.momentum.update(dt_s, imbalance, smooth.x_m);
        let Some(f) = regressors(&self.cylinder, &smooth, momentum) else {
            law.load_pressure_pa = smooth.load_pressure_pa();
            self.law = Some(law);
            return Update::Accepted;
        };
        law.step(&self.gains, dt_s, smooth.load_pressure_pa(), &f);
        if law.is_finite() {
            self.law = Some(law);
            let elapsed_s = core::mem::take(&mut self.since_renewal_s);
            Update::Renewed { elapsed_s, changed: false, innovation: None }
        } else {
            Update::Rejected
        }
    }

    fn start(&mut self, sample: &Sample<T>) -> Update<T> {
        self.filters.reset(sample);
        self.momentum.restart(sample.x_m);
        self.law = Some(PaperLaw::new(&self.cylinder, &self.fluid, sample.load_pressure_pa()));
        Update::Started
    }

    /// The law's state; `None` before the first sample.
    pub fn law(&self) -> Option<&PaperLaw<T>> {
        self.law.as_ref()
    }

    /// Leak coefficients C_ip, C_epA, C_epB, m³/(s·Pa); zero before the first sample. The law knows no
    /// uncertainty.
    pub fn leak_coefficients(&self) -> PerLeak<T> {
        self.law.map_or_else(PerLeak::default, |law| law.leak_coefficients())
    }

    /// β, Pa.
    pub fn bulk_modulus_pa(&self) -> T {
        self.law.map_or(self.fluid.bulk_modulus_pa, |law| law.bulk_modulus_pa())
    }
}

impl<T: Real> Filters<T> {
    fn reset(&mut self, sample: &Sample<T>) {
        self.x.reset(sample.x_m);
        self.pa.reset(sample.pa_pa);
        self.pb.reset(sample.pb_pa);
        self.qa.reset(sample.qa_m3s.unwrap_or(T::zero()));
        self.qb.reset(sample.qb_m3s.unwrap_or(T::zero()));
        self.force.reset(sample.force_n.unwrap_or(T::zero()));
    }

    fn update(&mut self, sample: &Sample<T>) -> Sample<T> {
        Sample {
            x_m: self.x.update(sample.x_m),
            pa_pa: self.pa.update(sample.pa_pa),
            pb_pa: self.pb.update(sample.pb_pa),
            qa_m3s: sample.qa_m3s.map(|q| self.qa.update(q)),
            qb_m3s: sample.qb_m3s.map(|q| self.qb.update(q)),
            force_n: sample.force_n.map(|f| self.force.update(f)),
        }
    }
}
