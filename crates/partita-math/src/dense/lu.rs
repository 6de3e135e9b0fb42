//! LU factors with partial pivoting.

use crate::scalar::{Real, Scalar};

/// Elimination met a column without a usable pivot.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("column {index} has no usable pivot (largest candidate {pivot:e}): the matrix is singular or not finite")]
pub struct Singular {
    /// The column where the elimination stopped.
    pub index: usize,
    /// The largest candidate found there.
    pub pivot: f64,
}

/// Factors `P A = L U` in place with row exchanges; n³/3 multiply–adds.
///
/// L has a unit diagonal (not stored); `piv[k]` (n) is the row exchanged with row k at step k. Fails only when a column is
/// exactly zero or not finite; [`lu_pivot_ratio`] detects a nearly singular matrix.
pub fn lu<T: Real>(a: &mut [T], n: usize, piv: &mut [usize]) -> Result<(), Singular> {
    for k in 0..n {
        let mut best = k;
        let mut pivot = a[k * n + k].value().abs();
        for i in k + 1..n {
            let candidate = a[i * n + k].value().abs();
            // A NaN, once met, stays the pivot and is refused below.
            if candidate > pivot || candidate.is_nan() {
                best = i;
                pivot = candidate;
            }
        }
        if pivot == 0.0 || !pivot.is_finite() {
            return Err(Singular { index: k, pivot });
        }
        piv[k] = best;
        step(a, n, k, best);
    }
    Ok(())
}

/// [`lu`] straight through, with the exchanges `piv` of an earlier one.
pub fn lu_in_order<T: Scalar>(a: &mut [T], n: usize, piv: &[usize]) {
    for k in 0..n {
        step(a, n, k, piv[k]);
    }
}

/// Brings row `best` to place k and subtracts it from the rows below.
#[inline(always)]
fn step<T: Scalar>(a: &mut [T], n: usize, k: usize, best: usize) {
    let (upper, below) = a.split_at_mut((k + 1) * n);
    let top = &mut upper[k * n..];
    if best != k {
        let start = (best - k - 1) * n;
        top.swap_with_slice(&mut below[start..start + n]);
    }
    let reciprocal = T::one() / top[k];
    for row in below.chunks_exact_mut(n).take(n - k - 1) {
        let l = row[k] * reciprocal;
        row[k] = l;
        super::axpy(-l, &top[k + 1..], &mut row[k + 1..]);
    }
}

/// Solves `A x = b` in place with the factors of [`lu`].
pub fn lu_solve<T: Scalar>(a: &[T], n: usize, piv: &[usize], b: &mut [T]) {
    for k in 0..n {
        b.swap(k, piv[k]);
    }
    for i in 1..n {
        let (known, rest) = b.split_at_mut(i);
        rest[0] -= super::dot(&a[i * n..i * n + i], known);
    }
    for i in (0..n).rev() {
        let row = &a[i * n..(i + 1) * n];
        let (head, known) = b.split_at_mut(i + 1);
        head[i] = (head[i] - super::dot(&row[i + 1..], known)) / row[i];
    }
}

/// Solves `A X = B` in place for the m columns of B (n x m, row by row), all together.
pub fn lu_solve_many<T: Scalar>(a: &[T], n: usize, piv: &[usize], b: &mut [T], m: usize) {
    for k in 0..n {
        if piv[k] != k {
            let (upper, lower) = b.split_at_mut(piv[k] * m);
            upper[k * m..(k + 1) * m].swap_with_slice(&mut lower[..m]);
        }
    }
    for i in 1..n {
        let (known, rest) = b.split_at_mut(i * m);
        for (l, x) in a[i * n..i * n + i].iter().zip(known.chunks_exact(m)) {
            super::axpy(-*l, x, &mut rest[..m]);
        }
    }
    for i in (0..n).rev() {
        let row = &a[i * n..(i + 1) * n];
        let (head, known) = b.split_at_mut((i + 1) * m);
        let x = &mut head[i * m..];
        for (u, x_j) in row[i + 1..].iter().zip(known.chunks_exact(m)) {
            super::axpy(-*u, x_j, x);
        }
        let reciprocal = T::one() / row[i];
        x.iter_mut().for_each(|x| *x *= reciprocal);
    }
}

/// Solves `Aᵀ x = b` in place with the factors of [`lu`].
pub fn lu_solve_transposed<T: Scalar>(a: &[T], n: usize, piv: &[usize], b: &mut [T]) {
    for i in 0..n {
        let row = &a[i * n..(i + 1) * n];
        let (head, waiting) = b.split_at_mut(i + 1);
        let y = head[i] / row[i];
        head[i] = y;
        super::axpy(-y, &row[i + 1..], waiting);
    }
    for i in (1..n).rev() {
        let (waiting, rest) = b.split_at_mut(i);
        super::axpy(-rest[0], &a[i * n..i * n + i], waiting);
    }
    for k in (0..n).rev() {
        b.swap(k, piv[k]);
    }
}

/// Determinant of A from the factors of [`lu`]; 1 for n = 0.
pub fn lu_determinant<T: Scalar>(a: &[T], n: usize, piv: &[usize]) -> T {
    (0..n).fold(T::one(), |det, k| {
        let pivot = a[k * n + k];
        if piv[k] == k {
            det * pivot
        } else {
            -det * pivot
        }
    })
}

/// Smallest over largest pivot magnitude of the factors of [`lu`]; 1 for n = 0.
///
/// A cheap sign of near singularity for matrices whose rows and columns have comparable scales.
pub fn lu_pivot_ratio(a: &[f64], n: usize) -> f64 {
    let (low, high) =
        (0..n).map(|k| a[k * n + k].abs()).fold((f64::INFINITY, 0.0_f64), |(low, high), p| (low.min(p), high.max(p)));
    if n == 0 {
        1.0
    } else {
        low / high
    }
}

#[cfg(test)]
mod tests {
    use super::super::samples::{distance, random};
    use super::*;

    #[test]
    fn solutions_satisfy_both_systems() {
        let mut rng = fastrand::Rng::with_seed(21);
        for n in 0..12 {
            let a = random(&mut rng, n, n);
            let b = random(&mut rng, n, 1).into_vec();
            let (mut f, mut piv) = (a.data().to_vec(), vec![0; n]);
            lu(&mut f, n, &mut piv).unwrap();
            let mut x = b.clone();
            lu_solve(&f, n, &piv, &mut x);
            assert!(distance(&a.matvec(&x), &b) < 1e-11);
            let mut y = b.clone();
            lu_solve_transposed(&f, n, &piv, &mut y);
            assert!(distance(&a.transpose().matvec(&y), &b) < 1e-11);
        }
    }

    #[test]
    fn determinant_of_a_product_is_the_product() {
        let mut rng = fastrand::Rng::with_seed(22);
        let det = |m: &super::super::Matrix| {
            let (mut f, mut piv) = (m.data().to_vec(), vec![0; m.rows()]);
            lu(&mut f, m.rows(), &mut piv).unwrap();
            lu_determinant(&f, m.rows(), &piv)
        };
        for n in 1..7 {
            let (a, b) = (random(&mut rng, n, n), random(&mut rng, n, n));
            let (left, right) = (det(&a.matmul(&b)), det(&a) * det(&b));
            assert!((left - right).abs() < 1e-12 * (1.0 + right.abs()));
        }
        let exchange = super::super::Matrix::from_rows(&[&[0.0, 1.0], &[1.0, 0.0]]);
        assert_eq!(det(&exchange), -1.0);
    }

    #[test]
    fn unusable_columns_are_named() {
        let mut piv = [0; 2];
        assert_eq!(lu(&mut [0.0, 1.0, 0.0, 2.0], 2, &mut piv), Err(Singular { index: 0, pivot: 0.0 }));
        assert!(lu(&mut [1.0, 2.0, 2.0, 4.0], 2, &mut piv).is_err());
        assert!(lu(&mut [1.0, 0.0, f64::NAN, 1.0], 2, &mut piv).is_err());
    }

    #[test]
    fn pivot_ratio_falls_with_the_distance_to_singularity() {
        let mut piv = [0; 2];
        let mut a = [1.0, 1.0, 1.0, 1.0 + 1e-9];
        lu(&mut a, 2, &mut piv).unwrap();
        assert!(lu_pivot_ratio(&a, 2) < 1.1e-9);
        assert_eq!(lu_pivot_ratio(&[], 0), 1.0);
    }
}
