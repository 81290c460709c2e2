//! Any bytes as the elements of a MAT file, as they are and compressed.

use super::replay_bytes;
use flate2::Compression;
use flate2::write::ZlibEncoder;
use pitchleak::Rig;
use std::io::Write;

/// Text, version 5, little-endian.
const HEAD: usize = 128;
const COMPRESSED: u32 = 15;

pub fn enter(bytes: &[u8]) {
    let (rig, elements) = (Rig::paper(), bytes.get(HEAD..).unwrap_or(bytes));
    let mut plain = [b"MATLAB 5.0 MAT-file".as_slice(), &[b' '; HEAD - 23], b"\0\x01IM"].concat();
    let mut packed = plain.clone();
    plain.extend(elements);
    replay_bytes(&plain, &rig);
    let mut encoder = ZlibEncoder::new(Vec::new(), Compression::fast());
    let inner = encoder.write_all(elements).and_then(|()| encoder.finish()).expect("packs");
    packed.extend(COMPRESSED.to_le_bytes());
    packed.extend((inner.len() as u32).to_le_bytes());
    packed.extend(inner);
    replay_bytes(&packed, &rig);
    // With a head of its own: the other byte order, another version.
    if bytes.starts_with(b"MATL") {
        replay_bytes(bytes, &rig);
    }
}
