//! MAT files of version 7.3: the part of HDF5 that MATLAB writes.
//!
//! The HDF Group, "HDF5 File Format Specification", version 3.0: superblocks 0 and 1, groups as symbol tables, object
//! headers of version 1, data in B-trees of version 1.

use super::vector::vector;
use super::{Values, Variables};
use crate::read::error::TraceFault;
use crate::read::format::MOST_HELD;

/// Where MATLAB puts the superblock: behind its own header.
const SUPERBLOCK: usize = 512;

/// Bytes of a name; MATLAB's have 63 at the most.
const LONGEST_NAME: usize = 1024;

/// Types of header messages.
const DATASPACE: u64 = 0x01;
const DATATYPE: u64 = 0x03;
const LAYOUT: u64 = 0x08;
const FILTERS: u64 = 0x0b;
const ATTRIBUTE: u64 = 0x0c;
const CONTINUATION: u64 = 0x10;
const SYMBOL_TABLE: u64 = 0x11;

/// Types of B-trees.
const OF_GROUP: u64 = 0;

/// Why a file is not read.
#[derive(Debug)]
pub(super) enum Trouble {
    /// It contradicts itself.
    Damaged,
    /// It is written in another form.
    Form,
    TooLarge,
}

pub(super) type Found<T> = Result<T, Trouble>;

/// Bytes, read from their front; numbers are little-endian.
#[derive(Clone, Copy)]
pub(super) struct Front<'a>(pub(super) &'a [u8]);

impl<'a> Front<'a> {
    pub(super) fn take(&mut self, count: u64) -> Found<&'a [u8]> {
        let count = usize::try_from(count).map_err(|_| Trouble::Damaged)?;
        let (taken, rest) = self.0.split_at_checked(count).ok_or(Trouble::Damaged)?;
        self.0 = rest;
        Ok(taken)
    }

    /// Of so many bytes, eight at most.
    pub(super) fn number(&mut self, bytes: u64) -> Found<u64> {
        let bytes = self.take(bytes)?.iter().rev();
        Ok(bytes.fold(0, |number, byte| number << 8 | u64::from(*byte)))
    }
}

/// A file, and how often it may still be looked at: what points at itself has no end, and what is pointed at by many is
/// no longer in proportion to the file.
pub(super) struct File<'a> {
    bytes: &'a [u8],
    base: u64,
    looks: usize,
}

/// What the header of an object says: messages, each with its type.
struct Object<'a>(Vec<(u64, &'a [u8])>);

pub(super) fn read(bytes: &[u8]) -> Result<Variables, TraceFault> {
    variables(bytes).map_err(|trouble| match trouble {
        Trouble::Damaged => TraceFault::Damaged("the MAT file of version 7.3 contradicts itself".to_owned()),
        Trouble::Form => TraceFault::Format(
            "a MAT file of version 7.3 in a form of HDF5 that is not read: load it and save it with save -v7, or as CSV",
        ),
        Trouble::TooLarge => TraceFault::Format(super::TOO_LARGE),
    })
}

fn variables(bytes: &[u8]) -> Found<Variables> {
    let (mut file, root) = File::open(bytes)?;
    let mut budget = MOST_HELD / 8;
    let mut variables = Vec::new();
    let root = file.object(root)?.message(SYMBOL_TABLE).ok_or(Trouble::Form)?;
    for (name, address) in file.members(root)? {
        // Others are what variables point at.
        if !name.starts_with('#') {
            variables.push((name, file.variable(address, &mut budget)?));
        }
    }
    Ok(variables)
}

impl<'a> File<'a> {
    /// The file, and the address of its root.
    fn open(bytes: &'a [u8]) -> Found<(Self, u64)> {
        let mut head = Front(bytes.get(SUPERBLOCK..).unwrap_or_default());
        if head.take(8)? != b"\x89HDF\r\n\x1a\n" {
            return Err(Trouble::Damaged);
        }
        let version = head.number(1)?;
        head.take(4)?;
        let widths = [head.number(1)?, head.number(1)?];
        if version > 1 || widths != [8, 8] {
            return Err(Trouble::Form);
        }
        head.take(if version == 0 { 9 } else { 13 })?;
        let base = head.number(8)?;
        // Free space.
        head.take(8)?;
        if head.number(8)? > bytes.len() as u64 {
            return Err(Trouble::Damaged);
        }
        // Driver, name of the root.
        head.take(2 * 8)?;
        Ok((Self { bytes, base, looks: bytes.len() }, head.number(8)?))
    }

    /// One more of what takes a byte of the file at the least.
    fn look(&mut self) -> Found<()> {
        self.looks = self.looks.checked_sub(1).ok_or(Trouble::Damaged)?;
        Ok(())
    }

    /// All from an address on.
    pub(super) fn at(&mut self, address: u64) -> Found<Front<'a>> {
        self.look()?;
        let start = self.base.checked_add(address).and_then(|start| usize::try_from(start).ok());
        start.and_then(|start| self.bytes.get(start..)).map(Front).ok_or(Trouble::Damaged)
    }

    fn object(&mut self, address: u64) -> Found<Object<'a>> {
        let mut head = self.at(address)?;
        if head.number(1)? != 1 {
            return Err(Trouble::Form);
        }
        head.take(1)?;
        let count = head.number(2)?;
        head.take(4)?;
        let size = head.number(4)?;
        head.take(4)?;
        let (mut messages, mut blocks, mut seen) = (Vec::new(), vec![Front(head.take(size)?)], 0);
        while let Some(mut block) = blocks.pop() {
            while seen < count && block.0.len() >= 8 {
                seen += 1;
                self.look()?;
                let (kind, size, flags) = (block.number(2)?, block.number(2)?, block.number(1)?);
                block.take(3)?;
                let data = block.take(size)?;
                if kind == CONTINUATION {
                    let mut data = Front(data);
                    let mut next = self.at(data.number(8)?)?;
                    blocks.push(Front(next.take(data.number(8)?)?));
                } else if flags & 2 == 0 {
                    messages.push((kind, data));
                }
            }
        }
        Ok(Object(messages))
    }

    /// Names and addresses of what is in a group.
    fn members(&mut self, symbol_table: &[u8]) -> Found<Vec<(String, u64)>> {
        let mut table = Front(symbol_table);
        let (tree, heap) = (table.number(8)?, table.number(8)?);
        let mut heap = self.at(heap)?;
        if heap.take(4)? != b"HEAP" {
            return Err(Trouble::Damaged);
        }
        heap.take(4)?;
        let size = heap.number(8)?;
        heap.take(8)?;
        let names = self.at(heap.number(8)?)?.take(size)?;
        let mut members = Vec::new();
        for (_, node) in self.leaves(tree, OF_GROUP, 8)? {
            let mut node = self.at(node)?;
            if node.take(4)? != b"SNOD" {
                return Err(Trouble::Damaged);
            }
            node.take(2)?;
            for _ in 0..node.number(2)? {
                self.look()?;
                let mut name = Front(names);
                name.take(node.number(8)?)?;
                let end =
                    name.0.iter().take(LONGEST_NAME).position(|byte| *byte == 0).ok_or(Trouble::Damaged)?;
                let name = String::from_utf8_lossy(name.take(end as u64)?).into_owned();
                members.push((name, node.number(8)?));
                node.take(24)?;
            }
        }
        Ok(members)
    }

    /// The leaves of a B-tree with keys of so many bytes, and the key before each.
    pub(super) fn leaves(&mut self, root: u64, kind: u64, key: u64) -> Found<Vec<(&'a [u8], u64)>> {
        let (mut leaves, mut nodes) = (Vec::new(), vec![(root, None)]);
        while let Some((address, expected)) = nodes.pop() {
            let mut node = self.at(address)?;
            let is_tree = node.take(4)? == b"TREE" && node.number(1)? == kind;
            let level = node.number(1)?;
            if !is_tree || expected.is_some_and(|expected| level != expected) {
                return Err(Trouble::Damaged);
            }
            let entries = node.number(2)?;
            node.take(16)?;
            for _ in 0..entries {
                self.look()?;
                let (key, child) = (node.take(key)?, node.number(8)?);
                match level.checked_sub(1) {
                    None => leaves.push((key, child)),
                    Some(below) => nodes.push((child, Some(below))),
                }
            }
        }
        Ok(leaves)
    }

    fn variable(&mut self, address: u64, budget: &mut u64) -> Found<Values> {
        let object = self.object(address)?;
        if let Some(kind) = object.kind() {
            return Ok(Err(kind));
        }
        let [space, data, layout] = [DATASPACE, DATATYPE, LAYOUT].map(|kind| object.message(kind));
        let (Some(space), Some(data), Some(layout)) = (space, data, layout) else {
            return Ok(Err("variable of an unknown class"));
        };
        vector(self, space, data, layout, object.message(FILTERS), budget)
    }
}

impl<'a> Object<'a> {
    /// The last one of a type.
    fn message(&self, kind: u64) -> Option<&'a [u8]> {
        self.0.iter().rfind(|(known, _)| *known == kind).map(|(_, data)| *data)
    }

    /// What it is where it is no array of numbers.
    fn kind(&self) -> Option<&'static str> {
        let attributes = || self.0.iter().filter(|(kind, _)| *kind == ATTRIBUTE);
        let value =
            |name: &[u8]| attributes().filter_map(|(_, one)| attribute(one).ok()).find(|one| one.0 == name);
        let is_group = self.message(SYMBOL_TABLE).is_some();
        let class = value(b"MATLAB_class").map(|(_, class)| class.trim_ascii_end());
        match class {
            _ if is_group && value(b"MATLAB_sparse").is_some() => Some("sparse matrix"),
            None if is_group => Some("struct"),
            Some(b"struct") => Some("struct"),
            Some(b"cell") => Some("cell array"),
            Some(b"char") => Some("text"),
            Some(class) if is_group || !is_numeric(class) => Some("object"),
            _ => value(b"MATLAB_empty").map(|_| "matrix"),
        }
    }
}

fn is_numeric(class: &[u8]) -> bool {
    matches!(class, b"double" | b"single" | b"logical")
        || class.starts_with(b"int")
        || class.starts_with(b"uint")
}

/// Name and value of an attribute (version 1, whose parts end at multiples of eight bytes).
fn attribute(message: &[u8]) -> Found<(&[u8], &[u8])> {
    let mut message = Front(message);
    if message.number(1)? != 1 {
        return Err(Trouble::Form);
    }
    message.take(1)?;
    let [name, datatype, dataspace] = [message.number(2)?, message.number(2)?, message.number(2)?];
    let name = message.take(name.next_multiple_of(8))?;
    message.take(datatype.next_multiple_of(8) + dataspace.next_multiple_of(8))?;
    Ok((until_nul(name), until_nul(message.0)))
}

fn until_nul(text: &[u8]) -> &[u8] {
    text.split(|byte| *byte == 0).next().unwrap_or_default()
}
