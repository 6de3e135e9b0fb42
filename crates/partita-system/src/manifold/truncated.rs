//! Rows closed by the pseudo-inverse of C without its weak part, and curves along the motions that this leaves free.
//!
//! ```text
//! dq = -C_s⁺ Φ,   C_s = C without its pivots up to the level s
//! ```
//!
//! Pivots (or singular values) up to the level s count as null: weaker rows are not closed. Far from the solution the
//! level is graded, strong rows first, since otherwise steps jump along weak ones.                               (T1)

use super::close::{close, Closed, ClosingScratch, ClosureError, Ending, Linearization, Part, Residuals, Rule};
use super::follow::{Curve, LONGEST_PREDICTION};
use super::scaled::Scaled;
use crate::error::Result;
use crate::messages::not_finite;
use crate::reduction::largest;
use crate::system::{ConstrainedSystem, SystemError};
use partita_math::dense::Matrix;
use partita_math::factor::{pivoted_least_norm, qr_null_space_by};
use partita_math::tolerance;

/// First grade of the level. Unit: singular values in natural scales. Reason: rows that are clearly independent.
pub const FIRST_GRADE: f64 = 0.03;
/// Ratio between grades. Unit: ratio. Reason: one digit at a time.
const GRADE_RATIO: f64 = 0.1;
/// Displacements below this end a grade. Scale: fraction of the grade. Reason: null directions turn by no more than it.
const GRADE_SETTLED: f64 = 1e-2;
/// Maximum number of longest steps: guides that are out of parallel meet far away.
const FARTHEST: usize = 400;
/// Further iterations: three or four of Newton's method for each grade.
const ITERATIONS: usize = 60;
/// Closes the accepted rows: the remaining residual cannot be closed by a motion of the level.
pub const TO_REST: Rule = Rule::new(ITERATIONS, tolerance::TEN_ROUNDINGS, tolerance::SUM_ROUNDING)
    .cut(LONGEST_PREDICTION)
    .to_rest(tolerance::SUM_ROUNDING)
    .undamped(tolerance::SINGULAR_ROUNDING, FARTHEST);

/// Which pivots or singular values of C are accepted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Cut {
    /// Keep the singular values above a level; the others are null.
    Level(f64),
    /// This many of the largest.
    Rank(usize),
}

impl Cut {
    /// Number of accepted values.
    pub fn count(self, values: &[f64]) -> usize {
        match self {
            Self::Level(level) => values.iter().filter(|s| **s > level).count(),
            Self::Rank(rank) => rank.min(values.len()),
        }
    }

    /// With its level no finer than a grade.
    fn graded(self, grade: f64) -> Self {
        match self {
            Self::Level(level) => Self::Level(level.max(grade)),
            Self::Rank(_) => self,
        }
    }
}

/// Null space of C at one position.
#[derive(Clone, Debug)]
pub struct Motions {
    /// Pivots, descending.
    pub pivots: Vec<f64>,
    /// Motions free of all rows, in characteristic displacements.
    pub motions: Vec<Vec<f64>>,
}

/// All rows of a system but the idle ones, dense.
pub struct Truncated<'s, S: ConstrainedSystem> {
    /// The rows in natural scales.
    pub scaled: Scaled<'s, S>,
    /// What counts.
    pub cut: Cut,
    /// The displacement, in characteristic displacements, summed over the iterations.
    pub moved: Vec<f64>,
    t: f64,
    grade: f64,
    closure_error: ClosureError,
    y: Vec<f64>,
    dv: Vec<f64>,
    /// Length of the step last found.
    length: f64,
}

impl<'s, S: ConstrainedSystem> Truncated<'s, S> {
    /// At the time t.
    pub fn new(scaled: Scaled<'s, S>, t: f64, cut: Cut) -> Self {
        let n = scaled.displacement.len();
        Self {
            scaled,
            cut,
            moved: vec![0.0; n],
            t,
            grade: FIRST_GRADE,
            closure_error: ClosureError::default(),
            y: vec![0.0; n],
            dv: vec![0.0; n],
            length: f64::INFINITY,
        }
    }

    /// Close q as far as possible, the level graded from the start.
    ///
    /// # Errors
    /// As [`close`].
    pub fn close(&mut self, q: &mut [f64], memory: &mut ClosingScratch) -> Result<Closed> {
        (self.grade, self.length) = (FIRST_GRADE, f64::INFINITY);
        self.moved.fill(0.0);
        close(self, q, &TO_REST, memory)
    }

    /// Φ and C of the rows at q, dense.
    ///
    /// # Errors
    /// Where nothing can be evaluated at q.
    pub fn look(&mut self, q: &[f64]) -> Result<(Vec<f64>, Matrix)> {
        self.scaled.evaluate(self.t, q)?;
        Ok(self.scaled.dense())
    }

    /// Largest relative residual of a row at q.
    ///
    /// # Errors
    /// Where nothing can be evaluated at q.
    pub fn open_at(&mut self, q: &[f64]) -> Result<f64> {
        self.scaled.evaluate(self.t, q)?;
        Ok(largest(self.scaled.phi.iter().copied()))
    }

    /// Pivots at q, and the motions free of all rows: cheaper than singular values, for one position after the other.
    ///
    /// # Errors
    /// Where nothing can be evaluated at q.
    pub fn motions(&mut self, q: &[f64]) -> Result<Motions> {
        let (_, c) = self.look(q)?;
        let (n, cut) = (c.cols(), self.cut);
        let mut pivots = Vec::new();
        let found = qr_null_space_by(&c, &mut |all| {
            pivots = all.to_vec();
            cut.count(all)
        });
        let f = found.map_err(|_| self.not_finite())?;
        let column = |j: usize| (0..n).map(|i| f.null[(i, j)]).collect::<Vec<f64>>();
        Ok(Motions { motions: (0..f.null.cols()).map(column).collect(), pivots })
    }

    /// Size of a displacement (in characteristic displacements): the fastest coordinate, or its invariant over axes.
    pub fn travel(&self, y: &[f64]) -> f64 {
        let v: Vec<f64> = y.iter().zip(&self.scaled.displacement).map(|(y, displacement)| y * displacement).collect();
        self.scaled.system.travel(&v)
    }

    /// q displaced by `by` times a displacement in characteristic displacements.
    pub fn step(&mut self, q: &mut [f64], by: f64, y: &[f64]) {
        self.scaled.advance(q, by, y, &mut self.dv);
    }

    fn not_finite(&self) -> SystemError {
        not_finite(self.scaled.system, self.t, &self.scaled.raw_phi, &self.scaled.raw_c)
    }
}

impl<S: ConstrainedSystem> Residuals for Truncated<'_, S> {
    fn evaluate(&mut self, q: &[f64]) -> Result<()> {
        self.scaled.evaluate(self.t, q)?;
        self.closure_error = ClosureError::of(self.scaled.phi.iter().copied());
        Ok(())
    }
    fn closure_error(&self, _part: usize) -> ClosureError {
        self.closure_error
    }
}

impl<S: ConstrainedSystem> Linearization for Truncated<'_, S> {
    fn solve(&mut self, _q: &[f64], _parts: &[Part]) -> Result<bool> {
        if !self.is_settled() && self.length < tolerance::LAST_MOVE.max(GRADE_SETTLED * self.grade) {
            self.grade *= GRADE_RATIO;
        }
        let (mut phi, c) = self.scaled.dense();
        phi.iter_mut().for_each(|x| *x = -*x);
        let cut = self.cut.graded(self.grade);
        (self.y, _) = pivoted_least_norm(&c, &phi, &|pivots| cut.count(pivots)).map_err(|_| self.not_finite())?;
        self.length = self.travel(&self.y);
        Ok(true)
    }
    fn length(&self, _part: usize) -> f64 {
        self.length
    }
    fn scale(&mut self, _part: usize, by: f64) {
        self.y.iter_mut().for_each(|y| *y *= by);
        self.length *= by;
    }
    fn advance(&mut self, q: &mut [f64]) {
        self.scaled.advance(q, 1.0, &self.y, &mut self.dv);
    }
    fn take(&mut self, _part: usize) {
        self.moved.iter_mut().zip(&self.y).for_each(|(m, y)| *m += y);
    }
    fn is_settled(&self) -> bool {
        self.cut.graded(self.grade) == self.cut
    }
}

/// The curve along a direction that is continued in the motions that the level leaves free, by the length of its
/// fastest coordinate.
pub struct Along<'r, 's, S: ConstrainedSystem> {
    /// The rows.
    pub rows: &'r mut Truncated<'s, S>,
    /// The free motions at the position last closed.
    pub free: Option<Motions>,
    /// Allowed residual of the rows.
    closure_error: f64,
    memory: ClosingScratch,
}

impl<'r, 's, S: ConstrainedSystem> Along<'r, 's, S> {
    /// Along the motions that these rows leave free, with the allowed residual `closure_error`.
    pub fn new(rows: &'r mut Truncated<'s, S>, closure_error: f64) -> Self {
        Self { rows, free: None, closure_error, memory: ClosingScratch::default() }
    }
}

impl<S: ConstrainedSystem> Curve for Along<'_, '_, S> {
    /// The projection of the previous direction on the present free motions, its fastest coordinate 1.
    fn direct(&mut self, q: &[f64], _s: f64, tangent: &mut [f64]) -> Result<bool> {
        let found = self.rows.motions(q)?;
        let before = norm(tangent);
        let mut on = vec![0.0; tangent.len()];
        for free in &found.motions {
            let part: f64 = free.iter().zip(tangent.iter()).map(|(a, b)| a * b).sum();
            on.iter_mut().zip(free).for_each(|(x, d)| *x += part * d);
        }
        self.free = Some(found);
        let (after, fastest) = (norm(&on), self.travel(&on));
        tangent.iter_mut().zip(&on).for_each(|(t, x)| *t = x / fastest);
        Ok(after > tolerance::HALF_LOST * before && fastest > 0.0 && fastest.is_finite())
    }
    fn predict(&mut self, q: &mut [f64], tangent: &[f64], ds: f64) {
        self.rows.step(q, ds, tangent);
    }
    fn close(&mut self, q: &mut [f64], _s: f64) -> Result<Closed> {
        self.rows.close(q, &mut self.memory)
    }
    fn accepts(&self, closed: &Closed) -> bool {
        closed.ending <= Ending::AtRest && closed.closure_error.worst <= self.closure_error
    }
    fn travel(&self, tangent: &[f64]) -> f64 {
        self.rows.travel(tangent)
    }
}

fn norm(x: &[f64]) -> f64 {
    x.iter().map(|x| x * x).sum::<f64>().sqrt()
}
