//! The closing conditions and the goals at one position, in natural scales, and the least displacements that change
//! them.

use super::goal::Target;
use crate::instant::Levels;
use partita_math::elimination::Pattern;
use partita_math::least_norm::LeastNorm;
use partita_math::tolerance;
use partita_model::Model;
use partita_system::manifold::{close, Closed, ClosingScratch, ClosureError, Linearization, Part, Residuals, Rule};
use partita_system::messages::not_finite;
use partita_system::prelude::*;
use partita_system::SystemError;

/// Damping of ignored rows. Unit: squares of singular values in natural scales. Reason: they cause no visible
/// displacement.
const IGNORED: f64 = 1e12;

/// Role of a row in a displacement.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Duty {
    /// It must be satisfied.
    Hard,
    /// Its square is minimised.
    Soft,
    /// It is ignored.
    Idle,
}

/// `Φ_i / L_i` and `C_ij displacement_j / L_i`, and behind them the same for each goal's difference from its target.
pub(crate) struct Field<'m> {
    pub model: &'m Model,
    pub targets: &'m [Target],
    pub t: f64,
    levels: Levels<'m, Model>,
    solver: LeastNorm,
    pub pattern: Pattern,
    pub displacement: Vec<f64>,
    length: Vec<f64>,
    /// Residuals of the closing conditions, then of the goals.
    pub phi: Vec<f64>,
    pub c: Vec<f64>,
    /// Values of the goals where last evaluated: angles are counted on from there.
    pub y: Vec<f64>,
    next: Vec<f64>,
    /// Targets of the goals.
    pub aims: Vec<f64>,
    pub duty: Vec<Duty>,
    mu: Vec<f64>,
    r: Vec<f64>,
    memory: ClosingScratch,
    /// Displacement in characteristic displacements.
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
            displacement: model.structure().displacements().collect(),
            length: (0..size.holonomic).map(|i| model.structure().rows[i].size()).collect(),
            phi: vec![0.0; rows],
            c: vec![0.0; pattern.nnz()],
            y: vec![0.0; targets.len()],
            next: vec![0.0; targets.len()],
            aims: vec![0.0; targets.len()],
            duty: vec![Duty::Hard; rows],
            mu: vec![tolerance::DAMPING; rows],
            r: vec![0.0; rows],
            memory: ClosingScratch::default(),
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
        for (k, x) in self.targets.iter().enumerate() {
            let near = x.near(&self.y, k);
            self.next[k] = x.value_near(self.model, q, &self.rest, &mut self.levels.scratch, near);
        }
        self.y.copy_from_slice(&self.next);
    }

    /// Residuals and their derivatives at q for the targets.
    ///
    /// # Errors
    /// `NotFinite` where one of them is; `y` stays as it was.
    pub fn evaluate(&mut self, q: &[f64]) -> Result<(), SystemError> {
        self.levels.position(self.t, q)?;
        let m = self.closings();
        for i in 0..m {
            self.phi[i] = self.levels.phi[i] / self.length[i];
            for e in self.pattern.row(i) {
                self.c[e] = self.levels.c[e] * self.displacement[self.pattern.col_idx[e]] / self.length[i];
            }
        }
        for (k, x) in self.targets.iter().enumerate() {
            let s = &mut self.levels.scratch;
            let near = x.near(&self.y, k);
            self.next[k] = x.value_near(self.model, q, &self.rest, s, near);
            self.phi[m + k] = (self.next[k] - self.aims[k]) / x.displacement;
            let mut e = self.pattern.row_ptr[m + k];
            x.gradient(self.model, q, near, &mut self.rest, s, |g| {
                self.c[e] = g * self.displacement[self.pattern.col_idx[e]] / x.displacement;
                e += 1;
            });
        }
        if !self.phi.iter().chain(&self.c).all(|x| x.is_finite()) {
            return Err(not_finite(self.model, self.t, &self.levels.phi, &self.levels.c));
        }
        self.y.copy_from_slice(&self.next);
        Ok(())
    }

    /// Factorise for these roles; soft rows are damped, or ignored.
    fn factor(&mut self, damping: Option<f64>) {
        for (mu, duty) in self.mu.iter_mut().zip(&self.duty) {
            *mu = match (duty, damping) {
                (Duty::Hard, _) => tolerance::DAMPING,
                (Duty::Soft, Some(damping)) => damping.max(tolerance::DAMPING),
                _ => IGNORED,
            };
        }
        self.solver.factor(&self.c, &self.mu);
    }

    /// The least displacement that changes the rows by `r`, left in `dv`.
    pub fn solve(&mut self, r: &[f64]) {
        self.solver.solve(r, &mut self.dv);
    }

    /// Factor for the hard rows alone, for [`solve`](Self::solve).
    pub fn factor_hard(&mut self) {
        self.factor(None);
    }

    /// The displacement that corrects the hard rows to first order, and with damping the soft ones, left in `dv`.
    fn newton(&mut self, damping: Option<f64>) {
        self.factor(damping);
        for (i, r) in self.r.iter_mut().enumerate() {
            let counts = self.duty[i] == Duty::Hard || self.duty[i] == Duty::Soft && damping.is_some();
            *r = if counts { -self.phi[i] } else { 0.0 };
        }
        self.solver.solve(&self.r, &mut self.dv);
    }

    /// Largest entry of `dv`.
    fn largest(&self) -> f64 {
        self.dv.iter().fold(0.0, |m: f64, x| m.max(x.abs()))
    }

    /// Goals that are coordinates are set to their targets.
    pub fn set_own(&self, q: &mut [f64]) {
        let m = self.closings();
        for (k, x) in self.targets.iter().enumerate().filter(|(k, _)| self.duty[m + k] == Duty::Hard) {
            if let Some((at, _)) = x.own() {
                q[at] = self.aims[k];
            }
        }
    }

    /// Close the hard rows from q on, ignoring the soft ones.
    ///
    /// # Errors
    /// The errors of functions that the conditions call; `NotFinite` where nothing can be evaluated at q.
    pub fn close_hard(&mut self, q: &mut [f64], rule: &Rule) -> Result<Closed, SystemError> {
        let mut memory = std::mem::take(&mut self.memory);
        let closed = close(&mut Hard(self), q, rule, &mut memory);
        self.memory = memory;
        closed
    }

    /// q displaced by `part` of `dv`.
    pub fn step(&mut self, q: &mut [f64], part: f64) {
        for (to, (x, displacement)) in self.scaled.iter_mut().zip(self.dv.iter().zip(&self.displacement)) {
            *to = part * x * displacement;
        }
        self.model.step(q, &self.scaled);
        self.model.normalise(q);
    }

    /// Row i of the derivatives times a displacement.
    pub fn along(&self, i: usize, y: &[f64]) -> f64 {
        self.pattern.row(i).map(|e| self.c[e] * y[self.pattern.col_idx[e]]).sum()
    }

    /// Residual of the rows of this role, in characteristic displacements.
    fn closure_error_of(&self, duty: Duty) -> ClosureError {
        let of = self.phi.iter().zip(&self.duty).filter(|(_, d)| **d == duty);
        ClosureError::of(of.map(|(x, _)| *x))
    }

    /// Largest residual among the rows of this role.
    pub fn worst(&self, duty: Duty) -> f64 {
        self.closure_error_of(duty).worst
    }

    /// The loop-closure row with the largest closure error, and the gap between the points (m) and directions (rad) of
    /// its joint.
    pub fn closure_error(&self) -> (usize, f64, f64) {
        let m = self.closings();
        let Some(worst) = (0..m).max_by(|&i, &j| self.phi[i].abs().total_cmp(&self.phi[j].abs())) else {
            return (0, 0.0, 0.0);
        };
        let all = &self.model.structure().rows;
        let size = |angle: bool| {
            let rows = (0..m).filter(|&i| all[i].is_angle == angle && all[i].owner == all[worst].owner);
            rows.map(|i| (self.phi[i] * self.length[i]).powi(2)).sum::<f64>().sqrt()
        };
        (worst, size(false), size(true))
    }
}

/// The hard rows alone.
struct Hard<'f, 'm>(&'f mut Field<'m>);

impl Residuals for Hard<'_, '_> {
    fn evaluate(&mut self, q: &[f64]) -> Result<(), SystemError> {
        self.0.evaluate(q)
    }
    fn closure_error(&self, _part: usize) -> ClosureError {
        self.0.closure_error_of(Duty::Hard)
    }
}

impl Linearization for Hard<'_, '_> {
    fn solve(&mut self, _q: &[f64], _parts: &[Part]) -> Result<bool, SystemError> {
        self.0.newton(None);
        Ok(true)
    }
    fn length(&self, _part: usize) -> f64 {
        self.0.largest()
    }
    fn scale(&mut self, _part: usize, by: f64) {
        self.0.dv.iter_mut().for_each(|x| *x *= by);
    }
    fn advance(&mut self, q: &mut [f64]) {
        self.0.step(q, 1.0);
    }
}

/// The soft rows, over positions at which the hard rows are satisfied.
pub(super) struct Soft<'f, 'm> {
    field: &'f mut Field<'m>,
    keeping: Rule,
    /// Whether the hard rows could be satisfied after the last step.
    kept: Result<bool, SystemError>,
    /// Values of the goals where the last step was found.
    home: Vec<f64>,
    closure_error: ClosureError,
}

impl<'f, 'm> Soft<'f, 'm> {
    /// The hard rows are satisfied again by the rule `keeping` after each step.
    pub fn new(field: &'f mut Field<'m>, keeping: Rule) -> Self {
        let home = field.y.clone();
        Self { field, keeping, kept: Ok(true), home, closure_error: ClosureError::default() }
    }
}

impl Residuals for Soft<'_, '_> {
    fn evaluate(&mut self, q: &[f64]) -> Result<(), SystemError> {
        // a permanent failure while returning to the hard rows ends the loop; a rejected step is undone
        let kept = std::mem::replace(&mut self.kept, Ok(true))?;
        self.field.y.copy_from_slice(&self.home);
        self.field.evaluate(q)?;
        self.closure_error = self.field.closure_error_of(Duty::Soft);
        if !kept {
            self.closure_error = ClosureError { square: f64::INFINITY, worst: f64::INFINITY };
        }
        Ok(())
    }
    fn closure_error(&self, _part: usize) -> ClosureError {
        self.closure_error
    }
}

impl Linearization for Soft<'_, '_> {
    fn solve(&mut self, _q: &[f64], parts: &[Part]) -> Result<bool, SystemError> {
        self.home.copy_from_slice(&self.field.y);
        self.field.newton(Some(parts[0].damping * parts[0].closure_error.square.min(1.0)));
        Ok(true)
    }
    fn length(&self, _part: usize) -> f64 {
        self.field.largest()
    }
    fn scale(&mut self, _part: usize, by: f64) {
        self.field.dv.iter_mut().for_each(|x| *x *= by);
    }
    fn advance(&mut self, q: &mut [f64]) {
        self.field.step(q, 1.0);
        self.kept = match self.field.close_hard(q, &self.keeping) {
            Err(SystemError::NotFinite { .. }) => Ok(false),
            closed => closed.map(|closed| closed.is_closed()),
        };
    }
    fn left(&self, _part: usize, _fraction: f64) -> f64 {
        let f = &self.field;
        let soft = (0..f.phi.len()).filter(|&i| f.duty[i] == Duty::Soft);
        soft.map(|i| (f.phi[i] + f.along(i, &f.dv)).powi(2)).sum()
    }
    fn least_damping(&self, _part: usize) -> Option<f64> {
        Some(tolerance::DAMPING / self.closure_error.square.clamp(f64::MIN_POSITIVE, 1.0))
    }
}
