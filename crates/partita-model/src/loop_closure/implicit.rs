//! Blocks without a closed form: Newton's method with the block's own Jacobian, from where q stands.        (34)
//!
//! Rows that say what others say are solved for along with them, by least squares: any choice of rows loses rank
//! somewhere on
//! the way of an overconstrained loop, and Newton's method goes astray there, while all of them together do not.

use super::instant::Instant;
use super::planar::Fit;
use crate::evaluator::{Evaluator, Scratch};
use crate::model::{Model, ModelScratch};
use partita_math::dense::{lu, lu_in_order, lu_pivot_ratio, lu_solve};
use partita_math::scalar::Scalar;
use partita_system::{ConstrainedSystem, SystemError};

/// Largest move in one iteration, in reaches (radians for turns).
const LARGEST_MOVE: f64 = 0.3;
/// A move this small (in reaches) is the last: Newton's next one would be its square, below round-off.
const LAST_MOVE: f64 = 1e-9;
/// More iterations than any start within a turn needs with moves of [`LARGEST_MOVE`].
const ITERATIONS: usize = 60;

/// Iterations without a look at the moves: from a tenth of a reach each squares what is left, and the derivative
/// follows
/// one iteration behind.
const STRAIGHT: usize = 7;

/// Rows and velocities solved together.
#[derive(Clone, Debug)]
pub(super) struct Implicit {
    pub rows: Vec<usize>,
    pub unknown: Vec<usize>,
    /// All rows that are closed: those, and behind them others that follow from them.
    closed: Vec<usize>,
    /// Row and column in the block, place in the values of C; row by row.
    places: Vec<(usize, usize, usize)>,
    /// Exchanges of rows where the plan was made.
    exchanges: Vec<usize>,
}

/// Memory for the largest block.
#[derive(Clone, Debug, Default)]
pub(super) struct Room {
    jacobian: Vec<f64>,
    x: Vec<f64>,
    pivots: Vec<usize>,
}

impl Room {
    pub fn new(n: usize) -> Self {
        Self { jacobian: vec![0.0; n * n], x: vec![0.0; n], pivots: vec![0; n] }
    }
}

/// Memory of the straight iteration.
#[derive(Clone, Debug)]
pub(super) struct StraightRoom<S: Scalar> {
    pub scratch: Scratch<S>,
    pub phi: Vec<S>,
    pub c: Vec<S>,
    pub a: Vec<S>,
    pub dv: Vec<S>,
    pub jacobian: Vec<S>,
    pub x: Vec<S>,
}

/// What the iteration works on.
pub(super) struct Field<'a> {
    pub model: &'a Model,
    pub scratch: &'a mut ModelScratch,
    pub phi: &'a mut [f64],
    pub c: &'a mut [f64],
    pub a: &'a mut [f64],
    pub dv: &'a mut [f64],
    pub room: &'a mut Room,
    pub iterations: &'a mut u64,
}

impl Implicit {
    pub fn new(at: &Instant, rows: Vec<usize>, unknown: Vec<usize>, others: &[usize]) -> Self {
        let mut places = Vec::new();
        let closed = [&rows[..], others].concat();
        for (i, &r) in closed.iter().enumerate() {
            for e in at.pattern.row(r) {
                if let Some(j) = unknown.iter().position(|&u| u == at.pattern.col_idx[e]) {
                    places.push((i, j, e));
                }
            }
        }
        let n = rows.len();
        let mut block = Self { rows, unknown, closed, places, exchanges: (0..n).collect() };
        if !others.is_empty() {
            return block; // least squares exchange no rows
        }
        let (mut jacobian, mut exchanges) = (vec![0.0; n * n], vec![0; n]);
        block.jacobian(at.model, &at.c, &mut jacobian);
        if lu(&mut jacobian, n, &mut exchanges).is_ok() {
            block.exchanges = exchanges;
        }
        block
    }

    /// The block of C, its rows and columns brought to the size of large moves.
    fn jacobian<S: Scalar>(&self, model: &Model, c: &[S], out: &mut [S]) {
        let n = self.rows.len();
        out.fill(S::zero());
        for &(i, j, e) in &self.places {
            let (reach, size) = (model.reach(self.unknown[j]), model.row_reach(self.rows[i]).unwrap_or(1.0));
            out[i * n + j] = c[e].scale(reach) / S::from_f64(size);
        }
    }

    /// Matrix and right-hand side of one move: of Newton's method, or of Gauss' where rows follow from others.
    fn equations<S: Scalar>(&self, model: &Model, c: &[S], phi: &[S], matrix: &mut [S], x: &mut [S]) {
        let size = |row: usize| S::from_f64(model.row_reach(row).unwrap_or(1.0));
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
        for row in self.places.chunk_by(|a, b| a.0 == b.0) {
            let r = self.closed[row[0].0];
            let entry = |&(_, j, e): &(usize, usize, usize)| c[e].scale(model.reach(self.unknown[j])) / size(r);
            for one in row {
                let value = entry(one);
                x[one.1] -= value * phi[r] / size(r);
                row.iter().for_each(|other| matrix[one.1 * n + other.1] += value * entry(other));
            }
        }
    }

    /// The same straight through, over any scalar: a fixed number of iterations with the exchanges of the plan, from
    /// near
    /// by. How far the last move was from being the last one.
    pub fn solve_straight<S: Scalar>(
        &self,
        (model, e): (&Model, &Evaluator<S>),
        t: S,
        q: &mut [S],
        room: &mut StraightRoom<S>,
    ) -> Result<Fit<S>, SystemError> {
        let n = self.rows.len();
        let mut largest = S::zero();
        for _ in 0..STRAIGHT {
            e.position(t, q, &mut room.scratch, &mut room.phi, &mut room.c, &mut room.a)?;
            let (jacobian, x) = (&mut room.jacobian[..n * n], &mut room.x[..n]);
            self.equations(model, &room.c, &room.phi, jacobian, x);
            lu_in_order(jacobian, n, &self.exchanges);
            lu_solve(jacobian, n, &self.exchanges, x);
            largest = x.iter().fold(S::zero(), |m, x| m.max(x.abs()));
            room.dv.fill(S::zero());
            for (x, &u) in x.iter().zip(&self.unknown) {
                room.dv[u] = x.scale(model.reach(u));
            }
            e.step(q, &room.dv);
            e.normalise(q);
        }
        let open = room.phi.iter().fold(S::zero(), |m, x| m.max(x.abs()));
        Ok(Fit { excess: largest - S::from_f64(LAST_MOVE), shortfall: open })
    }

    /// Closes the rows by moving the unknowns of q; returns the ratio of the pivots.
    pub fn solve(&self, f: &mut Field, t: f64, q: &mut [f64], words: &str) -> Result<f64, SystemError> {
        let n = self.rows.len();
        let model = f.model;
        let mut least = f64::INFINITY;
        for _ in 0..ITERATIONS {
            model.position(t, q, f.scratch, f.phi, f.c, f.a)?;
            let jacobian = &mut f.room.jacobian[..n * n];
            let (x, pivots) = (&mut f.room.x[..n], &mut f.room.pivots[..n]);
            self.equations(model, f.c, f.phi, jacobian, x);
            let open =
                self.closed
                    .iter()
                    .fold(0.0f64, |m, &r| if f.phi[r].is_nan() { f64::NAN } else { m.max(f.phi[r].abs()) });
            if !open.is_finite() {
                return Err(SystemError::NotFinite { what: words.into(), t });
            }
            least = least.min(open);
            if lu(jacobian, n, pivots).is_err() {
                break;
            }
            lu_solve(jacobian, n, pivots, x);
            *f.iterations += 1;
            let largest = x.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
            if !largest.is_finite() {
                break;
            }
            let part = (LARGEST_MOVE / largest.max(f64::MIN_POSITIVE)).min(1.0);
            f.dv.fill(0.0);
            for (x, &u) in x.iter().zip(&self.unknown) {
                f.dv[u] = x * part * model.reach(u);
            }
            model.step(q, f.dv);
            model.normalise(q);
            if largest <= LAST_MOVE {
                let ratio = lu_pivot_ratio(jacobian, n);
                return Ok(if self.closed.len() == n { ratio } else { ratio.sqrt() });
            }
        }
        Err(SystemError::Limit { block: words.into(), t, shortfall: least })
    }
}
