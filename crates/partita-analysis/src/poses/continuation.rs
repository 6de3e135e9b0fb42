//! Continuation of a mechanism from one position to another along its own motion, the goals on a straight line.
//!
//! Each step predicts along the tangent and corrects by Newton's method. It is accepted only if the corrections are
//! small compared with the step and shrink as they do near the intended solution, if the tangent has turned little, and
//! if the determinant of the conditions has kept its sign. So a step never lands on another branch: at a limit the
//! tangent grows without bound, at a singular position the determinant changes its sign, and both end the continuation.

use super::field::{Duty, Field};
use super::goal::Target;
use partita_math::dense::{self, lu, lu_determinant, Matrix};
use partita_math::factor::qr_null_space;
use partita_math::rank::independent_rows;
use partita_math::tolerance;
use partita_model::Model;
use partita_system::manifold::least_change::near_by;
use partita_system::manifold::{follow, leap, Closed, Curve, End, Pace, Rule, Visit};
use partita_system::SystemError;

/// Corrections of one position: to residuals of 1e-12, and only to the solution next to it.
const NEAR: Rule = near_by(tolerance::CLOSED);
/// Closes to round-off.
const LAST: Rule = Rule::new(6, f64::EPSILON, tolerance::CLOSED);
/// Steps that are tried across a singular position. Unit: characteristic displacement. Reason: Newton's method needs
/// some distance to it on both sides.
const LEAPS: [f64; 3] = [1e-3, 1e-2, 3e-2];
/// Velocities up to which the sign of the determinant is watched: its cost grows with their cube.
pub(super) const WATCHED: usize = 150;
/// Number of steps of one continuation: three thousand radians.
const STEPS: usize = 10_000;

/// How a continuation ended.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Ending {
    /// There.
    There,
    /// At a limit, after this fraction of the path.
    Limit(f64),
    /// At a position where branches meet, likewise.
    Crossing(f64),
}

/// Which of the conditions are independent, and the position of the others: the reference of the sign of the
/// determinant.
#[derive(Clone, Debug, Default)]
struct Signed {
    /// Orthonormal, spans the displacements that change nothing (n - r rows of n); empty where there are none.
    null: Vec<Vec<f64>>,
    /// Orthonormal, spans the changes that are possible (r rows of m); none where all are.
    range: Option<Vec<Vec<f64>>>,
    sign: f64,
}

/// The common starting point of many continuations.
#[derive(Clone, Debug)]
pub(super) struct Start {
    pub q: Vec<f64>,
    /// Values of the goals there.
    pub y: Vec<f64>,
    /// Which goals are independent there.
    pub free: Vec<bool>,
    /// Whether anything besides the goals moves.
    pub rest: usize,
    signed: Option<Signed>,
}

impl Start {
    /// Whether continuations from it notice singular positions by the sign of a determinant.
    pub fn is_watched(&self) -> bool {
        self.signed.is_some()
    }

    /// How many numbers it holds, one at least.
    pub fn numbers(&self) -> usize {
        let of = |rows: &[Vec<f64>]| rows.iter().map(Vec::len).sum::<usize>();
        let signed = self.signed.as_ref();
        1 + self.q.len() + signed.map_or(0, |s| of(&s.null) + s.range.as_deref().map_or(0, of))
    }
}

/// Work arrays for continuations of one mechanism.
pub(super) struct Continuation<'m> {
    pub field: Field<'m>,
    r: Vec<f64>,
    matrix: Vec<f64>,
    pivots: Vec<usize>,
}

impl<'m> Continuation<'m> {
    pub fn new(model: &'m Model, targets: &'m [Target], t: f64) -> Self {
        let field = Field::new(model, targets, t);
        Self { r: vec![0.0; field.pattern.rows], matrix: Vec::new(), pivots: Vec::new(), field }
    }

    /// Initial data of continuations from the closed position q.
    ///
    /// # Errors
    /// `NotFinite` where q is not a position.
    pub fn start(&mut self, q: &[f64]) -> Result<Start, SystemError> {
        let f = &mut self.field;
        f.y.fill(0.0);
        f.look(q);
        let y = f.y.clone();
        f.aims.copy_from_slice(&y);
        f.evaluate(q)?;
        let (m, ones) = (f.closings(), vec![1.0; f.pattern.cols]);
        // goals one after the other, so that of two that depend on each other the first counts
        let mut c = f.c.clone();
        f.pattern.row_ptr[m..].windows(2).for_each(|e| c[e[0]..e[1]].fill(0.0));
        let strong = |c: &mut Vec<f64>, row: usize| {
            let entries = f.pattern.row(row);
            if dense::dot(&c[entries.clone()], &c[entries.clone()]) < tolerance::REDUNDANT {
                c[entries].fill(0.0);
            }
        };
        (0..m).for_each(|i| strong(&mut c, i));
        let mut rank = independent_rows(&f.pattern, &c, &ones, tolerance::REDUNDANT).rank;
        let mut free = vec![false; y.len()];
        for (k, free) in free.iter_mut().enumerate() {
            let entries = f.pattern.row(m + k);
            c[entries.clone()].copy_from_slice(&f.c[entries.clone()]);
            strong(&mut c, m + k);
            let now = independent_rows(&f.pattern, &c, &ones, tolerance::REDUNDANT).rank;
            *free = now > rank;
            if !*free {
                c[entries].fill(0.0);
            }
            rank = now;
        }
        let rest = f.pattern.cols - rank;
        let mut start = Start { q: q.to_vec(), y, free, rest, signed: None };
        self.begin(&start);
        start.signed = self.signed(rank);
        Ok(start)
    }

    pub fn begin(&mut self, start: &Start) {
        let m = self.field.closings();
        self.field.duty[..m].fill(Duty::Hard);
        for (duty, free) in self.field.duty[m..].iter_mut().zip(&start.free) {
            *duty = if *free { Duty::Hard } else { Duty::Idle };
        }
    }

    /// The hard rows as a dense matrix, and their indices.
    fn dense(&self) -> Matrix {
        let f = &self.field;
        let hard: Vec<usize> = (0..f.pattern.rows).filter(|&i| f.duty[i] == Duty::Hard).collect();
        let mut j = Matrix::new(hard.len(), f.pattern.cols);
        for (to, &i) in hard.iter().enumerate() {
            f.pattern.row(i).for_each(|e| j[(to, f.pattern.col_idx[e])] = f.c[e]);
        }
        j
    }

    fn signed(&mut self, rank: usize) -> Option<Signed> {
        let j = self.dense();
        let (m, n) = (j.rows(), j.cols());
        if n > WATCHED {
            return None;
        }
        let rows = |x: &Matrix| -> Vec<Vec<f64>> {
            (0..x.cols()).map(|k| (0..x.rows()).map(|i| x[(i, k)]).collect()).collect()
        };
        let null = if rank < n { rows(&qr_null_space(&j).ok()?.null) } else { Vec::new() };
        let range = if rank < m { Some(rows(&qr_null_space(&j.transpose()).ok()?.range)) } else { None };
        if null.len() != n - rank || range.as_ref().is_some_and(|x| x.len() != rank) {
            return None;
        }
        let mut signed = Signed { null, range, sign: 0.0 };
        signed.sign = self.sign(&signed)?;
        Some(signed)
    }

    /// Sign of det [U J; N] where last evaluated.
    fn sign(&mut self, s: &Signed) -> Option<f64> {
        let f = &self.field;
        let n = f.pattern.cols;
        self.matrix.resize(n * n, 0.0);
        self.matrix.fill(0.0);
        self.pivots.resize(n, 0);
        let mut to = 0;
        match &s.range {
            None => {
                for i in (0..f.pattern.rows).filter(|&i| f.duty[i] == Duty::Hard) {
                    f.pattern.row(i).for_each(|e| self.matrix[to * n + f.pattern.col_idx[e]] = f.c[e]);
                    to += 1;
                }
            }
            Some(range) => {
                let hard: Vec<usize> = (0..f.pattern.rows).filter(|&i| f.duty[i] == Duty::Hard).collect();
                for u in range {
                    for (&i, x) in hard.iter().zip(u) {
                        f.pattern.row(i).for_each(|e| self.matrix[to * n + f.pattern.col_idx[e]] += x * f.c[e]);
                    }
                    to += 1;
                }
            }
        }
        for row in &s.null {
            self.matrix[to * n..(to + 1) * n].copy_from_slice(row);
            to += 1;
        }
        lu(&mut self.matrix, n, &mut self.pivots).ok()?;
        // the sign alone: a determinant of many entries may underflow
        for k in 0..n {
            let pivot = &mut self.matrix[k * n + k];
            *pivot = pivot.signum();
        }
        Some(lu_determinant(&self.matrix, n, &self.pivots))
    }

    /// Carry the bases of `s` over to where last evaluated and factored: their projections, which keep the orientation.
    fn update_sign(&mut self, s: &mut Signed) {
        let f = &mut self.field;
        let hard: Vec<usize> = (0..f.pattern.rows).filter(|&i| f.duty[i] == Duty::Hard).collect();
        for row in &mut s.null {
            self.r.fill(0.0);
            hard.iter().for_each(|&i| self.r[i] = f.along(i, row));
            f.solve(&self.r);
            row.iter_mut().zip(&f.dv).for_each(|(x, d)| *x -= d);
        }
        orthonormalise(&mut s.null);
        if let Some(range) = &mut s.range {
            for u in range.iter_mut() {
                self.r.fill(0.0);
                hard.iter().zip(u.iter()).for_each(|(&i, x)| self.r[i] = *x);
                f.solve(&self.r);
                hard.iter().zip(u.iter_mut()).for_each(|(&i, x)| *x = f.along(i, &f.dv));
            }
            orthonormalise(range);
        }
    }

    /// From the start to where the goals have the values `to`; q and `self.field.y` are left at the end of the path.
    ///
    /// # Errors
    /// The errors of functions that the conditions call.
    pub fn go(&mut self, start: &Start, to: &[f64], q: &mut Vec<f64>) -> Result<Ending, SystemError> {
        q.clone_from(&start.q);
        self.begin(start);
        self.field.y.copy_from_slice(&start.y);
        let mut signed = start.signed.clone();
        let ending = self.on(&start.y, to, q, &mut signed)?;
        if ending == Ending::There && !self.settle(q, to)? {
            return Ok(Ending::Limit(1.0));
        }
        Ok(ending)
    }

    /// The start of further continuations where the goals have the values `to`; none where they are not reached from this
    /// one.
    ///
    /// # Errors
    /// As [`go`](Self::go).
    pub fn start_at(&mut self, start: &Start, to: &[f64]) -> Result<Option<Start>, SystemError> {
        let mut next = Start { y: to.to_vec(), ..start.clone() };
        self.begin(start);
        self.field.y.copy_from_slice(&start.y);
        let ending = self.on(&start.y, to, &mut next.q, &mut next.signed)?;
        Ok((ending == Ending::There && self.settle(&mut next.q, to)?).then_some(next))
    }

    /// As [`start_at`](Self::start_at), for values near by: none where steps would have to be shorter than this many
    /// characteristic displacements.
    ///
    /// # Errors
    /// As [`go`](Self::go).
    pub fn start_near(&mut self, start: &Start, to: &[f64], shortest: f64) -> Result<Option<Start>, SystemError> {
        let mut next = Start { y: to.to_vec(), ..start.clone() };
        self.begin(start);
        self.field.y.copy_from_slice(&start.y);
        let (mut line, none) = self.line(&start.y, to);
        let end = line.follow((&mut next.q[..], &none), shortest, &mut next.signed)?;
        Ok((end.is_none() && self.settle(&mut next.q, to)?).then_some(next))
    }

    /// For each goal the least velocity that changes it at unit rate with the loops closed and the others at rest, at
    /// this start.
    ///
    /// # Errors
    /// As [`go`](Self::go).
    pub fn directions(&mut self, start: &Start) -> Result<Vec<Vec<f64>>, SystemError> {
        self.begin(start);
        let f = &mut self.field;
        f.y.copy_from_slice(&start.y);
        f.aims.copy_from_slice(&start.y);
        f.evaluate(&start.q)?;
        f.factor_hard();
        let m = f.closings();
        let mut found = Vec::with_capacity(f.targets.len());
        for (k, x) in f.targets.iter().enumerate() {
            self.r.fill(0.0);
            self.r[m + k] = 1.0 / x.displacement;
            f.solve(&self.r);
            let first = f.dv.clone();
            // the damping leaves a part of 1e-10; a second solution removes it
            for (i, r) in self.r.iter_mut().enumerate() {
                *r = if f.duty[i] == Duty::Hard { *r - f.along(i, &first) } else { 0.0 };
            }
            f.solve(&self.r);
            let exact = first.iter().zip(&f.dv).zip(&f.displacement);
            found.push(exact.map(|((x, more), displacement)| (x + more) * displacement).collect());
        }
        Ok(found)
    }

    /// As `go`, via intermediate values of the goals, linearly from each to the next.
    ///
    /// # Errors
    /// As [`go`](Self::go).
    pub fn go_by(
        &mut self,
        start: &Start,
        by: &[Vec<f64>],
        to: &[f64],
        q: &mut Vec<f64>,
    ) -> Result<Ending, SystemError> {
        q.clone_from(&start.q);
        self.begin(start);
        self.field.y.copy_from_slice(&start.y);
        let mut signed = start.signed.clone();
        let mut from = start.y.clone();
        for next in by.iter().map(Vec::as_slice).chain([to]) {
            let ending = self.on(&from, next, q, &mut signed)?;
            if ending != Ending::There {
                return Ok(ending);
            }
            from.copy_from_slice(next);
        }
        Ok(if self.settle(q, to)? { Ending::There } else { Ending::Limit(1.0) })
    }

    /// As [`go`](Self::go) from a start near by, for goals that are all independent; false where steps would have to be
    /// shorter than this many characteristic displacements.
    ///
    /// # Errors
    /// As [`go`](Self::go).
    pub fn go_near(&mut self, start: &Start, to: &[f64], shortest: f64, q: &mut Vec<f64>) -> Result<bool, SystemError> {
        q.clone_from(&start.q);
        self.begin(start);
        self.field.y.copy_from_slice(&start.y);
        let mut signed = start.signed.clone();
        let (mut line, none) = self.line(&start.y, to);
        let end = line.follow((&mut q[..], &none), shortest, &mut signed)?;
        Ok(end.is_none() && self.settle(q, to)?)
    }

    /// The line between these values of the goals, from where the conditions were last evaluated, and the displacement
    /// zero.
    fn line<'a>(&'a mut self, from: &'a [f64], to: &'a [f64]) -> (Straight<'a, 'm>, Vec<f64>) {
        let (kept, none) = (self.field.y.clone(), vec![0.0; self.field.pattern.cols]);
        (Straight { continuation: self, from, to, kept, is_fresh: false }, none)
    }

    fn on(
        &mut self,
        from: &[f64],
        to: &[f64],
        q: &mut [f64],
        signed: &mut Option<Signed>,
    ) -> Result<Ending, SystemError> {
        let (mut line, none) = self.line(from, to);
        let Some(end) = line.follow((&mut *q, &none), tolerance::SHORTEST_STEP, signed)? else {
            return Ok(Ending::There);
        };
        // next to a singular position no step succeeds; a longer one may lead across
        let Some(before) = signed else { return Ok(Ending::Limit(end)) };
        for part in LEAPS {
            let (mut there, mut crossed) = (q.to_vec(), false);
            leap(&mut line, &mut there, &none, (end, 1.0), part, &mut |line, _| {
                let now = line.continuation.updated(before);
                crossed = line.continuation.sign(&now) != Some(now.sign);
                Ok(Visit::Back)
            })?;
            if crossed {
                return Ok(Ending::Crossing(end));
            }
        }
        Ok(Ending::Limit(end))
    }

    /// The bases of `s` where last evaluated and factored.
    fn updated(&mut self, s: &Signed) -> Signed {
        let mut now = s.clone();
        if !now.null.is_empty() || now.range.is_some() {
            self.update_sign(&mut now);
        }
        now
    }

    /// Close q to round-off at the goals, those that are coordinates exact; false where it does not close.
    fn settle(&mut self, q: &mut [f64], to: &[f64]) -> Result<bool, SystemError> {
        let f = &mut self.field;
        f.aims.copy_from_slice(to);
        f.set_own(q);
        let closed = f.close_hard(q, &LAST)?;
        f.set_own(q);
        Ok(closed.is_closed())
    }
}

/// The curve along which the goals vary linearly, from 0 to 1.
struct Straight<'a, 'm> {
    continuation: &'a mut Continuation<'m>,
    from: &'a [f64],
    to: &'a [f64],
    /// Values of the goals at the last accepted position.
    kept: Vec<f64>,
    /// Whether the conditions are evaluated at the position that was closed last.
    is_fresh: bool,
}

impl Curve for Straight<'_, '_> {
    /// The displacement that advances the goals linearly with the loops closed to first order.
    fn direct(&mut self, q: &[f64], s: f64, tangent: &mut [f64]) -> Result<bool, SystemError> {
        if !self.is_fresh {
            self.aim(s);
            self.continuation.field.evaluate(q)?;
        }
        let f = &mut self.continuation.field;
        f.factor_hard();
        let m = f.closings();
        self.continuation.r.fill(0.0);
        for (k, x) in f.targets.iter().enumerate().filter(|(k, _)| f.duty[m + k] == Duty::Hard) {
            self.continuation.r[m + k] = (self.to[k] - self.from[k]) / x.displacement;
        }
        f.solve(&self.continuation.r);
        tangent.copy_from_slice(&f.dv);
        Ok(true)
    }
    fn predict(&mut self, q: &mut [f64], tangent: &[f64], ds: f64) {
        self.continuation.field.dv.copy_from_slice(tangent);
        self.continuation.field.step(q, ds);
    }
    fn close(&mut self, q: &mut [f64], s: f64) -> Result<Closed, SystemError> {
        self.aim(s);
        self.is_fresh = false;
        self.continuation.field.set_own(q);
        let closed = self.continuation.field.close_hard(q, &NEAR)?;
        self.is_fresh = true;
        Ok(closed)
    }
    fn conclude(&mut self, taken: bool) {
        match taken {
            true => self.kept.copy_from_slice(&self.continuation.field.y),
            false => self.continuation.field.y.copy_from_slice(&self.kept),
        }
        self.is_fresh &= taken;
    }
}

impl Straight<'_, '_> {
    /// Follow the line from q as far as steps of at least this many characteristic displacements lead; the fraction of
    /// it that was followed, if not all. The sign of the determinant is that of `signed`, which is kept up to date.
    fn follow(
        &mut self,
        (q, none): (&mut [f64], &[f64]),
        shortest: f64,
        signed: &mut Option<Signed>,
    ) -> Result<Option<f64>, SystemError> {
        let f = &self.continuation.field;
        let m = f.closings();
        let far = (0..self.from.len()).filter(|&k| f.duty[m + k] == Duty::Hard);
        let far = far.map(|k| (self.to[k] - self.from[k]).abs() / f.targets[k].displacement).fold(0.0, f64::max);
        if far == 0.0 {
            return Ok(None);
        }
        let pace = Pace { longest: follow::LONGEST_PREDICTION, shortest: shortest.min(0.1 * far), steps: STEPS };
        let done = follow(self, q, none, 1.0, &pace, &mut |line, _| {
            // across a singular position the determinant changes its sign
            let Some(before) = &*signed else { return Ok(Visit::On) };
            let now = line.continuation.updated(before);
            let keeps = line.continuation.sign(&now) == Some(now.sign);
            if keeps {
                *signed = Some(now);
            }
            Ok(if keeps { Visit::On } else { Visit::Back })
        })?;
        Ok((done.end != End::There).then_some(done.s))
    }

    fn aim(&mut self, s: f64) {
        let ends = self.from.iter().zip(self.to);
        for (aim, (from, to)) in self.continuation.field.aims.iter_mut().zip(ends) {
            *aim = if s == 1.0 { *to } else { from + (to - from) * s };
        }
    }
}

/// Gram-Schmidt; dependent vectors become zero.
fn orthonormalise(rows: &mut [Vec<f64>]) {
    for i in 0..rows.len() {
        let (done, rest) = rows.split_at_mut(i);
        let row = &mut rest[0];
        for _ in 0..2 {
            for other in done.iter() {
                let part = dense::dot(row, other);
                row.iter_mut().zip(other).for_each(|(x, o)| *x -= part * o);
            }
        }
        let size = dense::dot(row, row).sqrt();
        if size > 0.0 {
            row.iter_mut().for_each(|x| *x /= size);
        }
    }
}
