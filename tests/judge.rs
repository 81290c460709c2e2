//! A small piece of the blind judge (`cargo bench --bench judge`): honest cylinders alone.

use pitchleak_testkit::judge::Case;
use pitchleak_testkit::judge::givers::{Explain, Replay, VerdictGiver};
use pitchleak_testkit::judge::score::{Judgement, Scored};
use pitchleak_testkit::judge::worlds::WORLDS;
use rayon::prelude::*;

const DRAWS: u64 = 16;
/// Honest traces that may stay open: leaks of 0.2 L/min beside sensors of 1 % lie near the threshold.
const OPEN: usize = 2;

/// Every honest draw, at each door.
fn honest(givers: &[&dyn VerdictGiver]) -> Vec<Vec<Scored>> {
    let honest = WORLDS.iter().find(|world| world.name == "honest").expect("there is one");
    let draw = |number| Case::draw(honest, number, "tests", None, 60.0);
    (0..DRAWS).into_par_iter().map(|number| draw(number).judge(givers)).collect()
}

/// A mistake that makes the readings louder once explained an honest trace in every other run: the noise that it takes off was
/// the expected one, and that of a run is more or less.
#[test]
#[cfg_attr(debug_assertions, ignore = "too slow without optimisation: run with --release")]
fn honest_traces_are_sure_and_right_and_no_wire_is_blamed() {
    let givers: [&dyn VerdictGiver; 2] = [&Replay, &Explain];
    let scored = honest(&givers);
    for (place, giver) in givers.iter().enumerate() {
        let own: Vec<&Scored> = scored.iter().map(|all| &all[place]).collect();
        let texts: Vec<&str> = own.iter().map(|one| one.text.as_str()).collect();
        let open = own.iter().filter(|one| one.judgement == Judgement::Open).count();
        assert!(own.iter().all(|one| one.judgement != Judgement::Wrong), "{}: {texts:#?}", giver.name());
        assert!(own.iter().all(|one| !one.causes.contains("unit_")), "{}: {texts:#?}", giver.name());
        assert!(open <= OPEN, "{}: {open} open: {texts:#?}", giver.name());
    }
}
