//! The closing conditions and the goals at one position, in natural scales, and least moves that change them.

use super::goal::Target;
use crate::instant::Levels;
use partita_math::elimination::Pattern;
use partita_math::least_norm::LeastNorm;
use partita_model::Model;
use partita_system::{ConstrainedSystem, SystemError};

/// Damping of rows that hold, in squares of singular values: rows weaker than its root, 1e-5, count as repeated.
const HOLDS: f64 = 1e-10;
/// Damping of rows that do not count.
const IGNORED: f64 = 1e12;

/// What a row is to a move.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Duty {
    /// It is to hold.
    Hard,
    /// Its square is to become small.
    Soft,
    /// It does not count.
    Idle,
}

/// `Φ_i / L_i` and `C_ij reach_j / L_i`, and behind them the same for each goal's difference from its aim.
pub(super) struct Field<'m> {
    pub model: &'m Model,
    pub targets: &'m [Target],
    pub t: f64,
    levels: Levels<'m, Model>,
    solver: LeastNorm,
    pub pattern: Pattern,
    pub reach: Vec<f64>,
    length: Vec<f64>,
    /// Residuals of the closing conditions, then of the goals.
    pub phi: Vec<f64>,
    pub c: Vec<f64>,
    /// Values of the goals where last evaluated: angles are counted on from there.
    pub y: Vec<f64>,
    pub duty: Vec<Duty>,
    mu: Vec<f64>,
    /// Move in reaches.
    pub dv: Vec<f64>,
    rest: Vec<f64>,
    scaled: Vec<f64>,
}

impl<'m> Field<'m> {
    pub fn new(model: &'m Model, targets: &'m [Target], t: f64) -> Self {
        let (size, all) = (model.size(), model.pattern());
        let mut row_ptr = all.row_ptr[..=size.holonomic].to_vec();
        let mut col_idx = all.col_idx[..row_ptr[size.holonomic]].to_vec();
        for x in targets {
            col_idx.extend(&x.velocities);
            row_ptr.push(col_idx.len());
        }
        let rows = size.holonomic + targets.len();
        let pattern = Pattern::new(rows, size.nv, row_ptr, col_idx);
        Self {
            model,
            targets,
            t,
            levels: Levels::new(model),
            solver: LeastNorm::new(&pattern),
            reach: (0..size.nv).map(|i| model.reach(i)).collect(),
            length: (0..size.holonomic).map(|i| model.row_reach(i).unwrap_or(1.0)).collect(),
            phi: vec![0.0; rows],
            c: vec![0.0; pattern.nnz()],
            y: vec![0.0; targets.len()],
            duty: vec![Duty::Hard; rows],
            mu: vec![HOLDS; rows],
            dv: vec![0.0; size.nv],
            rest: vec![0.0; size.nv],
            scaled: vec![0.0; size.nv],
            pattern,
        }
    }

    /// Closing conditions.
    pub fn closings(&self) -> usize {
        self.length.len()
    }

    /// Values of the goals at q; angles that are read off a pose as near to `self.y` as they can be.
    pub fn look(&mut self, q: &[f64]) {
        for (x, y) in self.targets.iter().zip(&mut self.y) {
            *y = x.value(self.model, q, &self.rest, &mut self.levels.scratch, *y);
        }
    }

    /// Residuals and their derivatives at q for these aims.
    ///
    /// # Errors
    /// `NotFinite` where one of them is.
    pub fn evaluate(&mut self, q: &[f64], aims: &[f64]) -> Result<(), SystemError> {
        self.levels.position(self.t, q)?;
        let m = self.closings();
        for i in 0..m {
            self.phi[i] = self.levels.phi[i] / self.length[i];
            for e in self.pattern.row(i) {
                self.c[e] = self.levels.c[e] * self.reach[self.pattern.col_idx[e]] / self.length[i];
            }
        }
        for (k, x) in self.targets.iter().enumerate() {
            let s = &mut self.levels.scratch;
            self.y[k] = x.value(self.model, q, &self.rest, s, self.y[k]);
            self.phi[m + k] = (self.y[k] - aims[k]) / x.reach;
            let mut e = self.pattern.row_ptr[m + k];
            x.gradient(self.model, q, &mut self.rest, s, |g| {
                self.c[e] = g * self.reach[self.pattern.col_idx[e]] / x.reach;
                e += 1;
            });
        }
        if !self.phi.iter().chain(&self.c).all(|x| x.is_finite()) {
            return Err(SystemError::NotFinite { what: "a closing condition".into(), t: self.t });
        }
        Ok(())
    }

    /// Factor for the duties; soft rows are damped by `damping`.
    pub fn factor(&mut self, damping: f64) {
        for (mu, duty) in self.mu.iter_mut().zip(&self.duty) {
            *mu = match duty {
                Duty::Hard => HOLDS,
                Duty::Soft => damping.max(HOLDS),
                Duty::Idle => IGNORED,
            };
        }
        self.solver.factor(&self.c, &self.mu);
    }

    /// The least move that changes the rows by `r`, left in `dv`.
    pub fn solve(&mut self, r: &[f64]) {
        self.solver.solve(r, &mut self.dv);
    }

    /// Take back what the rows are open by, to first order; the largest move, in reaches.
    pub fn newton(&mut self, r: &mut [f64]) -> f64 {
        for (i, r) in r.iter_mut().enumerate() {
            *r = if self.duty[i] == Duty::Idle { 0.0 } else { -self.phi[i] };
        }
        self.solver.solve(r, &mut self.dv);
        self.largest()
    }

    /// Largest entry of `dv`.
    pub fn largest(&self) -> f64 {
        self.dv.iter().fold(0.0, |m: f64, x| m.max(x.abs()))
    }

    /// q moved by `part` of `dv`.
    pub fn step(&mut self, q: &mut [f64], part: f64) {
        for (to, (x, reach)) in self.scaled.iter_mut().zip(self.dv.iter().zip(&self.reach)) {
            *to = part * x * reach;
        }
        self.model.step(q, &self.scaled);
        self.model.normalise(q);
    }

    /// Row i of the derivatives times a move.
    pub fn along(&self, i: usize, y: &[f64]) -> f64 {
        self.pattern.row(i).map(|e| self.c[e] * y[self.pattern.col_idx[e]]).sum()
    }

    /// Largest residual among the rows of this duty.
    pub fn worst(&self, duty: Duty) -> f64 {
        let of = self.phi.iter().zip(&self.duty).filter(|(_, d)| **d == duty);
        of.fold(0.0, |m: f64, (x, _)| m.max(x.abs()))
    }

    /// Sum of squares of the soft rows.
    pub fn square(&self) -> f64 {
        let soft = self.phi.iter().zip(&self.duty).filter(|(_, d)| **d == Duty::Soft);
        soft.map(|(x, _)| x * x).sum()
    }

    /// The closing row that is open most, and by how much its joint's points and directions miss each other [m, rad].
    pub fn open(&self) -> (usize, f64, f64) {
        let m = self.closings();
        let Some(worst) = (0..m).max_by(|&i, &j| self.phi[i].abs().total_cmp(&self.phi[j].abs())) else {
            return (0, 0.0, 0.0);
        };
        let owner = self.model.row_owner(worst);
        let size = |angle: bool| {
            let rows = (0..m).filter(|&i| self.model.row_is_angle(i) == angle && self.model.row_owner(i) == owner);
            rows.map(|i| (self.phi[i] * self.length[i]).powi(2)).sum::<f64>().sqrt()
        };
        (worst, size(false), size(true))
    }
}
