//! What each doubt is worth.

use pitchleak::diagnose::FoundEffect;
use std::collections::BTreeMap;

/// The names that each doubt alone takes confidence from, a line each; a name comes with whether it is right.
pub(crate) fn alone<'a>(names: impl Iterator<Item = (&'a FoundEffect, bool)>) -> String {
    let mut counts: BTreeMap<String, [usize; 2]> = BTreeMap::new();
    for (name, is_right) in names {
        if let [only] = &name.doubts[..] {
            counts.entry(format!("{:?}", only.id)).or_default()[usize::from(is_right)] += 1;
        }
    }
    let line = |(id, [wrong, right]): (&String, &[usize; 2])| {
        format!("  {id} alone: {wrong} wrong, {right} right\n")
    };
    counts.iter().map(line).collect()
}
