//! The equations of motion in the rates of as many actuators as there are degrees of freedom.
//!
//! ```text
//! w = Eᵀ v    v = R w,  R = Dᵀ B⁻ᵀ    v' = R w' + σ    τ = M_a w' + c,   M_a = Rᵀ M R,  c = Rᵀ (M σ − h)
//! ```
//!
//! R are the transmission ratios: each row the rate of a velocity per rate of an actuator, the others held. Rotations that
//! move nothing else (rods between balls) need no actuator: no effort acts on them, and R is what costs least,
//!
//! ```text
//! R = Dᵀ M_d⁻¹ B S⁻¹    M_a = S⁻¹,   S = Bᵀ M_d⁻¹ B
//! ```
//!
//! E is the same everywhere where the actuators stand in the tree, and then it is not evaluated again. An evaluation
//! costs that of the recursion for k partial velocities, or of the mass matrix where k is nearly n and that costs less;
//! after set-up nothing is allocated.

use crate::error::AnalysisError;
use crate::inverse::{Inverse, InverseScratch};
use crate::plausibility::idle;
use partita_math::dense;
use partita_math::tolerance;
use partita_model::Model;
use partita_system::actuation;
use partita_system::prelude::*;
use partita_system::system::Tangent;
use partita_system::{start, Size, SystemError};
use std::sync::Arc;

/// Memory for the equations of a mechanism in the rates of its actuators.
pub struct Actuated {
    inverse: Arc<Inverse>,
    memory: InverseScratch,
    /// Degrees of freedom, those included that need no actuator.
    all: usize,
    /// The mechanism without gravity, once it was needed.
    light: Option<Model>,
    /// B (all x k), and in natural scales, factored, where no degree of freedom is without an actuator; pivots.
    b: Vec<f64>,
    pivots: Vec<usize>,
    /// Right-hand sides (all x n): Rᵀ, or M_d⁻¹ B column by column.
    sides: Vec<f64>,
    /// S in natural scales, factored.
    responses: Vec<f64>,
    /// |k_s| of each actuator where this was made: scales.
    lengths: Vec<f64>,
    column: Vec<f64>,
    /// b of the rows of the actuated model.
    rows: Vec<f64>,
    /// R (n x k).
    pub ratios: Vec<f64>,
    /// σ (n): v' for w' = 0.
    pub drift: Vec<f64>,
    /// M_a (k x k).
    pub mass: Vec<f64>,
    /// c (k): the efforts for w' = 0.
    pub bias: Vec<f64>,
}

impl Actuated {
    /// For positions like (t, q).
    ///
    /// # Errors
    /// `Argument` where there are not as many actuators as degrees of freedom, idle rotations aside, and where the position
    /// is singular.
    pub fn new(inverse: Arc<Inverse>, t: f64, q: &[f64]) -> Result<Self, AnalysisError> {
        let released = inverse.released().clone();
        let rank = start::analyse(&*released, t, q)?.rank;
        let (n, s) = (released.size().nv, inverse.count());
        let all = n - rank;
        let spins = idle(&released).len().min(all);
        let k = all - spins;
        if s != k && s != all {
            let message = format!(
                "there {} {s} actuator{}, but {k} degree{} of freedom{}; name {k}",
                if s == 1 { "is" } else { "are" },
                if s == 1 { "" } else { "s" },
                if k == 1 { "" } else { "s" },
                if spins > 0 {
                    format!(" beside {spins} idle rotation{}", if spins == 1 { "" } else { "s" })
                } else {
                    String::new()
                },
            );
            return Err(AnalysisError::Argument { argument: "actuators", message });
        }
        let mut memory = inverse.memory(rank);
        start::choose_partition(&mut memory.reduction, t, q, None, None)?;
        inverse.columns(t, q, &mut memory)?;
        // an actuator that acts on nothing has no scale, and is found to be singular
        let lengths =
            inverse.lengths2(t, q, &mut memory)?.into_iter().map(|x| x.sqrt().max(f64::MIN_POSITIVE)).collect();
        let rows = vec![0.0; inverse.actuated().size().rows];
        Ok(Self {
            inverse,
            memory,
            all,
            light: None,
            b: vec![0.0; all * s],
            pivots: vec![0; s],
            sides: vec![0.0; all * n],
            responses: vec![0.0; s * s],
            lengths,
            column: vec![0.0; s],
            rows,
            ratios: vec![0.0; n * s],
            drift: vec![0.0; n],
            mass: vec![0.0; s * s],
            bias: vec![0.0; s],
        })
    }

    /// Sizes of the mechanism without drives.
    pub fn size(&self) -> Size {
        self.inverse.released().size()
    }

    /// w = Eᵀ v at the position of the last `evaluate`.
    pub fn rates(&self, v: &[f64]) -> Vec<f64> {
        self.memory.columns.iter().map(|column| column.iter().map(|&(i, e)| e * v[i]).sum()).collect()
    }

    /// R, σ, M_a and c at (t, q, v), v as the constraints allow.
    ///
    /// # Errors
    /// `Argument` where the actuators cannot cause every motion; where the system cannot be evaluated.
    pub fn evaluate(&mut self, t: f64, q: &[f64], v: &[f64]) -> Result<(), AnalysisError> {
        let (inverse, k) = (self.inverse.clone(), self.pivots.len());
        if !inverse.is_constant() {
            inverse.columns(t, q, &mut self.memory)?;
        }
        if self.all > k {
            return self.beside_idle(t, q, v);
        }
        let r = &mut self.memory.reduction;
        r.position(t, q)?;
        match r.tangent(t) {
            // the coordinates chosen elsewhere do not serve here; others may
            Err(SystemError::Singular { .. }) => start::choose_partition(r, t, q, None, None)?,
            other => other?,
        }
        actuation::reduced(&r.at.dt, k, self.memory.columns.iter().map(Vec::as_slice), &mut self.b);
        self.factor(t)?;
        let r = &mut self.memory.reduction;
        // Bᵀ u = w: B times a row of R is a row of Dᵀ
        let (scales, n) = (r.scales(), self.drift.len());
        for (j, (row, &i)) in self.sides.chunks_exact_mut(n).zip(&r.planned.partition.independent).enumerate() {
            row.iter_mut().zip(r.at.dt[j..].iter().step_by(k)).for_each(|(x, d)| *x = d * scales[i]);
        }
        dense::lu_solve_many(&self.b, k, &self.pivots, &mut self.sides, n);
        for (j, (row, length)) in self.sides.chunks_exact(n).zip(&self.lengths).enumerate() {
            self.ratios[j..].iter_mut().step_by(k).zip(row).for_each(|(x, side)| *x = side / length);
        }
        r.at.v.copy_from_slice(v);
        r.velocity(t, q)?;
        self.accelerate(t, q, v)?;
        let r = &mut self.memory.reduction;
        for ((x, delta), row) in self.drift.iter_mut().zip(&r.at.delta).zip(self.ratios.chunks_exact(k)) {
            *x = delta + dense::dot(row, &self.column);
        }
        let tangent = Tangent { k, dt: &self.ratios, delta: &self.drift };
        r.system.project(t, q, v, &tangent, &mut r.scratch, &mut self.mass, &mut self.bias)?;
        self.bias.iter_mut().for_each(|x| *x = -*x);
        Ok(())
    }

    /// Bᵀ u' for w' = 0 in `column`: Eᵀ v' = −b_E with v' = δ + Dᵀ u'.
    fn accelerate(&mut self, t: f64, q: &[f64], v: &[f64]) -> Result<(), AnalysisError> {
        let inverse = self.inverse.clone();
        if inverse.is_constant() {
            self.column.fill(0.0);
        } else {
            inverse.biases((t, q, v), &mut self.memory, &mut self.rows, &mut self.column)?;
        }
        let delta = &self.memory.reduction.at.delta;
        for (x, column) in self.column.iter_mut().zip(&self.memory.columns) {
            *x = column.iter().fold(-*x, |x, &(i, e)| x - e * delta[i]);
        }
        Ok(())
    }

    /// [`evaluate`](Self::evaluate) where rotations need no actuator.
    fn beside_idle(&mut self, t: f64, q: &[f64], v: &[f64]) -> Result<(), AnalysisError> {
        let (all, k) = (self.all, self.pivots.len());
        let r = &mut self.memory.reduction;
        for attempt in 0..2 {
            for (x, &i) in self.sides.iter_mut().zip(&r.planned.partition.independent) {
                *x = v[i];
            }
            match r.evaluate(t, q, &self.sides[..all]) {
                Err(SystemError::Singular { .. }) if attempt == 0 => start::choose_partition(r, t, q, None, None)?,
                other => {
                    other?;
                    break;
                }
            }
        }
        actuation::reduced(&r.at.dt, all, self.memory.columns.iter().map(Vec::as_slice), &mut self.b);
        self.accelerate(t, q, v)?;
        let r = &self.memory.reduction;
        // M_d⁻¹ B, column by column
        for (j, side) in self.sides.chunks_exact_mut(all).take(k).enumerate() {
            side.iter_mut().zip(self.b[j..].iter().step_by(k)).for_each(|(x, b)| *x = *b);
            dense::cholesky_solve(&r.at.md_factor, all, side);
        }
        for (i, side) in self.sides.chunks_exact(all).take(k).enumerate() {
            for j in 0..k {
                let s: f64 = side.iter().zip(self.b[j..].iter().step_by(k)).map(|(x, b)| x * b).sum();
                self.responses[i * k + j] = s / (self.lengths[i] * self.lengths[j]);
            }
        }
        let factored = dense::cholesky(&mut self.responses, k).is_ok();
        if !factored || (0..k).any(|i| self.responses[i * k + i] < tolerance::SINGULAR_PIVOT) {
            return Err(self.singular(t));
        }
        // c = S⁻¹ (Bᵀ u' for w' = 0 − Bᵀ u' without efforts)
        for (i, c) in self.bias.iter_mut().enumerate() {
            let free: f64 = r.at.vdot_independent.iter().zip(self.b[i..].iter().step_by(k)).map(|(x, b)| x * b).sum();
            *c = (self.column[i] - free) / self.lengths[i];
        }
        dense::cholesky_solve(&self.responses, k, &mut self.bias);
        self.bias.iter_mut().zip(&self.lengths).for_each(|(c, length)| *c /= length);
        for (i, row) in self.mass.chunks_exact_mut(k).enumerate() {
            row.fill(0.0);
            row[i] = 1.0;
            dense::cholesky_solve(&self.responses, k, row);
            row.iter_mut().zip(&self.lengths).for_each(|(x, length)| *x /= length * self.lengths[i]);
        }
        for (l, d) in r.at.dt.chunks_exact(all).enumerate() {
            for (x, side) in self.column.iter_mut().zip(self.sides.chunks_exact(all)) {
                *x = dense::dot(d, side);
            }
            for (j, x) in self.ratios[l * k..(l + 1) * k].iter_mut().enumerate() {
                *x = (0..k).map(|i| self.column[i] * self.mass[i * k + j]).sum();
            }
            self.drift[l] =
                r.at.delta[l] + dense::dot(d, &r.at.vdot_independent) + dense::dot(&self.column, &self.bias);
        }
        Ok(())
    }

    /// Efforts (k) that carry the constant gravity at (t, q): the difference to the same mechanism without it, which is made
    /// at the first call. Allocates.
    ///
    /// # Errors
    /// Where the system cannot be evaluated.
    pub fn gravity(&mut self, t: f64, q: &[f64], v: &[f64]) -> Result<Vec<f64>, AnalysisError> {
        self.evaluate(t, q, v)?;
        let k = self.pivots.len();
        let mut out = vec![0.0; k];
        let heavy: &Model = self.inverse.released();
        let light = match self.light.take() {
            Some(light) => light,
            None => heavy.with_parameters(&[("gravity", &[0.0; 3])])?,
        };
        for (model, sign) in [(heavy, 1.0), (&light, -1.0)] {
            let mut s = model.scratch();
            let size = model.size();
            let (mut phi, mut c) = (vec![0.0; size.holonomic], vec![0.0; model.pattern().nnz()]);
            let (mut a, mut residual) = (vec![0.0; size.rows], vec![0.0; size.nv]);
            model.position(t, q, &mut s, &mut phi, &mut c, &mut a)?;
            model.velocity(t, q, v, &mut s, &mut a)?;
            model.inverse_dynamics(t, q, v, &vec![0.0; size.nv], &mut s, &mut residual)?;
            for (x, row) in residual.iter().zip(self.ratios.chunks_exact(k)) {
                dense::axpy(sign * x, row, &mut out);
            }
        }
        self.light = Some(light);
        Ok(out)
    }

    /// Smallest singular value of the set at (t, q), see [`Actuation::margin`](actuation::Actuation::margin); the best
    /// coordinates there are used from then on. Allocates.
    ///
    /// # Errors
    /// Where the position is singular.
    pub fn margin(&mut self, t: f64, q: &[f64]) -> Result<f64, AnalysisError> {
        Ok(self.inverse.set(t, q, &mut self.memory)?.margin())
    }

    /// Factor B in natural scales.
    fn factor(&mut self, t: f64) -> Result<(), AnalysisError> {
        let k = self.pivots.len();
        let r = &self.memory.reduction;
        for (row, &i) in self.b.chunks_exact_mut(k).zip(&r.planned.partition.independent) {
            row.iter_mut().zip(&self.lengths).for_each(|(x, length)| *x *= r.scales()[i] / length);
        }
        // at least as large as the margin where the coordinates are good
        let smallest = |b: &[f64]| (0..k).fold(f64::INFINITY, |m: f64, i| m.min(b[i * k + i].abs()));
        let factored = dense::lu(&mut self.b, k, &mut self.pivots).is_ok();
        if factored && smallest(&self.b) > tolerance::SINGULAR_PIVOT {
            return Ok(());
        }
        Err(self.singular(t))
    }

    fn singular(&self, t: f64) -> AnalysisError {
        let message = format!(
            "at t = {t:.6} s the actuators {} cannot cause every motion (type II singularity): their effects depend on \
             each other up to rounding; name others, or move away from this position",
            self.inverse.names()
        );
        AnalysisError::Argument { argument: "actuators", message }
    }
}
