//! Φ and C at one position in natural scales, with one more row for every target: displacements in characteristic
//! displacements (a radian, a characteristic length), residuals relative to the closure error of a large displacement.

use crate::messages::not_finite;
use crate::system::{ConstrainedSystem, SystemError};
use partita_math::dense::Matrix;
use partita_math::elimination::Pattern;

/// `Φ_i / L_i` and `C_ij displacement_j / L_i`; the rows of the targets follow those of the system.
pub struct Scaled<'s, S: ConstrainedSystem> {
    /// The system.
    pub system: &'s S,
    scratch: S::Scratch,
    /// Φ, not scaled.
    pub raw_phi: Vec<f64>,
    /// C of all rows, not scaled, in the order of the system's pattern.
    pub raw_c: Vec<f64>,
    raw_a: Vec<f64>,
    /// Characteristic displacement of each velocity.
    pub displacement: Vec<f64>,
    /// Closure error of each row under a large displacement.
    pub length: Vec<f64>,
    /// Velocities whose coordinate is fixed.
    pub locked: Vec<bool>,
    /// Rows that are ignored in closing.
    pub idle: Vec<bool>,
    /// Rows of S3, then one for each target.
    pub pattern: Pattern,
    /// Φ, scaled; 0 in idle rows and in those of targets.
    pub phi: Vec<f64>,
    /// C, scaled, in the order of the pattern; likewise.
    pub c: Vec<f64>,
}

impl<'s, S: ConstrainedSystem> Scaled<'s, S> {
    /// Natural scales are those of the system; a row without one is scaled by its entries at (t, q).
    ///
    /// # Errors
    /// Where nothing can be evaluated at (t, q).
    pub fn new(system: &'s S, t: f64, q: &[f64], targets: &[usize]) -> Result<Self, SystemError> {
        let mut scaled = Self::known(system, targets);
        scaled.evaluate(t, q)?;
        for i in (0..system.size().holonomic).filter(|&i| system.structure().rows[i].displacement.is_none()) {
            // a coordinate far larger than 1 sets the scale of large displacements itself
            let large = |v: usize| {
                system.structure().coordinates_of(v).map(|k| q[k].abs()).fold(scaled.displacement[v], f64::max)
            };
            let widest = |m: f64, e: usize| m.max(scaled.raw_c[e].abs() * large(scaled.pattern.col_idx[e]));
            let length = scaled.pattern.row(i).fold(0.0, widest);
            scaled.length[i] = if length > 0.0 { length } else { 1.0 };
        }
        Ok(scaled)
    }

    /// As `new`, with 1 for scales that the system does not know.
    pub fn known(system: &'s S, targets: &[usize]) -> Self {
        let (size, all) = (system.size(), system.pattern());
        let entries = all.row_ptr[size.holonomic];
        let mut row_ptr = all.row_ptr[..=size.holonomic].to_vec();
        let mut col_idx = all.col_idx[..entries].to_vec();
        for &v in targets {
            col_idx.push(v);
            row_ptr.push(col_idx.len());
        }
        let pattern = Pattern::new(size.holonomic + targets.len(), size.nv, row_ptr, col_idx);
        let displacement: Vec<f64> = system.structure().displacements().collect();
        Self {
            system,
            scratch: system.scratch(),
            raw_phi: vec![0.0; size.holonomic],
            raw_c: vec![0.0; all.nnz()],
            raw_a: vec![0.0; size.rows],
            length: (0..size.holonomic).map(|i| system.structure().rows[i].size()).collect(),
            locked: vec![false; size.nv],
            idle: vec![false; size.holonomic],
            phi: vec![0.0; pattern.rows],
            c: vec![0.0; pattern.nnz()],
            displacement,
            pattern,
        }
    }

    /// Φ and C at (t, q).
    ///
    /// # Errors
    /// `NotFinite` where a condition is.
    pub fn evaluate(&mut self, t: f64, q: &[f64]) -> Result<(), SystemError> {
        self.system.position(t, q, &mut self.scratch, &mut self.raw_phi, &mut self.raw_c, &mut self.raw_a)?;
        if !self.raw_phi.iter().chain(&self.raw_c).all(|x| x.is_finite()) {
            return Err(not_finite(self.system, t, &self.raw_phi, &self.raw_c));
        }
        self.phi.fill(0.0);
        self.c.fill(0.0);
        for (i, raw) in self.raw_phi.iter().enumerate().filter(|(i, _)| !self.idle[*i]) {
            self.phi[i] = raw / self.length[i];
            for e in self.pattern.row(i) {
                let v = self.pattern.col_idx[e];
                if !self.locked[v] {
                    self.c[e] = self.raw_c[e] * self.displacement[v] / self.length[i];
                }
            }
        }
        Ok(())
    }

    /// Largest |Φ|, not scaled.
    pub fn residual(&self) -> f64 {
        self.raw_phi.iter().fold(0.0, |m: f64, x| m.max(x.abs()))
    }

    /// Φ of row i, not scaled.
    pub fn raw(&self, i: usize) -> f64 {
        self.raw_phi[i]
    }

    /// Rows of S3.
    pub fn rows(&self) -> usize {
        self.raw_phi.len()
    }

    /// C y of row i.
    pub fn along(&self, i: usize, y: &[f64]) -> f64 {
        self.pattern.row(i).map(|e| self.c[e] * y[self.pattern.col_idx[e]]).sum()
    }
}

impl<S: ConstrainedSystem> Scaled<'_, S> {
    /// Rows that are not idle.
    pub fn active(&self) -> impl Iterator<Item = usize> + '_ {
        (0..self.pattern.rows).filter(|&i| !self.idle.get(i).is_some_and(|idle| *idle))
    }

    /// Φ and C of the rows that are not idle, C as a dense matrix.
    pub fn dense(&self) -> (Vec<f64>, Matrix) {
        let rows: Vec<usize> = self.active().collect();
        let mut m = Matrix::new(rows.len(), self.pattern.cols);
        for (index, &i) in rows.iter().enumerate() {
            self.pattern.row(i).for_each(|e| m[(index, self.pattern.col_idx[e])] = self.c[e]);
        }
        (rows.iter().map(|&i| self.phi[i]).collect(), m)
    }

    /// q displaced by `by` times a displacement in characteristic displacements.
    pub fn advance(&self, q: &mut [f64], by: f64, y: &[f64], dv: &mut [f64]) {
        dv.iter_mut()
            .zip(y.iter().zip(&self.displacement))
            .for_each(|(d, (y, displacement))| *d = by * y * displacement);
        self.system.step(q, dv);
        self.system.normalise(q);
    }
}
