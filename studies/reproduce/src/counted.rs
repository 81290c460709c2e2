use rayon::prelude::*;
use std::sync::atomic::{AtomicUsize, Ordering};

/// `work` on every item, on all cores; results in the items' order whatever the thread count. `done` is
/// called with the number of items finished, from any thread.
pub(super) fn map_counted<I: Sync, O: Send>(
    items: &[I],
    done: impl Fn(usize) + Sync,
    work: impl Fn(&I) -> O + Sync,
) -> Vec<O> {
    let finished = AtomicUsize::new(0);
    let counted = |item| {
        let result = work(item);
        done(finished.fetch_add(1, Ordering::Relaxed) + 1);
        result
    };
    // Items take seconds each: none waits behind another while a core is free.
    items.par_iter().with_max_len(1).map(counted).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn results_come_in_order_and_all_are_counted() {
        let items: Vec<u64> = (0..100).collect();
        let counted = AtomicUsize::new(0);
        let count = |_| {
            counted.fetch_add(1, Ordering::Relaxed);
        };
        let squares = map_counted(&items, count, |n| n * n);
        assert_eq!(squares, items.iter().map(|n| n * n).collect::<Vec<_>>());
        assert_eq!(counted.into_inner(), 100);
        assert!(map_counted(&[] as &[u8], |_| (), |_| 0).is_empty());
    }
}
