//! Any bytes as a trace for the paper's law.
#![no_main]

use libfuzzer_sys::fuzz_target;
use pitchleak::Rig;
use pitchleak::rig::EstimatorKind;

fuzz_target!(|bytes: &[u8]| {
    let mut rig = Rig::paper();
    rig.estimator.kind = EstimatorKind::Paper;
    pitchleak_fuzz::replay_bytes(bytes, &rig);
});
