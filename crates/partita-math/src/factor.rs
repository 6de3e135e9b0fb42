//! Factorisations of larger or rank-deficient dense matrices, for set-up and analysis.
//!
//! Thin layers over `faer`, in the row-major [`Matrix`] of this crate. They allocate; evaluations use [`dense`] and
//! [`elimination`](crate::elimination). Input that is not finite is refused. Nothing here is generic: what is, would be
//! compiled again in every crate that calls it, with all of `faer` that it needs.

use faer::linalg::solvers::{PartialPivLu, Solve};
use faer::{Mat, MatRef, Side};

use crate::dense::{self, Matrix};
use crate::tolerance;
use crate::wide::Cleared;

/// Up to this size the kernels of [`dense`] are used.
const SMALL: usize = 40;

/// Why a factorisation failed.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum FactorError {
    /// An entry is NaN or infinite.
    #[error("a matrix or right-hand side contains NaN or infinity: look at the state it was evaluated at")]
    NotFinite,
    /// The iteration for singular values or eigenvalues did not converge.
    #[error("the iteration for singular values or eigenvalues did not converge")]
    NoConvergence,
    /// A matrix to be solved with is singular.
    #[error("pivot {index} is {pivot:e}: the matrix is singular")]
    Singular {
        /// The pivot's position.
        index: usize,
        /// Its value.
        pivot: f64,
    },
    /// A matrix to be factored by Cholesky is not positive definite.
    #[error("pivot {index} cannot be a square: the matrix is not positive definite")]
    NotPositiveDefinite {
        /// The pivot's position.
        index: usize,
    },
}

/// Singular value decomposition `A = U diag(s) Vᵀ`.
#[derive(Clone, Debug, PartialEq)]
pub struct Svd {
    /// Left singular vectors in columns (m×min(m, n), or m×m if full).
    pub u: Matrix,
    /// Singular values, descending (min(m, n)).
    pub s: Vec<f64>,
    /// Right singular vectors in columns (n×min(m, n), or n×n if full).
    pub v: Matrix,
}

impl Svd {
    /// Number of singular values above `rtol` times the largest.
    pub fn rank(&self, rtol: f64) -> usize {
        let largest = self.s.first().copied().unwrap_or(0.0);
        self.s.iter().filter(|&&s| s > rtol * largest && s > 0.0).count()
    }
}

/// QR decomposition `Cᵀ P = [Q₁ Q₂] [R; 0]` with column pivoting.
#[derive(Clone, Debug, PartialEq)]
pub struct QrNullSpace {
    /// Number of independent rows of C.
    pub rank: usize,
    /// Q₁ (n×rank): an orthonormal basis of the row space of C.
    pub range: Matrix,
    /// Q₂ (n×(n − rank)): an orthonormal basis of its null space, `C Q₂ = 0`.
    pub null: Matrix,
    /// R (rank×m), upper trapezoidal; its column k belongs to row `perm[k]` of C.
    pub r: Matrix,
    /// The rows of C in pivot order (m); the first `rank` are independent.
    pub perm: Vec<usize>,
}

fn finite(numbers: &[f64]) -> Result<(), FactorError> {
    if numbers.iter().all(|x| x.is_finite()) {
        Ok(())
    } else {
        Err(FactorError::NotFinite)
    }
}

fn view(a: &Matrix) -> MatRef<'_, f64> {
    MatRef::from_row_major_slice(a.data(), a.rows(), a.cols())
}

/// Columns `from..to` as a matrix of their own.
fn columns(a: MatRef<'_, f64>, from: usize, to: usize) -> Matrix {
    let mut out = Matrix::new(a.nrows(), to - from);
    for i in 0..a.nrows() {
        for j in from..to {
            out[(i, j - from)] = a[(i, j)];
        }
    }
    out
}

/// Thin singular value decomposition of an m×n matrix.
pub fn svd(a: &Matrix) -> Result<Svd, FactorError> {
    decompose(a, false)
}

/// Singular value decomposition with square U and V, for bases of null spaces.
pub fn svd_full(a: &Matrix) -> Result<Svd, FactorError> {
    decompose(a, true)
}

fn decompose(a: &Matrix, full: bool) -> Result<Svd, FactorError> {
    finite(a.data())?;
    let size = a.rows().min(a.cols());
    if size == 0 {
        let side = |n| if full { Matrix::identity(n) } else { Matrix::new(n, 0) };
        return Ok(Svd { u: side(a.rows()), s: Vec::new(), v: side(a.cols()) });
    }
    let result = if full { view(a).svd() } else { view(a).thin_svd() };
    let _after = Cleared;
    let f = result.map_err(|_| FactorError::NoConvergence)?;
    Ok(Svd {
        u: columns(f.U(), 0, f.U().ncols()),
        s: f.S().column_vector().iter().copied().collect(),
        v: columns(f.V(), 0, f.V().ncols()),
    })
}

/// Row and null space of C (m×n) by QR of Cᵀ with column pivoting; cheaper than [`svd_full`], nearly as reliable.
///
/// The rank is decided at [`tolerance::NULL_VALUE`] of the largest pivot: scale rows of different units beforehand.
pub fn qr_null_space(c: &Matrix) -> Result<QrNullSpace, FactorError> {
    qr_null_space_by(c, &mut |pivots| {
        pivots.iter().take_while(|x| **x > tolerance::NULL_VALUE * pivots[0] && **x != 0.0).count()
    })
}

/// As `qr_null_space`, with the rank that `rank` derives from the sizes of the pivots, in descending order.
pub fn qr_null_space_by(c: &Matrix, rank: &mut dyn FnMut(&[f64]) -> usize) -> Result<QrNullSpace, FactorError> {
    finite(c.data())?;
    let (m, n) = (c.rows(), c.cols());
    if c.max_abs() == 0.0 {
        return Ok(QrNullSpace {
            rank: 0,
            range: Matrix::new(n, 0),
            null: Matrix::identity(n),
            r: Matrix::new(0, m),
            perm: (0..m).collect(),
        });
    }
    let _after = Cleared;
    let f = view(c).transpose().col_piv_qr();
    let (q, r) = (f.compute_Q(), f.R());
    let pivots: Vec<f64> = (0..m.min(n)).map(|k| r[(k, k)].abs()).collect();
    let rank = rank(&pivots).min(pivots.len());
    let mut upper = Matrix::new(rank, m);
    for i in 0..rank {
        for j in i..m {
            upper[(i, j)] = r[(i, j)];
        }
    }
    Ok(QrNullSpace {
        rank,
        range: columns(q.as_ref(), 0, rank),
        null: columns(q.as_ref(), rank, n),
        r: upper,
        perm: f.P().arrays().0.to_vec(),
    })
}

/// Eigenvalues, ascending, and orthonormal eigenvectors, in columns, of a symmetric matrix (lower triangle read).
///
/// # Panics
/// If the matrix is not square.
pub fn symmetric_eigen(a: &Matrix) -> Result<(Vec<f64>, Matrix), FactorError> {
    square(a);
    finite(a.data())?;
    if a.rows() == 0 {
        return Ok((Vec::new(), Matrix::default()));
    }
    let _after = Cleared;
    let f = view(a).self_adjoint_eigen(Side::Lower).map_err(|_| FactorError::NoConvergence)?;
    Ok((f.S().column_vector().iter().copied().collect(), columns(f.U(), 0, a.rows())))
}

/// Eigenvalues and eigenvectors of a square matrix.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Eigen {
    /// Real and imaginary parts of the eigenvalues.
    pub values: Vec<(f64, f64)>,
    /// Real parts of the eigenvectors, in columns.
    pub re: Matrix,
    /// Imaginary parts of the eigenvectors.
    pub im: Matrix,
}

/// Eigenvalues of a square matrix, and its eigenvectors.
///
/// # Panics
/// If the matrix is not square.
pub fn general_eigen(a: &Matrix) -> Result<Eigen, FactorError> {
    square(a);
    finite(a.data())?;
    let n = a.rows();
    if n == 0 {
        return Ok(Eigen::default());
    }
    let _after = Cleared;
    let f = view(a).eigen().map_err(|_| FactorError::NoConvergence)?;
    let values = f.S().column_vector().iter().map(|x| (x.re, x.im)).collect();
    let (mut re, mut im) = (Matrix::new(n, n), Matrix::new(n, n));
    for i in 0..n {
        for j in 0..n {
            let x = f.U()[(i, j)];
            (re[(i, j)], im[(i, j)]) = (x.re, x.im);
        }
    }
    Ok(Eigen { values, re, im })
}

fn square(a: &Matrix) {
    assert_eq!(a.rows(), a.cols(), "a {} x {} matrix is not square", a.rows(), a.cols());
}

/// Solves `A x = b` by LU with partial pivoting.
///
/// # Panics
/// If A is not square or b does not fit.
pub fn solve_dense(a: &Matrix, b: &[f64]) -> Result<Vec<f64>, FactorError> {
    square(a);
    let n = a.rows();
    assert_eq!(b.len(), n, "{n} equations have {n} right-hand sides");
    finite(a.data())?;
    finite(b)?;
    let mut x = b.to_vec();
    if n <= SMALL {
        let (mut f, mut piv) = (a.data().to_vec(), vec![0; n]);
        dense::lu(&mut f, n, &mut piv).map_err(|e| FactorError::Singular { index: e.index, pivot: e.pivot })?;
        dense::lu_solve(&f, n, &piv, &mut x);
    } else {
        let _after = Cleared;
        let f: PartialPivLu<f64> = view(a).partial_piv_lu();
        if let Some(index) = (0..n).find(|&k| f.U()[(k, k)] == 0.0) {
            return Err(FactorError::Singular { index, pivot: 0.0 });
        }
        let solution = f.solve(Mat::from_fn(n, 1, |i, _| b[i]));
        x.iter_mut().enumerate().for_each(|(i, y)| *y = solution[(i, 0)]);
    }
    finite(&x).map_err(|_| FactorError::Singular { index: n - 1, pivot: 0.0 })?;
    Ok(x)
}

/// Factors `A = L Lᵀ` in place like [`dense::cholesky`], blocked when n is large.
///
/// Above n = 40 a pivot that is not positive is an error, but the relative guard of the small kernel is applied only at the
/// end, to the finished pivots.
pub fn cholesky_large(a: &mut [f64], n: usize) -> Result<(), FactorError> {
    let a = &mut a[..n * n];
    for i in 0..n {
        finite(&a[i * n..=i * n + i])?;
    }
    if n <= SMALL {
        return dense::cholesky(a, n).map_err(|e| FactorError::NotPositiveDefinite { index: e.index });
    }
    let _after = Cleared;
    let f = MatRef::from_row_major_slice(a, n, n).llt(Side::Lower).map_err(
        |faer::linalg::cholesky::llt::factor::LltError::NonPositivePivot { index }| FactorError::NotPositiveDefinite {
            index,
        },
    )?;
    let l = f.L();
    for i in 0..n {
        let pivot = l[(i, i)] * l[(i, i)];
        if pivot.is_nan() || pivot <= tolerance::LOST_PIVOT * a[i * n + i] {
            return Err(FactorError::NotPositiveDefinite { index: i });
        }
    }
    for i in 0..n {
        for j in 0..=i {
            a[i * n + j] = l[(i, j)];
        }
    }
    Ok(())
}

/// The shortest x that minimises `|A x − b|`, and the rank used: singular values below `rtol` of the largest count as zero.
///
/// # Panics
/// If b does not have one entry per row.
pub fn least_squares_min_norm(a: &Matrix, b: &[f64], rtol: f64) -> Result<(Vec<f64>, usize), FactorError> {
    assert_eq!(b.len(), a.rows(), "one right-hand side per row");
    finite(b)?;
    let f = svd(a)?;
    let rank = f.rank(rtol);
    let mut x = vec![0.0; a.cols()];
    for k in 0..rank {
        let along: f64 = (0..a.rows()).map(|i| f.u[(i, k)] * b[i]).sum();
        for (j, y) in x.iter_mut().enumerate() {
            *y += along / f.s[k] * f.v[(j, k)];
        }
    }
    Ok((x, rank))
}

/// The shortest x that minimises `|A x − b|` with the rows of R that `keep` counts, by QR with column pivoting on both
/// sides; much cheaper than singular values. `keep` is given the sizes of the diagonal of R, in descending order.
///
/// # Panics
/// If b does not have one entry per row.
pub fn pivoted_least_norm(
    a: &Matrix,
    b: &[f64],
    keep: &dyn Fn(&[f64]) -> usize,
) -> Result<(Vec<f64>, usize), FactorError> {
    assert_eq!(b.len(), a.rows(), "one right-hand side per row");
    finite(a.data())?;
    finite(b)?;
    let (m, n) = (a.rows(), a.cols());
    let mut x = vec![0.0; n];
    let _after = Cleared;
    let f = view(a).col_piv_qr();
    let (q, r) = (f.compute_thin_Q(), f.thin_R());
    let diagonal: Vec<f64> = (0..m.min(n)).map(|k| r[(k, k)].abs()).collect();
    let kept = keep(&diagonal).min(diagonal.len());
    if kept == 0 {
        return Ok((x, 0));
    }
    // R₁ᵀ = Q₂ R₂:  the shortest y with R₁ y = c is Q₂ R₂⁻ᵀ c
    let second = Mat::from_fn(n, kept, |i, j| if i >= j { r[(j, i)] } else { 0.0 }).qr();
    let (q2, r2) = (second.compute_thin_Q(), second.thin_R());
    let mut c: Vec<f64> = (0..kept).map(|k| (0..m).map(|i| q[(i, k)] * b[i]).sum()).collect();
    for k in 0..kept {
        let sum: f64 = (0..k).map(|j| r2[(j, k)] * c[j]).sum();
        c[k] = (c[k] - sum) / r2[(k, k)];
    }
    for (j, &to) in f.P().arrays().0.iter().enumerate() {
        x[to] = (0..kept).map(|k| q2[(j, k)] * c[k]).sum();
    }
    finite(&x).map_err(|_| FactorError::Singular { index: kept - 1, pivot: 0.0 })?;
    Ok((x, kept))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dense::samples::{distance, positive_definite, random};

    const SHAPES: [(usize, usize); 6] = [(1, 1), (3, 5), (5, 3), (4, 4), (0, 3), (50, 60)];

    /// What they leave there would slow down all that follows on the thread.
    #[cfg(target_arch = "x86_64")]
    #[test]
    fn large_factorisations_leave_no_wide_registers_in_use() {
        use crate::wide::in_use;
        let n = 60;
        let entry = |i: usize, j: usize| ((3 * i + 7 * j) % 11) as f64 + if i == j { 500.0 } else { 0.0 };
        let a: Vec<f64> = (0..n * n).map(|e| entry(e / n, e % n) + entry(e % n, e / n)).collect();
        let matrix = Matrix::from_vec(n, n, a.clone());
        let half = Matrix::from_vec(n / 2, n, a[..n * n / 2].to_vec());
        let ones = vec![1.0; n];
        let calls: [(&str, &dyn Fn() -> bool); 6] = [
            ("svd", &|| svd(&matrix).is_ok()),
            ("svd_full", &|| svd_full(&half).is_ok()),
            ("qr_null_space", &|| qr_null_space(&half).is_ok()),
            ("symmetric_eigen", &|| symmetric_eigen(&matrix).is_ok()),
            ("solve_dense", &|| solve_dense(&matrix, &ones).is_ok()),
            ("cholesky_large", &|| cholesky_large(&mut a.clone(), n).is_ok()),
        ];
        for (name, call) in calls {
            assert!(call(), "{name}");
            assert_eq!(in_use().unwrap_or(0), 0, "{name}");
        }
    }

    fn orthonormal(q: &Matrix) {
        let gram = q.transpose().matmul(q);
        assert!(distance(gram.data(), Matrix::identity(q.cols()).data()) < 1e-13);
    }

    #[test]
    fn singular_vectors_rebuild_the_matrix() {
        let mut rng = fastrand::Rng::with_seed(61);
        for (m, n) in SHAPES {
            let a = random(&mut rng, m, n);
            let f = svd(&a).unwrap();
            orthonormal(&f.u);
            orthonormal(&f.v);
            assert!(f.s.windows(2).all(|w| w[0] >= w[1]));
            let mut us = f.u.clone();
            for i in 0..m {
                us.row_mut(i).iter_mut().zip(&f.s).for_each(|(x, s)| *x *= s);
            }
            assert!(distance(us.matmul(&f.v.transpose()).data(), a.data()) < 1e-12);
            let full = svd_full(&a).unwrap();
            assert_eq!((full.u.cols(), full.v.cols()), (m, n));
            orthonormal(&full.v);
            assert!(distance(&full.s, &f.s) < 1e-12);
        }
    }

    #[test]
    fn pivoted_least_norm_is_that_of_singular_values() {
        let mut rng = fastrand::Rng::with_seed(67);
        for (m, n) in SHAPES {
            for rank in 0..=m.min(n).min(4) {
                let a = random(&mut rng, m, rank).matmul(&random(&mut rng, rank, n));
                let b = random(&mut rng, m, 1).into_vec();
                let (x, kept) = pivoted_least_norm(&a, &b, &|d| d.iter().filter(|x| **x > 1e-9).count()).unwrap();
                let (y, _) = least_squares_min_norm(&a, &b, 1e-9).unwrap();
                assert_eq!(kept, rank);
                assert!(distance(&x, &y) < 1e-10, "{m} {n} {rank}");
            }
        }
    }

    #[test]
    fn null_space_is_orthonormal_and_annihilated() {
        let mut rng = fastrand::Rng::with_seed(62);
        for (m, n) in SHAPES {
            for rank in 0..=m.min(n).min(4) {
                let c = random(&mut rng, m, rank).matmul(&random(&mut rng, rank, n));
                let f = qr_null_space(&c).unwrap();
                assert_eq!((f.rank, f.null.cols()), (rank, n - rank));
                orthonormal(&f.range);
                orthonormal(&f.null);
                assert!(c.matmul(&f.null).max_abs() < 1e-12);
                // Cᵀ P = Q₁ R
                let product = f.range.matmul(&f.r);
                for i in 0..n {
                    for k in 0..m {
                        assert!((product[(i, k)] - c[(f.perm[k], i)]).abs() < 1e-12);
                    }
                }
            }
        }
    }

    #[test]
    fn eigenvectors_diagonalise() {
        let mut rng = fastrand::Rng::with_seed(63);
        for n in [0, 1, 2, 7, 45] {
            let a = positive_definite(&mut rng, n);
            let (values, vectors) = symmetric_eigen(&a).unwrap();
            orthonormal(&vectors);
            assert!(values.windows(2).all(|w| w[0] <= w[1]));
            let product = a.matmul(&vectors);
            for i in 0..n {
                for k in 0..n {
                    assert!((product[(i, k)] - values[k] * vectors[(i, k)]).abs() < 1e-11);
                }
            }
        }
    }

    #[test]
    fn solutions_satisfy_their_equations_on_both_sides_of_the_size_limit() {
        let mut rng = fastrand::Rng::with_seed(64);
        for n in [0, 1, 5, 40, 41, 70] {
            let a = random(&mut rng, n, n);
            let b = random(&mut rng, n, 1).into_vec();
            let x = solve_dense(&a, &b).unwrap();
            assert!(distance(&a.matvec(&x), &b) < 1e-10);
            let singular = Matrix::new(n, n);
            assert_eq!(n > 0, matches!(solve_dense(&singular, &b), Err(FactorError::Singular { index: 0, .. })));
        }
    }

    #[test]
    fn large_cholesky_continues_the_small_one() {
        let mut rng = fastrand::Rng::with_seed(65);
        for n in [0, 3, 40, 41, 80] {
            let a = positive_definite(&mut rng, n);
            let (mut f, mut g) = (a.data().to_vec(), a.data().to_vec());
            cholesky_large(&mut f, n).unwrap();
            dense::cholesky(&mut g, n).unwrap();
            assert!(distance(&f, &g) < 1e-11);
            if n > 0 {
                let mut bad = a.clone();
                bad[(n - 1, n - 1)] = -1.0;
                let refused = cholesky_large(bad.data_mut(), n).unwrap_err();
                assert_eq!(refused, FactorError::NotPositiveDefinite { index: n - 1 });
            }
        }
    }

    #[test]
    fn minimum_norm_solution_lies_in_the_row_space() {
        let mut rng = fastrand::Rng::with_seed(66);
        for rank in 0..4 {
            let a = random(&mut rng, 6, rank).matmul(&random(&mut rng, rank, 5));
            let b = random(&mut rng, 6, 1).into_vec();
            let (x, found) = least_squares_min_norm(&a, &b, 1e-10).unwrap();
            assert_eq!(found, rank);
            let residual: Vec<f64> = a.matvec(&x).iter().zip(&b).map(|(p, q)| p - q).collect();
            assert!(a.transpose().matvec(&residual).iter().all(|g| g.abs() < 1e-12));
            let null = qr_null_space(&a).unwrap().null;
            assert!(null.transpose().matvec(&x).iter().all(|g| g.abs() < 1e-11));
        }
    }

    #[test]
    fn what_is_not_finite_is_refused() {
        for bad in [f64::NAN, f64::INFINITY] {
            for n in [2, 50] {
                let mut a = Matrix::identity(n);
                a[(1, 0)] = bad;
                let b = vec![1.0; n];
                assert_eq!(svd(&a).unwrap_err(), FactorError::NotFinite);
                assert_eq!(svd_full(&a).unwrap_err(), FactorError::NotFinite);
                assert_eq!(qr_null_space(&a).unwrap_err(), FactorError::NotFinite);
                assert_eq!(symmetric_eigen(&a).unwrap_err(), FactorError::NotFinite);
                assert_eq!(solve_dense(&a, &b).unwrap_err(), FactorError::NotFinite);
                assert_eq!(least_squares_min_norm(&a, &b, 1e-10).unwrap_err(), FactorError::NotFinite);
                assert_eq!(cholesky_large(a.data_mut(), n).unwrap_err(), FactorError::NotFinite);
            }
        }
    }
}
