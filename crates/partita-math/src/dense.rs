//! Small dense matrices: row-major storage, and in-place kernels that allocate nothing.
//!
//! [`Matrix`] owns its numbers and is meant for set-up and results. The kernels work on plain slices, entry `(i, j)` of
//! an `n`-column matrix at `i n + j`, and are meant for evaluations: up to about n = 40 they are faster than a blocked
//! library; above, see [`factor`](crate::factor). They are written over any [`Scalar`]; those that choose or check
//! pivots need values ([`Real`](crate::scalar::Real)) and have a variant that runs in a given order without checks.

use crate::scalar::Scalar;

mod cholesky;
mod complex;
mod ldlt;
mod lu;
mod matrix;

pub use cholesky::{
    cholesky, cholesky_backward, cholesky_forward, cholesky_solve, cholesky_straight, inverse_from_cholesky,
    pivoted_cholesky, NotPositiveDefinite,
};
pub use complex::{lu_complex, lu_complex_solve, Complex};
pub use ldlt::{ldlt, ldlt_solve, ldlt_straight};
pub use lu::{lu, lu_determinant, lu_in_order, lu_pivot_ratio, lu_solve, lu_solve_many, lu_solve_transposed, Singular};
pub use matrix::Matrix;

/// Scalar product `xᵀ y` over the shorter length.
#[inline]
pub fn dot<T: Scalar>(x: &[T], y: &[T]) -> T {
    let n = x.len().min(y.len());
    let (x, y) = (x[..n].chunks_exact(4), y[..n].chunks_exact(4));
    let mut tail = T::zero();
    for (&a, &b) in x.remainder().iter().zip(y.remainder()) {
        tail += a * b;
    }
    // Four sums side by side: the additions need not wait for one another.
    let mut sums = [T::zero(); 4];
    for (a, b) in x.zip(y) {
        for k in 0..4 {
            sums[k] += a[k] * b[k];
        }
    }
    (sums[0] + sums[1]) + (sums[2] + sums[3]) + tail
}

/// `y ← y + alpha x` over the shorter length.
#[inline]
pub fn axpy<T: Scalar>(alpha: T, x: &[T], y: &mut [T]) {
    for (t, &s) in y.iter_mut().zip(x) {
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

#[cfg(test)]
mod over_scalars {
    use super::samples::{positive_definite, random};
    use super::*;
    use crate::scalar::{Dual, Lanes};

    /// A⁻¹ b by all three factorisations; A in front, then b.
    fn solutions<T: Scalar>(n: usize, input: &[T], piv: &[usize]) -> Vec<T> {
        let (a, b) = input.split_at(n * n);
        let mut out = Vec::new();
        let (mut f, mut x) = (a.to_vec(), b.to_vec());
        cholesky_straight(&mut f, n);
        cholesky_solve(&f, n, &mut x);
        out.extend(x);
        let (mut f, mut x) = (a.to_vec(), b.to_vec());
        ldlt_straight(&mut f, n);
        ldlt_solve(&f, n, &mut x);
        out.extend(x);
        let (mut f, mut x) = (a.to_vec(), b.to_vec());
        lu_in_order(&mut f, n, piv);
        lu_solve(&f, n, piv, &mut x);
        lu_solve_transposed(&f, n, piv, &mut x);
        out.extend(x);
        out
    }

    /// The derivative of A⁻¹ b is A⁻¹ (b' − A' A⁻¹ b); lanes are single solutions.
    #[test]
    fn factors_carry_derivatives_and_lanes() {
        let mut rng = fastrand::Rng::with_seed(71);
        for n in 1..8 {
            let (a, b) = (positive_definite(&mut rng, n), random(&mut rng, n, 1));
            let slope = random(&mut rng, n, n);
            let slope = slope.matmul(&slope.transpose());
            let (mut f, mut piv) = (a.data().to_vec(), vec![0; n]);
            lu(&mut f, n, &mut piv).unwrap();
            let input: Vec<f64> = a.data().iter().chain(b.data()).copied().collect();
            let along: Vec<f64> = slope.data().iter().copied().chain(std::iter::repeat_n(0.5, n)).collect();
            let plain = solutions(n, &input, &piv);
            let duals: Vec<Dual> = input.iter().zip(&along).map(|(x, d)| Dual::new(*x, [*d])).collect();
            let duals = solutions(n, &duals, &piv);
            let mut exact: Vec<f64> = slope.matvec(&plain[..n]).iter().map(|x| 0.5 - x).collect();
            lu_solve(&f, n, &piv, &mut exact);
            for i in 0..n {
                for x in [duals[i], duals[n + i]] {
                    // the condition of A is some hundreds, and comes in twice
                    assert!((x.eps[0] - exact[i]).abs() < 1e-9 * (1.0 + exact[i].abs()), "{} {}", x.eps[0], exact[i]);
                }
            }
            assert!(duals.iter().zip(&plain).all(|(x, y)| x.re.to_bits() == y.to_bits()));
            let lanes: Vec<Lanes> =
                (0..input.len()).map(|i| Lanes::from_fn(|l| input[i] + 0.01 * l as f64 * along[i])).collect();
            let lanes = solutions(n, &lanes, &piv);
            for l in 0..Lanes::COUNT {
                let there: Vec<f64> = input.iter().zip(&along).map(|(x, d)| x + 0.01 * l as f64 * d).collect();
                let single = solutions(n, &there, &piv);
                assert!(single.iter().zip(&lanes).all(|(x, y)| x.to_bits() == y.0[l].to_bits()));
            }
        }
    }
}
