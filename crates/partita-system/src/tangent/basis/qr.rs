//! Tangent velocities from the QR decomposition of Cᵀ (Kim, Vanderploeg 1986).
//!
//! `Cᵀ = [Q₁ Q₂] [R; 0]`, S = Q₂ᵀ: orthonormal in the units at hand, the cheapest such basis: nm² − m³/3 + (2nm − m²)k when
//! frozen.

use super::Basis;
use partita_math::dense::Matrix;
use partita_math::factor::{self, FactorError};

/// Rows of S: the columns of Q₂.
pub struct OrthogonalTriangular;

impl Basis for OrthogonalTriangular {
    fn name(&self) -> &'static str {
        "qr"
    }
    fn basis(&self, mass: &Matrix, c: &Matrix) -> Result<Matrix, FactorError> {
        if c.rows() == 0 {
            return Ok(Matrix::identity(mass.rows()));
        }
        let f = factor::qr_null_space(c)?;
        // a rank that fell shows as too many rows: the caller tells
        Ok(f.null.transpose())
    }
}
