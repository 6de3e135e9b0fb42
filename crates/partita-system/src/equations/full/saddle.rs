//! The full equations with multipliers, solved directly: the reference for all other forms.
//!
//! ```text
//! [ M  Cᵀ ] [ v' ]   [  h ]
//! [ C  0  ] [ −λ ] = [ −b ]
//! ```
//! (S1, S5). The matrix is indefinite, but in this order it needs no pivoting: M comes first and is
//! positive definite, and its Schur complement is `−C M⁻¹ Cᵀ`, negative definite for independent rows. So `L D Lᵀ` with
//! n positive and r negative pivots. Dense: (n + r)³/6 per evaluation.

use super::{AccelerationRule, Failure, Instant};
use partita_math::dense;

/// `v'` and λ from the symmetric saddle-point matrix.
pub struct Saddle {
    matrix: Vec<f64>,
    /// M where it has to be made heavier first.
    mass: Vec<f64>,
    x: Vec<f64>,
}

impl Saddle {
    /// Memory for n velocities and r independent rows.
    pub fn new(n: usize, r: usize) -> Self {
        Self { matrix: vec![0.0; (n + r) * (n + r)], mass: vec![0.0; n * n], x: vec![0.0; n + r] }
    }
}

impl AccelerationRule for Saddle {
    fn name(&self) -> &'static str {
        "multipliers"
    }

    fn solve(&mut self, x: &Instant, vdot: &mut [f64], lambda: &mut [f64]) -> Result<u64, Failure> {
        let n = x.h.len();
        let all = n + x.rows.len();
        let m = &mut self.matrix[..all * all];
        self.x[..n].copy_from_slice(x.h);
        let mut mass = x.mass;
        if !x.scales.is_empty() {
            self.mass.copy_from_slice(x.mass);
            x.heavier(&mut self.mass, &mut self.x[..n]);
            mass = &self.mass;
        }
        for i in 0..n {
            m[i * all..i * all + n].copy_from_slice(&mass[i * n..(i + 1) * n]);
        }
        for (i, &row) in x.rows.iter().enumerate() {
            let line = &mut m[(n + i) * all..(n + i + 1) * all];
            line.fill(0.0);
            x.row(row, &mut line[..n]);
            self.x[n + i] = -x.b[row];
        }
        if let Err(e) = dense::ldlt(m, all) {
            if e.index < n {
                return Err(Failure::Mass { index: e.index, pivot: e.pivot });
            }
            // the part of the row that M alone leaves, as a reference for the pivot
            let line = &m[e.index * all..];
            let length: f64 = (0..n).map(|j| line[j] * line[j] * m[j * all + j]).sum();
            return Err(Failure::Rows { sine2: if length > 0.0 { -e.pivot / length } else { 0.0 } });
        }
        if let Some(index) = (0..n).find(|&i| m[i * all + i] < 0.0) {
            return Err(Failure::Mass { index, pivot: m[index * all + index] });
        }
        dense::ldlt_solve(m, all, &mut self.x[..all]);
        vdot.copy_from_slice(&self.x[..n]);
        for (&row, y) in x.rows.iter().zip(&self.x[n..all]) {
            lambda[row] = -y;
        }
        Ok(0)
    }
}
