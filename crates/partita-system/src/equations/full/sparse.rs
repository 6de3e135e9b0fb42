//! The full equations with multipliers, eliminated with their sparsity.
//!
//! ```text
//! [ M  Cᵀ ] [ v' ]   [  h ]
//! [ C  0  ] [ −λ ] = [ −b ]
//! ```
//! (S1, S5). The sparse counterpart of [`Saddle`](super::saddle::Saddle): M and C keep their zeros, pivots are
//! chosen once for little fill (Markowitz) among entries that are not small, and an evaluation executes the elimination
//! without searching. A new plan is made when a pivot has shrunk or other rows are kept. Cost per evaluation: that of
//! the fill, proportional to the bodies where loops are connected as in a chain. The reference for large mechanisms.

use super::{AccelerationRule, Failure, Instant};
use partita_math::elimination::{Pattern, Plan, PlanError, PlanOptions};

/// `v'` and λ from the sparse saddle-point matrix.
pub struct Sparse {
    n: usize,
    mass: Pattern,
    /// Of the whole matrix, all rows of C in it.
    pattern: Pattern,
    values: Vec<f64>,
    /// Indices of the entries of M, and of each entry of C below and beside it.
    mass_entries: Vec<usize>,
    c_entries: Vec<[usize; 2]>,
    /// Index of each diagonal entry of M.
    diagonal: Vec<usize>,
    scale: Vec<f64>,
    lent: Vec<f64>,
    plan: Option<Plan>,
    /// The rows it was planned for.
    rows: Vec<usize>,
    factors: Vec<f64>,
    x: Vec<f64>,
    plans: u64,
}

impl Sparse {
    /// For M (n x n) and C (m x n) with these patterns.
    pub fn new(mass: Pattern, c: &Pattern) -> Self {
        let (n, m) = (mass.rows, c.rows);
        let mut rows: Vec<Vec<usize>> = (0..n).map(|i| mass.col_idx[mass.row(i)].to_vec()).collect();
        // M stands first in each of its rows, then the columns of C below it, in their order
        for i in 0..m {
            c.col_idx[c.row(i)].iter().for_each(|&j| rows[j].push(n + i));
        }
        rows.extend((0..m).map(|i| c.col_idx[c.row(i)].to_vec()));
        let pattern = Pattern::from_rows(n + m, &rows);
        let mass_entries = (0..n).flat_map(|i| (0..mass.row(i).len()).map(move |e| (i, e)));
        let mass_entries: Vec<usize> = mass_entries.map(|(i, e)| pattern.row_ptr[i] + e).collect();
        let mut next: Vec<usize> = (0..n).map(|i| pattern.row_ptr[i] + mass.row(i).len()).collect();
        let mut c_entries = Vec::with_capacity(c.nnz());
        for i in 0..m {
            for (e, &j) in c.col_idx[c.row(i)].iter().enumerate() {
                c_entries.push([pattern.row_ptr[n + i] + e, next[j]]);
                next[j] += 1;
            }
        }
        // a row without a diagonal is that of a velocity without inertia, which is refused when a plan is made
        let diagonal = (0..n).map(|i| mass.row(i).find(|&e| mass.col_idx[e] == i).unwrap_or(usize::MAX)).collect();
        Self {
            n,
            values: vec![0.0; pattern.nnz()],
            mass_entries,
            c_entries,
            diagonal,
            scale: vec![0.0; n + m],
            lent: vec![0.0; n],
            plan: None,
            rows: Vec::with_capacity(m),
            factors: Vec::new(),
            x: vec![0.0; n + m],
            plans: 0,
            mass,
            pattern,
        }
    }

    /// Choose pivots for the current values.
    fn make_plan(&mut self, x: &Instant) -> Result<(), Failure> {
        let (n, all) = (self.n, self.pattern.rows);
        // where M is singular, as large as the rows of C would make its diagonal: they are eliminated with it
        self.lent.fill(0.0);
        for &row in x.rows.iter().filter(|_| !x.scales.is_empty()) {
            for e in x.pattern.row(row) {
                self.lent[x.pattern.col_idx[e]] += (x.scales[row] * x.c[e]).powi(2);
            }
        }
        for (i, &entry) in self.diagonal.iter().enumerate() {
            let pivot = x.mass.get(entry).copied().unwrap_or(0.0) + self.lent[i];
            // a NaN is not above zero either
            if !(pivot > 0.0 && pivot.is_finite()) {
                return Err(Failure::Mass { index: i, pivot });
            }
            self.scale[i] = 1.0 / pivot.sqrt();
        }
        let mut eligible = vec![true; all];
        eligible[n..].fill(false);
        for &row in x.rows {
            eligible[n + row] = true;
            let size: f64 = x.pattern.row(row).map(|e| (x.c[e] * self.scale[x.pattern.col_idx[e]]).powi(2)).sum();
            self.scale[n + row] = if size > 0.0 { 1.0 / size.sqrt() } else { 0.0 };
        }
        let (rank, scale) = (n + x.rows.len(), &self.scale);
        let options = PlanOptions::default();
        let made = Plan::new(&self.pattern, &self.values, &eligible, &eligible, scale, scale, rank, options);
        let plan = made.map_err(|e| match e {
            PlanError::RankDeficient { best, .. } => Failure::Rows { sine2: best * best },
            PlanError::NotFinite { row } if row < n => Failure::Mass { index: row, pivot: f64::NAN },
            PlanError::NotFinite { .. } => Failure::Rows { sine2: f64::NAN },
        })?;
        self.factors.clear();
        self.factors.resize(plan.factor_len(), 0.0);
        self.rows.clear();
        self.rows.extend_from_slice(x.rows);
        self.plans += 1;
        self.plan = Some(plan);
        Ok(())
    }

    /// Factor the matrix of an instant.
    fn factor(&mut self, x: &Instant) -> Result<(), Failure> {
        for (&entry, value) in self.mass_entries.iter().zip(x.mass) {
            self.values[entry] = *value;
        }
        for (entries, value) in self.c_entries.iter().zip(x.c) {
            (self.values[entries[0]], self.values[entries[1]]) = (*value, *value);
        }
        if let Some(plan) = self.plan.as_ref().filter(|_| self.rows == x.rows) {
            if plan.factor(&self.values, &mut self.factors).is_ok() {
                return Ok(());
            }
        }
        self.make_plan(x)?;
        let plan = self.plan.as_ref().map(|plan| plan.factor(&self.values, &mut self.factors));
        match plan {
            Some(Err(e)) => Err(Failure::Rows { sine2: e.pivot * e.pivot }),
            _ => Ok(()),
        }
    }

    /// Solve for a right-hand side, velocities and rows of C: `upper` (n) and `lower` (of all rows), entry by entry.
    fn solved(&mut self, upper: impl Fn(usize) -> f64, lower: impl Fn(usize) -> f64, mut put: impl FnMut(usize, f64)) {
        let Some(plan) = &self.plan else { return };
        let n = self.n;
        let x = &mut self.x[..plan.rank()];
        for (x, &i) in x.iter_mut().zip(plan.pivot_rows()) {
            *x = if i < n { upper(i) } else { lower(i - n) };
        }
        plan.solve(&self.factors, x, 1);
        x.iter().zip(plan.pivot_cols()).for_each(|(x, &j)| put(j, *x));
    }
}

impl AccelerationRule for Sparse {
    fn name(&self) -> &'static str {
        "sparse-multipliers"
    }

    fn mass_pattern(&self) -> Option<&Pattern> {
        Some(&self.mass)
    }

    fn solve(&mut self, x: &Instant, vdot: &mut [f64], lambda: &mut [f64]) -> Result<u64, Failure> {
        self.factor(x)?;
        let n = self.n;
        self.solved(
            |i| x.h[i],
            |i| -x.b[i],
            |j, y| match j.checked_sub(n) {
                None => vdot[j] = y,
                Some(row) => lambda[row] = -y,
            },
        );
        Ok(0)
    }

    /// `[M Cᵀ; C 0] [Δ; ·] = [0; −x]`, with the same elimination.
    fn least_move(&mut self, x: &Instant, violation: &[f64], out: &mut [f64]) -> Option<Result<(), Failure>> {
        if let Err(e) = self.factor(x) {
            return Some(Err(e));
        }
        let n = self.n;
        self.solved(
            |_| 0.0,
            |i| -violation[i],
            |j, y| {
                if j < n {
                    out[j] = y;
                }
            },
        );
        Some(Ok(()))
    }

    fn plans(&self) -> u64 {
        self.plans
    }
}
