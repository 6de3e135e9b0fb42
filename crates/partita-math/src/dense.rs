//! Small dense matrices: row-major storage, and in-place kernels that allocate nothing.
//!
//! [`Matrix`] owns its numbers and is meant for set-up and results. The kernels work on plain slices, entry `(i, j)` of an
//! `n`-column matrix at `i n + j`, and are meant for evaluations: up to about n = 40 they beat a blocked library; above,
//! see [`factor`](crate::factor).

mod cholesky;
mod ldlt;
mod lu;
mod matrix;

pub use cholesky::{
    cholesky, cholesky_backward, cholesky_forward, cholesky_solve, inverse_from_cholesky, pivoted_cholesky,
    NotPositiveDefinite,
};
pub use ldlt::{ldlt, ldlt_solve};
pub use lu::{lu, lu_determinant, lu_pivot_ratio, lu_solve, lu_solve_transposed, Singular};
pub use matrix::Matrix;

/// Scalar product `xᵀ y` over the shorter length.
#[inline]
pub fn dot(x: &[f64], y: &[f64]) -> f64 {
    let n = x.len().min(y.len());
    let (x, y) = (x[..n].chunks_exact(4), y[..n].chunks_exact(4));
    let tail: f64 = x.remainder().iter().zip(y.remainder()).map(|(a, b)| a * b).sum();
    // Four sums side by side: the additions need not wait for one another.
    let mut sums = [0.0; 4];
    for (a, b) in x.zip(y) {
        for k in 0..4 {
            sums[k] += a[k] * b[k];
        }
    }
    (sums[0] + sums[1]) + (sums[2] + sums[3]) + tail
}

/// `y ← y + alpha x` over the shorter length.
#[inline]
pub fn axpy(alpha: f64, x: &[f64], y: &mut [f64]) {
    for (t, s) in y.iter_mut().zip(x) {
        *t += alpha * s;
    }
}

#[cfg(test)]
pub(crate) mod samples {
    //! Random matrices for the theorems below.
    use super::Matrix;

    /// Entries uniform in (−1, 1).
    pub(crate) fn random(random: &mut fastrand::Rng, rows: usize, cols: usize) -> Matrix {
        let data = (0..rows * cols).map(|_| 2.0 * random.f64() - 1.0).collect();
        Matrix::from_vec(rows, cols, data)
    }

    /// `X Xᵀ + 0.1` with random X.
    pub(crate) fn positive_definite(rng: &mut fastrand::Rng, n: usize) -> Matrix {
        let x = random(rng, n, n);
        let mut a = x.matmul(&x.transpose());
        for i in 0..n {
            a[(i, i)] += 0.1;
        }
        a
    }

    /// Largest difference of two sequences; NaN if any.
    pub(crate) fn distance(x: &[f64], y: &[f64]) -> f64 {
        assert_eq!(x.len(), y.len());
        let differences = x.iter().zip(y).map(|(a, b)| a - b).collect();
        Matrix::from_vec(x.len(), 1, differences).max_abs()
    }
}
