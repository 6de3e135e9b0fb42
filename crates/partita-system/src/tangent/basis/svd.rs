//! Tangent velocities from the singular value decomposition of C (Singh, Likins 1985; Mani, Haug, Atkinson 1985).
//!
//! `C = U Σ [V₁ V₂]ᵀ`, S = V₂ᵀ: orthonormal in the units at hand, to full accuracy however small the singular values are.
//! Cost when frozen: about 2n²m + 4nm² + 4.5m³, the dearest of the bases and the most reliable. The singular values depend
//! on the units of the velocities; the space does not.

use super::Basis;
use partita_math::dense::Matrix;
use partita_math::factor::{self, FactorError};

/// Rows of S: the right singular vectors of C that belong to no singular value.
pub struct SingularValues;

impl Basis for SingularValues {
    fn name(&self) -> &'static str {
        "svd"
    }
    fn basis(&self, mass: &Matrix, c: &Matrix) -> Result<Matrix, FactorError> {
        let (n, r) = (mass.rows(), c.rows());
        if r == 0 {
            return Ok(Matrix::identity(n));
        }
        let v = factor::svd_full(c)?.v;
        let data = (0..(n - r) * n).map(|e| v[(e % n, r + e / n)]).collect();
        Ok(Matrix::from_vec(n - r, n, data))
    }
}
