//! A saved estimator goes on as it was, or is refused: nothing in between.

#![allow(clippy::unwrap_used)]

use pitchleak::Rig;
use pitchleak::core::PerLeak;
use pitchleak::replay::{RestoreError, Stream};
use pitchleak::trace::{BadRows, TraceReader};
use pitchleak_testkit::Motion;
use pitchleak_testkit::rig::with_sensors_of;
use pitchleak_testkit::trace_text::file;
use pitchleak_view::Text;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

fn part(range: std::ops::Range<usize>) -> String {
    let motion = Motion::sines(PerLeak { internal: 1.2e-11, external_a: 0.0, external_b: 0.0 });
    file(&motion.rows(range.end as u32)[range])
}

fn extend(stream: &mut Stream, text: String) {
    let rig = stream.rig().clone();
    let reader =
        TraceReader::from_stream("t", Box::new(std::io::Cursor::new(text.into_bytes())), &rig).unwrap();
    stream.extend(reader).unwrap();
}

/// Every estimator there is, with and without effects, part of a trace taken in.
fn streams() -> Vec<Stream> {
    let plain = with_sensors_of("1 %");
    let declared = |bias, gain| {
        plain.replace("bias = \"0 %\", gain = \"0 %\"", &format!("bias = {bias}, gain = {gain}"))
    };
    let (offsets, gains) = (declared(0.001, 0.0), declared(0.001, 0.002));
    let effects = plain.clone() + "[effects]\nposition_gain = { value = 0.01, std = 0.002 }\n";
    let paper = plain.clone() + "[estimator]\nkind = \"paper\"\n";
    let stream = |text: &String| {
        let mut stream = Stream::new(&Rig::parse(text, "rig.toml").unwrap(), BadRows::Skip).unwrap();
        extend(&mut stream, part(0..1500));
        stream
    };
    [plain, offsets, gains, effects, paper].iter().map(stream).collect()
}

/// Saved and restored at every stage of a block and of a half-done renewal it ends where it would have ended.
#[test]
fn interrupted_anywhere_it_goes_on_to_the_last_bit() {
    for mut whole in streams() {
        let mut interrupted = Stream::restore(&whole.save().unwrap()).unwrap();
        extend(&mut whole, part(1500..1920));
        // Blocks have 25 samples: sevens come by all their moments.
        for begin in (1500..1920).step_by(7) {
            extend(&mut interrupted, part(begin..begin + 7));
            interrupted = Stream::restore(&interrupted.save().unwrap()).unwrap();
        }
        assert!(interrupted.save().unwrap() == whole.save().unwrap(), "{:?}", whole.rig().name);
    }
}

/// A version is told as it is written; other bytes are not printed.
#[test]
fn another_version_is_named_and_what_is_none_is_not() {
    let mut state = streams()[0].save().unwrap();
    let version = b"\x72pitchleak.state/".len();
    state[version] = b'0';
    assert!(
        matches!(Stream::restore(&state), Err(RestoreError::Version(name)) if name == "pitchleak.state/06")
    );
    state[version] = b'\x1b';
    assert!(matches!(Stream::restore(&state), Err(RestoreError::Content(_))));
}

/// Of 6000, 782 were once read as other numbers.
#[test]
fn no_single_wrong_bit_is_read() {
    let mut random = ChaCha8Rng::seed_from_u64(1);
    for stream in streams() {
        let saved = stream.save().unwrap();
        assert!(Stream::restore(&saved).is_ok());
        for _ in 0..1200 {
            let mut bytes = saved.clone();
            let (at, bit) = (random.random_range(0..bytes.len()), random.random_range(0..8));
            bytes[at] ^= 1 << bit;
            assert!(Stream::restore(&bytes).is_err(), "bit {bit} of byte {at} of {}", bytes.len());
        }
    }
}

#[test]
fn nothing_missing_and_nothing_more_is_read() {
    for stream in streams() {
        let saved = stream.save().unwrap();
        for length in [0, 1, 17, 18, 19, 22, saved.len() / 2, saved.len() - 1] {
            assert!(Stream::restore(&saved[..length]).is_err(), "{length} bytes");
        }
        assert!(matches!(Stream::restore(&[&saved[..], b"\0"].concat()), Err(RestoreError::Checksum)));
        assert!(matches!(Stream::restore(&[&saved[..], &saved[..]].concat()), Err(RestoreError::Checksum)));
        let older = [b"\x71pitchleak.state/3", &saved[19..]].concat();
        assert!(
            matches!(Stream::restore(&older), Err(RestoreError::Version(version)) if version.ends_with('3'))
        );
    }
}

#[test]
fn a_state_of_another_rig_is_refused() {
    let streams = streams();
    let saved: Vec<_> = streams.iter().map(|stream| stream.save().unwrap()).collect();
    for (own, bytes) in saved.iter().enumerate() {
        for (other, stream) in streams.iter().enumerate() {
            assert_eq!(Stream::restore_for(bytes, stream.rig()).is_ok(), own == other, "{own} for {other}");
        }
    }
    let renamed = Rig { name: "moved.toml".to_owned(), ..streams[0].rig().clone() };
    assert!(Stream::restore_for(&saved[0], &renamed).is_ok(), "a file may move");
}

/// A number that was changed with its checksum put right gives no panic and no NaN.
#[test]
fn forged_numbers_lead_to_no_nan() {
    let mut random = ChaCha8Rng::seed_from_u64(2);
    let (mut taken, mut tried) = (0, 0);
    for stream in streams() {
        let saved = stream.save().unwrap();
        for _ in 0..200 {
            let mut bytes = saved[..saved.len() - 4].to_vec();
            let (at, bit) = (random.random_range(19..bytes.len()), random.random_range(0..8));
            bytes[at] ^= 1 << bit;
            let mut crc = flate2::Crc::new();
            crc.update(&bytes);
            bytes.extend(crc.sum().to_le_bytes());
            tried += 1;
            let Ok(mut forged) = Stream::restore(&bytes) else { continue };
            taken += 1;
            extend(&mut forged, part(1500..1800));
            let report = forged.report("t").unwrap();
            let text = report.to_text(&pitchleak_view::Palette::PLAIN);
            assert!(!text.contains("NaN") && !text.contains("inf"), "bit {bit} of byte {at}: {text}");
        }
    }
    assert!(taken > 0 && taken < tried);
}

/// The state as a tree, changed and sealed again.
fn forged(saved: &[u8], change: impl Fn(&mut ciborium::Value)) -> Vec<u8> {
    let mut value: ciborium::Value = ciborium::from_reader(&saved[19..saved.len() - 4]).unwrap();
    change(&mut value);
    let mut bytes = saved[..19].to_vec();
    ciborium::into_writer(&value, &mut bytes).unwrap();
    sealed(bytes)
}

fn sealed(mut bytes: Vec<u8>) -> Vec<u8> {
    let mut crc = flate2::Crc::new();
    crc.update(&bytes);
    bytes.extend(crc.sum().to_le_bytes());
    bytes
}

/// Every value of a tree.
fn each(value: &mut ciborium::Value, visit: &mut impl FnMut(&mut ciborium::Value)) {
    visit(value);
    match value {
        ciborium::Value::Array(values) => values.iter_mut().for_each(|value| each(value, visit)),
        ciborium::Value::Map(entries) => entries.iter_mut().for_each(|(_, value)| each(value, visit)),
        _ => {}
    }
}

/// The rig's text, with `from` become `to`.
fn in_rig_text(value: &mut ciborium::Value, from: &str, to: &str) {
    each(value, &mut |value| {
        if let ciborium::Value::Text(text) = value {
            *text = text.replace(from, to);
        }
    });
}

#[test]
fn parts_that_do_not_fit_each_other_are_refused() {
    let saved = streams()[0].save().unwrap();
    assert!(Stream::restore(&forged(&saved, |_| ())).is_ok(), "unchanged");
    let floats = std::cell::Cell::new(0);
    each(
        &mut ciborium::from_reader(&saved[19..saved.len() - 4]).unwrap(),
        &mut |value: &mut ciborium::Value| {
            floats.set(floats.get() + usize::from(value.is_float()));
        },
    );
    assert!(floats.get() > 100);
    for nan in (0..floats.get()).step_by(17) {
        let bytes = forged(&saved, |value| {
            let mut seen = 0;
            each(value, &mut |value| {
                if value.is_float() {
                    if seen == nan {
                        *value = ciborium::Value::Float(f64::NAN);
                    }
                    seen += 1;
                }
            });
        });
        assert!(Stream::restore(&bytes).is_err(), "NaN for number {nan}");
    }
    let effect = "[effects]\nposition_gain = { value = 0.01, std = 0.002 }\n\n[alarms]";
    for (from, to) in [
        ("kind = \"rls\"", "kind = \"paper\""),
        ("stroke = \"0.2 m\"", "stroke = \"0.3 m\""),
        ("[alarms]", effect),
    ] {
        let bytes = forged(&saved, |value| in_rig_text(value, from, to));
        assert_ne!(bytes, saved);
        assert!(Stream::restore(&bytes).is_err(), "{to}");
    }
    let doubled = sealed([&saved[..saved.len() - 4], &[0]].concat());
    assert!(matches!(Stream::restore(&doubled), Err(RestoreError::Content(_))), "something after the end");
}

/// A channel that repeats more readings than it has.
#[test]
fn counts_that_contradict_each_other_are_refused() {
    let saved = streams()[0].save().unwrap();
    for name in ["in_long_runs", "repeats"] {
        let bytes = forged(&saved, |value| {
            each(value, &mut |value| {
                for (key, count) in value.as_map_mut().into_iter().flatten() {
                    if key.as_text() == Some(name) {
                        *count = 1_000_000.into();
                    }
                }
            });
        });
        assert_ne!(bytes, saved, "{name}");
        assert!(Stream::restore(&bytes).is_err(), "{name}");
    }
}
