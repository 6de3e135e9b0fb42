//! Tangent velocities from the zero eigenvalues of CᵀC (Kamman, Huston 1984).
//!
//! The eigenvectors of `CᵀC x = 0` are orthonormal and span the null space of C in the units at hand. Forming CᵀC squares the
//! condition of C: a zero and a small eigenvalue are told apart only down to √ε, 1e-8 of the largest. Cost when frozen:
//! n²m/2 + about 4.5 n³. Of historical interest; prefer [`qr`](super::qr) for the same space at less cost and full accuracy.

use super::Basis;
use partita_math::dense::Matrix;
use partita_math::factor::{self, FactorError};

/// Rows of S: the eigenvectors of the k smallest eigenvalues of CᵀC.
pub struct ZeroEigenvalue;

impl Basis for ZeroEigenvalue {
    fn name(&self) -> &'static str {
        "zero-eigenvalue"
    }
    fn basis(&self, mass: &Matrix, c: &Matrix) -> Result<Matrix, FactorError> {
        let n = mass.rows();
        let (_, vectors) = factor::symmetric_eigen(&c.transpose().matmul(c))?;
        let k = n - c.rows();
        let data = (0..k * n).map(|e| vectors[(e % n, e / n)]).collect();
        Ok(Matrix::from_vec(k, n, data))
    }
}
