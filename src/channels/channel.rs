/// Runs of identical readings up to this long are counted by their length; a longer one may be a stuck sensor.
pub(super) const SHORT_RUN: usize = 32;

/// No trace has as many.
const MOST_READINGS: u64 = 1 << 53;

/// What one channel did, reading by reading.
#[derive(Clone, Copy, Debug, serde::Serialize, serde::Deserialize)]
pub(super) struct Channel {
    pub readings: u64,
    last: f64,
    last_step: f64,
    last_bend: f64,
    /// Steps between readings, without those of zero size; the smallest.
    pub steps: u64,
    pub smallest_step: f64,
    /// Bends are differences of two such steps: how often they turn back from the one before, and their squares' sum.
    pub turns: u64,
    bend_square_sum: f64,
    pub least: Extreme,
    pub most: Extreme,
    /// The run that goes on: how often its reading was repeated, and when first.
    repeats: u32,
    repeats_from_s: f64,
    last_s: f64,
    /// The longest run of all, …
    pub longest: Run,
    /// … of the stretch that goes on, and of the one before it.
    lately: [Run; 2],
    /// Runs of length 2, 3, … [`SHORT_RUN`] at their length less 1; the first place is not used.
    short_runs: [u32; SHORT_RUN],
    /// Longer runs, and the readings in them.
    pub long_runs: u64,
    in_long_runs: u64,
}

/// A largest or smallest reading.
#[derive(Clone, Copy, Debug, serde::Serialize, serde::Deserialize)]
pub(super) struct Extreme {
    pub value: f64,
    /// How often it was read, how often twice in a row, and when first and last.
    pub count: u64,
    pub repeats: u64,
    pub from_s: f64,
    pub to_s: f64,
}

/// Identical readings in a row.
#[derive(Clone, Copy, Debug, Default, serde::Serialize, serde::Deserialize)]
pub(super) struct Run {
    pub value: f64,
    pub count: u64,
    pub from_s: f64,
    pub to_s: f64,
}

impl Default for Channel {
    fn default() -> Self {
        Self {
            readings: 0,
            last: 0.0,
            last_step: 0.0,
            last_bend: 0.0,
            steps: 0,
            smallest_step: f64::MAX,
            turns: 0,
            bend_square_sum: 0.0,
            least: Extreme::none(f64::MAX),
            most: Extreme::none(f64::MIN),
            repeats: 0,
            repeats_from_s: 0.0,
            last_s: 0.0,
            longest: Run::default(),
            lately: [Run::default(); 2],
            short_runs: [0; SHORT_RUN],
            long_runs: 0,
            in_long_runs: 0,
        }
    }
}

impl Extreme {
    fn none(value: f64) -> Self {
        Self { value, count: 0, repeats: 0, from_s: 0.0, to_s: 0.0 }
    }

    #[cold]
    fn met(&mut self, t_s: f64, value: f64, repeated: bool) {
        if self.count > 0 && value.to_bits() == self.value.to_bits() {
            self.count += 1;
            self.repeats += u64::from(repeated);
            self.to_s = t_s;
        } else {
            *self = Self { value, count: 1, repeats: 0, from_s: t_s, to_s: t_s };
        }
    }
}

impl Channel {
    #[inline]
    pub fn add(&mut self, t_s: f64, value: f64) {
        let step = value - self.last;
        let repeated = step == 0.0 && self.readings > 0;
        if repeated {
            self.repeat();
        } else {
            if self.repeats > 0 {
                self.close_run();
            }
            self.turn(step);
        }
        if value >= self.most.value {
            self.most.met(t_s, value, repeated);
        }
        if value <= self.least.value {
            self.least.met(t_s, value, repeated);
        }
        self.readings += 1;
        self.last = value;
        self.last_s = t_s;
    }

    /// Whether readings can have led to it, as far as its counts tell.
    pub fn is_possible(&self) -> bool {
        let running = if self.repeats > 0 { u64::from(self.repeats) + 1 } else { 0 };
        let in_runs = self.in_short_runs_longer_than_one() + running;
        let extremes = [&self.least, &self.most];
        in_runs.checked_add(self.in_long_runs).is_some_and(|count| count <= self.readings)
            && self.readings < MOST_READINGS
            && extremes
                .iter()
                .all(|extreme| extreme.repeats <= extreme.count && extreme.count <= self.readings)
    }

    fn in_short_runs_longer_than_one(&self) -> u64 {
        (1..).zip(self.short_runs).map(|(length, count): (u64, u32)| length * u64::from(count)).sum()
    }

    /// Some readings are not looked at: the next one follows from none, whatever it is.
    pub fn skip_to(&mut self, t_s: f64, value: f64) {
        if value.to_bits() != self.last.to_bits() && self.repeats > 0 {
            self.close_run();
        }
        (self.last, self.last_step, self.last_bend, self.last_s) = (value, 0.0, 0.0, t_s);
        // A run may begin with it.
        self.readings += 1;
    }

    #[inline]
    fn turn(&mut self, step: f64) {
        if self.readings > 0 {
            let bend = step - self.last_step;
            self.steps += 1;
            self.smallest_step = self.smallest_step.min(step.abs());
            self.turns += u64::from(bend * self.last_bend < 0.0);
            self.bend_square_sum += bend * bend;
            self.last_step = step;
            self.last_bend = bend;
        }
    }

    #[inline]
    fn repeat(&mut self) {
        if self.repeats == 0 {
            self.repeats_from_s = self.last_s;
        }
        self.repeats = self.repeats.saturating_add(1);
    }

    #[cold]
    fn close_run(&mut self) {
        let repeats = std::mem::take(&mut self.repeats);
        if let Some(runs) = self.short_runs.get_mut(repeats as usize) {
            *runs += 1;
            return;
        }
        let count = u64::from(repeats) + 1;
        self.in_long_runs += count;
        self.long_runs += 1;
        let run = Run { value: self.last, count, from_s: self.repeats_from_s, to_s: self.last_s };
        let [now, _] = &mut self.lately;
        for longest in [&mut self.longest, now] {
            if count > longest.count {
                *longest = run;
            }
        }
    }

    /// Another stretch begins: the one before the last is forgotten.
    pub fn next_stretch(&mut self) {
        let [now, _] = self.lately;
        self.lately = [Run::default(), now];
    }

    /// With no run but those that ended in the last two stretches, or go on.
    pub fn lately(mut self) -> Self {
        let [now, before] = self.lately;
        self.longest = if now.count > before.count { now } else { before };
        self
    }

    /// As if the trace ended here: the run that goes on counts.
    pub fn closed(mut self) -> Self {
        if self.repeats > 0 {
            self.close_run();
        }
        self
    }

    /// Readings outside of long runs.
    pub fn in_short_runs(&self) -> u64 {
        self.readings - self.in_long_runs
    }

    /// Short runs, single readings among them, and how many those are.
    pub fn short_runs(&self) -> (u64, u64) {
        let runs: u64 = self.short_runs.iter().copied().map(u64::from).sum();
        let singles = self.in_short_runs() - self.in_short_runs_longer_than_one();
        (runs + singles, singles)
    }

    /// Share of steps after which the next one bends the other way.
    pub fn turn_share(&self) -> f64 {
        self.turns as f64 / self.steps.max(1) as f64
    }

    /// Root mean square of a bend: √6 σ of white noise.
    pub fn bend(&self) -> f64 {
        (self.bend_square_sum / self.steps.max(1) as f64).sqrt()
    }
}
