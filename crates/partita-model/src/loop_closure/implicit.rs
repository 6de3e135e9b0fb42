//! Blocks without a closed form: Newton's method with the block's own Jacobian, from where q stands.        (34)

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

/// Iterations without a look at the moves: from a tenth of a reach each squares what is left, and the derivative follows
/// one iteration behind.
const STRAIGHT: usize = 7;

/// Rows and velocities solved together.
#[derive(Clone, Debug)]
pub(super) struct Implicit {
    pub rows: Vec<usize>,
    pub unknown: Vec<usize>,
    /// Row and column in the block, place in the values of C.
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
    pub fn new(at: &Instant, rows: Vec<usize>, unknown: Vec<usize>) -> Self {
        let mut places = Vec::new();
        for (i, &r) in rows.iter().enumerate() {
            for e in at.pattern.row(r) {
                if let Some(j) = unknown.iter().position(|&u| u == at.pattern.col_idx[e]) {
                    places.push((i, j, e));
                }
            }
        }
        let n = rows.len();
        let mut block = Self { rows, unknown, places, exchanges: (0..n).collect() };
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

    /// The same straight through, over any scalar: a fixed number of iterations with the exchanges of the plan, from near
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
            self.jacobian(model, &room.c, jacobian);
            for (x, &r) in x.iter_mut().zip(&self.rows) {
                *x = -room.phi[r] / S::from_f64(model.row_reach(r).unwrap_or(1.0));
            }
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
            self.jacobian(model, f.c, jacobian);
            let size = |row: usize| model.row_reach(row).unwrap_or(1.0);
            let mut open = 0.0f64;
            for (x, &r) in x.iter_mut().zip(&self.rows) {
                *x = -f.phi[r] / size(r);
                open = open.max(f.phi[r].abs());
            }
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
                return Ok(lu_pivot_ratio(jacobian, n));
            }
        }
        Err(SystemError::Limit { block: words.into(), t, shortfall: least })
    }
}
