//! Lines on standard error, for the journal: one of each kind and minute.

use std::collections::BTreeMap;
use std::io::Write as _;
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

const MINUTE: Duration = Duration::from_secs(60);
/// Kinds at most; all others are one.
const KINDS: usize = 100;

/// As systemd reads it (`sd-daemon(3)`).
#[derive(Clone, Copy, Debug)]
pub enum Level {
    Warning = 4,
    Info = 6,
}

#[derive(Default)]
pub struct Log(Mutex<BTreeMap<String, Kind>>);

struct Kind {
    said: Instant,
    unsaid: u64,
}

impl Log {
    /// Says it, unless one of its kind was said less than a minute ago.
    pub fn say(&self, level: Level, kind: &str, text: &str) {
        let Some(unsaid) = self.due(kind, Instant::now()) else { return };
        let more = if unsaid > 0 { format!(" ({unsaid} more since the last)") } else { String::new() };
        let text: String = text.chars().map(|c| if c.is_control() { ' ' } else { c }).take(500).collect();
        let _ = writeln!(std::io::stderr().lock(), "<{}>{kind}: {text}{more}", level as u8);
    }

    /// How many of the kind were not said since the last; none where this is not, either.
    fn due(&self, kind: &str, now: Instant) -> Option<u64> {
        let mut kinds = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let kind = if kinds.len() < KINDS || kinds.contains_key(kind) { kind } else { "" };
        let Some(known) = kinds.get_mut(kind) else {
            kinds.insert(kind.to_owned(), Kind { said: now, unsaid: 0 });
            return Some(0);
        };
        if now.duration_since(known.said) < MINUTE {
            known.unsaid += 1;
            return None;
        }
        known.said = now;
        Some(std::mem::take(&mut known.unsaid))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_kind_is_said_once_a_minute() {
        let (log, begin) = (Log::default(), Instant::now());
        let said: Vec<_> = (0..150).filter_map(|s| log.due("down", begin + Duration::from_secs(s))).collect();
        assert_eq!(said, [0, 59, 59]);
        assert_eq!(log.due("up", begin), Some(0));
    }
}
