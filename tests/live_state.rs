//! What a watch keeps on the disk: each cylinder by itself, so that what is wrong with one is nobody else's.

#![allow(clippy::unwrap_used)]

use ciborium::Value;
use flate2::Compression;
use flate2::read::{GzDecoder, GzEncoder};
use pitchleak::Rig;
use pitchleak::core::Sample;
use pitchleak::live::{
    Batch, BatchFormat, Checkpoint, Event, LineFormat, LiveConfig, NoticeEvent, Snapshot, Watch,
};
use pitchleak::wind::WindCase;
use pitchleak_testkit::windy::minute;
use proptest::prelude::*;
use std::collections::BTreeMap;
use std::io::Read;
use std::path::Path;

fn config() -> LiveConfig {
    let mut config = LiveConfig::of(Rig::paper());
    config.cylinders.insert("edited".to_owned(), Rig::paper());
    config
}

/// A second of samples from `t_s` on, as rows.
fn rows(t_s: f64) -> String {
    let row = |k: u32| {
        let t_s = t_s + 0.01 * f64::from(k);
        let (x_mm, v_mps) = (100.0 + 30.0 * (6.0 * t_s).sin(), 0.18 * (6.0 * t_s).cos());
        let (pa, pb) = (80.0 + 20.0 * (2.0 * t_s).sin(), 30.0 + 10.0 * (3.0 * t_s).cos());
        let leak = 0.06 * (pa - pb);
        let (qa, qb) = (v_mps * 12.6e-4 * 6e4 + leak, -v_mps * 9.4e-4 * 6e4 - leak);
        format!("{t_s},{x_mm},{pa},{pb},{qa},{qb}\n")
    };
    (0..100).map(row).collect()
}

const HEADER: &str = "t_s,x_mm,pa_bar,pb_bar,qa_lpm,qb_lpm\n";

fn take(watch: &mut Watch, cylinder: &str, rows: &str) -> Vec<Event> {
    let mut events = Vec::new();
    let payload = [HEADER, rows].concat();
    let batch = Batch { cylinder, format: BatchFormat::Csv, payload: payload.as_bytes(), resent: false };
    watch.take_batch(&batch, &mut events);
    events
}

fn count(events: &[Event], kind: &str) -> u64 {
    let counts = events.iter().map(|event| match event {
        Event::Notice(notice) if notice.kind == kind => notice.count,
        _ => 0,
    });
    counts.sum()
}

fn save(folder: &Path, watch: &mut Watch) {
    Checkpoint::new(folder).unwrap().save(&Snapshot::of(watch)).unwrap();
}

/// A watch that goes on from the folder, and what it says of it.
fn restored(folder: &Path, config: LiveConfig) -> (Watch, Vec<NoticeEvent>) {
    let mut watch = Watch::new(config, None);
    let notices = Checkpoint::new(folder).unwrap().restore(&mut watch).unwrap();
    (watch, notices)
}

/// Of so many cylinders, a second each, in two checkpoints.
fn folder_of(names: &[&str]) -> tempfile::TempDir {
    folder_after(names, 2).0
}

/// Of so many checkpoints, each a second after the one before; and the cylinder `B2` after each.
fn folder_after(names: &[&str], checkpoints: u32) -> (tempfile::TempDir, Vec<Vec<u8>>) {
    let folder = tempfile::tempdir().unwrap();
    let checkpoint = Checkpoint::new(folder.path()).unwrap();
    let mut watch = Watch::new(config(), None);
    let after = (0..checkpoints).map(|t_s| {
        names.iter().for_each(|name| _ = take(&mut watch, name, &rows(f64::from(t_s))));
        checkpoint.save(&Snapshot::of(&mut watch)).unwrap();
        watch.states().unwrap().remove("B2").unwrap_or_default()
    });
    let after = after.collect();
    (folder, after)
}

fn copy_of(folder: &Path) -> tempfile::TempDir {
    let copy = tempfile::tempdir().unwrap();
    std::fs::create_dir(copy.path().join("cylinders")).unwrap();
    for file in std::fs::read_dir(folder.join("cylinders")).unwrap().map(Result::unwrap) {
        std::fs::copy(file.path(), copy.path().join("cylinders").join(file.file_name())).unwrap();
    }
    copy
}

/// The newest file of each by its name.
fn files(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let entries = std::fs::read_dir(folder.join("cylinders")).unwrap().map(|entry| entry.unwrap());
    let file = |entry: std::fs::DirEntry| {
        (entry.file_name().into_string().unwrap(), std::fs::read(entry.path()).unwrap())
    };
    entries.map(file).filter(|(name, _)| name.ends_with(".state")).collect()
}

#[test]
fn an_impossible_time_is_left_out_and_its_state_restores() {
    let folder = tempfile::tempdir().unwrap();
    let mut watch = Watch::new(config(), None);
    take(&mut watch, "B1", &rows(0.0));
    // Nanoseconds where seconds are meant.
    let events = take(&mut watch, "B1", "1.764e18,100,80,30,0,0\n");
    assert_eq!(count(&events, "out_of_range"), 1, "{events:?}");
    save(folder.path(), &mut watch);
    let (mut next, notices) = restored(folder.path(), config());
    assert_eq!(notices, []);
    let events = take(&mut next, "B1", &rows(1.0));
    assert_eq!(count(&events, "late"), 0, "{events:?}");
}

#[test]
fn a_rig_that_was_edited_begins_one_cylinder_anew_and_no_other() {
    let folder = folder_of(&["B1", "edited"]);
    let before = files(folder.path());
    let mut changed = config();
    changed.cylinders.get_mut("edited").unwrap().cylinder.stroke_m *= 1.1;
    let (mut next, notices) = restored(folder.path(), changed.clone());
    assert_eq!(next.names().collect::<Vec<_>>(), ["B1"]);
    let [notice] = notices.as_slice() else { panic!("{notices:?}") };
    assert_eq!((notice.cylinder.as_str(), notice.kind.as_str()), ("edited", "checkpoint"));
    assert!(notice.text.contains("of another rig") && notice.text.contains("begins anew"), "{notice:?}");
    let aside = std::fs::read(folder.path().join("cylinders/edited.state.aside")).unwrap();
    assert_eq!(aside, before["edited.state"]);
    // It is said once.
    take(&mut next, "edited", &rows(2.0));
    save(folder.path(), &mut next);
    assert_eq!(restored(folder.path(), changed).1, []);
    assert_eq!(files(folder.path())["B1.state"], before["B1.state"]);
}

/// Whatever is wrong with the newest file: its cylinder is as it was after the last checkpoint before the damage, or after one
/// that the file before holds, and goes on; the others are as they were.
#[test]
fn damage_costs_one_cylinder_what_came_after_it_and_the_others_nothing() {
    let names = ["B1", "B2", "T7/ü"];
    let (sound, after) = folder_after(&names, 5);
    let file = std::fs::read(sound.path().join("cylinders/B2.state")).unwrap();
    // Where records begin.
    let begins: Vec<_> = (0..file.len() - 2).filter(|at| file[*at..].starts_with(&[0x1f, 0x8b, 8])).collect();
    assert_eq!(begins.len(), 4, "records");
    let whole = restored(sound.path(), config()).0;
    for at in (10..file.len()).step_by(file.len() / 40) {
        let Some(record) = begins.iter().rposition(|begin| begin + 10 <= at) else { continue };
        if begins.get(record + 1).is_some_and(|next| *next <= at) {
            // A date that no checksum covers.
            continue;
        }
        let flipped = [&file[..at], &[!file[at]], &file[at + 1..]].concat();
        for damaged in [&flipped, &file[..at]] {
            let folder = copy_of(sound.path());
            std::fs::write(folder.path().join("cylinders/B2.state"), damaged).unwrap();
            let (watch, notices) = restored(folder.path(), config());
            assert_eq!(notices.len(), 1, "{notices:?}");
            let (mut expected, found) = (whole.states().unwrap(), watch.states().unwrap());
            // The file's first record is of the second checkpoint, as the last of the file before is.
            let last = &after[record.max(1)];
            expected.insert("B2", last.clone());
            assert!(found == expected, "{at} of {begins:?}: {notices:?}");
            // What was cut off is said once.
            assert_eq!(restored(folder.path(), config()).1.is_empty(), record > 0);
        }
    }
}

#[test]
fn where_both_states_are_damaged_the_cylinder_begins_anew() {
    let folder = folder_of(&["B1", "B2"]);
    for ending in ["state", "state.before"] {
        std::fs::write(folder.path().join(format!("cylinders/B2.{ending}")), "nothing").unwrap();
    }
    let (watch, notices) = restored(folder.path(), config());
    assert_eq!(watch.names().collect::<Vec<_>>(), ["B1"]);
    assert!(notices[0].text.ends_with("damaged: the cylinder begins anew"), "{notices:?}");
    assert_eq!(restored(folder.path(), config()).1, []);
    assert!(folder.path().join("cylinders/B2.state.aside").exists());
}

/// Bytes of a checkpoint of a cylinder in turbulent wind, in the mean over a quarter of an hour: `docs/edge.md` says what they
/// are in a day. A state holds twelve segments after a minute, and grows no more.
#[test]
fn a_checkpoint_takes_no_more_bytes_than_is_said() {
    let samples: Vec<_> =
        (0..20).flat_map(|seed| minute(WindCase::Mps13, None, seed).into_iter().take(6000)).collect();
    for (checkpoint_s, most_kb) in [(10_u32, 24.0), (60, 70.0), (300, 208.0)] {
        let folder = tempfile::tempdir().unwrap();
        let checkpoint = Checkpoint::new(folder.path()).unwrap();
        let mut watch = Watch::new(config(), None);
        let mut bytes = Vec::new();
        for (second, samples) in samples.chunks(100).enumerate() {
            let row = |(k, (_, sample)): (usize, &(f64, Sample<f64>))| {
                let t_s = second as f64 + 0.01 * k as f64;
                let [x, pa, pb, qa, qb] = sample.readings().map(Option::unwrap_or_default);
                format!(
                    "{t_s},{:.5},{:.5},{:.5},{:.6},{:.6}\n",
                    1e3 * x,
                    1e-5 * pa,
                    1e-5 * pb,
                    6e4 * qa,
                    6e4 * qb
                )
            };
            take(&mut watch, "B1", &samples.iter().enumerate().map(row).collect::<String>());
            if (second as u32 + 1).is_multiple_of(checkpoint_s) {
                let written = checkpoint.save(&Snapshot::of(&mut watch)).unwrap();
                bytes.extend((second >= 300).then_some(written as f64));
            }
        }
        let kb = 1e-3 * bytes.iter().sum::<f64>() / bytes.len() as f64;
        let mb_a_day = 1e-3 * kb * 86_400.0 / f64::from(checkpoint_s);
        println!("every {checkpoint_s} s: {kb:.1} kB, {mb_a_day:.0} MB a day");
        assert!(kb < most_kb, "every {checkpoint_s} s: {kb:.1} kB");
    }
}

#[test]
fn a_checkpoint_is_of_what_changed() {
    let folder = folder_of(&["B1", "B2"]);
    let (mut watch, _) = restored(folder.path(), config());
    assert!(Snapshot::of(&mut watch).is_empty());
    take(&mut watch, "B2", &rows(2.0));
    let snapshot = Snapshot::of(&mut watch);
    let checkpoint = Checkpoint::new(folder.path()).unwrap();
    let before = files(folder.path());
    let bytes = checkpoint.save(&snapshot).unwrap();
    let after = files(folder.path());
    assert_eq!((bytes, &before["B1.state"]), (after["B2.state"].len(), &after["B1.state"]));
    assert_ne!(before["B2.state"], after["B2.state"]);
    // One that could not be written goes with the next.
    snapshot.give_back(&mut watch);
    assert!(!Snapshot::of(&mut watch).is_empty());
}

#[test]
fn a_reload_keeps_every_cylinder_whose_rig_is_the_same() {
    let folder = folder_of(&["B1", "edited", "T7/B2"]);
    let (mut watch, _) = restored(folder.path(), config());
    let before = files(folder.path());
    let mut changed = LiveConfig { rig: None, ..config() };
    changed.cylinders.insert("B1".to_owned(), Rig { name: "moved.toml".to_owned(), ..Rig::paper() });
    changed.cylinders.get_mut("edited").unwrap().cylinder.stroke_m *= 1.1;
    let mut events = Vec::new();
    watch.reload(changed.clone(), &mut events);
    let said: Vec<_> = events
        .iter()
        .map(|event| match event {
            Event::Notice(notice) => (notice.cylinder.as_str(), notice.kind.as_str()),
            other => panic!("{other:?}"),
        })
        .collect();
    assert_eq!(said, [("T7/B2", "reload"), ("edited", "reload")]);
    assert_eq!(watch.names().collect::<Vec<_>>(), ["B1"]);
    save(folder.path(), &mut watch);
    assert!(files(folder.path()) == before);
    let aside = || std::fs::read(folder.path().join("cylinders/edited.state.aside")).unwrap();
    assert_eq!(aside(), before["edited.state"]);
    // It comes back, and goes on where it was.
    changed.rig = Some(Rig::paper());
    watch.reload(changed, &mut events);
    let notices = Checkpoint::new(folder.path()).unwrap().restore(&mut watch).unwrap();
    assert_eq!(watch.names().collect::<Vec<_>>(), ["B1", "T7/B2"]);
    // Its own file still is of the rig that it had.
    assert_eq!(notices.iter().map(|notice| notice.cylinder.as_str()).collect::<Vec<_>>(), ["edited"]);
    take(&mut watch, "T7/B2", &rows(2.0));
    save(folder.path(), &mut watch);
    let (mut plain, other) = (Watch::new(config(), None), tempfile::tempdir().unwrap());
    [0.0, 1.0, 2.0].iter().for_each(|t_s| _ = take(&mut plain, "T7/B2", &rows(*t_s)));
    save(other.path(), &mut plain);
    assert!(files(folder.path())["T7%2FB2.state"] == files(other.path())["T7%2FB2.state"]);
}

#[test]
fn what_begins_anew_is_written_with_what_it_was() {
    let folder = folder_of(&["edited"]);
    let (mut watch, _) = restored(folder.path(), config());
    let before = files(folder.path());
    let mut changed = config();
    changed.cylinders.get_mut("edited").unwrap().cylinder.stroke_m *= 1.1;
    watch.reload(changed.clone(), &mut Vec::new());
    take(&mut watch, "edited", &rows(2.0));
    save(folder.path(), &mut watch);
    assert_eq!(files(folder.path())["edited.state"], watch.states().unwrap()["edited"]);
    let aside = std::fs::read(folder.path().join("cylinders/edited.state.aside")).unwrap();
    assert_eq!(aside, before["edited.state"]);
}

fn row() -> impl Strategy<Value = (f64, [f64; 5], bool)> {
    let step_s = prop_oneof![
        20 => Just(0.01),
        2 => prop::sample::select(vec![1e-12, 0.3, 100.0, 1e6, 1e10, 1e300, -0.01, -70.0, -1e9, -1e300]),
        1 => any::<f64>(),
    ];
    let sound = (0.0..200.0, 0.0..100.0, 0.0..100.0, -5.0..5.0, -5.0..5.0);
    let readings = prop_oneof![
        20 => sound.prop_map(|(x, pa, pb, qa, qb)| [x, pa, pb, qa, qb]),
        2 => prop::array::uniform5(prop::sample::select(vec![0.0, 20.0, 1e9, -1e300, 1e-300, f64::NAN])),
        1 => prop::array::uniform5(any::<f64>()),
    ];
    (step_s, readings, prop::bool::weighted(0.05))
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, ..ProptestConfig::default() })]

    /// Nothing that comes in makes a state that nothing can go on from.
    #[test]
    fn whatever_was_saved_restores(
        rows in prop::collection::vec(row(), 1..600),
        interval_s in prop::sample::select(vec![1e-3, 1.0, 3600.0]),
        every in 30..300_usize,
    ) {
        let config = LiveConfig { interval_s, ..config() };
        let (mut watch, mut events, mut t_s) = (Watch::new(config.clone(), None), Vec::new(), 0.0);
        let folder = tempfile::tempdir().unwrap();
        let checkpoint = Checkpoint::new(folder.path()).unwrap();
        for (index, (step_s, [x, pa, pb, qa, qb], resent)) in rows.into_iter().enumerate() {
            let next_s = t_s + step_s;
            let payload = format!("{HEADER}{next_s:?},{x:?},{pa:?},{pb:?},{qa:?},{qb:?}\n");
            let (format, payload) = (BatchFormat::Csv, payload.as_bytes());
            watch.take_batch(&Batch { cylinder: "B1", format, payload, resent }, &mut events);
            t_s = if next_s.abs() < 2e11 { next_s } else { t_s };
            if index % every == 0 {
                checkpoint.save(&Snapshot::of(&mut watch)).unwrap();
            }
        }
        checkpoint.save(&Snapshot::of(&mut watch)).unwrap();
        drop(checkpoint);
        let (mut next, notices) = restored(folder.path(), config);
        prop_assert_eq!(notices, []);
        prop_assert!(watch.states().unwrap() == next.states().unwrap());
        let last = format!("{t_s:?},100,80,30,0,0\n");
        take(&mut watch, "B1", &last);
        take(&mut next, "B1", &last);
        prop_assert!(watch.states().unwrap() == next.states().unwrap());
    }
}

#[test]
fn a_line_that_is_late_is_left_out_however_many_there_are() {
    let lines = |t_s| rows(t_s).lines().map(str::to_owned).collect::<Vec<_>>();
    let mut watch = Watch::new(config(), Some(LineFormat::Csv));
    let mut events = Vec::new();
    watch.take(HEADER.as_bytes(), &mut events);
    let all = [lines(0.0), lines(1.0), lines(2.0)].concat();
    all.iter().for_each(|line| watch.take(line.as_bytes(), &mut events));
    // As whoever sends what is not known to have come.
    all.iter().for_each(|line| watch.take(line.as_bytes(), &mut events));
    lines(3.0).iter().for_each(|line| watch.take(line.as_bytes(), &mut events));
    watch.finish(&mut events);
    let estimates = |events: Vec<Event>| {
        events.into_iter().filter(|event| matches!(event, Event::Estimate(_))).collect::<Vec<_>>()
    };
    assert_eq!(count(&events, "late"), 300);
    let mut plain = Watch::new(config(), Some(LineFormat::Csv));
    let mut once = Vec::new();
    plain.take(HEADER.as_bytes(), &mut once);
    [all, lines(3.0)].concat().iter().for_each(|line| plain.take(line.as_bytes(), &mut once));
    plain.finish(&mut once);
    assert_eq!(estimates(events), estimates(once));
}

#[test]
fn two_with_one_state_are_one_too_many() {
    let folder = tempfile::tempdir().unwrap();
    let first = Checkpoint::new(folder.path()).unwrap();
    assert!(Checkpoint::new(folder.path()).is_err());
    drop(first);
    Checkpoint::new(folder.path()).unwrap();
}

/// What a packed state holds.
fn tree(packed: &[u8]) -> Value {
    ciborium::from_reader(GzDecoder::new(packed)).unwrap()
}

/// Whether a cylinder goes on from this.
fn restores(tree: &Value) -> bool {
    let folder = tempfile::tempdir().unwrap();
    std::fs::create_dir(folder.path().join("cylinders")).unwrap();
    let (mut bytes, mut packed) = (Vec::new(), Vec::new());
    ciborium::into_writer(tree, &mut bytes).unwrap();
    GzEncoder::new(bytes.as_slice(), Compression::fast()).read_to_end(&mut packed).unwrap();
    std::fs::write(folder.path().join("cylinders/B1.state"), packed).unwrap();
    restored(folder.path(), config()).1.is_empty()
}

fn floats(value: &mut Value) -> Vec<&mut f64> {
    match value {
        Value::Array(values) => values.iter_mut().flat_map(floats).collect(),
        Value::Map(entries) => entries.iter_mut().flat_map(|(_, value)| floats(value)).collect(),
        Value::Float(number) => vec![number],
        _ => Vec::new(),
    }
}

fn set_alarms(value: &mut Value) {
    let Some(entries) = value.as_map_mut() else {
        return value.as_array_mut().into_iter().flatten().for_each(set_alarms);
    };
    for (key, value) in entries {
        match key.as_text() {
            Some("alarms") => *value = 1_000_000.into(),
            _ => set_alarms(value),
        }
    }
}

/// The checksum finds damage; what is left is a writer that went wrong.
#[test]
fn a_state_with_a_number_that_is_none_or_of_another_cylinder_is_put_aside() {
    let folder = tempfile::tempdir().unwrap();
    let mut watch = Watch::new(config(), None);
    (0..5).for_each(|s| _ = take(&mut watch, "B1", &rows(f64::from(s))));
    save(folder.path(), &mut watch);
    let saved = tree(&files(folder.path())["B1.state"]);
    assert!(restores(&saved));
    for number in [f64::NAN, f64::INFINITY, -1e300] {
        let count = floats(&mut saved.clone()).len();
        assert!(count > 10, "{count} numbers");
        for which in 0..count {
            let mut forged = saved.clone();
            *floats(&mut forged)[which] = number;
            assert!(!restores(&forged), "number {which} is {number}");
        }
    }
    let mut counts = saved.clone();
    set_alarms(&mut counts);
    assert!(!restores(&counts), "more alarms than estimates");
    let mut renamed = saved;
    renamed.as_array_mut().unwrap()[1] = Value::Text("B2".to_owned());
    assert!(!restores(&renamed), "of another cylinder");
}
