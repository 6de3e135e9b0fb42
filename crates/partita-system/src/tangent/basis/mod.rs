//! Rules that provide a constant S for tangent velocities `u = S v`.

pub mod gram_schmidt;
pub mod qr;
pub mod svd;
pub mod zero_eigenvalue;

use partita_math::dense::Matrix;
use partita_math::factor::FactorError;

/// A rule that provides S.
pub trait Basis: Send {
    /// Name of the formulation it makes.
    fn name(&self) -> &'static str;
    /// S (k x n) from M (n x n) and the kept rows of C (r x n), each brought to length 1, at one position.
    ///
    /// r + k = n; fewer than k rows come out where C loses rank.
    fn basis(&self, mass: &Matrix, c: &Matrix) -> Result<Matrix, FactorError>;
}
