use super::{Listener, data};
use pitchleak::Rig;
use pitchleak::live::{Batch, BatchFormat, Checkpoint, Event, LiveConfig, Snapshot, Watch};
use std::collections::BTreeSet;
use std::path::Path;

/// The state file and the alarms' ids of a run that nothing disturbs.
pub fn undisturbed(cylinders: &[String], batches: &[String]) -> (Vec<u8>, BTreeSet<String>) {
    let rig = Rig::load(data().join("traces/rig.toml")).unwrap();
    let mut watch = Watch::new(LiveConfig::of(rig), None);
    let mut events = Vec::new();
    for payload in batches {
        for cylinder in cylinders {
            let payload = payload.as_bytes();
            let batch = Batch { cylinder, format: BatchFormat::Json, payload, resent: false };
            watch.take_batch(&batch, &mut events);
        }
    }
    let folder = tempfile::tempdir().unwrap();
    Checkpoint::new(folder.path()).unwrap().save(&Snapshot::of(&watch)).unwrap();
    let ids = events.into_iter().filter_map(|event| match event {
        Event::Alarm(alarm) => Some(alarm.id),
        _ => None,
    });
    let undisturbed = state(folder.path());
    assert!(!undisturbed.is_empty());
    (undisturbed, ids.collect())
}

/// Nothing in the moment in which the checkpoint before makes room for the next.
pub fn state(folder: &Path) -> Vec<u8> {
    std::fs::read(folder.join("watch.state")).unwrap_or_default()
}

/// Of the alarms that were heard.
pub fn ids(listener: &Listener) -> BTreeSet<String> {
    let alarms = listener.heard("/alarm").into_iter();
    alarms
        .map(|alarm| {
            serde_json::from_str::<serde_json::Value>(&alarm).unwrap()["id"].as_str().unwrap().to_owned()
        })
        .collect()
}

/// Of so many cylinders.
pub fn names(count: usize) -> Vec<String> {
    (0..count).map(|k| format!("T{k}/B{}", k % 3)).collect()
}
