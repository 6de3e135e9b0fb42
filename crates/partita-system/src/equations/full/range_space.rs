//! Multipliers first, in the range of C: `M_c λ = −(b + C M⁻¹ h)`, then `v' = M⁻¹ (h + Cᵀ λ)`.     (40)
//!
//! Two Cholesky factors instead of one indefinite one; with `W = C L⁻ᵀ`, `M = L Lᵀ`, the Delassus
//! matrix is `M_c = W Wᵀ`, and the two projectors `P_c + P_d = 1` are available. Prefer it for few constraints on many
//! velocities: n³/6 + n²r/2 + nr²/2 + r³/6 per evaluation, dense, of which the first part is unchanged when constraints
//! come and go.

use super::{AccelerationRule, Failure, Instant};
use partita_math::dense;

/// `v'` and λ through the Delassus matrix.
pub struct Range {
    metric: MassMetric,
    mc: Vec<f64>,
    x: Vec<f64>,
}

impl Range {
    /// Memory for n velocities and r independent rows.
    pub fn new(n: usize, r: usize) -> Self {
        Self { metric: MassMetric::new(n, r), mc: vec![0.0; r * r], x: vec![0.0; r] }
    }
}

impl AccelerationRule for Range {
    fn name(&self) -> &'static str {
        "range-space"
    }

    fn solve(&mut self, x: &Instant, vdot: &mut [f64], lambda: &mut [f64]) -> Result<u64, Failure> {
        let (r, n) = (x.rows.len(), x.h.len());
        let m = &mut self.metric;
        m.set(x)?;
        m.gram(&mut self.mc);
        dense::cholesky(&mut self.mc, r).map_err(|e| Failure::Rows { sine2: e.pivot })?;
        for i in 0..r {
            self.x[i] = -(m.b[i] + dense::dot(m.w(i, n), &m.y));
        }
        dense::cholesky_solve(&self.mc, r, &mut self.x);
        for i in 0..r {
            let (w, y) = (&m.w[i * n..(i + 1) * n], &mut m.y);
            dense::axpy(self.x[i], w, y);
            lambda[x.rows[i]] = self.x[i] * m.scale[i];
        }
        m.acceleration(vdot);
        Ok(0)
    }
}

/// Constraint rows in the mass metric, each brought to length 1: `W = diag(s) C L⁻ᵀ` with `M = L Lᵀ`.
///
/// `W Wᵀ` is then the scaled Delassus matrix, with ones on its diagonal whatever the units of rows and coordinates.
pub(super) struct MassMetric {
    l: Vec<f64>,
    /// W (r x n).
    pub w: Vec<f64>,
    /// `1/|c_i|`: the factor that scales row i to length 1; 0 for a row of zeros.
    pub scale: Vec<f64>,
    /// b in these scales.
    pub b: Vec<f64>,
    /// `L⁻¹ h` at first; `Lᵀ v'` at the end.
    pub y: Vec<f64>,
}

impl MassMetric {
    pub(super) fn new(n: usize, r: usize) -> Self {
        Self { l: vec![0.0; n * n], w: vec![0.0; r * n], scale: vec![0.0; r], b: vec![0.0; r], y: vec![0.0; n] }
    }

    /// Row i of W.
    pub(super) fn w(&self, i: usize, n: usize) -> &[f64] {
        &self.w[i * n..(i + 1) * n]
    }

    /// Set up an instant, with the rows in use.
    pub(super) fn set(&mut self, x: &Instant) -> Result<(), Failure> {
        self.set_with(x, x.rows)
    }

    /// Set up an instant, with these rows of C in W.
    pub(super) fn set_with(&mut self, x: &Instant, rows: &[usize]) -> Result<(), Failure> {
        let n = x.h.len();
        self.l.copy_from_slice(x.mass);
        self.y.copy_from_slice(x.h);
        x.heavier(&mut self.l, &mut self.y);
        dense::cholesky(&mut self.l, n).map_err(|e| Failure::Mass { index: e.index, pivot: e.pivot })?;
        dense::cholesky_forward(&self.l, n, &mut self.y);
        for (i, &row) in rows.iter().enumerate() {
            let w = &mut self.w[i * n..(i + 1) * n];
            x.row(row, w);
            dense::cholesky_forward(&self.l, n, w);
            let length = dense::dot(w, w).sqrt();
            self.scale[i] = if length > 0.0 { 1.0 / length } else { 0.0 };
            w.iter_mut().for_each(|w| *w *= self.scale[i]);
            self.b[i] = x.b[row] * self.scale[i];
        }
        Ok(())
    }

    /// `W Wᵀ`, its lower triangle.
    fn gram(&self, out: &mut [f64]) {
        let (r, n) = (self.scale.len(), self.y.len());
        for i in 0..r {
            for j in 0..=i {
                out[i * r + j] = dense::dot(self.w(i, n), self.w(j, n));
            }
        }
    }

    /// `v' = L⁻ᵀ y`.
    pub(super) fn acceleration(&self, vdot: &mut [f64]) {
        vdot.copy_from_slice(&self.y);
        dense::cholesky_backward(&self.l, vdot.len(), vdot);
    }
}
