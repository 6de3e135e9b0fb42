//! `L D Lᵀ` factors of symmetric matrices, without pivoting.

use super::Singular;
use crate::scalar::{Real, Scalar};
use crate::tolerance;
use std::convert::Infallible;

/// Factors `A = L D Lᵀ` in place; n³/6 multiply–adds and no square root.
///
/// `a` (n×n) is read on and below the diagonal and overwritten there: D on the diagonal, L (unit diagonal) below. Prefer it
/// to Cholesky for quasi-definite matrices, whose leading blocks are all regular; it fails on a pivot that is zero, not
/// finite, or below 1e-14 of the diagonal terms it was left over from.
pub fn ldlt<T: Real>(a: &mut [T], n: usize) -> Result<(), Singular> {
    factored(a, n, |index, pivot: T, reference: T| {
        let (pivot, reference) = (pivot.value(), reference.value());
        if pivot.is_nan() || pivot.is_infinite() || pivot.abs() <= tolerance::LOST_PIVOT * reference {
            return Err(Singular { index, pivot });
        }
        Ok(())
    })
}

/// [`ldlt`] without inspecting the pivots.
pub fn ldlt_straight<T: Scalar>(a: &mut [T], n: usize) {
    match factored(a, n, |_, _: T, _: T| Ok::<(), Infallible>(())) {
        Ok(()) => {}
        Err(never) => match never {},
    }
}

/// `accept(i, pivot, reference)` may stop; the reference is the largest term from which the pivot was computed.
#[inline(always)]
fn factored<T: Scalar, E>(a: &mut [T], n: usize, accept: impl Fn(usize, T, T) -> Result<(), E>) -> Result<(), E> {
    for i in 0..n {
        let (above, rest) = a.split_at_mut(i * n);
        let row = &mut rest[..=i];
        // First w_j = l_ij d_j, the solution of a unit triangular system …
        for j in 0..i {
            row[j] -= super::dot(&row[..j], &above[j * n..j * n + j]);
        }
        // … then the pivot, and w_j divided by d_j.
        let (mut pivot, mut reference) = (row[i], row[i].abs());
        for j in 0..i {
            let l = row[j] / above[j * n + j];
            let term = l * row[j];
            row[j] = l;
            pivot -= term;
            reference = reference.max(term.abs());
        }
        accept(i, pivot, reference)?;
        row[i] = pivot;
    }
    Ok(())
}

/// Solves `A x = b` in place with the factors of [`ldlt`].
pub fn ldlt_solve<T: Scalar>(a: &[T], n: usize, b: &mut [T]) {
    for i in 1..n {
        let (known, rest) = b.split_at_mut(i);
        rest[0] -= super::dot(&a[i * n..i * n + i], known);
    }
    for i in 0..n {
        b[i] = b[i] / a[i * n + i];
    }
    for i in (1..n).rev() {
        let (waiting, rest) = b.split_at_mut(i);
        super::axpy(-rest[0], &a[i * n..i * n + i], waiting);
    }
}

#[cfg(test)]
mod tests {
    use super::super::samples::{distance, positive_definite, random};
    use super::super::Matrix;
    use super::*;

    #[test]
    fn solves_positive_definite_and_quasi_definite_systems() {
        let mut rng = fastrand::Rng::with_seed(31);
        for n in 1..8 {
            for m in 0..=n {
                // [M Cᵀ; C −1]: regular for every C.
                let (mass, c) = (positive_definite(&mut rng, n), random(&mut rng, m, n));
                let mut a = Matrix::new(n + m, n + m);
                for i in 0..n {
                    a.row_mut(i)[..n].copy_from_slice(mass.row(i));
                }
                for i in 0..m {
                    for j in 0..n {
                        a[(n + i, j)] = c[(i, j)];
                        a[(j, n + i)] = c[(i, j)];
                    }
                    a[(n + i, n + i)] = -1.0;
                }
                let b = random(&mut rng, n + m, 1).into_vec();
                let mut f = a.data().to_vec();
                ldlt(&mut f, n + m).unwrap();
                assert!((0..n + m).all(|i| (f[i * (n + m) + i] > 0.0) == (i < n)));
                let mut x = b.clone();
                ldlt_solve(&f, n + m, &mut x);
                assert!(distance(&a.matvec(&x), &b) < 1e-11);
            }
        }
    }

    #[test]
    fn lost_pivots_are_refused() {
        assert_eq!(ldlt(&mut [1.0, 0.0, 1.0, 1.0], 2).unwrap_err().index, 1);
        assert_eq!(ldlt(&mut [0.0], 1).unwrap_err().index, 0);
        assert!(ldlt(&mut [f64::NAN], 1).is_err());
    }
}
