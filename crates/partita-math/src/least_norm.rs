//! Damped least-norm solutions with sparse rows, of any rank.
//!
//! ```text
//! min |C y − r|² + Σ_i μ_i z_i²,  y = Cᵀ z        [ 1  Cᵀ ] [  y ]   [ 0 ]
//!                                                 [ C  −μ ] [ −z ] = [ r ]
//! ```
//!
//! For μ → 0 this is the shortest y with C y = r, in the sense of least squares where the rows contradict. The matrix
//! is quasi-definite: it has a factorisation L D Lᵀ in any order, so the order is chosen for little fill (least
//! degree), once per pattern. Unknowns and rows form one system because neither C Cᵀ nor Cᵀ C alone is sparse for both
//! a ring of many links and a slide that many loops share.
//!
//! Where a row is eliminated before its unknowns, the factorisation divides by its small pivot −μ, and round-off grows
//! to ε/μ. Two refinements with the same factors remove it.

use crate::elimination::Pattern;
use std::cmp::Reverse;
use std::collections::{BTreeSet, BinaryHeap};

const NONE: usize = usize::MAX;
/// Refinements of a solution: each multiplies its error by ε/μ, so for μ = 1e-10 two leave round-off.
const REFINEMENTS: usize = 2;

/// The factorisation for one pattern. Cost of a solution: proportional to the factor, linear for a chain of loops.
#[derive(Clone, Debug)]
pub struct LeastNorm {
    rows: usize,
    cols: usize,
    /// Index of each unknown, then of each row, in the order of elimination.
    pivot_of: Vec<usize>,
    /// Whether the pivot at this index is that of an unknown (positive) or of a row: its number.
    row_at: Vec<usize>,
    /// Entries above the diagonal by column: where each column starts, then (row of the matrix, entry of C).
    upper_start: Vec<usize>,
    upper: Vec<(usize, usize)>,
    /// The matrix last factored: those entries, and the diagonal.
    entries: Vec<f64>,
    diagonal: Vec<f64>,
    parent: Vec<usize>,
    start: Vec<usize>,
    index: Vec<usize>,
    l: Vec<f64>,
    d: Vec<f64>,
    count: Vec<usize>,
    flag: Vec<usize>,
    path: Vec<usize>,
    work: Vec<f64>,
    solution: Vec<f64>,
}

/// Least degree first, ties by number; the graph of the remaining unknowns is stored explicitly.
fn least_degree(neighbours: &mut [BTreeSet<usize>]) -> Vec<usize> {
    let mut heap: BinaryHeap<Reverse<(usize, usize)>> =
        neighbours.iter().enumerate().map(|(v, n)| Reverse((n.len(), v))).collect();
    let mut gone = vec![false; neighbours.len()];
    let mut order = Vec::with_capacity(neighbours.len());
    while let Some(Reverse((degree, v))) = heap.pop() {
        if gone[v] || degree != neighbours[v].len() {
            continue; // an old entry
        }
        gone[v] = true;
        order.push(v);
        let around: Vec<usize> = std::mem::take(&mut neighbours[v]).into_iter().collect();
        for &u in &around {
            let before = neighbours[u].len();
            neighbours[u].remove(&v);
            neighbours[u].extend(around.iter().copied().filter(|&w| w != u));
            if neighbours[u].len() != before {
                heap.push(Reverse((neighbours[u].len(), u)));
            }
        }
    }
    order
}

impl LeastNorm {
    /// Choose the order of elimination and find the fill.
    pub fn new(pattern: &Pattern) -> Self {
        let (rows, cols) = (pattern.rows, pattern.cols);
        let size = rows + cols;
        let mut neighbours = vec![BTreeSet::new(); size];
        for i in 0..rows {
            for e in pattern.row(i) {
                neighbours[cols + i].insert(pattern.col_idx[e]);
                neighbours[pattern.col_idx[e]].insert(cols + i);
            }
        }
        let order = least_degree(&mut neighbours);
        let mut pivot_of = vec![0; size];
        order.iter().enumerate().for_each(|(k, &v)| pivot_of[v] = k);
        let row_at = order.iter().map(|&v| if v < cols { NONE } else { v - cols }).collect();
        let mut columns: Vec<Vec<(usize, usize)>> = vec![Vec::new(); size];
        for i in 0..rows {
            for e in pattern.row(i) {
                let (a, b) = (pivot_of[pattern.col_idx[e]], pivot_of[cols + i]);
                columns[a.max(b)].push((a.min(b), e));
            }
        }
        let mut upper_start = vec![0];
        let mut upper = Vec::with_capacity(pattern.nnz());
        for column in &columns {
            upper.extend_from_slice(column);
            upper_start.push(upper.len());
        }
        // elimination tree and number of entries in each column of L
        let (mut parent, mut flag, mut count) = (vec![NONE; size], vec![NONE; size], vec![0; size]);
        for k in 0..size {
            flag[k] = k;
            for &(i, _) in &columns[k] {
                let mut i = i;
                while flag[i] != k {
                    if parent[i] == NONE {
                        parent[i] = k;
                    }
                    count[i] += 1;
                    flag[i] = k;
                    i = parent[i];
                }
            }
        }
        let mut start = vec![0];
        for c in &count {
            start.push(start[start.len() - 1] + c);
        }
        let fill = start[size];
        Self {
            rows,
            cols,
            pivot_of,
            row_at,
            upper_start,
            entries: vec![0.0; upper.len()],
            diagonal: vec![1.0; size],
            upper,
            parent,
            start,
            index: vec![0; fill],
            l: vec![0.0; fill],
            d: vec![1.0; size],
            count,
            flag,
            path: vec![0; size],
            work: vec![0.0; size],
            solution: vec![0.0; size],
        }
    }

    /// Entries of L below the diagonal.
    pub fn fill(&self) -> usize {
        self.l.len()
    }

    /// Factor for the values of C in pattern order and the damping μ > 0 of each row.
    ///
    /// In exact arithmetic the pivot of an unknown is at least 1 and that of a row at most −μ; pivots that round-off
    /// moves past these bounds are reset to them, so that the factorisation exists for any finite values.
    pub fn factor(&mut self, values: &[f64], mu: &[f64]) {
        let size = self.rows + self.cols;
        self.flag.fill(NONE);
        self.count.fill(0);
        self.work.fill(0.0);
        for k in 0..size {
            // pattern of row k of L: paths of the elimination tree, collected from the back
            let mut top = size;
            self.flag[k] = k;
            for at in self.upper_start[k]..self.upper_start[k + 1] {
                let (i, e) = self.upper[at];
                self.entries[at] = values[e];
                self.work[i] += values[e];
                let (mut i, mut length) = (i, 0);
                while self.flag[i] != k {
                    self.path[length] = i;
                    length += 1;
                    self.flag[i] = k;
                    i = self.parent[i];
                }
                while length > 0 {
                    top -= 1;
                    length -= 1;
                    self.path[top] = self.path[length];
                }
            }
            let limit = if self.row_at[k] == NONE { 1.0 } else { -mu[self.row_at[k]] };
            self.diagonal[k] = limit;
            let mut pivot = limit;
            for &i in &self.path[top..size] {
                let y = std::mem::take(&mut self.work[i]);
                let (from, to) = (self.start[i], self.start[i] + self.count[i]);
                for (j, l) in self.index[from..to].iter().zip(&self.l[from..to]) {
                    self.work[*j] -= l * y;
                }
                let entry = y / self.d[i];
                pivot -= entry * y;
                self.index[to] = k;
                self.l[to] = entry;
                self.count[i] += 1;
            }
            self.d[k] = if limit > 0.0 { pivot.max(limit) } else { pivot.min(limit) };
        }
    }

    /// y for the right-hand side r of the last factorisation.
    pub fn solve(&mut self, r: &[f64], y: &mut [f64]) {
        self.solution.fill(0.0);
        for pass in 0..=REFINEMENTS {
            self.work.fill(0.0);
            for (r, &k) in r.iter().zip(&self.pivot_of[self.cols..]) {
                self.work[k] = *r;
            }
            if pass > 0 {
                self.subtract_product();
            }
            self.back_and_forth();
            self.solution.iter_mut().zip(&self.work).for_each(|(x, d)| *x += d);
        }
        y.iter_mut().zip(&self.pivot_of).for_each(|(y, &k)| *y = self.solution[k]);
    }

    /// z of the last solution: the weights of the rows in y = Cᵀ z.
    pub fn weights(&self, z: &mut [f64]) {
        z.iter_mut().zip(&self.pivot_of[self.cols..]).for_each(|(z, &k)| *z = -self.solution[k]);
    }

    /// `work ← work − A solution`.
    fn subtract_product(&mut self) {
        for k in 0..self.d.len() {
            let x = self.solution[k];
            let mut sum = self.diagonal[k] * x;
            for at in self.upper_start[k]..self.upper_start[k + 1] {
                let (i, a) = (self.upper[at].0, self.entries[at]);
                sum += a * self.solution[i];
                self.work[i] -= a * x;
            }
            self.work[k] -= sum;
        }
    }

    /// `work ← (L D Lᵀ)⁻¹ work`.
    fn back_and_forth(&mut self) {
        let size = self.d.len();
        for k in 0..size {
            let x = self.work[k];
            if x != 0.0 {
                let range = self.start[k]..self.start[k + 1];
                for (j, l) in self.index[range.clone()].iter().zip(&self.l[range]) {
                    self.work[*j] -= l * x;
                }
            }
        }
        self.work.iter_mut().zip(&self.d).for_each(|(x, d)| *x /= d);
        for k in (0..size).rev() {
            let range = self.start[k]..self.start[k + 1];
            let sum: f64 = self.index[range.clone()].iter().zip(&self.l[range]).map(|(j, l)| l * self.work[*j]).sum();
            self.work[k] -= sum;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dense::samples::random;
    use crate::dense::Matrix;
    use crate::factor;

    fn solved(pattern: &Pattern, c: &[f64], mu: f64, r: &[f64]) -> Vec<f64> {
        let mut f = LeastNorm::new(pattern);
        f.factor(c, &vec![mu; pattern.rows]);
        let mut y = vec![0.0; pattern.cols];
        f.solve(r, &mut y);
        y
    }

    fn gap(x: &[f64], y: &[f64]) -> f64 {
        x.iter().zip(y).fold(0.0, |m, (x, y)| f64::max(m, (x - y).abs()))
    }

    #[test]
    fn damped_solutions_satisfy_their_normal_equations() {
        let mut rng = fastrand::Rng::with_seed(71);
        for (m, n) in [(1, 1), (3, 8), (8, 3), (6, 6), (0, 4), (20, 30)] {
            let c = random(&mut rng, m, n);
            let r = random(&mut rng, m, 1).into_vec();
            for mu in [1e-6, 1e-2, 1.0] {
                let y = solved(&Pattern::dense(m, n), c.data(), mu, &r);
                // (Cᵀ C + μ) y = Cᵀ r
                let left: Vec<f64> =
                    c.transpose().matvec(&c.matvec(&y)).iter().zip(&y).map(|(a, y)| a + mu * y).collect();
                assert!(gap(&left, &c.transpose().matvec(&r)) < 1e-9);
            }
        }
    }

    #[test]
    fn little_damping_gives_the_shortest_solution_of_rows_that_repeat() {
        let mut rng = fastrand::Rng::with_seed(72);
        for rank in 1..4 {
            let c = random(&mut rng, 6, rank).matmul(&random(&mut rng, rank, 7));
            let r = random(&mut rng, 6, 1).into_vec();
            let (x, _) = factor::least_squares_min_norm(&c, &r, 1e-9).unwrap();
            let size = x.iter().fold(1.0, |m: f64, x| m.max(x.abs()));
            let y = solved(&Pattern::dense(6, 7), c.data(), 1e-10, &r);
            // the damping changes μ/σ² of y, rounding ε/μ of what the rows contradict by
            assert!(gap(&x, &y) < 1e-5 * size, "{}", gap(&x, &y));
        }
    }

    #[test]
    fn chains_rings_and_shared_columns_fill_in_proportion_to_their_length() {
        let fill = |rows: &[Vec<usize>], cols| LeastNorm::new(&Pattern::from_rows(cols, rows)).fill();
        // loops in series, three rows each, sharing a column with the next
        let chain = |n: usize| {
            fill(&(0..3 * n).map(|i| (2 * (i / 3)..2 * (i / 3) + 4).collect()).collect::<Vec<_>>(), 2 * n + 2)
        };
        assert!(chain(400) < 11 * chain(40));
        // one ring
        let ring = |n: usize| fill(&vec![(0..n).collect::<Vec<_>>(); 3], n);
        assert!(ring(400) < 11 * ring(40));
        // loops on one common column
        let star = |n: usize| {
            fill(&(0..2 * n).map(|i| vec![0, 1 + 2 * (i / 2), 2 + 2 * (i / 2)]).collect::<Vec<_>>(), 2 * n + 1)
        };
        assert!(star(400) < 11 * star(40));
    }

    /// Rows of one unknown each go first, with the pivot −μ: what they divide by comes back in the refinements.
    #[test]
    fn rows_that_go_first_cost_no_digits() {
        let mut rng = fastrand::Rng::with_seed(74);
        let mut rows: Vec<Vec<usize>> = (0..20).map(|i| vec![i, i + 1]).collect();
        rows.extend((0..19).map(|i| vec![i, i + 1, i + 2]));
        let pattern = Pattern::from_rows(41, &rows);
        let values: Vec<f64> = (0..pattern.nnz()).map(|_| 0.5 + rng.f64()).collect();
        let r = random(&mut rng, 39, 1).into_vec();
        let mut dense = Matrix::new(39, 41);
        for i in 0..39 {
            pattern.row(i).for_each(|e| dense[(i, pattern.col_idx[e])] = values[e]);
        }
        let y = solved(&pattern, &values, 1e-10, &r);
        // y in the row space of C, to round-off of its size
        let (p, _) = factor::least_squares_min_norm(&dense, &dense.matvec(&y), 1e-12).unwrap();
        let size = y.iter().fold(1.0, |m: f64, x| m.max(x.abs()));
        assert!(gap(&p, &y) < 1e-12 * size, "{:e} of {size:e}", gap(&p, &y));
    }

    #[test]
    fn sparse_and_dense_agree() {
        let mut rng = fastrand::Rng::with_seed(73);
        let rows: Vec<Vec<usize>> = (0..60).map(|i| vec![i / 2, i / 2 + 1, i / 2 + 3, 40]).collect();
        let pattern = Pattern::from_rows(41, &rows);
        let values: Vec<f64> = (0..pattern.nnz()).map(|_| rng.f64() - 0.5).collect();
        let mut dense = Matrix::new(60, 41);
        for i in 0..60 {
            pattern.row(i).for_each(|e| dense[(i, pattern.col_idx[e])] = values[e]);
        }
        let r = random(&mut rng, 60, 1).into_vec();
        let x = solved(&Pattern::dense(60, 41), dense.data(), 1e-4, &r);
        assert!(gap(&x, &solved(&pattern, &values, 1e-4, &r)) < 1e-9);
    }
}
