//! The committed header is the one that the sources give; `PITCHLEAK_WRITE_HEADER=1` puts it there.

use std::path::Path;

#[test]
fn the_header_is_that_of_the_sources() {
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    let config = cbindgen::Config::from_file(here.join("cbindgen.toml")).unwrap();
    // From the file and its modules: from the crate it would run cargo.
    let sources = cbindgen::Builder::new().with_config(config).with_src(here.join("src/lib.rs"));
    let mut header = Vec::new();
    sources.generate().unwrap().write(&mut header);
    let header = String::from_utf8(header).unwrap();
    let path = here.join("include/pitchleak.h");
    if std::env::var_os("PITCHLEAK_WRITE_HEADER").is_some() {
        std::fs::write(path, header).unwrap();
    } else {
        assert!(std::fs::read_to_string(path).unwrap() == header, "write it anew and read the difference");
    }
}
