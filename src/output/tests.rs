use super::fault::{Fault, plan};
use super::*;
use std::io::Read;
use std::sync::atomic::{AtomicU32, Ordering};

/// A folder that goes with the test.
struct Folder(PathBuf);

impl Folder {
    fn new() -> Self {
        static COUNT: AtomicU32 = AtomicU32::new(0);
        let count = COUNT.fetch_add(1, Ordering::Relaxed);
        let path = std::env::temp_dir().join(format!("pitchleak-output-{}-{count}", std::process::id()));
        fs::create_dir_all(&path).expect("a folder");
        Self(path)
    }

    fn names(&self) -> Vec<String> {
        let entries = fs::read_dir(&self.0).expect("reads").map(|entry| entry.expect("an entry").file_name());
        let mut names: Vec<_> = entries.map(|name| name.to_string_lossy().into_owned()).collect();
        names.sort();
        names
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.0);
    }
}

fn text(path: &Path) -> String {
    let mut bytes = fs::read(path).expect("reads");
    if path.extension().is_some_and(|extension| extension == "gz") && bytes.starts_with(b"\x1f\x8b") {
        let mut plain = Vec::new();
        flate2::read::GzDecoder::new(&bytes[..]).read_to_end(&mut plain).expect("whole gzip");
        bytes = plain;
    }
    String::from_utf8(bytes).expect("text")
}

/// More than any buffer holds, so that many writes reach the disk.
fn long_text() -> String {
    (0..40_000).map(|k| format!("{},{}\n", k, k * k % 9973)).collect()
}

fn write_in_lines(path: &Path, content: &str) -> Result<(), OutputError> {
    let mut file = OutputFile::create(path, &Inputs::default())?;
    for line in content.lines() {
        writeln!(file, "{line}").map_err(|source| file.error(source))?;
    }
    file.finish()
}

/// SQLite's habit: the first operation fails, then the second, … until nothing does. Before, the old file is there;
/// after, the new one; never another, and no temporary.
#[test]
fn whatever_fails_the_old_file_or_the_new_one_is_there() {
    let content = long_text();
    for name in ["out.csv", "out.csv.gz"] {
        let folder = Folder::new();
        let path = folder.0.join(name);
        for kind in [ErrorKind::StorageFull, ErrorKind::Other, ErrorKind::PermissionDenied] {
            let mut failures = 0;
            loop {
                fs::write(&path, "old").expect("writes");
                plan(Some((failures, Fault::Fails(kind))));
                let done = write_in_lines(&path, &content);
                plan(None);
                assert_eq!(folder.names(), [name], "operation {failures} fails");
                let found = text(&path);
                match done {
                    Ok(()) => {
                        assert_eq!(found, content);
                        break;
                    }
                    Err(OutputError::Write { source, .. }) if source.kind() == kind => {
                        assert!(found == "old" || found == content, "operation {failures} fails");
                    }
                    Err(other) => panic!("{other}"),
                }
                failures += 1;
            }
            assert!(failures > 5, "{failures} operations could fail");
        }
    }
}

#[test]
fn short_and_interrupted_writes_lose_nothing() {
    let folder = Folder::new();
    let path = folder.0.join("out.csv");
    for before in 2..40 {
        plan(Some((before, Fault::Hampered)));
        let done = write_in_lines(&path, &"0.1,2\n".repeat(100));
        plan(None);
        done.expect("written");
        assert_eq!(text(&path), "0.1,2\n".repeat(100));
    }
}

/// The end of a compressed file was once given up where a signal came within it.
#[test]
fn an_interrupted_write_of_a_compressed_file_is_tried_again() {
    let folder = Folder::new();
    let path = folder.0.join("out.csv.gz");
    // More than a buffer when compressed, and less than zlib hands on before the end.
    let sign =
        |k: u32| if k % 60 == 59 { '\n' } else { char::from(33 + (k.wrapping_pow(3) % 9973 % 94) as u8) };
    let content: String = (0..12_000_u32).map(sign).collect();
    for before in [2, 3, 100, 500] {
        plan(Some((before, Fault::Hampered)));
        let done = write_in_lines(&path, &content);
        plan(None);
        done.expect("written");
        assert_eq!(text(&path), content);
    }
}

#[test]
fn without_finish_nothing_is_written() {
    let folder = Folder::new();
    let path = folder.0.join("out.csv");
    let mut file = OutputFile::create(&path, &Inputs::default()).expect("created");
    writeln!(file, "half").expect("written");
    drop(file);
    assert_eq!(folder.names(), [""; 0]);
}

#[test]
fn many_threads_to_one_file_leave_one_of_theirs() {
    let folder = Folder::new();
    let path = folder.0.join("state");
    std::thread::scope(|threads| {
        for number in 0..8 {
            let path = &path;
            threads.spawn(move || {
                for _ in 0..20 {
                    write(path, format!("{number}").repeat(50_000), &Inputs::default()).expect("written");
                }
            });
        }
    });
    let found = text(&path);
    assert_eq!(found, found[..1].repeat(50_000));
    assert_eq!(folder.names(), ["state"]);
}

#[cfg(unix)]
#[test]
fn an_input_is_known_behind_any_name() {
    use std::os::unix::fs::symlink;
    let folder = Folder::new();
    let [input, link, hard] = ["input.csv", "link.csv", "hard.csv"].map(|name| folder.0.join(name));
    fs::write(&input, "precious").expect("writes");
    symlink(&input, &link).expect("links");
    fs::hard_link(&input, &hard).expect("links");
    let inputs = Inputs::of([&input, &folder.0.join("absent"), Path::new("-")]);
    let roundabout = folder.0.join("..").join(folder.0.file_name().expect("a name")).join("input.csv");
    for path in [&input, &link, &hard, &roundabout] {
        let refused = write(path, "other", &inputs).expect_err("an input");
        assert!(matches!(refused, OutputError::OverInput { .. }), "{refused}");
    }
    assert_eq!(text(&input), "precious");
}

#[cfg(unix)]
#[test]
fn links_permissions_and_devices_stay_what_they_are() {
    use std::os::unix::fs::{PermissionsExt, symlink};
    let folder = Folder::new();
    let [target, link] = ["target.csv", "link.csv"].map(|name| folder.0.join(name));
    fs::write(&target, "old").expect("writes");
    fs::set_permissions(&target, fs::Permissions::from_mode(0o640)).expect("sets");
    symlink(&target, &link).expect("links");
    write(&link, "new", &Inputs::default()).expect("written");
    assert_eq!(text(&target), "new");
    assert!(fs::symlink_metadata(&link).expect("there").is_symlink());
    assert_eq!(fs::metadata(&target).expect("there").permissions().mode() & 0o777, 0o640);
    write("/dev/null", "nothing", &Inputs::default()).expect("written");
    assert!(!fs::metadata("/dev/null").expect("there").is_file());
}

#[test]
fn what_cannot_be_written_is_found_before_anything_is() {
    let folder = Folder::new();
    for path in [folder.0.clone(), folder.0.join("absent").join("out.csv")] {
        let refused = OutputFile::create(&path, &Inputs::default()).err().expect("no file");
        assert!(refused.to_string().starts_with(&format!("cannot write {}", path.display())), "{refused}");
    }
    fs::write(folder.0.join("file"), "").expect("writes");
    assert!(make_folder(&folder.0.join("file").join("figures")).is_err());
    make_folder(&folder.0.join("deep").join("figures")).expect("made");
    assert_eq!(folder.names(), ["deep", "file"]);
}
