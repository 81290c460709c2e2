//! Any bytes as a trace for the paper's law.

use pitchleak::Rig;
use pitchleak::rig::EstimatorKind;

pub fn enter(bytes: &[u8]) {
    let mut rig = Rig::paper();
    rig.estimator.kind = EstimatorKind::Paper;
    super::replay_bytes(bytes, &rig);
}
