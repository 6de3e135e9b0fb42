//! Sorting, compiled once: the standard library's sorts are compiled anew for each comparison, ten kilobytes each.

use std::cmp::Ordering;

/// Sort stably, by a comparison. For lists that are made outside of evaluations: it allocates.
pub fn sort_by<T>(items: &mut [T], compare: impl Fn(&T, &T) -> Ordering) {
    let mut from = sorted(items.len(), &|i, j| compare(&items[i], &items[j]));
    // each cycle of the permutation, from place to place
    for start in 0..from.len() {
        let mut here = start;
        loop {
            let next = std::mem::replace(&mut from[here], here);
            if next == start {
                break;
            }
            items.swap(here, next);
            here = next;
        }
    }
}

/// As [`sort_by`], by a key.
pub fn sort_by_key<T, K: Ord>(items: &mut [T], key: impl Fn(&T) -> K) {
    sort_by(items, |x, y| key(x).cmp(&key(y)));
}

/// The numbers below `count` in the order of a comparison.
#[inline(never)]
fn sorted(count: usize, compare: &dyn Fn(usize, usize) -> Ordering) -> Vec<usize> {
    let mut order: Vec<usize> = (0..count).collect();
    order.sort_by(|&i, &j| compare(i, j));
    order
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lists_are_sorted_as_by_the_standard_library() {
        let mut random = fastrand::Rng::with_seed(1);
        for n in (0..60).chain([1000]) {
            // few keys, so that many are equal, and names by which those are told apart
            let list: Vec<(u8, String)> = (0..n).map(|i| (random.u8(0..8), i.to_string())).collect();
            let (mut ours, mut theirs) = (list.clone(), list);
            sort_by_key(&mut ours, |x| x.0);
            theirs.sort_by_key(|x| x.0);
            assert_eq!(ours, theirs);
            sort_by(&mut ours, |x, y| y.cmp(x));
            theirs.sort_by(|x, y| y.cmp(x));
            assert_eq!(ours, theirs);
        }
    }
}
