//! Cholesky factors of symmetric positive definite matrices, plain and with diagonal pivoting.

use crate::scalar::{Real, Scalar};
use crate::tolerance;
use std::convert::Infallible;

/// A symmetric matrix turned out not to be numerically positive definite.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error(
    "pivot {index} is {pivot:e}: the matrix is not positive definite to working precision; \
     look for a massless or doubly constrained coordinate of that index"
)]
pub struct NotPositiveDefinite {
    /// Where the elimination stopped.
    pub index: usize,
    /// The pivot found there.
    pub pivot: f64,
}

/// Square root of a pivot, if it is not negligible compared with the diagonal entry it came from.
#[inline(always)]
fn root<T: Real>(index: usize, pivot: T, diagonal: T) -> Result<T, NotPositiveDefinite> {
    let (p, d) = (pivot.value(), diagonal.value());
    if p > tolerance::LOST_PIVOT * d && p > 0.0 && p < f64::INFINITY {
        Ok(pivot.sqrt())
    } else {
        Err(NotPositiveDefinite { index, pivot: p })
    }
}

/// Factors `A = L Lᵀ` in place; n³/6 multiply–adds.
///
/// `a` (n×n) is read and overwritten on and below the diagonal; above it nothing is touched. The guard on the pivots is
/// relative to the diagonal, so the units of the coordinates do not matter. After an error the lower triangle is
/// invalid.
#[inline]
pub fn cholesky<T: Real>(a: &mut [T], n: usize) -> Result<(), NotPositiveDefinite> {
    factored(a, n, root)
}

/// [`cholesky`] without inspecting the pivots: NaN where A is not positive definite.
#[inline]
pub fn cholesky_straight<T: Scalar>(a: &mut [T], n: usize) {
    match factored(a, n, |_, pivot: T, _| Ok::<T, Infallible>(pivot.sqrt())) {
        Ok(()) => {}
        Err(never) => match never {},
    }
}

#[inline(always)]
fn factored<T: Scalar, E>(a: &mut [T], n: usize, root: impl Fn(usize, T, T) -> Result<T, E>) -> Result<(), E> {
    match n {
        1 => {
            a[0] = root(0, a[0], a[0])?;
            Ok(())
        }
        2 => {
            let a = &mut a[..4];
            let l00 = root(0, a[0], a[0])?;
            let l10 = a[2] / l00;
            let l11 = root(1, a[3] - l10 * l10, a[3])?;
            a[0] = l00;
            a[2] = l10;
            a[3] = l11;
            Ok(())
        }
        _ => {
            for i in 0..n {
                let (above, rest) = a.split_at_mut(i * n);
                let row = &mut rest[..=i];
                let diagonal = row[i];
                let mut pivot = diagonal;
                for j in 0..i {
                    let other = &above[j * n..=j * n + j];
                    let l = (row[j] - super::dot(&row[..j], &other[..j])) / other[j];
                    row[j] = l;
                    pivot -= l * l;
                }
                row[i] = root(i, pivot, diagonal)?;
            }
            Ok(())
        }
    }
}

/// Solves `L y = b` in place, with L from [`cholesky`].
#[inline]
pub fn cholesky_forward<T: Scalar>(l: &[T], n: usize, b: &mut [T]) {
    for i in 0..n {
        let row = &l[i * n..=i * n + i];
        let (known, rest) = b.split_at_mut(i);
        rest[0] = (rest[0] - super::dot(row, known)) / row[i];
    }
}

/// Solves `Lᵀ x = y` in place, with L from [`cholesky`].
#[inline]
pub fn cholesky_backward<T: Scalar>(l: &[T], n: usize, b: &mut [T]) {
    for i in (0..n).rev() {
        let row = &l[i * n..=i * n + i];
        let (waiting, rest) = b.split_at_mut(i);
        let x = rest[0] / row[i];
        rest[0] = x;
        super::axpy(-x, row, waiting);
    }
}

/// Solves `A x = b` in place, with `A = L Lᵀ` from [`cholesky`]; n² multiply–adds.
#[inline]
pub fn cholesky_solve<T: Scalar>(l: &[T], n: usize, b: &mut [T]) {
    match n {
        1 => b[0] = b[0] / (l[0] * l[0]),
        2 => {
            let (l, b) = (&l[..4], &mut b[..2]);
            let y0 = b[0] / l[0];
            let x1 = (b[1] - l[2] * y0) / (l[3] * l[3]);
            b[0] = (y0 - l[2] * x1) / l[0];
            b[1] = x1;
        }
        _ => {
            cholesky_forward(l, n, b);
            cholesky_backward(l, n, b);
        }
    }
}

/// Writes `A⁻¹` (n×n, both triangles) to `out`, with `A = L Lᵀ` from [`cholesky`].
pub fn inverse_from_cholesky<T: Scalar>(l: &[T], n: usize, out: &mut [T]) {
    // A is symmetric, so the columns of the inverse may be computed as its rows.
    for i in 0..n {
        let row = &mut out[i * n..(i + 1) * n];
        row.fill(T::zero());
        row[i] = T::one();
        cholesky_solve(l, n, row);
    }
    for i in 0..n {
        for j in 0..i {
            let mean = (out[i * n + j] + out[j * n + i]).scale(0.5);
            out[i * n + j] = mean;
            out[j * n + i] = mean;
        }
    }
}

/// Factors a positive semidefinite matrix `P A Pᵀ = L Lᵀ` with diagonal pivoting and returns its rank.
///
/// Each step takes the largest remaining diagonal entry; of equal ones the first. It stops after `max_rank` steps
/// or when no entry exceeds `tol` (absolute; with A scaled to unit diagonal a squared sine).           (C1)
/// `a` (n×n) is read on and below the diagonal. On return its first `rank` columns hold L, the lower triangle of the rest
/// holds what remains of A, and position k of either belongs to index `perm[k]`.
pub fn pivoted_cholesky(a: &mut [f64], n: usize, max_rank: usize, tol: f64, perm: &mut [usize]) -> usize {
    for (i, p) in perm[..n].iter_mut().enumerate() {
        *p = i;
    }
    for k in 0..n.min(max_rank) {
        let mut best = k;
        for i in k + 1..n {
            if a[i * n + i] > a[best * n + best] {
                best = i;
            }
        }
        let pivot = a[best * n + best];
        // NaN compares false and stops here too.
        let usable = pivot > tol && pivot > 0.0;
        if !usable {
            return k;
        }
        if best != k {
            perm.swap(k, best);
            swap_symmetric(a, n, k, best);
        }
        let l = pivot.sqrt();
        a[k * n + k] = l;
        for i in k + 1..n {
            a[i * n + k] /= l;
        }
        for i in k + 1..n {
            let factor = a[i * n + k];
            for j in k + 1..=i {
                a[i * n + j] -= factor * a[j * n + k];
            }
        }
    }
    n.min(max_rank)
}

/// Exchanges indices `p < q` of a symmetric matrix of which the lower triangle is stored.
fn swap_symmetric(a: &mut [f64], n: usize, p: usize, q: usize) {
    for j in 0..p {
        a.swap(p * n + j, q * n + j);
    }
    for i in p + 1..q {
        a.swap(i * n + p, q * n + i);
    }
    for i in q + 1..n {
        a.swap(i * n + p, i * n + q);
    }
    a.swap(p * n + p, q * n + q);
}

#[cfg(test)]
mod tests {
    use super::super::samples::{distance, positive_definite, random};
    use super::super::Matrix;
    use super::*;

    fn lower(a: &[f64], n: usize, cols: usize) -> Matrix {
        let mut l = Matrix::new(n, cols);
        for i in 0..n {
            for j in 0..cols.min(i + 1) {
                l[(i, j)] = a[i * n + j];
            }
        }
        l
    }

    #[test]
    fn factor_times_its_transpose_is_the_matrix() {
        let mut rng = fastrand::Rng::with_seed(11);
        for n in 0..9 {
            let a = positive_definite(&mut rng, n);
            let mut f = a.data().to_vec();
            cholesky(&mut f, n).unwrap();
            let l = lower(&f, n, n);
            assert!(distance(l.matmul(&l.transpose()).data(), a.data()) < 1e-13);
        }
    }

    #[test]
    fn solution_satisfies_the_equations_and_the_halves_compose() {
        let mut rng = fastrand::Rng::with_seed(12);
        for n in 1..9 {
            let a = positive_definite(&mut rng, n);
            let b = random(&mut rng, n, 1).into_vec();
            let mut f = a.data().to_vec();
            cholesky(&mut f, n).unwrap();
            let mut x = b.clone();
            cholesky_solve(&f, n, &mut x);
            assert!(distance(&a.matvec(&x), &b) < 1e-12);
            let mut y = b.clone();
            cholesky_forward(&f, n, &mut y);
            assert!(distance(&lower(&f, n, n).matvec(&y), &b) < 1e-12);
            cholesky_backward(&f, n, &mut y);
            assert!(distance(&x, &y) < 1e-11);
        }
    }

    #[test]
    fn inverse_times_matrix_is_the_identity() {
        let mut rng = fastrand::Rng::with_seed(13);
        for n in 1..7 {
            let a = positive_definite(&mut rng, n);
            let mut f = a.data().to_vec();
            cholesky(&mut f, n).unwrap();
            let mut inverse = Matrix::new(n, n);
            inverse_from_cholesky(&f, n, inverse.data_mut());
            let unit = inverse.matmul(&a);
            assert!(distance(unit.data(), Matrix::identity(n).data()) < 1e-11);
            assert_eq!(inverse, inverse.transpose());
        }
    }

    #[test]
    fn guard_follows_the_diagonal_not_the_units() {
        for scale in [1e-9, 1.0, 1e9] {
            let mut fine = [scale * scale, 0.0, 0.5 * scale, 1.0];
            assert!(cholesky(&mut fine, 2).is_ok());
            let mut lost = [scale * scale, 0.0, scale, 1.0];
            assert_eq!(cholesky(&mut lost, 2).unwrap_err().index, 1);
        }
        let mut singular = [1.0, 0.0, 0.0, 1.0, 1.0, 0.0, 1.0, 1.0, 1.0];
        assert!(cholesky(&mut singular, 3).is_err());
        assert!(cholesky(&mut [f64::NAN], 1).is_err());
        assert!(cholesky(&mut [-1.0], 1).is_err());
    }

    #[test]
    fn pivoted_factor_reveals_the_rank_and_reproduces_the_matrix() {
        let mut rng = fastrand::Rng::with_seed(14);
        for n in 1..9 {
            for rank in 0..=n {
                let x = random(&mut rng, n, rank);
                let a = x.matmul(&x.transpose());
                let mut f = a.data().to_vec();
                let mut perm = vec![0; n];
                let found = pivoted_cholesky(&mut f, n, n, 1e-12, &mut perm);
                assert_eq!(found, rank);
                let l = lower(&f, n, rank);
                let product = l.matmul(&l.transpose());
                for i in 0..n {
                    for j in 0..n {
                        assert!((product[(i, j)] - a[(perm[i], perm[j])]).abs() < 1e-12);
                    }
                }
            }
        }
    }

    #[test]
    fn pivoting_breaks_ties_towards_the_lower_index_and_obeys_the_cap() {
        let mut a = Matrix::identity(4).into_vec();
        let mut perm = [9; 4];
        assert_eq!(pivoted_cholesky(&mut a, 4, 2, 1e-12, &mut perm), 2);
        assert_eq!(perm, [0, 1, 2, 3]);
        let mut b = [1.0, 0.0, 0.0, 0.0, 3.0, 0.0, 0.0, 0.0, 3.0];
        let mut perm = [0; 3];
        assert_eq!(pivoted_cholesky(&mut b, 3, 3, 1e-12, &mut perm), 3);
        assert_eq!(perm, [1, 2, 0]);
    }
}
