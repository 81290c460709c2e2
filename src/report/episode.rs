use pitchleak_core::Leak;

/// A time in which a leak's alarm stood.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Episode {
    /// Which leak.
    pub fault: Leak,
    /// When its alarm was raised, s.
    pub from_s: f64,
    /// When it was cleared, s; none where it stands at the end.
    pub to_s: Option<f64>,
    /// Mean of the estimates meanwhile, L/min.
    pub mean_lpm: f64,
    /// Largest of them, L/min.
    pub peak_lpm: f64,
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
