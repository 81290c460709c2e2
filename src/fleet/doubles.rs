//! Copies among the traces: a recording counts once, whatever its files are called.

use super::FleetTrace;
use crate::Rig;
use std::collections::{BTreeMap, HashMap};
use std::fs::File;
use std::hash::{DefaultHasher, Hasher};
use std::io::Read;
use std::path::Path;
use std::sync::Arc;

/// Within so many bytes the noise of two recordings of one size makes them differ.
const HEAD_BYTES: usize = 64 << 10;

/// Moves copies to the trace that comes first: the same bytes, judged with the same rig. Only files of one size are opened,
/// and only those that begin alike are read to their end.
pub(super) fn merge(traces: Vec<FleetTrace>) -> Vec<FleetTrace> {
    let looks: [fn(&Path) -> Option<u64>; 3] =
        [size, |path| hash(path, HEAD_BYTES as u64), |path| hash(path, u64::MAX)];
    let mut groups: Vec<Vec<usize>> = vec![(0..traces.len()).collect()];
    for look in looks {
        let same = |group: &Vec<usize>| alike(group, |at| look(&traces.get(*at)?.path));
        groups = groups.iter().flat_map(same).collect();
    }
    let mut first_of = HashMap::new();
    for group in groups {
        let mut firsts: Vec<usize> = Vec::new();
        for at in group {
            let rig = |at: usize| traces.get(at).map(|trace| &trace.rig);
            match firsts.iter().find(|first| rig(**first).zip(rig(at)).is_some_and(|(a, b)| same_rig(a, b))) {
                Some(first) => drop(first_of.insert(at, *first)),
                None => firsts.push(at),
            }
        }
    }
    let mut kept: BTreeMap<usize, FleetTrace> = BTreeMap::new();
    for (at, trace) in traces.into_iter().enumerate() {
        match first_of.get(&at).and_then(|first| kept.get_mut(first)) {
            Some(first) => first.copies.extend([trace.path].into_iter().chain(trace.other_names)),
            None => drop(kept.insert(at, trace)),
        }
    }
    kept.into_values().collect()
}

/// The members that share their key with another, by their keys.
fn alike(group: &[usize], key: impl Fn(&usize) -> Option<u64>) -> Vec<Vec<usize>> {
    let mut by_key: HashMap<u64, Vec<usize>> = HashMap::new();
    for at in group {
        if let Some(key) = key(at) {
            by_key.entry(key).or_default().push(*at);
        }
    }
    by_key.into_values().filter(|group| group.len() > 1).collect()
}

/// Whether a trace is judged alike by both, wherever their files stand.
fn same_rig(a: &Result<Arc<Rig>, Arc<str>>, b: &Result<Arc<Rig>, Arc<str>>) -> bool {
    let nameless = |rig: &Rig| Rig { name: String::new(), ..rig.clone() };
    match (a, b) {
        (Ok(a), Ok(b)) => Arc::ptr_eq(a, b) || nameless(a) == nameless(b),
        (a, b) => a == b,
    }
}

/// Of what can be opened twice: not of a pipe.
fn size(path: &Path) -> Option<u64> {
    Some(std::fs::metadata(path).ok().filter(std::fs::Metadata::is_file)?.len())
}

/// Of a file's first bytes.
fn hash(path: &Path, most: u64) -> Option<u64> {
    let mut file = File::open(path).ok()?.take(most);
    let mut hasher = DefaultHasher::new();
    let mut block = vec![0; HEAD_BYTES];
    loop {
        let length = file.read(&mut block).ok()?;
        match block.get(..length)? {
            [] => return Some(hasher.finish()),
            bytes => hasher.write(bytes),
        }
    }
}
