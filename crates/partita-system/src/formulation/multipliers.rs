//! The full equations with multipliers, solved in the range of C: the reference the reduced forms are held against.
//!
//! `λ = −M_c⁻¹ (b + C M⁻¹ h)`, `v' = M⁻¹ (h + Cᵀ λ)`                                     (40)
//! Integrates all q and all v; after a step the remainders of S3 and S4 are removed by the least change in the mass
//! metric, (33) and (35). Dense: (n³ + n²m)/6 per evaluation. Prefer the projective form for everything but checking.

use super::reduction::Reduction;
use super::{Correction, Formulation, FormulationCounters, PartitionEvent, Review, Sample};
use crate::kinematics::projection::{dense_rows, MassProjection};
use crate::start;
use crate::system::{ConstrainedSystem, SystemError};
use partita_math::dense;

/// Range-space form with multipliers.
pub struct Multipliers<'s, S: ConstrainedSystem> {
    r: Reduction<'s, S>,
    correction: Correction,
    observes_work: bool,
    mass: Vec<f64>,
    h: Vec<f64>,
    vdot: Vec<f64>,
    lambda: Vec<f64>,
    corrections: u64,
}

impl<'s, S: ConstrainedSystem> Multipliers<'s, S> {
    /// For a system of the given rank.
    pub fn new(system: &'s S, rank: usize, correction: Correction) -> Self {
        let n = system.size().nv;
        Self {
            r: Reduction::new(system, rank),
            correction,
            observes_work: system.has_power() || system.rheonomic(),
            mass: vec![0.0; n * n],
            h: vec![0.0; n],
            vdot: vec![0.0; n],
            lambda: vec![0.0; system.size().rows],
            corrections: 0,
        }
    }

    /// v' and λ at (t, q, v), left in `self.vdot` and `self.lambda`.
    fn solve(&mut self, t: f64, q: &[f64], v: &[f64]) -> Result<(), SystemError> {
        self.r.position(t, q)?;
        self.r.v.copy_from_slice(v);
        self.r.system.velocity(t, q, v, &mut self.r.scratch, &mut self.r.b)?;
        self.r.system.dynamics(t, q, v, &mut self.r.scratch, &mut self.mass, &mut self.h)?;
        let rows = &self.r.partition.rows;
        let c = dense_rows(self.r.system, &self.r.c, rows);
        let p = MassProjection::new(self.r.system, &self.mass, &c)?;
        self.vdot.copy_from_slice(&self.h);
        dense::cholesky_solve(&p.mass, self.h.len(), &mut self.vdot); // M⁻¹ h
        let mut x = c.matvec(&self.vdot);
        for (x, &row) in x.iter_mut().zip(rows) {
            *x = -(*x + self.r.b[row]);
        }
        dense::cholesky_solve(&p.mc, x.len(), &mut x); // λ
        for (v, w) in self.vdot.iter_mut().zip(p.w.matvec(&x)) {
            *v += w;
        }
        self.lambda.fill(0.0);
        for (x, &row) in x.iter().zip(rows) {
            self.lambda[row] = *x;
        }
        Ok(())
    }

    fn orthogonal(&mut self, t: f64, y: &mut [f64]) -> Result<(), SystemError> {
        let size = self.r.size();
        let (q, rest) = y.split_at_mut(size.nq);
        let v = &mut rest[..size.nv];
        for level in 0..2 {
            self.r.position(t, q)?;
            self.r.system.velocity(t, q, v, &mut self.r.scratch, &mut self.r.b)?;
            self.r.system.dynamics(t, q, v, &mut self.r.scratch, &mut self.mass, &mut self.h)?;
            let holonomic = |i: &&usize| level == 1 || **i < size.holonomic;
            let rows: Vec<usize> = self.r.partition.rows.iter().filter(holonomic).copied().collect();
            let c = dense_rows(self.r.system, &self.r.c, &rows);
            let p = MassProjection::new(self.r.system, &self.mass, &c)?;
            if level == 0 {
                let x: Vec<f64> = rows.iter().map(|&i| self.r.phi[i]).collect();
                self.r.system.step(q, &p.correction(&x)); // (33)
            } else {
                let mut x = c.matvec(v);
                for (x, &i) in x.iter_mut().zip(&rows) {
                    *x += self.r.a[i];
                }
                for (v, d) in v.iter_mut().zip(p.correction(&x)) {
                    *v += d; // (35)
                }
            }
        }
        Ok(())
    }
}

impl<S: ConstrainedSystem> Formulation for Multipliers<'_, S> {
    fn name(&self) -> &'static str {
        "multipliers"
    }
    fn dim(&self) -> usize {
        self.controlled() + usize::from(self.observes_work)
    }
    fn controlled(&self) -> usize {
        let s = self.r.size();
        s.nq + s.nv
    }
    fn start(&mut self, t: f64, q: &[f64], v: &[f64], y: &mut [f64]) -> Result<(), SystemError> {
        start::choose_partition(&mut self.r, t, q, None, None)?; // for the rows, and for the measure at outputs
        y.fill(0.0);
        y[..q.len()].copy_from_slice(q);
        y[q.len()..q.len() + v.len()].copy_from_slice(v);
        Ok(())
    }
    fn derivative(&mut self, t: f64, y: &[f64], dy: &mut [f64]) -> Result<(), SystemError> {
        let size = self.r.size();
        let (q, rest) = y.split_at(size.nq);
        self.solve(t, q, &rest[..size.nv])?;
        self.r.system.rate(q, &rest[..size.nv], &mut dy[..size.nq]);
        dy[size.nq..size.nq + size.nv].copy_from_slice(&self.vdot);
        if self.observes_work {
            let p = self.r.system.power(t, q, &self.r.v, &mut self.r.scratch)?;
            dy[size.nq + size.nv] = p - dense::dot(&self.lambda, &self.r.a);
        }
        Ok(())
    }
    fn correct(&mut self, t: f64, y: &mut [f64]) -> Result<bool, SystemError> {
        let moved = self.r.system.normalise(&mut y[..self.r.size().nq]);
        if self.correction == Correction::None || self.r.rank() == 0 {
            return Ok(moved);
        }
        self.orthogonal(t, y)?;
        self.corrections += 1;
        Ok(true)
    }
    fn review(&mut self, _t: f64, _y: &[f64]) -> Review {
        Review::Keep
    }
    fn change(&mut self, _t: f64, _y: &mut [f64], _dy: &mut [f64]) -> Result<(), SystemError> {
        Ok(())
    }
    fn recover(&mut self, t: f64, y: &mut [f64], dy: &mut [f64]) -> Result<(), SystemError> {
        self.derivative(t, y, dy)
    }
    fn sample(&mut self, t: f64, y: &[f64], out: &mut Sample) -> Result<(), SystemError> {
        let size = self.r.size();
        let mut y = y.to_vec();
        self.r.system.normalise(&mut y[..size.nq]);
        if self.correction != Correction::None {
            for _ in 0..3 {
                self.orthogonal(t, &mut y)?;
            }
        }
        let (q, rest) = y.split_at(size.nq);
        let v = &rest[..size.nv];
        self.solve(t, q, v)?;
        out.t = t;
        out.q = q.to_vec();
        out.v = v.to_vec();
        out.vdot = self.vdot.clone();
        out.multipliers = self.lambda.clone();
        out.closure = self.r.closure();
        out.velocity_closure = self.r.velocity_closure();
        out.independent.clear();
        out.work = if self.observes_work { rest[size.nv] } else { 0.0 };
        // the measure belongs to the mechanism, not to the formulation: take it from a partition of the moment
        let rank = self.r.rank();
        let mut probe = Reduction::new(self.r.system, rank);
        start::choose_partition(&mut probe, t, q, None, None)?;
        let speeds: Vec<f64> = probe.partition.independent.iter().map(|&i| v[i]).collect();
        probe.evaluate(t, q, &speeds)?;
        out.measure.resize(size.nv, 0.0);
        probe.measure(t, q, &mut out.measure)?;
        let quality = probe.quality(t, q)?;
        out.sigma = quality.sigma;
        out.sqrt_mu = quality.sqrt_mu;
        out.independent.extend_from_slice(&probe.partition.independent);
        Ok(())
    }
    fn events(&self) -> &[PartitionEvent] {
        &[]
    }
    fn counters(&self) -> FormulationCounters {
        FormulationCounters { corrections: self.corrections, ..FormulationCounters::default() }
    }
    fn rows(&self) -> Vec<usize> {
        let mut rows = self.r.partition.rows.clone();
        rows.sort_unstable();
        rows
    }
}
