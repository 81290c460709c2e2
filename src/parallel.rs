//! The same work on many items, on all cores; results in the items' order whatever the thread count.

use std::num::NonZero;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

/// `work` on every item, on as many threads as the machine has cores. `done` is called with the
/// number of items finished, from any thread.
pub fn map<I: Sync, O: Send>(
    items: &[I],
    done: impl Fn(usize) + Sync,
    work: impl Fn(&I) -> O + Sync,
) -> Vec<O> {
    let threads = std::thread::available_parallelism().map_or(1, NonZero::get).min(items.len().max(1));
    let (next, finished) = (AtomicUsize::new(0), AtomicUsize::new(0));
    let results: Mutex<Vec<(usize, O)>> = Mutex::new(Vec::with_capacity(items.len()));
    let worker = || {
        while let Some((index, item)) = pick(items, &next) {
            let result = work(item);
            // A poisoned lock means that another worker panicked; the scope passes that panic on.
            if let Ok(mut results) = results.lock() {
                results.push((index, result));
            }
            done(finished.fetch_add(1, Ordering::Relaxed) + 1);
        }
    };
    std::thread::scope(|scope| (0..threads).for_each(|_| drop(scope.spawn(worker))));
    let mut results = results.into_inner().unwrap_or_default();
    results.sort_by_key(|(index, _)| *index);
    results.into_iter().map(|(_, result)| result).collect()
}

fn pick<'a, I>(items: &'a [I], next: &AtomicUsize) -> Option<(usize, &'a I)> {
    let index = next.fetch_add(1, Ordering::Relaxed);
    Some((index, items.get(index)?))
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
        let squares = map(&items, count, |n| n * n);
        assert_eq!(squares, items.iter().map(|n| n * n).collect::<Vec<_>>());
        assert_eq!(counted.into_inner(), 100);
        assert!(map(&[] as &[u8], |_| (), |_| 0).is_empty());
    }
}
