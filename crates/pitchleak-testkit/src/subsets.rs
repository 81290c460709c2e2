//! Any effects of the table at once, at random: each rig is drawn from a seed with its motion, its sensors, its leaks, and what is missing.

use crate::doubts::alone;
use pitchleak::Rig;
use pitchleak::core::effects::EffectConstants;
use pitchleak::core::{Effect, EffectSet, PerLeak};
use pitchleak::diagnose::{Declared, Diagnosis, DoubtId, FoundEffect, Series, Verdict, diagnose};
use pitchleak::simulate::{Biases, LeakSize, Scenario, Sensing};
use pitchleak::wind::{Emulation, History, Wind, WindCase};
use rand::seq::IndexedRandom;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use std::fmt::Write;

/// What the table has had only since then: a rig that a draw has found stays the same rig.
const LATER: [Effect; 1] = [Effect::InternalLeakOneWay];
/// Sizes of effects, in what the same trace of a sound rig says it could have shown (five standard deviations): even in their logarithm.
const MULTIPLES: (f64, f64) = (2.0, 20.0);
/// No more of what an effect may be at all.
const SHARE_OF_UPPER: f64 = 0.5;

/// One rig.
#[derive(Clone, Debug)]
pub struct Case {
    seed: u64,
    wind: WindCase,
    start_s: f64,
    seconds: f64,
    rate_hz: f64,
    accuracy: f64,
    leaks: PerLeak<f64>,
    constants: EffectConstants<f64>,
    /// What is missing, with a size in what could have been shown.
    missing: Vec<(Effect, f64)>,
}

/// What was said of one rig.
#[derive(Clone, Debug)]
pub struct Answer {
    /// What is there, with its size.
    pub truth: Vec<(&'static str, f64)>,
    /// What is said of it, …
    pub diagnosis: Diagnosis,
    /// … and of the same rig, motion and noise without it.
    pub sound: Diagnosis,
    /// The leaks that are there.
    pub leaks: PerLeak<f64>,
}

impl Case {
    /// Rig `number` of a seed, with `effects` missing.
    pub fn draw(seed: u64, number: u64, effects: usize) -> Self {
        Self::draw_of(Effect::ALL, seed, number, effects)
    }

    /// The same as it was drawn before the table had [`LATER`].
    pub fn draw_before(seed: u64, number: u64, effects: usize) -> Self {
        let table: Vec<Effect> = Effect::ALL.iter().copied().filter(|one| !LATER.contains(one)).collect();
        Self::draw_of(&table, seed, number, effects)
    }

    fn draw_of(table: &[Effect], seed: u64, number: u64, effects: usize) -> Self {
        let seed = seed.wrapping_mul(1_000_003).wrapping_add(10 * number + effects as u64);
        let random = &mut ChaCha8Rng::seed_from_u64(seed);
        let wind = *[WindCase::Mps13, WindCase::Mps21, WindCase::Mps30].choose(random).expect("is not empty");
        let accuracy = *[1e-3, 3e-3, 1e-2].choose(random).expect("is not empty");
        let rate_hz = *[50.0, 100.0, 200.0].choose(random).expect("is not empty");
        let missing = table.sample(random, effects).copied().collect::<Vec<_>>();
        let (low, high) = (MULTIPLES.0.ln(), MULTIPLES.1.ln());
        let mut size = |effect: Effect| {
            let sign = if effect.spec().lower < 0.0 && random.random_bool(0.5) { -1.0 } else { 1.0 };
            (effect, sign * random.random_range(low..high).exp())
        };
        let missing = missing.into_iter().map(&mut size).collect();
        Self {
            seed,
            wind,
            start_s: random.random_range(5.0..300.0),
            seconds: random.random_range(60.0..180.0_f64).round(),
            rate_hz,
            accuracy,
            leaks: PerLeak { internal: 2e-11, external_a: 6e-12, external_b: 2e-12 }
                .map(|most| random.random_range(0.0..most)),
            constants: EffectConstants {
                spot_position_m: random.random_range(0.06..0.12),
                spot_width_m: random.random_range(0.01..0.03),
                cracking_pa: random.random_range(0.5e6..1.5e6),
                ..EffectConstants::default()
            },
            missing,
        }
    }

    fn rig(&self) -> Rig {
        let mut rig = Rig::paper();
        rig.instruments = rig.instruments.with_accuracy(self.accuracy);
        rig
    }

    fn diagnosed(&self, effects: EffectSet<f64>) -> Option<Diagnosis> {
        let history = History::of(&Wind::BuiltIn(self.wind)).ok()?;
        let scenario = Scenario {
            leaks: self.leaks.map(|leak| LeakSize::Coefficient(leak).into()),
            effects,
            start_s: self.start_s,
            warm_up_s: 3.0,
            duration_s: self.seconds,
            sample_rate_hz: self.rate_hz,
            ..Scenario::new(self.rig(), Emulation::paper().reference(&history, 0.2).ok()?)
        };
        let truths = scenario.collect(scenario.leak_coefficients().ok()?).ok()?;
        let mut sensing = Sensing::new(self.rig().sensors(), Biases::default(), self.seed);
        let mut series = Series::default();
        truths.iter().for_each(|truth| series.push(truth.t_s, &sensing.read(&truth.sample), None));
        Some(diagnose(&[series], &[], &Declared::of(&self.rig()), &|| ()))
    }

    /// None where such a rig can't be: effects that exclude each other, or that show only where they are larger than anything built.
    pub fn ask(&self) -> Option<Answer> {
        let sound = self.diagnosed(EffectSet::default())?;
        let (mut effects, mut truth) = (EffectSet::default(), vec![]);
        for (effect, multiple) in &self.missing {
            let spec = effect.spec();
            let size = multiple * sound.not_detectable_below.get(spec.id)?.value;
            let declared = effect.adds_to(&mut self.rig().cylinder).copied();
            let least = declared.map_or(spec.lower, |number| spec.lower.max(-number));
            let most = SHARE_OF_UPPER * if size < 0.0 { least.abs() } else { spec.upper };
            if size.abs() > most {
                return None;
            }
            effects.set(*effect, size, self.constants).ok()?;
            truth.push((spec.id, size));
        }
        let diagnosis = if truth.is_empty() { sound.clone() } else { self.diagnosed(effects)? };
        Some(Answer { diagnosis, truth, sound, leaks: self.leaks })
    }

    /// The rig in words.
    pub fn words(&self) -> String {
        let Self { seed, wind, start_s, seconds, rate_hz, accuracy, .. } = self;
        format!("{seed} {wind:?} from {start_s:.0} s, {seconds} s, {rate_hz} Hz, {accuracy}")
    }
}

impl Answer {
    fn is_there(&self, effect: &FoundEffect) -> bool {
        self.truth.iter().any(|(id, _)| *id == effect.id)
    }

    /// Something is named that is not there.
    pub fn has_a_wrong_name(&self) -> bool {
        self.diagnosis.effects.iter().any(|effect| !self.is_there(effect))
    }

    /// Something is named that is not there, and no doubt stands beside it.
    pub fn has_a_sure_wrong_name(&self) -> bool {
        self.diagnosis.effects.iter().any(|effect| effect.confident && !self.is_there(effect))
    }

    fn first_is_right(&self) -> bool {
        self.diagnosis.effects.first().is_some_and(|effect| self.is_there(effect))
    }

    /// The first name is that of an effect that is there, or can't be told from one.
    fn first_is_in_the_group(&self) -> bool {
        let is_near = |effect: &FoundEffect| {
            self.is_there(effect) || self.truth.iter().any(|(id, _)| effect.confusable_with.contains(id))
        };
        self.diagnosis.effects.first().is_some_and(is_near)
    }

    fn all_are_named(&self) -> bool {
        let is_named = |id| self.diagnosis.effects.iter().any(|effect| effect.id == id);
        self.truth.iter().all(|(id, _)| is_named(*id))
    }

    /// By how many standard deviations each leak's coefficient is off, with the effects that were named.
    fn leaks_off_sigma(&self) -> [f64; 3] {
        let leaks = &self.diagnosis.after.leaks;
        let told = [
            leaks.internal_leak_coefficient,
            leaks.external_leak_a_coefficient,
            leaks.external_leak_b_coefficient,
        ];
        let truth = [self.leaks.internal, self.leaks.external_a, self.leaks.external_b];
        std::array::from_fn(|at| (told[at].value - truth[at]) / told[at].std)
    }

    /// What is there and what was said.
    pub fn line(&self) -> String {
        let mut out = format!("{:?}; there:", self.diagnosis.verdict);
        if self.sound.verdict != Verdict::NoMissingEffect {
            let names: Vec<_> = self.sound.effects.iter().map(|one| one.id).collect();
            let _ = write!(out, " (sound twin: {:?} {names:?} {:?})", self.sound.verdict, self.sound.notes);
        }
        self.truth.iter().for_each(|(id, size)| _ = write!(out, " {id} {size:.3e}"));
        out += "; named:";
        for one in &self.diagnosis.effects {
            let right = if self.is_there(one) { "" } else { "WRONG " };
            let doubts: Vec<DoubtId> = one.doubts.iter().map(|doubt| doubt.id).collect();
            let FoundEffect { id, value, std, probability, confusable_with, .. } = one;
            let _ = write!(
                out,
                " {right}{id} {value:.3e}±{std:.1e} {probability:.2} {doubts:?} {confusable_with:?}"
            );
        }
        let _ = write!(out, "; leaks off by {:.1?} sigma", self.leaks_off_sigma());
        out
    }
}

/// All that can be asked of a number of cases; on all cores.
pub fn ask_all(cases: &[Case]) -> Vec<(Case, Answer)> {
    cases.par_iter().filter_map(|case| Some((case.clone(), case.ask()?))).collect()
}

/// How often the answers are right.
pub fn summary(answers: &[(Case, Answer)]) -> String {
    let count = |of: &dyn Fn(&Answer) -> bool| answers.iter().filter(|(_, answer)| of(answer)).count();
    let names = |of: &dyn Fn(&FoundEffect) -> bool| {
        let found = |answer: &Answer| -> Vec<bool> {
            let wanted = answer.diagnosis.effects.iter().filter(|one| of(one));
            wanted.map(|one| answer.is_there(one)).collect()
        };
        let all: Vec<bool> = answers.iter().flat_map(|(_, answer)| found(answer)).collect();
        format!("{} of {}", all.iter().filter(|right| **right).count(), all.len())
    };
    let within = |answer: &Answer| -> Vec<bool> {
        let size =
            |one: &FoundEffect| answer.truth.iter().find(|(id, _)| *id == one.id).map(|(_, size)| *size);
        let sure = answer.diagnosis.effects.iter().filter(|one| one.confident);
        sure.filter_map(|one| Some((one.value - size(one)?).abs() <= 4.0 * one.std)).collect()
    };
    let within: Vec<bool> = answers.iter().flat_map(|(_, answer)| within(answer)).collect();
    let explained = answers.iter().filter(|(_, answer)| answer.diagnosis.verdict == Verdict::Explained);
    let leaks: Vec<f64> = explained.flat_map(|(_, answer)| answer.leaks_off_sigma()).collect();
    let mut out = format!(
        "{} rigs: first right {}, in the group {}, all named {}, explained {}; names {} right, sure {}; sure values within 4 σ {} of {}; leaks of \
         explained traces {} of {}; \
         sound twins {} without a missing effect, {} named\n",
        answers.len(),
        count(&Answer::first_is_right),
        count(&Answer::first_is_in_the_group),
        count(&Answer::all_are_named),
        count(&|answer| answer.diagnosis.verdict == Verdict::Explained),
        names(&|_| true),
        names(&|one| one.confident),
        within.iter().filter(|held| **held).count(),
        within.len(),
        leaks.iter().filter(|off| off.abs() <= 4.0).count(),
        leaks.len(),
        count(&|answer| answer.sound.verdict == Verdict::NoMissingEffect),
        count(&|answer| !answer.sound.effects.is_empty()),
    );
    for (low, high) in [(0.0, 0.3), (0.3, 0.55), (0.55, 0.8), (0.8, 0.95), (0.95, 1.01)] {
        let right = names(&|one| (low..high).contains(&one.probability));
        let _ = writeln!(out, "  names of {low} to {high}: {right} right");
    }
    let names = answers
        .iter()
        .flat_map(|(_, answer)| answer.diagnosis.effects.iter().map(|one| (one, answer.is_there(one))));
    out + &alone(names)
}
