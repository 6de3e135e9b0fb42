//! Blocks without a closed form: Newton's method with the block's own Jacobian, from the present q.              (34)
//!
//! Rows that repeat others are solved along with them, by least squares: any choice of rows loses rank somewhere along
//! an overconstrained loop, and Newton's method diverges there, while the complete set does not.

use super::instant::Instant;
use super::planar::Fit;
use crate::evaluator::{Evaluator, Scratch};
use crate::model::{Model, ModelScratch};
use partita_math::dense::{lu, lu_determinant, lu_in_order, lu_pivot_ratio, lu_solve};
use partita_math::scalar::Scalar;
use partita_math::tolerance;
use partita_system::manifold::follow::LONGEST_PREDICTION;
use partita_system::manifold::{self, close, ClosureError, Ending, Linearization, Part, Residuals, Rule};
use partita_system::prelude::*;
use partita_system::SystemError;

/// To the round-off of the closure error of a large displacement, or until displacements vanish, by steps of 0.3
/// characteristic displacements (radians for rotations); more iterations than any start within a turn needs. Dependent
/// rows close slowly next to a singular position: a slow decrease does not mean that they are closed.
const RULE: Rule =
    Rule::new(60, tolerance::ROUNDING, tolerance::ROUNDING).cut(LONGEST_PREDICTION).to_rest(tolerance::LAST_MOVE);

/// Iterations without a check of the steps: from a tenth of a characteristic displacement each squares the remaining
/// error, and the derivative follows one iteration later.
pub(crate) const STRAIGHT: usize = 7;

/// Rows and velocities solved together.
#[derive(Clone, Debug)]
pub(super) struct Implicit {
    pub rows: Vec<usize>,
    pub unknown: Vec<usize>,
    /// All rows that are closed: those, then others that depend on them.
    closed: Vec<usize>,
    /// Row and column in the block, place in the values of C; row by row.
    entries: Vec<(usize, usize, usize)>,
    /// Exchanges of rows where the plan was made.
    pivots: Vec<usize>,
}

/// Memory for the largest block.
#[derive(Clone, Debug, Default)]
pub(super) struct ImplicitScratch {
    jacobian: Vec<f64>,
    x: Vec<f64>,
    pivots: Vec<usize>,
    closing: manifold::ClosingScratch,
}

impl ImplicitScratch {
    pub fn new(n: usize, nq: usize) -> Self {
        let closing = manifold::ClosingScratch::for_coordinates(nq);
        Self { jacobian: vec![0.0; n * n], x: vec![0.0; n], pivots: vec![0; n], closing }
    }
}

/// Memory of the unchecked iteration.
#[derive(Clone, Debug)]
pub(super) struct StraightScratch<S: Scalar> {
    pub scratch: Scratch<S>,
    pub phi: Vec<S>,
    pub c: Vec<S>,
    pub a: Vec<S>,
    pub dv: Vec<S>,
    pub jacobian: Vec<S>,
    pub x: Vec<S>,
}

impl<S: Scalar> StraightScratch<S> {
    /// For blocks of at most n unknowns.
    pub fn new(model: &Model, e: &Evaluator<S>, n: usize) -> Self {
        let (size, memory) = (model.size(), |n: usize| vec![S::zero(); n]);
        Self {
            scratch: e.scratch(),
            phi: memory(size.holonomic),
            c: memory(model.pattern().nnz()),
            a: memory(size.rows),
            dv: memory(size.nv),
            jacobian: memory(n * n),
            x: memory(n),
        }
    }
}

/// One unchecked iteration.
#[derive(Clone, Copy, Debug)]
pub(super) struct Straight<S> {
    /// Largest correction, in characteristic displacements.
    pub largest: S,
    /// Determinant of the block before it.
    pub determinant: S,
}

/// Working data of the iteration.
pub(super) struct Field<'a> {
    pub model: &'a Model,
    pub scratch: &'a mut ModelScratch,
    pub phi: &'a mut [f64],
    pub c: &'a mut [f64],
    pub a: &'a mut [f64],
    pub dv: &'a mut [f64],
    pub memory: &'a mut ImplicitScratch,
    pub iterations: &'a mut u64,
}

impl Implicit {
    pub fn new(at: &Instant, rows: Vec<usize>, unknown: Vec<usize>, others: &[usize]) -> Self {
        let mut entries = Vec::new();
        let closed = [&rows[..], others].concat();
        for (i, &r) in closed.iter().enumerate() {
            for e in at.pattern().row(r) {
                if let Some(j) = unknown.iter().position(|&u| u == at.pattern().col_idx[e]) {
                    entries.push((i, j, e));
                }
            }
        }
        let n = rows.len();
        let mut block = Self { rows, unknown, closed, entries, pivots: (0..n).collect() };
        if !others.is_empty() {
            return block; // least squares exchange no rows
        }
        let (mut jacobian, mut pivots) = (vec![0.0; n * n], vec![0; n]);
        block.jacobian(&at.model, &at.c, &mut jacobian);
        if lu(&mut jacobian, n, &mut pivots).is_ok() {
            block.pivots = pivots;
        }
        block
    }

    /// The block of C, its rows and columns scaled by large displacements.
    fn jacobian<S: Scalar>(&self, model: &Model, c: &[S], out: &mut [S]) {
        let n = self.rows.len();
        out.fill(S::zero());
        for &(i, j, e) in &self.entries {
            let (displacement, size) =
                (model.structure().displacement(self.unknown[j]), model.structure().rows[self.rows[i]].size());
            out[i * n + j] = c[e].scale(displacement) / S::from_f64(size);
        }
    }

    /// Matrix and right-hand side of one step: of Newton's method, or of Gauss' where rows are dependent.
    fn equations<S: Scalar>(&self, model: &Model, c: &[S], phi: &[S], matrix: &mut [S], x: &mut [S]) {
        let size = |row: usize| S::from_f64(model.structure().rows[row].size());
        if self.closed.len() == self.rows.len() {
            self.jacobian(model, c, matrix);
            for (x, &r) in x.iter_mut().zip(&self.rows) {
                *x = -phi[r] / size(r);
            }
            return;
        }
        let n = self.rows.len();
        matrix.fill(S::zero());
        x.fill(S::zero());
        for row in self.entries.chunk_by(|a, b| a.0 == b.0) {
            let r = self.closed[row[0].0];
            let entry = |&(_, j, e): &(usize, usize, usize)| {
                c[e].scale(model.structure().displacement(self.unknown[j])) / size(r)
            };
            for one in row {
                let value = entry(one);
                x[one.1] -= value * phi[r] / size(r);
                row.iter().for_each(|other| matrix[one.1 * n + other.1] += value * entry(other));
            }
        }
    }

    /// Solve without checks, over any scalar, by a fixed number of iterations with the exchanges of the plan, from near
    /// by; returns how far the last step was from converging.
    pub fn solve_straight<S: Scalar>(
        &self,
        (model, e): (&Model, &Evaluator<S>),
        t: S,
        q: &mut [S],
        memory: &mut StraightScratch<S>,
        iterations: usize,
    ) -> Result<Fit<S>, SystemError> {
        let mut largest = S::zero();
        for _ in 0..iterations {
            largest = self.iterate((model, e), t, q, memory)?.largest;
        }
        let closure_error = memory.phi.iter().fold(S::zero(), |m, x| m.max(x.abs()));
        Ok(Fit { excess: largest - S::from_f64(tolerance::LAST_MOVE), shortfall: closure_error })
    }

    /// One iteration with the exchanges of the plan.
    pub fn iterate<S: Scalar>(
        &self,
        (model, e): (&Model, &Evaluator<S>),
        t: S,
        q: &mut [S],
        memory: &mut StraightScratch<S>,
    ) -> Result<Straight<S>, SystemError> {
        let n = self.rows.len();
        e.closings(t, q, &mut memory.scratch, &mut memory.phi, &mut memory.c, &mut memory.a)?;
        let (jacobian, x) = (&mut memory.jacobian[..n * n], &mut memory.x[..n]);
        self.equations(model, &memory.c, &memory.phi, jacobian, x);
        lu_in_order(jacobian, n, &self.pivots);
        lu_solve(jacobian, n, &self.pivots, x);
        let largest = x.iter().fold(S::zero(), |m, x| m.max(x.abs()));
        let determinant = lu_determinant(jacobian, n, &self.pivots);
        memory.dv.fill(S::zero());
        for (x, &u) in x.iter().zip(&self.unknown) {
            memory.dv[u] = x.scale(model.structure().displacement(u));
        }
        e.step(q, &memory.dv);
        e.normalise(q);
        Ok(Straight { largest, determinant })
    }

    /// Determinant of the block for these values of C, and the ratio of the pivots in the order of the plan.
    pub fn determinant(&self, model: &Model, c: &[f64]) -> (f64, f64) {
        let n = self.rows.len();
        let mut jacobian = vec![0.0; n * n];
        self.jacobian(model, c, &mut jacobian);
        lu_in_order(&mut jacobian, n, &self.pivots);
        (lu_determinant(&jacobian, n, &self.pivots), lu_pivot_ratio(&jacobian, n))
    }

    /// Closes the rows by moving the unknowns of q; returns the ratio of the pivots.
    pub fn solve(&self, f: &mut Field, t: f64, q: &mut [f64], words: &str) -> Result<f64, SystemError> {
        let n = self.rows.len();
        f.model.normalise(q);
        let mut memory = std::mem::take(&mut f.memory.closing);
        let done = close(
            &mut Rows { block: self, f, t, words, closure_error: ClosureError::default(), length: 0.0 },
            q,
            &RULE,
            &mut memory,
        );
        f.memory.closing = memory;
        let done = done?;
        *f.iterations += done.iterations as u64;
        let (jacobian, x) = (&mut f.memory.jacobian[..n * n], &mut f.memory.x[..n]);
        self.equations(f.model, f.c, f.phi, jacobian, x);
        if done.ending > Ending::AtRest || lu(jacobian, n, &mut f.memory.pivots[..n]).is_err() {
            let shortfall = self.closed.iter().fold(0.0, |m: f64, &r| m.max(f.phi[r].abs()));
            return Err(SystemError::Limit { block: words.into(), t, shortfall });
        }
        let ratio = lu_pivot_ratio(jacobian, n);
        Ok(if self.closed.len() == n { ratio } else { ratio.sqrt() })
    }
}

/// The rows of a block, closed by its unknowns.
struct Rows<'x, 'f> {
    block: &'x Implicit,
    f: &'x mut Field<'f>,
    t: f64,
    words: &'x str,
    closure_error: ClosureError,
    length: f64,
}

impl Residuals for Rows<'_, '_> {
    fn evaluate(&mut self, q: &[f64]) -> Result<(), SystemError> {
        let f = &mut *self.f;
        f.model.position(self.t, q, f.scratch, f.phi, f.c, f.a)?;
        let size = |row: usize| f.model.structure().rows[row].size();
        self.closure_error = ClosureError::of(self.block.closed.iter().map(|&r| f.phi[r] / size(r)));
        match self.closure_error.worst.is_finite() {
            true => Ok(()),
            false => Err(SystemError::NotFinite { what: self.words.into(), t: self.t }),
        }
    }
    fn closure_error(&self, _part: usize) -> ClosureError {
        self.closure_error
    }
}

impl Linearization for Rows<'_, '_> {
    fn solve(&mut self, _q: &[f64], _parts: &[Part]) -> Result<bool, SystemError> {
        let (f, n) = (&mut *self.f, self.block.rows.len());
        let (jacobian, x) = (&mut f.memory.jacobian[..n * n], &mut f.memory.x[..n]);
        let pivots = &mut f.memory.pivots[..n];
        self.block.equations(f.model, f.c, f.phi, jacobian, x);
        if lu(jacobian, n, pivots).is_err() {
            return Ok(false);
        }
        lu_solve(jacobian, n, pivots, x);
        self.length = x.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
        Ok(true)
    }
    fn length(&self, _part: usize) -> f64 {
        self.length
    }
    fn scale(&mut self, _part: usize, by: f64) {
        self.f.memory.x[..self.block.rows.len()].iter_mut().for_each(|x| *x *= by);
    }
    fn advance(&mut self, q: &mut [f64]) {
        let f = &mut *self.f;
        f.dv.fill(0.0);
        for (x, &u) in f.memory.x.iter().zip(&self.block.unknown) {
            f.dv[u] = x * f.model.structure().displacement(u);
        }
        f.model.step(q, f.dv);
        f.model.normalise(q);
    }
}
