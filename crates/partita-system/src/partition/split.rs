//! C split into its independent and dependent columns, as dense matrices for inspection.                     (P1, P2)

use super::Partition;
use crate::error::SystemError;
use partita_math::dense::{self, Matrix};

/// A = −C_D⁻¹ C_I and D = [1 Aᵀ] of a partition, all indices ascending.
#[derive(Clone, Debug)]
pub struct Split {
    /// I (k).
    pub independent: Vec<usize>,
    /// D (r).
    pub dependent: Vec<usize>,
    /// Rows kept (r).
    pub rows: Vec<usize>,
    /// A (r x k).
    pub a: Matrix,
    /// D (k x n), columns in the order of the coordinates.
    pub d: Matrix,
    factors: Vec<f64>,
    pivots: Vec<usize>,
}

impl Split {
    /// For C (m x n) at time t.
    ///
    /// # Errors
    /// `Singular` where C_D is.
    pub fn new(t: f64, partition: &Partition, c: &Matrix) -> Result<Self, SystemError> {
        let sorted = |x: &[usize]| {
            let mut x = x.to_vec();
            x.sort_unstable();
            x
        };
        let (independent, dependent) = (sorted(&partition.independent), sorted(&partition.dependent));
        let rows = sorted(&partition.rows);
        let (k, r, n) = (independent.len(), rows.len(), c.cols());
        let mut factors: Vec<f64> = rows.iter().flat_map(|&i| dependent.iter().map(move |&j| c[(i, j)])).collect();
        let mut pivots = vec![0; r];
        dense::lu(&mut factors, r, &mut pivots).map_err(|_| SystemError::Singular { t, pivot: 0.0, limit: 0.0 })?;
        let mut split =
            Self { a: Matrix::new(r, k), d: Matrix::new(k, n), independent, dependent, rows, factors, pivots };
        let mut column = vec![0.0; r];
        for j in 0..k {
            split.d[(j, split.independent[j])] = 1.0;
            column.iter_mut().zip(&split.rows).for_each(|(x, &i)| *x = -c[(i, split.independent[j])]);
            split.solve(&mut column);
            for (p, x) in column.iter().enumerate() {
                split.a[(p, j)] = *x;
                split.d[(j, split.dependent[p])] = *x;
            }
        }
        Ok(split)
    }

    /// `x ← C_D⁻¹ x`.
    pub fn solve(&self, x: &mut [f64]) {
        dense::lu_solve(&self.factors, self.rows.len(), &self.pivots, x);
    }

    /// `x ← C_D⁻ᵀ x`.
    pub fn solve_transposed(&self, x: &mut [f64]) {
        dense::lu_solve_transposed(&self.factors, self.rows.len(), &self.pivots, x);
    }

    /// `−C_D⁻¹ x` of the kept among all rows: η from a, ξ from b.                                  (P1)
    pub fn offset(&self, x: &[f64]) -> Vec<f64> {
        let mut y: Vec<f64> = self.rows.iter().map(|&i| -x[i]).collect();
        self.solve(&mut y);
        y
    }

    /// `Dᵀ u + [0; offset]`.                                                                    (P2)
    pub fn spread(&self, u: &[f64], offset: &[f64]) -> Vec<f64> {
        let mut v = self.d.transpose().matvec(u);
        for (&i, x) in self.dependent.iter().zip(offset) {
            v[i] += x;
        }
        v
    }
}
