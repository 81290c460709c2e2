//! What a stream says on its way: every estimate and every alarm, not the last word alone.

use super::judge::{Judgement, Said, events, judge, recorded};
use super::{Family, LEAKING, LIES, Leaking, Lie, OPENS_S, opening, truths};
use pitchleak::core::{AlarmState, Leak};
use pitchleak::live::Event;
use pitchleak::simulate::Truth;
use pitchleak::wind::WindCase;
use rayon::prelude::*;

/// Of one stream.
#[derive(Debug)]
pub struct OnItsWay {
    pub lie: &'static Lie,
    pub leaking: Leaking,
    pub accuracy: f64,
    pub wind: WindCase,
    pub seed: u64,
    /// Times of the estimates and alarms that are sure and wrong, s …
    pub wrong_s: Vec<f64>,
    /// … and of those among them that name a leak which is not there, or none where one is, s.
    pub misnamed_s: Vec<f64>,
    /// Time of the first alarm of the leak that there is, s …
    pub alarm_s: Option<f64>,
    /// … and of the first estimate that is sure of it and right, s.
    pub sure_s: Option<f64>,
}

impl OnItsWay {
    /// Whether all that is wrong is a leak's size.
    pub fn names_no_other(&self) -> bool {
        self.misnamed_s.is_empty()
    }
}

/// Leaks that open at once.
const OPENING: [Leak; 2] = [Leak::Internal, Leak::ExternalA];
const OPENING_LPM: [f64; 2] = [0.2, 0.5];

/// Every honest trace, and every one of which a meter's zero is off.
pub fn sweep(accuracies: &[f64], winds: &[WindCase], seeds: &[u64]) -> Vec<OnItsWay> {
    let cylinders: Vec<_> = winds.iter().flat_map(|wind| LEAKING.map(|leaking| (*wind, leaking))).collect();
    let of_cylinder = |(wind, leaking): &(WindCase, Leaking)| {
        let truths = truths(*wind, *leaking);
        let lies = LIES.iter().filter(|lie| matches!(lie.family, Family::Honest | Family::Offset));
        let each = |lie| accuracies.iter().flat_map(move |a| seeds.iter().map(move |seed| (lie, *a, *seed)));
        let cases: Vec<_> = lies.flat_map(each).collect();
        let follow = |(lie, accuracy, seed): &(&'static Lie, f64, u64)| {
            follow(&truths, *wind, *leaking, lie, *accuracy, *seed)
        };
        cases.par_iter().map(follow).collect::<Vec<_>>()
    };
    cylinders.par_iter().flat_map_iter(of_cylinder).collect()
}

/// Leaks of this mean flow, L/min, that open at once beside honest sensors.
pub fn openings(accuracies: &[f64], winds: &[WindCase], seeds: &[u64], size_lpm: f64) -> Vec<OnItsWay> {
    let cylinders: Vec<_> = winds.iter().flat_map(|wind| OPENING.map(|leak| (*wind, leak))).collect();
    let of_cylinder = |(wind, leak): &(WindCase, Leak)| {
        let truths = opening(*wind, *leak, size_lpm);
        let cases = accuracies.iter().flat_map(|a| seeds.iter().map(move |seed| (*a, *seed)));
        let cases: Vec<_> = cases.collect();
        let follow = |(a, seed): &(f64, u64)| follow(&truths, *wind, Some(*leak), &LIES[0], *a, *seed);
        cases.par_iter().map(follow).collect::<Vec<_>>()
    };
    cylinders.par_iter().flat_map_iter(of_cylinder).collect()
}

/// All that a stream says of `truths`.
fn follow(
    truths: &[Truth],
    wind: WindCase,
    leaking: Leaking,
    lie: &'static Lie,
    accuracy: f64,
    seed: u64,
) -> OnItsWay {
    let (trace, shown) = recorded(truths, lie, accuracy, seed);
    let mut found = OnItsWay {
        lie,
        leaking,
        accuracy,
        wind,
        seed,
        wrong_s: Vec::new(),
        misnamed_s: Vec::new(),
        alarm_s: None,
        sure_s: None,
    };
    for event in events(&trace, accuracy) {
        match event {
            Event::Estimate(estimate) => {
                let t_s = estimate.t_s;
                let so_far = shown.partition_point(|truth| truth.t_s <= t_s);
                let named = estimate.faults.clone();
                match judge(&Said::from(*estimate), leaking, &shown[..so_far]) {
                    Judgement::ConfidentlyWrong => {
                        found.wrong_s.push(t_s);
                        found.misnamed_s.extend((!named.into_iter().eq(leaking)).then_some(t_s));
                    }
                    Judgement::Right if leaking.is_some() => found.sure_s = found.sure_s.or(Some(t_s)),
                    _ => {}
                }
            }
            Event::Alarm(alarm) if alarm.state == AlarmState::Raised => {
                if leaking == Some(alarm.fault) {
                    found.alarm_s = found.alarm_s.or(Some(alarm.t_s));
                } else if alarm.status.is_sure() {
                    found.wrong_s.push(alarm.t_s);
                    found.misnamed_s.push(alarm.t_s);
                }
            }
            _ => {}
        }
    }
    found
}

/// The tables for people.
pub fn print(accuracies: &[f64], seeds: &[u64]) {
    print!("{}", summary(&sweep(accuracies, &WindCase::ALL, seeds)));
    println!("\n| opens | streams | alarm, s: median (longest) | sure of it, s |\n|---|---|---|---|");
    for size_lpm in OPENING_LPM {
        print!("{}", delays(size_lpm, &openings(accuracies, &WindCase::ALL, seeds, size_lpm)));
    }
}

/// The table for people, and every stream that was sure of what is not so.
fn summary(streams: &[OnItsWay]) -> String {
    let mut out = String::from(
        "| lie | streams | sure of what is not so | of more than a size | estimates and alarms so | first sure of a leak that is there, s: median (longest) |\n\
         |---|---|---|---|---|---|\n",
    );
    for lie in LIES.iter().filter(|lie| matches!(lie.family, Family::Honest | Family::Offset)) {
        let own = || streams.iter().filter(|stream| stream.lie.name == lie.name);
        let wrong = own().filter(|stream| !stream.wrong_s.is_empty()).count();
        let misnamed = own().filter(|stream| !stream.names_no_other()).count();
        let words = own().map(|stream| stream.wrong_s.len()).sum::<usize>();
        let leaking = own().filter(|stream| stream.leaking.is_some());
        let delays: Vec<_> = leaking.map(|stream| stream.sure_s.unwrap_or(f64::INFINITY)).collect();
        out += &format!(
            "| {} | {} | {wrong} | {misnamed} | {words} | {} |\n",
            lie.name,
            own().count(),
            middle_and_last(delays)
        );
    }
    for OnItsWay { lie, leaking, accuracy, wind, seed, wrong_s, .. } in streams {
        if !wrong_s.is_empty() {
            let leaks = leaking.map_or("sound", Leak::id);
            out += &format!(
                "{}, {leaks}, {accuracy}, {} m/s, seed {seed}: {wrong_s:?}\n",
                lie.name,
                wind.mean_mps()
            );
        }
    }
    out
}

/// How long after it opened a leak is alarmed, and known for sure.
fn delays(size_lpm: f64, streams: &[OnItsWay]) -> String {
    let mut out = String::new();
    for wind in WindCase::ALL {
        for leak in OPENING {
            let own = || streams.iter().filter(|one| one.wind == wind && one.leaking == Some(leak));
            let after = |s: Option<f64>| s.map_or(f64::INFINITY, |s| s - OPENS_S);
            let alarms = own().map(|one| after(one.alarm_s)).collect();
            let sure = own().map(|one| after(one.sure_s)).collect();
            out += &format!(
                "| {size_lpm} L/min, {}, {} m/s | {} | {} | {} |\n",
                leak.id(),
                wind.mean_mps(),
                own().count(),
                middle_and_last(alarms),
                middle_and_last(sure)
            );
        }
    }
    out
}

fn middle_and_last(mut delays: Vec<f64>) -> String {
    delays.sort_by(f64::total_cmp);
    let at = |index: usize| {
        delays
            .get(index)
            .map_or("-".into(), |s| if s.is_finite() { format!("{s:.1}") } else { "never".into() })
    };
    format!("{} ({})", at(delays.len() / 2), at(delays.len().saturating_sub(1)))
}
