use super::TraceSummary;
use crate::units::duration;
use pitchleak_core::Leak;

/// Episodes of one leak that follow one another closely, told as one: what a day of a leak that comes and goes is in short.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Spell {
    /// Which leak.
    pub fault: Leak,
    /// When the first alarm was raised, s.
    pub from_s: f64,
    /// When the last one was cleared, s; none where it stands at the end.
    pub to_s: Option<f64>,
    /// How many episodes.
    pub times: usize,
    /// How long an alarm stood, all of them together, s.
    pub stood_s: f64,
    /// Mean of the estimates while one stood and the leak was not below the level at which it clears, L/min.
    pub mean_lpm: f64,
    /// Largest of them, L/min.
    pub peak_lpm: f64,
}

/// Pauses that are a smaller share of the trace's duration are within a spell: an hour of a day.
const PAUSE_SHARE: f64 = 1.0 / 24.0;

impl Spell {
    /// The spells of a trace that is `duration_s` long and ends at `end_s`, in the order of their beginnings.
    pub fn of(episodes: &[Episode], duration_s: f64, end_s: f64) -> Vec<Self> {
        let mut spells: Vec<Self> = Vec::new();
        for episode in episodes {
            let open = spells.iter_mut().rev().find(|spell| spell.fault == episode.fault);
            let follows = |spell: &&mut Self| {
                spell.to_s.is_some_and(|to_s| episode.from_s - to_s <= PAUSE_SHARE * duration_s)
            };
            match open.filter(follows) {
                Some(spell) => spell.go_on(episode, end_s),
                None => spells.push(Self::begin(episode, end_s)),
            }
        }
        spells
    }

    /// From when to when.
    pub fn when(&self, trace: &TraceSummary) -> String {
        let from = trace.time(self.from_s, 1);
        self.to_s
            .map_or_else(|| format!("from {from} on"), |to_s| format!("{from} to {}", trace.time(to_s, 1)))
    }

    /// How large, and how long or how often.
    pub fn size(&self) -> String {
        let Self { mean_lpm, peak_lpm, times, stood_s, .. } = *self;
        let long = match times {
            1 => format!("for {}", duration(stood_s)),
            times => format!("{times} times, {} in all", duration(stood_s)),
        };
        format!("{mean_lpm:.3} L/min on average, {peak_lpm:.3} at most; {long}")
    }

    fn begin(episode: &Episode, end_s: f64) -> Self {
        let Episode { fault, from_s, to_s, mean_lpm, peak_lpm } = *episode;
        Self { fault, from_s, to_s, times: 1, stood_s: to_s.unwrap_or(end_s) - from_s, mean_lpm, peak_lpm }
    }

    fn go_on(&mut self, episode: &Episode, end_s: f64) {
        let next = Self::begin(episode, end_s);
        let stood_s = self.stood_s + next.stood_s;
        if stood_s > 0.0 {
            self.mean_lpm = (self.mean_lpm * self.stood_s + next.mean_lpm * next.stood_s) / stood_s;
        }
        self.stood_s = stood_s;
        self.times += 1;
        self.to_s = next.to_s;
        self.peak_lpm = self.peak_lpm.max(next.peak_lpm);
    }
}

/// A time in which a leak's alarm stood.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Episode {
    /// Which leak.
    pub fault: Leak,
    /// When its alarm was raised, s.
    pub from_s: f64,
    /// When it was cleared, s; none where it stands at the end.
    pub to_s: Option<f64>,
    /// Mean of the estimates meanwhile that are not below the level at which it clears, L/min.
    pub mean_lpm: f64,
    /// Largest of them, L/min.
    pub peak_lpm: f64,
}

impl Episode {
    /// The last of a leak.
    pub(crate) fn last_of(episodes: &[Self], leak: Leak) -> Option<&Self> {
        episodes.iter().rev().find(|episode| episode.fault == leak)
    }
}

/// A leak that stayed away for so many times its longest pause no longer comes and goes.
const STAYED_AWAY: f64 = 3.0;

/// Whether a leak whose alarm does not stand at `end_s` comes and goes: it came twice, and has not been away for much
/// longer than between.
pub(super) fn comes_and_goes(episodes: &[Episode], leak: Leak, end_s: f64) -> bool {
    let own: Vec<_> = episodes.iter().filter(|episode| episode.fault == leak).collect();
    let pauses = own.windows(2).filter_map(|pair| Some(pair.last()?.from_s - pair.first()?.to_s?));
    let longest = pauses.fold(0.0, f64::max);
    let away_since = own.last().and_then(|last| last.to_s);
    own.len() > 1 && away_since.is_some_and(|since| end_s - since < STAYED_AWAY * longest)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn episode(fault: Leak, from_s: f64, to_s: Option<f64>, mean_lpm: f64) -> Episode {
        Episode { fault, from_s, to_s, mean_lpm, peak_lpm: 2.0 * mean_lpm }
    }

    #[test]
    fn a_leak_that_comes_and_goes_is_one_spell_and_two_leaks_are_two() {
        let mut episodes: Vec<_> = (0..30_u32)
            .map(|k| 100.0 * f64::from(k))
            .map(|from_s| episode(Leak::Internal, from_s, Some(from_s + 50.0), 0.2))
            .collect();
        episodes.push(episode(Leak::ExternalA, 40_000.0, Some(50_000.0), 0.4));
        episodes.push(episode(Leak::Internal, 80_000.0, Some(80_100.0), 0.3));
        episodes.push(episode(Leak::Internal, 80_200.0, None, 0.9));
        let spells = Spell::of(&episodes, 86_400.0, 86_400.0);
        let [many, other, last] = spells.as_slice() else { panic!("{spells:?}") };
        assert_eq!((many.times, many.from_s, many.to_s), (30, 0.0, Some(2950.0)));
        assert!((many.stood_s - 1500.0).abs() < 1e-9 && (many.mean_lpm - 0.2).abs() < 1e-12);
        assert_eq!((other.fault, other.times), (Leak::ExternalA, 1));
        assert_eq!((last.times, last.to_s), (2, None));
        assert!((last.stood_s - 6300.0).abs() < 1e-9);
        assert!((last.mean_lpm - (0.3 * 100.0 + 0.9 * 6200.0) / 6300.0).abs() < 1e-12);
        assert!((last.peak_lpm - 1.8).abs() < 1e-12);
    }

    fn episodes(times: &[(f64, f64)]) -> Vec<Episode> {
        let episode = |(from_s, to_s): &(f64, f64)| Episode {
            fault: Leak::Internal,
            from_s: *from_s,
            to_s: Some(*to_s),
            mean_lpm: 0.5,
            peak_lpm: 0.6,
        };
        times.iter().map(episode).collect()
    }

    #[test]
    fn a_leak_that_was_mended_stays_away_and_one_that_comes_again_does_not() {
        let once = episodes(&[(10.0, 20.0)]);
        assert!(!comes_and_goes(&once, Leak::Internal, 21.0));
        let twice = episodes(&[(10.0, 20.0), (70.0, 80.0)]);
        assert!(comes_and_goes(&twice, Leak::Internal, 120.0));
        assert!(!comes_and_goes(&twice, Leak::ExternalA, 120.0));
        assert!(!comes_and_goes(&twice, Leak::Internal, 1000.0));
    }
}
