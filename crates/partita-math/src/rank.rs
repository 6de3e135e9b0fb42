//! Which rows of C are independent. (C1)
//!
//! ```text
//! R = diag(G)^-1/2 G diag(G)^-1/2,   G = C S² Cᵀ,   S the scales of the columns
//! ```
//!
//! Diagonal-pivoted Cholesky of R: each pivot is the squared sine of the angle between a row and the rows accepted before
//! it, whatever the units of the rows. With `S = M^-1/2` (diagonal) the angles are those of the mass metric.
//!
//! R is kept sparse, and rows that share no column do not interact. Taking always the largest pivot would nevertheless
//! link all rows: rows left for later are neighbours of all rows they can reach through accepted ones. Large systems
//! therefore take, among the rows at a sufficient angle, the one with the fewest neighbours, and the poorer ones last;
//! for a chain of loops the cost is then proportional to its length. A column shared by p rows costs p² entries.

use std::cmp::{Ordering, Reverse};
use std::collections::BinaryHeap;

use crate::elimination::Pattern;

/// An independent subset of rows.
#[derive(Clone, Debug, PartialEq, Default)]
pub struct RowRank {
    /// Number of independent rows.
    pub rank: usize,
    /// The rows kept, in the order they were accepted; in large systems this is not the order of the pivots.
    pub kept: Vec<usize>,
    /// The rows that depend on them (or are zero, or not finite), ascending.
    pub dropped: Vec<usize>,
    /// Squared sine of each kept row's angle to the rows kept before it.
    pub pivots: Vec<f64>,
    /// Largest squared sine of a row at the time it was dropped (it may have fallen since); 0 if none was.
    pub largest_dropped: f64,
    /// Smallest pivot over [`largest_dropped`](Self::largest_dropped), infinite if that is 0: how clear the rank is.
    pub gap: f64,
}

/// Up to this many rows the largest pivot is taken regardless of fill-in.
const FULL_SEARCH: usize = 200;

/// Squared sines between two of these count as equal in large matrices. Scale: squared sine. Reason: two digits are
/// enough to order rows by, which leaves room for sparsity.
const SINE_LEVELS: [f64; 4] = [1e-3, 1e-5, 1e-7, 1e-9];

/// Finds independent rows of a sparse C (m×n) with column scales (n).
///
/// Up to 200 rows, the row at the largest angle to those accepted is accepted next, ties going to the lower index;
/// above, see the head of this file. It ends when no squared sine exceeds `tol`: 1e-8 to 1e-10 separates dependence
/// from poor geometry, and the `gap` says how well. Squared sines below about 1e-14 are rounding errors.
///
/// # Panics
/// If a length contradicts the pattern.
pub fn independent_rows(pattern: &Pattern, values: &[f64], col_scale: &[f64], tol: f64) -> RowRank {
    preferred_rows(pattern, values, col_scale, tol, (f64::INFINITY, &|_| false))
}

/// As `independent_rows`, with some rows considered last: those with `last` true are accepted only when no other row has a squared
/// sine above `clear`.
///
/// # Panics
/// If a length contradicts the pattern.
pub fn preferred_rows(
    pattern: &Pattern,
    values: &[f64],
    col_scale: &[f64],
    tol: f64,
    (clear, last): (f64, &dyn Fn(usize) -> bool),
) -> RowRank {
    chosen_rows(pattern, values, (col_scale, None), tol, (clear, last))
}

/// As `preferred_rows`, for rows of known sizes: each is divided by its own size, not by its length, so that a pivot is the square
/// of what a row adds to those before it, and a row with a small size has little weight.
///
/// # Panics
/// If a length contradicts the pattern.
pub fn weighed_rows(
    pattern: &Pattern,
    values: &[f64],
    scales: (&[f64], &[f64]),
    tol: f64,
    preference: (f64, &dyn Fn(usize) -> bool),
) -> RowRank {
    assert_eq!(scales.1.len(), pattern.rows, "one size per row");
    chosen_rows(pattern, values, (scales.0, Some(scales.1)), tol, preference)
}

fn chosen_rows(
    pattern: &Pattern,
    values: &[f64],
    (col_scale, row_size): (&[f64], Option<&[f64]>),
    tol: f64,
    (clear, last): (f64, &dyn Fn(usize) -> bool),
) -> RowRank {
    assert_eq!(values.len(), pattern.nnz(), "one value per entry");
    assert_eq!(col_scale.len(), pattern.cols, "one scale per column");
    let mut gram = Gram::new(pattern, values, col_scale, row_size);
    gram.clear = clear;
    gram.last = (0..pattern.rows).map(last).collect();
    let large = pattern.rows > FULL_SEARCH;
    let first = (0..pattern.rows).filter(|&i| large && gram.waiting[i]).map(|i| gram.claim(i));
    let mut heap: BinaryHeap<Claim> = first.collect();
    let mut found = RowRank::default();
    while let Some(row) = if large { gram.first_of(&mut heap) } else { gram.first() } {
        let sine2 = gram.diagonal[row];
        if sine2 > tol {
            found.kept.push(row);
            found.pivots.push(sine2);
            let changed = gram.accept(row, tol);
            if large {
                heap.extend(changed.into_iter().map(|neighbour| gram.claim(neighbour)));
            }
        } else {
            gram.drop_row(row);
        }
    }
    let mut kept = vec![false; pattern.rows];
    found.kept.iter().for_each(|&i| kept[i] = true);
    found.rank = found.kept.len();
    found.dropped = (0..pattern.rows).filter(|&i| !kept[i]).collect();
    found.largest_dropped = gram.largest_dropped;
    let smallest = found.pivots.iter().fold(f64::INFINITY, |m: f64, &p| m.min(p));
    found.gap = if found.largest_dropped > 0.0 { smallest / found.largest_dropped } else { f64::INFINITY };
    found
}

/// Priority of a row; stale when the row would now get another one.
struct Claim {
    /// Whether it is independent of the accepted rows and not among those considered last.
    first: bool,
    /// Its squared sine, rounded down to a level in large systems.
    sine2: f64,
    /// Its number of neighbours, in large systems.
    neighbours: Reverse<usize>,
    row: Reverse<usize>,
}

impl Ord for Claim {
    fn cmp(&self, other: &Self) -> Ordering {
        let sines = self.sine2.total_cmp(&other.sine2);
        self.first
            .cmp(&other.first)
            .then(sines)
            .then(self.neighbours.cmp(&other.neighbours))
            .then(self.row.cmp(&other.row))
    }
}

impl PartialOrd for Claim {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Claim {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Claim {}

/// The remainder of R for the rows not yet accepted: 1 − (projection on the accepted rows).
struct Gram {
    diagonal: Vec<f64>,
    /// Entries off the diagonal, both triangles.
    rows: Vec<Vec<(usize, f64)>>,
    waiting: Vec<bool>,
    /// Index + 1 of each column in the row being updated, else 0.
    index: Vec<usize>,
    largest_dropped: f64,
    /// Rows that come after those whose squared sine is above `clear`.
    last: Vec<bool>,
    clear: f64,
}

impl Gram {
    fn new(pattern: &Pattern, values: &[f64], col_scale: &[f64], row_size: Option<&[f64]>) -> Self {
        let m = pattern.rows;
        let mut lengths = vec![1.0; m];
        // the rows scaled to length 1, or weighed, one after the other
        let (mut unit, mut starts) = (Vec::with_capacity(pattern.nnz()), Vec::with_capacity(m + 1));
        starts.push(0);
        for i in 0..m {
            let first = unit.len();
            let length = unit_row(pattern, values, col_scale, i, &mut unit);
            if let Some(size) = row_size {
                lengths[i] = length / size[i];
                unit[first..].iter_mut().for_each(|x| x.1 *= lengths[i]);
            }
            starts.push(unit.len());
        }
        let row_of = |i: usize| &unit[starts[i]..starts[i + 1]];
        // by columns
        let mut ends = vec![0; pattern.cols + 1];
        unit.iter().for_each(|&(j, _)| ends[j + 1] += 1);
        (0..pattern.cols).for_each(|j| ends[j + 1] += ends[j]);
        let mut columns = vec![(0, 0.0); unit.len()];
        for i in 0..m {
            for &(j, x) in row_of(i) {
                columns[ends[j]] = (i, x);
                ends[j] += 1;
            }
        }
        let column_of = |j: usize| &columns[if j == 0 { 0 } else { ends[j - 1] }..ends[j]];
        let neighbours = |i: usize| row_of(i).iter().map(|&(j, _)| column_of(j).len() - 1).sum::<usize>();
        let mut gram = Self {
            diagonal: lengths.iter().map(|x| x * x).collect(),
            rows: (0..m).map(|i| Vec::with_capacity(neighbours(i).min(m))).collect(),
            waiting: (0..m).map(|i| !row_of(i).is_empty()).collect(),
            index: vec![0; m],
            largest_dropped: 0.0,
            last: Vec::new(),
            clear: f64::INFINITY,
        };
        for i in 0..m {
            for &(j, x) in row_of(i) {
                gram.add(i, column_of(j).iter().filter(|e| e.0 != i), x);
            }
            gram.clear_places(i);
        }
        gram
    }

    fn claim(&self, row: usize) -> Claim {
        let sine2 = self.diagonal[row];
        let first = sine2 > self.clear && !self.last[row];
        if self.rows.len() <= FULL_SEARCH {
            return Claim { first, sine2, neighbours: Reverse(0), row: Reverse(row) };
        }
        let level = SINE_LEVELS.into_iter().find(|&level| sine2 >= level).unwrap_or(0.0);
        Claim { first, sine2: level, neighbours: Reverse(self.rows[row].len()), row: Reverse(row) }
    }

    /// The waiting row with the highest claim: compared with all others where they are few.
    fn first(&self) -> Option<usize> {
        let waiting = (0..self.waiting.len()).filter(|&i| self.waiting[i]);
        waiting.map(|i| self.claim(i)).max().map(|claim| claim.row.0)
    }

    /// The same out of a heap that may hold stale claims.
    fn first_of(&self, heap: &mut BinaryHeap<Claim>) -> Option<usize> {
        while let Some(claim) = heap.pop() {
            let Reverse(row) = claim.row;
            if self.waiting[row] && claim == self.claim(row) {
                return Some(row);
            }
        }
        None
    }

    /// Adds `factor` times some entries to row `i`, leaving the columns of the row marked.
    fn add<'a>(&mut self, i: usize, entries: impl Iterator<Item = &'a (usize, f64)>, factor: f64) {
        let row = &mut self.rows[i];
        for &(j, x) in entries {
            match self.index[j] {
                0 => {
                    row.push((j, factor * x));
                    self.index[j] = row.len();
                }
                k => row[k - 1].1 += factor * x,
            }
        }
    }

    fn clear_places(&mut self, i: usize) {
        for &(j, _) in &self.rows[i] {
            self.index[j] = 0;
        }
    }

    /// Projects row `p` out of its neighbours, drops those of which no more than `tol` is left, and returns the others.
    fn accept(&mut self, p: usize, tol: f64) -> Vec<usize> {
        self.waiting[p] = false;
        let pivot = self.diagonal[p];
        let mut neighbours = std::mem::take(&mut self.rows[p]);
        neighbours.retain(|e| self.waiting[e.0]);
        for &(i, g) in &neighbours {
            self.diagonal[i] -= g * g / pivot;
            remove(&mut self.rows[i], p);
        }
        // At once: a dependent row that stayed would keep all its neighbours linked with one another.
        for &(i, _) in &neighbours {
            if self.diagonal[i].is_nan() || self.diagonal[i] <= tol {
                self.drop_row(i);
            }
        }
        neighbours.retain(|e| self.waiting[e.0]);
        for &(i, g) in &neighbours {
            for k in 0..self.rows[i].len() {
                self.index[self.rows[i][k].0] = k + 1;
            }
            self.add(i, neighbours.iter().filter(|e| e.0 != i), -g / pivot);
            self.clear_places(i);
            self.forget_negligible(i);
        }
        neighbours.into_iter().map(|e| e.0).collect()
    }

    /// Unlinks row `i` from rows it is perpendicular to within rounding, as distant loops are.
    fn forget_negligible(&mut self, i: usize) {
        let (diagonal, least) = (&self.diagonal, f64::EPSILON * f64::EPSILON * self.diagonal[i]);
        self.rows[i].retain(|&(j, g)| g * g > least * diagonal[j]);
    }

    /// Removes row `i` permanently; by Cauchy and Schwarz nothing but its own rounding errors depended on it.
    fn drop_row(&mut self, i: usize) {
        self.waiting[i] = false;
        self.largest_dropped = self.largest_dropped.max(self.diagonal[i]);
        for (j, _) in std::mem::take(&mut self.rows[i]) {
            remove(&mut self.rows[j], i);
        }
    }
}

/// Deletes the entry in column `j`.
fn remove(row: &mut Vec<(usize, f64)>, j: usize) {
    if let Some(index) = row.iter().position(|e| e.0 == j) {
        row.swap_remove(index);
    }
}

/// Row `i` scaled to length 1, behind `rows`; its length. Nothing of it if it is zero or not finite.
fn unit_row(pattern: &Pattern, values: &[f64], col_scale: &[f64], i: usize, rows: &mut Vec<(usize, f64)>) -> f64 {
    let first = rows.len();
    rows.extend(
        pattern.row(i).map(|p| (pattern.col_idx[p], values[p] * col_scale[pattern.col_idx[p]])).filter(|e| e.1 != 0.0),
    );
    let row = &mut rows[first..];
    if row.iter().any(|e| !e.1.is_finite()) {
        rows.truncate(first);
        return 0.0;
    }
    // By the largest entry first, so that squares neither overflow nor vanish.
    let largest = row.iter().fold(0.0, |m: f64, e| m.max(e.1.abs()));
    row.iter_mut().for_each(|e| e.1 /= largest);
    let length = row.iter().map(|e| e.1 * e.1).sum::<f64>().sqrt();
    row.iter_mut().for_each(|e| e.1 /= length);
    length * largest
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dense::{pivoted_cholesky, Matrix};

    fn of_dense(c: &Matrix, tol: f64) -> RowRank {
        independent_rows(&Pattern::dense(c.rows(), c.cols()), c.data(), &vec![1.0; c.cols()], tol)
    }

    fn random(rng: &mut fastrand::Rng, rows: usize, cols: usize) -> Matrix {
        Matrix::from_vec(rows, cols, (0..rows * cols).map(|_| 2.0 * rng.f64() - 1.0).collect())
    }

    #[test]
    fn rows_that_come_last_are_those_left_out() {
        let mut rng = fastrand::Rng::with_seed(52);
        for _ in 0..50 {
            // six rows of rank four, the first two to come last
            let c = random(&mut rng, 6, 4).matmul(&random(&mut rng, 4, 7));
            let pattern = Pattern::dense(6, 7);
            for tol in [1e-9, 0.0] {
                let found = preferred_rows(&pattern, c.data(), &[1.0; 7], tol, (1e-9, &|i| i < 2));
                let mut kept = found.kept[..4].to_vec();
                kept.sort_unstable();
                assert_eq!(kept, [2, 3, 4, 5], "the others are independent and suffice");
            }
        }
    }

    #[test]
    fn rank_of_a_product_is_the_inner_size() {
        let mut rng = fastrand::Rng::with_seed(51);
        for rank in 0..7 {
            let c = random(&mut rng, 9, rank).matmul(&random(&mut rng, rank, 8));
            let found = of_dense(&c, 1e-9);
            assert_eq!((found.rank, found.dropped.len()), (rank, 9 - rank));
            assert!(found.pivots.windows(2).all(|w| w[0] >= w[1]));
            assert!(found.gap > 1e3);
        }
    }

    #[test]
    fn agrees_with_the_dense_factorisation() {
        let mut rng = fastrand::Rng::with_seed(52);
        for _ in 0..20 {
            let c = random(&mut rng, 8, 12);
            let mut gram = c.matmul(&c.transpose());
            let d: Vec<f64> = (0..8).map(|i| gram[(i, i)].sqrt()).collect();
            for i in 0..8 {
                for j in 0..8 {
                    gram[(i, j)] = if i == j { 1.0 } else { gram[(i, j)] / (d[i] * d[j]) };
                }
            }
            let mut perm = [0; 8];
            assert_eq!(pivoted_cholesky(gram.data_mut(), 8, 8, 1e-10, &mut perm), 8);
            let found = of_dense(&c, 1e-10);
            assert_eq!(found.kept, perm);
            for (k, p) in found.pivots.iter().enumerate() {
                assert!((p - gram[(k, k)].powi(2)).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn pivot_is_the_squared_sine() {
        let angle: f64 = 0.3;
        let c = Matrix::from_rows(&[&[2.0, 0.0], &[5.0 * angle.cos(), 5.0 * angle.sin()]]);
        let found = of_dense(&c, 1e-10);
        assert_eq!(found.kept, [0, 1]);
        assert!((found.pivots[1] - angle.sin().powi(2)).abs() < 1e-15);
        assert_eq!(found.gap, f64::INFINITY);
    }

    #[test]
    fn units_of_rows_change_nothing() {
        let mut rng = fastrand::Rng::with_seed(53);
        let c = random(&mut rng, 6, 4).matmul(&random(&mut rng, 4, 9));
        let mut scaled = c.clone();
        for i in 0..6 {
            scaled.row_mut(i).iter_mut().for_each(|x| *x *= 1024_f64.powi(i as i32 - 3));
        }
        assert_eq!(of_dense(&c, 1e-9), of_dense(&scaled, 1e-9));
    }

    #[test]
    fn column_scales_act_like_scaled_columns() {
        let mut rng = fastrand::Rng::with_seed(54);
        let c = random(&mut rng, 5, 7);
        let scale: Vec<f64> = (0..7).map(|j| 2_f64.powi(j - 3)).collect();
        let mut scaled = c.clone();
        for i in 0..5 {
            for j in 0..7 {
                scaled[(i, j)] *= scale[j];
            }
        }
        assert_eq!(independent_rows(&Pattern::dense(5, 7), c.data(), &scale, 1e-9), of_dense(&scaled, 1e-9));
    }

    #[test]
    fn zero_and_unusable_rows_are_dropped_and_ties_go_to_the_lower_index() {
        let c = Matrix::from_rows(&[&[0.0, 0.0], &[1.0, 0.0], &[3.0, 0.0], &[f64::NAN, 1.0], &[0.0, 1e-200]]);
        let found = of_dense(&c, 1e-10);
        assert_eq!((found.kept, found.dropped), (vec![1, 4], vec![0, 2, 3]));
        assert_eq!(found.largest_dropped, 0.0);
        assert_eq!(of_dense(&Matrix::new(0, 3), 1e-10).rank, 0);
    }

    /// A chain of loops in joint angles that transmit with a ratio near 1; the third row of each is made of the others.
    fn chain(rng: &mut fastrand::Rng, loops: usize) -> (Pattern, Vec<f64>) {
        let (mut columns, mut values) = (Vec::new(), Vec::new());
        for first in (0..loops).map(|l| 2 * l) {
            let (coupler, ratio) = (2.0 * rng.f64() - 1.0, 0.95 + 0.1 * rng.f64());
            let pair: Vec<[f64; 3]> = (0..2)
                .map(|_| {
                    let (x, y) = (0.5 + rng.f64(), rng.f64() - 1.5);
                    [x * coupler + y * ratio, -x, -y]
                })
                .collect();
            let third = [0, 1, 2].map(|k| pair[0][k] - 3.0 * pair[1][k]);
            for row in [pair[0], pair[1], third] {
                columns.push((first..first + 3).collect::<Vec<_>>());
                values.extend(row);
            }
        }
        (Pattern::from_rows(2 * loops + 1, &columns), values)
    }

    #[test]
    fn each_loop_of_a_long_chain_loses_its_redundant_row() {
        let mut rng = fastrand::Rng::with_seed(55);
        for loops in [10, 66, 67, 10_000] {
            let (pattern, values) = chain(&mut rng, loops);
            let clock = std::time::Instant::now();
            let found = independent_rows(&pattern, &values, &vec![1.0; pattern.cols], 1e-11);
            println!("{} rows: {:?}, gap {:e}", 3 * loops, clock.elapsed(), found.gap);
            assert_eq!(found.rank, 2 * loops);
            assert!(found.dropped.iter().enumerate().all(|(l, &i)| i / 3 == l));
            assert!(found.gap > 1e2);
        }
    }
}
