//! Rows closed by the least change of coordinates in a diagonal metric, damped, of any rank: sparse, part by part.
//!
//! ```text
//! min |C y + Φ|² + Σ μ_i z_i²,   y = Cᵀ z,   y in characteristic displacements
//! ```

use super::close::{ClosureError, Linearization, Part, Residuals, Rule};
use super::scaled::Scaled;
use crate::error::Result;
use crate::system::ConstrainedSystem;
use partita_math::least_norm::LeastNorm;
use partita_math::tolerance;

/// Largest displacement in one iteration. Unit: characteristic displacement (radians for rotations). Reason: over half
/// a radian the linear prediction of a direction errs by an eighth.
pub const LARGEST_MOVE: f64 = 0.5;
/// Iterations of one descent; half a radian each, so a hundred radians.
pub const ITERATIONS: usize = 200;

/// From afar: to round-off, or to `tolerance` if they close no further.
pub const fn from_afar(tolerance: f64) -> Rule {
    Rule::new(ITERATIONS, f64::EPSILON, tolerance).cut(LARGEST_MOVE)
}

/// Largest first correction of a predicted position. Scale: characteristic displacement. Reason: the curvature over the
/// longest prediction.
pub const FIRST_CORRECTION: f64 = 0.05;
/// Solutions after the first of the displacement towards targets. Reason: rows of 3e-5, near those that count as
/// repeated, are met to a thousandth.
const REFINEMENTS: usize = 2;
/// Corrections of one position; a step that needs more is too long.
const CORRECTIONS: usize = 8;

/// From a predictor: to `tolerance`, by corrections that lead to the adjacent solution and to no other.
pub const fn near_by(tolerance: f64) -> Rule {
    Rule::new(CORRECTIONS, tolerance, tolerance).contracting(FIRST_CORRECTION, tolerance::CONVERGES)
}

/// Rows and velocities that depend on each other.
pub struct Block {
    /// Rows of S3.
    pub rows: Vec<usize>,
    /// Velocities.
    pub columns: Vec<usize>,
    /// Whether it is to be left unchanged.
    pub rests: bool,
    closure_error: ClosureError,
    slope: f64,
    length: f64,
}

/// All rows of a system, each part of the mechanism by itself.
pub struct LeastChange<'s, S: ConstrainedSystem> {
    /// The rows in natural scales.
    pub scaled: Scaled<'s, S>,
    /// Parts that share no row and no velocity.
    pub blocks: Vec<Block>,
    t: f64,
    solver: LeastNorm,
    mu: Vec<f64>,
    r: Vec<f64>,
    y: Vec<f64>,
    dv: Vec<f64>,
    gradient: Vec<f64>,
}

fn blocks<S: ConstrainedSystem>(scaled: &Scaled<S>) -> Vec<Block> {
    let pattern = &scaled.pattern;
    // smallest velocity of each set, by union of rows
    let mut root: Vec<usize> = (0..pattern.cols).collect();
    fn find(root: &mut [usize], mut v: usize) -> usize {
        while root[v] != v {
            root[v] = root[root[v]];
            v = root[v];
        }
        v
    }
    for i in 0..scaled.rows() {
        let mut row = pattern.row(i).map(|e| pattern.col_idx[e]);
        let Some(first) = row.next() else { continue };
        for v in row {
            let (a, b) = (find(&mut root, first), find(&mut root, v));
            root[a.max(b)] = a.min(b);
        }
    }
    let mut of = vec![usize::MAX; pattern.cols];
    let mut found: Vec<Block> = Vec::new();
    for i in 0..scaled.rows() {
        // a row without velocities is in the part of whatever velocity is first: it stays unchanged
        let first = pattern.row(i).next().map_or(0, |e| pattern.col_idx[e]);
        let at = find(&mut root, first);
        if of[at] == usize::MAX {
            of[at] = found.len();
            let (rows, columns) = (Vec::new(), Vec::new());
            found.push(Block {
                rows,
                columns,
                rests: false,
                closure_error: ClosureError::default(),
                slope: 0.0,
                length: 0.0,
            });
        }
        found[of[at]].rows.push(i);
    }
    for v in 0..pattern.cols {
        let r = find(&mut root, v);
        if of[r] != usize::MAX {
            found[of[r]].columns.push(v);
        }
    }
    found
}

impl<'s, S: ConstrainedSystem> LeastChange<'s, S> {
    /// At the time t; scales as at q. One more row for each velocity of `targets`, for [`ahead`](Self::ahead).
    ///
    /// # Errors
    /// Where nothing can be evaluated at (t, q).
    pub fn new(system: &'s S, t: f64, q: &[f64], targets: &[usize]) -> Result<Self> {
        let scaled = Scaled::new(system, t, q, targets)?;
        let (rows, n) = (scaled.pattern.rows, scaled.pattern.cols);
        Ok(Self {
            blocks: blocks(&scaled),
            t,
            solver: LeastNorm::new(&scaled.pattern),
            mu: vec![1.0; rows],
            r: vec![0.0; rows],
            y: vec![0.0; n],
            dv: vec![0.0; n],
            gradient: vec![0.0; n],
            scaled,
        })
    }

    /// These velocities keep their coordinates from now on.
    pub fn lock(&mut self, locked: &[usize]) {
        locked.iter().for_each(|&v| self.scaled.locked[v] = true);
    }

    /// Residual of a part where last evaluated, also if it is left unchanged.
    pub fn closure_error_of(&self, block: usize) -> ClosureError {
        self.blocks[block].closure_error
    }

    /// Largest |Φ| in natural scales.
    pub fn worst(&self) -> f64 {
        self.blocks.iter().fold(0.0, |m: f64, b| m.max(b.closure_error.worst))
    }

    /// The displacement (in characteristic displacements) that moves the targets `ahead` by these steps with the loops
    /// closed to first order, where last evaluated, without the locked velocities.
    pub fn ahead(&mut self, ahead: &[f64], y: &mut [f64]) {
        let rows = self.scaled.rows();
        self.mu.fill(tolerance::DAMPING);
        self.r.fill(0.0);
        for (k, x) in ahead.iter().enumerate() {
            self.r[rows + k] = *x;
            self.scaled.c[self.scaled.pattern.row_ptr[rows + k]] = 1.0;
        }
        self.solver.factor(&self.scaled.c, &self.mu);
        self.solver.solve(&self.r, y);
        // next to a limit the damping leaves a part, of which each further solution removes all but the same fraction
        for _ in 0..REFINEMENTS {
            let pattern = &self.scaled.pattern;
            for i in 0..pattern.rows {
                let met: f64 = pattern.row(i).map(|e| self.scaled.c[e] * y[pattern.col_idx[e]]).sum();
                self.r[i] = if i < rows { -met } else { ahead[i - rows] - met };
            }
            self.solver.solve(&self.r, &mut self.y);
            y.iter_mut().zip(&self.y).for_each(|(y, more)| *y += more);
        }
    }

    /// q displaced by `by` times a displacement in characteristic displacements.
    pub fn go(&mut self, q: &mut [f64], by: f64, y: &[f64]) {
        self.scaled.advance(q, by, y, &mut self.dv);
    }
}

impl<S: ConstrainedSystem> Residuals for LeastChange<'_, S> {
    fn evaluate(&mut self, q: &[f64]) -> Result<()> {
        self.scaled.evaluate(self.t, q)?;
        let s = &self.scaled;
        self.gradient.fill(0.0);
        for i in 0..s.rows() {
            for e in s.pattern.row(i) {
                self.gradient[s.pattern.col_idx[e]] += s.c[e] * s.phi[i];
            }
        }
        for b in &mut self.blocks {
            b.closure_error = ClosureError::of(b.rows.iter().map(|&i| s.phi[i]));
            b.slope = b.columns.iter().map(|&v| self.gradient[v].powi(2)).sum();
        }
        Ok(())
    }
    fn parts(&self) -> usize {
        self.blocks.len()
    }
    fn closure_error(&self, part: usize) -> ClosureError {
        let b = &self.blocks[part];
        if b.rests {
            ClosureError::default()
        } else {
            b.closure_error
        }
    }
    fn keep(&self, part: usize, from: &[f64], to: &mut [f64]) {
        for &v in &self.blocks[part].columns {
            let range = self.scaled.system.structure().coordinates_of(v);
            to[range.clone()].copy_from_slice(&from[range]);
        }
    }
    fn slope(&self, part: usize) -> Option<f64> {
        Some(self.blocks[part].slope)
    }
}

impl<S: ConstrainedSystem> Linearization for LeastChange<'_, S> {
    fn solve(&mut self, _q: &[f64], parts: &[Part]) -> Result<bool> {
        self.mu.fill(1.0);
        self.r.fill(0.0);
        for (b, p) in self.blocks.iter().zip(parts).filter(|(_, p)| p.is_active()) {
            let mu = (p.damping * p.closure_error.worst.min(1.0).powi(2)).max(tolerance::DAMPING);
            for &i in &b.rows {
                self.mu[i] = mu;
                self.r[i] = -self.scaled.phi[i];
            }
        }
        self.solver.factor(&self.scaled.c, &self.mu);
        self.solver.solve(&self.r, &mut self.y);
        for b in &mut self.blocks {
            b.length = b.columns.iter().fold(0.0, |m: f64, &v| m.max(self.y[v].abs()));
        }
        Ok(true)
    }
    fn length(&self, part: usize) -> f64 {
        self.blocks[part].length
    }
    fn scale(&mut self, part: usize, by: f64) {
        self.blocks[part].columns.iter().for_each(|&v| self.y[v] *= by);
    }
    fn advance(&mut self, q: &mut [f64]) {
        self.scaled.advance(q, 1.0, &self.y, &mut self.dv);
    }
    fn left(&self, part: usize, _fraction: f64) -> f64 {
        let s = &self.scaled;
        self.blocks[part].rows.iter().map(|&i| (s.phi[i] + s.along(i, &self.y)).powi(2)).sum()
    }
    fn least_damping(&self, part: usize) -> Option<f64> {
        Some(tolerance::DAMPING / self.blocks[part].closure_error.worst.min(1.0).powi(2))
    }
}
