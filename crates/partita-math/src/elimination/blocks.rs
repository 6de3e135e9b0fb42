//! Diagonal blocks of C_D: what its determinant is a product of.

use super::Pattern;
use std::collections::hash_map::DefaultHasher;
use std::hash::{Hash, Hasher};

/// Diagonal blocks of C_D with rows and columns in the order of the steps.
#[derive(Clone, Debug)]
pub(super) struct Blocks {
    /// Block of each step, numbered by their first columns.
    pub of_step: Vec<usize>,
    /// Whether the order of its steps is an odd permutation of rows against columns.
    pub odd: Vec<bool>,
    /// As `odd`, of all steps.
    pub all_odd: bool,
    /// Entries of C within blocks, with the steps of their rows and columns; none where there is one block.
    pub entries: Vec<[u32; 3]>,
    /// Rows and columns of all blocks, as one number.
    pub signature: u64,
}

/// A diagonal block of C_D with scaled rows and columns.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Block {
    steps: i32,
    determinant: f64,
    /// Sum of the squares of its entries.
    squares: f64,
}

impl Block {
    pub(super) const EMPTY: Self = Self { steps: 0, determinant: 1.0, squares: 0.0 };

    pub(super) fn add_pivot(&mut self, pivot: f64) {
        self.steps += 1;
        self.determinant *= pivot;
    }

    pub(super) fn add_entry(&mut self, entry: f64) {
        self.squares += entry * entry;
    }

    /// A lower bound of its smallest singular value: the others have the product |det| / smallest, which is largest if
    /// they are equal.
    pub fn least_singular_value(&self) -> f64 {
        let others = self.steps - 1;
        let by = if others > 0 { (f64::from(others) / self.squares).sqrt().powi(others) } else { 1.0 };
        // of hundreds of steps neither factor need be a number
        match self.determinant.is_normal() && by.is_finite() {
            true => self.determinant.abs() * by,
            false => 0.0,
        }
    }
}

impl Blocks {
    /// For steps that pair `rows[k]` with `cols[k]`: the strongly connected components of "row k has an entry in column l".
    /// The product of the pivots of a block is its determinant, up to the sign of that permutation.
    pub fn new(pattern: &Pattern, rows: &[usize], cols: &[usize]) -> Self {
        let n = rows.len();
        let mut step_of = vec![usize::MAX; pattern.cols];
        for (k, &c) in cols.iter().enumerate() {
            step_of[c] = k;
        }
        let found = components(n, |k| pattern.row(rows[k]).map(|e| step_of[pattern.col_idx[e]]).filter(|&l| l < n));
        // named by their first column, whatever the order of the steps was
        let count = found.iter().max().map_or(0, |m| m + 1);
        let mut first = vec![usize::MAX; count];
        for (k, &b) in found.iter().enumerate() {
            first[b] = first[b].min(cols[k]);
        }
        let order = ordered(count, |b| first[b]);
        let mut index = vec![0; count];
        order.iter().enumerate().for_each(|(i, &b)| index[b] = i);
        let of_step: Vec<usize> = found.iter().map(|&b| index[b]).collect();
        let mut steps = vec![Vec::new(); count];
        of_step.iter().enumerate().for_each(|(k, &b)| steps[b].push(k));
        let odd = steps.iter().map(|own| is_odd(own, rows) ^ is_odd(own, cols)).collect();
        let all: Vec<usize> = (0..n).collect();
        let mut named: Vec<(usize, usize, usize)> = (0..n).map(|k| (cols[k], rows[k], of_step[k])).collect();
        named.sort_unstable();
        let mut columns = DefaultHasher::new();
        named.iter().for_each(|x| (x.0, x.2).hash(&mut columns));
        named.iter_mut().for_each(|x| *x = (x.1, x.0, x.2));
        named.sort_unstable();
        named.iter().for_each(|x| (x.0, x.2).hash(&mut columns));
        let inside = |k: usize, e: usize| {
            let l = step_of[pattern.col_idx[e]];
            (l < n && of_step[l] == of_step[k]).then(|| [e, k, l].map(|x| x as u32))
        };
        let inside = (0..n).flat_map(|k| pattern.row(rows[k]).filter_map(move |e| inside(k, e)));
        let entries = if count > 1 { inside.collect() } else { Vec::new() };
        Self { of_step, odd, entries, all_odd: is_odd(&all, rows) ^ is_odd(&all, cols), signature: columns.finish() }
    }
}

/// The numbers below `count` in the order of their keys, no two of which are equal.
fn ordered(count: usize, key: impl Fn(usize) -> usize) -> Vec<usize> {
    // of the type of the other list that is sorted here: a sort is compiled once for each
    let mut keyed: Vec<(usize, usize, usize)> = (0..count).map(|i| (key(i), i, 0)).collect();
    keyed.sort_unstable();
    keyed.into_iter().map(|x| x.1).collect()
}

/// Is the order that `own` has by `key` an odd permutation of it?
fn is_odd(own: &[usize], key: &[usize]) -> bool {
    let sorted = ordered(own.len(), |i| key[own[i]]);
    let (mut seen, mut odd) = (vec![false; own.len()], false);
    for i in 0..own.len() {
        let (mut j, mut length) = (i, 0);
        while !seen[j] {
            seen[j] = true;
            j = sorted[j];
            length += 1;
        }
        odd ^= length > 0 && length % 2 == 0;
    }
    odd
}

/// Strongly connected component of each node (Tarjan, without recursion).
fn components<I: Iterator<Item = usize>>(n: usize, next: impl Fn(usize) -> I) -> Vec<usize> {
    const NONE: usize = usize::MAX;
    let (mut index, mut low, mut of) = (vec![NONE; n], vec![0; n], vec![NONE; n]);
    let (mut stack, mut count, mut found) = (Vec::new(), 0, 0);
    for root in 0..n {
        if index[root] != NONE {
            continue;
        }
        let mut path = Vec::new();
        let mut enter =
            |k: usize, stack: &mut Vec<usize>, path: &mut Vec<(usize, I)>, low: &mut [usize], index: &mut [usize]| {
                (index[k], low[k]) = (count, count);
                count += 1;
                stack.push(k);
                path.push((k, next(k)));
            };
        enter(root, &mut stack, &mut path, &mut low, &mut index);
        while let Some((k, edges)) = path.last_mut() {
            let k = *k;
            match edges.next() {
                Some(l) if index[l] == NONE => enter(l, &mut stack, &mut path, &mut low, &mut index),
                Some(l) => {
                    if of[l] == NONE {
                        low[k] = low[k].min(index[l]);
                    }
                }
                None => {
                    path.pop();
                    if let Some((parent, _)) = path.last() {
                        low[*parent] = low[*parent].min(low[k]);
                    }
                    if low[k] == index[k] {
                        while let Some(l) = stack.pop() {
                            of[l] = found;
                            if l == k {
                                break;
                            }
                        }
                        found += 1;
                    }
                }
            }
        }
    }
    of
}
