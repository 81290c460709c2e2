//! What the traces of a cylinder, one after the other, say together: whether something stands, and since when.

use super::FleetRow;
use crate::report::Status;
use pitchleak_core::Leak;

/// What one trace says of a question that later traces answer again.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Answer {
    Yes,
    No,
    /// In doubt, or it says too little: it neither confirms nor ends what stood before it.
    Open,
}

/// An unbroken run of answers that lasts to the end: places in the order of time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Standing {
    /// The first yes since the last no.
    pub since: usize,
    /// The last no before it; none where no trace said no.
    pub other_until: Option<usize>,
    /// The last yes.
    pub latest: usize,
}

impl Answer {
    /// Whether `leak` is there. A sound trace excludes it, and one that names other leaks does where this one's interval
    /// ends below its threshold.
    pub fn on_leak(row: &FleetRow, leak: Leak) -> Self {
        match row.status {
            Some(Status::Leak) if row.faults.contains(&leak) => Self::Yes,
            Some(Status::Leak) if is_below(row, leak) => Self::No,
            Some(Status::Sound) => Self::No,
            _ => Self::Open,
        }
    }

    /// Whether the cylinder was as `now` says. Between sound traces one in doubt ends nothing; what is in doubt lasts
    /// as long as each trace says the same.
    pub fn on_status(row: &FleetRow, now: Status) -> Self {
        match row.status {
            Some(status) if status == now => Self::Yes,
            Some(status) if now.is_sure() && !status.is_sure() => Self::Open,
            Some(_) => Self::No,
            None => Self::Open,
        }
    }
}

fn is_below(row: &FleetRow, leak: Leak) -> bool {
    row.leaks.is_some_and(|leaks| {
        let found = leaks[leak];
        found.identifiable && found.ci95.is_some_and(|[_, high]| high < found.threshold_lpm)
    })
}

impl Standing {
    /// None where the last answer that is one is no, or there is none.
    pub fn of(answers: &[Answer]) -> Option<Self> {
        let is = |wanted: Answer| move |answer: &Answer| *answer == wanted;
        let latest = answers.iter().rposition(is(Answer::Yes))?;
        let other_until = answers.iter().rposition(is(Answer::No));
        if other_until.is_some_and(|no| no > latest) {
            return None;
        }
        let run_begins = other_until.map_or(0, |no| no + 1);
        let since = run_begins + answers.iter().skip(run_begins).position(is(Answer::Yes))?;
        Some(Self { since, other_until, latest })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn standing(text: &str) -> Option<(usize, Option<usize>, usize)> {
        let answer = |mark| match mark {
            'y' => Answer::Yes,
            'n' => Answer::No,
            _ => Answer::Open,
        };
        let answers: Vec<_> = text.chars().map(answer).collect();
        Standing::of(&answers).map(|found| (found.since, found.other_until, found.latest))
    }

    #[test]
    fn a_doubt_ends_nothing_and_a_no_ends_everything() {
        assert_eq!(standing("nyyy"), Some((1, Some(0), 3)));
        assert_eq!(standing("yy?yy??"), Some((0, None, 4)));
        assert_eq!(standing("yynyy"), Some((3, Some(2), 4)));
        assert_eq!(standing("n?y"), Some((2, Some(0), 2)));
        assert_eq!(standing("yyn"), None);
        assert_eq!(standing("yn?"), None);
        assert_eq!(standing("??"), None);
        assert_eq!(standing(""), None);
    }
}
