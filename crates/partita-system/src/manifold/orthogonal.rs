//! Orthogonal corrections in the mass metric, (33) and (35).

use crate::reduction::Reduction;
use crate::system::{ConstrainedSystem, SystemError};
use partita_math::dense::{self, Matrix};

/// `M`, `M_c = C M⁻¹ Cᵀ` and `M⁻¹ Cᵀ` at one position, factored densely. Cost: n³/6 + n²m.
pub struct MassProjection {
    /// Cholesky factor of M (n x n).
    pub mass: Vec<f64>,
    /// `M⁻¹ C_Rᵀ` (n x r) for the rows R.
    pub w: Matrix,
    /// Cholesky factor of M_c (r x r).
    pub mc: Vec<f64>,
}

/// The rows `rows` of C as a dense matrix.
pub fn dense_rows<S: ConstrainedSystem>(system: &S, c: &[f64], rows: &[usize]) -> Matrix {
    let pattern = system.pattern();
    let mut m = Matrix::new(rows.len(), system.size().nv);
    for (r, &row) in rows.iter().enumerate() {
        for e in pattern.row(row) {
            m[(r, pattern.col_idx[e])] = c[e];
        }
    }
    m
}

impl MassProjection {
    /// From a dense mass matrix, a metric, and dense independent constraint rows.
    pub fn new<S: ConstrainedSystem>(system: &S, t: f64, mass: &[f64], c: &Matrix) -> Result<Self, SystemError> {
        let n = system.size().nv;
        let mut l = mass.to_vec();
        dense::cholesky(&mut l, n)
            .map_err(|e| SystemError::Mass { name: system.structure().velocity_name(e.index), pivot: e.pivot })?;
        let r = c.rows();
        let mut w = Matrix::new(n, r);
        let mut column = vec![0.0; n];
        for i in 0..r {
            column.copy_from_slice(c.row(i));
            dense::cholesky_solve(&l, n, &mut column);
            for j in 0..n {
                w[(j, i)] = column[j];
            }
        }
        let mut mc = c.matmul(&w).into_vec();
        dense::cholesky(&mut mc, r).map_err(|e| SystemError::Singular { t, pivot: e.pivot, limit: 0.0 })?;
        Ok(Self { mass: l, w, mc })
    }

    /// `−M⁻¹ Cᵀ M_c⁻¹ x`: the smallest displacement (velocity) in the mass metric that removes the residual x.
    pub fn correction(&self, x: &[f64]) -> Vec<f64> {
        let mut y = x.to_vec();
        dense::cholesky_solve(&self.mc, y.len(), &mut y);
        self.w.matvec(&y).iter().map(|d| -d).collect()
    }
}

/// `−M⁻¹ Cᵀ M_c⁻¹ Φ` at the position q last evaluated, on the holonomic rows among those kept.             (33)
///
/// Cost: n³/6 + n²m/2, dense.
pub fn orthogonal_step<S: ConstrainedSystem>(r: &mut Reduction<S>, t: f64, q: &[f64]) -> Result<Vec<f64>, SystemError> {
    let size = r.size();
    let n = size.nv;
    // nonholonomic rows have no position to correct
    let rows: Vec<usize> = r.planned.partition.rows.iter().copied().filter(|&i| i < size.holonomic).collect();
    let zero = vec![0.0; n];
    if rows.is_empty() {
        return Ok(zero);
    }
    r.system.velocity(t, q, &zero, &mut r.scratch, &mut r.at.b)?;
    let (mut mass, mut h) = (vec![0.0; n * n], vec![0.0; n]);
    r.system.dynamics(t, q, &zero, &mut r.scratch, &mut mass, &mut h)?;
    let c = dense_rows(&*r.system, &r.at.c, &rows);
    r.system.add_metric(&mut r.scratch, &mut mass);
    let p = MassProjection::new(&*r.system, t, &mass, &c)?;
    let x: Vec<f64> = rows.iter().map(|&i| r.at.phi[i]).collect();
    Ok(p.correction(&x))
}
