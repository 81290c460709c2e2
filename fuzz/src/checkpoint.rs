//! Any bytes as the state of a cylinder, and a saved one with values changed and the checksum put right: put aside, or a
//! watch that goes on with numbers.

use super::{Dice, assert_told, scratch, trace_text};
use ciborium::Value;
use flate2::Compression;
use flate2::read::{GzDecoder, GzEncoder};
use pitchleak::Rig;
use pitchleak::live::{Batch, BatchFormat, Checkpoint, Event, LiveConfig, Snapshot, Watch};
use std::io::Read;
use std::path::Path;
use std::sync::LazyLock;

/// In the folder.
const STATE: &str = "cylinders/T7%2FB2.state";

static SAVED: LazyLock<Value> = LazyLock::new(|| {
    let (mut watch, mut events) = (watch(), Vec::new());
    // Four days and a few hours, seconds of each.
    for t_s in [0.0, 3600.0, 86_400.0, 172_800.0, 259_200.0, 345_600.0, 349_200.0] {
        go_on(&mut watch, t_s, &mut events);
    }
    let folder = scratch::folder("checkpoint-saved");
    save(&folder, &mut watch);
    let bytes = std::fs::read(folder.join(STATE)).expect("reads");
    std::fs::remove_dir_all(folder).expect("removes");
    ciborium::from_reader(GzDecoder::new(bytes.as_slice())).expect("CBOR")
});

pub fn enter(bytes: &[u8]) {
    let folder = scratch::folder("checkpoint");
    restore_and_go_on(&folder, bytes);
    let (mut dice, mut tree) = (Dice(bytes), SAVED.clone());
    for _ in 0..1 + dice.byte() % 4 {
        let (at, value) = (u32::from(dice.byte()) << 8 | u32::from(dice.byte()), any_value(&mut dice));
        let mut leaves = Vec::new();
        collect(&mut tree, &mut leaves);
        let count = leaves.len();
        if let Some(leaf) = leaves.into_iter().nth(at as usize % count) {
            *leaf = value;
        }
    }
    let mut forged = Vec::new();
    ciborium::into_writer(&tree, &mut forged).expect("writes");
    // Something behind the end, too.
    forged.extend((0..dice.byte() % 3).map(|_| 0));
    let mut packed = Vec::new();
    GzEncoder::new(forged.as_slice(), Compression::fast()).read_to_end(&mut packed).expect("packs");
    restore_and_go_on(&folder, &packed);
}

fn save(folder: &Path, watch: &mut Watch) {
    Checkpoint::new(folder).expect("a folder").save(&Snapshot::of(watch)).expect("saves");
}

/// Whatever was saved, restores: as it was, without a word.
///
/// # Panics
/// Where it doesn't.
pub fn assert_restores(watch: &mut Watch) {
    let folder = scratch::folder("checkpoint-restores");
    save(&folder, watch);
    let mut next = Watch::new(watch.config().clone(), None);
    let notices = Checkpoint::new(&folder).expect("a folder").restore(&mut next).expect("reads");
    std::fs::remove_dir_all(folder).expect("removes");
    assert!(notices.is_empty() && watch.names().eq(next.names()), "{notices:?}");
}

fn watch() -> Watch {
    Watch::new(LiveConfig { most_cylinders: 3, ..LiveConfig::of(Rig::paper()) }, None)
}

fn restore_and_go_on(folder: &Path, bytes: &[u8]) {
    let (mut watch, mut events) = (watch(), Vec::new());
    let checkpoint = Checkpoint::new(folder).expect("a folder");
    std::fs::write(folder.join(STATE), bytes).expect("writes");
    events.extend(checkpoint.restore(&mut watch).expect("reads").into_iter().map(Event::Notice));
    for t_s in [349_210.0, 352_800.0, 432_000.0] {
        go_on(&mut watch, t_s, &mut events);
    }
    watch.finish(&mut events);
    assert_told(&events);
}

/// Three seconds of samples from `t_s` on.
fn go_on(watch: &mut Watch, t_s: f64, events: &mut Vec<Event>) {
    let later = |line: &str| match line.split_once(',').map(|(t, rest)| (t.parse::<f64>(), rest)) {
        Some((Ok(t), rest)) => format!("{},{rest}\n", t + t_s),
        _ => format!("{line}\n"),
    };
    let payload: String = trace_text(0, 250).lines().map(later).collect();
    let batch =
        Batch { cylinder: "T7/B2", format: BatchFormat::Csv, payload: payload.as_bytes(), resent: false };
    watch.take_batch(&batch, events);
}

fn any_value(dice: &mut Dice<'_>) -> Value {
    match dice.byte() % 8 {
        0 => Value::Null,
        1 => Value::Bool(true),
        2 => Value::Integer(u64::MAX.into()),
        3 => Value::Integer(dice.byte().into()),
        4 => Value::Text("\u{1b}[8m".repeat(usize::from(dice.byte()))),
        5 => Value::Bytes(vec![dice.byte(); 3]),
        _ => Value::Float(dice.number()),
    }
}

/// All that holds no further values.
fn collect<'a>(value: &'a mut Value, leaves: &mut Vec<&'a mut Value>) {
    match value {
        Value::Array(values) => values.iter_mut().for_each(|value| collect(value, leaves)),
        Value::Map(entries) => entries.iter_mut().for_each(|(key, value)| {
            leaves.push(key);
            collect(value, leaves);
        }),
        leaf => leaves.push(leaf),
    }
}
