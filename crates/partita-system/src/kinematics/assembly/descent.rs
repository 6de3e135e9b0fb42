//! Damped Gauss-Newton descent of |Φ|², each part of the mechanism by itself.
//!
//! Parts share no row and no column of C, so each has its own damping, accepts or refuses its own steps and comes to rest
//! by itself: a thousand loops side by side take as many iterations as the slowest of them.

use super::scaled::Scaled;
use crate::system::{ConstrainedSystem, SystemError};
use partita_math::least_norm::LeastNorm;

/// Largest move in one iteration, in reaches (radians for turns): half a radian turns a direction by less than its own
/// linear prediction errs by an eighth.
const LARGEST_MOVE: f64 = 0.5;
/// Damping of the last steps, in squares of singular values of C in natural scales. Rows weaker than its root, 1e-5, count
/// as repeated; a loop at a singular position is closed by moves of no more than 5e4 times its residual.
const LEAST_DAMPING: f64 = 1e-10;
/// Damping at the start, in squares of the residual.
const FIRST_DAMPING: f64 = 1e-2;
/// A damping above this moves nothing any more.
const LARGEST_DAMPING: f64 = 1e10;
/// At rest: |Cᵀ Φ| below this part of |Φ|. A mechanism that closes at a singular position comes to √Φ, 1e-6 at the
/// tolerance.
const AT_REST: f64 = 1e-7;
/// The same where twenty iterations have gained nothing.
const NEARLY_AT_REST: f64 = 1e-3;
/// An iteration that lowers |Φ|² by less than this part gains nothing...
const GAIN: f64 = 1e-2;
/// ... and this many of them in a row end the descent.
const PATIENCE: usize = 20;
/// Iterations of one descent; half a radian each, so a hundred radians.
pub(super) const ITERATIONS: usize = 200;
/// Iterations of the last closing: each gains the digits that the damping leaves, ten or more.
const LAST: usize = 8;

/// How a descent ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Ending {
    /// Under way.
    Open,
    Closed,
    /// Closed, with an axis pointing backwards: another mechanism.
    TurnedOver,
    /// At rest with loops open.
    AtRest,
    /// Out of iterations.
    Unfinished,
}

/// Rows and velocities that depend on each other.
pub(super) struct Part {
    pub rows: Vec<usize>,
    pub columns: Vec<usize>,
    pub ending: Ending,
    /// |Φ|², scaled.
    pub square: f64,
    /// Largest |Φ|, scaled.
    worst: f64,
    damping: f64,
    idle: usize,
    active: bool,
}

pub(super) struct Descent<'s, S: ConstrainedSystem> {
    pub scaled: Scaled<'s, S>,
    pub parts: Vec<Part>,
    solver: LeastNorm,
    mu: Vec<f64>,
    r: Vec<f64>,
    y: Vec<f64>,
    dv: Vec<f64>,
    gradient: Vec<f64>,
    trial: Vec<f64>,
}

fn parts<S: ConstrainedSystem>(scaled: &Scaled<S>) -> Vec<Part> {
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
    let mut found: Vec<Part> = Vec::new();
    let mut part_of = |root: usize, found: &mut Vec<Part>| {
        if of[root] == usize::MAX {
            of[root] = found.len();
            found.push(Part {
                rows: Vec::new(),
                columns: Vec::new(),
                ending: Ending::Open,
                square: 0.0,
                worst: 0.0,
                damping: FIRST_DAMPING,
                idle: 0,
                active: true,
            });
        }
        of[root]
    };
    for i in 0..scaled.rows() {
        // a row without velocities is in a part of its own with whatever velocity is first: it stays as it is
        let first = pattern.row(i).next().map_or(0, |e| pattern.col_idx[e]);
        let at = part_of(find(&mut root, first), &mut found);
        found[at].rows.push(i);
    }
    for v in 0..pattern.cols {
        let r = find(&mut root, v);
        if of[r] != usize::MAX {
            found[of[r]].columns.push(v);
        }
    }
    found
}

impl<'s, S: ConstrainedSystem> Descent<'s, S> {
    pub fn new(system: &'s S, t: f64, q: &[f64], targets: &[usize]) -> Result<Self, SystemError> {
        let scaled = Scaled::new(system, t, q, targets)?;
        let (rows, n) = (scaled.pattern.rows, scaled.pattern.cols);
        Ok(Self {
            parts: parts(&scaled),
            solver: LeastNorm::new(&scaled.pattern),
            mu: vec![1.0; rows],
            r: vec![0.0; rows],
            y: vec![0.0; n],
            dv: vec![0.0; n],
            gradient: vec![0.0; n],
            trial: q.to_vec(),
            scaled,
        })
    }

    /// These velocities keep their coordinate from now on.
    pub fn lock(&mut self, locked: &[usize]) {
        locked.iter().for_each(|&v| self.scaled.locked[v] = true);
    }

    /// Φ and C at (t, q), and what is open in each part.
    pub fn evaluate(&mut self, t: f64, q: &[f64]) -> Result<(), SystemError> {
        self.scaled.evaluate(t, q)?;
        for p in &mut self.parts {
            (p.square, p.worst) = measure(&self.scaled.phi, &p.rows);
        }
        Ok(())
    }

    /// Parts open by more than `tolerance` are under way again.
    pub fn judge(&mut self, tolerance: f64) {
        for p in &mut self.parts {
            p.active = p.worst > tolerance;
            p.ending = if p.active { Ending::Open } else { Ending::Closed };
            (p.damping, p.idle) = (FIRST_DAMPING, 0);
        }
    }

    /// Parts that gain nothing any more and are open by no more than this are as closed as their drawing allows.
    pub fn accept_last_digits(&mut self, open: f64) {
        let stays = |p: &Part| matches!(p.ending, Ending::AtRest | Ending::Unfinished);
        for p in self.parts.iter_mut().filter(|p| stays(p) && p.worst <= open) {
            p.ending = Ending::Closed;
        }
    }

    /// Parts that are closed the wrong way round are not closed.
    pub fn turn_over(&mut self, q: &[f64]) -> Vec<usize> {
        let rows = self.scaled.system.turned_over(q);
        for p in self.parts.iter_mut().filter(|p| p.ending == Ending::Closed) {
            if rows.iter().any(|i| p.rows.contains(i)) {
                (p.ending, p.square) = (Ending::TurnedOver, f64::INFINITY);
            }
        }
        rows
    }

    pub fn open(&self) -> impl Iterator<Item = &Part> {
        self.parts.iter().filter(|p| p.ending != Ending::Closed)
    }

    /// Largest |Φ| in natural scales.
    pub fn worst(&self) -> f64 {
        self.parts.iter().fold(0.0, |m: f64, p| m.max(p.worst))
    }

    /// Coordinates of part i from one position to another.
    pub fn copy_part(&self, i: usize, from: &[f64], to: &mut [f64]) {
        copy(self.scaled.system, &self.parts[i].columns, from, to);
    }

    /// The least move (in reaches) that the linear conditions ask of the active parts; `ahead` are the targets' steps.
    fn least_move(&mut self, ahead: &[f64]) {
        self.mu.fill(1.0);
        self.r.fill(0.0);
        for p in self.parts.iter().filter(|p| p.active) {
            let mu = (p.damping * p.worst.min(1.0).powi(2)).max(LEAST_DAMPING);
            for &i in &p.rows {
                self.mu[i] = mu;
                self.r[i] = -self.scaled.phi[i];
            }
        }
        let rows = self.scaled.rows();
        for (k, x) in ahead.iter().enumerate() {
            self.mu[rows + k] = LEAST_DAMPING;
            self.r[rows + k] = *x;
            self.scaled.c[self.scaled.pattern.row_ptr[rows + k]] = 1.0;
        }
        self.solver.factor(&self.scaled.c, &self.mu);
        self.solver.solve(&self.r, &mut self.y);
    }

    /// The move (in reaches) that takes the targets `ahead` by these steps with the loops closed to first order.
    pub fn step_ahead(&mut self, ahead: &[f64]) -> &[f64] {
        for p in &mut self.parts {
            (p.active, p.damping) = (true, 0.0);
        }
        self.least_move(ahead);
        &self.y
    }

    /// q moved by `self.y`, left in `self.trial`.
    fn take(&mut self, q: &[f64]) {
        self.trial.copy_from_slice(q);
        for (d, (y, reach)) in self.dv.iter_mut().zip(self.y.iter().zip(&self.scaled.reach)) {
            *d = y * reach;
        }
        self.scaled.system.step(&mut self.trial, &self.dv);
        self.scaled.system.normalise(&mut self.trial);
    }

    /// Which parts are at rest: |Cᵀ Φ| against |Φ|.
    fn rest(&mut self) {
        self.gradient.fill(0.0);
        for i in 0..self.scaled.rows() {
            for e in self.scaled.pattern.row(i) {
                self.gradient[self.scaled.pattern.col_idx[e]] += self.scaled.c[e] * self.scaled.phi[i];
            }
        }
        for p in self.parts.iter_mut().filter(|p| p.active) {
            let slope = p.columns.iter().map(|&v| self.gradient[v].powi(2)).sum::<f64>();
            let flat = |part: f64| slope <= part * part * p.square;
            let idle = p.idle >= PATIENCE;
            if flat(AT_REST) || idle && flat(NEARLY_AT_REST) {
                (p.ending, p.active) = (Ending::AtRest, false);
            } else if idle || p.damping > LARGEST_DAMPING {
                (p.ending, p.active) = (Ending::Unfinished, false);
            }
        }
    }

    /// Lower |Φ|² of all parts that are not closed until each is closed, at rest, or out of iterations.
    ///
    /// Leaves Φ and C of q. Returns the iterations.
    pub fn descend(&mut self, t: f64, q: &mut [f64], tolerance: f64) -> Result<usize, SystemError> {
        self.evaluate(t, q)?;
        self.judge(tolerance);
        for iteration in 0..ITERATIONS {
            for p in self.parts.iter_mut().filter(|p| p.active && p.worst <= tolerance) {
                (p.ending, p.active) = (Ending::Closed, false);
            }
            self.rest();
            if !self.parts.iter().any(|p| p.active) {
                return Ok(iteration);
            }
            self.least_move(&[]);
            let mut promised = vec![0.0; self.parts.len()];
            for (p, promised) in self.parts.iter().zip(&mut promised).filter(|(p, _)| p.active) {
                let largest = p.columns.iter().fold(0.0, |m: f64, &v| m.max(self.y[v].abs()));
                if largest > LARGEST_MOVE {
                    p.columns.iter().for_each(|&v| self.y[v] *= LARGEST_MOVE / largest);
                }
                let left = |&i: &usize| (self.scaled.phi[i] + self.scaled.along(i, &self.y)).powi(2);
                *promised = p.square - p.rows.iter().map(left).sum::<f64>();
            }
            self.take(q);
            let tried = match self.scaled.evaluate(t, &self.trial) {
                Ok(()) => true,
                Err(SystemError::NotFinite { .. }) => false,
                Err(e) => return Err(e),
            };
            let mut refused = false;
            for (p, promised) in self.parts.iter_mut().zip(promised).filter(|(p, _)| p.active) {
                let (square, worst) = measure(&self.scaled.phi, &p.rows);
                let gain = if tried { p.square - square } else { f64::NEG_INFINITY };
                if gain > 1e-4 * promised && gain > 0.0 {
                    p.damping *= match gain / promised {
                        x if x > 0.75 => 0.2,
                        x if x < 0.25 => 3.0,
                        _ => 1.0,
                    };
                    p.idle = if gain > GAIN * p.square { 0 } else { p.idle + 1 };
                    (p.square, p.worst) = (square, worst);
                } else {
                    refused = true;
                    // where the damping has fallen to nothing, the first that matters
                    p.damping = (4.0 * p.damping).max(LEAST_DAMPING / p.worst.min(1.0).powi(2));
                    p.idle += 1;
                    copy(self.scaled.system, &p.columns, q, &mut self.trial);
                }
            }
            q.copy_from_slice(&self.trial);
            if refused {
                self.evaluate(t, q)?;
            }
        }
        for p in self.parts.iter_mut().filter(|p| p.active) {
            (p.ending, p.active) = (Ending::Unfinished, false);
        }
        Ok(ITERATIONS)
    }

    /// Close these parts to their round-off: steps without damping for as long as they gain.
    pub fn polish(&mut self, t: f64, q: &mut [f64], part: impl Fn(usize) -> bool) -> Result<usize, SystemError> {
        self.evaluate(t, q)?;
        self.judge(0.0);
        self.parts.iter_mut().enumerate().for_each(|(i, p)| p.active &= part(i));
        for iteration in 0..LAST {
            if !self.parts.iter().any(|p| p.active) {
                return Ok(iteration);
            }
            self.parts.iter_mut().for_each(|p| p.damping = 0.0);
            self.least_move(&[]);
            self.take(q);
            self.scaled.evaluate(t, &self.trial)?;
            for p in self.parts.iter_mut().filter(|p| p.active) {
                let (square, worst) = measure(&self.scaled.phi, &p.rows);
                p.active = worst > f64::EPSILON && worst < 0.5 * p.worst;
                if worst < p.worst {
                    (p.square, p.worst) = (square, worst);
                } else {
                    copy(self.scaled.system, &p.columns, q, &mut self.trial);
                }
            }
            q.copy_from_slice(&self.trial);
            self.evaluate(t, q)?;
        }
        Ok(LAST)
    }

    /// Another start for the parts that are not closed: the drawing, turned irregularly by more with each attempt.
    ///
    /// Of a large part only what meets an open row starts again; every third attempt all of it does.
    pub fn start_again(&mut self, t: f64, q: &mut [f64], drawn: &[f64], attempt: usize) -> Result<(), SystemError> {
        self.evaluate(t, q)?;
        self.y.fill(0.0);
        let amplitude = 0.1 + 0.1 * attempt as f64;
        for p in self.parts.iter().filter(|p| p.ending != Ending::Closed) {
            let mut again = vec![false; self.y.len()];
            let open = if attempt % 3 == 0 { 0.0 } else { 0.05 * p.worst };
            for &i in p.rows.iter().filter(|&&i| self.scaled.phi[i].abs() >= open) {
                self.scaled.pattern.row(i).for_each(|e| again[self.scaled.pattern.col_idx[e]] = true);
            }
            let columns: Vec<usize> = p.columns.iter().copied().filter(|&v| again[v]).collect();
            copy(self.scaled.system, &columns, drawn, q);
            for &v in columns.iter().filter(|&&v| !self.scaled.locked[v]) {
                self.y[v] = amplitude * irregular(v, attempt);
            }
        }
        self.take(q);
        q.copy_from_slice(&self.trial);
        Ok(())
    }
}

/// |Φ|² and largest |Φ| of these rows.
fn measure(phi: &[f64], rows: &[usize]) -> (f64, f64) {
    rows.iter().fold((0.0, 0.0), |(square, worst): (f64, f64), &i| (square + phi[i] * phi[i], worst.max(phi[i].abs())))
}

fn copy<S: ConstrainedSystem>(system: &S, columns: &[usize], from: &[f64], to: &mut [f64]) {
    for &v in columns {
        let range = system.coordinates_of(v);
        to[range.clone()].copy_from_slice(&from[range]);
    }
}

/// Numbers in (−1, 1) without a pattern, always the same: multiples of the golden ratio, mixed.
fn irregular(v: usize, attempt: usize) -> f64 {
    let mut x =
        (v as u64 + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ (attempt as u64).wrapping_mul(0xd1b5_4a32_d192_ed03);
    x ^= x >> 32;
    x = x.wrapping_mul(0x9e37_79b9_7f4a_7c15);
    x ^= x >> 29;
    (x >> 11) as f64 / (1u64 << 52) as f64 - 1.0
}
