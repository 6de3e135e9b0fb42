//! Blocks without a closed form: Newton's method with the block's own Jacobian, from where q stands.        (34)

use crate::model::{Model, ModelScratch};
use partita_math::dense::{lu, lu_pivot_ratio, lu_solve};
use partita_system::{ConstrainedSystem, SystemError};

/// Largest move in one iteration, in reaches (radians for turns).
const LARGEST_MOVE: f64 = 0.3;
/// A move this small (in reaches) is the last: Newton's next one would be its square, below round-off.
const LAST_MOVE: f64 = 1e-9;
/// More iterations than any start within a turn needs with moves of [`LARGEST_MOVE`].
const ITERATIONS: usize = 60;

/// Rows and velocities solved together.
#[derive(Clone, Debug)]
pub(super) struct Implicit {
    pub rows: Vec<usize>,
    pub unknown: Vec<usize>,
    /// Row and column in the block, place in the values of C.
    places: Vec<(usize, usize, usize)>,
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

/// What the iteration works on.
pub(super) struct Field<'a> {
    pub model: &'a Model,
    pub scratch: &'a mut ModelScratch,
    pub phi: &'a mut [f64],
    pub c: &'a mut [f64],
    pub a: &'a mut [f64],
    pub dv: &'a mut [f64],
    pub room: &'a mut Room,
}

impl Implicit {
    pub fn new(model: &Model, rows: Vec<usize>, unknown: Vec<usize>) -> Self {
        let pattern = model.pattern();
        let mut places = Vec::new();
        for (i, &r) in rows.iter().enumerate() {
            for e in pattern.row(r) {
                if let Some(j) = unknown.iter().position(|&u| u == pattern.col_idx[e]) {
                    places.push((i, j, e));
                }
            }
        }
        Self { rows, unknown, places }
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
            jacobian.fill(0.0);
            let size = |row: usize| model.row_reach(row).unwrap_or(1.0);
            for &(i, j, e) in &self.places {
                jacobian[i * n + j] = f.c[e] * model.reach(self.unknown[j]) / size(self.rows[i]);
            }
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
