use super::Written;
use crate::Rig;
use crate::read::{Record, TraceError, TraceReader};
use flate2::Compression;
use flate2::write::ZlibEncoder;
use std::io::{Cursor, Write};

const CLASS_DOUBLE: u32 = 6;
const CLASS_STRUCT: u32 = 2;

/// Writes elements of either byte order.
struct Writer {
    bytes: Vec<u8>,
    big_endian: bool,
}

impl Writer {
    fn word(&mut self, word: u32) {
        let bytes = if self.big_endian { word.to_be_bytes() } else { word.to_le_bytes() };
        self.bytes.extend(bytes);
    }

    fn element(&mut self, kind: u32, data: &[u8]) {
        self.word(kind);
        self.word(data.len() as u32);
        self.bytes.extend(data);
        self.bytes.resize(self.bytes.len().next_multiple_of(8), 0);
    }

    /// Its inside alone.
    fn variable(&mut self, class: u32, name: &str, kind: u32, data: &[u8], count: usize) {
        self.word(6);
        self.word(8);
        self.word(class);
        self.word(0);
        self.word(5);
        self.word(8);
        self.word(count as u32);
        self.word(1);
        self.element(1, name.as_bytes());
        self.element(kind, data);
    }
}

fn header(big_endian: bool) -> Vec<u8> {
    let mut bytes = b"MATLAB 5.0 MAT-file, by a test".to_vec();
    bytes.resize(124, b' ');
    bytes.extend(if big_endian { [1, 0] } else { [0, 1] });
    bytes.extend(if big_endian { b"MI" } else { b"IM" });
    bytes
}

const NAMES: [&str; 6] = ["t_s", "x_mm", "pa_bar", "pb_bar", "qa_lpm", "qb_lpm"];

fn signals(row: usize) -> [f64; 6] {
    let i = row as f64;
    [0.01 * i, 100.0 + i, 50.0, 40.0, 6.5, -3.5]
}

fn file(big_endian: bool, compressed: bool, class: u32, rows: usize) -> Vec<u8> {
    let mut bytes = header(big_endian);
    for (column, name) in NAMES.iter().enumerate() {
        let values = (0..rows).map(|row| signals(row)[column]);
        let data: Vec<u8> = values
            .flat_map(|value| if big_endian { value.to_be_bytes() } else { value.to_le_bytes() })
            .collect();
        let mut inside = Writer { bytes: Vec::new(), big_endian };
        inside.variable(class, name, 9, &data, rows);
        let mut whole = Writer { bytes: Vec::new(), big_endian };
        whole.word(14);
        whole.word(inside.bytes.len() as u32);
        whole.bytes.extend(inside.bytes);
        if compressed {
            let mut encoder = ZlibEncoder::new(Vec::new(), Compression::default());
            encoder.write_all(&whole.bytes).unwrap();
            let packed = encoder.finish().unwrap();
            whole = Writer { bytes: Vec::new(), big_endian };
            whole.word(15);
            whole.word(packed.len() as u32);
            whole.bytes.extend(packed);
        }
        bytes.extend(whole.bytes);
    }
    bytes
}

fn read(bytes: Vec<u8>) -> Result<Vec<Record>, TraceError> {
    let mut reader = TraceReader::from_stream("trace.mat", Box::new(Cursor::new(bytes)), &Rig::paper())?;
    let (mut records, mut record) = (Vec::new(), Record::default());
    while reader.next_record(&mut record)? {
        records.push(record);
    }
    Ok(records)
}

#[test]
fn vectors_are_the_columns_of_a_trace() {
    for (big_endian, compressed) in [(false, false), (false, true), (true, false), (true, true)] {
        let records = read(file(big_endian, compressed, CLASS_DOUBLE, 50)).unwrap();
        assert_eq!(records.len(), 50);
        let last = &records[49];
        assert_eq!((last.t_s, last.sample.pa_pa, last.sample.qb_m3s), (0.49, 5e6, Some(-3.5 / 60_000.0)));
    }
}

#[test]
fn small_numbers_are_of_any_type() {
    let mut bytes = header(false);
    let t: Vec<u8> = (0..20_i16).flat_map(|i| (10 * i).to_le_bytes()).collect();
    let x: Vec<u8> = (0..20_u8).collect();
    let p: Vec<u8> = (0..20).flat_map(|_| 50.5_f32.to_le_bytes()).collect();
    for (name, kind, data) in [("t_ms", 3, t), ("x_mm", 2, x), ("pa_bar", 7, p.clone()), ("pb_bar", 7, p)] {
        let mut inside = Writer { bytes: Vec::new(), big_endian: false };
        inside.variable(CLASS_DOUBLE, name, kind, &data, 20);
        let mut tag = Writer { bytes: Vec::new(), big_endian: false };
        tag.word(14);
        tag.word(inside.bytes.len() as u32);
        bytes.extend(tag.bytes);
        bytes.extend(inside.bytes);
    }
    let records = read(bytes).unwrap();
    assert_eq!(
        (records[19].t_s, records[19].sample.x_m, records[19].sample.pa_pa),
        (0.19, 0.019, 5_050_000.0)
    );
}

/// Vectors of several types, compact, contiguous and in compressed chunks, beside a struct and a text.
const VERSION_7_3: &[u8] = include_bytes!("../../../../../fuzz/seeds/mat/version-7.3.mat");

#[test]
fn version_7_3_is_read() {
    let records = read(VERSION_7_3.to_vec()).unwrap();
    assert_eq!(records, read(file(false, false, CLASS_DOUBLE, 50)).unwrap());
    let without = |name: &str| {
        let mut bytes = VERSION_7_3.to_vec();
        let at = bytes.windows(name.len()).position(|part| part == name.as_bytes()).unwrap();
        bytes[at] = b'z';
        read(bytes).unwrap_err().to_string()
    };
    let text = without("x_mm");
    assert!(text.contains("variable `data` is a struct") && text.contains("-struct"), "{text}");
}

#[test]
fn damage_to_version_7_3_is_one_line() {
    for length in [128, 512, 520, 600, VERSION_7_3.len() / 2, VERSION_7_3.len() - 1] {
        let message = read(VERSION_7_3[..length].to_vec()).unwrap_err().to_string();
        assert!(message.contains("damaged") && !message.contains('\n'), "{length}: {message}");
    }
    let superblock = |version: u8| {
        let mut bytes = VERSION_7_3.to_vec();
        bytes[520] = version;
        read(bytes).unwrap_err().to_string()
    };
    assert!(superblock(2).contains("in a form of HDF5 that is not read"), "{}", superblock(2));
}

/// A group of which each of 4000 entries points at the same 4000 members: a file of 200 kB, 16 million names.
#[test]
fn what_is_pointed_at_by_many_takes_no_more_than_the_file() {
    const MANY: u16 = 4000;
    let mut bytes = VERSION_7_3.to_vec();
    let find = |what: &[u8]| VERSION_7_3.windows(what.len()).position(|part| part == what).unwrap();
    let (tree, first_member) = (find(b"TREE"), find(b"SNOD") + 8);
    let address = |at: usize| ((at - 512) as u64).to_le_bytes();
    let members = bytes.len();
    bytes.extend([b"SNOD".as_slice(), &[1, 0], &MANY.to_le_bytes()].concat());
    bytes.extend(VERSION_7_3[first_member..first_member + 40].repeat(usize::from(MANY)));
    let entries = bytes.len();
    bytes.extend([&VERSION_7_3[tree..tree + 6], &MANY.to_le_bytes(), &[0xff; 16]].concat());
    bytes.extend([[0; 8], address(members)].concat().repeat(usize::from(MANY)));
    let (before, after) = (address(tree), address(entries));
    for at in 512..members - 8 {
        if bytes[at..at + 8] == before {
            bytes[at..at + 8].copy_from_slice(&after);
        }
    }
    let message = read(bytes).unwrap_err().to_string();
    assert!(message.contains("contradicts itself"), "{message}");
}

/// Chunks of a gigabyte each, of which sixteen numbers are needed: four of them are not unpacked for fifty numbers.
#[test]
fn chunks_that_unpack_to_more_than_a_gigabyte_are_refused() {
    let mut bytes = VERSION_7_3.to_vec();
    // Sides of the first array's chunks: one by sixteen numbers of eight bytes.
    let sides = [1_u32, 16, 8].map(u32::to_le_bytes).concat();
    let at = bytes.windows(sides.len()).position(|part| part == sides).unwrap();
    bytes[at..at + 4].copy_from_slice(&(1_u32 << 23).to_le_bytes());
    let message = read(bytes).unwrap_err().to_string();
    assert!(message.contains("more than a gigabyte"), "{message}");
}

proptest::proptest! {
    #[test]
    fn any_byte_of_version_7_3_may_be_wrong(at in 512..100_000_usize, byte in 0..=255_u8) {
        let mut bytes = VERSION_7_3.to_vec();
        let at = at % bytes.len();
        bytes[at] = byte;
        if let Err(error) = read(bytes) {
            proptest::prop_assert!(!error.to_string().contains('\n'));
        }
    }
}

#[test]
fn what_is_not_read_is_refused_by_name() {
    let message = |bytes| read(bytes).unwrap_err().to_string();
    let text = message(file(false, false, CLASS_STRUCT, 50));
    assert!(text.contains("variable `t_s` is a struct") && text.contains("-struct"), "{text}");
    assert!(message(b"\x89HDF\r\n\x1a\n".to_vec()).contains("HDF5"));
    assert!(message(b"PK\x03\x04....".to_vec()).contains("Excel"));
    assert!(message(b"\x28\xb5\x2f\xfd....".to_vec()).contains("compressed by zstd"));
    assert!(message(b"TDSm....".to_vec()).contains("TDMS"));
}

#[test]
fn damage_is_one_line_and_costs_no_memory() {
    let whole = file(false, true, CLASS_DOUBLE, 50);
    for length in [0, 4, 100, 128, 130, 136, 140, 200, whole.len() - 1] {
        let message = read(whole[..length].to_vec()).unwrap_err().to_string();
        assert!(!message.contains('\n'), "{message}");
    }
    let mut broken_name = file(false, false, CLASS_STRUCT, 50);
    let at = broken_name.windows(3).position(|bytes| bytes == b"t_s").unwrap();
    broken_name[at + 1] = b'\n';
    let message = read(broken_name).unwrap_err().to_string();
    assert!(message.contains("variable `t\\ns` is a struct") && !message.contains('\n'), "{message}");
    let mut broken_unit = file(false, false, CLASS_DOUBLE, 50);
    let at = broken_unit.windows(6).position(|bytes| bytes == b"pa_bar").unwrap();
    broken_unit[at + 3] = b'\n';
    let message = read(broken_unit).unwrap_err().to_string();
    assert!(message.contains("unknown unit `\\nar`") && !message.contains('\n'), "{message}");
    let mut huge = file(false, false, CLASS_DOUBLE, 50);
    // The count of the first variable, and the size of its data.
    let at = huge.windows(4).position(|bytes| bytes == 50_u32.to_le_bytes()).unwrap();
    huge[at..at + 4].copy_from_slice(&u32::MAX.to_le_bytes());
    assert!(read(huge).unwrap_err().to_string().contains("damaged"));
}

/// Data beside their tag are four bytes at most: more once took the variables after them away.
#[test]
fn more_beside_a_tag_than_it_has_room_for_is_damage() {
    let mut inside = Writer { bytes: Vec::new(), big_endian: false };
    inside.variable(CLASS_DOUBLE, "t_s", 2, &[], 8);
    inside.bytes.truncate(inside.bytes.len() - 8);
    inside.word(8 << 16 | 2);
    inside.bytes.extend([0; 8]);
    let mut bytes = header(false);
    bytes.extend(14_u32.to_le_bytes());
    bytes.extend((inside.bytes.len() as u32).to_le_bytes());
    bytes.extend(inside.bytes);
    let message = read(bytes).unwrap_err().to_string();
    assert!(message.contains("`t_s` has 8 bytes beside its tag"), "{message}");
}

proptest::proptest! {
    #[test]
    fn any_byte_may_be_wrong(at in 0..4000_usize, byte in 0..=255_u8, big_endian: bool, compressed: bool) {
        let mut bytes = file(big_endian, compressed, CLASS_DOUBLE, 20);
        let at = at % bytes.len();
        bytes[at] = byte;
        if let Err(error) = read(bytes) {
            proptest::prop_assert!(!error.to_string().contains('\n'));
        }
    }
}

#[test]
fn every_way_to_write_a_number_is_read_in_either_byte_order() {
    let ways: [(u32, f64, Vec<u8>); 13] = [
        (1, -2.0, (-2_i8).to_le_bytes().to_vec()),
        (2, 254.0, 254_u8.to_le_bytes().to_vec()),
        (3, -300.0, (-300_i16).to_le_bytes().to_vec()),
        (4, 65_000.0, 65_000_u16.to_le_bytes().to_vec()),
        (5, -70_000.0, (-70_000_i32).to_le_bytes().to_vec()),
        (6, 4e9, 4_000_000_000_u32.to_le_bytes().to_vec()),
        (7, -0.25, (-0.25_f32).to_le_bytes().to_vec()),
        (9, 0.1, 0.1_f64.to_le_bytes().to_vec()),
        (12, -4e18, (-4_000_000_000_000_000_000_i64).to_le_bytes().to_vec()),
        (13, 1.6e19, 16_000_000_000_000_000_000_u64.to_le_bytes().to_vec()),
        (1, -128.0, i8::MIN.to_le_bytes().to_vec()),
        (5, 2_147_483_647.0, i32::MAX.to_le_bytes().to_vec()),
        (9, f64::NEG_INFINITY, f64::NEG_INFINITY.to_le_bytes().to_vec()),
    ];
    for (kind, number, mut bytes) in ways {
        for big_endian in [false, true] {
            let written = Written::of(kind, big_endian).expect("numbers");
            let read: Vec<f64> = written.numbers(&bytes.repeat(3), 2).collect();
            assert_eq!(read, [number; 2], "type {kind}, big-endian: {big_endian}");
            bytes.reverse();
        }
    }
    assert!([0, 8, 10, 11, 14, 15].iter().all(|kind| Written::of(*kind, false).is_none()));
}
