//! The metric geometry of the criterion: gradients of coordinates, split into the parts along constrained and
//! admissible directions, and the projectors that split them: (11) to (23), of Blajer, Schiehlen, Schirm 1994.
//!
//! Everything here is dense and meant for inspection; an evaluation needs only D and M_d.

use super::criterion;
use crate::error::SystemError;
use partita_math::dense::{self, Matrix};

/// Lengths, metrics and projectors of n coordinates under r independent constraint rows, k = n − r.
#[derive(Clone, Debug)]
pub struct Geometry {
    /// |k_i| (n): length of the gradient of coordinate i.                                    (19)
    pub k: Vec<f64>,
    /// |k_i,c| (n): its component normal to the motions that the constraints allow.            (20)
    pub k_constrained: Vec<f64>,
    /// |k_i,d| (n): its component along these motions.                                        (21)
    pub k_tangential: Vec<f64>,
    /// Projector on the constrained directions (n x n), acting on velocities.
    pub p_c: Matrix,
    /// Projector on the admissible motions (n x n); the two add up to 1.
    pub p_d: Matrix,
    /// M_c = C M⁻¹ Cᵀ (r x r).                                                              (15)
    pub m_c: Matrix,
    /// M_d = D M Dᵀ (k x k).                                                                (13)
    pub m_d: Matrix,
    /// Rows of C M⁻¹, then rows of D (n x n).                                               (11)
    pub t_cd: Matrix,
    /// S M⁻¹ Sᵀ (k x k): products of the directions that S chooses.
    pub m_s: Matrix,
    /// √μ_S, their smallest principal cosine with the admissible motions.                      (27)
    pub sqrt_mu: f64,
}

/// The Cholesky factor of a metric, or the index and size of the failed pivot.
fn factored(metric: &Matrix) -> Result<Vec<f64>, (usize, f64)> {
    let mut l = metric.data().to_vec();
    dense::cholesky(&mut l, metric.rows()).map_err(|e| (e.index, e.pivot)).map(|()| l)
}

/// `A⁻¹ B` with the Cholesky factor of A.
fn solved(l: &[f64], b: &Matrix) -> Matrix {
    let mut columns = b.transpose();
    for j in 0..columns.rows() {
        dense::cholesky_solve(l, b.rows(), columns.row_mut(j));
    }
    columns.transpose()
}

impl Geometry {
    /// From M (n x n), independent rows C (r x n), S and D (k x n) with D Cᵀ = 0, S Dᵀ = 1.
    ///
    /// # Errors
    /// `Mass` where M or M_d is not positive definite, `Singular` where the rows of C are dependent.
    pub fn new(
        mass: &Matrix,
        c: &Matrix,
        (s, d): (&Matrix, &Matrix),
        name: &dyn Fn(usize) -> String,
    ) -> Result<Self, SystemError> {
        let n = mass.rows();
        let heavy = |(i, pivot): (usize, f64)| SystemError::Mass { name: name(i), pivot };
        let l = factored(mass).map_err(heavy)?;
        let inverse = solved(&l, &Matrix::identity(n));
        let w = c.matmul(&inverse); // C M⁻¹, whose columns are k_i*(c)                        (18)
        let m_c = w.matmul(&c.transpose());
        let m_d = d.matmul(mass).matmul(&d.transpose());
        let dependent = |(_, pivot): (usize, f64)| SystemError::Singular { t: 0.0, pivot, limit: 0.0 };
        let (lc, ld) = (factored(&m_c).map_err(dependent)?, factored(&m_d).map_err(heavy)?);
        let (from_c, from_d) = (solved(&lc, &w), solved(&ld, d));
        let m_s = s.matmul(&inverse).matmul(&s.transpose());
        let squares: Vec<f64> = (0..s.rows()).map(|j| m_s[(j, j)]).collect();
        let sqrt_mu = criterion::quality(m_d.data(), &squares, m_s.data()).sqrt_mu;
        // covariant components are measured by the inverse metric
        let length = |own: &Matrix, dual: &Matrix| -> Vec<f64> {
            (0..n).map(|i| (0..own.rows()).map(|r| own[(r, i)] * dual[(r, i)]).sum::<f64>().max(0.0).sqrt()).collect()
        };
        let mut t_cd = Matrix::new(w.rows() + d.rows(), n);
        for i in 0..w.rows() {
            t_cd.row_mut(i).copy_from_slice(w.row(i));
        }
        for i in 0..d.rows() {
            t_cd.row_mut(w.rows() + i).copy_from_slice(d.row(i));
        }
        Ok(Self {
            k: (0..n).map(|i| inverse[(i, i)].sqrt()).collect(),
            k_constrained: length(&w, &from_c),
            k_tangential: length(d, &from_d),
            p_c: w.transpose().matmul(&solved(&lc, c)),      // M⁻¹ Cᵀ M_c⁻¹ C
            p_d: d.transpose().matmul(&from_d).matmul(mass), // Dᵀ M_d⁻¹ D M
            m_c,
            m_d,
            t_cd,
            m_s,
            sqrt_mu,
        })
    }
}
