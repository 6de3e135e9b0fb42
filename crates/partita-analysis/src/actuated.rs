//! The equations of motion in the rates of as many actuators as there are degrees of freedom.
//!
//! ```text
//! w = Eᵀ v    v = R w,  R = Dᵀ B⁻ᵀ    v' = R w' + σ    τ = M_a w' + c,   M_a = Rᵀ M R,  c = Rᵀ (M σ − h)
//! ```
//!
//! R are the transmission ratios: each row the rate of a velocity per rate of an actuator, the others held. An evaluation
//! costs that of the recursion for k partial velocities; no matrix of n x n is made, and after set-up nothing is
//! allocated.

use crate::error::AnalysisError;
use crate::inverse::{Inverse, Room};
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
    room: Room,
    /// B in natural scales, factored, and its pivots.
    b: Vec<f64>,
    pivots: Vec<usize>,
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
    /// `Argument` where there are not as many actuators as degrees of freedom, and where the position is singular.
    pub fn new(inverse: Arc<Inverse>, t: f64, q: &[f64]) -> Result<Self, AnalysisError> {
        let released = inverse.released().clone();
        let rank = start::analyse(&*released, t, q)?.rank;
        let (n, s) = (released.size().nv, inverse.count());
        let k = n - rank;
        if s != k {
            let message = format!(
                "there {} {s} actuator{}, but {k} degree{} of freedom; name {k}",
                if s == 1 { "is" } else { "are" },
                if s == 1 { "" } else { "s" },
                if k == 1 { "" } else { "s" },
            );
            return Err(AnalysisError::Argument { argument: "actuators", message });
        }
        let mut room = inverse.room(rank);
        start::choose_partition(&mut room.reduction, t, q, None, None)?;
        inverse.columns(t, q, &mut room)?;
        // an actuator that acts on nothing has no scale, and is found to be singular
        let lengths = inverse.lengths2(t, q, &mut room)?.into_iter().map(|x| x.sqrt().max(f64::MIN_POSITIVE)).collect();
        let rows = vec![0.0; inverse.actuated().size().rows];
        Ok(Self {
            inverse,
            room,
            b: vec![0.0; k * k],
            pivots: vec![0; k],
            lengths,
            column: vec![0.0; k],
            rows,
            ratios: vec![0.0; n * k],
            drift: vec![0.0; n],
            mass: vec![0.0; k * k],
            bias: vec![0.0; k],
        })
    }

    /// Sizes of the mechanism without drives.
    pub fn size(&self) -> Size {
        self.inverse.released().size()
    }

    /// w = Eᵀ v at the position of the last `evaluate`.
    pub fn rates(&self, v: &[f64]) -> Vec<f64> {
        self.room.columns.iter().map(|column| column.iter().map(|&(i, e)| e * v[i]).sum()).collect()
    }

    /// R, σ, M_a and c at (t, q, v), v as the constraints allow.
    ///
    /// # Errors
    /// `Argument` where the actuators cannot cause every motion; where the system cannot be evaluated.
    pub fn evaluate(&mut self, t: f64, q: &[f64], v: &[f64]) -> Result<(), AnalysisError> {
        let (inverse, k) = (self.inverse.clone(), self.pivots.len());
        inverse.columns(t, q, &mut self.room)?;
        let r = &mut self.room.reduction;
        r.position(t, q)?;
        match r.tangent(t) {
            // the coordinates chosen elsewhere do not serve here; others may
            Err(SystemError::Singular { .. }) => start::choose_partition(r, t, q, None, None)?,
            other => other?,
        }
        actuation::reduced(&r.dt, k, self.room.columns.iter().map(Vec::as_slice), &mut self.b);
        self.factor(t)?;
        let r = &mut self.room.reduction;
        // Bᵀ u = w: B times a row of R is a row of Dᵀ
        let scales = r.scales();
        for (row, d) in self.ratios.chunks_exact_mut(k).zip(r.dt.chunks_exact(k)) {
            row.iter_mut().zip(d).zip(&r.partition.independent).for_each(|((x, d), &i)| *x = d * scales[i]);
            dense::lu_solve(&self.b, k, &self.pivots, row);
            row.iter_mut().zip(&self.lengths).for_each(|(x, length)| *x /= length);
        }
        r.v.copy_from_slice(v);
        r.velocity(t, q)?;
        // Eᵀ σ = −b_E with σ = [0; ξ] + Dᵀ u
        inverse.biases((t, q, v), &mut self.room, &mut self.rows, &mut self.column)?;
        let r = &mut self.room.reduction;
        for (x, column) in self.column.iter_mut().zip(&self.room.columns) {
            *x = column.iter().fold(-*x, |x, &(i, e)| x - e * r.delta[i]);
        }
        for ((x, delta), row) in self.drift.iter_mut().zip(&r.delta).zip(self.ratios.chunks_exact(k)) {
            *x = delta + dense::dot(row, &self.column);
        }
        let tangent = Tangent { k, dt: &self.ratios, delta: &self.drift };
        r.system.project(t, q, v, &tangent, &mut r.scratch, &mut self.mass, &mut self.bias)?;
        self.bias.iter_mut().for_each(|x| *x = -*x);
        Ok(())
    }

    /// Efforts (k) that carry the constant gravity, after `evaluate` at the same state: the difference to the same mechanism
    /// without it. Allocates.
    ///
    /// # Errors
    /// Where the system cannot be evaluated.
    pub fn gravity(&self, t: f64, q: &[f64], v: &[f64]) -> Result<Vec<f64>, AnalysisError> {
        let k = self.pivots.len();
        let mut out = vec![0.0; k];
        let heavy: &Model = self.inverse.released();
        let light = heavy.with_parameters(&[("gravity", &[0.0; 3])])?;
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
        Ok(out)
    }

    /// Smallest singular value of the set at (t, q), see [`Actuation::margin`](actuation::Actuation::margin); the best
    /// coordinates there are used from then on. Allocates.
    ///
    /// # Errors
    /// Where the position is singular.
    pub fn margin(&mut self, t: f64, q: &[f64]) -> Result<f64, AnalysisError> {
        Ok(self.inverse.set(t, q, &mut self.room)?.margin())
    }

    /// Factor B in natural scales.
    fn factor(&mut self, t: f64) -> Result<(), AnalysisError> {
        let k = self.pivots.len();
        let r = &self.room.reduction;
        for (row, &i) in self.b.chunks_exact_mut(k).zip(&r.partition.independent) {
            row.iter_mut().zip(&self.lengths).for_each(|(x, length)| *x *= r.scales()[i] / length);
        }
        // at least as large as the margin where the coordinates are good
        let smallest = |b: &[f64]| (0..k).fold(f64::INFINITY, |m: f64, i| m.min(b[i * k + i].abs()));
        let factored = dense::lu(&mut self.b, k, &mut self.pivots).is_ok();
        if factored && smallest(&self.b) > tolerance::SINGULAR_PIVOT {
            return Ok(());
        }
        let message = format!(
            "at t = {t:.6} s the actuators {} cannot cause every motion (type II singularity): their effects depend on \
             each other up to rounding; name others, or move away from this position",
            self.inverse.names()
        );
        Err(AnalysisError::Argument { argument: "actuators", message })
    }
}
