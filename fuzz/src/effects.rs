//! Any effects of any size in a rig: a trace is replayed with them to numbers.

use super::{Dice, trace_text};
use pitchleak::Rig;
use pitchleak::core::Effect;
use pitchleak::rig::EffectValue;
use std::sync::LazyLock;

static TRACE: LazyLock<String> = LazyLock::new(|| trace_text(0, 200));

pub fn enter(bytes: &[u8]) {
    let (mut dice, mut rig) = (Dice(bytes), Rig::paper());
    for _ in 0..dice.byte() % 9 {
        let effect = Effect::ALL[usize::from(dice.byte()) % Effect::ALL.len()];
        let std = (dice.byte() % 2 == 0).then(|| dice.number().abs());
        rig.effects.insert(effect, EffectValue::new(dice.number(), std));
    }
    // As a file holds them, within their bounds.
    let rig = Rig::parse(&rig.to_toml(), "fuzz").expect("reads what it wrote");
    super::replay_bytes(TRACE.as_bytes(), &rig);
}
